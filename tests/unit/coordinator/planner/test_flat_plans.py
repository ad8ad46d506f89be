"""Missions that only keep apart are planned by the plain kernels, as the field's would have it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from coordinator.planner.plan import make_plan
from swarm import evaluate
from swarm.allocation import TeamState, rank_of, rule_by_name, run
from swarm.allocation.field import FieldProblem, FieldState
from swarm.allocation.field.lists import evaluate_in_field
from swarm.allocation.problem import Problem
from swarm.kernels.field import FIELD_GREEDY, run_rule
from swarm.model import Mission
from swarm.runtime.clock import SystemClock
from tests.support.fleet_builders import random_mission
from tests.support.seeds import seeds


def kept_apart(seed: int) -> Mission:
    """A random flat mission; every other one with accelerations."""
    rng = np.random.default_rng(seed)
    mission = random_mission(rng, n_uav=int(rng.integers(1, 6)), n_task=int(rng.integers(1, 25)))
    if seed % 2:
        fleet = [replace(uav, acceleration_m_s2=float(rng.uniform(1, 4))) for uav in mission.uavs]
        mission = replace(mission, uavs=tuple(fleet))
    return replace(mission, separation_m=6.0, band_m=(30.0, 110.0))


def lists_of(items: object) -> list[list[int]]:
    return [[int(item) for item in each] for each in items]  # type: ignore[attr-defined]  # lists


@pytest.mark.parametrize("seed", seeds(30, 300))
def test_the_greedy_lists_of_a_sequence_are_those_of_the_field(seed: int) -> None:
    mission = kept_apart(seed)
    plain, field = Problem.from_mission(mission), FieldProblem.from_mission(mission)
    sequence = np.random.default_rng(seed).permutation(plain.n_uav).tolist()

    found, _ = run(plain, TeamState.at_start(plain), rank_of(sequence), rule_by_name("greedy"))
    team = FieldState.at_start(field, sequence)
    in_field = run_rule(field.kernel, team, FIELD_GREEDY).lists(field.n_uav)

    assert lists_of(found) == [[item >> 1 for item in each] for each in lists_of(in_field)]


@pytest.mark.parametrize("method", ["greedy", "guided"])
@pytest.mark.parametrize("seed", seeds(6, 60))
def test_a_plan_is_that_of_the_mission_without_a_distance_and_worth_as_much_in_the_field(
    seed: int, method: str
) -> None:
    mission = kept_apart(seed)
    free = replace(mission, separation_m=None, band_m=None, schema=2)
    plan = make_plan(mission, method, clock=SystemClock(), seed=seed)
    other = make_plan(free, method, clock=SystemClock(), seed=seed)

    assert plan == replace(other, elapsed_s=plan.elapsed_s)
    assert plan.schedule is not None
    assert plan.schedule.keys() == {uav.id for uav in mission.uavs}
    worth = evaluate_in_field(mission, plan.routes)
    assert worth.objective == pytest.approx(plan.objective, rel=1e-12)
    assert evaluate(mission, plan.routes).completion_s == pytest.approx(worth.completion_s)


def test_what_only_keeps_apart_is_flat_and_not_plain() -> None:
    mission = kept_apart(1)

    assert mission.is_flat
    assert not mission.is_plain
    assert not replace(mission, wind_enu_m_s=(1.0, 0.0)).is_flat
    assert replace(mission, separation_m=None, band_m=None).is_plain


def test_a_fleet_that_only_keeps_apart_needs_no_tables_of_legs() -> None:
    """One for each kind of UAV would be 290 MB at 1000 x 5000."""
    rng = np.random.default_rng(0)
    mission = random_mission(rng, n_uav=40, n_task=200, incapable_frac=0.0)
    mission = replace(mission, separation_m=6.0, band_m=(30.0, 110.0))
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(FieldProblem, "from_mission", None)
        plan = make_plan(mission, "greedy", clock=SystemClock(), stop=lambda n: n > 1)

    assert len(plan.completion_s) == 200
