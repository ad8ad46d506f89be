"""What is said of a mission's standing."""

from __future__ import annotations

import json
from dataclasses import replace

from rich.console import Console

from coordinator.mission_view.mission_state import MissionState
from coordinator.mission_view.presentation import signs_for
from coordinator.mission_view.scene import scene_of
from coordinator.terminal.status_table import status_as_json, status_table
from swarm.model.ids import COORDINATOR, OPERATOR
from swarm.protocol.events import PeerGone, PeerSeen, Tick
from swarm.protocol.messages import CommandKind, MissionPhase, OperatorCommand, PlanEpoch
from swarm.protocol.uav_messages import Claim, ClaimPhase, Status, StatusPhase
from tests.support.builders import TIMING, brief_of
from tests.support.observed_mission import Teller, random_mission, shipped

MALFORMED = {"malformed": 48, "stale": 2}


def rendered(mission_state: MissionState, now_s: float, width: int = 80) -> str:
    console = Console(width=width, color_system=None, highlight=False)
    with console.capture() as capture:
        console.print(status_table(scene_of(mission_state, now_s), width, signs_for(True)))
    return capture.get()


def flying() -> Teller:
    """table-1 running for 3 s: uav1 on its way, uav2 gone, uav3 never heard."""
    teller = Teller(shipped("table-1"))
    teller.begin()
    teller.claim("uav1", "t2", 4.5)
    status = Status(StatusPhase.FLYING, "t2", (5.0, -0.001, 0.0), None, 0.17, 2.5, MALFORMED, "")
    teller.say("uav1", status, 2.5)
    teller.say("uav2", replace(status, phase=StatusPhase.IDLE, dropped={"stale": 3}), 2.0)
    teller.claim("uav2", "t8", 2.0)
    teller.end("uav2", "t8", 2.0)
    teller.mission_state.step(PeerSeen("standby"), 2.0)
    go(teller, "uav2", 2.1)
    return teller


def go(teller: Teller, writer: str, now_s: float) -> None:
    teller.mission_state.step(PeerGone(writer), now_s)
    teller.mission_state.step(Tick(), now_s + TIMING.loss_delay_s)


def test_each_uav_is_told_with_task_place_age_and_what_it_dropped() -> None:
    first, second, third = scene_of(flying().mission_state, 3.0).uavs

    assert (first.now_does, first.now_task, first.now_eta_s) == ("flying", "t2", 1.5)
    assert (first.in_layer_enu_m, first.battery_frac) == ((5.0, -0.001, 0.0), 0.17)
    assert first.link_age_s == 0.5
    assert first.dropped == MALFORMED
    assert (second.now_does, second.now_task, len(second.flown)) == ("lost", None, 1)
    assert (third.in_layer_enu_m, third.link_age_s, third.dropped) == (None, None, {})


def test_dropped_messages_are_added_up_by_reason() -> None:
    assert scene_of(flying().mission_state, 3.0).dropped_by_reason == {"malformed": 48, "stale": 5}


def test_coordinator_and_others_are_told() -> None:
    teller = flying()
    assert scene_of(teller.mission_state, 3.0).coordinator
    assert scene_of(teller.mission_state, 3.0).others == ("standby",)

    go(teller, "coordinator", 2.7)

    assert not scene_of(teller.mission_state, 3.0).coordinator


def test_a_uav_that_was_never_seen_is_absent_whatever_others_remember_of_it() -> None:
    teller = Teller(shipped("table-1"))
    teller.claim("uav3", "t1", 4.5)

    third = scene_of(teller.mission_state, 3.0).uavs[2]

    assert (third.now_does, third.now_task) == ("absent", None)


def test_json_holds_everything_and_can_be_printed() -> None:
    told = json.loads(json.dumps(status_as_json(scene_of(flying().mission_state, 3.0))))

    assert (told["mission"], told["phase"], told["epoch"]) == ("table-1", "running", 1)
    assert told["tasks"] == {"open": 7, "done": 1, "failed": 0, "withdrawn": 0, "taken": 1}
    assert [uav["id"] for uav in told["uavs"]] == ["uav1", "uav2", "uav3"]
    assert told["uavs"][0]["dropped"] == MALFORMED
    assert told["dropped"] == {"malformed": 48, "stale": 5}


def test_table_fits_80_columns_and_names_who_dropped_most() -> None:
    text = rendered(flying().mission_state, 3.0)

    assert max(len(line) for line in text.splitlines()) <= 80
    assert "table-1 - RUNNING - mission time 3.0 s (D = 5 s)" in text
    assert "1 of 8 done" in text
    words = " ".join(text.split())
    assert "^ uav1 flying t2 0 5.0, 0.0, 0.0 17% 0.5 s 50 ! uav2 LOST - 1" in words
    assert "malformed 48 uav1 (48)" in words
    assert "stale 5 uav2 (3)" in words


def test_long_ids_and_notes_still_fit() -> None:
    mission = random_mission(3, 2, seed=1)
    teller = Teller(mission)
    teller.begin()
    note = "waiting for a position estimate that does not come, with \x1b[31mcolour"
    place = (-12345.6, 98765.4, 120.0)
    status = Status(StatusPhase.PREPARING, None, place, None, None, None, {"x" * 40: 9}, note)
    teller.say("uav1", status)

    text = rendered(teller.mission_state, 1.0)

    assert max(len(line) for line in text.splitlines()) <= 80
    assert "\x1b" not in text
    assert "-12346, 98765, 120" in text
    assert "does not come" in " ".join(text.split())


def test_a_note_has_a_line_of_its_own_beside_whose_it_is() -> None:
    teller = flying()
    note = "it flies at 10.5 m/s, asked for 12: its own limits forbid more"
    teller.status("uav1", StatusPhase.FLYING, 2.7, note=note)

    lines = [line.strip() for line in rendered(teller.mission_state, 3.0).splitlines()]

    assert f"uav1  {note}" in lines


def test_what_another_has_taken_is_on_nobodys_list() -> None:
    teller = Teller(shipped("table-1"))
    teller.begin()
    lists = {"uav1": ("t1", "t2"), "uav2": ("t3", "t4"), "uav3": ()}
    epoch = PlanEpoch(2, MissionPhase.RUNNING, "guided", tuple(lists), 0.5, "as told", lists)
    teller.say(COORDINATOR, epoch, 0.5)

    teller.claim("uav1", "t3", 4.5)

    planned = {uav.id: uav.planned for uav in scene_of(teller.mission_state, 1.0).uavs}
    assert planned == {"uav1": ("t1", "t2"), "uav2": ("t4",), "uav3": ()}


def commanded() -> Teller:
    """table-1, whose uav1 the operator holds; then the mission is aborted."""
    teller = flying()
    teller.say(COORDINATOR, brief_of(shipped("table-1")), 2.5)
    teller.say(OPERATOR, OperatorCommand("uav1", CommandKind.HOLD, 1, "helicopter"), 2.6)
    teller.say(OPERATOR, OperatorCommand("uav2", CommandKind.HOLD, 0, "of an earlier flight"), 2.6)
    return teller


def test_the_operators_words_are_told() -> None:
    teller = commanded()
    teller.say(OPERATOR, OperatorCommand("fleet", CommandKind.ABORT, 1, ""), 2.7)

    told = json.loads(json.dumps(status_as_json(scene_of(teller.mission_state, 3.0))))
    assert told["aborted"] is True
    assert told["commands"] == {
        "uav1": {"command": "hold", "reason": "helicopter"},
        "fleet": {"command": "abort", "reason": ""},
    }
    lines = rendered(teller.mission_state, 3.0).splitlines()
    assert "operator     uav1 held by the operator: helicopter" in [line.rstrip() for line in lines]
    assert "operator     mission aborted by the operator" in [line.rstrip() for line in lines]
    assert [line.text for line in teller.mission_state.story][-2:] == [
        "operator holds uav1: helicopter",
        "operator aborts the mission",
    ]


def test_without_a_word_of_the_operator_nothing_is_told_of_any() -> None:
    told = status_as_json(scene_of(flying().mission_state, 3.0))

    assert (told["aborted"], told["commands"]) == (False, {})


def test_who_went_home_and_left_is_home_and_its_height_is_that_of_its_layer() -> None:
    teller = flying()
    layered = brief_of(shipped("table-1"))
    layered = replace(layered, uavs=tuple(replace(uav, layer_m=10.0) for uav in layered.uavs))
    teller.say(COORDINATOR, layered, 2.4)
    teller.say("uav1", Claim(ClaimPhase.OUT, None, 2.5, 0, 2.5), 2.5)
    teller.status("uav1", StatusPhase.HOME, 2.6, position_enu_m=(5.0, 0.0, -10.0))
    go(teller, "uav1", 2.7)

    first = scene_of(teller.mission_state, 3.0).uavs[0]

    assert (first.now_does, first.in_layer_enu_m) == ("home", (5.0, 0.0, 0.0))
