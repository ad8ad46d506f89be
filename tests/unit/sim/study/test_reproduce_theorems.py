from __future__ import annotations

import numpy as np
import pytest

from sim.study.paper.theorems import TheoremResult, allocations, check_theorems
from tests.support import reference
from tests.support.problems import random_problem, table_1


@pytest.mark.parametrize(("n_uav", "n_task"), [(1, 4), (2, 3), (3, 3), (3, 0)])
def test_allocations_are_as_many_as_ordered_partitions(n_uav: int, n_task: int) -> None:
    problem = random_problem(np.random.default_rng(1), n_uav, n_task)

    assert allocations(n_uav, n_task) == len(list(reference.ordered_partitions(problem)))


def test_allocations_of_table_1() -> None:
    assert allocations(table_1().n_uav, table_1().n_task) == 1_814_400


@pytest.mark.parametrize("seed", [0, 1])
def test_theorems_hold_on_as_many_cases_as_asked(seed: int) -> None:
    found = check_theorems(seed, 40)

    assert [(each.name, each.cases, each.violations) for each in found] == [
        ("Theorem 1", 24, 0),
        ("Theorem 3", 40, 0),
        ("Theorem 5", 40, 0),
    ]
    assert check_theorems(seed, 40) == found


def test_a_violation_or_nothing_tried_fails() -> None:
    assert TheoremResult("T", "c", cases=3, violations=0).check().ok
    assert not TheoremResult("T", "c", cases=3, violations=1).check().ok
    assert not TheoremResult("T", "c", cases=0, violations=0).check().ok
