"""Missions of schema 2 from the dicts that `tests.support.field_oracle.made_up` makes up."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from swarm.model import Base, BaseId, Mission, Task, TaskId, Uav, UavId, Zone, ZoneId

Table = Mapping[str, Any]


def mission_of(draft: Table) -> Mission:
    """The mission that ``draft`` describes, pop-ups included; all in metres."""
    mission = draft["mission"]
    east_m_s, north_m_s = mission.get("wind_m_s", (0.0, 0.0))
    band = mission.get("band_m")
    return Mission(
        name=draft["name"],
        horizon_s=mission["horizon_s"],
        uavs=tuple(_uav(row) for row in draft["uav"]),
        tasks=tuple(_task(row) for row in draft["task"]),
        success_default=mission.get("success_default", 1.0),
        survival_default=mission.get("survival_default", 1.0),
        bases=tuple(_base(row) for row in draft.get("base", ())),
        zones=tuple(_zone(row) for row in draft.get("zone", ())),
        wind_enu_m_s=(east_m_s, north_m_s),
        zone_margin_m=mission.get("zone_margin_m", 0.0),
        band_m=None if band is None else (band[0], band[1]),
    )


def _uav(row: Table) -> Uav:
    given = {key: row[key] for key in row if key not in ("id", "position_m")}
    return Uav(id=UavId(row["id"]), position_enu_m=_point(row["position_m"]), **given)


def _base(row: Table) -> Base:
    place_m = _point(row["position_m"])
    return Base(BaseId(row["id"]), place_m, row.get("swap_s", 0.0), row.get("slots"))


def _zone(row: Table) -> Zone:
    return Zone(
        id=ZoneId(row["id"]),
        polygon_enu_m=tuple(_corner(corner) for corner in row["polygon_m"]),
        holes_enu_m=tuple(tuple(_corner(c) for c in hole) for hole in row.get("holes_m", ())),
        floor_m=row.get("floor_m"),
        ceiling_m=row.get("ceiling_m"),
        inclusive=row.get("inclusive", False),
    )


def _task(row: Table) -> Task:
    given = {key: row[key] for key in row if key not in ("id", "position_m", "path_m")}
    points = [_point(point) for point in row.get("path_m", [row.get("position_m")])]
    path = tuple(points) if "path_m" in row else ()
    return Task(id=TaskId(row["id"]), position_enu_m=points[0], path_enu_m=path, **given)


def _point(numbers: Sequence[float]) -> tuple[float, float, float]:
    east_m, north_m, *up_m = map(float, numbers)
    return east_m, north_m, up_m[0] if up_m else 0.0


def _corner(numbers: Sequence[float]) -> tuple[float, float]:
    return float(numbers[0]), float(numbers[1])
