"""What a UAV does next in the field: the rule, continued from what the registers say."""

from __future__ import annotations

import math
import random
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from agent.core.field_decision import decide_in_field, divert_in_field, field_rule_of
from coordinator.planner.field_guided import field_guided_plan
from coordinator.planner.options import after_evaluations
from swarm.allocation.field import FieldProblem
from swarm.allocation.field.rules import FIELD_RULES
from swarm.kernels.field import FIELD_GREEDY
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


def guided_moments(seed: int, n_uav: int = 3, n_task: int = 7) -> tuple[FieldProblem, list[Moment]]:
    """Turns along a run by greedy, and the problem."""
    mission = mission_of(dilemma(seed, n_uav, n_task, slots=True))
    problem = FieldProblem.from_mission(mission)
    sequence = random.Random(seed).sample(range(n_uav), n_uav)
    return problem, list(PlannedRun(mission, problem, FIELD_GREEDY, sequence).moments())


def test_guided_uavs_free_at_once_take_different_tasks_that_their_plan_holds() -> None:
    n_task = 0
    for seed in range(12):
        problem, moments = guided_moments(seed)
        plan = field_guided_plan(problem, stop=after_evaluations(400))
        routes = {
            str(uav): tuple(str(problem.task_ids[task]) for task in route)
            for uav, route in zip(problem.uav_ids, plan.routes, strict=True)
        }
        rule = field_rule_of("guided", routes)
        assert rule is not None
        board, turn = moments[0].board, moments[0].turn
        taken = []
        for row, uav in enumerate(problem.uav_ids):
            others = {str(other) for other in problem.uav_ids if other != uav}
            place = problem.network.node_enu_m[row].tolist() if problem.network else (0.0, 0.0, 0.0)
            mine = replace(
                turn,
                uav=str(uav),
                credible=others,
                awaited=others,
                place_enu_m=(place[0], place[1], place[2]),
                sortie_end_s=float(problem.first_s[row]),
            )
            found = decide_in_field(problem, board, rule, mine)
            assert found == decide_in_field(problem, board, rule, mine)
            if found is None:
                continue
            assert found.score is not None
            if found.task is not None:
                taken.append(found.task)
        assert len(set(taken)) == len(taken)
        n_task += len(taken)
    assert n_task > 0


def test_who_turns_aside_takes_something_else_and_the_team_gains() -> None:
    turned = 0
    for seed in range(30):
        problem, moments = guided_moments(seed)
        rule = field_rule_of("guided", {})
        assert rule is not None
        for moment in moments:
            for uav, claim in moment.board.replica.claims.items():
                if uav == moment.turn.uav or claim.task is None or claim.departs_s is not None:
                    continue
                where = random.Random(seed)
                mine = replace(
                    moment.turn,
                    uav=uav,
                    credible=(set(moment.turn.credible) | {moment.turn.uav}) - {uav},
                    awaited=(),
                    place_enu_m=(where.uniform(0, 400), where.uniform(0, 400), 0.0),
                    sortie_end_s=math.inf if claim.sortie_end_s is None else claim.sortie_end_s,
                    landed_at=None,
                )
                found = divert_in_field(problem, moment.board, rule, mine)
                if found is None:
                    continue
                assert found.task != claim.task
                turned += 1
    assert turned > 0


def test_what_a_rule_is_called_must_be_known() -> None:
    assert field_rule_of("nearest", {}) is None
