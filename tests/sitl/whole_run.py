"""What the tests of whole runs share: the scenario, and the autopilots there are to fly with.

Where SWARM_SITL_ARDUCOPTER or SWARM_SITL_PX4 is set, the real firmware flies; elsewhere the
simulated autopilot that behaves like it does, through the very same tests.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import pytest

from agent.vehicle.config import CommandStyle
from sim.fleet.firmware import FirmwareKind
from swarm.scenario import load_scenario
from swarm.scenario.files import resolve_scenario
from tests.process.mission import SwarmRun
from tests.process.pace import pace

MEADOW = resolve_scenario("meadow")
_MISSION = load_scenario(MEADOW)
UAVS = [uav.id for uav in _MISSION.uavs]
TASKS = sorted(task.id for task in _MISSION.tasks)


@dataclass(frozen=True, slots=True)
class Flown:
    """A run that has ended by itself, with nothing left behind."""

    status: int
    told: dict[str, Any]
    story: str
    """Everything said on standard error, and how it ended."""

    def assert_all_done(self) -> None:
        """Every task is done, and every process ended well, with its vehicle at home."""
        assert self.status == 0, self.story
        assert sorted(self.told["done"]) == TASKS, self.story
        assert self.told["failed"] == self.told["open"] == [], self.story
        assert self.told["processes"] == [], self.story

    def said_of(self, uav: str) -> str:
        """What the story tells of one UAV."""
        texts = [each["text"] for each in self.told["story"]]
        return "\n".join(text for text in texts if text.startswith(f"{uav} "))


def fly(folder: Path, *arguments: str, speedup: float | None = None) -> Flown:
    """Fly `MEADOW` with these arguments of `swarm run`, ten times as fast where none is said."""
    speedup = speedup or pace(10.0)
    words = [str(MEADOW), "--speedup", f"{speedup:g}", *arguments]
    with SwarmRun(words, folder) as run:
        status, told = run.result(timeout_s=220.0)
        run.assert_nothing_left()
        return Flown(status, told, f"{' '.join(words)}\n{run.story()}\n{told['processes']}")


@dataclass(frozen=True, slots=True)
class Autopilot:
    """What flies with one firmware on this machine."""

    option: str
    """For ``--autopilot``."""
    real: bool
    speedup: float
    worth: float
    """Least J in J of the plan: real vehicles take time to get up to speed, and to stop."""


def by_day(kind: FirmwareKind, style: CommandStyle) -> list[object]:
    """All pairs of firmware and way to command, of which only that one is flown by day."""
    return [
        pytest.param(*pair, marks=() if pair == (kind, style) else pytest.mark.slow)
        for pair in product(FirmwareKind, CommandStyle)
    ]


def autopilot_of(kind: FirmwareKind) -> Autopilot:
    """The firmware itself if this machine has it, or else what imitates it."""
    if os.environ.get(kind.variable):
        return Autopilot(kind, real=True, speedup=4.0, worth=0.8)
    simulated = "sim" if kind is FirmwareKind.ARDUPILOT else "sim-px4"
    return Autopilot(simulated, real=False, speedup=pace(20.0), worth=0.93)
