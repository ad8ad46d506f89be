"""What UAVs can do as their only task, held against the oracle's plain loops."""

from __future__ import annotations

import numpy as np
import pytest

from swarm.allocation.field import FieldProblem
from swarm.kernels.field_alone import earliest_alone
from tests.support.field_missions import mission_of
from tests.support.field_oracle import scenario
from tests.support.field_oracle.brute import can_do_alone
from tests.support.field_oracle.flight import FlightTimes
from tests.support.field_oracle.made_up import KINDS, made_up
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
        alone_s = earliest_alone(problem.kernel, problem.first_s)
        np.testing.assert_array_equal(np.isfinite(alone_s), can, err_msg=draft["name"])
        found += [cell for row in can for cell in row]
    assert any(found)


def test_first_s_must_be_of_all_uavs() -> None:
    problem = FieldProblem.from_mission(mission_of(made_up(0, "energy")).known_at_start())
    with pytest.raises(ValueError, match=r"first_s must have shape \(2,\)"):
        earliest_alone(problem.kernel, np.zeros(3))
