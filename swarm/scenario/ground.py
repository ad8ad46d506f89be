"""A mission put on the ground that its file names: every place gets the height of the ground there.

Leaves out: reading the file (swarm.scenario.terrain_files).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from swarm.model import Base, Mission, Uav
from swarm.model.terrain import LEEWAY_M
from swarm.scenario.findings import Document, Finding, number_of, shown
from swarm.scenario.places import LINE, entries

_Point = tuple[float, float, float]
_Standing = TypeVar("_Standing", Uav, Base)
_HEIGHT = "places stand on the ground that [terrain] gives"


def terrain_faults(document: Document) -> Iterator[Finding]:
    """What of the rest of a scenario does not go with its table [terrain]."""
    table = document.get("terrain")
    if not isinstance(table, Mapping):
        return
    if "origin" not in document:
        remedy = "add a table [origin] with lat_deg, lon_deg and alt_m"
        yield Finding(("terrain",), "where the ground is takes an origin", remedy)
    mission = document.get("mission")
    for name in ("uav", "base", "task"):
        for index, entry in entries(document, name):
            if "alt_m" in entry:
                yield Finding((name, index, "alt_m"), _HEIGHT, "leave it out")
            for key in ("position_m", LINE.metres):
                if _has_heights(entry.get(key)):
                    yield Finding((name, index, key), _HEIGHT, "give [east, north] alone")
    clearance_m = number_of(table.get("clearance_m"))
    if clearance_m is None:
        return
    least_m = clearance_m + LEEWAY_M
    band_m = mission.get("band_m") if isinstance(mission, Mapping) else None
    lowest_m = number_of(band_m[0]) if isinstance(band_m, list) and band_m else None
    if lowest_m is not None and 0.0 <= lowest_m < least_m:
        problem = f"begins {shown(lowest_m)} above the ground, too near to clearance_m"
        remedy = f"begin at {least_m:g} or higher: vehicles cut corners and sag"
        yield Finding(("mission", "band_m"), problem, remedy)
    for name in ("task", "area"):
        for index, entry in entries(document, name):
            height_m = number_of(entry.get("height_m"))
            if height_m is not None and height_m < least_m:
                problem = f"{shown(height_m)} above the ground is too near to clearance_m"
                remedy = f"give {least_m:g} or more: vehicles cut corners and sag"
                yield Finding((name, index, "height_m"), problem, remedy)


def _has_heights(value: object) -> bool:
    """Whether a place, or a point of a line, has a third number."""
    if not isinstance(value, list):
        return False
    points = [point for point in value if isinstance(point, list)]
    return len(value) == 3 if not points else any(len(point) == 3 for point in points)


def on_ground(mission: Mission, file: Path, clearance_m: float) -> Mission:
    """``mission``, whose places have no heights yet, on the ground that the ``file`` gives.

    Raises:
        InputError: one line about the file.
    """
    from swarm.allocation.legs.ground import ground_of
    from swarm.scenario.terrain_files import read_terrain

    if mission.origin is None:
        raise ValueError("a terrain without an origin has passed the checks")
    terrain = read_terrain(file, mission.origin, _around(mission), clearance_m)
    ground = ground_of(terrain)

    def standing(places: Sequence[_Point]) -> tuple[_Point, ...]:
        flat_m = np.array([place[:2] for place in places], dtype=np.float64).reshape(-1, 2)
        up_m = ground.up_m(flat_m).tolist()
        return tuple((*place[:2], up) for place, up in zip(places, up_m, strict=True))

    tasks = tuple(
        replace(
            task,
            position_enu_m=standing([task.position_enu_m])[0],
            path_enu_m=standing(task.path_enu_m),
        )
        for task in mission.tasks
    )
    uavs_m = standing([uav.position_enu_m for uav in mission.uavs])
    bases_m = standing([base.position_enu_m for base in mission.bases])
    return replace(
        mission,
        uavs=tuple(map(_standing_at, mission.uavs, uavs_m)),
        bases=tuple(map(_standing_at, mission.bases, bases_m)),
        tasks=tasks,
        terrain=terrain,
    )


def off_ground(mission: Mission) -> Mission:
    """``mission`` as it was before `on_ground`: no place has a height, and no ground is known."""

    def flat(place_enu_m: _Point) -> _Point:
        return (*place_enu_m[:2], 0.0)

    tasks = tuple(
        replace(
            task,
            position_enu_m=flat(task.position_enu_m),
            path_enu_m=tuple(map(flat, task.path_enu_m)),
        )
        for task in mission.tasks
    )
    return replace(
        mission,
        uavs=tuple(_standing_at(uav, flat(uav.position_enu_m)) for uav in mission.uavs),
        bases=tuple(_standing_at(base, flat(base.position_enu_m)) for base in mission.bases),
        tasks=tasks,
        terrain=None,
    )


def _standing_at(who: _Standing, place_enu_m: _Point) -> _Standing:
    return replace(who, position_enu_m=place_enu_m)


def _around(mission: Mission) -> tuple[float, float, float, float]:
    """A box in which all paths lie: that of all places, and of zones that they lead round [m]."""
    import shapely

    tasks = [point for t in mission.tasks for point in (t.position_enu_m, *t.path_enu_m)]
    stands = [uav.position_enu_m for uav in mission.uavs]
    stands += [base.position_enu_m for base in mission.bases]
    box = shapely.MultiPoint([point[:2] for point in (*stands, *tasks)]).envelope
    margin_m = mission.zone_margin_m
    zones = [zone.shape() for zone in mission.zones]
    while reached := [zone for zone in zones if zone.distance(box) <= margin_m]:
        zones = [zone for zone in zones if zone not in reached]
        grown = [zone.envelope.buffer(margin_m, join_style="mitre") for zone in reached]
        box = shapely.union_all([box, *grown]).envelope
    west_m, south_m, east_m, north_m = box.bounds
    return west_m, south_m, east_m, north_m
