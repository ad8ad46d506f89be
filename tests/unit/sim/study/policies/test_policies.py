from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coordinator.planner.plan import make_plan
from sim.study.baselines.cbba import cbba
from sim.study.baselines.index_rules import nearest_first, value_per_time
from sim.study.generator import mission_of
from sim.study.policies.dispatchers import (
    FROZEN,
    NEAREST_FIRST,
    VALUE_PER_TIME_ONLINE,
    RuleDispatcher,
)
from sim.study.policies.replanning import (
    CBBA,
    CENTRAL,
    CENTRAL_DIVERT,
    CentralOptimiser,
    interval,
)
from sim.study.policies.roster import Policy
from sim.study.policies.situation import Account, TeamNews, TeamSituation
from sim.study.policies.team import fly_team
from sim.world.outcome import FlightOutcome, score, value_of
from sim.world.uncertainty import Realization, Uncertainty
from swarm.allocation import Problem, TeamState, evaluate, rank_of, rule_by_name, run
from swarm.allocation.rules import GuidedRule
from swarm.model import Mission, Plan
from tests.support.builders import mission, task, uav
from tests.support.problems import random_problem
from tests.unit.sim.study.policies.play import StillClock, calm, fate_of, flown, planner_of, times_s
from tests.unit.sim.study.policies.test_team import random_lists

SEEDS = st.integers(0, 2**32 - 1)
CLOCK = StillClock()
POLICIES: tuple[Policy, ...] = (
    CENTRAL,
    CENTRAL_DIVERT,
    interval(2.0),
    FROZEN,
    CBBA,
    NEAREST_FIRST,
    VALUE_PER_TIME_ONLINE,
)
ROUGH = Uncertainty(
    loss=0.4,
    popup=0.3,
    popups_per_min=20.0,
    withdrawals_per_min=20.0,
    outcomes=True,
    survival=True,
    speed_sd_frac=0.2,
    leg_sd_frac=0.2,
    wind_m_s=0.5,
    position_error_m=0.3,
)


def planned(mission: Mission, method: str) -> Plan:
    return make_plan(mission, method, clock=CLOCK)


def drawn(seed: int, uncertainty: Uncertainty = ROUGH) -> Realization:
    rng = np.random.default_rng(seed)
    problem = random_problem(rng, 4, 10, lowest_survival=0.7, incapable_frac=0.2, horizon_s=12.0)
    scenario = replace(mission_of(problem, "drawn"), reattempt_failed=bool(rng.integers(2)))
    return uncertainty.draw(scenario, 10.0, seed)


# -- nothing happens ---------------------------------------------------------------------


@settings(max_examples=20, deadline=None)
@given(seed=SEEDS)
def test_frozen_flies_its_plan(seed: int) -> None:
    rng = np.random.default_rng(seed)
    problem = random_problem(rng, 3, 9, lowest_survival=0.5)
    routes = random_lists(rng, 3, 9)
    flight = FROZEN.fly(calm(problem), planner_of(problem, routes), CLOCK)
    objective, expected_s = evaluate(problem, routes)
    assert flown(problem, flight) == routes
    assert times_s(flight) == dict(zip(problem.task_ids, expected_s.tolist(), strict=True))
    assert value_of(calm(problem), flight.visits) == pytest.approx(objective)
    assert (flight.epochs, flight.moved) == (1, 0)


@settings(max_examples=20, deadline=None)
@given(seed=SEEDS)
def test_rules_fly_what_they_lead_to(seed: int) -> None:
    rng = np.random.default_rng(seed)
    problem = random_problem(rng, 3, 9, lowest_survival=0.5, incapable_frac=0.2)
    fate, plan = calm(problem), planner_of(problem, [[], [], []])
    nearest = NEAREST_FIRST.fly(fate, plan, CLOCK)
    assert flown(problem, nearest) == nearest_first(problem)
    by_value = VALUE_PER_TIME_ONLINE.fly(fate, plan, CLOCK)
    assert flown(problem, by_value) == value_per_time(problem)
    assert (by_value.epochs, by_value.moved) == (0, 0)
    assert len(by_value.decision_s) >= len(by_value.visits)


@settings(max_examples=20, deadline=None)
@given(seed=SEEDS)
def test_auction_flies_its_paths(seed: int) -> None:
    problem = random_problem(np.random.default_rng(seed), 3, 9, incapable_frac=0.2)
    flight = CBBA.fly(calm(problem), planner_of(problem, [[], [], []]), CLOCK)
    assert flown(problem, flight) == cbba(problem).routes
    assert flight.epochs == 1


@pytest.mark.parametrize("rule", ["greedy", "lookahead"])
@settings(max_examples=20, deadline=None)
@given(seed=SEEDS)
def test_rules_of_the_paper_fly_the_lower_level(rule: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    problem = random_problem(rng, 3, 8, lowest_survival=0.5)
    order = rng.permutation(3).tolist()
    expected, _ = run(problem, TeamState.at_start(problem), rank_of(order), rule_by_name(rule))
    dispatcher = RuleDispatcher(rule_by_name(rule), Account(CLOCK))
    sequence = [problem.uav_ids[row] for row in order]
    assert flown(problem, fly_team(calm(problem), dispatcher, sequence=sequence)) == expected


@settings(max_examples=10, deadline=None)
@given(seed=SEEDS)
def test_those_who_improve_a_plan_are_never_worse(seed: int) -> None:
    rng = np.random.default_rng(seed)
    problem = random_problem(rng, 3, 8, lowest_survival=0.8)
    routes = random_lists(rng, 3, 8)
    plan, worth = planner_of(problem, routes), evaluate(problem, routes)[0]
    fate = calm(problem)
    lists = {str(uav): tasks for uav, tasks in plan(fate.mission, "guided").routes.items()}
    guided = fly_team(fate, RuleDispatcher(GuidedRule(lists), Account(CLOCK)))
    flights = [p.fly(fate, plan, CLOCK) for p in (CENTRAL, CENTRAL_DIVERT, interval(1.0))]
    for flight in (guided, *flights):
        assert value_of(fate, flight.visits) >= worth - 1e-9 * abs(worth)


# -- something happens -------------------------------------------------------------------


class Recorder(CentralOptimiser):
    """Remembers where the team stood when a UAV was lost."""

    at_loss: tuple[Problem, TeamState] | None = None

    def hear(self, situation: TeamSituation, news: Collection[TeamNews]) -> Collection[int]:
        if TeamNews.LOST in news:
            self.at_loss = situation.problem, situation.state.copy()
        return super().hear(situation, news)


def best_worth(problem: Problem, state: TeamState) -> float:
    """Of all lists for what is open, plainly tried one by one."""
    left = np.flatnonzero(state.open).tolist()
    living = np.flatnonzero(state.active).tolist()

    def lists() -> Iterator[list[list[int]]]:
        for order in permutations(left):
            for cuts in np.ndindex(*[len(left) + 1] * (len(living) - 1)):
                ends = [0, *cuts, len(left)]
                if ends == sorted(ends):
                    routes: list[list[int]] = [[] for _ in range(problem.n_uav)]
                    for n, row in enumerate(living):
                        routes[row] = list(order[ends[n] : ends[n + 1]])
                    yield routes

    return max(evaluate(problem, routes, state)[0] for routes in lists())


@pytest.mark.parametrize("seed", range(12))
def test_central_makes_the_best_of_what_a_loss_leaves(seed: int) -> None:
    rng = np.random.default_rng(seed)
    problem = random_problem(rng, 3, 7, lowest_survival=0.8, horizon_s=8.0)
    scenario = mission_of(problem, "loss")
    fate = fate_of(scenario, lost_at_s={problem.uav_ids[seed % 3]: float(rng.uniform(0.2, 1.5))})
    best = planned(scenario, "guided")
    central = Recorder(best.routes, Account(CLOCK), seed=0)
    flight = fly_team(fate, central, sequence=best.sequence)
    assert central.at_loss is not None
    known, state = central.at_loss
    open_then = {task for task, is_open in zip(known.task_ids, state.open, strict=True) if is_open}
    others = [visit for visit in flight.visits if visit.task not in open_then]
    expected = value_of(fate, others) + best_worth(known, state)
    assert value_of(fate, flight.visits) == pytest.approx(expected)


def diversion() -> tuple[Realization, list[list[int]]]:
    """On the way to a far task, something worth much more appears behind."""
    far = mission(
        [uav("u1")], [task("a", 100.0), task("b", -20.0, 50.0, appears_s=10.0)], horizon_s=500.0
    )
    return fate_of(far), [[0]]


def test_diverting_breaks_the_promise_that_central_keeps() -> None:
    fate, routes = diversion()
    plan = planner_of(Problem.from_mission(fate.mission), routes)
    kept, diverted = (p.fly(fate, plan, CLOCK) for p in (CENTRAL, CENTRAL_DIVERT))
    assert times_s(kept) == {"a": 100.0, "b": 220.0}
    assert times_s(diverted) == {"b": 40.0, "a": 160.0}
    assert (kept.released, diverted.released) == (0, 1)


def test_diverting_leaves_those_alone_who_serve() -> None:
    served = mission(
        [uav("u1")],
        [task("a", 5.0, service_s=100.0), task("b", -20.0, 50.0, appears_s=10.0)],
        horizon_s=500.0,
    )
    plan = planner_of(Problem.from_mission(served), [[0]])
    assert times_s(CENTRAL_DIVERT.fly(fate_of(served), plan, CLOCK)) == {"a": 105.0, "b": 130.0}


def test_intervals_bring_a_new_plan_and_gaps_are_filled_in_between() -> None:
    scenario = mission(
        [uav("u1"), uav("u2", 50.0)],
        [task("a", 10.0), task("b", 20.0), task("c", 30.0), task("d", 52.0, appears_s=1.0)],
    )
    plan = planner_of(Problem.from_mission(scenario), [[0, 1, 2], []])
    frozen = FROZEN.fly(fate_of(scenario), plan, CLOCK)
    assert times_s(frozen) == {"d": 3.0, "a": 10.0, "b": 20.0, "c": 30.0}
    late = interval(1000.0).fly(fate_of(scenario), plan, CLOCK)
    assert late.visits == frozen.visits
    soon = interval(2.0).fly(fate_of(scenario), plan, CLOCK)
    assert times_s(soon) == {"d": 3.0, "a": 10.0, "c": 25.0, "b": 20.0}
    assert (soon.epochs, soon.moved) == (2, 1)


def test_frozen_list_of_a_lost_uav_is_taken_by_those_who_have_done_theirs() -> None:
    scenario = mission(
        [uav("u1"), uav("u2", 50.0)], [task("a", 10.0), task("b", 20.0), task("c", 45.0)]
    )
    fate = fate_of(scenario, lost_at_s={"u1": 12.0})
    plan = planner_of(Problem.from_mission(scenario), [[0, 1], [2]])
    flight = FROZEN.fly(fate, plan, CLOCK)
    assert [(v.uav, v.task, v.completed_s) for v in flight.visits] == [
        ("u2", "c", 5.0),
        ("u1", "a", 10.0),
        ("u2", "b", 37.0),
    ]


def test_auction_is_held_again_when_a_uav_is_lost() -> None:
    scenario = mission(
        [uav("u1"), uav("u2", 50.0)], [task("a", 10.0), task("b", 20.0), task("c", 45.0)]
    )
    fate = fate_of(scenario, lost_at_s={"u1": 4.0})
    flight = CBBA.fly(fate, planner_of(Problem.from_mission(scenario), [[], []]), CLOCK)
    assert [(v.task, v.completed_s) for v in flight.visits] == [
        ("c", 5.0),
        ("b", 30.0),
        ("a", 40.0),
    ]
    assert flight.epochs == 2
    assert len(flight.decision_s) == 2


@pytest.mark.parametrize("policy", POLICIES, ids=lambda policy: policy.name)
@settings(max_examples=12, deadline=None)
@given(seed=SEEDS)
def test_every_task_is_accounted_for_whatever_happens(policy: Policy, seed: int) -> None:
    fate = drawn(seed)
    flight = policy.fly(fate, planned, CLOCK)
    require_order(fate, flight)
    tasks = {task.id: task for task in fate.mission.tasks}
    tried = {visit.task for visit in flight.visits}
    succeeded = {visit.task for visit in flight.visits if visit.done}
    living = [uav for uav in fate.mission.uavs if uav.id not in flight.lost_uavs]
    reattempts = fate.mission.reattempt_failed
    for name in set(tasks) - set(fate.withdrawn_at_s) - (succeeded if reattempts else tried):
        assert not any(fate.mission.success(uav, tasks[name]) > 0.0 for uav in living)
    assert score(fate, flight).duplicate_visits == 0


def require_order(fate: Realization, flight: FlightOutcome) -> None:
    """Nobody is at two places, does what is not there, or goes on after its end."""
    uavs = {uav.id: uav for uav in fate.mission.uavs}
    tasks = {task.id: task for task in fate.mission.tasks}
    ends_s = [visit.completed_s for visit in flight.visits]
    assert ends_s == sorted(ends_s)
    free_s = dict.fromkeys(uavs, 0.0)
    closed: set[str] = set()
    attempts: dict[tuple[str, str], int] = {}
    gone: set[str] = set()
    for visit in flight.visits:
        who, what = uavs[visit.uav], tasks[visit.task]
        key = visit.uav, visit.task
        attempts[key] = attempts.get(key, 0) + 1
        assert visit.uav not in gone
        assert visit.task not in closed
        assert fate.mission.success(who, what) > 0.0
        begin_s = visit.completed_s - what.service_s
        assert begin_s >= max(free_s[who.id], what.appears_s) - 1e-9
        assert visit.completed_s <= fate.lost_at_s.get(who.id, np.inf)
        assert visit.completed_s <= fate.withdrawn_at_s.get(what.id, np.inf)
        assert visit.done == fate.succeeds(who, what, attempts[key])
        free_s[who.id] = visit.completed_s
        if visit.done or not fate.mission.reattempt_failed:
            closed.add(visit.task)
        if not fate.survives(who, what, attempts[key]):
            gone.add(visit.uav)
    assert gone <= set(flight.lost_uavs)


@pytest.mark.parametrize("policy", POLICIES, ids=lambda policy: policy.name)
def test_same_fate_same_flight(policy: Policy) -> None:
    for seed in (1, 2):
        first, again = (policy.fly(drawn(seed), planned, CLOCK) for _ in range(2))
        assert first == again


def test_names_tell_policies_apart() -> None:
    assert [policy.name for policy in POLICIES] == [
        "central",
        "central-divert",
        "interval:2",
        "frozen",
        "cbba",
        "nearest",
        "value-per-time",
    ]
    assert all(policy.what for policy in POLICIES)


@pytest.mark.parametrize("interval_s", [0.0, -1.0, float("inf"), float("nan")])
def test_intervals_are_positive_and_finite(interval_s: float) -> None:
    with pytest.raises(ValueError, match="interval_s"):
        interval(interval_s)
