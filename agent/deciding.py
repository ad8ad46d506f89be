"""Which task this UAV should take next, from the state it shares with the others.

The offline lower level (swarm.allocation.lower_level) is continued from the state
the registers describe until this UAV's turn comes. So UAVs that are free at the
same time and of better rank decide first in everyone's picture, and a faultless
run repeats the offline plan decision for decision (section III.C of the paper).
Leaves out: what is done with the decision (agent.tasking).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from swarm.allocation.lower_level import Decision, Rule, decisions
from swarm.allocation.problem import Problem
from swarm.state.board import TaskBoard
from swarm.state.claims import claim_strength
from swarm.state.team import after_outcomes, finish_claim, ranks
from swarm.wire.messages import Claim, ClaimPhase

__all__ = ["Turn", "decide"]


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
    replica, epoch = board.replica, board.replica.epoch
    rank = ranks(epoch.sequence if epoch is not None else (), problem.uav_ids)
    mine = problem.uav_ids.index(turn.uav)
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
    if not state.open.any():
        return None
    for index, uav in enumerate(problem.uav_ids):
        claim = stronger.get(uav)
        state.active[index] = True
        if uav == turn.uav:
            state.free_s[index] = turn.now_s
            state.place_enu_m[index] = turn.place_enu_m
        elif claim is not None and claim.task in columns:
            finish_claim(problem, state, index, columns[claim.task], claim)
            # Who is a little late is about to decide, or its word is on its way.
            state.active[index] = turn.now_s < claim.completion_s + turn.patience_s
        elif uav in turn.awaited or uav in weaker:
            # Who has claimed after this UAV became free decides again, but after it.
            after_s = math.nextafter(turn.now_s, math.inf)
            state.free_s[index] = after_s if uav in weaker else turn.now_s
        else:
            state.active[index] = False
    order = np.array([rank[uav] for uav in problem.uav_ids])
    process = decisions(problem, state, order, rule)
    return next((decision for decision in process if decision.uav == mine), None)


def _stronger_claims(claims: Mapping[str, Claim], rank: int, turn: Turn) -> dict[str, Claim]:
    """Claims of credible others that would beat a claim this UAV makes now."""
    proposal = Claim(ClaimPhase.PROPOSED, "-", turn.decided_s, rank, turn.now_s)
    own = claim_strength(turn.uav, proposal)
    return {
        uav: claim
        for uav, claim in claims.items()
        if uav in turn.credible and claim.task is not None and claim_strength(uav, claim) < own
    }
