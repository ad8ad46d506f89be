"""What QGroundControl asks of a plan before it opens it: keys, types and versions.

Told of its loaders as they stand (src/MissionManager of mavlink/qgroundcontrol, 2017 to 2026):
PlanMasterController, MissionController (version 2), MissionItem and SimpleMissionItem,
GeoFenceController with QGCFencePolygon and QGCMapPolygon, RallyPointController, and JsonHelper, for
which null is a number that is none. Leaves out: complex items, which plans written here have none
of, and what is merely warned of.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

_Kind = Callable[[Any], bool]


def _number(value: Any) -> bool:
    """A JSON number, or null for one that is none."""
    return value is None or (type(value) in (int, float) and math.isfinite(value))


def _string(value: Any) -> bool:
    return isinstance(value, str)


def _flag(value: Any) -> bool:
    return isinstance(value, bool)


def _object(value: Any) -> bool:
    return isinstance(value, dict)


def _array(value: Any) -> bool:
    return isinstance(value, list)


def _version(number: int) -> _Kind:
    return lambda value: type(value) is int and value == number


def _degrees(count: int) -> _Kind:
    """A coordinate: latitude, longitude and, of three, a height; none of them null."""

    def is_place(value: Any) -> bool:
        sound = _array(value) and len(value) == count
        return sound and all(each is not None and _number(each) for each in value)

    return is_place


def _params(value: Any) -> bool:
    return _array(value) and len(value) == 7 and all(map(_number, value))


_SPECIFIES_HEIGHT = {16, 21, 22, 195}
"""Commands written here to whose items a height belongs: of those three more keys go together."""
_ROOT: Mapping[str, _Kind] = {
    "fileType": lambda value: value == "Plan",
    "groundStation": _string,
    "version": _version(1),
    "mission": _object,
    "geoFence": _object,
    "rallyPoints": _object,
}
_MISSION: Mapping[str, _Kind] = {
    "version": _version(2),
    "items": _array,
    "plannedHomePosition": _degrees(3),
    "firmwareType": _number,
}
_MISSION_OPTIONS: Mapping[str, _Kind] = dict.fromkeys(
    ("vehicleType", "cruiseSpeed", "hoverSpeed", "globalPlanAltitudeMode"), _number
)
_ITEM: Mapping[str, _Kind] = {
    "type": lambda value: value == "SimpleItem",
    "frame": lambda value: type(value) is int,
    "command": lambda value: type(value) is int,
    "params": _params,
    "autoContinue": _flag,
    "doJumpId": lambda value: type(value) is int,
}
_HEIGHT: Mapping[str, _Kind] = dict.fromkeys(
    ("AltitudeMode", "Altitude", "AMSLAltAboveTerrain"), _number
)
_FENCE: Mapping[str, _Kind] = {"version": _version(2), "circles": _array, "polygons": _array}
_POLYGON: Mapping[str, _Kind] = {"version": _version(1), "inclusion": _flag, "polygon": _array}
_RALLY: Mapping[str, _Kind] = {"version": _version(2), "points": _array}


def faults(document: Any) -> list[str]:
    """Why QGroundControl would refuse a plan, one line each; none: it opens it."""
    found = _faults("plan", document, _ROOT)
    if found:
        return found
    mission, fence, rally = (document[key] for key in ("mission", "geoFence", "rallyPoints"))
    found = [
        *_faults("mission", mission, _MISSION),
        *_faults("mission", mission, {k: v for k, v in _MISSION_OPTIONS.items() if k in mission}),
        *_faults("geoFence", fence, _FENCE),
        *_faults("rallyPoints", rally, _RALLY),
    ]
    if found:
        return found
    for index, item in enumerate(mission["items"]):
        found += _faults(f"items[{index}]", item, _ITEM)
        if not found and (item["command"] in _SPECIFIES_HEIGHT or item.keys() & _HEIGHT.keys()):
            found += _faults(f"items[{index}]", item, _HEIGHT)
    for index, polygon in enumerate(fence["polygons"]):
        found += _faults(f"polygons[{index}]", polygon, _POLYGON)
        found += _places_faults(f"polygons[{index}]", polygon.get("polygon"), _degrees(2))
    found += _places_faults("points", rally["points"], _degrees(3))
    return found


def _faults(where: str, value: Any, table: Mapping[str, _Kind]) -> list[str]:
    if not _object(value):
        return [f"{where} is no object"]
    missing = [f"{where}.{key} is missing" for key in table if key not in value]
    wrong = [
        f"{where}.{key} is {value[key]!r}"
        for key, is_kind in table.items()
        if key in value and not is_kind(value[key])
    ]
    return missing + wrong


def _places_faults(where: str, places: Sequence[Any] | None, is_place: _Kind) -> list[str]:
    return [f"{where} has {place!r}" for place in places or () if not is_place(place)]
