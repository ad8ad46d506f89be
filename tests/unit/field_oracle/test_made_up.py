"""Made-up scenarios: the same of the same seed, without faults, and no constraint idle."""

from __future__ import annotations

import tomllib
from itertools import product
from typing import Any

import pytest

from swarm.scenario import parse_scenario
from tests.support.field_oracle.brute import best_plan
from tests.support.field_oracle.faults import faults
from tests.support.field_oracle.made_up import KINDS, as_toml, made_up
from tests.support.field_oracle.scenario import read


@pytest.mark.parametrize("kind", KINDS)
def test_same_seed_makes_the_same_and_another_another(kind: str) -> None:
    assert made_up(1, kind) == made_up(1, kind)
    assert made_up(1, kind) != made_up(2, kind)


@pytest.mark.parametrize("kind", KINDS)
def test_toml_says_the_same(kind: str) -> None:
    draft = made_up(5, kind)
    told = tomllib.loads(as_toml(draft))

    assert read(told) == read(draft)


@pytest.mark.parametrize("kind", KINDS)
def test_every_one_is_a_file_without_faults(kind: str) -> None:
    """Zones whose borders never cross themselves, chances of tasks and kinds that there are."""
    for seed, n_uavs in product(range(8), (1, 2, 3)):
        draft = made_up(seed, kind, n_uavs)

        mission = parse_scenario(as_toml(draft).encode(), "made-up.toml")

        assert len(mission.uavs) == n_uavs


FREED: dict[str, dict[str, tuple[str, ...]]] = {
    "acceleration": {"uav": ("acceleration_m_s2",)},
    "wind": {"uav": ("airspeed_m_s",)},
    "energy": {"uav": ("endurance_s",)},
    "slots": {"base": ("slots",)},
    "zones": {"zone": ()},
    "inclusive": {"zone": ()},
    "margin": {"mission": ("zone_margin_m",)},
    "windows": {"task": ("opens_s", "closes_s")},
    "due": {"task": ("due_s",)},
    "heights": {"mission": ("band_m",)},
    "survival": {"uav": ("survival",), "mission": ("survival_default",)},
}
"""By kind what to take away: of which tables which keys, or without keys the whole table."""


@pytest.mark.parametrize("kind", [kind for kind in FREED if kind != "heights"])
def test_constraint_changes_the_optimum_of_some(kind: str) -> None:
    changed = 0
    for seed in range(8):
        draft = made_up(seed, kind, n_tasks=3)
        bound = best_plan(read(draft), in_a_row=1)
        free = best_plan(read(freed(draft, FREED[kind])), in_a_row=1)
        changed += (bound.n_left_out, bound.objective) != (free.n_left_out, free.objective)

    assert changed >= 1


def freed(draft: dict[str, Any], keys: dict[str, tuple[str, ...]]) -> dict[str, Any]:
    free = dict(draft)
    for table, names in keys.items():
        rows = draft[table]
        if not names:
            free[table] = []
        elif isinstance(rows, dict):
            free[table] = {key: value for key, value in rows.items() if key not in names}
        else:
            free[table] = [{k: v for k, v in row.items() if k not in names} for row in rows]
    return free


WALL = {"id": "wall", "polygon_m": [[0, 0], [10, 0], [10, 10], [0, 10]]}


def table(**changed: Any) -> dict[str, Any]:
    return {
        "schema": 2,
        "name": "faulty",
        "mission": {"horizon_s": 10.0, "wind_m_s": [3.0, 4.0]},
        "uav": [{"id": "u1", "position_m": [-10, 0], "speed_m_s": 1.0}],
        "task": [{"id": "t1", "position_m": [20, 0], "value": 1.0}],
        **changed,
    }


@pytest.mark.parametrize(
    ("changed", "fault"),
    [
        ({"uav": [{"id": "u1", "position_m": [0, 0], "speed_m_s": 1, "airspeed_m_s": 5}]}, "wind"),
        ({"task": [{"id": "t1", "position_m": [5, 5], "value": 1}], "zone": [WALL]}, "t1:0 lies"),
        ({"base": [{"id": "b", "position_m": [5, 5]}], "zone": [WALL]}, "base:b lies"),
        (
            {"task": [{"id": "t1", "path_m": [[-1, 5], [20, 5]], "value": 1}], "zone": [WALL]},
            "line t1 meets",
        ),
        ({"zone": [WALL | {"inclusive": True}]}, "start:u1 lies"),
        ({"zone": [WALL], "mission": {"horizon_s": 1, "zone_margin_m": 10.1}}, "start:u1 lies"),
        ({"schema": 1, "mission": {"horizon_s": 1, "band_m": [1, 2]}}, "mission.band_m"),
        ({"schema": 1, "zone": [WALL]}, "schema = 1 with zone"),
    ],
)
def test_fault_of_the_file_is_told(changed: dict[str, Any], fault: str) -> None:
    assert any(fault in found for found in faults(table(**changed)))


@pytest.mark.parametrize(
    "changed",
    [
        {},
        {"task": [{"id": "t1", "position_m": [10, 5], "value": 1}], "zone": [WALL]},
        {"task": [{"id": "t1", "path_m": [[0, 0], [10, 0]], "value": 1}], "zone": [WALL]},
        {"zone": [WALL], "mission": {"horizon_s": 1, "zone_margin_m": 10.0}},
    ],
)
def test_border_is_no_fault(changed: dict[str, Any]) -> None:
    assert faults(table(**changed)) == []
