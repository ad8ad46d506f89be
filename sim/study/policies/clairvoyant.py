"""A value that nobody can exceed who meets the same realization, not even one who knows all of it.

**What counts.** Whoever decides, every task adds to `sim.world.outcome.value_of` at one visit at
most. Let j be the UAV that makes it, at time t, at the end of its k-th attempt. What the visit adds
is at most S·m·(D − t)⁺ times p, or times 1 where outcomes are drawn. Then k is 1, or the number of
the attempt that the realization lets succeed; that must be 1 as well unless the mission reattempts,
as no UAV tries again what is not open again. So

- t is not before the task has appeared, j could be there and k services are over, nor after the
  task is withdrawn or j is lost; earlier attempts may have been made long before, so after its
  previous counted visit j has to fly there and to serve once;
- S is 1 where survival is drawn, and j survives its attempts before the k-th; if it does not
  survive that one either, this task is its last, which is S = 0 for all that follow;
- elsewhere S is at most the product of j's survival probabilities over its counted visits so far,
  each with the power of its number of attempts.

**Flights.** Between two of its counted visits j moves from true stop to true stop and then serves.
It may turn off on the way, towards other tasks, and however it turns its velocity stays within what
the realization lets it fly in that direction at the greatest speed of all its legs. With a wind
these velocities form a convex set around 0 (two balls' common part), so by the triangle inequality
no detour is faster than the straight leg at that speed. Without variation from leg to leg that is
the leg as it is really flown; with it the bound is that much too generous. So it is where UAVs take
their time to change speed: who turns off on its way stops there in no time, and may so have flown
at full speed throughout, which is all that is counted on here.

**The bound.** So no value exceeds the largest sum of worths over disjoint lists of tasks, one list
per UAV, so timed and worth so much, where UAVs wait as they like. How prices of tasks bound that
from above is told in `coordinator.planner.bound`; here each UAV's best list at given prices is
searched for among real lists with exact times, which leaves the duality gap. That is closed as the
planner closes it, by choosing among all lists that may be part of an optimum, as far as a fixed
amount of work allows. Where it is lower the trivial bound counts: every task reached straight from
its best UAV's start, as soon as that may be.

Leaves out: a flight that reaches the bound, which need not exist. Who waits at a place before the
task there appears knew of it, so part of what policies miss is beyond them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from coordinator.planner.bound import closed_bound, lagrangian_bound
from sim.world.motion import Point
from sim.world.uncertainty import Realization
from swarm.allocation import Problem
from swarm.allocation.problem import BoolArray, FloatArray, IntArray, straight_m
from swarm.allocation.rules import team_at_start
from swarm.kernels.routes import TeamArrays
from swarm.kernels.routes_bound import Timetable, relaxed_lists, worthy_timed_lists
from swarm.kernels.routes_pricing import ListBundle
from swarm.model import Task, Uav

_ROUNDS = 60
_OPERATIONS = 1e10
"""Of the dynamic programme in all: some ten seconds."""
_FEWEST_ROUNDS = 4
_BUCKETS_PER_TASK = 30.0
"""Up to the horizon, per task on a UAV's list."""
_FEWEST_BUCKETS, _MOST_BUCKETS = 150, 400
_EXPANSIONS = 2000
"""Of the search among real lists, per list; with lists of some five tasks it seldom needs them."""
_REACHED = 4e6
"""Places at which all these searches of a round may look."""
_CLOSING_HEADS = 20_000
"""Beginnings of lists looked at, per UAV, when those that might be part of an optimum are named."""
_CLOSING_ASKED = 1000
"""How often closing asks whether to end, which it does about every millisecond."""
_FIRST_PRICE = 0.5
"""Of a task, as a share of what it is worth when reached straight from the best start."""
_ROUNDING = 1e-10
_MOST_ATTEMPTS = 64
"""Looked at; after these the next is taken to succeed."""
_SLACK_S = 1e-6
"""By which a visit may miss a deadline through rounding."""


class Clairvoyant:
    """The bound of whoever knows the draws."""

    name = "clairvoyant"
    what = "no policy can be better: an upper bound that knows all draws"

    def value(self, fate: Realization) -> float:
        """The bound for that realization [value·s]."""
        return clairvoyant_bound(fate)


def clairvoyant_bound(fate: Realization) -> float:
    """No flight in ``fate`` has a larger value [value·s].

    Half a second at 10 UAVs × 50 tasks. Where lists are long (more than ten tasks) the
    search among real ones is cut short and the bound a few per cent above the best flight; with
    thousands of tasks only the trivial one is given.
    """
    hindsight = _Hindsight.of(fate)
    direct = hindsight.direct_worth()
    trivial = float(direct.sum()) * (1.0 + 1e-9)
    n_uav, n_task = hindsight.worth.shape
    if trivial == 0.0:
        return 0.0
    buckets = _BUCKETS_PER_TASK * n_task / n_uav
    buckets = min(max(buckets, _FEWEST_BUCKETS), _MOST_BUCKETS)
    rounds = min(_ROUNDS, int(_OPERATIONS / (n_uav * n_task**2 * buckets)))
    if rounds < _FEWEST_ROUNDS:
        return trivial
    bucket_s = fate.mission.horizon_s / buckets
    pricing = partial(
        relaxed_lists,
        hindsight.team,
        bucket_s=bucket_s,
        timetable=hindsight.timetable,
        expansions=min(_EXPANSIONS, int(_REACHED / (n_uav * n_task))),
        threads=1,
    )
    price = _FIRST_PRICE * direct
    relaxed = lagrangian_bound(pricing, price, ListBundle(n_uav, price), rounds=rounds)
    stops = _Asked(_CLOSING_ASKED)
    worthy = partial(
        worthy_timed_lists,
        hindsight.team,
        relaxed.price,
        relaxed.earned,
        bucket_s=bucket_s,
        heads=_CLOSING_HEADS,
        timetable=hindsight.timetable,
        threads=1,
        should_stop=stops,
    )
    closed, _ = closed_bound(worthy, relaxed, 0.0, stops)
    return min(closed * (1.0 + _ROUNDING), trivial)


class _Asked:
    """Says to stop once it was asked so often: the same work on every machine."""

    def __init__(self, most: int) -> None:
        self._left = most

    def __call__(self) -> bool:
        self._left -= 1
        return self._left < 0


@dataclass(frozen=True, slots=True, eq=False)
class _Hindsight:
    """The mission as it looks to one who knows the realization."""

    team: TeamArrays
    worth: FloatArray
    """(n_uav, n_task) what a visit that counts is worth per second before D."""
    horizon_s: float
    earliest_s: FloatArray
    latest_s: FloatArray
    first_s: FloatArray
    timetable: Timetable

    @classmethod
    def of(cls, fate: Realization) -> _Hindsight:
        """All that the realization says of every UAV and task."""
        mission = fate.mission
        problem = Problem.from_mission(mission)
        attempts, survives = _attempts(fate)
        tries = np.maximum(attempts, 1)
        success = np.ones_like(problem.success) if fate.uncertainty.outcomes else problem.success
        success = np.where(problem.capable & (attempts > 0), success, 0.0)
        if fate.uncertainty.survival:
            survival = survives.astype(float)
        else:
            success = success * problem.survival ** (tries - 1)
            survival = problem.survival**tries
        appears_s = np.array([task.appears_s for task in mission.tasks], float)
        lost_s = np.array([fate.lost_at_s.get(uav.id, math.inf) for uav in mission.uavs], float)
        gone_s = np.array([fate.withdrawn_at_s.get(t.id, math.inf) for t in mission.tasks], float)
        start_s, between_s = _flights_s(fate)
        drawn = replace(problem, success=success, survival=survival)
        earliest_s = np.maximum(appears_s, start_s) + tries * problem.service_s
        latest_s = np.minimum(lost_s[:, None], gone_s) + _SLACK_S
        first_s = start_s + problem.service_s
        return cls(
            team=team_at_start(drawn),
            worth=drawn.weight,
            horizon_s=problem.horizon_s,
            earliest_s=earliest_s,
            latest_s=latest_s,
            first_s=first_s,
            timetable=Timetable(first_s, between_s + problem.service_s, earliest_s, latest_s),
        )

    def direct_worth(self) -> FloatArray:
        """(n_task,) what each task is worth when its best UAV flies straight to it."""
        done_s = np.maximum(self.first_s, self.earliest_s)
        left_s = np.where(done_s <= self.latest_s, np.maximum(0.0, self.horizon_s - done_s), 0.0)
        worth: FloatArray = (self.worth * left_s).max(axis=0, initial=0.0)
        return worth


def _attempts(fate: Realization) -> tuple[IntArray, BoolArray]:
    """(n_uav, n_task) attempts until one succeeds, 0 for never; whether the UAV survives them."""
    mission = fate.mission
    shape = (len(mission.uavs), len(mission.tasks))
    attempts, survives = np.ones(shape, dtype=np.int64), np.ones(shape, dtype=np.bool_)
    if fate.uncertainty.outcomes or fate.uncertainty.survival:
        for row, uav in enumerate(mission.uavs):
            for column, task in enumerate(mission.tasks):
                attempts[row, column], survives[row, column] = _attempts_of(fate, uav, task)
    return attempts, survives


def _attempts_of(fate: Realization, uav: Uav, task: Task) -> tuple[int, bool]:
    most = _MOST_ATTEMPTS if fate.mission.reattempt_failed else 1
    for attempt in range(1, most + 1):
        survives = fate.survives(uav, task, attempt)
        if fate.succeeds(uav, task, attempt):
            return attempt, survives
        if not survives:
            return 0, False
    return (most + 1, True) if fate.mission.reattempt_failed else (0, True)


def _flights_s(fate: Realization) -> tuple[FloatArray, FloatArray]:
    """Least flight times, from starts (n_uav, n_task) and between tasks (n_uav, n_task, n_task)."""
    mission = fate.mission
    n_uav, n_task = len(mission.uavs), len(mission.tasks)
    start_s, between_s = np.zeros((n_uav, n_task)), np.zeros((n_uav, n_task, n_task))
    for row, uav in enumerate(mission.uavs):
        stops = [fate.stop_enu_m(uav.id, task) for task in mission.tasks]
        fast = _at_its_fastest(fate, uav)
        start_s[row] = _legs_s(fate, fast, [uav.position_enu_m], stops)
        between_s[row] = _legs_s(fate, fast, stops, stops)
    return start_s, between_s


def _at_its_fastest(fate: Realization, uav: Uav) -> Uav:
    """The UAV with the speed on its fastest leg as its cruise speed, as variation there goes."""
    here = uav.position_enu_m
    still_m_s = fate.speed_m_s(uav, None, here, here)
    speeds_m_s = (fate.speed_m_s(uav, task.id, here, here) for task in fate.mission.tasks)
    fastest_m_s = max(speeds_m_s, default=still_m_s)
    return replace(uav, speed_m_s=uav.speed_m_s * max(1.0, fastest_m_s / still_m_s))


def _legs_s(fate: Realization, uav: Uav, starts: list[Point], stops: list[Point]) -> FloatArray:
    """(len(starts), len(stops)) straight flights."""
    begin, end = np.array(starts, float).reshape(-1, 3).T, np.array(stops, float).reshape(-1, 3).T
    length_m = straight_m(end[:, None, :] - begin[:, :, None])
    here = uav.position_enu_m
    speed_m_s = np.full(length_m.shape, fate.speed_m_s(uav, None, here, here))
    if fate.wind.speed_m_s > 0.0:
        for row, start in enumerate(starts):
            speed_m_s[row] = [fate.speed_m_s(uav, None, start, stop) for stop in stops]
    legs_s: FloatArray = length_m / speed_m_s
    return legs_s
