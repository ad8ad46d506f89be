"""What is drawn of a mission's future: from streams of their own, by known distributions."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sim.options import ChanceOptions
from sim.world.simulation import simulate_mission
from sim.world.uncertainty import Realization, Uncertainty
from sim.world.wind import Wind
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


def test_tasks_that_are_like_a_line_are_lines_at_another_place(valley: Mission) -> None:
    path = ((0.1, 0.2, 3.0), (10.3, 20.7, 4.0), (40.0, -5.0, 5.0))
    line = replace(valley.tasks[0], position_enu_m=path[0], path_enu_m=path)

    drawn = Uncertainty(popups_per_min=6.0).draw(
        replace(valley, tasks=(line, *valley.tasks[1:2])), 100.0, 3
    )

    places = [task for task in drawn.mission.tasks[2:] if task.path_enu_m]
    assert places
    for task in places:
        assert task.path_enu_m[0] == task.position_enu_m != path[0]
        moved = np.subtract(task.path_enu_m, task.path_enu_m[0])
        assert moved == pytest.approx(np.subtract(path, path[0]))


def test_losses_do_not_change_which_tasks_pop_up(valley: Mission) -> None:
    calm = Uncertainty(popup=0.3).draw(valley, 100.0, 11)
    rough = Uncertainty(loss=1.0, popup=0.3).draw(valley, 100.0, 11)

    assert rough.mission.tasks == calm.mission.tasks
    assert set(rough.lost_at_s) == {uav.id for uav in valley.uavs}


def test_windows_and_due_times_move_with_what_appears_after_they_began(valley: Mission) -> None:
    first, second, third = valley.tasks[:3]
    timed = (
        replace(first, closes_s=10.0, due_s=15.0),
        replace(second, opens_s=500.0, closes_s=600.0),
        replace(third, opens_s=5.0),
    )

    fate = Uncertainty(popup=1.0).draw(replace(valley, tasks=timed), 100.0, seed=7)

    late, early, endless = fate.mission.tasks
    assert 0.0 < late.appears_s == late.opens_s < 50.0
    assert (late.closes_s, late.due_s) == (10.0 + late.appears_s, 15.0 + late.appears_s)
    assert (early.opens_s, early.closes_s) == (500.0, 600.0)
    assert endless.opens_s == 5.0


def test_moments_lie_within_the_mission(valley: Mission) -> None:
    fate = Uncertainty(loss=1.0, popup=1.0).draw(valley, 100.0, 5)

    assert all(0.0 <= lost_s <= 100.0 for lost_s in fate.lost_at_s.values())
    assert all(0.0 <= task.appears_s <= 50.0 for task in fate.mission.tasks)


def test_probabilities_outside_their_range_are_refused() -> None:
    with pytest.raises(ValueError, match=r"loss must be within 0\.\.1"):
        Uncertainty(loss=1.5)


def test_simulated_mission_survives_losses_and_pop_ups(valley: Mission) -> None:
    flown = replace(valley, tasks=valley.tasks[:12], uavs=valley.uavs[:4])
    uncertainty = Uncertainty(0.5, 0.5, delay_s=0.01)
    result = simulate_mission(flown, method="greedy", seed=2, uncertainty=uncertainty).result

    assert len(result.lost_uavs) in (1, 2, 3)
    assert len(result.done) == 12


# -- streams ----------------------------------------------------------------------------

EVERYTHING = Uncertainty(
    loss=0.4,
    popup=0.3,
    popups_per_min=4.0,
    withdrawals_per_min=3.0,
    outcomes=True,
    survival=True,
    speed_sd_frac=0.2,
    leg_sd_frac=0.1,
    wind_m_s=4.0,
    position_error_m=3.0,
    partitions_per_min=2.0,
)
"""All but what the network draws message by message."""
OFF: dict[str, float | bool] = {
    "loss": 0.0,
    "outcomes": False,
    "survival": False,
    "speed_sd_frac": 0.0,
    "leg_sd_frac": 0.0,
    "wind_m_s": 0.0,
    "position_error_m": 0.0,
    "partitions_per_min": 0.0,
    "withdrawals_per_min": 0.0,
}


def drawn(fate: Realization) -> dict[str, object]:
    """All that one says of the UAVs and tasks of `small_valley`, by what it comes from."""
    uavs, tasks = fate.mission.uavs[:4], fate.mission.tasks[:6]
    pairs = [(uav, task) for uav in uavs for task in tasks]
    here = (0.0, 0.0, 0.0)
    alone = replace(fate.uncertainty, speed_sd_frac=0.0, wind_m_s=0.0)
    legs = replace(fate, uncertainty=alone, speed_frac={}, wind=Wind())
    return {
        "loss": {uav: at_s for uav, at_s in fate.lost_at_s.items() if uav in {u.id for u in uavs}},
        "popup": [task.appears_s for task in tasks],
        "outcomes": [fate.succeeds(uav, task, n) for uav, task in pairs for n in (1, 2, 9)],
        "survival": [fate.survives(uav, task, n) for uav, task in pairs for n in (1, 2, 9)],
        "speed_sd_frac": [fate.speed_frac[uav.id] for uav in uavs],
        "leg_sd_frac": [legs.speed_m_s(u, t.id, here, t.position_enu_m) for u, t in pairs],
        "wind_m_s": fate.wind,
        "position_error_m": [fate.stop_enu_m(uav.id, task) for uav, task in pairs],
        "partitions_per_min": [each.at_s for each in fate.partitions],
        "withdrawals_per_min": dict(fate.withdrawn_at_s),
    }


def small(valley: Mission, n_uav: int = 4, n_task: int = 6) -> Mission:
    cut = replace(valley, uavs=valley.uavs[:n_uav], tasks=valley.tasks[:n_task])
    return replace(cut, success_default=0.6, survival_default=0.7)


@pytest.mark.parametrize("off", OFF)
def test_asking_for_one_kind_less_leaves_all_others_as_they_were(valley: Mission, off: str) -> None:
    every = drawn(EVERYTHING.draw(small(valley), 300.0, 5))
    asked: dict[str, Any] = {off: OFF[off]}
    changed = ChanceOptions(**asked).changed(EVERYTHING)
    without = drawn(changed.draw(small(valley), 300.0, 5))

    assert every.pop(off) != without.pop(off)
    assert every == without


def test_more_uavs_change_nothing_for_those_that_were_there(valley: Mission) -> None:
    few = drawn(EVERYTHING.draw(small(valley, 4), 300.0, 5))
    many = drawn(EVERYTHING.draw(small(valley, 8), 300.0, 5))

    assert few == many


def test_more_tasks_change_nothing_for_those_that_were_there(valley: Mission) -> None:
    few = drawn(EVERYTHING.draw(small(valley, n_task=6), 300.0, 5))
    many = drawn(EVERYTHING.draw(small(valley, n_task=12), 300.0, 5))
    for each in (few, many):
        del each["withdrawals_per_min"]  # which task is withdrawn depends on which there are

    assert few == many


def test_listed_losses_and_withdrawals_come_besides_those_drawn(valley: Mission) -> None:
    one, task = valley.uavs[0].id, valley.tasks[0].id
    listed = Uncertainty(lost_at_s={one: 12.0}, withdrawn_at_s={task: 3.0}).draw(valley, 100.0, 1)
    random = Uncertainty(loss=1.0).draw(valley, 100.0, 1)
    both = Uncertainty(loss=1.0, lost_at_s={one: 0.5}).draw(valley, 100.0, 1)

    assert listed.lost_at_s == {one: 12.0}
    assert listed.withdrawn_at_s == {task: 3.0}
    assert both.lost_at_s == {**random.lost_at_s, one: 0.5}


# -- distributions ----------------------------------------------------------------------


def test_losses_and_pop_ups_come_at_the_share_asked_for(valley: Mission) -> None:
    fates = [Uncertainty(loss=0.3, popup=0.2).draw(valley, 100.0, seed) for seed in range(400)]
    n_uav, n_task = 400 * len(valley.uavs), 400 * len(valley.tasks)
    lost = sum(len(fate.lost_at_s) for fate in fates)
    late = sum(task.appears_s > 0.0 for fate in fates for task in fate.mission.tasks)

    assert lost / n_uav == pytest.approx(0.3, abs=4.0 * (0.3 * 0.7 / n_uav) ** 0.5)
    assert late / n_task == pytest.approx(0.2, abs=4.0 * (0.2 * 0.8 / n_task) ** 0.5)


def test_events_at_a_rate_are_poisson(valley: Mission) -> None:
    uncertainty = Uncertainty(popups_per_min=2.0, withdrawals_per_min=1.0, partitions_per_min=0.5)
    fates = [uncertainty.draw(valley, 300.0, seed) for seed in range(400)]
    counts = {
        10.0: [len(fate.mission.tasks) - len(valley.tasks) for fate in fates],
        5.0: [len(fate.withdrawn_at_s) for fate in fates],
        2.5: [len(fate.partitions) for fate in fates],
    }
    for mean, each in counts.items():
        assert np.mean(each) == pytest.approx(mean, abs=4.0 * (mean / 400) ** 0.5)
        assert np.var(each) == pytest.approx(mean, rel=4.0 * (2.0 / 400) ** 0.5 + 0.05)
    times_s = [task.appears_s for fate in fates for task in fate.mission.tasks[len(valley.tasks) :]]
    assert np.mean(times_s) == pytest.approx(150.0, abs=4.0 * 300.0 / (12 * len(times_s)) ** 0.5)


def test_attempts_succeed_and_uavs_survive_as_often_as_the_scenario_says(valley: Mission) -> None:
    fate = Uncertainty(outcomes=True, survival=True).draw(small(valley), 100.0, 3)
    uav, task = fate.mission.uavs[1], fate.mission.tasks[2]
    n, p, s = 4000, fate.mission.success(uav, task), fate.mission.survival(uav, task)
    assert 0.0 < p < 1.0
    succeeded = np.mean([fate.succeeds(uav, task, attempt) for attempt in range(1, n + 1)])
    survived = np.mean([fate.survives(uav, task, attempt) for attempt in range(1, n + 1)])

    assert succeeded == pytest.approx(p, abs=4.0 * (p * (1.0 - p) / n) ** 0.5)
    assert survived == pytest.approx(s, abs=4.0 * (s * (1.0 - s) / n) ** 0.5)


def test_speeds_are_lognormal_with_the_mean_and_spread_asked_for(valley: Mission) -> None:
    sd_frac = 0.25
    uncertainty = Uncertainty(speed_sd_frac=sd_frac)
    fates = [uncertainty.draw(valley, 100.0, seed) for seed in range(300)]
    fracs = np.array([frac for fate in fates for frac in fate.speed_frac.values()])
    logs = np.log(fracs)

    assert fracs.mean() == pytest.approx(1.0, abs=4.0 * sd_frac / len(fracs) ** 0.5)
    assert fracs.std() == pytest.approx(sd_frac, rel=0.06)
    assert logs.std() == pytest.approx(
        np.log1p(sd_frac**2) ** 0.5, rel=4.0 / (2 * len(logs)) ** 0.5
    )
    assert abs(np.mean(((logs - logs.mean()) / logs.std()) ** 3)) < 4.0 * (6.0 / len(logs)) ** 0.5


def test_places_are_normal_about_the_task_and_winds_from_all_around(valley: Mission) -> None:
    sd_m = 7.0
    uncertainty = Uncertainty(position_error_m=sd_m, wind_m_s=3.0)
    fates = [uncertainty.draw(small(valley), 100.0, seed) for seed in range(200)]
    errors_m = np.array(
        [
            np.subtract(fate.stop_enu_m(uav.id, task), task.position_enu_m)
            for fate in fates
            for uav in fate.mission.uavs
            for task in fate.mission.tasks
        ]
    )
    winds = np.array([fate.wind.velocity_enu_m_s for fate in fates])

    assert np.abs(errors_m.mean(axis=0)).max() < 4.0 * sd_m / len(errors_m) ** 0.5
    assert errors_m[:, :2].std(axis=0) == pytest.approx([sd_m, sd_m], rel=0.05)
    assert not errors_m[:, 2].any()
    assert np.hypot(*winds.T) == pytest.approx(np.full(len(winds), 3.0))
    assert np.abs(winds.mean(axis=0)).max() < 4.0 * 3.0 / (2 * len(winds)) ** 0.5
