"""What UAVs can do as their only task, held against the oracle's plain loops."""

from __future__ import annotations

import math
import random

import numpy as np
import pytest

from swarm.allocation.field import FieldProblem, FieldState
from swarm.kernels.field_alone import earliest_alone
from swarm.kernels.field_exact import best_list
from tests.support.field_missions import mission_of
from tests.support.field_oracle import scenario
from tests.support.field_oracle.brute import can_do_alone
from tests.support.field_oracle.flight import FlightTimes
from tests.support.field_oracle.made_up import KINDS, made_up
from tests.support.field_states import random_state
from tests.support.seeds import sweeps


@pytest.mark.parametrize("sweep", sweeps(4, 30))
@pytest.mark.parametrize("kind", KINDS)
def test_who_can_do_what_alone_is_as_the_oracle_has_it(kind: str, sweep: range) -> None:
    found = []
    for seed in sweep:
        draft = made_up(seed, kind, n_uavs=2, n_tasks=4)
        meant = scenario.read(draft)
        times = FlightTimes(meant)
        problem = FieldProblem.from_mission(mission_of(draft).known_at_start())
        can = [
            [can_do_alone(meant, times, uav, task) for task in meant.known] for uav in meant.uavs
        ]
        alone_s = earliest_alone(problem.kernel, FieldState.at_start(problem))
        np.testing.assert_array_equal(np.isfinite(alone_s), can, err_msg=draft["name"])
        found += [cell for row in can for cell in row]
    assert any(found)


def test_from_where_it_stands_a_uav_can_do_what_its_list_would_hold_alone() -> None:
    """In mid-mission, with all other tasks done; who takes no part can do nothing."""
    rng = random.Random(5)
    n_can = 0
    for seed in range(30):
        problem = FieldProblem.from_mission(
            mission_of(made_up(seed, "energy", n_uavs=3, n_tasks=4)).known_at_start()
        )
        state = random_state(rng, problem)
        alone_s = earliest_alone(problem.kernel, state)
        for uav, task in np.ndindex(alone_s.shape):
            state.open[:] = np.arange(problem.n_task) == task
            own = best_list(problem.kernel, state, uav)
            expected = bool(own.items) and bool(state.active[uav])
            assert math.isfinite(alone_s[uav, task]) == expected
            n_can += expected
    assert n_can > 0


def test_state_must_be_of_all_uavs() -> None:
    problem = FieldProblem.from_mission(mission_of(made_up(0, "energy")).known_at_start())
    two = FieldState.at_start(problem)
    state = FieldState(
        np.zeros(3),
        two.sortie_end_s,
        two.first_s,
        two.survived,
        two.active,
        two.open,
        two.landed_at,
        two.rank,
    )
    with pytest.raises(ValueError, match=r"free_s must have shape \(2,\)"):
        earliest_alone(problem.kernel, state)
