"""How much longer vehicles take from task to task than straight line ÷ cruise speed.

Read from what `swarm run --json` said of a flight: a leg begins when the last task ended and
ends when the next one's service begins; the UAV's first leg begins at mission time 0, at its
start. Time in which a UAV had nothing to fly to counts too, so missions with pop-ups or losses
say little. Leaves out: the flight, and how the figures are shown
(`sim.bench.legs_command`).
"""

from __future__ import annotations

import json
import math
import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from swarm.errors import Fault, InputError
from swarm.model import Mission

__all__ = ["FlownLeg", "LegTimes", "leg_times", "legs_flown", "load_run"]

_REMEDY = "name what swarm run SCENARIO --json printed of a flight of that scenario"


@dataclass(frozen=True, slots=True)
class FlownLeg:
    """One leg, from rest to rest."""

    uav: str
    task: str
    length_m: float
    speed_m_s: float
    """Cruise speed that the UAV was told."""
    flown_s: float

    @property
    def excess_s(self) -> float:
        """Beyond length ÷ speed."""
        return self.flown_s - self.length_m / self.speed_m_s


@dataclass(frozen=True, slots=True)
class LegTimes:
    """What legs took beyond length ÷ speed [s]."""

    legs: int
    median_s: float
    least_s: float
    greatest_s: float
    beyond_ramps_s: float | None
    """Median of what they took beyond length ÷ speed + speed ÷ acceleration; None where no
    acceleration is known."""


def load_run(path: Path) -> Mapping[str, Any]:
    """What `swarm run --json` printed.

    Raises:
        InputError: it cannot be read, or is something else.
    """
    try:
        told = json.loads(path.read_text(encoding="utf-8"))
    except OSError as fault:
        raise InputError(Fault(str(path), "", fault.strerror or str(fault), _REMEDY)) from fault
    except ValueError as fault:
        raise InputError(Fault(str(path), "", "it is not JSON", _REMEDY)) from fault
    keys = ("scenario", "executed_routes", "executed_completion_s")
    lacks = [key for key in keys if not isinstance(told, dict) or key not in told]
    if lacks:
        raise InputError(Fault(str(path), lacks[0], "is missing", _REMEDY))
    found: Mapping[str, Any] = told
    return found


def legs_flown(mission: Mission, run: Mapping[str, Any], source: str) -> list[FlownLeg]:
    """The legs of one flight.

    Args:
        mission: its scenario.
        run: what `swarm run --json` said of it.
        source: where that is from, for people.

    Raises:
        InputError: it flew another scenario.
    """
    uavs = {uav.id: uav for uav in mission.uavs}
    tasks = {task.id: task for task in mission.tasks}
    ended_s = run["executed_completion_s"]
    legs = []
    for name, route in run["executed_routes"].items():
        strangers = [] if name in uavs else [name]
        strangers += [task for task in route if task not in tasks]
        if strangers:
            problem = f"{strangers[0]!r} is not in the scenario {mission.name}"
            raise InputError(Fault(source, "executed_routes", problem, _REMEDY))
        uav, at_s = uavs[name], 0.0
        place_enu_m = uav.position_enu_m
        for task in (tasks[each] for each in route if each in ended_s):
            length_m = math.dist(place_enu_m, task.position_enu_m)
            flown_s = ended_s[task.id] - task.service_s - at_s
            legs.append(FlownLeg(name, task.id, length_m, uav.speed_m_s, flown_s))
            place_enu_m, at_s = task.position_enu_m, ended_s[task.id]
    return legs


def leg_times(legs: Sequence[FlownLeg], acceleration_m_s2: float | None) -> LegTimes | None:
    """Median and spread; None without any leg.

    Args:
        legs: of one flight or of several.
        acceleration_m_s2: the vehicles'; None if it is not known.
    """
    if not legs:
        return None
    excess_s = sorted(leg.excess_s for leg in legs)
    beyond_s = None
    if acceleration_m_s2 is not None:
        ramps_s = (leg.excess_s - leg.speed_m_s / acceleration_m_s2 for leg in legs)
        beyond_s = statistics.median(ramps_s)
    return LegTimes(len(legs), statistics.median(excess_s), excess_s[0], excess_s[-1], beyond_s)
