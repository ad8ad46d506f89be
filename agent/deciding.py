"""Which task this UAV should take next, from the state it shares with the others.

The offline lower level (swarm.allocation.lower_level) is continued from the state
the registers describe until this UAV's turn comes. So UAVs that are free at the
same time and of better rank decide first in everyone's picture, and a faultless
run repeats the offline plan decision for decision (section III.C of the paper).
Leaves out: what is done with the decision (agent.tasking).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from swarm.allocation.guided import GuidedRule
from swarm.allocation.lower_level import Decision, Rule, TeamState, decisions
from swarm.allocation.problem import Problem
from swarm.allocation.rules import RULE_NAMES, rule_by_name
from swarm.state.board import TaskBoard, TaskState
from swarm.state.claims import claim_strength
from swarm.wire.messages import Claim, ClaimPhase, Epoch

__all__ = ["Turn", "decide", "ranks", "rule_of"]


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


def rule_of(epoch: Epoch) -> Rule | None:
    """The decision rule of an epoch, one instance for all its decisions; None if unknown here.

    Rules keep what they worked out for one decision to be quicker at the next.
    """
    if epoch.rule == GuidedRule.name:
        return GuidedRule(epoch.routes)
    return rule_by_name(epoch.rule) if epoch.rule in RULE_NAMES else None


def ranks(sequence: Sequence[str], uavs: Sequence[str]) -> dict[str, int]:
    """Rank of every UAV: place in the sequence; those not in it follow by id."""
    listed = [uav for uav in sequence if uav in uavs]
    return {uav: rank for rank, uav in enumerate([*listed, *sorted(set(uavs) - set(listed))])}


def decide(problem: Problem, board: TaskBoard, rule: Rule, turn: Turn) -> Decision | None:
    """The decision of ``turn.uav``; None when there is no task it could take.

    Args:
        problem: every UAV and every task on the board.
        board: the registers and what they say about tasks.
        rule: how UAVs choose in the epoch in force; see `rule_of`.
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
    state = TeamState.at_start(problem)
    taken = {claim.task for claim in stronger.values()} | set(turn.excluded)
    for index, task in enumerate(problem.task_ids):
        state.open[index] = board.states.get(task) is TaskState.OPEN and task not in taken
    if not state.open.any():
        return None
    columns = {str(task): index for index, task in enumerate(problem.task_ids)}
    for index, uav in enumerate(problem.uav_ids):
        ended = sorted(
            (outcome.completed_s, task)
            for (who, task), outcome in replica.outcomes.items()
            if who == uav and task in columns
        )
        survived = [problem.survival[index, columns[task]] for _, task in ended]
        state.survived[index] = math.prod(survived)
        claim = stronger.get(uav)
        state.active[index] = True
        if uav == turn.uav:
            state.free_s[index] = turn.now_s
            state.place_enu_m[index] = turn.place_enu_m
        elif claim is not None and claim.task in columns:
            state.free_s[index] = claim.completion_s
            state.place_enu_m[index] = problem.task_enu_m[columns[claim.task]]
            state.survived[index] *= problem.survival[index, columns[claim.task]]
            # Who is a little late is about to decide, or its word is on its way.
            state.active[index] = turn.now_s < claim.completion_s + turn.patience_s
        elif uav in turn.awaited or uav in weaker:
            # Who has claimed after this UAV became free decides again, but after it.
            after_s = math.nextafter(turn.now_s, math.inf)
            state.free_s[index] = after_s if uav in weaker else turn.now_s
            if ended:
                state.place_enu_m[index] = problem.task_enu_m[columns[ended[-1][1]]]
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
