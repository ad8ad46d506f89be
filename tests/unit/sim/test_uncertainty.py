"""Random losses and pop-ups."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from sim.simulate import simulate_mission
from sim.uncertainty import Uncertainty
from swarm.model import Mission
from swarm.scenario import load_scenario, shipped_scenarios


@pytest.fixture(scope="module")
def valley() -> Mission:
    return load_scenario(Path(shipped_scenarios()["valley-survey"]))


def test_certain_mission_is_left_as_it_is(valley: Mission) -> None:
    fate = Uncertainty().draw(valley, 100.0, seed=3)

    assert fate.mission == valley
    assert fate.lost_at_s == {}


def test_same_seed_draws_the_same_world(valley: Mission) -> None:
    uncertainty = Uncertainty(loss=0.5, popup=0.5)

    one, same, other = (uncertainty.draw(valley, 100.0, seed) for seed in (7, 7, 8))

    assert (one.mission, one.lost_at_s) == (same.mission, same.lost_at_s)
    assert (one.mission, one.lost_at_s) != (other.mission, other.lost_at_s)


def test_losses_do_not_change_which_tasks_pop_up(valley: Mission) -> None:
    calm = Uncertainty(popup=0.3).draw(valley, 100.0, 11)
    rough = Uncertainty(loss=1.0, popup=0.3).draw(valley, 100.0, 11)

    assert rough.mission.tasks == calm.mission.tasks
    assert set(rough.lost_at_s) == {uav.id for uav in valley.uavs}


def test_moments_lie_within_the_mission(valley: Mission) -> None:
    fate = Uncertainty(loss=1.0, popup=1.0).draw(valley, 100.0, 5)

    assert all(0.0 <= lost_s <= 100.0 for lost_s in fate.lost_at_s.values())
    assert all(0.0 <= task.appears_s <= 50.0 for task in fate.mission.tasks)


def test_probabilities_outside_their_range_are_refused() -> None:
    with pytest.raises(ValueError, match=r"loss must be within 0\.\.1"):
        Uncertainty(loss=1.5)


def test_simulated_mission_survives_losses_and_pop_ups(valley: Mission) -> None:
    small = replace(valley, tasks=valley.tasks[:12], uavs=valley.uavs[:4])
    uncertainty = Uncertainty(0.5, 0.5, delay_s=0.01)
    result = simulate_mission(small, method="greedy", seed=2, uncertainty=uncertainty).result

    assert len(result.lost_uavs) in (1, 2, 3)
    assert len(result.done) == 12
