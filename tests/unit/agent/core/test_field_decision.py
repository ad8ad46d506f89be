"""What a UAV does next in the field: the rule, continued from what the registers say."""

from __future__ import annotations

import math
import random
from collections.abc import Iterator

import numpy as np
import pytest

from agent.core.field_decision import decide_in_field, field_rule_of
from swarm.allocation.field import FieldProblem
from swarm.allocation.field.rules import FIELD_RULES
from swarm.protocol.uav_messages import BaseStage
from tests.support.field_dilemmas import dilemma
from tests.support.field_missions import mission_of
from tests.support.field_oracle.made_up import KINDS, Draft, made_up
from tests.support.field_registers import Moment, PlannedRun


@pytest.mark.parametrize("rule", ["greedy", "lookahead"])
@pytest.mark.parametrize("kind", KINDS)
def test_a_faultless_run_repeats_the_plan_decision_for_decision(kind: str, rule: str) -> None:
    rng = random.Random(f"{kind} {rule}")
    n_decision = 0
    for seed in range(12):
        draft = made_up(seed, kind, n_uavs=rng.choice([2, 3, 4]), n_tasks=rng.choice([4, 6]))
        n_decision += sum(moment.decision is not None for moment in repeated(draft, rule, rng))
    assert n_decision > 0


@pytest.mark.parametrize("rule", ["greedy", "lookahead"])
def test_so_it_does_where_uavs_wait_above_bases_and_on_them(rule: str) -> None:
    """And where they fly to bases in vain, were they to decide by themselves."""
    rng = random.Random(rule)
    waited = departing = 0
    for seed in range(40):
        n_uav = rng.choice([3, 4, 5])
        draft = dilemma(seed, n_uav, 7, slots=True, extras=rng.choice([(), ("lines",)]))
        for moment in repeated(draft, rule, rng):
            claims = moment.board.replica.claims.values()
            waited += any(claim.stage is BaseStage.WAITING for claim in claims)
            departing += any(claim.departs_s is not None for claim in claims)
    assert waited > 0
    assert departing > 0


def repeated(draft: Draft, rule: str, rng: random.Random) -> Iterator[Moment]:
    """Every turn of a planned run, once it has been decided from registers as it was planned.

    Items, times and scores are the same to the last bit; who goes home finds nothing.
    """
    in_force = field_rule_of(rule, {})
    assert in_force is not None
    mission = mission_of(draft).known_at_start()
    problem = FieldProblem.from_mission(mission)
    sequence = rng.sample(range(problem.n_uav), problem.n_uav)
    run = PlannedRun(mission, problem, FIELD_RULES[rule], sequence)
    for moment in run.moments():
        found = decide_in_field(problem, moment.board, in_force, moment.turn)

        where = f"{mission.name}: {moment.turn.uav} at {moment.turn.now_s}"
        assert (found is None) == (moment.decision is None), where
        if found is not None:
            k = moment.decision
            told = [found.depart_s, found.arrive_s, found.begin_s, found.end_s]
            assert found.item == run.runs.items[k], where
            assert told == run.runs.times_s[k].tolist(), where
            scores = [math.nan if x is None else x for x in (found.score, found.second_score)]
            np.testing.assert_array_equal(scores, run.runs.scores[k], err_msg=where)
        yield moment
