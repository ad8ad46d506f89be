"""What an observer makes of tasks that the operator adds and withdraws."""

from __future__ import annotations

from dataclasses import replace

import pytest

from swarm.model.ids import COORDINATOR, OPERATOR
from tests.support.builders import brief, order
from tests.support.observed_mission import Teller, random_mission


def ordered_mission() -> Teller:
    """A mission of ``uav0``, ``t0`` and the pop-up ``t1`` that runs."""
    flown = random_mission(1, 2, seed=0)
    late = replace(flown.tasks[1], appears_s=60.0)
    teller = Teller(replace(flown, tasks=(flown.tasks[0], late)))
    teller.say(COORDINATOR, brief(*flown.uavs))
    teller.begin()
    return teller


def test_the_story_tells_what_the_operator_adds_and_withdraws() -> None:
    teller = ordered_mission()
    teller.say(OPERATOR, order("op1", reason="smoke"), 3.0)
    teller.say(OPERATOR, order("t0", withdrawn=True), 4.0)
    teller.say(OPERATOR, order("op7", run=9), 5.0)

    told = [line.text for line in teller.mission_state.story if line.text.startswith("operator")]
    assert told == ["operator adds task op1: smoke", "operator withdraws t0"]


def test_tasks_the_operator_added_count_once_in_result_and_worth() -> None:
    teller = ordered_mission()
    teller.say(OPERATOR, order("op1", value=2.0), 3.0)
    teller.say(OPERATOR, order("op2"), 3.0)
    teller.say(OPERATOR, order("op1", value=2.0), 4.0)  # said again by another seat
    teller.end("uav0", "op1", 10.0)
    result = teller.mission_state.result()

    assert (result.done, result.open) == (("op1",), ("t0", "t1", "op2"))
    assert result.added == ("op1", "op2")
    assert result.executed_objective == pytest.approx(2.0 * (1000.0 - 10.0))
    (added_s, _) = [task.appears_s for task in teller.mission_state.mission.tasks[2:]]
    assert added_s == 3.0


def test_a_pop_up_that_was_withdrawn_before_it_appeared_is_not_open() -> None:
    teller = ordered_mission()
    teller.say(OPERATOR, order("t1", withdrawn=True), 3.0)

    assert teller.mission_state.result().open == ("t0",)
    assert teller.mission_state.result().added == ()


def test_tasks_added_to_another_flight_are_forgotten_with_it() -> None:
    teller = ordered_mission()
    teller.say(OPERATOR, order("op1"), 3.0)
    teller.say(COORDINATOR, replace(brief(*teller.mission_state.mission.uavs), run=2), 4.0)

    assert [task.id for task in teller.mission_state.mission.tasks] == ["t0", "t1"]
