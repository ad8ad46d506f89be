"""What an observer makes of tasks that the operator adds and withdraws."""

from __future__ import annotations

from dataclasses import replace

import pytest

from coordinator.mission_view.story import EventKind
from swarm.model.ids import COORDINATOR, OPERATOR
from swarm.protocol.field_messages import UavReady, ZoneEdit, ZoneSpec
from swarm.protocol.uav_messages import BaseStage, Claim, ClaimPhase
from tests.support.builders import brief, order
from tests.support.observed_mission import Teller, random_mission

CORNERS = ((50.0, 50.0), (60.0, 50.0), (60.0, 60.0))
VILLAGE = ZoneSpec("village", CORNERS, (), None, None, False)


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


# -- in the field -------------------------------------------------------------------------


def test_the_story_tells_zones_and_words_of_readiness() -> None:
    teller = ordered_mission()
    teller.say(OPERATOR, ZoneEdit(VILLAGE, False, 1, "crowd"), 3.0)
    teller.say(OPERATOR, ZoneEdit(replace(VILLAGE, id="arena", inclusive=True), False, 1, ""), 4.0)
    teller.say(OPERATOR, UavReady("uav0", 1, "battery 7"), 5.0)
    teller.say(OPERATOR, ZoneEdit(VILLAGE, True, 1, ""), 6.0)
    teller.say(OPERATOR, ZoneEdit(VILLAGE, False, 9, "another flight's"), 7.0)

    told = [line.text for line in teller.mission_state.story if line.text.startswith("operator")]
    assert told == [
        "operator draws zone village: crowd",
        "operator keeps the fleet inside zone arena",
        "operator lets uav0 start again: battery 7",
        "operator takes zone village away",
    ]


def test_zones_of_the_mission_are_those_in_force() -> None:
    teller = ordered_mission()
    teller.say(OPERATOR, ZoneEdit(VILLAGE, False, 1, ""), 3.0)
    assert [zone.id for zone in teller.mission_state.mission.zones] == ["village"]

    teller.say(OPERATOR, ZoneEdit(VILLAGE, True, 1, ""), 4.0)
    assert len(teller.mission_state.mission.zones) == 0


def test_a_line_with_limits_is_told_and_worth_what_is_left_until_it_is_due() -> None:
    teller = ordered_mission()
    path = ((1.0, 0.0, 0.0), (9.0, 0.0, 0.0))
    line = order("op1", 1.0, value=2.0, path_enu_m=path, height_m=30.0)
    teller.say(OPERATOR, replace(line, due_s=60.0, opens_s=5.0, closes_s=50.0), 3.0)
    (told,) = (each for each in teller.mission_state.story if each.text.startswith("operator"))
    assert told.detail.endswith(
        "a line of 2 points from 1 m east of the origin, opens at 5.00 s, closes at 50.0 s, "
        "due by 60.0 s, 30 m high"
    )

    teller.end("uav0", "op1", 10.0)
    result = teller.mission_state.result()
    assert result.executed_objective == pytest.approx(2.0 * (60.0 - 10.0))
    added = next(task for task in teller.mission_state.mission.tasks if task.id == "op1")
    assert (added.path_enu_m, added.due_s, added.appears_s) == (path, 60.0, 3.0)


def test_the_story_tells_each_stage_of_a_visit_to_a_base_once() -> None:
    teller = ordered_mission()
    visit = Claim(
        ClaimPhase.HELD, None, 1.0, 0, 90.0, base="b0", stage=BaseStage.APPROACHING, arrives_s=20.0
    )
    for at_s, stage in enumerate([*BaseStage, BaseStage.PARKED], 3):
        teller.say("uav0", replace(visit, stage=stage, arrives_s=float(at_s)), float(at_s))
    teller.say("uav0", replace(visit, task="t0", stage=BaseStage.LANDED, departs_s=30.0), 9.0)
    teller.say("uav0", replace(visit, task="t0", base=None, stage=None, arrives_s=None), 30.0)

    told = [line.text for line in teller.mission_state.story if line.kind is EventKind.BASE]
    assert told == [
        "uav0 flies to base b0 for another battery",
        "uav0 waits above base b0 for a free slot",
        "uav0 has landed at base b0",
        "uav0 is parked at base b0",
        "uav0 has landed at base b0",
    ]
