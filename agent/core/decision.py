"""Which task this UAV should take next, and what it says of that choice.

The offline lower level (swarm.allocation) is continued from the state the registers describe
until this UAV's turn comes. So UAVs that are free at the same time and of better rank decide
first in everyone's view, and a faultless run repeats the offline plan decision for decision
(section III.C of the paper). When something has opened, a UAV in flight may turn to it where
the whole team gains. What a choice rested on is put together when everything that follows from
it has been done, so neither the order to the vehicle nor the claim waits for it. Leaves out:
what is done with the decision (agent.core.tasking).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from agent.core.context import AgentContext, AgentPart
from swarm.allocation.lower_level import (
    Decision,
    IdlingRule,
    Rule,
    ScoringRule,
    TeamState,
    decisions,
)
from swarm.allocation.problem import IntArray, Problem
from swarm.allocation.rules import GuidedRule
from swarm.protocol.board import TaskBoard, after_outcomes, claim_strength, finish_claim, ranks
from swarm.protocol.events import PublishLast
from swarm.protocol.messages import Message, PlanEpoch, Stamp
from swarm.protocol.sync import combined, fingerprint
from swarm.protocol.uav_messages import (
    MAX_CANDIDATES,
    Candidate,
    Choice,
    ChoiceBasis,
    Claim,
    ClaimPhase,
    choice_id,
)

DIVERSION_MARGIN_FRAC = 0.001
"""Of the value the team has still to win; a UAV turns aside for no less."""


@dataclass(frozen=True, slots=True)
class DecisionTurn:
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
    sortie_end_s: float = math.inf
    """By then it must have landed [s]; infinite: endless, or of no matter while it stands at a
    base."""
    landed_at: str | None = None
    """Base at which it stands ready, with a full battery; None: it is in the air."""
    parked: bool = False
    """Whether it stands there beside the slots."""
    flown_m: float | None = None
    """Height at which it hovers out of its layer over the ground [m]; None: it does not."""
    blocking: Mapping[str, str] = field(default_factory=dict)
    """Lost UAV -> base on whose slot it stands; see `swarm.protocol.bases.blocking`."""


def nothing_left(
    board: TaskBoard, decided_s: float, excluded: Collection[str], counts: Callable[[str], bool]
) -> bool:
    """Whether others surely keep all open tasks from a UAV that became free at ``decided_s``.

    True only if `decide` finds nothing, and told without looking at everybody's place. What others
    decide meanwhile changes nothing of it, as long as no task opens: in a large fleet at the end of
    its mission each claim would make all who are idle decide anew. A claim keeps nothing from
    anybody for long once its outcome is told: the next one tells whether its task is open again.

    Args:
        board: the registers and what they say about tasks.
        decided_s: mission time [s].
        excluded: tasks this UAV cannot take.
        counts: whether that UAV is another one whose claims count.
    """
    claimants, outcomes = board.replica.claimants, board.replica.outcomes
    return all(
        task in excluded
        or any(
            (claim.phase is not ClaimPhase.PROPOSED or claim.decided_s < decided_s)
            and counts(uav)
            and (uav, task) not in outcomes
            for uav, claim in claimants.get(task, {}).items()
        )
        for task in board.open
    )


def decide(problem: Problem, board: TaskBoard, rule: Rule, turn: DecisionTurn) -> Decision | None:
    """The decision of ``turn.uav``; None when there is no task it could take.

    Args:
        problem: every UAV and every task on the board.
        board: the registers and what they say about tasks.
        rule: of the epoch in force; see `swarm.protocol.board.rule_of`.
        turn: who decides, when and where.
    """
    mine = problem.row_of[turn.uav]
    state, order = _team_at(problem, board, turn)
    if not state.open.any():
        return None
    process = decisions(problem, state, order, rule, last=mine)
    return next((decision for decision in process if decision.uav == mine), None)


def decide_diversion(
    problem: Problem, board: TaskBoard, rule: GuidedRule, turn: DecisionTurn, claim: Claim
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
    current = problem.column_of.get(claim.task or "")
    if current is None:
        return None
    mine = problem.row_of[turn.uav]
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
    return decision if decision.score - worth > DIVERSION_MARGIN_FRAC * abs(worth) else None


def _team_at(problem: Problem, board: TaskBoard, turn: DecisionTurn) -> tuple[TeamState, IntArray]:
    """Where everybody stands when ``turn.uav`` is free where it is, and everybody's rank."""
    replica, epoch = board.replica, board.replica.epoch
    rank = ranks(epoch.sequence if epoch is not None else (), problem.uav_ids)
    stronger = _stronger_claims(replica.claims, rank[turn.uav], turn)
    weaker = {
        uav
        for uav, claim in replica.claims.items()
        if uav in turn.credible and uav not in stronger and claim.task is not None
    }
    columns = problem.column_of
    state = after_outcomes(problem, board)
    taken = {claim.task for claim in stronger.values()} | set(turn.excluded)
    state.open[[columns[task] for task in taken if task is not None and task in columns]] = False
    for index, uav in enumerate(problem.uav_ids):
        claim = stronger.get(uav)
        state.active[index] = True
        if uav == turn.uav:
            state.free_s[index] = turn.now_s
            state.place_enu_m[index] = turn.place_enu_m
        elif claim is not None and claim.task is not None and claim.task in columns:
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


def _stronger_claims(
    claims: Mapping[str, Claim], rank: int, turn: DecisionTurn
) -> dict[str, Claim]:
    """Claims of credible others that would beat a claim this UAV makes now."""
    proposal = Claim(ClaimPhase.PROPOSED, "-", turn.decided_s, rank, turn.now_s)
    own = claim_strength(turn.uav, proposal)
    return {
        uav: claim
        for uav, claim in claims.items()
        if uav in turn.credible and claim.task is not None and claim_strength(uav, claim) < own
    }


_PASSING_FRAC = 1.0 / 6.0
"""Of the pause, after which a task is considered again that others were in the way of."""


class RefusedTasks:
    """Tasks that a UAV's vehicle would not fly to, each left alone for a while."""

    def __init__(self, pause_s: float) -> None:
        self._pause_s = pause_s
        self._refusals: dict[str, tuple[int, float]] = {}
        """How often, and until when."""

    def add(self, task: str, now_s: float, *, passes: bool = False) -> None:
        """Leave ``task`` alone: the vehicle refused it, or others were in the way (``passes``)."""
        times = 1 + self._refusals.get(task, (0, 0.0))[0]
        pause_s = _PASSING_FRAC * self._pause_s if passes else self._pause_s
        # Each time for longer, so that a fleet may find that nobody takes what is left.
        self._refusals[task] = times, now_s + pause_s * 2.0 ** (times - 1)

    def left_alone(self, now_s: float) -> dict[str, float]:
        """Task -> until when it is left alone [s]."""
        return {task: until_s for task, (_, until_s) in self._refusals.items() if now_s < until_s}


class RecordingRule:
    """A rule, and the state in which one UAV last decided by it."""

    def __init__(self, rule: Rule, uav: int) -> None:
        self.name = rule.name
        self._rule = rule
        self._idling = rule if isinstance(rule, IdlingRule) else None
        self._uav = uav
        self._state: TeamState | None = None

    def decide(
        self, problem: Problem, state: TeamState, rank: IntArray, uav: int
    ) -> Decision | None:
        """Whatever the rule says."""
        if uav == self._uav:
            self._state = state.copy()
        return self._rule.decide(problem, state, rank, uav)

    def count_idle(
        self, problem: Problem, state: TeamState, rank: IntArray, uavs: Sequence[int]
    ) -> int:
        """Whatever the rule says, where it says anything."""
        idling = self._idling
        return 0 if idling is None else idling.count_idle(problem, state, rank, uavs)

    def valued(self, problem: Problem, decision: Decision) -> tuple[tuple[int, float], ...]:
        """Tasks that ``decision`` chose from, with their scores: what it took, then best first."""
        found = decision.valued[:MAX_CANDIDATES]
        if not found and self._state is not None and isinstance(self._rule, ScoringRule):
            found = self._rule.valued(problem, self._state, decision.uav, MAX_CANDIDATES)
        return found or ((decision.task, decision.score),)


class FieldDecision(Protocol):
    """What a choice tells of a decision under constraints."""

    @property
    def task(self) -> str | None:
        """The task it takes; None: it flies to a base."""

    @property
    def base(self) -> str | None:
        """The base it flies to; None: it takes a task."""

    @property
    def end_s(self) -> float:
        """When the task is done, or the UAV ready at the base [s mission time]."""

    @property
    def score(self) -> float | None:
        """By the rule in force."""

    @property
    def second_score(self) -> float | None:
        """Of the best task it did not take."""


class ChoiceReporter(AgentPart):
    """Reports the choices of one agent in this life of it."""

    def __init__(self, context: AgentContext) -> None:
        super().__init__(context)
        self._number = 0

    @property
    def label(self) -> dict[str, object]:
        """For the log, which choice its lines are about: the last one, if there was any."""
        return {"decision": choice_id(self._uav, self._number)} if self._number else {}

    def made(
        self,
        turn: DecisionTurn,
        problem: Problem,
        epoch: PlanEpoch,
        recording_rule: RecordingRule,
        decision: Decision,
        claim: Claim,
        left: str | None,
    ) -> PublishLast:
        """Count a choice that has been made, before it is claimed; what is to be said of it.

        ``left`` is the task that the UAV turned aside from; None when it was free.
        """
        self._number += 1
        head, before = self._replica.heads.get(self._uav), self._announcer.claimed
        number = self._number

        def make() -> Message:
            choice = Choice(
                number=number,
                task=problem.task_ids[decision.task],
                left=left,
                chosen_s=turn.now_s,
                epoch=epoch.number,
                rule=epoch.rule,
                rank=claim.rank,
                score=decision.score,
                second_score=decision.second_score,
                certificate=decision.certificate,
                completion_s=decision.completion_s,
                candidates=tuple(
                    Candidate(problem.task_ids[task], score)
                    for task, score in recording_rule.valued(problem, decision)
                ),
                basis=self._basis(turn, head, before),
            )
            return self._announcer.say(choice).message

        return PublishLast(make)

    def made_in_field(
        self,
        turn: DecisionTurn,
        epoch: PlanEpoch,
        decision: FieldDecision,
        rank: int,
        left: str | None = None,
    ) -> PublishLast:
        """The same of a task or a base chosen under the field's constraints."""
        self._number += 1
        head, before = self._replica.heads.get(self._uav), self._announcer.claimed
        number, score = self._number, decision.score or 0.0
        candidates = () if decision.task is None else (Candidate(decision.task, score),)

        def make() -> Message:
            choice = Choice(
                number=number,
                task=decision.task,
                left=left,
                chosen_s=turn.now_s,
                epoch=epoch.number,
                rule=epoch.rule,
                rank=rank,
                score=score,
                second_score=decision.second_score,
                certificate=False,
                completion_s=decision.end_s,
                candidates=candidates,
                basis=self._basis(turn, head, before),
                base=decision.base,
            )
            return self._announcer.say(choice).message

        return PublishLast(make)

    def _basis(self, turn: DecisionTurn, head: Stamp | None, before: Message | None) -> ChoiceBasis:
        """What the choice rested on; of all registers only the own claim has changed since.

        ``head``, of the own statements, and ``before``, the own claim, are as it chose.
        """
        heads = {**self._replica.heads, self._uav: head}
        claims = [message for message in (before, self._announcer.claimed) if message is not None]
        numbers = [*self._replica.digest().values(), *map(fingerprint, claims)]
        claimants = self._replica.claims
        return ChoiceBasis(
            decided_s=turn.decided_s,
            place_enu_m=turn.place_enu_m,
            flown_m=turn.flown_m,
            patience_s=turn.patience_s,
            credible=tuple(sorted(uav for uav in turn.credible if uav in claimants)),
            awaited=tuple(sorted(turn.awaited)),
            excluded=tuple(sorted(turn.excluded)),
            heads={
                writer: (stamp.incarnation, stamp.counter)
                for writer, stamp in heads.items()
                if stamp is not None
            },
            digest=combined(numbers),
            sortie_end_s=turn.sortie_end_s if math.isfinite(turn.sortie_end_s) else None,
            landed_at=turn.landed_at,
            parked=turn.parked,
            blocking=tuple(sorted(turn.blocking.items())),
        )
