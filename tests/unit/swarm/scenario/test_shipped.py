"""Shipped scenarios: found by name, right, and worth flying."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from swarm.allocation.lower_level import TeamState, next_decision, rank_of, run
from swarm.allocation.objective import evaluate
from swarm.allocation.problem import Problem
from swarm.allocation.rules import rule_by_name
from swarm.model import Mission
from swarm.model.mission import kinds_of
from swarm.model.vehicles import VehicleKind
from swarm.runtime.errors import InputError
from swarm.scenario import format_scenario, load_scenario, parse_scenario
from swarm.scenario.files import resolve_scenario, shipped_scenarios

PLAIN = ["meadow", "orchard", "table-1", "valley-popups", "valley-survey"]
"""Those of schema 1."""
FIELD = ["airstrip", "hayfield", "reservoir-inspection", "ridge", "roundup", "vineyard"]
NAMES = sorted([*PLAIN, *FIELD])


def shipped(name: str) -> Mission:
    return load_scenario(resolve_scenario(name))


def test_every_shipped_scenario_is_found_by_its_own_name() -> None:
    assert list(shipped_scenarios()) == NAMES
    assert [shipped(name).name for name in NAMES] == NAMES


def test_without_the_package_nothing_is_shipped() -> None:
    assert shipped_scenarios("no_such_package.scenarios") == {}
    assert shipped_scenarios("sim.no_such_folder") == {}


def test_existing_file_wins_over_a_shipped_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert resolve_scenario("table-1") == shipped_scenarios()["table-1"]
    (tmp_path / "table-1").write_text("mine")
    assert resolve_scenario("table-1") == Path("table-1")


@pytest.mark.parametrize(
    ("argument", "line"),
    [
        ("tabel-1", "tabel-1: no such scenario file; did you mean 'table-1'? Shipped scenarios: "),
        (
            "valley-survey.toml",
            "valley-survey.toml: no such scenario file; did you mean 'valley-survey'? Shipped",
        ),
        (
            "",
            "SCENARIO: no such scenario file; give a file or a shipped scenario: airstrip, ",
        ),
        (
            "a\nb",
            r"'a\nb': no such scenario file; give a file or a shipped scenario: airstrip, ",
        ),
        (
            "\0",
            r"'\x00': no such scenario file; give a file or a shipped scenario: airstrip, ",
        ),
        ("x" * 5000, "x" * 5000 + ": no such scenario file; give a file or a shipped scenario: "),
    ],
)
def test_unknown_scenario_takes_one_line(argument: str, line: str) -> None:
    with pytest.raises(InputError) as caught:
        resolve_scenario(argument)
    assert str(caught.value).startswith(line)
    assert "\n" not in str(caught.value)


def test_folder_is_no_scenario(tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        resolve_scenario(str(tmp_path))
    assert str(caught.value).startswith(f"{tmp_path}: is a folder, not a scenario file; give ")


def test_table_1_is_the_papers() -> None:
    mission = shipped("table-1")
    places = [task.position_enu_m[:2] for task in mission.tasks]

    assert places == [(1, 10), (2, 2), (3, 7), (7, 1), (8, 8), (4, 3), (5, 9), (6, 5)]
    assert [task.value for task in mission.tasks] == [5, 7, 4, 6, 5, 4, 4.5, 4.5]
    assert [(uav.position_enu_m[:2], uav.speed_m_s) for uav in mission.uavs] == [
        ((5, 0), 4),
        ((5, 0), 5),
        ((5, 0), 4),
    ]
    better = {"uav1": {"t1", "t2", "t3"}, "uav2": {"t7", "t8"}, "uav3": {"t4", "t5", "t6"}}
    for uav, task in itertools.product(mission.uavs, mission.tasks):
        assert mission.success(uav, task) == (0.9 if task.id in better[uav.id] else 0.7)
        assert mission.survival(uav, task) == 1.0
    assert mission.horizon_s == 5.0


def test_table_1_gives_the_checked_greedy_figures() -> None:
    problem = Problem.from_mission(shipped("table-1"))
    greedy = rule_by_name("greedy")
    figures = {
        sequence: evaluate(
            problem, run(problem, TeamState.at_start(problem), rank_of(sequence), greedy)[0]
        )[0]
        for sequence in itertools.permutations(range(3))
    }

    assert figures[0, 2, 1] == pytest.approx(118.4939, abs=1e-4)
    assert figures[1, 0, 2] == pytest.approx(104.2051, abs=1e-4)


def test_survey_is_a_realistic_fleet_on_a_few_square_kilometres() -> None:
    mission = shipped("valley-survey")
    east_m, north_m, _ = zip(*(task.position_enu_m for task in mission.tasks), strict=True)
    area_km2 = (max(east_m) - min(east_m)) * (max(north_m) - min(north_m)) / 1e6

    assert (len(mission.uavs), len(mission.tasks)) == (10, 60)
    assert 2.0 < area_km2 < 6.0
    assert mission.origin is not None
    assert {task.kind for task in mission.tasks} == {"survey", "inspect", "photograph"}
    assert all(8.0 <= uav.speed_m_s <= 15.0 for uav in mission.uavs)
    assert all(5.0 <= task.service_s <= 30.0 for task in mission.tasks)
    assert mission.known_at_start() == mission


def test_popups_has_twelve_known_tasks_and_four_surprises() -> None:
    mission = shipped("valley-popups")

    assert len(mission.uavs) == 4
    assert [task.appears_s for task in mission.tasks if task.appears_s] == [30, 60, 90, 120]
    assert len(mission.known_at_start().tasks) == 12


@pytest.mark.parametrize("name", NAMES)
def test_uavs_do_not_start_on_top_of_each_other_nor_of_a_task(name: str) -> None:
    mission = shipped(name)
    starts = [uav.position_enu_m for uav in mission.uavs]
    places = [task.position_enu_m for task in mission.tasks]
    apart_m = [math.dist(a, b) for a, b in itertools.combinations(places, 2)]

    assert min(apart_m) > 1.0
    if name != "table-1":  # whose three UAVs share their start
        assert min(math.dist(a, b) for a, b in itertools.combinations(starts, 2)) >= 10.0
        assert min(math.dist(a, b) for a, b in itertools.product(starts, places)) > 50.0


@pytest.mark.parametrize("name", PLAIN)
def test_no_greedy_plan_passes_the_horizon(name: str) -> None:
    problem = Problem.from_mission(shipped(name))
    sequence = range(problem.n_uav)
    greedy = rule_by_name("greedy")
    for start in sequence:
        turned = [*sequence[start:], *sequence[:start]]
        _, completion_s = run(problem, TeamState.at_start(problem), rank_of(turned), greedy)
        assert completion_s.max() < 0.9 * problem.horizon_s


def test_survey_has_no_near_ties_in_its_best_sequence() -> None:
    problem = Problem.from_mission(shipped("valley-survey"))
    rank = rank_of([4, 0, 3, 8, 9, 5, 6, 2, 1, 7])  # the best that a long search has found
    greedy = rule_by_name("greedy")
    planned, _ = run(problem, TeamState.at_start(problem), rank, greedy)
    rng = np.random.default_rng(0)

    for _ in range(30):
        late_s = rng.uniform(0.0, 0.5, problem.n_task)
        state = TeamState.at_start(problem)
        routes: list[list[int]] = [[] for _ in range(problem.n_uav)]
        for _ in range(problem.n_task):
            uav = min(range(problem.n_uav), key=lambda j: (state.free_s[j], rank[j]))
            decision = next_decision(problem, state, rank, greedy, uav)
            assert decision is not None
            completion_s = decision.completion_s + late_s[decision.task]
            state.apply(problem, replace(decision, completion_s=completion_s))
            routes[uav].append(decision.task)
        assert routes == planned


def test_reservoir_has_all_that_limits_fleets_in_the_field() -> None:
    mission = shipped("reservoir-inspection")

    assert (len(mission.uavs), len(mission.bases), len(mission.zones)) == (3, 2, 2)
    assert set(mission.constraints) == {
        "acceleration_m_s2",
        "airspeed_m_s",
        "endurance_s",
        "due_s",
        "opens_s",
        "closes_s",
        "path_m",
        "wind_m_s",
        "base",
        "zone",
    }
    assert any(base.slots == 1 for base in mission.bases)


@pytest.mark.parametrize("name", NAMES)
def test_shipped_scenario_survives_being_written(name: str) -> None:
    mission = shipped(name)

    assert parse_scenario(format_scenario(mission).encode(), name) == mission


def test_roundup_has_a_task_for_every_kind_of_vehicle() -> None:
    mission = shipped("roundup")
    able = {
        uav.id: {task.kind for task in mission.tasks if mission.success(uav, task) > 0.0}
        for uav in mission.uavs
    }

    assert set(kinds_of(mission)) == set(VehicleKind) - {VehicleKind.PLANE}
    assert able == {"copter": {"roof", "herd"}, "rover": {"trough"}, "plane": {"herd"}}


def test_airstrip_has_a_plane_with_a_runway_and_tasks_for_it() -> None:
    mission = shipped("airstrip")
    able = {
        uav.id: {task.kind for task in mission.tasks if mission.success(uav, task) > 0.0}
        for uav in mission.uavs
    }

    assert kinds_of(mission) == (VehicleKind.COPTER, VehicleKind.PLANE)
    assert [uav.landing_heading_rad for uav in mission.uavs] == [None, 0.0]
    assert able == {"copter": {"roof"}, "plane": {"field"}}
