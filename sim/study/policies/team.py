"""A fleet with ideal communication, decision by decision: every UAV knows at once what all do.

What happens comes from a drawn future (`sim.fate`): losses, pop-ups and withdrawals by time, the
outcome of every attempt, how fast a leg is really flown and where it really ends. Who decides
knows nominal speeds, the tasks that have appeared, and where UAVs believe to be; without
uncertainty times are those of `swarm.allocation.evaluate`, float for float. UAVs decide when they
are free, those free at the same moment in the order of their ranks; idle ones are asked again
whenever anything has happened. Leaves out: how is decided (the other modules of this package),
and agents, messages and vehicles (sim.world).
"""

from __future__ import annotations

import heapq
import itertools
import math
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from enum import Enum, auto
from functools import partial
from typing import Protocol

import numpy as np

from sim.fate import Fate
from sim.kinematics import Point
from sim.study.flight import Flight, Visit
from swarm.allocation import Problem, TeamState, rank_of
from swarm.allocation.problem import FloatArray, IntArray
from swarm.clock import Clock
from swarm.model import UavId

__all__ = ["Account", "Chooser", "Leg", "News", "Situation", "fly_team"]


class News(Enum):
    """What may have happened since choices were last made."""

    BEGUN = auto()
    """The mission."""
    ENDED = auto()
    """An attempt, for good."""
    REOPENED = auto()
    """A task, as an attempt at it failed."""
    APPEARED = auto()
    """A task."""
    WITHDRAWN = auto()
    """A task that was open or being done."""
    LOST = auto()
    """A UAV; the task it was doing is open again."""
    TIME = auto()
    """The interval has passed after which a chooser wants to be asked."""


@dataclass(frozen=True, slots=True, eq=False)
class Leg:
    """One UAV's way to a task, and its service there."""

    task: int
    start_enu_m: Point
    """Where the UAV believes it began [m]."""
    left_s: float
    """Mission time [s], as all below."""
    due_s: float
    """When it should have ended the task by its cruise speed."""
    true_start_enu_m: Point
    true_stop_enu_m: Point
    arrives_s: float
    """When it is really there."""
    ends_s: float
    """When it has really ended the task."""

    def flown_frac(self, now_s: float) -> float:
        """Share of the way that is behind it; 1 while it serves."""
        if now_s >= self.arrives_s:
            return 1.0
        return max(0.0, now_s - self.left_s) / (self.arrives_s - self.left_s)


@dataclass(slots=True, eq=False)
class Situation:
    """Where the mission stands; choosers read it and change nothing."""

    problem: Problem
    """All UAVs, and the tasks that have appeared so far: new ones come last."""
    state: TeamState
    """A UAV under way is free when it should have ended its task, at the task's place, or now if
    it is late; any other one is free now. Open is what nobody has ended or is doing; active is who
    lives. Where survival is drawn, S of eq. 1 is that of the task under way alone: what came
    before has been survived."""
    rank: IntArray
    """(n_uav,) place in the priority sequence; 0 decides first."""
    now_s: float = 0.0
    """Mission time [s]."""
    legs: dict[int, Leg] = field(default_factory=dict)
    """By UAV index: what it is doing."""
    survived_before: FloatArray = field(default_factory=lambda: np.ones(0))
    """(n_uav,) S of eq. 1 without the tasks under way."""

    def in_flight(self) -> list[int]:
        """UAVs that have not arrived at their tasks."""
        return [uav for uav, leg in self.legs.items() if leg.arrives_s > self.now_s]

    def place_enu_m(self, uav: int) -> Point:
        """Where ``uav`` believes to be now [m]."""
        leg = self.legs.get(uav)
        if leg is None:
            return _point(self.state.place_enu_m[uav])
        there = _point(self.problem.task_enu_m[leg.task])
        return _between(leg.start_enu_m, there, leg.flown_frac(self.now_s))

    def if_stopped(self) -> TeamState:
        """The state if all that are in flight gave up their tasks now."""
        state = self.state.copy()
        for uav in self.in_flight():
            state.free_s[uav] = self.now_s
            state.place_enu_m[uav] = self.place_enu_m(uav)
            state.survived[uav] = self.survived_before[uav]
            state.open[self.legs[uav].task] = True
        return state


@dataclass(slots=True)
class Account:
    """What a chooser tells of its work."""

    clock: Clock
    epochs: int = 0
    """Plans that came into force."""
    moved: int = 0
    """Tasks that stood on one UAV's list in a plan and on another's in the next."""
    decision_s: list[float] = field(default_factory=list)
    """Wall time of each decision or plan [s]."""

    @contextmanager
    def timed(self) -> Iterator[None]:
        """Note how long a decision or plan takes."""
        begin_s = self.clock.now_s()
        yield
        self.decision_s.append(self.clock.now_s() - begin_s)


class Chooser(Protocol):
    """Who decides for all."""

    @property
    def account(self) -> Account:
        """Of its work so far."""
        ...

    def hear(self, situation: Situation, news: Collection[News]) -> Collection[int]:
        """Something has happened, all of it at the same moment.

        Returns:
            UAVs in flight that are to give up their tasks; they are asked what to do instead.
        """
        ...

    def choose(self, situation: Situation, uav: int) -> int | None:
        """The open task that ``uav``, which is free, shall do now; None: it waits for news."""
        ...


def fly_team(
    fate: Fate,
    chooser: Chooser,
    *,
    sequence: Sequence[UavId] | None = None,
    every_s: float | None = None,
) -> Flight:
    """Fly a mission to its end.

    Args:
        fate: what happens.
        chooser: decides.
        sequence: UAVs, first decider first; those not in it follow, as the mission has them.
        every_s: the chooser hears that this interval has passed, again and again [s]; > 0.

    Raises:
        ValueError: the interval is not positive, or the chooser wants what it must not.
    """
    if every_s is not None and not 0.0 < every_s < math.inf:
        raise ValueError(f"every_s must be > 0 and finite, not {every_s}")
    flight = _Flying(fate, chooser, sequence or ())
    if every_s is not None:
        flight.remind(every_s)
    return flight.run()


class _Flying:
    """One mission in progress."""

    def __init__(self, fate: Fate, chooser: Chooser, sequence: Sequence[UavId]) -> None:
        self._fate = fate
        self._chooser = chooser
        mission = fate.mission
        gone_s = fate.withdrawn_at_s
        self._uavs = mission.uavs
        # Who is withdrawn before it appears is never there.
        self._tasks = sorted(
            (t for t in mission.tasks if gone_s.get(t.id, math.inf) > t.appears_s),
            key=lambda task: task.appears_s,
        )
        self._all = Problem.from_mission(mission, tasks=self._tasks)
        self._rows = {uav.id: row for row, uav in enumerate(self._uavs)}
        self._columns = {task.id: column for column, task in enumerate(self._tasks)}
        self._heap: list[tuple[float, int, Callable[[], Collection[News]]]] = []
        self._numbers = itertools.count()
        self._survival_matters = not fate.uncertainty.survival
        n_known = sum(task.appears_s == 0.0 for task in self._tasks)
        problem = self._problem_of(n_known)
        listed = [self._rows[uav] for uav in sequence if uav in self._rows]
        rest = [row for row in range(problem.n_uav) if row not in listed]
        self._situation = Situation(
            problem=problem,
            state=TeamState.at_start(problem),
            rank=rank_of([*listed, *rest]),
            survived_before=np.ones(problem.n_uav),
        )
        self._order = [*listed, *rest]
        self._due_s = np.zeros(problem.n_uav)
        self._true_enu_m = {row: uav.position_enu_m for row, uav in enumerate(self._uavs)}
        self._attempts: dict[tuple[int, int], int] = {}
        self._visits: list[Visit] = []
        self._lost: list[UavId] = []
        self._released = 0
        self._schedule()

    def remind(self, every_s: float) -> None:
        """Let the chooser hear that time passes, while anything else is to come."""
        when_s = self._situation.now_s + every_s

        def pass_by() -> Collection[News]:
            if self._heap:
                self.remind(every_s)
            return (News.TIME,)

        self._at(when_s, pass_by)

    def run(self) -> Flight:
        """Fly until nothing is left to happen."""
        situation, heap = self._situation, self._heap
        news: set[News] = {News.BEGUN}
        waiting: list[int] = []
        while True:
            while heap and heap[0][0] <= situation.now_s:
                news.update(heapq.heappop(heap)[2]())
            if self._is_over():
                break
            if news:
                waiting = self._tell(frozenset(news))
                news.clear()
            elif waiting:
                uav = waiting.pop(0)
                task = self._chooser.choose(situation, uav)
                if task is not None:
                    self._set_off(uav, task)
            elif heap:
                situation.now_s = heap[0][0]
            else:
                break
        account = self._chooser.account
        return Flight(
            visits=tuple(self._visits),
            lost_uavs=tuple(self._lost),
            epochs=account.epochs,
            moved=account.moved,
            released=self._released,
            decision_s=tuple(account.decision_s),
        )

    # -- what happens -----------------------------------------------------------------

    def _schedule(self) -> None:
        for uav, lost_at_s in self._fate.lost_at_s.items():
            if uav in self._rows:
                self._at(lost_at_s, partial(self._lose, self._rows[uav]))
        for task, gone_at_s in self._fate.withdrawn_at_s.items():
            if task in self._columns:
                self._at(gone_at_s, partial(self._withdraw, self._columns[task]))
        for number, late in enumerate(self._tasks, start=1):
            if late.appears_s > 0.0:
                self._at(late.appears_s, partial(self._appear, number))

    def _at(self, time_s: float, happen: Callable[[], Collection[News]]) -> None:
        heapq.heappush(self._heap, (time_s, next(self._numbers), happen))

    def _is_over(self) -> bool:
        situation = self._situation
        if situation.legs or situation.problem.n_task < len(self._tasks):
            return False
        state = situation.state
        return not situation.problem.capable[state.active][:, state.open].any()

    def _appear(self, n_known: int) -> Collection[News]:
        situation = self._situation
        if n_known <= situation.problem.n_task:
            return ()  # with others at the same moment
        when_s = self._tasks[n_known - 1].appears_s
        while n_known < len(self._tasks) and self._tasks[n_known].appears_s == when_s:
            n_known += 1
        new = np.ones(n_known - situation.problem.n_task, dtype=np.bool_)
        situation.problem = self._problem_of(n_known)
        situation.state.open = np.concatenate((situation.state.open, new))
        return (News.APPEARED,)

    def _withdraw(self, task: int) -> Collection[News]:
        situation = self._situation
        doer = next((uav for uav, leg in situation.legs.items() if leg.task == task), None)
        if doer is not None:
            self._stop(doer)
        elif not situation.state.open[task]:
            return ()
        situation.state.open[task] = False
        return (News.WITHDRAWN,)

    def _lose(self, uav: int) -> Collection[News]:
        situation = self._situation
        if not situation.state.active[uav]:
            return ()
        situation.state.active[uav] = False
        leg = situation.legs.pop(uav, None)
        if leg is not None:
            situation.state.open[leg.task] = True
        self._lost.append(self._uavs[uav].id)
        return (News.LOST,)

    def _end(self, uav: int, leg: Leg) -> Collection[News]:
        situation = self._situation
        if situation.legs.get(uav) is not leg:
            return ()  # given up, or lost on the way
        del situation.legs[uav]
        who, task = self._uavs[uav], self._tasks[leg.task]
        key = uav, leg.task
        attempt = self._attempts[key] = self._attempts.get(key, 0) + 1
        done = self._fate.succeeds(who, task, attempt)
        self._visits.append(Visit(who.id, task.id, situation.now_s, done))
        self._true_enu_m[uav] = leg.true_stop_enu_m
        self._due_s[uav] = situation.now_s
        if self._survival_matters:
            situation.survived_before[uav] *= situation.problem.survival[uav, leg.task]
        situation.state.survived[uav] = situation.survived_before[uav]
        reopens = not done and self._fate.mission.reattempt_failed
        situation.state.open[leg.task] = reopens
        news = [News.REOPENED if reopens else News.ENDED]
        if not self._fate.survives(who, task, attempt):
            news += self._lose(uav)
        return news

    # -- what UAVs do -----------------------------------------------------------------

    def _tell(self, news: Collection[News]) -> list[int]:
        """Let the chooser hear of it; who is to be asked now, in their order."""
        situation = self._situation
        np.maximum(self._due_s, situation.now_s, out=situation.state.free_s)
        in_flight = situation.in_flight
        for uav in sorted(self._chooser.hear(situation, news)):
            if uav not in in_flight():
                raise ValueError(f"UAV {self._uavs[uav].id} is not in flight and cannot give up")
            task = situation.legs[uav].task
            self._stop(uav)
            situation.state.open[task] = True
        legs, active = situation.legs, situation.state.active
        return [uav for uav in self._order if active[uav] and uav not in legs]

    def _stop(self, uav: int) -> None:
        """Give up the task and stay where the UAV is."""
        situation = self._situation
        place_enu_m = situation.place_enu_m(uav)
        leg = situation.legs.pop(uav)
        self._true_enu_m[uav] = _between(
            leg.true_start_enu_m, leg.true_stop_enu_m, leg.flown_frac(situation.now_s)
        )
        situation.state.place_enu_m[uav] = place_enu_m
        situation.state.survived[uav] = situation.survived_before[uav]
        situation.state.free_s[uav] = self._due_s[uav] = situation.now_s
        self._released += 1

    def _set_off(self, uav: int, task: int) -> None:
        situation, who, what = self._situation, self._uavs[uav], self._tasks[task]
        problem, state, now_s = situation.problem, situation.state, situation.now_s
        if not state.open[task] or not problem.capable[uav, task]:
            raise ValueError(f"UAV {who.id} cannot take task {what.id}")
        start, true_start = _point(state.place_enu_m[uav]), self._true_enu_m[uav]
        stop = self._fate.stop_enu_m(who.id, what)
        speed_m_s = self._fate.speed_m_s(who, what.id, true_start, stop)
        arrives_s = now_s + _distance_m(true_start, stop) / speed_m_s
        travel_s = _distance_m(start, what.position_enu_m) / who.speed_m_s
        leg = Leg(
            task=task,
            start_enu_m=start,
            left_s=now_s,
            due_s=(now_s + travel_s) + what.service_s,
            true_start_enu_m=true_start,
            true_stop_enu_m=stop,
            arrives_s=arrives_s,
            ends_s=arrives_s + what.service_s,
        )
        situation.legs[uav] = leg
        self._due_s[uav] = state.free_s[uav] = leg.due_s
        state.place_enu_m[uav] = problem.task_enu_m[task]
        state.survived[uav] *= problem.survival[uav, task]
        state.open[task] = False
        self._at(leg.ends_s, partial(self._end, uav, leg))

    def _problem_of(self, n_known: int) -> Problem:
        """The mission as far as its first tasks."""
        known = self._all
        return Problem(
            uav_ids=known.uav_ids,
            task_ids=known.task_ids[:n_known],
            start_enu_m=known.start_enu_m,
            task_enu_m=known.task_enu_m[:n_known],
            speed_m_s=known.speed_m_s,
            value=known.value[:n_known],
            service_s=known.service_s[:n_known],
            success=known.success[:, :n_known],
            survival=known.survival[:, :n_known],
            horizon_s=known.horizon_s,
        )


def _point(place_enu_m: FloatArray) -> Point:
    east_m, north_m, up_m = place_enu_m.tolist()
    return east_m, north_m, up_m


def _between(start: Point, stop: Point, frac: float) -> Point:
    """The place that share of the way from start to stop; exactly the stop at 1."""
    if frac >= 1.0:
        return stop
    east_m, north_m, up_m = (a + (b - a) * frac for a, b in zip(start, stop, strict=True))
    return east_m, north_m, up_m


def _distance_m(start: Point, stop: Point) -> float:
    """Rounded as everywhere in `swarm.allocation`."""
    dx_m, dy_m, dz_m = stop[0] - start[0], stop[1] - start[1], stop[2] - start[2]
    return math.sqrt(dx_m * dx_m + dy_m * dy_m + dz_m * dz_m)
