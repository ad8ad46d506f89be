"""How long a running mission takes to be planned anew, and what that is worth.

A random mission has lists for the tasks known at its start. Then UAVs are lost and tasks appear, at
the start or when half of the known tasks are done; who flies to a task ends it. From there the rest
is planned anew as the coordinator does it, on one thread, everything included: nothing is known of
the mission's arrays yet, as after a task has appeared. Leaves out: messages, and how the fleet goes
on afterwards (`swarm study` flies it).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from rich.console import RenderableType

from coordinator.planner.online import (
    EpochPolicy,
    ReplanResult,
    Situation,
    complete_lists,
    replan,
    replan_limit_s,
    worth_to_go,
)
from coordinator.planner.options import ShouldStop, after_evaluations, after_time, first_of
from coordinator.planner.plan import guided_plan
from sim.bench.machine import this_machine
from sim.bench.results import BenchResult, Progress, size_name, table_of, unheard
from sim.bench.solvers import MissionSource, problem_of
from swarm.allocation import Problem, TeamState, evaluate
from swarm.allocation.problem import BoolArray, FloatArray
from swarm.runtime.clock import Clock
from swarm.runtime.table import Column

_DISTURBED_FRAC = 0.3
"""UAVs lost, and tasks that appear."""
_PLAN_ITERATIONS_PER_TASK = 20
"""Of the lists before."""
_CANCELLED_AT_FRAC = (0.01, 0.05, 0.15, 0.5, 0.95)
"""When a re-plan is given up, of its limit."""
METHOD = "guided"


@dataclass(frozen=True, slots=True)
class ReplanTime:
    """One mission, planned anew once."""

    n_uav: int
    n_task: int
    seed: int
    moment: str
    """The start, or midway."""
    n_open: int
    """Tasks to plan for."""
    limit_s: float
    """What a coordinator gives it."""
    replan_s: float
    """Predicting, searching and valuing together [s]."""
    judge_s: float
    """Then, in the coordinator's loop: both plans valued once more, and the lists to publish."""
    cancel_s: float
    """The longest that a re-plan went on after it was told to stop."""
    going_on: float
    """J of what is open if the fleet goes on, as predicted [value·s]."""
    replanned: float
    """The same by the new lists."""
    unhurried: float
    """The same after a long search."""

    @property
    def size(self) -> str:
        """UAVs and tasks."""
        return size_name(self.n_uav, self.n_task)

    @property
    def gain_frac(self) -> float:
        """What the new plan gains; 0 where nothing is left to win."""
        return self.replanned / self.going_on - 1.0 if self.going_on else 0.0

    @property
    def of_unhurried(self) -> float:
        """What it reaches of a long search, which has all processors."""
        return self.replanned / self.unhurried if self.unhurried else 1.0


@dataclass(frozen=True, slots=True)
class ReplansBench(BenchResult):
    """Everything measured in one run."""

    unhurried_s: float
    times: tuple[ReplanTime, ...]

    def parts(self) -> Iterable[RenderableType]:
        """See `BenchResult`."""
        lost = f"{_DISTURBED_FRAC:.0%}"
        yield f"Planned anew by one thread, {lost} of the UAVs lost and {lost} of the tasks new:"
        yield table_of(
            self.times,
            Column("size", words=True, key="size"),
            Column("seed", key="seed"),
            Column("moment", words=True, key="moment"),
            Column("open", key="n_open"),
            Column("re-plan", ".2f", "s", key="replan_s"),
            Column("judged", ".0f", "ms", 1e3, key="judge_s"),
            Column("stopped", ".0f", "ms", 1e3, key="cancel_s"),
            Column("gain", ".2f", "%", 100, key="gain_frac"),
            Column("of long run", ".4f", key="of_unhurried"),
        )
        yield (
            "gain: J of what is open by the new lists, beyond going on, both as predicted. long "
            f"run: {self.unhurried_s:g} s of search from going on. stopped: the longest that it "
            "went on after it was told to stop."
        )


def measure_replans(
    sizes: Iterable[tuple[int, int]],
    seeds: Iterable[int],
    clock: Clock,
    *,
    unhurried_s: float,
    progress: Progress = unheard,
) -> ReplansBench:
    """Plan random missions anew, each at its start and midway."""
    machine = this_machine()
    seeds, times = tuple(seeds), []
    for n_uav, n_task in sizes:
        for seed in seeds:
            problem = problem_of(MissionSource(n_uav=n_uav, n_task=n_task, seed=seed))
            disturbed = Disturbed.of(problem, seed)
            for moment in ("start", "midway"):
                progress(f"{size_name(n_uav, n_task)}, seed {seed}, {moment}")
                situation = disturbed.situation(midway=moment == "midway")
                found = _measured(situation, disturbed.course, seed, clock, unhurried_s)
                times.append(replace(found, moment=moment))
    return ReplansBench(machine, unhurried_s, tuple(times))


@dataclass(frozen=True, slots=True, eq=False)
class Disturbed:
    """A mission to which something happens."""

    problem: Problem
    lists: tuple[tuple[int, ...], ...]
    """Of the tasks that are known at the start."""
    completion_s: FloatArray
    """(n_task,) by these lists [s]; NaN for those that appear."""
    lost: BoolArray
    """(n_uav,) UAVs that are lost."""
    course: EpochPolicy
    """The lists as an epoch."""

    @classmethod
    def of(cls, problem: Problem, seed: int) -> Disturbed:
        """Draw who is lost and what appears, and plan for the rest."""
        rng = np.random.default_rng([seed, 61])
        n_uav, n_task = problem.n_uav, problem.n_task
        lost, known = np.zeros(n_uav, dtype=np.bool_), np.ones(n_task, dtype=np.bool_)
        lost[rng.permutation(n_uav)[: int(_DISTURBED_FRAC * n_uav)]] = True
        known[rng.permutation(n_task)[: int(_DISTURBED_FRAC * n_task)]] = False
        before = TeamState.at_start(problem)
        before.open[:] = known
        plan = guided_plan(
            problem,
            seed=seed,
            stop=after_evaluations(_PLAN_ITERATIONS_PER_TASK * n_task),
            state=before,
        )
        _, completion_s = evaluate(problem, plan.routes)
        routes = {
            str(uav): tuple(str(problem.task_ids[task]) for task in route)
            for uav, route in zip(problem.uav_ids, plan.routes, strict=True)
        }
        sequence = tuple(str(problem.uav_ids[uav]) for uav in plan.sequence)
        course = EpochPolicy(METHOD, sequence, routes)
        return cls(problem, plan.routes, completion_s, lost, course)

    def situation(self, *, midway: bool) -> Situation:
        """As it happens: at mission time 0, or when half of the known tasks are done."""
        problem, completion_s = replace(self.problem), self.completion_s  # no kernel knows it yet
        now_s = float(np.nanmedian(completion_s)) if midway else 0.0
        state = TeamState.at_start(problem)
        state.active[:] = ~self.lost
        visited: dict[str, tuple[str, ...]] = {}
        under_way: dict[str, str] = {}
        for uav, route in enumerate(self.lists if midway else ()):
            name, ids = str(problem.uav_ids[uav]), [str(problem.task_ids[task]) for task in route]
            n_done = sum(completion_s[task] <= now_s for task in route)
            visited[name] = tuple(ids[:n_done])
            n_taken = n_done
            if n_done < len(route) and not self.lost[uav]:
                under_way[name] = ids[n_done]
                n_taken += 1
            for task in route[:n_taken]:
                state.free_s[uav] = completion_s[task]
                state.place_enu_m[uav] = problem.task_enu_m[task]
                state.survived[uav] *= problem.survival[uav, task]
                state.open[task] = False
        np.maximum(state.free_s, now_s, out=state.free_s)
        return Situation(problem, state, now_s, visited, under_way, frozenset(), 0)


def _measured(
    situation: Situation, course: EpochPolicy, seed: int, clock: Clock, unhurried_s: float
) -> ReplanTime:
    limit_s = replan_limit_s(situation)
    cancel_s = max(
        _cancelled_s(_anew(situation), course, seed, clock, limit_s * frac)
        for frac in _CANCELLED_AT_FRAC
    )
    situation = _anew(situation)
    begin_s = clock.now_s()
    made = _replanned(situation, course, seed, after_time(clock, limit_s))
    replanned_s = clock.now_s()
    for lists in (made.prediction.lists, made.going_on.lists):
        worth_to_go(situation, lists)
    complete_lists(situation, made.prediction.lists)
    judged_s = clock.now_s()
    rows = {task: row for row, task in enumerate(situation.problem.task_ids)}
    unhurried = guided_plan(
        situation.problem,
        seed=seed,
        stop=after_time(clock, unhurried_s),
        state=situation.state,
        lists=[
            [rows[task] for task in made.going_on.lists[str(uav)]]  # type: ignore[index]  # plain text
            for uav in situation.problem.uav_ids
        ],
    )
    return ReplanTime(
        n_uav=situation.problem.n_uav,
        n_task=situation.problem.n_task,
        seed=seed,
        moment="",
        n_open=int(np.count_nonzero(situation.state.open)),
        limit_s=limit_s,
        replan_s=replanned_s - begin_s,
        judge_s=judged_s - replanned_s,
        cancel_s=cancel_s,
        going_on=made.going_on.objective,
        replanned=made.prediction.objective,
        unhurried=unhurried.objective,
    )


def _anew(situation: Situation) -> Situation:
    """The same with arrays that no kernel knows yet."""
    return replace(situation, problem=replace(situation.problem))


def _replanned(
    situation: Situation, course: EpochPolicy, seed: int, stop: ShouldStop
) -> ReplanResult:
    return replan(situation, course, METHOD, seed=seed, stop=stop, threads=1)


def _cancelled_s(
    situation: Situation, course: EpochPolicy, seed: int, clock: Clock, after_s: float
) -> float:
    """How long a re-plan goes on after it is given up."""
    begin_s = clock.now_s()
    limit = after_time(clock, replan_limit_s(situation))
    given_up_s = begin_s + after_s
    stop = first_of(limit, lambda _: clock.now_s() >= given_up_s)
    _replanned(situation, course, seed, stop)
    return max(0.0, clock.now_s() - given_up_s)
