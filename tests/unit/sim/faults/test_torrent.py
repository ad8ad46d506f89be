"""What a hostile agent with valid keys floods the bus with."""

from __future__ import annotations

from collections import Counter
from itertools import islice

from sim.fleet.faults.torrent import torrent
from sim.fleet.keys import fresh_keys
from swarm.identity import load_identity
from swarm.protocol.codec import Codec
from swarm.protocol.seal import seal_of
from tests.support.builders import MISSION, mission, task, uav


def test_a_third_is_genuine_a_third_forged_and_a_third_others_to_say() -> None:
    fleet = mission([uav("u1"), uav("u2")], [task("t1", 1.0)])
    with fresh_keys(fleet, strangers=["hostile"]) as keys:
        hostile = seal_of(load_identity(keys.of_seat("hostile")))
        honest = seal_of(load_identity(keys.of_seat("u1")))
    assert hostile is not None
    codec = Codec(MISSION, honest)

    said = list(islice(torrent(MISSION, hostile, ["u1", "u2"]), 300))

    believed = [codec.decode(key, payload) for key, payload in said]
    assert Counter(message.writer for message in believed if message) == {"hostile": 100}
    assert sum(codec.dropped.values()) == 200
    assert set(codec.dropped) <= {"wrongly signed", "not the signer's to say"}
    assert {key.split("/")[3] for key, _ in said} == {"hostile", "u1", "u2"}
