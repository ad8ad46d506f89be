"""OR-Tools' model of the field, solved by the real OR-Tools."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from coordinator.planner.field_exact import field_optimum_before
from sim.bench.field_methods import BENCH_SHAPE, bench_problem, index_lists
from sim.bench.field_score import score_in_field
from sim.study.baselines import ortools_field
from sim.study.baselines.ortools_field import field_lists, refusal
from sim.study.field_generator import FieldShape
from swarm.allocation.field import FieldProblem, FieldState
from swarm.kernels.field_search import optimise_lists

LINES = replace(BENCH_SHAPE, lines_frac=0.6, steady_wind_m_s=1.0)


@pytest.mark.parametrize("shape", [BENCH_SHAPE, LINES], ids=["places", "lines"])
@pytest.mark.parametrize("seed", range(3))
def test_plans_can_be_stated_and_are_only_improved(seed: int, shape: FieldShape) -> None:
    problem = bench_problem(4, 16, seed, shape)
    state = FieldState.at_start(problem)
    plan = optimise_lists(problem.kernel, state, seed=seed, iterations=1500, threads=1)
    assert any(item < 0 for items in plan.lists for item in items)

    found = score_in_field(problem, field_lists(problem, 0.2, plan.lists))

    assert found.left_out <= plan.n_left_out
    assert found.objective > (1.0 - 1e-4) * plan.objective


@pytest.mark.parametrize(
    ("shape", "seed"),
    [*((BENCH_SHAPE, seed) for seed in range(3)), *((LINES, seed) for seed in (0, 1, 4))],
)
def test_from_the_proven_optimum_nothing_better_is_found(shape: FieldShape, seed: int) -> None:
    problem = bench_problem(3, 6, seed, shape)
    best = field_optimum_before(problem, None)
    assert best is not None
    assert best.proven

    found = score_in_field(problem, field_lists(problem, 0.3, best.lists))

    assert found.left_out == best.n_left_out
    assert found.objective == pytest.approx(best.objective, rel=1e-4)


def test_its_own_start_serves_tasks_once_and_swaps_batteries() -> None:
    problem = bench_problem(4, 24, 5)

    lists = field_lists(problem, 1.0)

    tasks = [item >> 1 for items in lists for item in items if item >= 0]
    assert len(tasks) == len(set(tasks)) > 8
    assert all(not items or items[-1] >= 0 for items in lists)
    start = score_in_field(problem, field_lists(problem, 0.5, index_lists(problem, "nearest")))
    assert start.left_out <= score_in_field(problem, index_lists(problem, "nearest")).left_out


@pytest.mark.parametrize("seed", range(3))
def test_lines_are_flown_once_and_the_earliest_end_is_looked_for_if_asked(seed: int) -> None:
    problem = bench_problem(3, 12, seed, FieldShape(lines_frac=0.6, zones=4))
    start = index_lists(problem, "nearest")

    lists = field_lists(problem, 0.5, start, makespan=True)

    tasks = [item >> 1 for items in lists for item in items if item >= 0]
    assert len(tasks) == len(set(tasks)) == 12
    before, found = score_in_field(problem, start), score_in_field(problem, lists)
    assert np.nanmax(found.end_s) <= np.nanmax(before.end_s) + 0.01
    assert found.broken == 0


def test_without_tasks_lists_are_empty() -> None:
    assert field_lists(_cut(bench_problem(2, 3, 0), 0), 0.1) == ((), ())


def test_what_the_model_has_no_words_for_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = bench_problem(3, 6, 0)
    assert refusal(problem) is None

    unlike = problem.weight.copy()
    unlike[0, 0] *= 0.5
    assert refusal(replace(problem, weight=unlike)) == (
        "OR-Tools has no words for a p that depends on the UAV"
    )
    risky = np.full_like(problem.survival, 0.9)
    assert refusal(replace(problem, survival=risky)) == "OR-Tools has no words for losses"
    few = np.ones_like(problem.slots)
    assert refusal(replace(problem, slots=few)) == "its model here knows no slots at bases"
    weak = problem.full_s * np.array([1.0, 1.0, 0.9])
    assert refusal(replace(problem, full_s=weak)) == "its model here knows one kind of battery"
    monkeypatch.setattr(ortools_field, "is_installed", lambda: False)
    assert refusal(problem) == "OR-Tools is not installed: pip install 'peckorder[bench]'"


def _cut(problem: FieldProblem, n_task: int) -> FieldProblem:
    """The first tasks alone; their nodes stay."""
    columns = {"weight", "survival", "capable"}
    rows = {"enter", "service_s", "opens_s", "closes_s", "due_s"}
    return replace(
        problem,
        network=None,
        task_ids=problem.task_ids[:n_task],
        line_s=problem.line_s[:, :n_task],
        **{name: getattr(problem, name)[:, :n_task] for name in columns},
        **{name: getattr(problem, name)[:n_task] for name in rows},
    )
