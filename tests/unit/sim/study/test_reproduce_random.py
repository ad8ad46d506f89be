from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest

from sim.study.generator import random_table_problem
from sim.study.paper.random_problems import (
    READINGS,
    STUDIED,
    Average,
    ProblemResult,
    RandomResults,
    Reading,
    reproduce_random,
)
from sim.study.paper.tables import Expectations, PaperFigures, Printed
from tests.support import reference
from tests.support.problems import table_1


def two_problems() -> RandomResults:
    """Rules worth 50 and 0 by two sequences, between -100 and 100."""
    sequences = {"greedy": (50.0, 0.0), "lookahead": (0.0, 50.0)}
    result = ProblemResult(optimum=100.0, worst=-100.0, sequences=sequences, guided=100.0)
    return RandomResults(0, (result, result))


def test_result_is_the_same_for_any_number_of_threads() -> None:
    table = table_1()

    assert reproduce_random(table, 7, 5, threads=3) == reproduce_random(table, 7, 5)


def test_more_problems_leave_the_first_as_they_were() -> None:
    table = table_1()
    few, many = reproduce_random(table, 2, 1), reproduce_random(table, 4, 1)

    assert many.problems[:2] == few.problems
    assert reproduce_random(table, 2, 2).problems != few.problems


def test_values_are_those_of_the_definitions() -> None:
    table = table_1()
    result = reproduce_random(table, 1, 9).problems[0]
    problem = random_table_problem(table, 9, 0)

    greedy = [
        reference.objective(problem, reference.lists(problem, sequence, "greedy"))
        for sequence in permutations(range(3))
    ]
    assert result.sequences["greedy"] == pytest.approx(greedy, abs=1e-9)
    for values in result.sequences.values():
        assert result.worst <= min(values)
        assert max(values) <= result.optimum + 1e-9
    assert result.guided <= result.optimum + 1e-9


def test_problems_keep_all_of_table_1_but_the_places() -> None:
    table = table_1()
    problem = random_table_problem(table, 3, 4)

    assert len(np.unique(problem.start_enu_m, axis=0)) == 1
    assert 0.0 <= problem.start_enu_m[0, 0] <= 10.0
    assert (problem.start_enu_m[:, 1:] == 0.0).all()
    assert ((problem.task_enu_m >= 0.0) & (problem.task_enu_m <= 10.0)).all()
    for name in ("speed_m_s", "value", "service_s", "success", "survival"):
        np.testing.assert_array_equal(getattr(problem, name), getattr(table, name))
    assert problem.horizon_s == table.horizon_s


def test_progress_counts_the_problems() -> None:
    told: list[int] = []

    reproduce_random(table_1(), 3, 0, threads=2, progress=told.append)

    assert told == [1, 2, 3]


@pytest.mark.parametrize(("problems", "threads", "name"), [(0, 1, "problems"), (1, 0, "threads")])
def test_nothing_to_do_or_nobody_to_do_it_is_refused(
    problems: int, threads: int, name: str
) -> None:
    with pytest.raises(ValueError, match=name):
        reproduce_random(table_1(), problems, 0, threads=threads)


@pytest.mark.parametrize(
    ("reading", "expected"),
    [
        (Reading("worst", "best"), 0.75),
        (Reading("worst", "mean"), 0.625),
        (Reading("worst", "worst"), 0.5),
        (Reading("ratio", "best"), 0.5),
        (Reading("ratio", "mean"), 0.25),
        (Reading("ratio", "worst"), 0.0),
    ],
)
def test_readings(reading: Reading, expected: float) -> None:
    np.testing.assert_allclose(two_problems().read("greedy", reading), [expected, expected])


def test_closest_reading_is_the_one_nearest_to_all_figures_of_the_paper() -> None:
    paper = PaperFigures(normalised={"greedy": Printed(0.6, 1), "lookahead": Printed(0.7, 1)})

    assert two_problems().closest_reading(paper) == Reading("worst", "mean")
    assert READINGS[0] == Reading("worst", "best")


def test_interval_is_students() -> None:
    average = Average.of(np.array([1.0, 2.0, 3.0]))

    assert average.mean == 2.0
    assert average.half_width == pytest.approx(4.302653 / np.sqrt(3.0), abs=1e-5)
    assert Average.of(np.array([0.5])) == Average(0.5, None)


def test_a_plan_better_than_the_optimum_fails() -> None:
    good = two_problems()
    bad = RandomResults(
        0, (ProblemResult(100.0, -100.0, dict.fromkeys(STUDIED[:2], (50.0,)), 100.1),)
    )
    limits = Expectations(normalised_at_least={})

    assert [check.ok for check in good.checks(limits)] == [True]
    assert [(check.ours, check.ok) for check in bad.checks(limits)] == [("1", False)]
