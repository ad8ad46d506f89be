"""Shapes, types and ranges of a scenario file, and what to say when they are wrong.

The upper limits are far beyond any aircraft; they keep every product of eq. 1
finite, so that a misplaced exponent is named here and not met as an infinite J.
Leaves out: rules between several places of the file (swarm.scenario.checks).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError
from pydantic_core import ErrorDetails, PydanticCustomError

from swarm.model.ids import ID_RULE, valid_id
from swarm.scenario.findings import Document, Finding, Path, absent, close_match, shown

__all__ = ["SCHEMA", "MissionTable", "OriginTable", "Scenario", "TaskTable", "UavTable", "validate"]


SCHEMA = 1
"""The version of the format that is read and written."""
_SLOWEST_M_S = 1e-6


def _require_id(name: str) -> str:
    if not valid_id(name):
        raise PydanticCustomError("id", "not an id")
    return name


def _require_schema(version: int) -> int:
    if version != SCHEMA:
        raise PydanticCustomError("schema", "unknown version")
    return version


_Id = Annotated[str, AfterValidator(_require_id)]
_Kind = Annotated[str, Field(min_length=1, max_length=64)]
_Probability = Annotated[float, Field(ge=0.0, le=1.0)]
_Seconds = Annotated[float, Field(ge=0.0, le=1e9)]
_Metres = Annotated[float, Field(ge=-1e7, le=1e7)]
_Latitude = Annotated[float, Field(ge=-90.0, le=90.0)]
_Longitude = Annotated[float, Field(ge=-180.0, le=180.0)]
_Altitude = Annotated[float, Field(ge=-1e5, le=1e5)]
_Point = Annotated[list[_Metres], Field(min_length=2, max_length=3)]


class _Table(BaseModel):
    model_config = ConfigDict(strict=True, extra="forbid", allow_inf_nan=False, frozen=True)


class MissionTable(_Table):
    """``[mission]``."""

    horizon_s: Annotated[float, Field(gt=0.0, le=1e9)]
    success_default: _Probability = 1.0
    survival_default: _Probability = 1.0
    reattempt_failed: bool = False


class OriginTable(_Table):
    """``[origin]``."""

    lat_deg: Annotated[float, Field(ge=-89.0, le=89.0)]
    lon_deg: _Longitude
    alt_m: _Altitude


class _Placed(_Table):
    position_m: _Point | None = None
    lat_deg: _Latitude | None = None
    lon_deg: _Longitude | None = None
    alt_m: _Altitude | None = None


class UavTable(_Placed):
    """``[[uav]]``."""

    id: _Id
    speed_m_s: Annotated[float, Field(ge=_SLOWEST_M_S, le=1e6)]
    success: dict[str, _Probability] = Field(default_factory=dict)
    survival: dict[str, _Probability] = Field(default_factory=dict)
    kind: _Kind | None = None


class TaskTable(_Placed):
    """``[[task]]``."""

    id: _Id
    value: Annotated[float, Field(ge=0.0, le=1e12)]
    service_s: _Seconds = 0.0
    kind: _Kind | None = None
    appears_s: _Seconds = 0.0


class Scenario(_Table):
    """A whole file."""

    version: Annotated[int, AfterValidator(_require_schema)] = Field(alias="schema")
    name: _Id
    mission: MissionTable
    origin: OriginTable | None = None
    uav: Annotated[list[UavTable], Field(min_length=1)]
    task: list[TaskTable]
    tasks_from: Annotated[str, Field(min_length=1)] | None = None


_TABLES: Mapping[str, type[BaseModel]] = {
    "": Scenario,
    "mission": MissionTable,
    "origin": OriginTable,
    "uav": UavTable,
    "task": TaskTable,
}
_KEYS: Mapping[str, tuple[str, ...]] = {
    name: tuple(
        sorted((field.alias or key for key, field in table.model_fields.items()), key="id".__ne__)
    )
    for name, table in _TABLES.items()
}
"""Keys of every table, the id first."""

_PROBABILITY = "a probability within 0..1"
_LATITUDE = "a latitude within -90..90 [deg]"
_LONGITUDE = "a longitude within -180..180 [deg]"
_ALTITUDE = "a height above mean sea level within -1e5..1e5 [m], such as 488.0"
_RIGHT: Mapping[tuple[str, str], str] = {
    ("", "schema"): f"schema = {SCHEMA}",
    ("", "name"): f'an id of {ID_RULE}, such as name = "survey-1"',
    ("", "mission"): "a table [mission] with at least horizon_s",
    ("", "origin"): "a table [origin] with lat_deg, lon_deg and alt_m",
    ("", "uav"): "one table [[uav]] per UAV",
    ("", "task"): "one table [[task]] per task, or task = [] if all come later",
    ("", "tasks_from"): 'a file of tasks, such as tasks_from = "survey.plan"',
    ("mission", "horizon_s"): "a number > 0 and <= 1e9 [s], such as horizon_s = 600.0",
    ("mission", "success_default"): _PROBABILITY,
    ("mission", "survival_default"): _PROBABILITY,
    ("mission", "reattempt_failed"): "true or false",
    ("origin", "lat_deg"): "a latitude within -89..89 [deg]",
    ("origin", "lon_deg"): _LONGITUDE,
    ("origin", "alt_m"): _ALTITUDE,
    ("uav", "id"): f"an id of {ID_RULE}",
    ("uav", "speed_m_s"): "a cruise speed > 0 and <= 1e6 [m/s], such as speed_m_s = 12.0",
    ("uav", "success"): f"a table of task ids or kinds with {_PROBABILITY} each",
    ("uav", "survival"): f"a table of task ids or kinds with {_PROBABILITY} each",
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
_WANTED: Mapping[str, str] = {
    "float_type": "a number",
    "int_type": "an integer",
    "bool_type": "true or false",
    "string_type": "a string in quotes",
    "list_type": "an array",
    "dict_type": "a table",
    "model_type": "a table",
}
_RANGE: Mapping[str, str] = {
    "greater_than": "> {gt:g}",
    "greater_than_equal": ">= {ge:g}",
    "less_than_equal": "<= {le:g}",
}


def validate(document: Document) -> tuple[Scenario | None, list[Finding]]:
    """The scenario if every shape, type and range is right, and all findings otherwise."""
    try:
        return Scenario.model_validate(document), []
    except ValidationError as error:
        details = error.errors(include_url=False, include_context=True)
    findings: list[Finding] = []
    for detail in details:
        path = detail["loc"]
        if detail["type"] == "missing":
            findings.append(absent(path, _remedy(path)))
        elif detail["type"] == "extra_forbidden":
            findings.append(_unknown_key(path, document))
        else:
            findings.append(Finding(path, _problem(detail), _remedy(path)))
    return None, findings


def _problem(detail: ErrorDetails) -> str:
    kind, value, path = detail["type"], detail["input"], detail["loc"]
    context: dict[str, Any] = detail.get("ctx", {})
    if kind == "float_type" and isinstance(value, int) and not isinstance(value, bool):
        return f"{shown(value)} is out of range"  # no float is as large
    if kind in _WANTED:
        return f"{shown(value)} is not {_WANTED[kind]}"
    if kind in _RANGE:
        wanted = _RANGE[kind].format(**context)
        if _is_probability(path):
            wanted = "within 0..1"
        elif path[-1] == "speed_m_s" and value <= 0.0:
            wanted = "> 0"
        return f"{shown(value)} is not {wanted}"
    if path == ("uav",):
        return "the fleet is empty"
    match kind:
        case "finite_number":
            return f"{shown(value)} is not a finite number"
        case "id":
            return f"{shown(value)} is not an id"
        case "schema":
            return f"version {shown(value)} of the format is not known"
        case "string_too_short":
            return "the word is empty"
        case "string_too_long":
            return f"{shown(value)} is too long"
        case "too_short" | "too_long":
            return f"has {context['actual_length']} instead of 2 or 3 numbers"
        case _:
            return f"{shown(value)} is not valid"


def _is_probability(path: Path) -> bool:
    in_table = len(path) > 3 and path[2] in ("success", "survival")
    return in_table or path[-1] in ("success_default", "survival_default")


def _remedy(path: Path) -> str:
    if _is_probability(path):
        return f"give {_PROBABILITY}"
    names = [step for step in path if isinstance(step, str)]
    # ("uav",) is the array and ("uav", 3) one table of it; both are keys of the top.
    table, key = ("", names[0]) if len(names) == 1 else (names[0], names[1])
    return f"give {_RIGHT[table, key]}"


def _unknown_key(path: Path, document: Document) -> Finding:
    *parents, key = path
    table = str(parents[0]) if parents else ""
    name = str(key)
    keys = _KEYS[table]
    there = _there(document, path[:-1])
    meant = close_match(name, [known for known in keys if known not in there])
    if meant is not None:
        return Finding(path, "unknown key", f"did you mean {meant!r}?", meant=(*parents, meant))
    homes = [home for home, known in _KEYS.items() if name in known and home != table]
    if homes and not (table in ("uav", "task") and homes[0] == ""):
        home = homes[0]
        where = f"[[{home}]]" if home in ("uav", "task") else f"[{home}]" if home else "the top"
        return Finding(path, "unknown key here", f"it belongs in {where}")
    return Finding(path, "unknown key", f"the keys here are {', '.join(keys)}")


def _there(document: Document, path: Path) -> Mapping[str, object]:
    here: Any = document
    for step in path:
        here = here[step]
    return here if isinstance(here, Mapping) else {}
