"""Shapes, types and ranges of a scenario file, and what to say when they are wrong.

The upper limits are far beyond any aircraft; they keep every product of eq. 1
finite, so that a misplaced exponent is named here and not met as an infinite J.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

from pydantic import AfterValidator, Field

from swarm.model.ids import ID_RULE
from swarm.scenario.findings import Document, Finding
from swarm.scenario.validation import (
    PROBABILITY,
    Id,
    Probability,
    StrictTable,
    TableShape,
    known_schema,
    validate_tables,
    wrong,
)

SCHEMA = 1
"""The version of the format that is read and written."""
_SLOWEST_M_S = 1e-6


def _require_speed(speed_m_s: float) -> float:
    if speed_m_s < _SLOWEST_M_S:
        least = "> 0" if speed_m_s <= 0.0 else f">= {_SLOWEST_M_S:g}"
        raise wrong("{} is not " + least)
    return speed_m_s


def _require_point(point_m: list[float]) -> list[float]:
    if len(point_m) not in (2, 3):
        raise wrong(f"has {len(point_m)} instead of 2 or 3 numbers")
    return point_m


def _require_fleet(uavs: list[UavTable]) -> list[UavTable]:
    if not uavs:
        raise wrong("the fleet is empty")
    return uavs


_Kind = Annotated[str, Field(min_length=1, max_length=64)]
_Seconds = Annotated[float, Field(ge=0.0, le=1e9)]
_Metres = Annotated[float, Field(ge=-1e7, le=1e7)]
_Latitude = Annotated[float, Field(ge=-90.0, le=90.0)]
_Longitude = Annotated[float, Field(ge=-180.0, le=180.0)]
_Altitude = Annotated[float, Field(ge=-1e5, le=1e5)]
_Point = Annotated[list[_Metres], AfterValidator(_require_point)]


class MissionTable(StrictTable):
    """``[mission]``."""

    horizon_s: Annotated[float, Field(gt=0.0, le=1e9)]
    success_default: Probability = 1.0
    survival_default: Probability = 1.0
    reattempt_failed: bool = False


class OriginTable(StrictTable):
    """``[origin]``."""

    lat_deg: Annotated[float, Field(ge=-89.0, le=89.0)]
    lon_deg: _Longitude
    alt_m: _Altitude


class _Placed(StrictTable):
    position_m: _Point | None = None
    lat_deg: _Latitude | None = None
    lon_deg: _Longitude | None = None
    alt_m: _Altitude | None = None


class UavTable(_Placed):
    """``[[uav]]``."""

    id: Id
    speed_m_s: Annotated[float, Field(le=1e6), AfterValidator(_require_speed)]
    success: dict[str, Probability] = Field(default_factory=dict)
    survival: dict[str, Probability] = Field(default_factory=dict)
    kind: _Kind | None = None


class TaskTable(_Placed):
    """``[[task]]``."""

    id: Id
    value: Annotated[float, Field(ge=0.0, le=1e12)]
    service_s: _Seconds = 0.0
    kind: _Kind | None = None
    appears_s: _Seconds = 0.0


class Scenario(StrictTable):
    """A whole file."""

    version: Annotated[int, known_schema(SCHEMA)] = Field(alias="schema")
    name: Id
    mission: MissionTable
    origin: OriginTable | None = None
    uav: Annotated[list[UavTable], AfterValidator(_require_fleet)]
    task: list[TaskTable]
    tasks_from: Annotated[str, Field(min_length=1)] | None = None


_TABLES: Mapping[tuple[str, ...], TableShape] = {
    (): TableShape.of("the top", Scenario),
    ("mission",): TableShape.of("[mission]", MissionTable),
    ("origin",): TableShape.of("[origin]", OriginTable),
    ("uav",): TableShape.of("[[uav]]", UavTable),
    ("task",): TableShape.of("[[task]]", TaskTable),
}

_LATITUDE = "a latitude within -90..90 [deg]"
_LONGITUDE = "a longitude within -180..180 [deg]"
_ALTITUDE = "a height above mean sea level within -1e5..1e5 [m], such as 488.0"
_RIGHT: Mapping[tuple[str, ...], str] = {
    ("schema",): f"schema = {SCHEMA}",
    ("name",): f'an id of {ID_RULE}, such as name = "survey-1"',
    ("mission",): "a table [mission] with at least horizon_s",
    ("origin",): "a table [origin] with lat_deg, lon_deg and alt_m",
    ("uav",): "one table [[uav]] per UAV",
    ("task",): "one table [[task]] per task, or task = [] if all come later",
    ("tasks_from",): 'a file of tasks, such as tasks_from = "survey.plan"',
    ("mission", "horizon_s"): "a number > 0 and <= 1e9 [s], such as horizon_s = 600.0",
    ("mission", "success_default"): PROBABILITY,
    ("mission", "survival_default"): PROBABILITY,
    ("mission", "reattempt_failed"): "true or false",
    ("origin", "lat_deg"): "a latitude within -89..89 [deg]",
    ("origin", "lon_deg"): _LONGITUDE,
    ("origin", "alt_m"): _ALTITUDE,
    ("uav", "id"): f"an id of {ID_RULE}",
    ("uav", "speed_m_s"): "a cruise speed > 0 and <= 1e6 [m/s], such as speed_m_s = 12.0",
    ("uav", "success"): f"a table of task ids or kinds with {PROBABILITY} each",
    ("uav", "survival"): f"a table of task ids or kinds with {PROBABILITY} each",
    ("uav", "success", "*"): PROBABILITY,
    ("uav", "survival", "*"): PROBABILITY,
    ("uav", "kind"): "a word of 1 to 64 characters",
    ("task", "id"): f"an id of {ID_RULE}",
    ("task", "value"): "a number >= 0 and <= 1e12, such as value = 5.0",
    ("task", "service_s"): "a number >= 0 and <= 1e9 [s]",
    ("task", "kind"): "a word of 1 to 64 characters",
    ("task", "appears_s"): "a number >= 0 and <= 1e9 [s]; 0 if known from the start",
} | {
    (table, key): right
    for table in ("uav", "task")
    for key, right in {
        "position_m": "[east, north] or [east, north, up], each within -1e7..1e7 [m]",
        "lat_deg": _LATITUDE,
        "lon_deg": _LONGITUDE,
        "alt_m": _ALTITUDE,
    }.items()
}


def validate(document: Document) -> tuple[Scenario | None, list[Finding]]:
    """The scenario if every shape, type and range is right, and all findings otherwise."""
    return validate_tables(Scenario, document, _TABLES, _RIGHT)
