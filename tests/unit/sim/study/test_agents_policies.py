"""The agents' own policies: their plan where nothing is uncertain, and what is counted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from coordinator.planner.options import after_evaluations
from coordinator.planner.plan import make_plan
from sim.study.policies.agents import GREEDY, GUIDED, GUIDED_ALONE, LOOKAHEAD, AgentsPolicy
from sim.study.policies.roster import Planner
from sim.world.outcome import FlightOutcome, score
from sim.world.uncertainty import Uncertainty
from swarm.model import Mission, Plan, TaskId, UavId
from swarm.runtime.clock import SystemClock
from tests.support.builders import mission, task, uav
from tests.support.fleet_builders import random_mission

POLICIES = [GREEDY, LOOKAHEAD, GUIDED_ALONE, GUIDED]
ALL = pytest.mark.parametrize("policy", POLICIES, ids=lambda policy: policy.name)


class StepClock:
    """A clock that is read a second later each time."""

    def __init__(self) -> None:
        self.read = 0

    def now_s(self) -> float:
        self.read += 1
        return float(self.read)

    def wall_delay_s(self, delay_s: float) -> float:
        return delay_s


def planner() -> tuple[Planner, list[Plan]]:
    """Plans once per method; and the plans made so far."""
    made: list[Plan] = []

    def plan(what: Mission, method: str) -> Plan:
        known = [each for each in made if each.method == method]
        if not known:
            stop, clock = after_evaluations(50), SystemClock()
            made.append(make_plan(what.known_at_start(), method, clock=clock, seed=0, stop=stop))
        return (known or made)[-1]

    return plan, made


def fly(
    policy: AgentsPolicy, uncertainty: Uncertainty, flown: Mission, seed: int = 1
) -> FlightOutcome:
    return policy.fly(uncertainty.draw(flown, 60.0, seed), planner()[0], StepClock())


def drawn_mission(seed: int, n_uav: int = 3, n_task: int = 8) -> Mission:
    return random_mission(np.random.default_rng(seed), n_uav=n_uav, n_task=n_task)


@ALL
@pytest.mark.parametrize("seed", range(4))
def test_where_nothing_is_uncertain_they_fly_exactly_their_plan(
    policy: AgentsPolicy, seed: int
) -> None:
    flown, (plan, made) = drawn_mission(seed), planner()
    flight = policy.fly(Uncertainty().draw(flown, 60.0, seed), plan, StepClock())
    routes: dict[UavId, tuple[TaskId, ...]] = {each.id: () for each in flown.uavs}
    for visit in flight.visits:
        routes[visit.uav] += (visit.task,)

    (used,) = made
    if policy.method != "guided":  # those may find better lists than the plan's on their way
        assert routes == used.routes
        times_s = {visit.task: visit.completed_s for visit in flight.visits}
        assert times_s == pytest.approx(used.completion_s, abs=1e-9)
    value = score(Uncertainty().draw(flown, 60.0, seed), flight).value
    assert value >= used.objective - 1e-9 * abs(used.objective)
    assert (flight.epochs, flight.moved, flight.released, flight.lost_uavs) == (1, 0, 0, ())
    assert flight.messages > 0


@ALL
def test_the_same_fate_gives_the_same_flight(policy: AgentsPolicy) -> None:
    rough = Uncertainty(
        loss=0.4, popup=0.3, outcomes=True, speed_sd_frac=0.2, message_loss=0.1, jitter_s=0.02
    )
    flown = replace(drawn_mission(3), success_default=0.7, reattempt_failed=True)
    one, same = (replace(fly(policy, rough, flown), decision_s=()) for _ in range(2))

    assert one == same
    assert one != replace(fly(policy, rough, flown, seed=2), decision_s=())


def test_each_decision_is_timed_by_the_clock_passed_in() -> None:
    flight = fly(GREEDY, Uncertainty(), drawn_mission(0, 2, 6))

    assert flight.decision_s == (1.0,) * 6


PAIR = mission(
    [uav("u0", speed_m_s=2.0), uav("u1", east_m=100.0, speed_m_s=2.0)],
    [task("t0", 10.0), task("t1", 30.0), task("t2", 90.0), task("t3", 60.0)],
)


def test_a_uav_called_off_its_way_is_counted_as_a_release() -> None:
    flight = fly(GREEDY, Uncertainty(withdrawn_at_s={TaskId("t0"): 1.0}), PAIR)

    assert flight.released == 1
    assert {visit.task for visit in flight.visits} == {"t1", "t2", "t3"}


def test_visits_are_in_order_and_losses_are_told() -> None:
    flight = fly(GUIDED_ALONE, Uncertainty(lost_at_s={UavId("u1"): 6.0, UavId("u0"): 2.0}), PAIR)
    times_s = [visit.completed_s for visit in flight.visits]

    assert flight.lost_uavs == ("u0", "u1")
    assert times_s == sorted(times_s)
    assert [visit.uav for visit in flight.visits] == ["u1"]


def test_two_visits_to_one_task_are_two_visits() -> None:
    """Cut off from each other from the start, both go for what is nearest to both."""
    both = mission(
        [uav("u0", speed_m_s=2.0), uav("u1", east_m=2.0, speed_m_s=2.0)], [task("t0", 200.0)]
    )
    uncertainty = Uncertainty(partitions_per_min=60.0, partition_s=500.0)
    flight = fly(GREEDY, uncertainty, both)
    fate = uncertainty.draw(both, 60.0, 1)

    assert score(fate, flight).duplicate_visits == len(flight.visits) - 1


def test_a_coordinator_that_lives_plans_anew_and_moves_tasks() -> None:
    """Legs that take far longer than planned leave some UAVs with too much to do."""
    uncertain, flown = Uncertainty(leg_sd_frac=0.8), drawn_mission(0, 4, 16)
    flight, alone = (fly(policy, uncertain, flown, 0) for policy in (GUIDED, GUIDED_ALONE))

    assert flight.epochs > 1
    assert flight.moved > 0
    assert (alone.epochs, alone.moved) == (1, 0)
