"""An operator adds and withdraws tasks in a mission of real processes, its coordinator killed."""

from __future__ import annotations

import contextlib
import json
from pathlib import Path

import pytest

from swarm.model import Mission, Origin, Task, TaskId, Uav, UavId
from tests.process.by_hand import ByHand
from tests.process.long_fleet import swarm

pytestmark = [pytest.mark.process]

UAVS = ["uav1", "uav2"]
LONG = Task(TaskId("t1"), (10.0, 20.0, 0.0), 4.0, service_s=9000.0)
MISSION = Mission(
    "ordered",
    9000.0,
    (
        Uav(UavId("uav1"), (0.0, 0.0, 0.0), 5.0),
        Uav(UavId("uav2"), (12.0, 0.0, 0.0), 5.0, success={"t1": 0.0}),
    ),
    (LONG,),
    origin=Origin(46.8, 9.7, 1100.0),
)


def test_tasks_are_added_and_withdrawn_without_a_coordinator(tmp_path: Path) -> None:
    with contextlib.ExitStack() as stack:
        by_hand = ByHand(tmp_path, stack, MISSION, speedup=4)
        coordinator = by_hand.coordinator("coordinator")
        by_hand.wait_for("uav1", "event=decided")
        coordinator.kill()
        coordinator.wait()

        added = swarm(by_hand, "task", "add", "--position", "-5,15", "--reason", "smoke", "--json")
        assert (added.returncode, added.stderr) == (0, "")
        told = json.loads(added.stdout)
        assert (told["task"], told["position"], told["value"]) == ("op1", [-5.0, 15.0, 0.0], 4.0)
        assert told["text"] == "op1 is on the board, worth 4; uav2 flies there"
        assert (told["uav"], told["known_to"]) == ("uav2", UAVS)
        by_hand.wait_for_done(1)
        assert by_hand.done() == ["op1"]

        late = swarm(by_hand, "task", "withdraw", "op1")
        assert (late.returncode, late.stderr) == (1, "swarm: op1 is done already\n")
        unknown = swarm(by_hand, "task", "withdraw", "t9")
        assert unknown.returncode == 2
        assert unknown.stderr == "ID: 't9' is not in mission ordered; the board holds op1, t1\n"

        withdrawn = swarm(by_hand, "task", "withdraw", "t1")
        assert (withdrawn.returncode, withdrawn.stderr) == (0, "")
        assert withdrawn.stdout == "t1 is withdrawn\n"
        assert [agent.wait(90) for agent in by_hand.agents] == [0, 0]
        assert by_hand.done() == ["op1"]
