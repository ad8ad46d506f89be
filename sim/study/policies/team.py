"""A fleet with ideal communication, decision by decision: every UAV knows at once what all do.

What happens comes from a drawn future (`sim.world.uncertainty`): losses, pop-ups and withdrawals by
time, the outcome of every attempt, how fast a leg is really flown and where it really ends. Who
decides knows nominal speeds, the tasks that have appeared, and where UAVs believe to be; without
uncertainty times are those of `swarm.allocation.evaluate`, float for float. UAVs decide when they
are free, those free at the same moment in the order of their ranks; idle ones are asked again
whenever anything has happened.
"""

from __future__ import annotations

import heapq
import itertools
import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from sim.study.policies.situation import Dispatcher, TeamLeg, TeamNews, TeamSituation, as_point
from sim.world.motion import between, flown_s
from sim.world.outcome import FlightOutcome, TaskVisit
from sim.world.uncertainty import Realization
from swarm.allocation import Problem, TeamState, rank_of
from swarm.allocation.problem import straight_m
from swarm.model import UavId


def fly_team(
    fate: Realization,
    dispatcher: Dispatcher,
    *,
    sequence: Sequence[UavId] | None = None,
    every_s: float | None = None,
) -> FlightOutcome:
    """Fly a mission to its end.

    Args:
        fate: what happens.
        dispatcher: decides.
        sequence: UAVs, first decider first; those not in it follow, as the mission has them.
        every_s: how often the dispatcher hears that time has passed [s]; > 0.

    Raises:
        ValueError: the interval is not positive, or the dispatcher wants what it must not.
    """
    if every_s is not None and not 0.0 < every_s < math.inf:
        raise ValueError(f"every_s must be > 0 and finite, not {every_s}")
    flight = _TeamFlight(fate, dispatcher, sequence or ())
    if every_s is not None:
        flight.remind(every_s)
    return flight.run()


class _TeamFlight:
    """One mission in progress."""

    def __init__(
        self, fate: Realization, dispatcher: Dispatcher, sequence: Sequence[UavId]
    ) -> None:
        self._fate = fate
        self._dispatcher = dispatcher
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
        self._heap: list[tuple[float, int, Callable[[], Collection[TeamNews]]]] = []
        self._numbers = itertools.count()
        self._survival_matters = not fate.uncertainty.survival
        n_known = sum(task.appears_s == 0.0 for task in self._tasks)
        problem = self._problem_of(n_known)
        listed = [self._rows[uav] for uav in sequence if uav in self._rows]
        rest = [row for row in range(problem.n_uav) if row not in listed]
        self._situation = TeamSituation(
            problem=problem,
            state=TeamState.at_start(problem),
            rank=rank_of([*listed, *rest]),
            survived_before=np.ones(problem.n_uav),
        )
        self._order = [*listed, *rest]
        self._due_s = np.zeros(problem.n_uav)
        self._true_enu_m = {row: uav.position_enu_m for row, uav in enumerate(self._uavs)}
        self._attempts: dict[tuple[int, int], int] = {}
        self._visits: list[TaskVisit] = []
        self._lost: list[UavId] = []
        self._released = 0
        self._schedule()

    def remind(self, every_s: float) -> None:
        """Let the dispatcher hear that time passes, while anything else is to come."""
        when_s = self._situation.now_s + every_s

        def pass_by() -> Collection[TeamNews]:
            if self._heap:
                self.remind(every_s)
            return (TeamNews.TIME,)

        self._at(when_s, pass_by)

    def run(self) -> FlightOutcome:
        """Fly until nothing is left to happen."""
        situation, heap = self._situation, self._heap
        news: set[TeamNews] = {TeamNews.BEGUN}
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
                task = self._dispatcher.choose(situation, uav)
                if task is not None:
                    self._set_off(uav, task)
            elif heap:
                situation.now_s = heap[0][0]
            else:
                break
        account = self._dispatcher.account
        return FlightOutcome(
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
        for late_s in sorted({task.appears_s for task in self._tasks} - {0.0}):
            self._at(late_s, self._appear)

    def _at(self, time_s: float, happen: Callable[[], Collection[TeamNews]]) -> None:
        heapq.heappush(self._heap, (time_s, next(self._numbers), happen))

    def _is_over(self) -> bool:
        situation = self._situation
        if situation.legs or situation.problem.n_task < len(self._tasks):
            return False
        state = situation.state
        return not situation.problem.capable[state.active][:, state.open].any()

    def _appear(self) -> Collection[TeamNews]:
        situation = self._situation
        n_known = sum(task.appears_s <= situation.now_s for task in self._tasks)
        new = np.ones(n_known - situation.problem.n_task, dtype=np.bool_)
        situation.problem = self._problem_of(n_known)
        situation.state.open = np.concatenate((situation.state.open, new))
        return (TeamNews.APPEARED,)

    def _withdraw(self, task: int) -> Collection[TeamNews]:
        situation = self._situation
        doer = next((uav for uav, leg in situation.legs.items() if leg.task == task), None)
        if doer is not None:
            self._stop(doer)
        elif not situation.state.open[task]:
            return ()
        situation.state.open[task] = False
        return (TeamNews.WITHDRAWN,)

    def _lose(self, uav: int) -> Collection[TeamNews]:
        situation = self._situation
        if not situation.state.active[uav]:
            return ()
        situation.state.active[uav] = False
        leg = situation.legs.pop(uav, None)
        if leg is not None:
            situation.state.open[leg.task] = True
        self._lost.append(self._uavs[uav].id)
        return (TeamNews.LOST,)

    def _end(self, uav: int, leg: TeamLeg) -> Collection[TeamNews]:
        situation = self._situation
        if situation.legs.get(uav) is not leg:
            return ()  # given up, or lost on the way
        del situation.legs[uav]
        who, task = self._uavs[uav], self._tasks[leg.task]
        key = uav, leg.task
        attempt = self._attempts[key] = self._attempts.get(key, 0) + 1
        done = self._fate.succeeds(who, task, attempt)
        self._visits.append(TaskVisit(who.id, task.id, situation.now_s, done))
        self._true_enu_m[uav] = leg.true_stop_enu_m
        self._due_s[uav] = situation.now_s
        if self._survival_matters:
            situation.survived_before[uav] *= situation.problem.survival[uav, leg.task]
        situation.state.survived[uav] = situation.survived_before[uav]
        reopens = not done and self._fate.mission.reattempt_failed
        situation.state.open[leg.task] = reopens
        news = [TeamNews.REOPENED if reopens else TeamNews.ENDED]
        if not self._fate.survives(who, task, attempt):
            news += self._lose(uav)
        return news

    # -- what UAVs do -----------------------------------------------------------------

    def _tell(self, news: Collection[TeamNews]) -> list[int]:
        """Let the dispatcher hear of it; who is to be asked now, in their order."""
        situation = self._situation
        np.maximum(self._due_s, situation.now_s, out=situation.state.free_s)
        for uav in sorted(self._dispatcher.hear(situation, news)):
            if uav not in situation.in_flight():
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
        self._true_enu_m[uav] = between(
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
        start, true_start = as_point(state.place_enu_m[uav]), self._true_enu_m[uav]
        stop = self._fate.stop_enu_m(who.id, what)
        speed_m_s = self._fate.speed_m_s(who, what.id, true_start, stop)
        length_m = float(straight_m(np.subtract(stop, true_start)))
        arrives_s = now_s + flown_s(length_m, speed_m_s, who.acceleration_m_s2)
        travel_s = float(problem.travel_s(uav, state.place_enu_m[uav])[task])
        leg = TeamLeg(
            task=task,
            start_enu_m=start,
            left_s=now_s,
            due_s=(now_s + travel_s) + what.service_s,
            true_start_enu_m=true_start,
            true_stop_enu_m=stop,
            arrives_s=arrives_s,
        )
        situation.legs[uav] = leg
        self._due_s[uav] = state.free_s[uav] = leg.due_s
        state.place_enu_m[uav] = problem.task_enu_m[task]
        state.survived[uav] *= problem.survival[uav, task]
        state.open[task] = False
        self._at(arrives_s + what.service_s, partial(self._end, uav, leg))

    def _problem_of(self, n_known: int) -> Problem:
        """The mission as far as its first tasks."""
        known = self._all
        return replace(
            known,
            task_ids=known.task_ids[:n_known],
            task_enu_m=known.task_enu_m[:n_known],
            value=known.value[:n_known],
            service_s=known.service_s[:n_known],
            success=known.success[:, :n_known],
            survival=known.survival[:, :n_known],
        )
