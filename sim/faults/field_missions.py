"""Random missions with all of the field's constraints: fleets to fly with faults.

Drawn as the largest of their seed, as those without are, so that a smaller one is a part of the
larger: bases, zones, wind and margins are the same, whoever flies.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from sim.world.engine import stream
from swarm.allocation.field import problem_of
from swarm.allocation.legs import Airspace
from swarm.allocation.legs.planner import PathPlanner
from swarm.model import Base, BaseId, Mission, Task, TaskId, Uav, UavId, Zone, ZoneId

AREA_M = 120.0
HORIZON_S = 300.0
KINDS_OF_TASK = ("look", "lift")
_ENOUGH_M = 6.0
"""Places stay that far away from zones, so that who stops beside one is not in it."""
_TRIES = 200
_OF_RESERVE = 0.6
"""That share of a reserve is for batteries that drain faster; slow vehicles and zones take more."""


@lru_cache(maxsize=64)
def random_field_mission(
    seed: int,
    most: tuple[int, int],
    uavs: int,
    tasks: int,
    popups: int,
    area_m: float = AREA_M,
) -> Mission:
    """A mission of ``uavs`` and ``tasks`` out of the ``most`` of either, in such a square."""
    rng = stream(seed, "field")
    zones = tuple(_zone(rng, number, area_m) for number in range(int(rng.integers(0, 4))))
    margin_m = float(rng.choice([0.0, 2.0]))
    wind = tuple(rng.uniform(-2.0, 2.0, 2).tolist()) if rng.random() < 0.5 else (0.0, 0.0)
    planner = Airspace(zones, margin_m + _ENOUGH_M).concerning(-1e6, 1e6)
    bases = tuple(
        Base(
            BaseId(f"b{number}"),
            _point(rng, planner, area_m),
            swap_s=float(rng.uniform(0.0, 10.0)),
            slots=None if rng.random() < 0.2 else int(rng.integers(1, 3)),
        )
        for number in range(int(rng.integers(1, 3)) * max(1, round((area_m / AREA_M) ** 2)))
    )
    most_uavs, most_tasks = most
    fleet = [_uav(rng, planner, number, area_m) for number in range(most_uavs)]
    board = [_task(rng, planner, number, popups, area_m) for number in range(most_tasks)]
    return Mission(
        f"field-{seed}",
        HORIZON_S,
        tuple(fleet[:uavs]),
        tuple(board[:tasks]),
        bases=bases,
        zones=zones,
        wind_enu_m_s=(wind[0], wind[1]),
        zone_margin_m=margin_m,
    )


def fair_drain_frac(mission: Mission, uav: str) -> float:
    """By what share more the battery of ``uav`` may drain at most; twice the rate is 1.

    Who turns home when its charge, the reserve aside, just gets it there has the reserve for what
    the way takes beyond that, and for the wait for a slot.
    """
    problem = problem_of(mission)
    row = [str(each.id) for each in mission.uavs].index(uav)
    me = mission.uavs[row]
    if me.endurance_s is None:
        return 1.0
    homes_s = problem.home_s[row]
    farthest_s = max(float(homes_s[np.isfinite(homes_s)].max(initial=0.0)), 1e-3)
    return min(1.0, _OF_RESERVE * me.reserve_frac * me.endurance_s / farthest_s)


def _uav(rng: np.random.Generator, planner: PathPlanner, number: int, area_m: float) -> Uav:
    success = {kind: float(rng.uniform(0.3, 1.0)) for kind in KINDS_OF_TASK}
    if rng.random() < 0.3:
        success[str(rng.choice(KINDS_OF_TASK))] = 0.0
    survival = {kind: float(rng.uniform(0.8, 1.0)) for kind in KINDS_OF_TASK}
    speed_m_s = float(rng.uniform(5.0, 15.0))
    limited, hasty, sails = (rng.random() < share for share in (0.8, 0.4, 0.5))
    return Uav(
        UavId(f"u{number}"),
        _point(rng, planner, area_m / 2.0),
        speed_m_s,
        success,
        survival,
        acceleration_m_s2=None if hasty else float(rng.uniform(1.0, 5.0)),
        airspeed_m_s=float(rng.uniform(1.0, 1.4)) * speed_m_s if sails else None,
        endurance_s=float(rng.uniform(60.0, 150.0)) if limited else None,
        reserve_frac=float(rng.uniform(0.15, 0.3)),
        charge_frac=float(rng.uniform(0.7, 1.0)),
    )


def _task(
    rng: np.random.Generator, planner: PathPlanner, number: int, popups: int, area_m: float
) -> Task:
    place = _point(rng, planner, area_m)
    path = _line(rng, planner, place) if rng.random() < 0.25 else ()
    appears_s = float(rng.uniform(1.0, 25.0))
    appears_s = appears_s if number < popups else 0.0
    opens_s = appears_s + float(rng.uniform(0.0, 40.0)) if rng.random() < 0.3 else 0.0
    closes_s = opens_s + float(rng.uniform(20.0, 120.0)) if rng.random() < 0.3 else None
    due_s = max(opens_s, appears_s) + float(rng.uniform(30.0, 160.0))
    return Task(
        TaskId(f"t{number}"),
        place,
        value=float(rng.uniform(0.5, 7.0)),
        service_s=float(rng.uniform(0.0, 4.0) * rng.integers(0, 2)),
        kind=str(rng.choice(KINDS_OF_TASK)),
        appears_s=appears_s,
        due_s=due_s if rng.random() < 0.3 else None,
        opens_s=opens_s,
        closes_s=closes_s,
        path_enu_m=path,
        height_m=float(rng.uniform(20.0, 50.0)) if rng.random() < 0.15 else None,
    )


def _zone(rng: np.random.Generator, number: int, area_m: float) -> Zone:
    """A convex one, somewhere in the area."""
    middle_m = rng.uniform(0.15 * area_m, 0.85 * area_m, 2)
    angle_rad = np.sort(rng.uniform(0.0, 2.0 * np.pi, 5))
    reach_m = float(rng.uniform(6.0, 16.0))
    corners = middle_m + reach_m * np.column_stack([np.cos(angle_rad), np.sin(angle_rad)])
    ceiling_m = 14.5 if rng.random() < 0.3 else None  # some layers lie above
    polygon = tuple((float(east_m), float(north_m)) for east_m, north_m in corners)
    return Zone(ZoneId(f"z{number}"), polygon, ceiling_m=ceiling_m)


def _point(
    rng: np.random.Generator, planner: PathPlanner, size_m: float
) -> tuple[float, float, float]:
    """A place that is in no zone."""
    for _ in range(_TRIES):
        place_m = rng.uniform(0.0, size_m, 2)
        if planner.free(place_m[None])[0]:
            break
    return float(place_m[0]), float(place_m[1]), 0.0


def _line(
    rng: np.random.Generator, planner: PathPlanner, begin: tuple[float, float, float]
) -> tuple[tuple[float, float, float], ...]:
    """A line from there through no zone; none where there is no room."""
    points = [np.array(begin[:2])]
    for _ in range(int(rng.integers(1, 3))):
        for _ in range(_TRIES):
            ahead_m = points[-1] + rng.uniform(-30.0, 30.0, 2)
            if planner.clear(points[-1][None], ahead_m[None])[0] and planner.free(ahead_m[None])[0]:
                points.append(ahead_m)
                break
    if len(points) < 2:
        return ()
    line = tuple((float(east_m), float(north_m), 0.0) for east_m, north_m in points)
    return (begin, *line[1:])
