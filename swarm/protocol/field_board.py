"""What the registers say of a mission in the field: places, batteries, slots, what can be done.

Leaves out: what follows for one UAV's decision (agent.core.field_decision).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence

import numpy as np
import numpy.typing as npt

from swarm.allocation import field
from swarm.protocol.board import TaskBoard, TaskState, holders, ranks
from swarm.protocol.uav_messages import BaseStage, Claim, ClaimPhase

_ON_THE_WAY = (BaseStage.APPROACHING, BaseStage.WAITING)
_ON_THE_GROUND = (BaseStage.LANDED, BaseStage.PARKED)


def field_state(
    problem: field.FieldProblem,
    board: TaskBoard,
    claims: Mapping[str, Claim],
    *,
    present: Collection[str],
    sequence: Sequence[str] = (),
    blocking: Mapping[str, str] | None = None,
) -> field.FieldState:
    """Where everybody stands once they have ended what ``claims`` say.

    Args:
        problem: of this board.
        board: the registers; outcomes say where a UAV was last, and what it survived.
        claims: by UAV, those that count: their tasks are not open, and their UAVs are free at
            their completion. Who approaches a base is free when it says that it will be ready.
        present: UAVs believed alive. What they say of their batteries, and that they stand at a
            base, is so whether their claims count or not.
        sequence: UAV ids, best rank first; others follow by id.
        blocking: UAV -> base, lost ones that stand on a slot for good.

    Returns:
        A state in which all are active but the ``blocking``; who takes part is the caller's
        judgement. Who has claimed nothing is free since its last attempt, or since 0.
    """
    state = after_attempts(problem, board)
    rank = ranks(sequence, problem.uav_ids)
    columns: dict[str, int] = {task: index for index, task in enumerate(problem.task_ids)}
    for row, uav in enumerate(problem.uav_ids):
        state.rank[row] = rank[uav]
        if blocking is not None and uav in blocking:
            state.landed_at[row] = problem.base_ids.index(blocking[uav])
            state.active[row] = False
            continue
        known = board.replica.claims.get(uav)
        if known is not None and uav in present:
            _take_battery(problem, state, row, known)
            if known.stage in _ON_THE_GROUND and known.departs_s is None:
                _stand(problem, state, row, known)
        claim = claims.get(uav)
        if claim is None:
            continue
        if claim.task is not None:
            if claim.task in columns:
                _end_task(problem, state, row, columns[claim.task], claim)
        elif claim.stage in _ON_THE_WAY:
            _stand(problem, state, row, claim)
            arrives_s = claim.arrives_s
            state.arrives_s[row] = claim.completion_s if arrives_s is None else arrives_s
    return state


def after_attempts(problem: field.FieldProblem, board: TaskBoard) -> field.FieldState:
    """Where every UAV stands after the attempts it has ended, as if nobody claimed anything.

    ``open`` is as on the board; batteries are as at mission time 0.
    """
    state = field.FieldState.at_start(problem)
    states = board.states
    state.open[:] = [states.get(task) is TaskState.OPEN for task in problem.task_ids]
    rows: dict[str, int] = {uav: index for index, uav in enumerate(problem.uav_ids)}
    columns: dict[str, int] = {task: index for index, task in enumerate(problem.task_ids)}
    ended = sorted(
        (outcome.completed_s, columns[task], rows[uav], bool(outcome.reversed))
        for (uav, task), outcome in board.replica.outcomes.items()
        if uav in rows and task in columns
    )
    for completed_s, task, row, backwards in ended:
        _end_at(problem, state, row, task, completed_s, backwards=backwards)
    return state


def last_node(problem: field.FieldProblem, board: TaskBoard, uav: str) -> int:
    """Node where ``uav`` was after its last attempt: the end of that task, else its start."""
    columns: dict[str, int] = {task: index for index, task in enumerate(problem.task_ids)}
    ended = max(
        (
            (outcome.completed_s, columns[task], bool(outcome.reversed))
            for (who, task), outcome in board.replica.outcomes.items()
            if who == uav and task in columns
        ),
        default=None,
    )
    if ended is None:
        return problem.uav_ids.index(uav)
    return field.task_nodes(problem, ended[1], backwards=ended[2])[1]


def anything_doable_in_field(
    problem: field.FieldProblem, board: TaskBoard, present: Collection[str], mission_s: float
) -> bool:
    """Whether there is any of `doable_in_field`; mostly somebody is on its way to one."""
    claims, states = _taking_part(board, present), board.states
    under_way = holders(claims).keys() & set(problem.task_ids)
    if any(states.get(task) is TaskState.OPEN for task in under_way):
        return True
    return bool(doable_in_field(problem, board, present, mission_s))


def _taking_part(board: TaskBoard, present: Collection[str]) -> dict[str, Claim]:
    """Claims of those who are there and have not left."""
    return {
        uav: claim
        for uav, claim in board.replica.claims.items()
        if uav in present and claim.phase is not ClaimPhase.OUT
    }


def doable_in_field(
    problem: field.FieldProblem, board: TaskBoard, present: Collection[str], mission_s: float
) -> list[str]:
    """Open tasks that somebody claims or could still do as its only one, in board order.

    From its registered state, with as many swaps as that takes and every slot free.

    Args:
        problem: of this board.
        board: the registers.
        present: the writers believed alive; the lost take no part.
        mission_s: now [s mission time]: nobody departs before, but who has just ended a task.
    """
    claims = _taking_part(board, present)
    claimed = holders(claims)
    counting = {
        uav: claim
        for uav, claim in claims.items()
        if (claim.base is not None if claim.task is None else claimed.get(claim.task) == uav)
    }
    state = field_state(problem, board, counting, present=claims)
    state.active[:] = [uav in claims for uav in problem.uav_ids]
    outcomes = board.replica.outcomes
    # Who has told of its outcome has gone on already: the word of where to is on its way.
    chosen = [uav in claims and (uav, claims[uav].task) in outcomes for uav in problem.uav_ids]
    np.maximum(state.free_s, mission_s, out=state.free_s, where=~np.array(chosen, dtype=np.bool_))
    from swarm.kernels.field_alone import earliest_alone  # plain missions never load it

    can: npt.NDArray[np.bool_] = np.any(np.isfinite(earliest_alone(problem.kernel, state)), axis=0)
    states = board.states
    return [
        task
        for column, task in enumerate(problem.task_ids)
        if states.get(task) is TaskState.OPEN and (can[column] or task in claimed)
    ]


def may_claim_until_s(
    problem: field.FieldProblem, board: TaskBoard, present: Collection[str], mission_s: float
) -> float:
    """By when all who hover have claimed what another battery lets them do [s mission time].

    Who has left its way hovers nobody knows where: it may reach a base of which the place of its
    last attempt tells nothing, and may fly there as late as its sortie allows.

    Returns:
        The latest end of a sortie of those that could do an open task from some base, full; minus
        infinity if none could.
    """
    claims = _taking_part(board, present)
    free = {uav for uav, claim in claims.items() if claim.task is None and claim.base is None}
    hovers = [uav in free for uav in problem.uav_ids]
    state = field_state(problem, board, {}, present=claims)
    ends_s = state.sortie_end_s.copy()
    state.active[:] = hovers
    from swarm.kernels.field_alone import earliest_alone  # plain missions never load it

    able = np.zeros(problem.n_uav, dtype=np.bool_)
    for base in range(problem.n_base):
        for row in np.flatnonzero(hovers).tolist():
            _stand_at(problem, state, row, base, mission_s)
        can = np.isfinite(earliest_alone(problem.kernel, state))
        able |= np.any(can & state.open, axis=1)
    return float(np.max(ends_s, where=able, initial=-math.inf))


def _take_battery(
    problem: field.FieldProblem, state: field.FieldState, row: int, claim: Claim
) -> None:
    """What a UAV says of the end of its sortie; of its first one it need not say anything."""
    if claim.sortie_end_s is not None:
        state.sortie_end_s[row] = claim.sortie_end_s
    elif claim.task is not None and claim.departs_s is not None:
        state.sortie_end_s[row] = claim.departs_s + problem.full_s[row]
    elif claim.base is None and claim.phase is ClaimPhase.IDLE and state.free_s[row] > 0.0:
        # On the ground away from all bases, unless its battery is endless.
        state.sortie_end_s[row] = math.inf if np.isinf(problem.full_s[row]) else -math.inf


def _stand(problem: field.FieldProblem, state: field.FieldState, row: int, claim: Claim) -> None:
    """Let a UAV stand ready at the base of its claim, at its completion."""
    base = _base_of(problem, claim)
    if base is not None:
        _stand_at(problem, state, row, base, claim.completion_s)
        state.arrives_s[row] = math.inf if claim.stage is BaseStage.PARKED else -math.inf


def _stand_at(
    problem: field.FieldProblem, state: field.FieldState, row: int, base: int, ready_s: float
) -> None:
    """Let a UAV stand on a slot of that base, ready then [s mission time]."""
    state.landed_at[row] = base
    state.free_s[row] = ready_s
    state.arrives_s[row] = -math.inf
    state.first_s[row] = problem.leg_s[problem.kind[row], problem.n_uav + base]


def _base_of(problem: field.FieldProblem, claim: Claim) -> int | None:
    """Index of the base that a claim names; None if there is none, or it is unknown."""
    return next((i for i, base in enumerate(problem.base_ids) if base == claim.base), None)


def _end_task(
    problem: field.FieldProblem, state: field.FieldState, row: int, task: int, claim: Claim
) -> None:
    """Let a UAV end the task it claims: then it is free, there, and nobody else takes it."""
    state.landed_at[row] = -1
    state.open[task] = False
    base = _base_of(problem, claim)
    if claim.departs_s is not None and claim.stage is BaseStage.LANDED and base is not None:
        state.leaving[row] = base
        state.leaves_s[row] = claim.departs_s
    backwards = bool(claim.reversed)
    _end_at(problem, state, row, task, claim.completion_s, backwards=backwards)


def _end_at(
    problem: field.FieldProblem,
    state: field.FieldState,
    row: int,
    task: int,
    completed_s: float,
    *,
    backwards: bool,
) -> None:
    state.free_s[row] = completed_s
    leaves = field.task_nodes(problem, task, backwards=backwards)[1]
    state.first_s[row] = problem.leg_s[problem.kind[row], leaves]
    state.survived[row] *= problem.survival[row, task]
