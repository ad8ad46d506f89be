"""A fleet of real processes that is busy for as long as a test wants, to be commanded."""

from __future__ import annotations

import json
import subprocess

from swarm.model import Mission, Origin, Task, TaskId, Uav, UavId
from tests.process.by_hand import ByHand
from tests.process.programs import run_swarm

UAVS = ["uav1", "uav2", "uav3"]


def long_mission_of_three(name: str) -> Mission:
    """Each has two tasks of a quarter of an hour."""
    return Mission(
        name,
        9000.0,
        tuple(Uav(UavId(uav), (12.0 * n, 0.0, 0.0), 5.0) for n, uav in enumerate(UAVS)),
        tuple(
            Task(TaskId(f"t{n}"), (20.0 * n, 60.0, 0.0), 1.0, service_s=900.0)
            for n in range(2 * len(UAVS))
        ),
        origin=Origin(46.8, 9.7, 1100.0),
    )


def swarm(by_hand: ByHand, *words: str) -> subprocess.CompletedProcess[str]:
    """Run a command at the seat of the mission's operator."""
    return run_swarm(*words, *by_hand.seat)


def does(by_hand: ByHand, uav: str) -> str:
    """What `swarm status` says that UAV does."""
    told = json.loads(swarm(by_hand, "status", "--json").stdout)
    (found,) = [each["does"] for each in told["uavs"] if each["id"] == uav]
    return str(found)
