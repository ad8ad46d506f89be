"""Files of schema 2 as the product reads them, and as the oracle does from the text alone."""

from __future__ import annotations

import math
import random
import re
from typing import Any

import pytest

from swarm.model import Mission, Task, Uav
from swarm.runtime.errors import InputError
from swarm.scenario import format_scenario, parse_scenario
from tests.support.field_oracle import faults as oracle
from tests.support.field_oracle.made_up import KINDS, SIDE_M, Draft, as_toml, made_up
from tests.support.field_oracle.scenario import FieldScenario, FieldTask, FieldUav, read

Told = set[tuple[str, ...]]
"""Who is said to be wrong: a UAV; a place and a zone; a line and a zone."""


def told_by_product(draft: Draft) -> Told:
    try:
        parse_scenario(as_toml(draft).encode(), "s.toml")
    except InputError as error:
        told: Told = set()
        for line in str(error).splitlines():
            told |= _said(line)
        return told
    return set()


def _said(line: str) -> Told:
    if found := re.match(r's.toml: uav\[\d+\] "(\w+)".airspeed_m_s: .* than the wind', line):
        return {("slow", found[1])}
    found = re.match(r's.toml: (\w+)\[\d+\] "(\w+)".(position_m|path_m\[(\d)\]): (.*?);', line)
    assert found, line
    name, identity, _, number, problem = found.groups()
    zone = re.search(r"zone '([\w-]+)'", problem)
    assert zone, line
    place = {"uav": "start:", "base": "base:", "task": "task:"}[name] + identity
    if name == "task":
        place += f":{number or 0}"
    told: Told = set() if problem.startswith("the line to it") else {("place", place, zone[1])}
    return told | ({("line", identity, zone[1])} if number else set())


def told_by_oracle(draft: Draft) -> Told:
    told: Told = set()
    for words in oracle.faults(draft):
        if found := re.match(r"UAV (\w+): airspeed_m_s is not more", words):
            told.add(("slow", found[1]))
        elif found := re.match(r"(\S+) lies in zone ([\w-]+) or nearer", words):
            told.add(("place", found[1], found[2]))
        elif found := re.match(r"line (\w+) meets zone ([\w-]+) or", words):
            told.add(("line", found[1], found[2]))
        else:
            raise AssertionError(words)
    return told


def spoilt(draft: Draft, rng: random.Random) -> Draft:
    """``draft`` with places and lines moved anywhere, and more wind or margin, or none of it."""
    for row in (*draft["uav"], *draft["base"], *draft["task"]):
        if rng.random() < 0.4:
            key = "position_m" if "position_m" in row else "path_m"
            place = [rng.randrange(int(2 * SIDE_M) + 1) / 2 for _ in range(2)]
            if key == "position_m":
                row[key] = [*place, *row[key][2:]]
            else:
                number = rng.randrange(len(row[key]))
                row[key][number] = [*place, *row[key][number][2:]]
    if rng.random() < 0.3:
        draft["mission"]["zone_margin_m"] = round(rng.uniform(1.0, 25.0), 1)
    if rng.random() < 0.3:
        draft["mission"]["wind_m_s"] = [7.0, round(rng.uniform(-9.0, 9.0), 1)]
    return draft


def on_corners(draft: Draft, rng: random.Random) -> Draft:
    """``draft`` with places on corners of zones and on the middle of their edges."""
    rings = [
        ring for zone in draft["zone"] for ring in (zone["polygon_m"], *zone.get("holes_m", []))
    ]
    for row in (*draft["uav"], *draft["task"]):
        if "position_m" in row and rings and rng.random() < 0.5:
            ring = rng.choice(rings)
            number = rng.randrange(len(ring))
            share = rng.choice([0.0, 0.5])
            row["position_m"] = [
                a + share * (b - a) for a, b in zip(ring[number - 1], ring[number], strict=True)
            ]
    return draft


def test_product_and_oracle_find_the_same_faults() -> None:
    found: list[Told] = []
    for seed in range(150):
        kind = ("zones", "inclusive", "margin", "wind", "all", "all-but-margin")[seed % 6]
        draft = spoilt(made_up(seed, kind, n_uavs=3), random.Random(seed))
        told = told_by_product(draft)

        assert told == told_by_oracle(draft), (kind, seed)
        found.append(told)
    kinds = [fault[0] for told in found for fault in told]
    assert sum(not told for told in found) > 20  # both also find nothing
    assert min(map(kinds.count, ("slow", "place", "line"))) > 10


def test_product_and_oracle_agree_on_borders() -> None:
    """They count as outside; a margin is kept from them all the same."""
    wrong = 0
    for seed in range(80):
        kind = ("zones", "margin", "inclusive", "all-but-margin")[seed % 4]
        draft = on_corners(made_up(seed, kind, n_uavs=3, n_tasks=4), random.Random(seed))
        told = told_by_product(draft)

        assert told == told_by_oracle(draft), (kind, seed)
        wrong += bool(told)
    assert 10 < wrong < 70


@pytest.mark.parametrize("kind", KINDS)
def test_product_and_oracle_read_the_same(kind: str) -> None:
    for seed in range(8):
        draft = made_up(seed, kind)
        mission, scenario = parse_scenario(as_toml(draft).encode(), "s.toml"), read(draft)

        assert_same(mission, scenario)
        assert parse_scenario(format_scenario(mission).encode(), "again.toml") == mission


def test_a_file_in_degrees_is_read_alike() -> None:
    for seed in range(12):
        draft = in_degrees(made_up(seed, "all-but-margin"))
        mission = parse_scenario(as_toml(draft).encode(), "s.toml")

        assert_same(mission, read(draft))


def in_degrees(draft: Draft) -> Draft:
    """A draft much like ``draft`` with places in degrees, some 1e-5 of a degree for each metre."""
    draft["origin"] = {"lat_deg": 47.0, "lon_deg": 8.0, "alt_m": 400.0}

    def point(numbers: list[float]) -> list[float]:
        return [47.0 + 9e-6 * numbers[1], 8.0 + 13e-6 * numbers[0]]

    for row in (*draft["uav"], *draft["base"], *draft["task"]):
        if "path_m" in row:
            row["path"] = [point(each) for each in row.pop("path_m")]
        else:
            place = row.pop("position_m")
            row["lat_deg"], row["lon_deg"] = point(place)
            if place[2:]:
                row["alt_m"] = 400.0 + place[2]
    for zone in draft["zone"]:
        if "holes_m" not in zone:  # those have metres alone
            zone["polygon"] = [point(corner) for corner in zone.pop("polygon_m")]
    draft["zone"] = [zone for zone in draft["zone"] if "holes_m" not in zone]
    return draft


def assert_same(mission: Mission, scenario: FieldScenario) -> None:
    assert (mission.name, mission.horizon_s) == (scenario.name, scenario.horizon_s)
    assert mission.wind_enu_m_s == scenario.wind_m_s
    assert (mission.zone_margin_m, mission.band_m) == (scenario.margin_m, scenario.band_m)
    for uav, its in zip(mission.uavs, scenario.uavs, strict=True):
        assert of_uav(uav) == of_oracle_uav(its)
        assert (dict(uav.success), dict(uav.survival)) == (its.success, its.survival)
    for base, of_base in zip(mission.bases, scenario.bases, strict=True):
        assert (base.id, base.swap_s, base.slots) == (of_base.id, of_base.swap_s, of_base.slots)
        assert base.position_enu_m == (*of_base.stop.at, of_base.stop.up_m)
    for zone, of_zone in zip(mission.zones, scenario.zones, strict=True):
        assert (zone.polygon_enu_m, *zone.holes_enu_m) == of_zone.rings
        assert (zone.bottom_m, zone.top_m) == (of_zone.floor_m, of_zone.ceiling_m)
        assert (zone.id, zone.inclusive) == (of_zone.id, of_zone.inclusive)
    for task, of_task in zip(mission.tasks, scenario.tasks, strict=True):
        assert of_field_task(task) == of_oracle_task(of_task)
        line = task.path_enu_m or (task.position_enu_m,)
        assert [place[:2] for place in line] == [stop.at for stop in of_task.stops]
        if task.height_m is None:
            assert [place[2] for place in line] == [stop.up_m for stop in of_task.stops]


def of_uav(uav: Uav) -> tuple[Any, ...]:
    return (
        uav.id,
        uav.kind,
        uav.position_enu_m,
        uav.speed_m_s,
        uav.acceleration_m_s2,
        uav.airspeed_m_s,
        math.inf if uav.endurance_s is None else uav.endurance_s,
        uav.reserve_frac,
        uav.charge_frac,
    )


def of_oracle_uav(uav: FieldUav) -> tuple[Any, ...]:
    return (
        uav.id,
        uav.kind,
        (*uav.start.at, uav.start.up_m),
        uav.speed_m_s,
        uav.acceleration_m_s2,
        uav.airspeed_m_s,
        uav.endurance_s,
        uav.reserve_frac,
        uav.charge_frac,
    )


def of_field_task(task: Task) -> tuple[Any, ...]:
    closes_s = math.inf if task.closes_s is None else task.closes_s
    times = (task.service_s, task.appears_s, task.due_s, task.opens_s, closes_s)
    return task.id, task.kind, task.value, times


def of_oracle_task(task: FieldTask) -> tuple[Any, ...]:
    times = (task.service_s, task.appears_s, task.due_s, task.opens_s, task.closes_s)
    return task.id, task.kind, task.value, times
