"""What section 11 calls a fault of the file.

Leaves out: what every reader of a TOML would find (types, unknown keys, doubled ids).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from tests.support.field_oracle.geometry import Side, blocks, boxes_apart_m, side_of
from tests.support.field_oracle.rounded import SLACK_M, distance_m
from tests.support.field_oracle.scenario import FieldScenario, FieldZone, Point, Stop, read

NEW_KEYS: Mapping[str, Sequence[str]] = {
    "mission": ("wind_m_s", "zone_margin_m", "separation_m", "band_m"),
    "uav": (
        "acceleration_m_s2",
        "airspeed_m_s",
        "endurance_s",
        "reserve_frac",
        "charge_frac",
    ),
    "task": ("due_s", "opens_s", "closes_s", "path_m", "path", "trigger_m", "height_m"),
}
NEW_TABLES = ("base", "zone", "area", "terrain")


def faults(table: Mapping[str, Any]) -> list[str]:
    """Every fault, in words."""
    return list(_faults(table))


def is_faultless(table: Mapping[str, Any]) -> bool:
    """Whether there is no fault at all; stops at the first."""
    return next(_faults(table), None) is None


def _faults(table: Mapping[str, Any]) -> Iterator[str]:
    if table.get("schema") == 1:
        yield from (f"schema = 1 with {key}: say schema = 2" for key in _new_keys(table))
        return
    scenario = read(table)
    yield from _slow_uavs(scenario)
    yield from _forbidden_places(scenario)


def _slow_uavs(scenario: FieldScenario) -> Iterator[str]:
    wind_m_s = math.hypot(*scenario.wind_m_s)
    for uav in scenario.uavs:
        if uav.airspeed_m_s is not None and uav.airspeed_m_s <= wind_m_s:
            yield f"UAV {uav.id}: airspeed_m_s is not more than the wind's {wind_m_s}"


def _forbidden_places(scenario: FieldScenario) -> Iterator[str]:
    for zone in scenario.zones:
        for stop in _stops(scenario):
            if _forbids(zone, stop.at, stop.at, scenario.margin_m):
                yield f"{stop.name} lies in zone {zone.id} or nearer than the margin"
        for task in scenario.tasks:
            for a, b in itertools.pairwise(task.stops):
                if _forbids(zone, a.at, b.at, scenario.margin_m):
                    yield f"line {task.id} meets zone {zone.id} or its margin"


def _new_keys(table: Mapping[str, Any]) -> Iterator[str]:
    yield from (key for key in NEW_TABLES if table.get(key))
    for name, keys in NEW_KEYS.items():
        rows = table.get(name, ())
        for row in [rows] if isinstance(rows, Mapping) else rows:
            yield from (f"{name}.{key}" for key in keys if key in row)


def _stops(scenario: FieldScenario) -> Iterator[Stop]:
    for uav in scenario.uavs:
        yield uav.start
    for base in scenario.bases:
        yield base.stop
    for task in scenario.tasks:
        yield from task.stops


def _forbids(zone: FieldZone, a: Point, b: Point, margin_m: float) -> bool:
    if margin_m == 0.0:
        return blocks(zone, a, b)
    for ring in zone.rings:
        for c, d in zip(ring, [*ring[1:], ring[0]], strict=True):
            if boxes_apart_m(a, b, c, d) > margin_m:
                continue
            if distance_m(a, b, c, d) < margin_m - SLACK_M:
                return True
    return side_of(a, zone.rings) is (Side.OUTSIDE if zone.inclusive else Side.INSIDE)
