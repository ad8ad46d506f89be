"""The field's problem from a mission: tables of legs, lines and ways home, and its limits."""

from __future__ import annotations

import math
import pickle
from dataclasses import replace

import numpy as np
import pytest

from swarm.allocation.field import FieldProblem, FieldState, problem_of
from swarm.model import Mission, Task, TaskId, Uav, UavId, Zone, ZoneId
from tests.support.field_missions import mission_of
from tests.support.field_oracle.flight import FlightTimes
from tests.support.field_oracle.made_up import KINDS, made_up
from tests.support.field_oracle.scenario import FieldScenario, Stop, read
from tests.support.seeds import sweeps

ARCS_IN_WIND = 1e-5
"""The oracle flies arcs in straight pieces of half a degree."""


def made(seed: int, kind: str, n_uavs: int = 2) -> tuple[Mission, FieldProblem]:
    mission = mission_of(made_up(seed, kind, n_uavs)).known_at_start()
    return mission, FieldProblem.from_mission(mission)


def stops_of(scenario: FieldScenario) -> list[Stop]:
    """In the order of the nodes."""
    stops = [uav.start for uav in scenario.uavs] + [base.stop for base in scenario.bases]
    for task in scenario.known:
        stops += [task.stops[0], task.stops[-1]] if task.is_line else [task.stops[0]]
    return stops


@pytest.mark.parametrize("sweep", sweeps(3, 20))
@pytest.mark.parametrize("kind", KINDS)
def test_tables_are_those_of_the_oracle(kind: str, sweep: range) -> None:
    for seed in sweep:
        _, problem = made(seed, kind)
        scenario = read(made_up(seed, kind))
        times, stops = FlightTimes(scenario), stops_of(scenario)
        assert len(stops) == problem.n_node
        for row, uav in enumerate(scenario.uavs):
            legs_s = problem.leg_s[problem.kind[row]]
            own = [k for k in range(problem.n_node) if k == row or k >= problem.n_uav]
            for a in own:
                for b in own:
                    leg = times.leg(uav, stops[a], stops[b])
                    expected_s = math.inf if leg is None else leg.time_s
                    assert legs_s[a, b] == pytest.approx(expected_s, rel=ARCS_IN_WIND)
                home = times.home(uav, stops[a])
                if home is None:
                    assert math.isinf(problem.home_s[row, a])
                else:
                    assert problem.home_s[row, a] == pytest.approx(home[1].time_s, rel=ARCS_IN_WIND)
                    ends = [uav.start, *(base.stop for base in scenario.bases)]
                    assert ends[problem.home[row, a] + 1] is home[0]
            for column, task in enumerate(scenario.known):
                for backwards in (False, True):
                    line_s = times.line_s(uav, task, backwards=backwards)
                    expected_s = math.inf if line_s is None else line_s
                    assert problem.line_s[problem.kind[row], column, int(backwards)] == (
                        pytest.approx(expected_s)
                    )
            assert problem.first_s[row] == uav.first_budget_s
            assert problem.full_s[row] == uav.full_budget_s


def test_limits_that_are_absent_are_infinite() -> None:
    mission, problem = made(0, "plain")

    assert np.isinf(problem.closes_s).all()
    assert np.isinf(problem.due_s).all()
    assert np.isinf(problem.full_s).all()
    assert (problem.until_s == mission.horizon_s).all()
    assert problem.required.all()
    assert not problem.is_line.any()
    assert problem.n_base == 0


def test_due_tasks_are_worth_until_then_and_may_be_left_out() -> None:
    mission, problem = made(0, "due")
    due = [task.due_s is not None for task in mission.tasks]

    assert any(due)
    assert (problem.required == ~np.array(due)).all()
    assert (problem.until_s == np.where(due, problem.due_s, mission.horizon_s)).all()


def test_uavs_that_fly_alike_share_a_table() -> None:
    mission, _ = made(0, "plain")
    same = tuple(replace(uav, speed_m_s=9.0) for uav in mission.uavs)

    assert len(FieldProblem.from_mission(mission, uavs=same).leg_s) == 1
    other = (same[0], replace(same[1], speed_m_s=8.0))
    assert len(FieldProblem.from_mission(mission, uavs=other).leg_s) == 2


def test_layers_decide_which_zones_are_flown_round() -> None:
    draft = made_up(0, "plain", 2, 4)
    for uav in draft["uav"]:
        uav.update(position_m=[0.0, 0.0], speed_m_s=10.0)
    draft["task"] = [{"id": "t", "position_m": [100.0, 0.0], "value": 1.0}]
    wall = [[40.0, -50.0], [60.0, -50.0], [60.0, 50.0], [40.0, 50.0]]
    draft["zone"] = [{"id": "wall", "polygon_m": wall, "ceiling_m": 12.0}]
    mission = mission_of(draft)
    problem = FieldProblem.from_mission(mission)
    start_s = FieldState.at_start(problem).first_s[:, -1]

    assert start_s[0] > 12.0  # in its layer of 10 m it meets the wall
    assert start_s[1] == 10.0  # in that of 13 m it does not
    assert len(problem.leg_s) == 2
    low = FieldProblem.from_mission(mission, layers_m=[5.0, 6.0])
    assert (FieldState.at_start(low).first_s[:, -1] > 12.0).all()
    assert len(low.leg_s) == 1
    corners_m = low.corners_m(0, 0, 2)
    assert corners_m is not None
    assert [tuple(corner[:2]) for corner in corners_m][0::3] == [(0.0, 0.0), (100.0, 0.0)]


def test_layers_are_those_of_the_file_whichever_uavs_are_chosen() -> None:
    mission, problem = made(3, "zones", n_uavs=3)
    last = FieldProblem.from_mission(mission, uavs=mission.uavs[2:])

    tasks = slice(problem.n_uav, None)
    whole = problem.leg_s[problem.kind[2]][2, tasks]
    assert (last.leg_s[0][0, last.n_uav :] == whole).all()


@pytest.mark.parametrize("kind", ["plain", "zones", "heights", "lines"])
def test_legs_from_a_node_s_place_are_the_node_s(kind: str) -> None:
    for seed in range(5):
        mission, problem = made(seed, kind)
        for row, uav in enumerate(mission.uavs):
            from_s = problem.legs_from_s(row, uav.position_enu_m)
            assert from_s.tolist() == problem.leg_s[problem.kind[row], row].tolist()


def test_a_team_at_its_start_has_all_before_it() -> None:
    _, problem = made(0, "energy", n_uavs=3)
    state = FieldState.at_start(problem, [2, 0, 1])

    assert state.rank.tolist() == [1, 2, 0]
    assert state.sortie_end_s.tolist() == problem.first_s.tolist()
    assert state.first_s[1].tolist() == problem.leg_s[problem.kind[1], 1].tolist()
    assert state.open.all()
    with pytest.raises(ValueError, match="each of 3 UAVs once"):
        FieldState.at_start(problem, [0, 0, 1])


def test_it_survives_pickling_with_its_network() -> None:
    _, problem = made(1, "all")
    again: FieldProblem = pickle.loads(pickle.dumps(problem))

    assert again.leg_s.tolist() == problem.leg_s.tolist()
    corners_m, other_m = again.corners_m(0, 0, 2), problem.corners_m(0, 0, 2)
    assert np.array_equal(np.array(corners_m), np.array(other_m))


def test_tables_alone_know_no_places() -> None:
    _, problem = made(1, "plain")

    with pytest.raises(ValueError, match="knows no places"):
        replace(problem, network=None).corners_m(0, 0, 1)


def test_no_uavs_and_no_tasks_are_a_problem_too() -> None:
    mission, _ = made(1, "energy")
    nobody: tuple[Uav, ...] = ()

    assert FieldProblem.from_mission(mission, uavs=nobody).n_uav == 0
    assert FieldProblem.from_mission(mission, tasks=()).n_task == 0


def test_problems_of_equal_missions_are_made_once_with_given_layers_and_without() -> None:
    mission, expected = made(1, "plain")

    problem = problem_of(mission)

    assert problem_of(replace(mission)) is problem
    assert np.array_equal(problem.leg_s, expected.leg_s)
    layered = problem_of(mission, [10.0, 20.0])
    assert layered is not problem
    assert problem_of(replace(mission), (10.0, 20.0)) is layered


def test_one_layer_for_each_uav() -> None:
    mission, _ = made(1, "plain")

    with pytest.raises(ValueError, match="a height for each of 2 UAVs"):
        FieldProblem.from_mission(mission, layers_m=[10.0])


@pytest.mark.parametrize(("ceiling_m", "cut"), [(None, (True, True)), (12.0, (True, False))])
def test_lines_through_zones_cannot_be_flown_by_whom_these_concern(
    ceiling_m: float | None, cut: tuple[bool, bool]
) -> None:
    path = ((0.0, 0.0, 0.0), (100.0, 0.0, 0.0))
    lines = [
        Task(TaskId("through"), path[0], 1.0, path_enu_m=path),
        Task(TaskId("round"), path[0], 1.0, path_enu_m=(path[0], (50.0, 30.0, 0.0), path[1])),
        Task(TaskId("bent"), (50.0, -30.0, 0.0), 1.0, path_enu_m=((50.0, -30.0, 0.0), *path[::-1])),
    ]
    ring = ((40.0, -5.0), (60.0, -5.0), (60.0, 5.0), (40.0, 5.0))
    uavs = tuple(Uav(UavId(f"u{n}"), (-10.0, 0.0, 0.0), 10.0) for n in range(2))
    zones = (Zone(ZoneId("z"), ring, ceiling_m=ceiling_m),)

    problem = FieldProblem.from_mission(Mission("cut", 900.0, uavs, tuple(lines), zones=zones))

    for row, through in enumerate(cut):
        line_s = problem.line_s[problem.kind[row]]
        assert np.isinf(line_s[0]).all() == np.isinf(line_s[2]).all() == through
        assert np.isfinite(line_s[1]).all()
