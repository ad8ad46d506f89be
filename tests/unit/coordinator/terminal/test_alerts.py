"""What is wrong, and what the operator has said, is seen at a glance."""

from __future__ import annotations

import io

import pytest
from rich.console import Console

from coordinator.mission_view.mission_state import MissionState
from coordinator.terminal.live_view import LiveView, live_picture
from swarm.model import Mission
from swarm.model.ids import COORDINATOR, FLEET
from swarm.protocol.events import LinkChanged, Tick
from swarm.protocol.messages import CommandKind, MissionPhase, OperatorCommand, PlanEpoch
from swarm.protocol.uav_messages import Status, StatusPhase
from tests.support.builders import brief_of
from tests.support.observed_mission import Teller, random_mission, shipped


def shown(mission_state: MissionState, now_s: float, size: tuple[int, int] = (80, 24)) -> str:
    console = Console(file=io.StringIO(), width=size[0], color_system=None)
    with console.capture() as captured:
        console.print(live_picture(mission_state, now_s, width=size[0], height=size[1]))
    return captured.get()


def flying(mission: Mission | None = None) -> Teller:
    """Everyone is there, and has just been heard."""
    mission = mission or shipped("table-1")
    teller = Teller(mission)
    teller.say(COORDINATOR, brief_of(mission))
    teller.begin()
    for uav in mission.uavs:
        teller.status(uav.id, StatusPhase.FLYING, 0.5)
    return teller


def test_a_faultless_mission_has_no_alerts() -> None:
    text = shown(flying().mission_state, 1.0)

    assert "wrong" not in text
    assert "orders" not in text


@pytest.mark.parametrize("size", [(80, 24), (160, 50)])
def test_who_is_lost_is_named_and_where_they_are_many_counted(size: tuple[int, int]) -> None:
    few, many = flying(), flying(random_mission(8, 20, seed=1))
    for teller, lost in ((few, ("uav1", COORDINATOR)), (many, [f"uav{n}" for n in range(5)])):
        for uav in lost:
            teller.claim(uav, "t1", 9.0) if uav != COORDINATOR else None
            teller.lose(uav, 1.0)

    assert "wrong  coordinator not there · lost uav1\n" in shown(
        few.mission_state, 2.0, size
    ).replace(" \n", "\n")
    assert "lost 5 UAVs" in shown(many.mission_state, 2.0, size)


def test_a_uav_that_says_nothing_is_shown_before_it_is_given_up() -> None:
    teller = flying()
    teller.status("uav2", StatusPhase.FLYING, 3.0)
    teller.status("uav3", StatusPhase.FLYING, 3.0)

    text = shown(teller.mission_state, 3.6)

    assert "silent uav1 3 s" in text
    assert "uav1 silent 3s" in text
    assert "uav2 flying" in text.replace("idle  ", "flying")


def test_a_lost_link_of_the_onlooker_accuses_nobody() -> None:
    teller = flying()
    teller.mission_state.step(LinkChanged(False), 1.0)
    teller.mission_state.step(Tick(), 9.0)

    text = shown(teller.mission_state, 9.0)

    assert "own link LOST for 8 s: all this is old" in text
    assert "silent" not in text
    assert "coordinator not there" not in text


def test_the_operators_words_stand_there_until_they_are_taken_back() -> None:
    teller = flying()
    run = brief_of(shipped("table-1")).run
    teller.say("operator", OperatorCommand("uav1", CommandKind.HOLD, run, "helicopter"))
    teller.status("uav1", StatusPhase.HOLDING, 1.0, note="held by the operator: helicopter")
    held = shown(teller.mission_state, 1.0)
    teller.say("operator", OperatorCommand("uav1", CommandKind.RESUME, run, ""))
    teller.say("operator", OperatorCommand(FLEET, CommandKind.ABORT, run, "thunder"))
    aborted = shown(teller.mission_state, 2.0)

    assert "orders uav1 held by the operator: helicopter" in held
    assert "holding   held by the operator" in held
    assert "orders mission aborted by the operator: thunder" in aborted
    assert "uav1 told" not in aborted
    assert "table-1 · ABORTED · " in aborted


def test_dropped_messages_are_told() -> None:
    teller = flying()
    body = Status(StatusPhase.FLYING, None, None, None, None, 1.0, {"malformed": 7}, "")
    teller.say("uav1", body)

    assert "wrong  nothing but 7 dropped messages" in shown(teller.mission_state, 1.0)


def test_who_was_given_no_plan_takes_it_from_the_lists_in_force() -> None:
    teller = flying()
    lists = {"uav1": ("t2", "t3", "t1"), "uav2": ("t6", "t8", "t7"), "uav3": ("t4", "t5")}
    sequence = tuple(lists)
    teller.say(
        COORDINATOR,
        PlanEpoch(1, MissionPhase.RUNNING, "guided", sequence, 1.0, "as told", lists),
        1.0,
    )

    text = shown(teller.mission_state, 1.0)

    assert "of 120.33 planned" in text
    assert "uav2 ○t6 ○t8 ○t7" in text


def test_after_a_resize_the_picture_begins_on_a_clean_screen() -> None:
    file = io.StringIO()
    console = Console(
        file=file, force_terminal=True, width=80, height=24, _environ={"TERM": "xterm-256color"}
    )
    teller = flying()
    with LiveView(console) as view:
        view.wait("waiting for a mission")
        view.update(teller.mission_state, 1.0)
        before = file.getvalue()
        console.size = (100, 30)
        view.update(teller.mission_state, 1.2)

    assert "waiting for a mission" in before
    assert "\x1b[2J" not in before
    assert file.getvalue()[len(before) :].startswith("\x1b[2J\x1b[H")
