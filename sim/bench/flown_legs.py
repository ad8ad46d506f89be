"""How long vehicles take for legs and missions, beside what plans reckon with, and what they keep.

Leaves out: how that is asked for and told (sim.bench.leg_commands).
"""

from __future__ import annotations

import json
import math
import statistics
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

from swarm.allocation import field
from swarm.kernels.field import fly_lists
from swarm.model import BaseId, Mission, Task, TaskId, UavId
from swarm.protocol.calibration import FlightRates, fleet_as_told
from swarm.protocol.fields import Point
from swarm.runtime.errors import Fault, InputError

_REMEDY = "name what swarm run SCENARIO --json printed of a flight of that scenario"
_WAITED_S = 0.5
"""After a window has opened: who began that soon may have waited for it."""


@dataclass(frozen=True, slots=True)
class FlownLeg:
    """One leg in the air, from rest to rest."""

    uav: str
    task: str
    length_m: float
    """Round zones, if need be."""
    speed_m_s: float
    """Cruise speed that the UAV was told."""
    planned_s: float
    """By the kinematic model: acceleration, wind and zones, as the scenario has them; where it
    gives none, acceleration and greatest speed as the vehicles said in that flight."""
    flown_s: float

    @property
    def excess_s(self) -> float:
        """Beyond length ÷ speed."""
        return self.flown_s - self.length_m / self.speed_m_s

    @property
    def flown_frac(self) -> float:
        """Flown over planned; 1 of a leg of no length."""
        return self.flown_s / self.planned_s if self.planned_s > 0.0 else 1.0

    def as_json(self) -> dict[str, Any]:
        """Everything, ready for `json.dumps`."""
        return {**asdict(self), "excess_s": self.excess_s, "flown_frac": self.flown_frac}


@dataclass(frozen=True, slots=True)
class LegTimes:
    """What legs took beside what they should."""

    legs: int
    flown_frac: float
    """Median of flown over planned."""
    least_frac: float
    greatest_frac: float
    median_s: float
    """Of what they took beyond length ÷ speed, as the next two [s]."""
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
    keys = ("scenario", "executed_schedule", "completion_s", "makespan_s", "done")
    lacks = [key for key in keys if not isinstance(told, dict) or key not in told]
    if lacks:
        raise InputError(Fault(str(path), lacks[0], "is missing", _REMEDY))
    found: Mapping[str, Any] = told
    return found


def legs_flown(mission: Mission, run: Mapping[str, Any], source: str) -> list[FlownLeg]:
    """Legs to tasks of one flight, of which `swarm run --json` said ``run``.

    Those from a base, which begin with a take-off, and those that end in waiting for a window are
    left out.

    Args:
        mission: the scenario.
        run: what was said.
        source: where that stands, for people.

    Raises:
        InputError: it flew another scenario.
    """
    schedule = run["executed_schedule"]
    known = {uav.id for uav in mission.uavs}
    tasks = {task.id: task for task in mission.tasks}
    strangers = [uav for uav in schedule if uav not in known]
    strangers += [
        entry["go"]
        for entries in schedule.values()
        for entry in entries
        if entry["go"] not in tasks and entry["go"] != "start" and ":" not in entry["go"]
    ]
    if strangers:
        problem = f"{strangers[0]!r} is not in the scenario {mission.name}"
        raise InputError(Fault(source, "executed_schedule", problem, _REMEDY))
    told = {
        uav: FlightRates(
            acceleration_m_s2=rates.get("acceleration_m_s2"), speed_m_s=rates.get("speed_m_s")
        )
        for uav, rates in run.get("calibration", {}).items()
    }
    reckoned = field.FieldProblem.from_mission(fleet_as_told(mission, told))
    return [
        leg
        for uav, entries in schedule.items()
        for leg in _legs_of(mission, reckoned, uav, entries)
    ]


def _legs_of(
    mission: Mission, problem: field.FieldProblem, uav: str, entries: Sequence[Mapping[str, Any]]
) -> Iterator[FlownLeg]:
    row = problem.uav_ids.index(UavId(uav))
    tasks = {task.id: task for task in mission.tasks}
    here_enu_m = mission.uavs[row].position_enu_m
    took_off = False
    for entry in entries:
        task = tasks.get(TaskId(entry["go"]))
        if task is None:
            took_off = True
            continue
        backwards = bool(entry["reversed"])
        nodes = field.task_nodes(problem, problem.task_ids.index(task.id), backwards=backwards)
        waited = task.opens_s > 0.0 and entry["begin_s"] <= task.opens_s + _WAITED_S
        if not took_off and not waited:
            from_enu_m = *entry["from_m"], here_enu_m[2]
            across_m = sum(math.dist(*both) for both in pairwise([from_enu_m[:2], *entry["via_m"]]))
            up_m = _ends_of(task, backwards=backwards)[0][2] - here_enu_m[2]
            yield FlownLeg(
                uav,
                task.id,
                math.hypot(across_m, up_m),
                mission.uavs[row].speed_m_s,
                float(problem.legs_from_s(row, from_enu_m)[nodes[0]]),
                entry["arrive_s"] - entry["depart_s"],
            )
        here_enu_m, took_off = _ends_of(task, backwards=backwards)[-1], False


def _ends_of(task: Task, *, backwards: bool) -> tuple[Point, ...]:
    """Where it is flown along, in that direction."""
    return (task.path_enu_m or (task.position_enu_m,))[:: -1 if backwards else 1]


def makespan_frac(run: Mapping[str, Any]) -> float | None:
    """Flown makespan over that of the plan; None where there was no plan."""
    planned_s = max(run["completion_s"].values(), default=0.0)
    return float(run["makespan_s"] / planned_s) if planned_s > 0.0 else None


@dataclass(frozen=True, slots=True)
class KeptLimits:
    """What one flight kept of what it had to."""

    tasks: int
    """That were to be done: all but those that the plan left out."""
    done: int
    """Of them."""
    nearest_zone_m: float | None
    """How near a UAV in flight came to a zone [m]; None without zones, or if that is not told."""
    margin_m: float
    """How near it may come [m]."""
    charge_frac: float | None
    """Least charge, of the UAV that came nearest to its reserve; None if none was told."""
    reserve_frac: float
    """Of that UAV."""

    @property
    def kept(self) -> bool:
        """Whether all of that was kept, as far as it is told."""
        far = self.nearest_zone_m is None or self.nearest_zone_m >= self.margin_m
        charged = self.charge_frac is None or self.charge_frac >= self.reserve_frac
        return self.done == self.tasks and far and charged

    def as_json(self) -> dict[str, Any]:
        """Everything, ready for `json.dumps`."""
        return {**asdict(self), "kept": self.kept}


def limits_kept(mission: Mission, run: Mapping[str, Any]) -> KeptLimits:
    """What the flight of ``mission`` kept of which `swarm run --json` said ``run``."""
    wanted = {task.id for task in mission.tasks} - set(run.get("left_out", ()))
    reserves = {uav.id: uav.reserve_frac for uav in mission.uavs if uav.endurance_s is not None}
    told = run.get("lowest_charge_frac", {})
    charges = [(told[uav] - frac, told[uav], frac) for uav, frac in reserves.items() if uav in told]
    _, charge_frac, reserve_frac = min(charges, default=(0.0, None, 0.0))
    return KeptLimits(
        tasks=len(wanted),
        done=len(wanted.intersection(run["done"])),
        nearest_zone_m=run.get("nearest_zone_m"),
        margin_m=mission.zone_margin_m,
        charge_frac=charge_frac,
        reserve_frac=reserve_frac,
    )


def reckoned_makespan_s(mission: Mission, run: Mapping[str, Any]) -> float | None:
    """When the lists that were flown would have ended by the model [s]; None if they could not be.

    Agents may do something else than planned; this leaves their choices out. Landing and climbing
    take as long as the run says that they were found to.
    """
    problem = field.FieldProblem.from_mission(mission)
    found = [run.get("calibration", {}).get(uav, {}) for uav in problem.uav_ids]
    down_s, up_s = ([each.get(key, 0.0) for each in found] for key in ("land_s", "climb_s"))
    as_briefed = [1.0] * problem.n_uav
    problem = problem.calibrated(as_briefed, as_briefed, down_s, up_s, max(up_s))
    lists = [_items_of(problem, run["executed_schedule"].get(uav, ())) for uav in problem.uav_ids]
    flown = fly_lists(problem.kernel, field.FieldState.at_start(problem), lists)
    ends_s = flown.times_s[[item >= 0 for items in lists for item in items], 3].tolist()
    return max(ends_s, default=None) if flown.feasible else None


def _items_of(problem: field.FieldProblem, entries: Sequence[Mapping[str, Any]]) -> list[int]:
    """A list as it was flown, up to its last task."""
    items = []
    for entry in entries:
        if (name := TaskId(entry["go"])) in problem.task_ids:
            items.append(2 * problem.task_ids.index(name) + bool(entry["reversed"]))
        elif (base := BaseId(entry["go"].partition(":")[2])) in problem.base_ids:
            items.append(-1 - problem.base_ids.index(base))
    while items and items[-1] < 0:
        items.pop()
    return items


@dataclass(frozen=True, slots=True)
class JudgedFlight:
    """One flight, set beside what was planned, and what it kept."""

    legs: tuple[FlownLeg, ...]
    times: LegTimes | None
    """Of the legs; None without any."""
    makespan_frac: float | None
    """Flown makespan over that of the plan; None where there was no plan."""
    flown_lists_frac: float | None
    """The same over what the model says of the lists that were flown; None if they could not be."""
    limits: KeptLimits

    @property
    def legs_frac(self) -> float | None:
        """Median of flown over planned; None without a leg."""
        return None if self.times is None else self.times.flown_frac

    @property
    def kept(self) -> bool:
        """Whether legs were flown, and all limits kept."""
        return self.times is not None and self.limits.kept

    def as_json(self) -> dict[str, Any]:
        """Everything, ready for `json.dumps`."""
        return {
            "legs": [leg.as_json() for leg in self.legs],
            "times": None if self.times is None else asdict(self.times),
            "makespan_frac": self.makespan_frac,
            "flown_lists_frac": self.flown_lists_frac,
            "limits": self.limits.as_json(),
        }


def judge_flight(
    mission: Mission, run: Mapping[str, Any], source: str, acceleration_m_s2: float | None
) -> JudgedFlight:
    """What is to be said of a flight of which `swarm run --json` said ``run``.

    Args:
        mission: the scenario.
        run: what was said.
        source: where that stands, for people.
        acceleration_m_s2: of the vehicles; None if it is not known.

    Raises:
        InputError: it flew another scenario.
    """
    legs = tuple(legs_flown(mission, run, source))
    by_model_s = reckoned_makespan_s(mission, run)
    return JudgedFlight(
        legs=legs,
        times=leg_times(legs, acceleration_m_s2),
        makespan_frac=makespan_frac(run),
        flown_lists_frac=run["makespan_s"] / by_model_s if by_model_s else None,
        limits=limits_kept(mission, run),
    )


def leg_times(legs: Sequence[FlownLeg], acceleration_m_s2: float | None) -> LegTimes | None:
    """Medians and spread; None without any leg. The acceleration is None if it is not known."""
    if not legs:
        return None
    excess_s = sorted(leg.excess_s for leg in legs)
    fracs = sorted(leg.flown_frac for leg in legs)
    beyond_s = None
    if acceleration_m_s2 is not None:
        ramps_s = (leg.excess_s - leg.speed_m_s / acceleration_m_s2 for leg in legs)
        beyond_s = statistics.median(ramps_s)
    return LegTimes(
        legs=len(legs),
        flown_frac=statistics.median(fracs),
        least_frac=fracs[0],
        greatest_frac=fracs[-1],
        median_s=statistics.median(excess_s),
        least_s=excess_s[0],
        greatest_s=excess_s[-1],
        beyond_ramps_s=beyond_s,
    )
