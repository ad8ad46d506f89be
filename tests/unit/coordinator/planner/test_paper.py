"""Every figure of the paper's Tables I and II, to its printed digits."""

from __future__ import annotations

import numpy as np
import pytest

from coordinator.planner.exact import optimum, worst_value
from coordinator.planner.sequence_search import best_sequence
from swarm.allocation import TeamState, evaluate, rank_of, run
from swarm.allocation.rules import kernel_rule
from tests.support.problems import paper_problem, table_1

GREEDY = {
    (1, 2, 3): 116.1364,
    (1, 3, 2): 118.4939,
    (3, 1, 2): 118.4939,
    (2, 1, 3): 104.2051,
    (2, 3, 1): 113.6739,
    (3, 2, 1): 113.6739,
}


@pytest.mark.parametrize(("numbers", "expected"), GREEDY.items())
def test_greedy_by_sequence(numbers: tuple[int, ...], expected: float) -> None:
    problem = table_1()
    sequence = [number - 1 for number in numbers]

    routes, _ = run(problem, TeamState.at_start(problem), rank_of(sequence), kernel_rule("greedy"))

    assert evaluate(problem, routes)[0] == pytest.approx(expected, abs=5e-5)


@pytest.mark.parametrize(
    ("rule", "sequence", "expected"),
    [("greedy", (0, 2, 1), 118.4939), ("lookahead", (2, 0, 1), 115.4152)],
)
def test_best_sequence(rule: str, sequence: tuple[int, ...], expected: float) -> None:
    found = best_sequence(table_1(), kernel_rule(rule), np.random.default_rng(0))

    assert found.sequence == sequence
    assert found.objective == pytest.approx(expected, abs=5e-5)


def test_optimum_and_worst_plan() -> None:
    problem = table_1()

    assert optimum(problem).objective == pytest.approx(120.3335, abs=5e-5)
    assert worst_value(problem) == pytest.approx(-141.8787, abs=5e-5)


@pytest.mark.parametrize(
    ("horizon_s", "expected"), [(6.0, 155.53), (7.0, 190.99), (8.0, 226.99), (10.0, 298.99)]
)
def test_optimum_at_other_horizons(horizon_s: float, expected: float) -> None:
    assert optimum(table_1(horizon_s)).objective == pytest.approx(expected, abs=5e-3)


def test_random_problems_come_out_better_than_the_paper_reports() -> None:
    random = np.random.default_rng(2005)
    values: dict[str, list[float]] = {"greedy": [], "lookahead": []}
    for _ in range(300):
        problem = paper_problem(random)
        best, worst = optimum(problem).objective, worst_value(problem)
        for rule, normalised in values.items():
            found = best_sequence(problem, kernel_rule(rule), np.random.default_rng(0))
            normalised.append((found.objective - worst) / (best - worst))

    # 300 problems elsewhere gave 0.968 and 0.969, each ± 0.001; the paper reports 0.88 and 0.85
    assert np.mean(values["greedy"]) == pytest.approx(0.968, abs=0.004)
    assert np.mean(values["lookahead"]) == pytest.approx(0.969, abs=0.004)
    assert max(values["greedy"] + values["lookahead"]) <= 1.0 + 1e-12
