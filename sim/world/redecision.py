"""Decide again what a fleet decided, from recorded messages, compare, and tell what differs.

A `Choice` names the newest statement of each writer that its UAV knew. Of what is recorded up to
there the UAV's registers are built again; where their digest is that of the choice they are the
ones it decided from, and deciding again must give the same task, completion and score to the last
bit.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

from agent.core.decision import DecisionTurn, decide, decide_diversion
from agent.core.field_decision import decide_in_field, divert_in_field, field_rule_of
from swarm.allocation.field import FieldProblem
from swarm.allocation.lower_level import Rule
from swarm.allocation.rules import GuidedRule
from swarm.model import BaseId
from swarm.model.plan import at_base
from swarm.protocol.board import TaskBoard, rule_of
from swarm.protocol.events import CommonEvent, MessageReceived, SnapshotsReceived
from swarm.protocol.messages import Message, PlanEpoch, Stamp
from swarm.protocol.registers import Replica
from swarm.protocol.sync import combined
from swarm.protocol.uav_messages import Choice, ChoiceBasis, Status, choice_id


@dataclass(frozen=True, slots=True)
class DecisionDifference:
    """A choice that comes out otherwise when it is made again."""

    uav: str
    choice: Choice
    task: str | None
    """What the UAV takes now, a base as schedules name it; None: nothing."""
    completion_s: float | None
    score: float | None

    @property
    def decision(self) -> str:
        """The choice's id in logs."""
        return choice_id(self.uav, self.choice.number)


@dataclass(frozen=True, slots=True)
class RedecisionResult:
    """What came of deciding again."""

    agreeing: int
    differing: tuple[DecisionDifference, ...]
    """In the order in which the choices were made."""
    without_inputs: int
    """Choices whose inputs are not all in the recording: messages that got lost on the way to the
    UAV or to the recorder, or were said before the recording began."""

    @property
    def choices(self) -> int:
        """All that are in the recording."""
        return self.agreeing + len(self.differing) + self.without_inputs

    @property
    def ok(self) -> bool:
        """Whether anything was checked, and nothing differs."""
        return self.agreeing > 0 and not self.differing


def redecide(facts: Iterable[CommonEvent]) -> RedecisionResult:
    """Make every choice anew of what somebody on the bus heard and learned of one mission."""
    heard = _Heard(facts)
    agreeing, without_inputs, differing = 0, 0, list[DecisionDifference]()
    for uav, choices in heard.lives():
        memory = _Memory(heard)  # one at a time: each holds the arrays of the whole mission
        for choice in choices:
            if not memory.recall(choice.basis):
                without_inputs += 1
                continue
            now = memory.decide(uav, choice)
            if now == (_went(choice), choice.completion_s, choice.score):
                agreeing += 1
            else:
                differing.append(DecisionDifference(uav, choice, *now))
    differing.sort(key=lambda each: (each.choice.chosen_s, each.uav))
    return RedecisionResult(agreeing, tuple(differing), without_inputs)


class _Heard:
    """Everything that was said, each statement once."""

    def __init__(self, facts: Iterable[CommonEvent]) -> None:
        self.mission = ""
        self.statements: dict[str, list[Message]] = {}
        """What each writer stated in its registers, in its order."""
        self._choices: dict[tuple[str, int], dict[Stamp, Choice]] = defaultdict(dict)
        """By UAV and life of its agent."""
        known: dict[str, dict[tuple[str, Stamp], list[Message]]] = defaultdict(dict)
        for message in _messages(facts):
            self.mission = message.mission
            match message.body:
                case Choice() as choice:
                    life = message.writer, message.stamp.incarnation
                    self._choices[life].setdefault(message.stamp, choice)
                case Status():
                    pass
                case _:
                    same = known[message.writer].setdefault((message.key, message.stamp), [])
                    if message not in same:  # two processes under one name may count alike
                        same.append(message)
        for writer, by_stamp in known.items():
            said = [message for same in by_stamp.values() for message in same]
            self.statements[writer] = sorted(said, key=lambda message: message.stamp)

    def lives(self) -> Iterator[tuple[str, list[Choice]]]:
        """Every life of every agent: its UAV, and its choices in their order."""
        for (uav, _), choices in sorted(self._choices.items()):
            yield uav, [choice for _, choice in sorted(choices.items(), key=lambda item: item[0])]


class _Memory:
    """What one agent knew from choice to choice."""

    def __init__(self, heard: _Heard) -> None:
        self._heard = heard
        self._forget()

    def _forget(self) -> None:
        self._replica = Replica()
        self._board = TaskBoard(self._replica, self._heard.mission)
        self._taken: dict[str, int] = {}
        """By writer, how many of its statements are taken in."""
        self._heads: dict[str, Stamp] = {}
        self._epoch: PlanEpoch | None = None
        self._rule: Rule | None = None

    def recall(self, basis: ChoiceBasis) -> bool:
        """Know what was known at that choice; whether it is all there, and no more."""
        heads = {writer: Stamp(*head) for writer, head in basis.heads.items()}
        if any(writer not in heads or heads[writer] < head for writer, head in self._heads.items()):
            self._forget()  # an agent never does, but a recording may hold anything
        for writer, head in heads.items():
            statements, taken = self._heard.statements.get(writer, ()), self._taken.get(writer, 0)
            while taken < len(statements) and statements[taken].stamp <= head:
                self._replica.join(statements[taken])
                taken += 1
            self._taken[writer] = taken
        self._heads = heads
        return combined(self._replica.digest().values()) == basis.digest

    def decide(self, uav: str, choice: Choice) -> tuple[str | None, float | None, float | None]:
        """What ``uav`` takes now, its completion [s mission time] and score; Nones for nothing."""
        problem, rule = self._board.problem, self._rule_in_force()
        if problem is None or rule is None or uav not in problem.uav_ids:
            return None, None, None
        basis, decision = choice.basis, None
        turn = DecisionTurn(
            uav=uav,
            now_s=choice.chosen_s,
            decided_s=basis.decided_s,
            place_enu_m=basis.place_enu_m,
            credible=set(basis.credible),
            awaited=set(basis.awaited),
            patience_s=basis.patience_s,
            excluded=set(basis.excluded),
            sortie_end_s=math.inf if basis.sortie_end_s is None else basis.sortie_end_s,
            landed_at=basis.landed_at,
            parked=basis.parked,
            blocking=dict(basis.blocking),
            flown_m=basis.flown_m,
        )
        if self._board.field_problem is not None:
            return self._decided_in_field(self._board.field_problem, choice, turn)
        claim = self._replica.claims.get(uav)
        if choice.left is None:
            decision = decide(problem, self._board, rule, turn)
        elif isinstance(rule, GuidedRule) and claim is not None and claim.task == choice.left:
            decision = decide_diversion(problem, self._board, rule, turn, claim)
        if decision is None:
            return None, None, None
        return problem.task_ids[decision.task], decision.completion_s, decision.score

    def _decided_in_field(
        self, problem: FieldProblem, choice: Choice, turn: DecisionTurn
    ) -> tuple[str | None, float | None, float | None]:
        epoch = self._replica.epoch
        rule = None if epoch is None else field_rule_of(epoch.rule, epoch.routes)
        claim = self._replica.claims.get(turn.uav)
        if rule is None:
            return None, None, None
        if choice.left is None:
            decision = decide_in_field(problem, self._board, rule, turn)
        elif claim is not None and claim.task == choice.left:
            decision = divert_in_field(problem, self._board, rule, turn)
        else:
            decision = None
        if decision is None:
            return None, None, None
        went = decision.task if decision.base is None else at_base(decision.base)
        return went, decision.end_s, 0.0 if decision.score is None else decision.score

    def _rule_in_force(self) -> Rule | None:
        epoch = self._replica.epoch
        if epoch is not self._epoch:
            self._epoch = epoch
            self._rule = None if epoch is None else rule_of(epoch.rule, epoch.routes)
        return self._rule


def _messages(facts: Iterable[CommonEvent]) -> Iterator[Message]:
    for fact in facts:
        match fact:
            case MessageReceived(message):
                yield message
            case SnapshotsReceived(snapshots):
                for snapshot in snapshots:
                    yield from snapshot.messages
            case _:
                pass


def redecided_as_json(mission: str, found: RedecisionResult) -> dict[str, Any]:
    """Everything, ready for `json.dumps`."""
    return {
        "mission": mission,
        "choices": found.choices,
        "agreeing": found.agreeing,
        "differing": [
            {
                "decision": each.decision,
                "uav": each.uav,
                "mission_s": each.choice.chosen_s,
                "left": each.choice.left,
                "rule": each.choice.rule,
                "recorded": {
                    "task": _went(each.choice),
                    "completion_s": each.choice.completion_s,
                    "score": each.choice.score,
                },
                "again": {
                    "task": each.task,
                    "completion_s": each.completion_s,
                    "score": each.score,
                },
            }
            for each in found.differing
        ],
        "without_inputs": found.without_inputs,
    }


def redecided_lines(mission: str, found: RedecisionResult) -> Iterator[str]:
    """One line for each difference, and what that makes in all."""
    for each in found.differing:
        yield _told(each)
    yield (
        f"{mission}: of {found.choices} choices {found.agreeing} come out the same, to the last "
        f"bit, and {len(found.differing)} otherwise"
    )
    if found.without_inputs:
        yield (
            f"not decided again: {found.without_inputs}, whose inputs are not in the recording "
            "(messages were lost, or said before it began)"
        )
    if not found.choices:
        yield "no choice is in the recording; agents say them once they take tasks"


def _told(each: DecisionDifference) -> str:
    choice = each.choice
    took = f"turned from {choice.left} to" if choice.left is not None else "took"
    was = _value(_went(choice), choice.score, choice.completion_s)
    now = "nothing"
    if each.task is not None and each.score is not None and each.completion_s is not None:
        now = _value(each.task, each.score, each.completion_s)
    return f"{each.decision} at {choice.chosen_s:.1f} s {took} {was}; decided again: {now}"


def _went(choice: Choice) -> str:
    """The task that was taken, or the base that was flown to as schedules name it."""
    return str(choice.task) if choice.base is None else at_base(BaseId(choice.base))


def _value(task: str, score: float, completion_s: float) -> str:
    return f"{task} (score {score!r}, done at {completion_s!r} s)"
