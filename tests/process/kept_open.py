"""Missions that last until a test has done to them what it is to do, on any machine.

What a test does to a flight takes as long as its machine takes to start a process and to notice
a death, which may be longer than the flight; a flight with a keeper waits for it.
"""

from __future__ import annotations

from dataclasses import replace

from swarm.model import Mission, Task, TaskId
from tests.process.programs import run_swarm

KEEPER = TaskId("keeper")


def kept_open(mission: Mission) -> Mission:
    """``mission`` with a task more, which is worth less than any other and takes for ever."""
    place = mission.uavs[0].position_enu_m
    keeper = Task(KEEPER, place, 1e-6, service_s=1e6)
    return replace(mission, tasks=(*mission.tasks, keeper))


def let_end(*seat: str) -> None:
    """Take that task off the board, so that the mission ends when the others are done.

    Args:
        seat: where the bus is; not needed beside a `swarm run`, which is found.
    """
    done = run_swarm("task", "withdraw", KEEPER, *seat, "--timeout-s", "60")
    assert done.returncode == 0, done.stderr
