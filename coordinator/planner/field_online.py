"""Planning in a mission that runs under the field's constraints; see `coordinator.planner.online`.

Where it stands is what the registers tell of places, batteries and bases. The fleet is taken to go
on as its agents do: by their rule, or by lists that each decision searches anew from those of the
epoch. Whatever is compared is compared by (fewest required tasks left out, then largest J).
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from coordinator.planner.field_guided import field_guided_plan
from coordinator.planner.field_schedule import left_out
from coordinator.planner.options import ShouldStop, after_evaluations, first_of, never
from swarm.allocation.field import FieldProblem, FieldState
from swarm.allocation.field.rules import FIELD_RULES, GUIDED, item_lists
from swarm.kernels.field import fly_lists, run_rule
from swarm.kernels.field_alone import earliest_alone
from swarm.kernels.field_search import Effort
from swarm.model.plan import by_reason
from swarm.protocol.bases import blocking
from swarm.protocol.board import TaskBoard
from swarm.protocol.field_board import field_state
from swarm.protocol.uav_messages import Claim

Items = Sequence[Sequence[int]]
"""Lists of items, one of each UAV."""
_SEARCH_ITERATIONS_PER_TASK = 100
_SEARCH = Effort(60_000_000)
"""Of that search, some two seconds on one processor."""
_GOING_ON_ITERATIONS, _GOING_ON_STEPS = 200, 600_000
"""About what a decision online spends."""
_ITERATIONS_PER_MISSING_TASK = 2
"""Beside these: two lanes share them, and each places one missing task at a time."""


@dataclass(frozen=True, slots=True, eq=False)
class FieldStanding:
    """Where a running mission in the field stands."""

    problem: FieldProblem
    """Every UAV of the brief and every task posted so far, with the zones in force."""
    state: FieldState
    """Open is what nobody has ended or claims; active is who takes part."""

    @classmethod
    def of(
        cls,
        problem: FieldProblem,
        board: TaskBoard,
        claims: Mapping[str, Claim],
        tasks: Mapping[str, str],
        active: Collection[str],
        mission_s: float,
    ) -> FieldStanding:
        """As the registers of one replica show it.

        Args:
            problem: of this board.
            board: the registers.
            claims: of the UAVs believed alive.
            tasks: UAV -> the open task that it is going to end.
            active: UAVs that take part.
            mission_s: now [s mission time]: nobody departs before.
        """
        counting = {
            uav: claim
            for uav, claim in claims.items()
            if (uav in tasks if claim.task is not None else claim.base is not None)
        }
        everybody = board.replica.claims
        state = field_state(
            problem,
            board,
            counting,
            present=claims,
            sequence=() if board.replica.epoch is None else board.replica.epoch.sequence,
            blocking=blocking(everybody, everybody.keys() - claims.keys()),
        )
        taking_part = frozenset(active)
        state.active[:] = [uav in taking_part for uav in problem.uav_ids]
        np.maximum(state.free_s, mission_s, out=state.free_s)
        return cls(problem, state)

    @property
    def is_settled(self) -> bool:
        """Nobody could do anything more, even as its only task."""
        alone_s = earliest_alone(self.problem.kernel, self.state)[:, self.state.open]
        return not bool(np.isfinite(alone_s).any())


@dataclass(frozen=True, slots=True)
class FieldCourse:
    """What becomes of the tasks that nobody has begun."""

    items: tuple[tuple[int, ...], ...]
    """Of each UAV, base visits among them."""
    n_left_out: int
    """Open tasks without due_s that are on no list."""
    objective: float
    """J of eq. 1 of the lists flown together [value·s]."""
    routes: dict[str, tuple[str, ...]]
    """Task ids by UAV."""
    completion_s: dict[str, float]
    """Of these tasks [s mission time]."""


def going_on(
    standing: FieldStanding,
    rule: str,
    sequence: Sequence[str],
    routes: Mapping[str, Sequence[str]],
    stop: ShouldStop = never,
) -> FieldCourse:
    """What comes of it if the fleet goes on by that rule; by one unknown here, nothing.

    Told to stop, what is not known yet is left undone.
    """
    if rule == GUIDED:
        return _searched(standing, item_lists(standing.problem, routes), stop)
    if rule not in FIELD_RULES:
        return _course(standing, [()] * standing.problem.n_uav)
    state = _ranked(standing, sequence)
    runs = run_rule(standing.problem.kernel, state, FIELD_RULES[rule], lambda: stop(0.0))
    return _course(standing, runs.lists(standing.problem.n_uav))


def planned_anew(
    standing: FieldStanding,
    begin: Items,
    *,
    seed: int,
    stop: ShouldStop,
    threads: int | None,
) -> FieldCourse:
    """The best lists found in a second's work or so; never worse than those it begins with."""
    n_open = max(1, int(np.count_nonzero(standing.state.open)))
    most = after_evaluations(_SEARCH_ITERATIONS_PER_TASK * n_open)
    plan = field_guided_plan(
        standing.problem,
        seed=seed,
        stop=first_of(stop, most),
        state=standing.state,
        lists=begin,
        effort=_SEARCH,
        threads=threads,
    )
    return _course(standing, plan.lists)


def worth_to_go(standing: FieldStanding, routes: Mapping[str, Sequence[str]]) -> tuple[int, float]:
    """Required tasks left out, and J, if the fleet goes on by such lists from here [value·s]."""
    course = _searched(standing, item_lists(standing.problem, routes))
    return course.n_left_out, course.objective


def left_out_by(
    standing: FieldStanding, routes: Mapping[str, Sequence[str]]
) -> dict[str, tuple[str, ...]]:
    """Open tasks that are on no list, by why."""
    columns = {str(task): column for column, task in enumerate(standing.problem.task_ids)}
    listed = [columns[task] for tasks in routes.values() for task in tasks if task in columns]
    return by_reason(left_out(standing.problem, standing.state, listed))


def _searched(standing: FieldStanding, begin: Items, stop: ShouldStop = never) -> FieldCourse:
    listed = sum(item >= 0 for items in begin for item in items)
    missing = max(0, int(np.count_nonzero(standing.state.open)) - listed)
    placing = _ITERATIONS_PER_MISSING_TASK * missing
    most = _GOING_ON_ITERATIONS + placing
    plan = field_guided_plan(
        standing.problem,
        stop=first_of(stop, after_evaluations(most)),
        state=standing.state,
        lists=begin,
        effort=Effort(_GOING_ON_STEPS, placing),
        threads=1,
    )
    return _course(standing, plan.lists)


def _ranked(standing: FieldStanding, sequence: Sequence[str]) -> FieldState:
    """The same state under another sequence."""
    state, ids = standing.state, [str(uav) for uav in standing.problem.uav_ids]
    listed = [uav for uav in sequence if uav in ids]
    order = [*listed, *sorted(set(ids) - set(listed))]
    rank = np.array([order.index(uav) for uav in ids], dtype=np.int64)
    return FieldState(
        free_s=state.free_s,
        sortie_end_s=state.sortie_end_s,
        first_s=state.first_s,
        survived=state.survived,
        active=state.active,
        open=state.open,
        landed_at=state.landed_at,
        rank=rank,
        arrives_s=state.arrives_s,
        leaving=state.leaving,
        leaves_s=state.leaves_s,
    )


def _course(standing: FieldStanding, lists: Items) -> FieldCourse:
    """Lists, flown together."""
    problem, state = standing.problem, standing.state
    flown = fly_lists(problem.kernel, state, lists)
    flat = [item for items in lists for item in items]
    done = [item >> 1 for item in flat if item >= 0]
    wanted = problem.required & state.open
    return FieldCourse(
        items=tuple(tuple(items) for items in lists),
        n_left_out=int(wanted.sum() - wanted[done].sum()),
        objective=float(flown.value.sum()),
        routes={
            str(uav): tuple(str(problem.task_ids[item >> 1]) for item in items if item >= 0)
            for uav, items in zip(problem.uav_ids, lists, strict=True)
        },
        completion_s={
            str(problem.task_ids[item >> 1]): float(end_s)
            for item, end_s in zip(flat, flown.times_s[:, 3].tolist(), strict=True)
            if item >= 0
        },
    )
