"""Missions that last until a test has done to them what it is to do, on any machine."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace

from swarm.model import Mission, Task, TaskId
from tests.process.mission import SwarmRun
from tests.process.test_status import router_of

__all__ = ["kept_open", "let_end"]

_KEEPER = TaskId("keeper")


def kept_open(mission: Mission) -> Mission:
    """``mission`` with a task more, which is worth less than any other and takes for ever."""
    place = mission.uavs[0].position_enu_m
    keeper = Task(_KEEPER, place, 1e-6, service_s=1e6)
    return replace(mission, tasks=(*mission.tasks, keeper))


def let_end(run: SwarmRun) -> None:
    """Take that task off the board, so that the mission ends when the others are done."""
    words = ["task", "withdraw", _KEEPER, "--connect", router_of(run), "--timeout-s", "60"]
    done = subprocess.run(
        [sys.executable, "-m", "swarm", *words],
        check=False,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
