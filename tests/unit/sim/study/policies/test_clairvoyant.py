"""Nobody exceeds the clairvoyant bound, however much of the realization he knows."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain, pairwise, permutations, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coordinator.planner.bound import meets, upper_bound
from coordinator.planner.plan import guided_plan
from sim.study.generator import mission_of, random_mission
from sim.study.policies.agents import GUIDED, GUIDED_ALONE
from sim.study.policies.clairvoyant import Clairvoyant, clairvoyant_bound
from sim.world.outcome import TaskVisit, value_of
from sim.world.uncertainty import Realization, Uncertainty
from swarm.model import Mission, Task, TaskId, Uav, UavId
from tests.unit.sim.study.policies.test_policies import CLOCK, POLICIES, drawn, planned

CALM = Uncertainty()
SPAN_S = 60.0


def tiny_mission(rng: np.random.Generator, n_uav: int, n_task: int) -> Mission:
    """Within some 30 s of flight; deadlines, pop-ups, failures and losses all matter."""
    tasks = tuple(
        Task(
            TaskId(f"t{i}"),
            (float(rng.uniform(0.0, 300.0)), float(rng.uniform(0.0, 300.0)), 0.0),
            value=float(rng.uniform(1.0, 10.0)),
            service_s=float(rng.choice([0.0, 5.0])),
            appears_s=float(rng.choice([0.0, 0.0, 20.0, 50.0])),
        )
        for i in range(n_task)
    )
    uavs = tuple(
        Uav(
            UavId(f"u{i}"),
            (float(rng.uniform(0.0, 300.0)), 0.0, 0.0),
            speed_m_s=float(rng.uniform(8.0, 15.0)),
            success={task.id: float(rng.choice([0.0, 0.5, 0.9])) for task in tasks},
            survival={task.id: float(rng.choice([0.6, 1.0])) for task in tasks},
        )
        for i in range(n_uav)
    )
    return Mission(
        name="tiny",
        horizon_s=float(rng.choice([40.0, 100.0])),
        uavs=uavs,
        tasks=tasks,
        reattempt_failed=bool(rng.integers(2)),
    )


def tiny_fate(seed: int, n_uav: int, n_task: int) -> Realization:
    """Everything that may be uncertain is so in some of them."""
    rng = np.random.default_rng(seed)

    def either(much: float) -> float:
        return much if rng.integers(2) else 0.0

    uncertainty = Uncertainty(
        loss=either(0.5),
        popup=either(0.5),
        withdrawals_per_min=either(2.0),
        outcomes=bool(rng.integers(2)),
        survival=bool(rng.integers(2)),
        speed_sd_frac=either(0.2),
        leg_sd_frac=either(0.4),
        wind_m_s=either(8.0),
        position_error_m=either(20.0),
    )
    return uncertainty.draw(tiny_mission(rng, n_uav, n_task), SPAN_S, seed)


def all_lists(n_uav: int, n_task: int) -> Iterator[list[tuple[int, ...]]]:
    """Every way to put some tasks on one ordered list per UAV."""
    tasks = range(n_task)
    for chosen in chain.from_iterable(permutations(tasks, k) for k in range(n_task + 1)):
        for cuts in combinations_with_ends(len(chosen), n_uav - 1):
            yield [chosen[a:b] for a, b in pairwise(cuts)]


def combinations_with_ends(length: int, inner: int) -> Iterator[tuple[int, ...]]:
    for cuts in product(range(length + 1), repeat=inner):
        if list(cuts) == sorted(cuts):
            yield (0, *cuts, length)


def flown(
    fate: Realization, lists: Sequence[Sequence[int]], detours: np.random.Generator | None = None
) -> list[TaskVisit]:
    """Fly lists, waiting at tasks that have not appeared, and trying again where that is done.

    With ``detours`` UAVs begin some legs towards other tasks and turn off on the way, and may do
    other tasks before they try one again.
    """
    visits = []
    for uav, route in zip(fate.mission.uavs, lists, strict=True):
        visits += list(flown_by(fate, uav, [fate.mission.tasks[i] for i in route], detours))
    return sorted(visits, key=lambda visit: visit.completed_s)


def flown_by(
    fate: Realization, uav: Uav, route: Sequence[Task], detours: np.random.Generator | None
) -> Iterator[TaskVisit]:
    now_s, place = 0.0, uav.position_enu_m
    lost_s = fate.lost_at_s.get(uav.id, math.inf)
    route, attempts = list(route), Counter[TaskId]()
    while route:
        task = route.pop(0)
        if detours is not None and detours.integers(2):
            other = fate.mission.tasks[int(detours.integers(len(fate.mission.tasks)))]
            stop, share = fate.stop_enu_m(uav.id, other), float(detours.uniform(0.0, 0.9))
            leg_s = math.dist(place, stop) / fate.speed_m_s(uav, other.id, place, stop)
            now_s += share * leg_s
            east, north, up = (a + share * (b - a) for a, b in zip(place, stop, strict=True))
            place = east, north, up
        stop = fate.stop_enu_m(uav.id, task)
        now_s += math.dist(place, stop) / fate.speed_m_s(uav, task.id, place, stop)
        now_s, place = max(now_s, task.appears_s) + task.service_s, stop
        if now_s > lost_s or fate.mission.success(uav, task) == 0.0:
            return
        attempts[task.id] += 1
        done = fate.succeeds(uav, task, attempts[task.id])
        yield TaskVisit(uav.id, task.id, now_s, done)
        if not fate.survives(uav, task, attempts[task.id]):
            return
        if not done and fate.mission.reattempt_failed and attempts[task.id] < 30:
            later = 0 if detours is None else int(detours.integers(len(route) + 1))
            route.insert(later, task)


@settings(deadline=None, max_examples=40)
@given(seed=st.integers(0, 2**32 - 1), n_uav=st.integers(1, 2), n_task=st.integers(1, 4))
def test_no_lists_whatever_exceed_it(seed: int, n_uav: int, n_task: int) -> None:
    fate = tiny_fate(seed, n_uav, n_task)
    bound = clairvoyant_bound(fate)

    best = max(all_lists(n_uav, n_task), key=lambda lists: value_of(fate, flown(fate, lists)))

    most = value_of(fate, flown(fate, best))
    assert bound >= most * (1.0 - 1e-12)
    rng = np.random.default_rng(seed)
    assert all(bound >= value_of(fate, flown(fate, best, rng)) for _ in range(20))


@pytest.mark.parametrize("seed", [0, 1])
def test_no_policy_exceeds_it(seed: int) -> None:
    fate = drawn(seed)
    bound = clairvoyant_bound(fate)

    for policy in (*POLICIES, GUIDED, GUIDED_ALONE):
        assert value_of(fate, policy.fly(fate, planned, CLOCK).visits) <= bound


@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 2**32 - 1), n_task=st.integers(1, 3))
def test_it_is_reached_by_one_uav_whose_legs_do_not_vary_and_who_tries_once(
    seed: int, n_task: int
) -> None:
    fate = tiny_fate(seed, 1, n_task)
    steady = replace(fate.uncertainty, leg_sd_frac=0.0, survival=True)
    # Where failed tasks open again, other tasks between two attempts are bounded less tightly.
    mission = replace(fate.mission, reattempt_failed=False)
    fate = replace(fate, mission=mission, uncertainty=steady)

    most = max(value_of(fate, flown(fate, lists)) for lists in all_lists(1, n_task))

    assert clairvoyant_bound(fate) == pytest.approx(max(0.0, most), rel=1e-6)


@pytest.mark.parametrize(("n_uav", "n_task", "seed"), [(5, 20, 4), (2, 12, 4), (10, 50, 2)])
def test_without_uncertainty_it_is_no_larger_than_the_bound_on_plans(
    n_uav: int, n_task: int, seed: int
) -> None:
    problem = random_mission(n_uav, n_task, seed)
    plan = guided_plan(problem, threads=1)

    bound = clairvoyant_bound(CALM.draw(mission_of(problem, "calm"), SPAN_S, 0))

    assert plan.objective * (1.0 - 1e-9) <= bound
    assert meets(bound, upper_bound(problem, plan.routes, threads=1).objective)


def test_it_is_close_to_what_hindsight_reaches() -> None:
    problem = random_mission(10, 50, 2)
    plan = guided_plan(problem, threads=1)

    bound = clairvoyant_bound(CALM.draw(mission_of(problem, "calm"), SPAN_S, 0))

    assert plan.objective <= bound <= 1.01 * plan.objective


def test_what_a_fate_takes_away_lowers_it() -> None:
    mission = mission_of(random_mission(4, 16, 3), "rough")
    calm = CALM.draw(mission, SPAN_S, 1)

    fates = [
        calm,
        replace(calm, lost_at_s={mission.uavs[0].id: 30.0}),
        replace(calm, withdrawn_at_s={task.id: 30.0 for task in mission.tasks[:8]}),
        Uncertainty(popup=1.0).draw(mission, 2.0 * mission.horizon_s, 1),
    ]

    whole, *less = [clairvoyant_bound(fate) for fate in fates]
    assert all(0.0 < bound < 0.99 * whole for bound in less)


def test_a_mission_with_nobody_or_nothing_is_worth_nothing() -> None:
    mission = mission_of(random_mission(2, 3, 0), "empty")

    for empty in (replace(mission, uavs=()), replace(mission, tasks=())):
        assert clairvoyant_bound(CALM.draw(empty, SPAN_S, 0)) == 0.0


def test_it_comes_out_the_same_again() -> None:
    fate = tiny_fate(5, 2, 4)

    assert Clairvoyant().value(fate) == clairvoyant_bound(fate) > 0.0
