"""Random missions with the field's constraints, each in a measure that can be varied by itself.

UAVs, places, values and services are those of the plain random mission of the same seed, but for
places in zones or out of everybody's reach, which are drawn anew. Every measure has draws of its
own, so that changing one leaves the others as they were.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from sim.study.baselines.index_rules import value_per_time
from sim.study.generator import area_side_m, mission_of, random_mission
from swarm.allocation import evaluate
from swarm.allocation.field import FieldProblem, FieldState
from swarm.allocation.legs import Airspace
from swarm.allocation.legs.planner import PathPlanner
from swarm.allocation.problem import Problem
from swarm.kernels.field import FIELD_VALUE_PER_TIME, run_rule
from swarm.model import Base, BaseId, Mission, Task, TaskId, Zone, ZoneId

FloatArray = npt.NDArray[np.float64]

_RESERVE_FRAC = 0.2
_PER_TASK = 4
"""Places drawn, of which those are kept that can be reached."""
_ROUNDS = 8
_ZONE_FRACS = (0.04, 0.09)
"""Radii of zones, as shares of the side of the area."""
_CLEAR_M = 5.0
"""Places are that far away from zones."""
_MIDDLE = (0.2, 0.8)
"""Where bases and zones lie, as shares of the side."""
_APART_FRAC = 0.3
_TRIES = 200
_OPENS_FRACS, _OPEN_FRACS, _DUE_FRACS = (0.0, 0.5), (0.15, 0.35), (0.4, 1.0)
"""Of the span: when windows open, how long they last, and when what is due is due after that."""
_LINE_M = 60.0
_AIRSPEED_FRAC = 1.3
_HORIZON_FRAC = 1.2


@dataclass(frozen=True, slots=True)
class FieldShape:
    """What constrains a random mission; a measure of 0 leaves its constraint out."""

    endurance_frac: float = 0.0
    """Airborne time of a full battery less its reserve of 20 %, as a share of the mean time that a
    UAV's list takes by value per time with endless batteries. 0: endless."""
    bases: float = 0.0
    slots: float = 1.0
    """Of each base. 0: no limit."""
    swap_s: float = 15.0
    zones: float = 0.0
    windows_frac: float = 0.0
    """Share of the tasks that begin in a window."""
    due_frac: float = 0.0
    """Share of the tasks that are due."""
    lines_frac: float = 0.0
    """Share of the tasks that are lines."""
    steady_wind_m_s: float = 0.0
    """Known to all, from a random direction."""
    acceleration_m_s2: float = 0.0
    """0: speeds change at once."""


def field_span_s(mission: Mission) -> float:
    """What the whole mission takes by value per time under its constraints [s]."""
    problem = FieldProblem.from_mission(mission)
    runs = run_rule(problem.kernel, FieldState.at_start(problem), FIELD_VALUE_PER_TIME)
    return float(runs.times_s[runs.items >= 0, 3].max(initial=0.0))


def random_field_mission(uavs: int, tasks: int, seed: int, shape: FieldShape, name: str) -> Mission:
    """The mission of that seed and shape; horizon_s is 1.2 times its span by value per time."""
    plain = mission_of(random_mission(uavs, tasks, seed), name)
    side = area_side_m(tasks)
    bases = _bases(_rng(seed, "bases"), side, shape)
    zones = _zones(_rng(seed, "zones"), side, bases, round(shape.zones))
    wind = _wind(_rng(seed, "wind"), shape.steady_wind_m_s)
    planner = Airspace(zones, _CLEAR_M).concerning(-1e6, 1e6)
    rng = _rng(seed, "places")
    starts = _free(rng, planner, side, [uav.position_enu_m[:2] for uav in plain.uavs], uavs)
    fleet = tuple(
        replace(
            uav,
            position_enu_m=(*place, 0.0),
            acceleration_m_s2=shape.acceleration_m_s2 or None,
            airspeed_m_s=_AIRSPEED_FRAC * max(uav.speed_m_s, shape.steady_wind_m_s)
            if shape.steady_wind_m_s
            else None,
        )
        for uav, place in zip(plain.uavs, starts, strict=True)
    )
    known = [task.position_enu_m[:2] for task in plain.tasks]
    places = _free(rng, planner, side, known, _PER_TASK * tasks)
    mission = replace(plain, uavs=fleet, bases=bases, zones=zones, wind_enu_m_s=wind)
    mission = _within_reach(mission, places, shape)
    mission = _with_lines(_rng(seed, "lines"), mission, planner, shape.lines_frac)
    if mission.constraints:
        mission = _with_times(seed, mission, shape)
        if (span_s := field_span_s(mission)) > 0.0:  # somebody can do something
            mission = replace(mission, horizon_s=_HORIZON_FRAC * span_s)
    return mission


_STREAMS = ("bases", "zones", "wind", "places", "lines", "windows", "due")


def _rng(seed: int, what: str) -> np.random.Generator:
    return np.random.default_rng([seed, 1 + _STREAMS.index(what)])


def _bases(rng: np.random.Generator, side: float, shape: FieldShape) -> tuple[Base, ...]:
    """Somewhere in the middle, not next to each other if there is room."""
    places: list[FloatArray] = []
    for _ in range(round(shape.bases)):
        for _ in range(_TRIES):
            place = side * rng.uniform(*_MIDDLE, 2)
            if all(math.dist(place, other) > _APART_FRAC * side for other in places):
                break
        places.append(place)
    return tuple(
        Base(
            BaseId(f"b{number}"),
            (float(east_m), float(north_m), 0.0),
            swap_s=shape.swap_s,
            slots=round(shape.slots) or None,
        )
        for number, (east_m, north_m) in enumerate(places, start=1)
    )


def _zones(
    rng: np.random.Generator, side: float, bases: Sequence[Base], count: int
) -> tuple[Zone, ...]:
    """Convex ones that no base is in."""
    zones = []
    for number in range(1, count + 1):
        for _ in range(_TRIES):
            middle, radius = side * rng.uniform(*_MIDDLE, 2), side * rng.uniform(*_ZONE_FRACS)
            far = (math.dist(middle, base.position_enu_m[:2]) for base in bases)
            if min(far, default=math.inf) > radius + 2.0 * _CLEAR_M:
                break
        angles = math.tau * (np.arange(6) + rng.uniform(0.0, 0.8, 6)) / 6.0
        corners = middle + radius * np.column_stack([np.cos(angles), np.sin(angles)])
        polygon = tuple((float(east_m), float(north_m)) for east_m, north_m in corners)
        zones.append(Zone(ZoneId(f"z{number}"), polygon))
    return tuple(zones)


def _wind(rng: np.random.Generator, speed_m_s: float) -> tuple[float, float]:
    way_rad = float(rng.uniform(0.0, math.tau))
    return speed_m_s * math.cos(way_rad), speed_m_s * math.sin(way_rad)


def _free(
    rng: np.random.Generator,
    planner: PathPlanner,
    side: float,
    known: Sequence[tuple[float, float]],
    count: int,
) -> list[tuple[float, float]]:
    """Places in no zone: those of ``known`` that are, then more of them."""
    free: list[tuple[float, float]] = []
    drawn = np.array(known, dtype=np.float64)
    while len(free) < count:
        free += [(float(e_m), float(n_m)) for e_m, n_m in drawn[planner.free(drawn)]]
        drawn = rng.uniform(0.0, side, (count, 2))
    return free[:count]


def _within_reach(
    mission: Mission, places: Sequence[tuple[float, float]], shape: FieldShape
) -> Mission:
    """The mission with batteries, its tasks at the first places that half of its UAVs can serve.

    Where there are not enough of these, the nearest others take their place.
    """
    count = len(mission.tasks)

    def at(indices: Sequence[int]) -> tuple[Task, ...]:
        return tuple(
            replace(mission.tasks[index], position_enu_m=(*places[place], 0.0))
            for index, place in enumerate(indices)
        )

    kept = list(range(count))
    if not shape.endurance_frac:
        return replace(mission, tasks=at(kept))
    longest_s = float(max(task.service_s for task in mission.tasks))
    every = [
        replace(mission.tasks[0], id=TaskId(f"p{k}"), position_enu_m=(*place, 0.0))
        for k, place in enumerate(places)
    ]
    needs_s = np.concatenate(  # few at a time: legs between all of them would fit nowhere
        [
            _sortie_s(FieldProblem.from_mission(mission, tasks=every[first : first + count]))
            for first in range(0, len(every), count)
        ],
        axis=1,
    )
    half_s = np.sort(needs_s, axis=0)[len(mission.uavs) // 2] + longest_s
    for _ in range(_ROUNDS):
        budget_s = shape.endurance_frac * _list_s(replace(mission, tasks=at(kept)))
        near = np.flatnonzero(half_s <= budget_s)[:count].tolist()
        far = [place for place in np.argsort(half_s, kind="stable").tolist() if place not in near]
        before, kept = kept, [*near, *far[: count - len(near)]]
        if kept == before:
            break
    endurance_s = budget_s / (1.0 - _RESERVE_FRAC)
    fleet = tuple(
        replace(uav, endurance_s=endurance_s, reserve_frac=_RESERVE_FRAC) for uav in mission.uavs
    )
    return replace(mission, uavs=fleet, tasks=at(kept))


def _sortie_s(problem: FieldProblem) -> FloatArray:
    """(n_uav, n_task) from a base to a task and home again [s]; infinite without bases."""
    bases = slice(problem.n_uav, problem.n_uav + problem.n_base)
    nodes = problem.enter[:, 0]
    out_s = problem.leg_s[problem.kind][:, bases][:, :, nodes].min(axis=1, initial=np.inf)
    sortie_s: FloatArray = out_s + problem.home_s[:, nodes]
    return sortie_s


def _list_s(mission: Mission) -> float:
    """Mean time of a UAV's list by value per time without constraints [s]."""
    problem = Problem.from_mission(mission)
    routes = value_per_time(problem)
    _, completion_s = evaluate(problem, routes)
    return float(np.mean([completion_s[route[-1]] if route else 0.0 for route in routes]))


def _with_lines(
    rng: np.random.Generator, mission: Mission, planner: PathPlanner, share: float
) -> Mission:
    """A share of the tasks become lines from their places, where there is room."""
    chosen = set(rng.permutation(len(mission.tasks))[: round(share * len(mission.tasks))].tolist())
    tasks = list(mission.tasks)
    for index, task in enumerate(tasks):
        here = np.array([task.position_enu_m[:2]])
        for _ in range(_TRIES if index in chosen else 0):
            way_rad = float(rng.uniform(0.0, math.tau))
            there = here + _LINE_M * np.array([[math.cos(way_rad), math.sin(way_rad)]])
            if planner.free(there)[0] and planner.clear(here, there)[0]:
                end = (float(there[0, 0]), float(there[0, 1]), 0.0)
                tasks[index] = replace(task, path_enu_m=(task.position_enu_m, end))
                break
    return replace(mission, tasks=tuple(tasks))


def _with_times(seed: int, mission: Mission, shape: FieldShape) -> Mission:
    """Windows and due times, within the time that the mission takes without them."""
    span_s, count = field_span_s(mission), len(mission.tasks)
    tasks = list(mission.tasks)
    rng = _rng(seed, "windows")
    order, draws = rng.permutation(count).tolist(), rng.random((count, 2))
    for index in order[: round(shape.windows_frac * count)]:
        opens_s = span_s * _between(_OPENS_FRACS, draws[index, 0])
        closes_s = opens_s + span_s * _between(_OPEN_FRACS, draws[index, 1])
        tasks[index] = replace(tasks[index], opens_s=opens_s, closes_s=closes_s)
    rng = _rng(seed, "due")
    order, late = rng.permutation(count).tolist(), rng.random(count)
    for index in order[: round(shape.due_frac * count)]:
        due_s = tasks[index].opens_s + span_s * _between(_DUE_FRACS, late[index])
        tasks[index] = replace(tasks[index], due_s=due_s)
    return replace(mission, tasks=tuple(tasks))


def _between(ends: tuple[float, float], share: float) -> float:
    return ends[0] + float(share) * (ends[1] - ends[0])
