"""What PX4 does otherwise, held against what the real one was recorded to say."""

from __future__ import annotations

import itertools
import math
from pathlib import Path
from typing import Any

import pytest

from agent.core.interface import (
    GoTo,
    HandedOver,
    Home,
    Prepare,
    Return,
    ReturnAdvised,
    VehicleReady,
)
from agent.vehicle.activity import FlightPhase
from agent.vehicle.codec import MavlinkCodec
from agent.vehicle.firmware import firmware_of
from agent.vehicle.firmware.px4 import Px4Copter
from agent.vehicle.messages import (
    CommandAck,
    CommandInt,
    CommandLong,
    Heartbeat,
    Inbound,
    MissionRequest,
    Position,
    StatusText,
    SystemStatus,
)
from agent.vehicle.session import BytesReceived
from agent.vehicle.state import VehicleState
from tests.support.bridge_flight import ORIGIN, START, BridgeFlight
from tests.support.fake_copter import INTERVAL
from tests.support.fake_px4 import AUTO_LOITER, AUTO_TAKEOFF, POSCTL, FakePx4
from tests.support.mavlink_frames import frame, rebuilt, recorded

MISSION, RETARGET = (
    Path(f"tests/data/recordings/px4-1.17-{name}.jsonl") for name in ("mission", "retarget")
)
FLAVOUR = Px4Copter()
RESUME = Prepare(START.position_enu_m, START.speed_m_s, resume=True)


def heard(path: Path) -> list[Inbound]:
    """Everything the vehicle said, as the bridge reads it."""
    codec = MavlinkCodec(1, source_component_id=190)
    messages = [
        one.message
        for row in recorded(path, "vehicle")
        for one in codec.decode(frame(rebuilt(row), row["sys"], row["comp"]))
    ]
    assert codec.bad_bytes == codec.unknown_frames == codec.not_for_us == 0
    return messages


def of(kind: type, path: Path) -> list[Any]:
    return [message for message in heard(path) if isinstance(message, kind)]


def commanded(path: Path, command: int) -> list[dict[str, Any]]:
    return [row for row in recorded(path, "ground") if row.get("command") == command]


# -- as recorded ------------------------------------------------------------------------


def test_a_recorded_px4_is_known_by_its_heartbeat() -> None:
    assert {type(firmware_of(beat)) for beat in of(Heartbeat, MISSION)} == {Px4Copter}


@pytest.mark.parametrize(
    ("path", "modes"),
    [
        (MISSION, ["LOITER", "TAKEOFF", "LOITER", "MISSION", "LAND", "LOITER"]),
        (RETARGET, ["LOITER", "TAKEOFF", "LOITER", "MISSION", "LOITER", "RTL"]),
    ],
)
def test_recorded_modes_have_their_names(path: Path, modes: list[str]) -> None:
    names = [FLAVOUR.mode_name(beat.custom_mode) for beat in of(Heartbeat, path)]
    assert [name for name, _ in itertools.groupby(names)] == [f"AUTO.{mode}" for mode in modes]


def test_a_recorded_px4_boots_and_then_is_ready() -> None:
    beats = of(Heartbeat, MISSION)
    booting = next(n for n, beat in enumerate(beats) if beat.system_status == 0)
    assert [FLAVOUR.has_booted(beat) for beat in beats[booting : booting + 2]] == [False, True]

    vehicle = VehicleState()
    assert FLAVOUR.unready(vehicle) == "waiting for the pre-arm checks (SYS_STATUS)"
    statuses = of(SystemStatus, MISSION)
    unready = next(n for n, status in enumerate(statuses) if not status.prearm_healthy)
    vehicle.on_message(statuses[unready], 0.0)
    assert FLAVOUR.unready(vehicle) == "pre-arm checks do not pass"
    vehicle.on_message(statuses[unready + 1], 2.0)
    assert FLAVOUR.unready(vehicle) == "waiting for a position"
    vehicle.on_position(of(Position, MISSION)[-1])
    assert FLAVOUR.unready(vehicle) is None


def test_checks_that_fail_while_it_stands_are_no_reboot() -> None:
    flight = BridgeFlight(FakePx4(ORIGIN, ready_s=20.0))
    flight.order(START)
    while not flight.copter.count()[INTERVAL]:
        flight.step()
    flight.run(5.0)
    flight.copter.heard.clear()
    for status in (0, 3, 0, None):
        flight.copter.system_status = status
        flight.copter.heartbeat()
        flight.step()
    assert not flight.copter.count()[INTERVAL]  # streams are asked for anew after a reboot
    flight.run_until(VehicleReady())


def test_a_recorded_flight_is_told_from_standing_armed() -> None:
    vehicle, flights = VehicleState(), []
    for message in heard(RETARGET):
        vehicle.on_message(message, 0.0)
        if isinstance(message, Heartbeat):
            flights.append((vehicle.armed, FLAVOUR.airborne(vehicle)))
    order = [(False, False), (True, False), (True, True)]
    assert [state for state, _ in itertools.groupby(flights)] == order


def test_recorded_texts_are_whole_and_end_without_their_tab() -> None:
    said = [text.text for text in of(StatusText, RETARGET)]
    assert "RTL: start return at 519 m (31 m above destination)" in said
    assert "No valid mission available, loitering" in said
    assert not any("\t" in text or "?" in text for text in said)


def test_only_changes_of_mode_are_recorded_to_be_acknowledged_twice() -> None:
    for path in (MISSION, RETARGET):
        answers = [ack.command for ack in of(CommandAck, path)]
        for command in set(answers):
            twice = command in FLAVOUR.acknowledged_twice
            assert answers.count(command) == len(commanded(path, command)) * (2 if twice else 1)


def test_requests_and_commands_of_the_vehicle_itself_are_read_or_ignored() -> None:
    assert [request.seq for request in of(MissionRequest, MISSION)] == [0, 1, 2]
    own = [row for row in recorded(MISSION, "vehicle") if row["msg"] == "COMMAND_LONG"]
    assert own
    assert not any(isinstance(message, CommandLong) for message in heard(MISSION))


@pytest.mark.parametrize(
    ("path", "ours"),
    [
        (RETARGET, FLAVOUR.arm()),
        (RETARGET, FLAVOUR.takeoff(499.510009765625, 488.0)),
        (RETARGET, FLAVOUR.set_mission_mode()),
        (RETARGET, FLAVOUR.change_speed(5.0)),
        (RETARGET, FLAVOUR.reposition(47.3986015, 8.5455999, 500.9330139160156, -1.0)),
        (RETARGET, FLAVOUR.set_return_mode()),
    ],
)
def test_what_the_ground_said_is_what_we_would_say(
    path: Path, ours: CommandLong | CommandInt
) -> None:
    payload = slice(10, -2)
    said = {frame(rebuilt(row))[payload] for row in commanded(path, ours.command)}
    assert MavlinkCodec(1, source_component_id=190).encode(ours)[payload] in said


def test_the_scripted_px4_answers_as_the_recorded_one() -> None:
    rows = [row for row in recorded(RETARGET, "ground") if row["msg"].startswith("COMMAND")]
    px4 = FakePx4(ORIGIN)
    codec, answers = MavlinkCodec(1), []
    for step in range(round(40.0 / 0.1)):
        now_s = step * 0.1
        said = px4.advance(now_s)
        while rows and now_s >= rows[0]["t_s"] + 5.0:
            said += px4.receive(frame(rebuilt(rows.pop(0)), 255, 190), now_s)
        answers += [one.message for data in said for one in codec.decode(data)]
    acks = [answer for answer in answers if isinstance(answer, CommandAck)]
    # The identical mission that is not started again is not part of the scripted PX4.
    assert acks == of(CommandAck, RETARGET)[: len(acks)]
    assert len(acks) >= 14


# -- taking off -------------------------------------------------------------------------


def taking_off() -> BridgeFlight:
    flight = BridgeFlight(FakePx4(ORIGIN))
    flight.order(START)
    while not flight.copter.in_takeoff:
        flight.step()
    flight.run(1.5)
    assert flight.copter.mode == AUTO_TAKEOFF
    return flight


def test_it_is_not_up_before_it_loiters_again() -> None:
    flight = taking_off()
    while flight.copter.mode == AUTO_TAKEOFF:
        assert not {192, 178} & flight.copter.count().keys()
        flight.step()
    flight.run_until(VehicleReady())
    assert not [r for r in flight.reports if isinstance(r, HandedOver)]


def test_a_takeoff_that_is_repeated_late_does_not_interrupt_what_follows() -> None:
    flight = BridgeFlight(FakePx4(ORIGIN))
    flight.to_bridge = lambda data: [] if data[7] == 77 and data[10:12] == b"\x16\x00" else [data]
    flight.order(START)
    while not flight.copter.commands(192):
        flight.step()
    sent = len(flight.copter.commands(22))
    flight.run_until(VehicleReady())
    flight.run(10.0)
    assert len(flight.copter.commands(22)) == sent
    assert flight.bridge.phase is FlightPhase.HOVERING


def test_a_takeoff_that_never_ends_is_given_up() -> None:
    flight = taking_off()
    flight.copter.target_m = None
    advised = flight.run_until(ReturnAdvised)
    assert advised == ReturnAdvised("the vehicle took off and then stopped climbing")
    flight.order(Return("it failed"))
    flight.run_until(Home())


def test_called_home_while_it_takes_off_it_returns() -> None:
    flight = taking_off()
    flight.order(Return("abort"))
    flight.run_until(Home())
    assert not [r for r in flight.reports if isinstance(r, HandedOver)]


@pytest.mark.parametrize("order", [RESUME, Return("over", resume=True)])
def test_a_new_life_takes_over_a_takeoff_of_the_earlier_one(order: Prepare | Return) -> None:
    flight = taking_off().restart(down_s=0.5)
    flight.copter.heard.clear()
    flight.order(order)
    report = flight.run_until(VehicleReady, HandedOver, Home)
    if order is RESUME:
        assert report == VehicleReady()
        assert math.dist(flight.copter.position_m, START.position_enu_m) < 1.0
        assert not flight.copter.commands(22)
    else:
        assert report == Home()


def test_a_takeoff_that_is_not_ours_is_waited_out_and_not_repeated() -> None:
    flight = taking_off().restart(down_s=0.5)
    flight.copter.heard.clear()
    flight.order(START)
    flight.run(1.5)
    assert flight.reasons()[-1] == "waiting for the takeoff under way to end"
    assert set(flight.copter.count()) <= {511}
    flight.run(20.0)
    assert flight.copter.mode == AUTO_LOITER
    assert flight.reasons()[-1].startswith("flown by its pilot: land it")
    assert set(flight.copter.count()) <= {511}


def test_a_takeoff_of_the_pilot_in_flight_is_a_take_over() -> None:
    flight = BridgeFlight(FakePx4(ORIGIN)).flying()
    flight.copter.set_mode(AUTO_TAKEOFF)
    handed = flight.run_until(HandedOver)
    assert "AUTO.TAKEOFF" in str(handed)


def test_whether_it_flies_is_heard_before_anything_is_commanded() -> None:
    flight = BridgeFlight(FakePx4(ORIGIN)).flying().restart()
    flight.copter.deaf_to = {245}
    flight.copter.heard.clear()
    flight.order(RESUME)
    flight.run(3.0)
    assert flight.reasons()[-1] == "waiting to hear whether it flies (EXTENDED_SYS_STATE)"
    assert set(flight.copter.count()) <= {511}
    flight.copter.deaf_to = set()
    flight.run_until(VehicleReady())


# -- modes ------------------------------------------------------------------------------


def test_a_mode_of_its_own_that_a_pilot_left_set_is_changed_before_arming() -> None:
    flight = BridgeFlight(FakePx4(ORIGIN))
    flight.copter.mode = POSCTL
    flight.order(START)
    flight.run_until(VehicleReady())
    [sent] = flight.copter.commands(176)
    assert (sent.param1, sent.param2, sent.param3) == (1.0, 4.0, 3.0)


def test_after_landing_it_loiters_disarmed_and_is_home() -> None:
    flight = BridgeFlight(FakePx4(ORIGIN)).flying()
    flight.order(Return("over"))
    flight.run_until(Home())
    assert (flight.copter.armed, flight.copter.mode) == (False, AUTO_LOITER)
    flight.order(START)
    flight.run_until(VehicleReady())


def test_commands_of_the_vehicle_to_others_are_not_obeyed() -> None:
    flight = BridgeFlight(FakePx4(ORIGIN)).flying()
    flight.copter.heard.clear()
    for row in recorded(MISSION, "vehicle"):
        if row["msg"] == "COMMAND_LONG":
            flight.happen(BytesReceived(frame(rebuilt(row))))
    flight.run(5.0)
    assert not flight.copter.count()
    assert not flight.reports


def test_each_target_brings_the_cruise_speed() -> None:
    flight = BridgeFlight(FakePx4(ORIGIN)).prepared()
    flight.order(GoTo(1, (5.0, 40.0, 12.0)))
    assert flight.copter.speed_m_s == START.speed_m_s
