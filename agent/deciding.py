"""Which task this UAV should take next, from the state it shares with the others.

The offline lower level (swarm.allocation.lower_level) is continued from the state
the registers describe until this UAV's turn comes. So UAVs that are free at the
same time and of better rank decide first in everyone's picture, and a faultless
run repeats the offline plan decision for decision (section III.C of the paper). When something has
opened, a UAV in flight may turn to it where the whole team gains (`turn_aside`).
Leaves out: what is done with the decision (agent.tasking).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from swarm.allocation.guided import GuidedRule
from swarm.allocation.lower_level import Decision, Rule, TeamState, decisions
from swarm.allocation.problem import IntArray, Problem
from swarm.state.board import TaskBoard
from swarm.state.claims import claim_strength
from swarm.state.team import after_outcomes, finish_claim, ranks
from swarm.wire.messages import Claim, ClaimPhase

__all__ = ["TURN_MARGIN_FRAC", "Turn", "decide", "turn_aside"]

TURN_MARGIN_FRAC = 0.001
"""Of the value the team has still to win; a UAV turns aside for no less."""


@dataclass(frozen=True, slots=True)
class Turn:
    """One UAV's turn to decide."""

    uav: str
    now_s: float
    """Mission time [s]."""
    decided_s: float
    """Mission time at which this UAV became free [s]; orders claims made at the same time."""
    place_enu_m: tuple[float, float, float]
    """Where it is now [m; mission origin], without the height layer."""
    credible: Collection[str]
    """Others whose claims count."""
    awaited: Collection[str]
    """Free UAVs that may be expected to decide in their turn."""
    patience_s: float
    """How late a UAV may be at its task and still be expected to decide in its turn."""
    excluded: Collection[str]
    """Tasks this UAV cannot take, whatever their value."""


def decide(problem: Problem, board: TaskBoard, rule: Rule, turn: Turn) -> Decision | None:
    """The decision of ``turn.uav``; None when there is no task it could take.

    Args:
        problem: every UAV and every task on the board.
        board: the registers and what they say about tasks.
        rule: how UAVs choose in the epoch in force; see `swarm.state.team.rule_of`.
        turn: who decides, when and where.
    """
    mine = problem.uav_ids.index(turn.uav)
    state, order = _team_at(problem, board, turn)
    if not state.open.any():
        return None
    process = decisions(problem, state, order, rule)
    return next((decision for decision in process if decision.uav == mine), None)


def turn_aside(
    problem: Problem, board: TaskBoard, rule: GuidedRule, turn: Turn, claim: Claim
) -> Decision | None:
    """What ``turn.uav`` takes now instead of the task it is flying to; None to fly on.

    The team's J with this UAV free at once, and its task open again, is set against J with the
    task finished first.

    Args:
        problem: every UAV and every task on the board.
        board: the registers and what they say about tasks.
        rule: of the epoch in force; of all rules it alone values the whole team.
        turn: who decides, when and where; it became free just now.
        claim: its claim, on a task of ``problem``.
    """
    current = next((i for i, task in enumerate(problem.task_ids) if task == claim.task), None)
    if current is None:
        return None
    mine = problem.uav_ids.index(turn.uav)
    free, order = _team_at(problem, board, turn)
    flying_on = free.copy()
    finish_claim(problem, flying_on, mine, current, claim)
    if not (flying_on.open & problem.capable[mine]).any():
        return None
    decision = rule.decide(problem, free, order, mine)
    if decision is None or decision.task == current:
        return None
    left_s = problem.horizon_s - claim.completion_s
    worth = float(free.survived[mine] * problem.weight[mine, current]) * left_s
    worth += rule.worth(problem, flying_on, order, mine)
    return decision if decision.score - worth > TURN_MARGIN_FRAC * abs(worth) else None


def _team_at(problem: Problem, board: TaskBoard, turn: Turn) -> tuple[TeamState, IntArray]:
    """Where everybody stands when ``turn.uav`` is free where it is, and everybody's rank."""
    replica, epoch = board.replica, board.replica.epoch
    rank = ranks(epoch.sequence if epoch is not None else (), problem.uav_ids)
    stronger = _stronger_claims(replica.claims, rank[turn.uav], turn)
    weaker = {
        uav
        for uav, claim in replica.claims.items()
        if uav in turn.credible and uav not in stronger and claim.task is not None
    }
    columns: dict[str, int] = {task: index for index, task in enumerate(problem.task_ids)}
    state = after_outcomes(problem, board)
    taken = {claim.task for claim in stronger.values()} | set(turn.excluded)
    state.open[[columns[task] for task in taken if task in columns]] = False
    for index, uav in enumerate(problem.uav_ids):
        claim = stronger.get(uav)
        state.active[index] = True
        if uav == turn.uav:
            state.free_s[index] = turn.now_s
            state.place_enu_m[index] = turn.place_enu_m
        elif claim is not None and claim.task in columns:
            finish_claim(problem, state, index, columns[claim.task], claim)
            # Who is a little late is about to decide, or its word is on its way; who is later may
            # come any moment, and nobody waits for it.
            if turn.now_s >= claim.completion_s + turn.patience_s:
                state.free_s[index] = math.nextafter(turn.now_s, math.inf)
        elif uav in turn.awaited or uav in weaker:
            # Who has claimed after this UAV became free decides again, but after it.
            after_s = math.nextafter(turn.now_s, math.inf)
            state.free_s[index] = after_s if uav in weaker else turn.now_s
        else:
            state.active[index] = False
    return state, np.array([rank[uav] for uav in problem.uav_ids])


def _stronger_claims(claims: Mapping[str, Claim], rank: int, turn: Turn) -> dict[str, Claim]:
    """Claims of credible others that would beat a claim this UAV makes now."""
    proposal = Claim(ClaimPhase.PROPOSED, "-", turn.decided_s, rank, turn.now_s)
    own = claim_strength(turn.uav, proposal)
    return {
        uav: claim
        for uav, claim in claims.items()
        if uav in turn.credible and claim.task is not None and claim_strength(uav, claim) < own
    }
