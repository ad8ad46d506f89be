"""Forged messages are all dropped, each for the reason it was made for."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from sim.fleet.faults.forgery import REASONS, SETTLED_S, Forgery, Malformation, MessageForger
from swarm.bus.port import MAX_PAYLOAD_BYTES
from swarm.model.ids import COORDINATOR
from swarm.protocol.codec import Codec
from swarm.protocol.key_space import KeySpace
from swarm.protocol.registers import Replica
from tests.support.builders import MISSION, entry, epoch, held, message, status

HONEST = (
    message("u0", held("t1", 3.0), 4, 7),
    message(COORDINATOR, epoch("u0", "u1"), 1, 0),
    message(COORDINATOR, entry("t0"), 2, 7),
)


def hostile(seed: int = 0) -> MessageForger:
    return MessageForger(MISSION, ["u0", "u1"], ["t0", "t1"], np.random.default_rng(seed))


def informed(seed: int = 0) -> MessageForger:
    forger = hostile(seed)
    for said in HONEST:
        forger.hear(said, 0.0)
    return forger


def forgeries(kind: Malformation) -> list[Forgery]:
    forger = informed()
    return [f for _ in range(200) for f in forger.batch(SETTLED_S) if f.kind is kind]


@pytest.mark.parametrize("kind", [kind for kind in Malformation if kind is not Malformation.OLD])
def test_every_forgery_is_dropped_for_its_reason(kind: Malformation) -> None:
    codec = Codec(MISSION)

    forged = forgeries(kind)

    assert len(forged) == 200
    assert [codec.decode(each.key, each.payload) for each in forged] == [None] * 200
    assert codec.dropped == {REASONS[kind]: 200}


def test_old_statements_are_well_formed_and_beaten_by_what_everybody_knows() -> None:
    codec, replica = Codec(MISSION), Replica()
    replica.join_all(HONEST)

    heard = [codec.decode(each.key, each.payload) for each in forgeries(Malformation.OLD)]

    assert not codec.dropped
    assert {each.writer for each in heard if each} == {"u0", COORDINATOR}
    assert not replica.join_all(each for each in heard if each)
    assert replica.stale == 200


def test_nothing_is_old_before_everybody_has_heard_something_newer() -> None:
    forger = hostile()
    forger.hear(message("u0", status()), 0.0)
    assert Malformation.OLD not in {each.kind for each in forger.batch(10.0)}

    forger.hear(HONEST[0], 10.0)

    assert Malformation.OLD not in {each.kind for each in forger.batch(10.0 + 0.9 * SETTLED_S)}
    assert Malformation.OLD in {each.kind for each in forger.batch(10.0 + SETTLED_S)}


def test_everything_can_be_carried_on_keys_that_agents_read() -> None:
    keys = KeySpace(MISSION)
    read = {keys.plan, keys.claim("nobody")}
    read |= {keys.board(task) for task in ("t0", "t1")}
    for uav in ("u0", "u1"):
        read |= {keys.claim(uav), keys.outcome(uav, "t0"), keys.outcome(uav, "t1")}
    forger = informed()
    forged = [each for _ in range(50) for each in forger.batch(SETTLED_S)]

    assert {each.key for each in forged} == read
    assert max(len(each.payload) for each in forged) < MAX_PAYLOAD_BYTES


def test_answers_are_dropped_or_hold_nothing_acceptable() -> None:
    codec, forger = Codec(MISSION), hostile()
    key = KeySpace(MISSION).state("stranger")

    answers = [codec.decode_snapshot(key, forger.answer("stranger")) for _ in range(80)]

    assert all(answer is None or answer.messages == () for answer in answers)
    assert Counter(answer is None for answer in answers) == {True: 70, False: 10}
    assert codec.dropped.total() == 70 + 3 * 10
