"""What this UAV should do next under the field's constraints: a task, a base, or nothing now.

As `agent.core.decision` does for plain missions: the offline rule is continued from the state that
the registers describe until this UAV's turn comes, so that a faultless run repeats the plan.
Leaves out: what is done with the decision.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from agent.core.decision import DIVERSION_MARGIN_FRAC, DecisionTurn
from swarm.allocation.field import FieldProblem, FieldState
from swarm.allocation.field.rules import FIELD_INDEX_RULES, FIELD_RULES, GUIDED, item_lists
from swarm.kernels.field import FieldRuleCode, fly_lists, run_rule
from swarm.kernels.field_search import Effort, SearchedLists, optimise_lists
from swarm.model import BaseId, TaskId
from swarm.protocol.board import TaskBoard, claim_strength, ranks
from swarm.protocol.field_board import field_state, last_node
from swarm.protocol.uav_messages import Claim, ClaimPhase

_SEED = 0
"""Of the search of every decision: the same state gives the same lists everywhere."""
_RULES = {**FIELD_RULES, **FIELD_INDEX_RULES}
_ITERATIONS_PER_TASK, _FEWEST_ITERATIONS, _MOST_ITERATIONS = 20, 50, 250
_STEPS = 600_000
"""Of a decision, some 30 ms: who decides hears and says nothing meanwhile."""
_ITERATIONS_PER_MISSING_TASK = 2
"""Spent even so: two lanes share them, and each places one missing task at a time."""


@dataclass(frozen=True, slots=True)
class FieldTurnDecision:
    """What a UAV does next; times are predictions [s mission time]."""

    item: int
    """2k for column k from its first point on, 2k + 1 from its last one on, -1 - b for base b."""
    task: TaskId | None
    """The task it takes; None: it flies to a base."""
    base: BaseId | None
    """The base it flies to; None: it takes a task."""
    reversed: bool
    """Whether a line is flown from its last point to its first."""
    depart_s: float
    """When it departs: now, unless it stands at a base and the task opens later."""
    arrive_s: float
    """When it is where the work begins, or above the base."""
    begin_s: float
    """When the work begins, or the swap, as far as it is known who is ahead there."""
    end_s: float
    """When the task is done, or the UAV ready: the completion of the claim."""
    sortie_end_s: float
    """By then it must have landed, on the way there and until its next swap; infinite: endless."""
    score: float | None
    """By the rule in force; None of a base that greedy flies to."""
    second_score: float | None
    """Of the best task it does not take; None when there is no other, or the rule values lists."""


ListMaker = Callable[[FieldProblem, FieldState, int], SearchedLists]
"""Lists of the whole team from a state on, for the decision of one UAV."""


@dataclass(frozen=True, slots=True)
class FieldRule:
    """The rule of an epoch, for missions with the field's constraints; see `field_rule_of`."""

    name: str
    routes: Mapping[str, Sequence[str]]
    """Task ids by UAV in order of execution; heeded by ``guided`` alone."""
    make_lists: ListMaker | None = None
    """Whose lists are followed instead of any rule; a UAV with none stays where it is."""

    def decide(
        self, problem: FieldProblem, board: TaskBoard, turn: DecisionTurn
    ) -> FieldTurnDecision | None:
        """`decide_in_field` by this rule."""
        return decide_in_field(problem, board, self, turn)

    def divert(
        self, problem: FieldProblem, board: TaskBoard, turn: DecisionTurn
    ) -> FieldTurnDecision | None:
        """`divert_in_field` by this rule."""
        return divert_in_field(problem, board, self, turn)


FieldRuleMaker = Callable[[str, Mapping[str, Sequence[str]]], FieldRule | None]
"""The decision rule of an epoch by the name of its rule and its routes; see `field_rule_of`."""


def field_rule_of(name: str, routes: Mapping[str, Sequence[str]]) -> FieldRule | None:
    """The decision rule of an epoch by the name of its rule and its routes; None if unknown."""
    return FieldRule(name, routes) if name == GUIDED or name in FIELD_RULES else None


def decide_in_field(
    problem: FieldProblem, board: TaskBoard, rule: FieldRule, turn: DecisionTurn
) -> FieldTurnDecision | None:
    """The decision of ``turn.uav``; None when there is nothing that it could do now.

    Args:
        problem: every UAV and every task on the board.
        board: the registers and what they say.
        rule: of the epoch in force; see `field_rule_of`.
        turn: who decides, when, where, and with how much of its battery left.
    """
    state = _team_at(problem, board, turn)
    if not state.open.any():
        return None
    mine = problem.uav_ids.index(turn.uav)
    if rule.make_lists is not None:
        return _first_of_lists(problem, state, mine, rule.make_lists(problem, state, mine))
    if rule.name == GUIDED:
        return _first_of_lists(problem, state, mine, _searched(problem, state, rule))
    return _by_rule(problem, state, mine, _RULES[rule.name])


def divert_in_field(
    problem: FieldProblem, board: TaskBoard, rule: FieldRule, turn: DecisionTurn
) -> FieldTurnDecision | None:
    """What ``turn.uav`` does now instead of the task it is flying to; None to fly on.

    As `agent.core.decision.decide_diversion`: by rule ``guided`` alone, and only where the whole
    team gains by it. It must be in the air, on the way to a task that it claims.
    """
    claim = board.replica.claims.get(turn.uav)
    if rule.name != GUIDED or claim is None or claim.task is None or claim.departs_s is not None:
        return None
    current = next((i for i, task in enumerate(problem.task_ids) if task == claim.task), None)
    if current is None:
        return None
    mine = problem.uav_ids.index(turn.uav)
    flying_on = _team_at(problem, board, turn, flying_on=claim)
    if not (flying_on.open & problem.capable[mine]).any():
        return None
    later = _searched(problem, flying_on, rule)
    free = _team_at(problem, board, turn)
    lists = [list(items) for items in later.lists]
    lists[mine].insert(0, 2 * current + bool(claim.reversed))
    now = _searched(problem, free, rule, lists)
    found = _first_of_lists(problem, free, mine, now)
    if found is None or found.task == claim.task:
        return None
    worth = float(free.survived[mine] * problem.weight[mine, current])
    worth = worth * (float(problem.until_s[current]) - claim.completion_s) + later.objective
    if now.n_left_out != later.n_left_out:
        return found if now.n_left_out < later.n_left_out else None
    return found if now.objective - worth > DIVERSION_MARGIN_FRAC * abs(worth) else None


def _by_rule(
    problem: FieldProblem, state: FieldState, mine: int, rule: FieldRuleCode
) -> FieldTurnDecision | None:
    """What the rule has it do when its turn comes; None: home."""
    runs = run_rule(problem.kernel, state, rule, first=mine)
    place = next((k for k, uav in enumerate(runs.uavs.tolist()) if uav == mine), None)
    if place is None:
        return None
    score, second = (None if math.isnan(x) else x for x in runs.scores[place].tolist())
    times_s = tuple(runs.times_s[place].tolist())
    return _told(problem, state, mine, int(runs.items[place]), times_s, score, second)


def _searched(
    problem: FieldProblem,
    state: FieldState,
    rule: FieldRule,
    lists: Sequence[Sequence[int]] | None = None,
) -> SearchedLists:
    """Lists of the whole team from there on, begun with those of the epoch unless others are given.

    Where batteries are swapped follows from the order of the tasks.
    """
    begin = item_lists(problem, rule.routes) if lists is None else lists
    n_open = int(np.count_nonzero(state.open))
    listed = sum(item >= 0 and bool(state.open[item >> 1]) for items in begin for item in items)
    most = min(_MOST_ITERATIONS, max(_FEWEST_ITERATIONS, _ITERATIONS_PER_TASK * n_open))
    return optimise_lists(
        problem.kernel,
        state,
        seed=_SEED,
        iterations=most,
        effort=Effort(_STEPS, min(most, _ITERATIONS_PER_MISSING_TASK * (n_open - listed))),
        lists=begin,
        threads=1,
    )


def _first_of_lists(
    problem: FieldProblem, state: FieldState, mine: int, found: SearchedLists
) -> FieldTurnDecision | None:
    if not found.lists[mine]:
        return None
    flown = fly_lists(problem.kernel, state, found.lists)
    if not flown.done[mine]:  # lists made elsewhere may not heed who is at the bases
        return None
    row = sum(len(items) for items in found.lists[:mine])
    times_s = tuple(flown.times_s[row].tolist())
    return _told(problem, state, mine, found.lists[mine][0], times_s, found.objective, None)


def _told(
    problem: FieldProblem,
    state: FieldState,
    mine: int,
    item: int,
    times_s: tuple[float, ...],
    score: float | None,
    second_score: float | None,
) -> FieldTurnDecision:
    depart_s, arrive_s, begin_s, end_s = times_s
    sortie_end_s = float(state.sortie_end_s[mine])
    if state.landed_at[mine] >= 0:
        sortie_end_s = depart_s + float(problem.full_s[mine])
    return FieldTurnDecision(
        item=item,
        task=problem.task_ids[item >> 1] if item >= 0 else None,
        base=problem.base_ids[-1 - item] if item < 0 else None,
        reversed=item >= 0 and bool(item & 1),
        depart_s=depart_s,
        arrive_s=arrive_s,
        begin_s=begin_s,
        end_s=end_s,
        sortie_end_s=sortie_end_s,
        score=score,
        second_score=second_score,
    )


def _team_at(
    problem: FieldProblem,
    board: TaskBoard,
    turn: DecisionTurn,
    flying_on: Claim | None = None,
) -> FieldState:
    """Where everybody stands when ``turn.uav`` is free where it is, or has ended a claim first."""
    replica, epoch = board.replica, board.replica.epoch
    sequence = epoch.sequence if epoch is not None else ()
    rank = ranks(sequence, problem.uav_ids)
    stronger = _stronger_claims(replica.claims, rank[turn.uav], turn)
    weaker = {
        uav
        for uav, claim in replica.claims.items()
        if uav in turn.credible and uav not in stronger and _takes(claim)
    }
    counting = stronger if flying_on is None else {**stronger, turn.uav: flying_on}
    state = field_state(
        problem,
        board,
        counting,
        present={*turn.credible, turn.uav},
        sequence=sequence,
        blocking=turn.blocking,
    )
    columns: dict[str, int] = {task: index for index, task in enumerate(problem.task_ids)}
    excluded = [columns[task] for task in turn.excluded if task in columns]
    state.open[excluded] = False
    after_s = math.nextafter(turn.now_s, math.inf)
    for row, uav in enumerate(problem.uav_ids):
        claim = stronger.get(uav)
        known = claim is not None and (claim.task is None or claim.task in columns)
        if uav == turn.uav:
            if flying_on is None:
                _stand_here(problem, board, state, row, turn)
        elif claim is not None and known:
            # Who is a little late is about to decide, or its word is on its way; who is later may
            # come any moment, and nobody waits for it.
            if turn.now_s >= claim.completion_s + turn.patience_s:
                state.free_s[row] = after_s
                if np.isfinite(state.arrives_s[row]):
                    state.arrives_s[row] = -math.inf
        elif uav in turn.awaited or uav in weaker:
            # Who has claimed after this UAV became free decides again, but after it.
            state.free_s[row] = after_s if uav in weaker else turn.now_s
        elif uav not in turn.blocking:
            state.active[row] = False
            present = replica.claims.get(uav) if uav in turn.credible else None
            if present is None or present.phase is ClaimPhase.IDLE:
                state.landed_at[row] = -1  # gone, or about to leave its slot
    return state


def _stand_here(
    problem: FieldProblem, board: TaskBoard, state: FieldState, row: int, turn: DecisionTurn
) -> None:
    """Let the deciding UAV be free now, where it is, with what it has left of its battery."""
    state.free_s[row] = turn.now_s
    state.sortie_end_s[row] = turn.sortie_end_s
    state.landed_at[row] = -1
    state.leaving[row] = -1
    if turn.landed_at is not None:
        base = problem.base_ids.index(BaseId(turn.landed_at))
        state.landed_at[row] = base
        state.arrives_s[row] = math.inf if turn.parked else -math.inf
        state.first_s[row] = problem.leg_s[problem.kind[row], problem.n_uav + base]
        return
    node = last_node(problem, board, turn.uav)
    if problem.network is not None:
        at_m = problem.network.node_enu_m[node]
        if turn.place_enu_m[:2] != (at_m[0], at_m[1]):
            state.first_s[row] = problem.legs_from_s(row, turn.place_enu_m, turn.flown_m)
            return
    state.first_s[row] = problem.leg_s[problem.kind[row], node]


def _takes(claim: Claim) -> bool:
    return claim.phase in (ClaimPhase.PROPOSED, ClaimPhase.HELD)


def _stronger_claims(
    claims: Mapping[str, Claim], rank: int, turn: DecisionTurn
) -> dict[str, Claim]:
    """Claims of credible others that would beat a claim this UAV makes now."""
    proposal = Claim(ClaimPhase.PROPOSED, "-", turn.decided_s, rank, turn.now_s)
    own = claim_strength(turn.uav, proposal)
    return {
        uav: claim
        for uav, claim in claims.items()
        if uav in turn.credible and _takes(claim) and claim_strength(uav, claim) < own
    }
