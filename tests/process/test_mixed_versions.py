"""An earlier release and this one fly a mission together, as while a fleet is upgraded.

The earlier one runs from its own sources, on the kernels of this build (tests/support/releases.py),
on a bus without keys: it knows none. Everything said on that bus is heard, and read by both
releases once more, so that what either of them drops shows wherever it was sent.
"""

from __future__ import annotations

import contextlib
import json
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import zenoh

import swarm
from coordinator.core.publication import mission_config_of, task_entry_of
from sim.fleet.faults.flood import long_mission
from swarm.bus.config import DEFAULT_LEASE_S
from swarm.bus.zenoh_session import session_config
from swarm.model.ids import COORDINATOR, OPERATOR
from swarm.model.layers import FlightLayers
from swarm.protocol.codec import Codec
from swarm.protocol.encoding import encode
from swarm.protocol.key_space import KeySpace
from swarm.protocol.messages import (
    CommandKind,
    Message,
    MissionConfig,
    OperatorCommand,
    PlanEpoch,
    Snapshot,
    Stamp,
    StartWithout,
    TaskEntry,
)
from swarm.protocol.uav_messages import Claim, Outcome, Status
from tests.process.by_hand import ByHand
from tests.support.releases import kept_releases, python_of, unpacked

pytestmark = [pytest.mark.process]

MISSION = "table-1"
TIMES, SPEEDUP = 8.0, 6
"""On a map so much larger a busy machine is late by a fraction of a leg only."""
READ = """
import json
from swarm.wire.codec import Codec

said, answered = json.load(sys.stdin)
codec = Codec(sys.argv[1])
for key, payload in said:
    codec.decode(key, bytes.fromhex(payload))
registers = 0
for key, payload in answered:
    snapshot = codec.decode_snapshot(key, bytes.fromhex(payload))
    registers += 0 if snapshot is None else len(snapshot.messages)
print(json.dumps({"dropped": codec.dropped, "registers": registers}))
"""
"""Says what of these messages and answers the release it is run with would drop."""


class Listener:
    """Keeps all that is said on the bus of a mission."""

    def __init__(self, endpoint: str, stack: contextlib.ExitStack) -> None:
        config = session_config("client", listen=[], connect=[endpoint], lease_s=DEFAULT_LEASE_S)
        self._session = stack.enter_context(zenoh.open(config))
        self.said: list[tuple[str, bytes]] = []
        self.answered: list[tuple[str, bytes]] = []
        self._session.declare_subscriber(f"{KeySpace(MISSION).root}/**", self._hear)

    def _hear(self, sample: zenoh.Sample) -> None:
        self.said.append((str(sample.key_expr), sample.payload.to_bytes()))

    def ask_all(self) -> None:
        """Ask every process what it knows."""
        for reply in self._session.get(KeySpace(MISSION).state("*"), payload=b"", timeout=5.0):
            assert reply.ok is not None
            self.answered.append((str(reply.ok.key_expr), reply.ok.payload.to_bytes()))

    def as_json(self) -> str:
        """Everything, for `READ`."""
        return json.dumps(
            [[(key, data.hex()) for key, data in each] for each in (self.said, self.answered)]
        )


@pytest.fixture(scope="module", params=kept_releases())
def release(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return unpacked(request.param, tmp_path_factory.mktemp("release"))


def read_by(release: Path, messages: str) -> dict[str, Any]:
    """What a release makes of messages and answers."""
    words = [*python_of(release, READ), MISSION]
    told = subprocess.run(words, check=False, input=messages, capture_output=True, text=True)
    assert told.returncode == 0, told.stderr
    found: dict[str, Any] = json.loads(told.stdout)
    return found


def test_an_earlier_release_drops_and_counts_what_it_does_not_know(release: Path) -> None:
    start = Message(MISSION, OPERATOR, Stamp(9, 1), StartWithout("uav1", 1, "no GPS"))
    hold = Message(MISSION, OPERATOR, Stamp(9, 2), OperatorCommand("uav1", CommandKind.HOLD, 1, ""))
    answer = encode(Snapshot(MISSION, "uav1", 1, None, (start, hold)))
    said = [(start.key, encode(start).hex())]
    answered = [(KeySpace(MISSION).state("uav1"), answer.hex())]

    theirs = read_by(release, json.dumps([said, answered]))

    assert theirs == {"dropped": {"unknown kind": 2}, "registers": 1}


def test_of_a_mission_with_accelerations_an_earlier_release_drops_the_brief_alone(
    release: Path,
) -> None:
    mission = swarm.load(MISSION)
    slow = replace(mission, uavs=tuple(replace(u, acceleration_m_s2=2.5) for u in mission.uavs))
    config = mission_config_of(slow, FlightLayers(), run=1)
    brief = Message(MISSION, COORDINATOR, Stamp(9, 1), config)
    board = Message(MISSION, COORDINATOR, Stamp(9, 2), task_entry_of(slow.tasks[0], 0))
    answer = encode(Snapshot(MISSION, COORDINATOR, 9, None, (brief, board)))
    said = [(message.key, encode(message).hex()) for message in (brief, board)]
    answered = [(KeySpace(MISSION).state(COORDINATOR), answer.hex())]

    theirs = read_by(release, json.dumps([said, answered]))

    assert theirs == {"dropped": {"unknown version": 2}, "registers": 1}


@pytest.mark.parametrize("earlier", ["uav1", COORDINATOR])
def test_a_process_of_an_earlier_release_takes_its_part(
    earlier: str, release: Path, tmp_path: Path
) -> None:
    mission = replace(long_mission(TIMES), name=MISSION)
    with contextlib.ExitStack() as stack:
        programs = {earlier: python_of(release)}
        flight = ByHand(tmp_path, stack, mission, SPEEDUP, programs=programs)
        listener = Listener(flight.seat[1], stack)
        coordinating = flight.coordinator(COORDINATOR)
        flight.wait_for_done(1)
        listener.ask_all()
        assert coordinating.wait(100) == 0, flight.log(COORDINATOR)
        flight.assert_all_done()
        assert f"event=begins mission={MISSION} release={swarm.__version__} " in flight.log("uav2")

    theirs = read_by(release, listener.as_json())
    ours = Codec(MISSION)
    heard = [ours.decode(key, data) for key, data in listener.said]
    answers = [ours.decode_snapshot(key, data) for key, data in listener.answered]

    assert (ours.dropped, theirs["dropped"]) == ({}, {})
    bodies = [message.body for message in heard if message is not None]
    assert {type(body) for body in bodies} >= {
        MissionConfig,
        TaskEntry,
        PlanEpoch,
        Claim,
        Outcome,
        Status,
    }
    agents_dropped = [body.dropped for body in bodies if isinstance(body, Status)]
    assert all(dropped.keys() <= {"stale"} for dropped in agents_dropped), agents_dropped
    answering = [answer for answer in answers if answer is not None]
    assert {answer.writer for answer in answering} == {COORDINATOR, *flight.uavs}
    assert sum(len(answer.messages) for answer in answering) == theirs["registers"] > 0
