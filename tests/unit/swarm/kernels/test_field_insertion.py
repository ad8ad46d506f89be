"""What tasks gain a list, against every place tried; and the rules that studies compare with."""

from __future__ import annotations

import numpy as np
import pytest

from sim.study.field_generator import FieldShape, random_field_mission
from swarm.allocation.field import FieldProblem, FieldState
from swarm.kernels.field import (
    FIELD_NEAREST,
    FIELD_VALUE_PER_TIME,
    FieldRuleCode,
    fly_lists,
    run_rule,
)
from swarm.kernels.field_insertion import best_insertions
from swarm.kernels.field_search import optimise_lists


def problem_of(seed: int, shape: FieldShape) -> FieldProblem:
    return FieldProblem.from_mission(random_field_mission(3, 10, seed, shape, "drawn"))


@pytest.mark.parametrize("seed", range(5))
def test_the_best_place_is_the_best_of_all_tried(seed: int) -> None:
    problem = problem_of(seed, FieldShape(windows_frac=0.6, due_frac=0.3, zones=1))
    state = FieldState.at_start(problem)
    runs = run_rule(problem.kernel, state, FIELD_VALUE_PER_TIME)
    path = [item >> 1 for item in runs.lists(3)[0]][:3]
    wanted = np.ones(problem.n_task, dtype=np.bool_)
    wanted[path] = False

    gains, places = best_insertions(problem.kernel, state, 0, path, wanted)

    def worth(order: list[int]) -> float:
        flown = fly_lists(problem.kernel, state, [[2 * task for task in order], [], []])
        return float(flown.value[0]) if flown.feasible else -np.inf

    assert np.all(gains[path] == -np.inf)
    for task in np.flatnonzero(wanted).tolist():
        tried = [worth([*path[:k], task, *path[k:]]) - worth(path) for k in range(len(path) + 1)]
        if max(tried) == -np.inf:
            assert gains[task] == -np.inf
        else:
            assert gains[task] == pytest.approx(max(tried))
            assert tried[places[task]] == pytest.approx(max(tried))


def test_a_battery_is_swapped_where_a_list_needs_it() -> None:
    problem = problem_of(2, FieldShape(endurance_frac=0.4, bases=2))
    state = FieldState.at_start(problem)
    wanted = np.ones(problem.n_task, dtype=np.bool_)
    path: list[int] = []

    for _ in range(4):
        gains, places = best_insertions(problem.kernel, state, 0, path, wanted)
        task = int(np.argmax(gains))
        assert gains[task] > -np.inf
        path.insert(int(places[task]), task)
        wanted[task] = False

    flown = fly_lists(problem.kernel, state, [[2 * task for task in path], [], []])
    assert not flown.feasible  # not on one battery


LONG = {
    "batteries alone": FieldShape(endurance_frac=0.2, bases=2, slots=0, lines_frac=0.5),
    "windows": FieldShape(endurance_frac=0.2, bases=2, slots=0, windows_frac=0.3, due_frac=0.2),
    "slots": FieldShape(endurance_frac=0.2, bases=1, slots=1, lines_frac=0.3),
}


@pytest.mark.parametrize("name", LONG)
@pytest.mark.parametrize("seed", [0, 1, 3, 4])
def test_a_long_list_that_swaps_takes_a_task_where_it_is_worth_most(name: str, seed: int) -> None:
    """Its places are bounded by the battery; none that is better is passed over."""
    mission = random_field_mission(2, 30, seed, LONG[name], "drawn")
    problem = FieldProblem.from_mission(mission)
    state = FieldState.at_start(problem)

    def solved(order: list[int]) -> tuple[float, list[int]]:
        lists = [[2 * task for task in order], []]
        found = optimise_lists(problem.kernel, state, iterations=0, lists=lists, threads=1)
        kept = [item >> 1 for item in found.lists[0] if item >= 0]
        return (found.objective if len(kept) == len(order) else -np.inf), list(found.lists[0])

    start = optimise_lists(problem.kernel, state, seed=seed, iterations=400, threads=1)
    path = [item >> 1 for item in start.lists[0] if item >= 0]
    path.pop(len(path) // 2)  # one that it could certainly take
    before, items = solved(path)
    assert len(path) > 7
    assert any(item < 0 for item in items)
    wanted = np.ones(problem.n_task, dtype=np.bool_)
    wanted[path] = False

    gains, places = best_insertions(problem.kernel, state, 0, path, wanted)

    for task in np.flatnonzero(wanted).tolist()[:6]:
        tried = [solved([*path[:k], task, *path[k:]])[0] - before for k in range(len(path) + 1)]
        if max(tried) == -np.inf:
            continue
        assert gains[task] >= max(tried) - 1e-6 * abs(before)
        assert tried[places[task]] == pytest.approx(gains[task], abs=1e-6 * abs(before))


@pytest.mark.parametrize("rule", [FIELD_NEAREST, FIELD_VALUE_PER_TIME])
def test_an_index_rule_takes_the_largest_index(rule: FieldRuleCode) -> None:
    problem = problem_of(1, FieldShape(windows_frac=0.5))
    state = FieldState.at_start(problem)

    runs = run_rule(problem.kernel, state, rule)

    open_tasks = set(range(problem.n_task))
    uav, item = int(runs.uavs[0]), int(runs.items[0])
    index = {}
    for task in open_tasks:
        flown = fly_lists(
            problem.kernel, state, [[2 * task] if row == uav else [] for row in range(3)]
        )
        if flown.feasible:
            begin_s, end_s = flown.times_s[0, 2:].tolist()
            per_s = problem.weight[uav, task] / end_s
            index[task] = -begin_s if rule == FIELD_NEAREST else float(per_s)
    assert index[item >> 1] == pytest.approx(max(index.values()))
