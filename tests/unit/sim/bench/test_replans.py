"""Re-plans of running missions, timed."""

from __future__ import annotations

import numpy as np
import pytest

from sim.bench.replans import Disturbed, measure_replans
from sim.bench.solvers import MissionSource, problem_of
from swarm.runtime.clock import SystemClock


@pytest.mark.parametrize("midway", [False, True])
def test_what_happens_is_told_as_registers_would(midway: bool) -> None:
    problem = problem_of(MissionSource(n_uav=6, n_task=40, seed=2))

    disturbed = Disturbed.of(problem, 2)
    situation = disturbed.situation(midway=midway)

    listed = {task for tasks in disturbed.course.routes.values() for task in tasks}
    assert len(listed) == 28
    assert len(situation.taking_part) == 5
    closed = {task for tasks in situation.visited.values() for task in tasks}
    assert len(closed) == (14 if midway else 0)
    taken = closed | set(situation.under_way.values())
    is_open = {problem.task_ids[row] for row in np.flatnonzero(situation.state.open)}
    assert is_open == set(problem.task_ids) - taken
    assert set(situation.under_way) <= situation.taking_part
    assert (situation.state.free_s >= situation.now_s).all()
    assert (situation.now_s > 0.0) is midway


def test_a_mission_with_nothing_left_gains_nothing() -> None:
    found = measure_replans([(1, 2)], [0], SystemClock(), unhurried_s=0.05)

    midway = found.times[1]
    assert midway.n_open == midway.going_on == 0
    assert (midway.gain_frac, midway.of_unhurried) == (0.0, 1.0)


def test_replans_are_measured() -> None:
    found = measure_replans([(5, 70)], [0, 1], SystemClock(), unhurried_s=0.2)

    rows = found.times
    assert [(row.seed, row.moment) for row in rows] == [
        (0, "start"), (0, "midway"), (1, "start"), (1, "midway")
    ]  # fmt: skip
    assert [row.n_open for row in rows[::2]] == [70, 70]
    for row in rows:
        assert row.replanned >= row.going_on > 0.0
        assert row.of_unhurried <= 1.01
        assert row.gain_frac >= 0.0
        assert min(row.replan_s, row.judge_s, row.cancel_s) >= 0.0
        assert row.limit_s == 2.0
