"""Choices under the field's constraints come out the same when they are made again."""

from __future__ import annotations

import math
import random
from dataclasses import replace

import pytest

from agent.core.decision import DecisionTurn
from agent.core.field_decision import FieldTurnDecision, decide_in_field, field_rule_of
from sim.world.redecision import redecide
from swarm.allocation.field import FieldProblem
from swarm.kernels.field import FIELD_GREEDY
from swarm.protocol.events import MessageReceived
from swarm.protocol.sync import combined
from swarm.protocol.uav_messages import Choice, ChoiceBasis
from tests.support.builders import message
from tests.support.field_dilemmas import dilemma
from tests.support.field_missions import mission_of
from tests.support.field_registers import Moment, PlannedRun


def moments(seed: int, rule: str) -> list[Moment]:
    """Turns along a run by greedy, in a mission that is under that rule."""
    mission = mission_of(dilemma(seed, 3, 6, slots=True, extras=("lines",)))
    problem = FieldProblem.from_mission(mission)
    sequence = random.Random(seed).sample(range(3), 3)
    run = PlannedRun(mission, problem, FIELD_GREEDY, sequence, said_rule=rule)
    return list(run.moments())


def choice_of(moment: Moment, rule: str, found: FieldTurnDecision) -> Choice:
    """What the UAV says of it."""
    turn = moment.turn
    heads = {each.writer: each.stamp for each in moment.said}
    return Choice(
        number=1,
        task=found.task,
        left=None,
        chosen_s=turn.now_s,
        epoch=1,
        rule=rule,
        rank=0,
        score=found.score or 0.0,
        second_score=found.second_score,
        certificate=False,
        completion_s=found.end_s,
        candidates=(),
        basis=basis_of(turn, moment, {w: (s.incarnation, s.counter) for w, s in heads.items()}),
        base=found.base,
    )


def basis_of(turn: DecisionTurn, moment: Moment, heads: dict[str, tuple[int, int]]) -> ChoiceBasis:
    return ChoiceBasis(
        decided_s=turn.decided_s,
        place_enu_m=turn.place_enu_m,
        patience_s=turn.patience_s,
        credible=tuple(sorted(turn.credible)),
        awaited=tuple(sorted(turn.awaited)),
        excluded=(),
        heads=heads,
        digest=combined(moment.board.replica.digest().values()),
        sortie_end_s=turn.sortie_end_s if math.isfinite(turn.sortie_end_s) else None,
        landed_at=turn.landed_at,
        parked=turn.parked,
        blocking=tuple(sorted(turn.blocking.items())),
    )


@pytest.mark.parametrize("rule", ["greedy", "lookahead", "guided"])
def test_choices_in_the_field_come_out_the_same_and_changed_ones_do_not(rule: str) -> None:
    in_force = field_rule_of(rule, {})
    assert in_force is not None
    n_choice = n_landed = n_base = 0
    for seed in range(6):
        for moment in moments(seed, rule):
            problem = moment.board.field_problem
            assert problem is not None
            found = decide_in_field(problem, moment.board, in_force, moment.turn)
            if found is None:
                continue
            told = choice_of(moment, rule, found)
            choice = message(moment.turn.uav, told, counter=1000)
            facts = [MessageReceived(each) for each in (*moment.said, choice)]

            result = redecide(facts)
            assert result.ok
            assert result.agreeing == 1
            later = replace(told, completion_s=found.end_s + 1.0)
            changed = redecide([*facts[:-1], MessageReceived(replace(choice, body=later))])
            assert len(changed.differing) == 1
            n_choice += 1
            n_landed += moment.turn.landed_at is not None
            n_base += found.base is not None
    assert n_choice > n_base > 0
    assert n_landed > 0
