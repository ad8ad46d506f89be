"""What this UAV should do next under the field's constraints: a task, a base, or nothing now.

As `agent.core.decision` does for plain missions: the offline rule is continued from the state that
the registers describe until this UAV's turn comes, so that a faultless run repeats the plan.
Leaves out: what is done with the decision.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from agent.core.decision import DecisionTurn
from swarm.allocation.field import FieldProblem
from swarm.protocol.board import TaskBoard


@dataclass(frozen=True, slots=True)
class FieldTurnDecision:
    """What a UAV does next; times are predictions [s mission time]."""

    item: int
    """2k for column k from its first point on, 2k + 1 from its last one on, -1 - b for base b."""
    task: str | None
    """The task it takes; None: it flies to a base."""
    base: str | None
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


@dataclass(frozen=True, slots=True)
class FieldRule:
    """The rule of an epoch, for missions with the field's constraints; see `field_rule_of`."""

    name: str
    routes: Mapping[str, Sequence[str]]
    """Task ids by UAV in order of execution; heeded by ``guided`` alone."""


def field_rule_of(name: str, routes: Mapping[str, Sequence[str]]) -> FieldRule | None:
    """The decision rule of an epoch by the name of its rule and its routes; None if unknown."""
    raise NotImplementedError


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
    raise NotImplementedError


def divert_in_field(
    problem: FieldProblem, board: TaskBoard, rule: FieldRule, turn: DecisionTurn
) -> FieldTurnDecision | None:
    """What ``turn.uav`` does now instead of the task it is flying to; None to fly on.

    As `agent.core.decision.decide_diversion`: by rule ``guided`` alone, and only where the whole
    team gains by it. It must be in the air, on the way to a task that it claims.
    """
    raise NotImplementedError
