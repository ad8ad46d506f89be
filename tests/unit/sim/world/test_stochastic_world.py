"""A world in which a realization comes true, whoever decides."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from coordinator.planner.options import after_evaluations
from coordinator.planner.plan import make_plan
from sim.world.stochastic_world import StochasticWorld
from sim.world.uncertainty import Realization, Uncertainty
from swarm.model import Mission, Plan, TaskId, UavId
from swarm.runtime.clock import SystemClock
from tests.support.builders import mission, task, uav
from tests.support.fleet_builders import random_mission

PAIR = mission(
    [uav("u0", speed_m_s=2.0), uav("u1", east_m=100.0, speed_m_s=2.0)],
    [task("t0", 10.0), task("t1", 30.0), task("t2", 90.0), task("t3", 60.0)],
)


def planner(what: Mission, method: str, seed: int) -> Plan:
    stop = after_evaluations(50)
    return make_plan(what.known_at_start(), method, clock=SystemClock(), seed=seed, stop=stop)


class Flown:
    """A mission that has been flown, and what was counted."""

    def __init__(
        self, fate: Realization, method: str = "greedy", coordinator_lost_s: float | None = None
    ) -> None:
        self.world = StochasticWorld(
            fate,
            planner,
            method=method,
            seed=fate.seed,
            coordinator_lost_s=coordinator_lost_s,
        )
        assert self.world.run()
        self.tally = self.world.tally
        self.story = [(told.mission_s, told.text) for told in self.world.world.mission_state.story]

    @property
    def visits(self) -> dict[str, list[tuple[float, str, bool]]]:
        """By task, in order: when, by whom, and whether it was done."""
        found: dict[str, list[tuple[float, str, bool]]] = {}
        for visit in self.tally.visits:
            found.setdefault(visit.task, []).append((visit.completed_s, visit.uav, visit.done))
        return found


def fate_of(uncertainty: Uncertainty, flown: Mission = PAIR, seed: int = 1) -> Realization:
    return uncertainty.draw(flown, 50.0, seed)


@pytest.mark.parametrize("coordinator_lost_s", [None, 0.0])
def test_listed_losses_happen_when_they_should_and_are_told(
    coordinator_lost_s: float | None,
) -> None:
    flown = Flown(
        fate_of(Uncertainty(lost_at_s={UavId("u0"): 4.0})), coordinator_lost_s=coordinator_lost_s
    )

    assert flown.world.lost == {"u0": "lost at 4 s"}
    assert {who for each in flown.visits.values() for _, who, _ in each} == {"u1"}
    assert set(flown.visits) == {"t0", "t1", "t2", "t3"}


def test_a_uav_that_is_home_is_not_lost_any_more() -> None:
    assert Flown(fate_of(Uncertainty(lost_at_s={UavId("u0"): 500.0}))).world.lost == {}


@pytest.mark.parametrize("coordinator_lost_s", [None, 0.0, 21.0])
def test_pop_ups_and_withdrawals_reach_the_fleet_with_and_without_a_coordinator(
    coordinator_lost_s: float | None,
) -> None:
    late = replace(PAIR.tasks[3], appears_s=20.0)
    last = replace(PAIR.tasks[1], appears_s=200.0)
    popping = replace(PAIR, tasks=(PAIR.tasks[0], PAIR.tasks[2], late, last))
    fate = fate_of(Uncertainty(withdrawn_at_s={TaskId("t0"): 2.0}), popping)
    flown = Flown(fate, coordinator_lost_s=coordinator_lost_s)

    assert set(flown.visits) == {"t1", "t2", "t3"}
    ((third_s, _, _),), ((last_s, _, _),) = flown.visits["t3"], flown.visits["t1"]
    assert 20.0 < third_s <= 56.0
    assert 200.0 < last_s <= 236.0
    by_operator = coordinator_lost_s == 0.0
    told = "operator withdraws t0" if by_operator else "task t0 withdrawn"
    assert any(text == told for _, text in flown.story)
    assert not any("new coordinator" in text for _, text in flown.story)


def test_a_task_withdrawn_before_it_appears_is_never_seen() -> None:
    late = replace(PAIR, tasks=(*PAIR.tasks[:3], replace(PAIR.tasks[3], appears_s=20.0)))
    flown = Flown(fate_of(Uncertainty(withdrawn_at_s={TaskId("t3"): 10.0}), late))

    assert not any("t3" in text for _, text in flown.story)
    assert set(flown.visits) == {"t0", "t1", "t2"}


def risky(*, reattempt: bool = False, success: float = 0.5, survival: float = 1.0) -> Mission:
    return replace(
        PAIR,
        success_default=success,
        survival_default=survival,
        reattempt_failed=reattempt,
        tasks=tuple(replace(each, service_s=2.0) for each in PAIR.tasks),
    )


def test_failed_attempts_close_their_task() -> None:
    fate = fate_of(Uncertainty(outcomes=True), risky())
    flown = Flown(fate)
    uavs = {each.id: each for each in fate.mission.uavs}
    tasks = {each.id: each for each in fate.mission.tasks}

    assert all(len(each) == 1 for each in flown.visits.values())
    for name, ((_, who, done),) in flown.visits.items():
        assert done == fate.succeeds(uavs[UavId(who)], tasks[TaskId(name)], 1)
    result = flown.world.world.mission_state.result()
    assert set(result.failed) == {
        name for name, ((_, _, done),) in flown.visits.items() if not done
    }
    assert 0 < len(result.failed) < 4
    assert result.open == ()


@pytest.mark.parametrize("coordinator_lost_s", [None, 0.0])
@pytest.mark.parametrize("method", ["greedy", "guided"])
def test_failed_attempts_are_repeated_until_they_succeed_where_the_scenario_says_so(
    method: str, coordinator_lost_s: float | None
) -> None:
    fate = fate_of(Uncertainty(outcomes=True), risky(reattempt=True, success=0.3))
    flown = Flown(fate, method, coordinator_lost_s)

    assert [each[-1][2] for each in flown.visits.values()] == [True] * 4
    assert not any(done for each in flown.visits.values() for _, _, done in each[:-1])
    assert len(flown.tally.visits) > 6
    assert flown.world.world.mission_state.result().failed == ()


def test_who_does_not_survive_a_task_makes_no_more_visits_and_claims_nothing() -> None:
    fate = fate_of(Uncertainty(survival=True), risky(success=1.0, survival=0.4))
    flown = Flown(fate)
    tasks = {each.id: each for each in fate.mission.tasks}
    visits = [(v.uav, v.task, v.completed_s) for v in flown.tally.visits]

    assert flown.world.lost
    for who in fate.mission.uavs:
        own = [tasks[name] for uav_id, name, _ in visits if uav_id == who.id]
        assert all(fate.survives(who, each, 1) for each in own[:-1])
        assert (who.id in flown.world.lost) == bool(own and not fate.survives(who, own[-1], 1))
    orphaned = [text for _, text in flown.story if "is open again" in text]
    assert orphaned == []


def test_slow_uavs_arrive_late_and_everything_else_stays() -> None:
    calm = Flown(fate_of(Uncertainty()))
    windy = Flown(fate_of(Uncertainty(speed_sd_frac=0.3, leg_sd_frac=0.2, wind_m_s=1.0)))

    assert set(windy.visits) == set(calm.visits)
    assert windy.visits != calm.visits


@pytest.mark.parametrize("coordinator_lost_s", [None, 0.0])
def test_on_a_network_that_loses_many_messages_every_task_is_done(
    coordinator_lost_s: float | None,
) -> None:
    uncertainty = Uncertainty(message_loss=0.3, delay_s=0.2, jitter_s=0.1)
    late = replace(PAIR, tasks=(*PAIR.tasks[:3], replace(PAIR.tasks[3], appears_s=20.0)))
    for seed in range(3):
        flown = Flown(fate_of(uncertainty, late, seed), coordinator_lost_s=coordinator_lost_s)

        assert set(flown.visits) == {"t0", "t1", "t2", "t3"}


def test_in_a_partition_both_sides_go_on() -> None:
    uncertainty = Uncertainty(partitions_per_min=6.0, partition_s=40.0)
    far = mission(
        [uav(f"u{n}", east_m=100.0 * n, speed_m_s=2.0) for n in range(4)],
        [task(f"t{n}", 25.0 * n) for n in range(12)],
    )
    fate = fate_of(uncertainty, far, 3)
    flown = Flown(fate)
    cut = fate.partitions[0]
    inside = {
        visit.uav in cut.group
        for visit in flown.tally.visits
        if cut.at_s + 10.0 < visit.completed_s < cut.at_s + cut.for_s
    }

    assert inside == {True, False}
    assert len(flown.visits) == 12


def test_a_mission_of_which_nobody_hears_is_broken_off() -> None:
    fate = fate_of(Uncertainty(message_loss=1.0))
    flown = StochasticWorld(fate, planner, method="greedy", seed=0)

    assert not flown.run()


EVERYTHING = Uncertainty(
    loss=0.4,
    popup=0.3,
    popups_per_min=4.0,
    withdrawals_per_min=2.0,
    outcomes=True,
    survival=True,
    speed_sd_frac=0.2,
    leg_sd_frac=0.2,
    wind_m_s=2.0,
    position_error_m=5.0,
    message_loss=0.2,
    delay_s=0.05,
    jitter_s=0.05,
    partitions_per_min=2.0,
    partition_s=20.0,
)


@pytest.mark.parametrize("seed", range(6))
def test_under_everything_at_once_a_mission_ends_and_loses_no_task(seed: int) -> None:
    rng = np.random.default_rng(seed)
    drawn = random_mission(rng, n_uav=4, n_task=10)
    drawn = replace(
        drawn, success_default=0.7, survival_default=0.97, reattempt_failed=seed % 2 == 0
    )
    fate = EVERYTHING.draw(drawn, 60.0, seed)
    flown = Flown(fate, "guided" if seed % 3 else "greedy", 0.0 if seed % 2 else None)
    left = [each for each in fate.mission.uavs if each.id in flown.world.world.finished]
    outcomes = {name: [done for _, _, done in each] for name, each in flown.visits.items()}

    for each in fate.mission.tasks:
        tried = outcomes.get(each.id, [])
        ended = any(tried) or (bool(tried) and not drawn.reattempt_failed)
        able = [one.id for one in left if fate.mission.success(one, each) > 0.0]
        assert ended or each.id in fate.withdrawn_at_s or not able, each.id
    assert set(flown.world.lost) == {each.id for each in drawn.uavs} - {each.id for each in left}
