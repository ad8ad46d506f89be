"""Watching a mission: when it is over, what is told off a terminal, and lines for programs."""

from __future__ import annotations

import io
import json

import pytest
from rich.console import Console

from coordinator.mission_view.mission_state import MissionState
from coordinator.mission_view.observation import MissionObserver, deserted
from coordinator.mission_view.scene import scene_of
from coordinator.terminal.cli import JsonLines
from coordinator.terminal.live_view import LiveView
from swarm.model.ids import COORDINATOR, FLEET
from swarm.protocol.events import (
    LinkChanged,
    MessageReceived,
    PeerGone,
    PeerSeen,
    SnapshotsReceived,
    Tick,
)
from swarm.protocol.messages import Body, CommandKind, MissionPhase, OperatorCommand, Snapshot
from swarm.protocol.timing import Timing
from swarm.protocol.uav_messages import Status, StatusPhase
from tests.support.builders import MISSION, brief, done, entry, epoch, message, uav

REGISTERS = (
    message(COORDINATOR, brief(uav("u0"), uav("u1"))),
    message(COORDINATOR, entry("t0")),
    message(COORDINATOR, epoch("u0", "u1", phase=MissionPhase.RUNNING)),
)


def status(phase: StatusPhase, mission_s: float) -> Status:
    return Status(phase, None, None, None, None, mission_s, {}, "")


class Seen:
    """An observer that is told things."""

    def __init__(self) -> None:
        self.core = MissionObserver(MISSION, Timing(), None)
        self.mission_state: MissionState = self.core.mission_state
        self._said = 10
        self.core.start(0.0)
        for writer in (COORDINATOR, "u0", "u1"):
            self.core.step(PeerSeen(writer), 0.0)
        self.core.step(SnapshotsReceived((Snapshot(MISSION, COORDINATOR, 1, 0.0, REGISTERS),)), 0.0)

    def say(self, writer: str, body: Body, now_s: float = 1.0) -> Seen:
        self._said += 1
        self.core.step(MessageReceived(message(writer, body, self._said)), now_s)
        return self

    def leave(self, *writers: str, now_s: float = 2.0) -> Seen:
        for writer in writers:
            self.core.step(PeerGone(writer), now_s)
        self.core.step(Tick(), now_s + Timing().loss_delay_s)
        return self


def test_a_mission_that_has_ended_is_deserted_when_all_have_left() -> None:
    seen = Seen().say(COORDINATOR, epoch("u0", "u1", phase=MissionPhase.ENDED))

    assert not deserted(seen.leave("u0", COORDINATOR).mission_state)
    assert deserted(seen.leave("u1").mission_state)


def test_nobody_there_does_not_end_a_mission_with_tasks_left() -> None:
    seen = Seen().leave("u0", "u1", COORDINATOR)

    assert not deserted(seen.mission_state)
    assert deserted(seen.say("u0", done("t0")).mission_state)


def test_an_aborted_mission_is_over_without_its_coordinator() -> None:
    seen = Seen().leave("u0", "u1", COORDINATOR)
    run = brief().run

    assert deserted(
        seen.say("operator", OperatorCommand(FLEET, CommandKind.ABORT, run, "")).mission_state
    )


def test_a_bus_that_ends_with_the_mission_leaves_nobody_who_is_not_home() -> None:
    seen = Seen().say(COORDINATOR, epoch("u0", "u1", phase=MissionPhase.ENDED))
    seen.say("u0", status(StatusPhase.HOME, 9.0)).say("u1", status(StatusPhase.RETURNING, 9.0))
    seen.core.step(LinkChanged(False), 3.0)

    assert not deserted(seen.mission_state)
    seen.core.step(LinkChanged(True), 4.0)
    seen.say("u1", status(StatusPhase.HOME, 10.0), 4.0)
    assert not deserted(seen.mission_state)
    seen.core.step(LinkChanged(False), 5.0)
    assert deserted(seen.mission_state)


def test_a_bus_that_ends_with_the_mission_is_no_lost_link() -> None:
    console = Console(file=io.StringIO(), width=100)
    seen = Seen().say(COORDINATOR, epoch("u0", "u1", phase=MissionPhase.ENDED))
    for uav_id in ("u0", "u1"):
        seen.say(uav_id, status(StatusPhase.HOME, 9.0))
    seen.core.step(LinkChanged(False), 5.0)
    with LiveView(console) as view:
        view.update(seen.mission_state, 9.0)

    assert isinstance(console.file, io.StringIO)
    assert "link" not in console.file.getvalue()
    assert scene_of(seen.mission_state, 9.0).cut_s is None


@pytest.mark.parametrize("pace", [1.0, 20.0])
def test_the_missions_pace_is_seen_and_time_goes_on_at_it(pace: float) -> None:
    seen = Seen()
    for step in range(21):
        now_s = 0.1 * step
        seen.say("u0", status(StatusPhase.FLYING, 100.0 + pace * now_s), now_s)

    told_s = seen.mission_state.mission_s(3.0)
    assert seen.mission_state.pace == pytest.approx(pace)
    # At the mission's usual pace the zero is the one that was told first.
    assert told_s == pytest.approx(3.0 if pace == 1.0 else 100.0 + pace * 3.0)


def test_jitter_of_the_network_is_no_other_pace() -> None:
    seen = Seen()
    seen.say("u0", status(StatusPhase.FLYING, 0.0), 0.3)
    seen.say("u0", status(StatusPhase.FLYING, 2.0), 2.0)

    assert seen.mission_state.pace == 1.0


def test_lines_for_programs_come_once_a_second_and_the_last_state_at_the_end() -> None:
    seen, lines = Seen(), list[str]()
    told = JsonLines(lines.append, 1.0)
    told.wait("waiting for a mission")
    for now_s in (5.0, 5.2, 5.9, 6.0, 6.2):
        told.update(seen.mission_state, now_s)
    told.close()
    told.close()

    objects = [json.loads(line) for line in lines]
    assert [each["mission_s"] for each in objects] == [5.0, 6.0, 6.2]
    assert all(each["mission"] == MISSION and each["link"] for each in objects)


def test_off_a_terminal_the_own_link_and_what_is_waited_for_are_told_once() -> None:
    console = Console(file=io.StringIO(), width=80)
    seen = Seen()
    with LiveView(console) as view:
        view.wait("waiting for a mission")
        view.wait("waiting for a mission")
        view.update(seen.mission_state, 1.0)
        seen.core.step(LinkChanged(False), 2.0)
        view.update(seen.mission_state, 2.0)
        view.update(seen.mission_state, 2.2)
        seen.core.step(LinkChanged(True), 3.0)
        view.update(seen.mission_state, 3.0)

    assert isinstance(console.file, io.StringIO)
    lines = console.file.getvalue().splitlines()
    assert lines[0] == "waiting for a mission"
    assert lines[-2:] == ["own link to the bus is lost", "own link to the bus is back"]
    assert len(lines) == 3 + len(seen.mission_state.story)
