"""The best disjoint lists, by branch and bound."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coordinator.planner.closing import best_disjoint
from swarm.kernels.routes_pricing import WorthyLists


def best_of_all(lists: WorthyLists, n_uav: int) -> float:
    """By trying every list, or none, of each UAV."""
    of_uav = [[k for k, uav in enumerate(lists.uav.tolist()) if uav == u] for u in range(n_uav)]
    best = 0.0
    for chosen in itertools.product(*([None, *one] for one in of_uav)):
        some = [k for k in chosen if k is not None]
        tasks = [task for k in some for task in lists.lists[k]]
        if len(tasks) == len(set(tasks)):
            best = max(best, float(lists.worth[some].sum()))
    return best


@settings(deadline=None, max_examples=80)
@given(seed=st.integers(0, 2**32 - 1), n_uav=st.integers(1, 4), n_task=st.integers(1, 6))
def test_nothing_disjoint_is_worth_more(seed: int, n_uav: int, n_task: int) -> None:
    rng = np.random.default_rng(seed)
    drawn = {
        (int(uav), tuple(sorted(rng.permutation(n_task)[: rng.integers(1, n_task + 1)].tolist())))
        for uav in rng.integers(0, n_uav, 4 * n_uav)
    }
    rows = sorted(drawn)
    worth = rng.uniform(-2.0, 10.0, len(rows))
    lists = WorthyLists(
        np.array([uav for uav, _ in rows], dtype=np.int64), worth, [list(one) for _, one in rows]
    )
    best = best_of_all(lists, n_uav)
    bound = float(np.maximum(worth, 0.0).sum()) + 1.0

    found = best_disjoint(
        lists, np.zeros(n_task), n_uav, known=-1.0, bound=bound, should_stop=lambda: False
    )

    assert found.bound == pytest.approx(best, abs=1e-6)
    if best > 0.0:
        assert found.worth == pytest.approx(best, abs=1e-6)
    assert found.worth == pytest.approx(float(worth[list(found.chosen)].sum()))


def test_a_list_that_is_worth_less_than_nothing_is_never_chosen() -> None:
    lists = WorthyLists(np.array([0, 1]), np.array([10.0, -1.0]), [[0], [1]])

    found = best_disjoint(lists, np.zeros(2), 2, known=5.0, bound=20.0, should_stop=lambda: False)

    assert found.chosen == (0,)
    assert found.bound == pytest.approx(10.0)


def test_told_to_stop_the_bound_is_that_of_what_is_left() -> None:
    lists = WorthyLists(np.array([0, 1]), np.array([10.0, 9.0]), [[0], [0]])

    found = best_disjoint(lists, np.zeros(1), 2, known=5.0, bound=20.0, should_stop=lambda: True)

    assert found.bound >= 10.0


def test_what_is_met_is_told_where_it_is_worth_less_than_what_is_known() -> None:
    lists = WorthyLists(np.array([0, 1]), np.array([10.0, 9.0]), [[0], [0]])

    found = best_disjoint(lists, np.zeros(1), 2, known=12.0, bound=20.0, should_stop=lambda: False)

    assert (found.worth, found.chosen) == (10.0, (0,))
    assert found.bound == pytest.approx(12.0)
