"""The team as the registers show it: what each UAV has behind it, and how it decides.

Agents and coordinator both continue the lower level from here. Leaves out: who is alive,
and so whose claims count, which each process judges for itself.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from swarm.allocation.guided import GuidedRule
from swarm.allocation.lower_level import Rule, TeamState
from swarm.allocation.problem import Problem
from swarm.allocation.rules import RULE_NAMES, rule_by_name
from swarm.state.board import TaskBoard, TaskState
from swarm.wire.messages import Claim

__all__ = ["after_outcomes", "finish_claim", "ranks", "rule_of"]


def rule_of(name: str, routes: Mapping[str, Sequence[str]]) -> Rule | None:
    """The decision rule of an epoch, one instance for all its decisions; None if unknown here.

    Rules keep what they worked out for one decision to be quicker at the next.
    """
    if name == GuidedRule.name:
        return GuidedRule(routes)
    return rule_by_name(name) if name in RULE_NAMES else None


def ranks(sequence: Sequence[str], uavs: Sequence[str]) -> dict[str, int]:
    """Rank of every UAV: place in the sequence; those not in it follow by id."""
    listed = [uav for uav in sequence if uav in uavs]
    return {uav: rank for rank, uav in enumerate([*listed, *sorted(set(uavs) - set(listed))])}


def after_outcomes(problem: Problem, board: TaskBoard) -> TeamState:
    """Where every UAV stands after the attempts it has ended, as if nobody claimed anything.

    ``free_s`` and ``place_enu_m`` are of the last attempt, or 0 and the start before the first;
    ``open`` is as on the board. All are active: who takes part is the caller's judgement.
    """
    state = TeamState.at_start(problem)
    states = board.states
    state.open[:] = [states.get(task) is TaskState.OPEN for task in problem.task_ids]
    rows: dict[str, int] = {uav: index for index, uav in enumerate(problem.uav_ids)}
    columns: dict[str, int] = {task: index for index, task in enumerate(problem.task_ids)}
    ended = sorted(
        (outcome.completed_s, columns[task], rows[uav])
        for (uav, task), outcome in board.replica.outcomes.items()
        if uav in rows and task in columns
    )
    for completed_s, task, uav in ended:
        _end_at(problem, state, uav, task, completed_s)
    return state


def finish_claim(problem: Problem, state: TeamState, uav: int, task: int, claim: Claim) -> None:
    """Let ``uav`` end the ``task`` it claims: then it is free, there, and nobody else takes it."""
    _end_at(problem, state, uav, task, claim.completion_s)
    state.open[task] = False


def _end_at(problem: Problem, state: TeamState, uav: int, task: int, completed_s: float) -> None:
    state.free_s[uav] = completed_s
    state.place_enu_m[uav] = problem.task_enu_m[task]
    state.survived[uav] *= problem.survival[uav, task]
