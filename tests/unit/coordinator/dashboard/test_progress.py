"""J after each task agrees with what the mission state makes of the end."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from coordinator.mission_view.mission_state import MissionState
from coordinator.mission_view.results import progress_of
from tests.support.observed_mission import random_mission, shipped, watch


@pytest.mark.parametrize("name", ["table-1", "valley-popups"])
def test_the_curve_ends_where_the_result_does(name: str) -> None:
    mission_state = watch(shipped(name))
    problem = mission_state.board.problem
    assert problem is not None

    progress, result = progress_of(problem, mission_state.replica.outcomes), mission_state.result()

    assert progress.objective == pytest.approx(result.executed_objective)
    assert {uav: tuple(t) for uav, t in progress.flown.items()} == result.executed_routes
    assert {t: s for t, (_, s) in progress.completed.items()} == result.executed_completion_s
    assert len(progress.curve) == len(result.done)
    times_s = [time_s for time_s, _ in progress.curve]
    assert times_s == sorted(times_s)


def test_the_curve_grows_task_by_task() -> None:
    mission = random_mission(3, 9, seed=1)
    curves: list[list[tuple[float, float]]] = []

    def see(mission_state: MissionState, _now_s: float) -> None:
        problem = mission_state.board.problem
        if problem is not None:
            curves.append(progress_of(problem, mission_state.replica.outcomes).curve)

    watch(mission, step_s=20.0, see=see)

    assert len(curves[-1]) == 9
    for before, after in pairwise(curves):
        np.testing.assert_allclose(after[: len(before)], before)
