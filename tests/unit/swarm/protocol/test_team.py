"""What the registers tell of each UAV's past and of how it decides."""

from __future__ import annotations

from dataclasses import replace

import pytest

from swarm.allocation.rules import GuidedRule
from swarm.protocol.board import after_outcomes, finish_claim, ranks, rule_of
from tests.support.builders import done, entry, failed, held, mission, task, uav
from tests.support.running_mission import RunningMission


def running() -> RunningMission:
    flown = mission([uav("a"), uav("b", east_m=50.0)], [task(f"t{n}", 10.0 * n) for n in range(4)])
    return RunningMission(replace(flown, survival_default=0.5))


def test_before_any_attempt_everybody_is_at_its_start() -> None:
    fleet = running()
    problem = fleet.at(0.0).problem

    state = after_outcomes(problem, fleet.board)

    assert state.free_s.tolist() == [0.0, 0.0]
    assert state.place_enu_m[:, 0].tolist() == [0.0, 50.0]
    assert state.survived.tolist() == [1.0, 1.0]
    assert state.open.all()
    assert state.active.all()


def test_attempts_count_in_the_order_in_which_they_ended_whatever_came_of_them() -> None:
    fleet = running().say("a", done("t3", 30.0)).say("a", failed("t1", 10.0))
    fleet.post(entry("t2", east_m=20.0, number=2, withdrawn=True))

    state = after_outcomes(fleet.at(40.0).problem, fleet.board)

    assert state.free_s.tolist() == [30.0, 0.0]
    assert state.place_enu_m[:, 0].tolist() == [30.0, 50.0]
    assert state.survived.tolist() == [0.25, 1.0]
    assert state.open.tolist() == [True, False, False, False]


def test_outcomes_of_strangers_and_of_unknown_tasks_count_for_nobody() -> None:
    fleet = running().say("z", done("t1")).say("a", done("t9"))

    state = after_outcomes(fleet.at(40.0).problem, fleet.board)

    assert state.survived.tolist() == [1.0, 1.0]
    assert state.open.tolist() == [True, True, True, True]


def test_a_claim_is_finished_where_and_when_it_says() -> None:
    fleet = running()
    problem = fleet.at(0.0).problem
    state = after_outcomes(problem, fleet.board)

    finish_claim(problem, state, 1, 3, held("t3", 0.0, completion_s=20.0))

    assert state.free_s.tolist() == [0.0, 20.0]
    assert state.place_enu_m[:, 0].tolist() == [0.0, 30.0]
    assert state.survived.tolist() == [1.0, 0.5]
    assert state.open.tolist() == [True, True, True, False]


def test_ranks_follow_the_sequence_and_then_the_ids() -> None:
    assert ranks(("u2", "gone", "u0"), ("u3", "u0", "u1", "u2")) == {
        "u2": 0,
        "u0": 1,
        "u1": 2,
        "u3": 3,
    }


@pytest.mark.parametrize("name", ["greedy", "lookahead", "guided"])
def test_rules_are_found_by_name(name: str) -> None:
    rule = rule_of(name, {})

    assert rule is not None
    assert rule.name == name
    assert isinstance(rule, GuidedRule) == (name == "guided")


def test_a_rule_of_a_newer_version_is_unknown() -> None:
    assert rule_of("newer", {}) is None
