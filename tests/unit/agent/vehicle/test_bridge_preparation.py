"""From power-up to hovering at the start."""

from __future__ import annotations

import itertools
import math

import pytest

from agent.core.interface import (
    FlightLimits,
    HandedOver,
    Home,
    NotReady,
    Refused,
    Return,
    ReturnAdvised,
    VehicleReady,
)
from agent.vehicle.activity import FlightPhase
from agent.vehicle.config import BridgeConfig
from tests.support.bridge_flight import ORIGIN, START, BridgeFlight
from tests.support.fake_copter import (
    ARM,
    ASK,
    BUSY,
    DENIED,
    FAILED,
    INTERVAL,
    REPOSITION,
    SET_MODE,
    SPEED,
    TAKEOFF,
    UNSUPPORTED,
    FakeCopter,
)
from tests.support.fake_px4 import FakePx4


def test_vehicle_is_prepared_step_by_step_and_hovers_at_its_start(fake: type[FakeCopter]) -> None:
    flight = BridgeFlight(fake(ORIGIN))
    flight.order(START)
    flight.run_until(VehicleReady())

    assert math.dist(flight.copter.position_m, START.position_enu_m) < 1.0
    assert flight.copter.speed_m_s == START.speed_m_s
    order = [m.command for m in flight.copter.heard if hasattr(m, "command")]
    steps = [c for c in order if c not in (INTERVAL, ASK)]
    boots_into_another_mode = [SET_MODE] if fake.boot_mode != fake.own_mode else []
    assert steps == [*boots_into_another_mode, ARM, TAKEOFF, REPOSITION, SPEED]
    assert flight.bridge.phase is FlightPhase.HOVERING


def test_reasons_for_waiting_change_as_the_vehicle_gets_ready(fake: type[FakeCopter]) -> None:
    flight = BridgeFlight(fake(ORIGIN))
    flight.order(START)
    flight.run_until(VehicleReady())

    reasons = flight.reasons()
    assert reasons[0] == "waiting for a heartbeat of system id 1"
    ardupilots = ("setting GUIDED", "position estimate") if fake is FakeCopter else ()
    for words in ("booting", *ardupilots, "arming", "climbing", "start"):
        assert any(words in reason for reason in reasons), (words, reasons)
    assert all(a != b for a, b in itertools.pairwise(reasons))


@pytest.mark.parametrize("ready_s", [15.0, 60.0])
def test_vehicle_whose_position_comes_late_takes_off_as_any_other(
    fake: type[FakeCopter], ready_s: float
) -> None:
    flight = BridgeFlight(fake(ORIGIN, ready_s=ready_s))
    flight.order(START)
    flight.run(ready_s - 1.0)
    assert not flight.copter.commands(ARM)
    flight.run_until(VehicleReady())
    assert math.dist(flight.copter.position_m, START.position_enu_m) < 1.0
    assert {type(report) for report in flight.reports} == {NotReady, FlightLimits, VehicleReady}


@pytest.mark.parametrize("met_s", [1.0, 30.0])
def test_position_that_is_lost_on_the_ground_and_comes_back_is_forgiven(
    fake: type[FakeCopter], met_s: float
) -> None:
    flight = BridgeFlight(fake(ORIGIN))
    flight.run(met_s)
    flags, flight.copter.ekf_flags = flight.copter.ekf_flags, 167
    flight.run(1.0)
    flight.order(START)
    flight.run(20.0)
    assert not flight.copter.commands(ARM)
    flight.copter.ekf_flags = flags
    flight.run_until(VehicleReady())


def test_mode_is_not_set_before_boot_has_ended(fake: type[FakeCopter]) -> None:
    flight = BridgeFlight(fake(ORIGIN, boot_s=5.0, ready_s=6.0))
    flight.order(START)
    flight.run(4.5)
    assert not flight.copter.commands(SET_MODE)

    flight.run_until(VehicleReady())


def test_ground_station_heartbeat_comes_every_second(fake: type[FakeCopter]) -> None:
    flight = BridgeFlight(fake(ORIGIN))
    flight.run(10.0)
    beats = [m for m in flight.copter.heard if m.get_type() == "HEARTBEAT"]
    assert 10 <= len(beats) <= 11
    assert {(m.type, m.get_srcSystem(), m.get_srcComponent()) for m in beats} == {(6, 255, 191)}


def test_refused_arming_is_tried_again_and_the_reason_is_told(fake: type[FakeCopter]) -> None:
    flight = BridgeFlight(fake(ORIGIN))
    flight.copter.verdicts[ARM] = [FAILED, FAILED]
    flight.order(START)
    flight.run_until(VehicleReady())

    assert len(flight.copter.commands(ARM)) == 3
    assert any("arming refused (failed)" in reason for reason in flight.reasons())


def test_arming_that_is_refused_for_ever_ends_the_preparation(fake: type[FakeCopter]) -> None:
    flight = BridgeFlight(fake(ORIGIN))
    flight.copter.verdicts[ARM] = [FAILED] * 1000
    flight.order(START)
    refused = flight.run_until(Refused, limit_s=120.0)

    assert refused == Refused(START, "arming failed 15 times; last answer: failed")
    assert flight.bridge.phase is FlightPhase.IDLE
    heard = len(flight.copter.heard)
    flight.run(10.0)
    assert not [m for m in flight.copter.heard[heard:] if getattr(m, "command", None) == ARM]


def test_text_of_the_autopilot_explains_a_failing_check(fake: type[FakeCopter]) -> None:
    copter = fake(ORIGIN)
    copter.prearm_ok = False
    flight = BridgeFlight(copter)
    flight.order(START)
    flight.run(8.0)
    copter.text(2, "PreArm: Battery 1 low")
    flight.run(1.0)

    assert flight.reasons()[-1] == "pre-arm checks do not pass (PreArm: Battery 1 low)"
    assert not copter.commands(ARM)


def test_takeoff_that_is_refused_briefly_is_asked_again(fake: type[FakeCopter]) -> None:
    flight = BridgeFlight(fake(ORIGIN))
    flight.copter.verdicts[TAKEOFF] = [BUSY, FAILED, DENIED]
    flight.order(START)
    flight.run_until(VehicleReady())
    assert len(flight.copter.commands(TAKEOFF)) == 4


def test_vehicle_that_disarms_itself_on_the_ground_is_armed_again(fake: type[FakeCopter]) -> None:
    flight = BridgeFlight(fake(ORIGIN))
    flight.copter.verdicts[TAKEOFF] = [None] * 12  # silent for longer than it stays armed
    flight.order(START)
    flight.run_until(VehicleReady())
    assert len(flight.copter.commands(ARM)) == 2


@pytest.mark.parametrize("command", [SET_MODE, ARM, TAKEOFF, REPOSITION, SPEED, INTERVAL])
def test_lost_acknowledgement_is_made_good_by_sending_again(
    fake: type[FakeCopter], command: int
) -> None:
    flight = BridgeFlight(fake(ORIGIN))
    flight.copter.mode = fake.pilot_mode
    flight.copter.verdicts[command] = [None, None]
    flight.order(START)
    flight.run_until(VehicleReady())

    again = flight.copter.commands(command)
    assert len(again) >= 3
    if again[0].get_type() == "COMMAND_LONG":
        assert [m.confirmation for m in again[:3]] == [0, 1, 2]


def test_acknowledgement_lost_after_the_deed_does_no_harm(fake: type[FakeCopter]) -> None:
    lost: list[bytes] = []

    def lose_first_acks(data: bytes) -> list[bytes]:
        if data[7] == 77 and len(lost) < 12:
            lost.append(data)
            return []
        return [data]

    flight = BridgeFlight(fake(ORIGIN), to_bridge=lose_first_acks)
    flight.order(START)
    flight.run_until(VehicleReady())
    assert len(lost) == 12


def test_wrong_system_id_is_never_commanded_and_named(fake: type[FakeCopter]) -> None:
    flight = BridgeFlight(fake(ORIGIN, system_id=7))
    flight.order(START)
    flight.run(10.0)

    assert flight.reasons()[-1] == "heard the vehicle with system id 7, not 1"
    assert flight.bridge.contact.foreign[7] >= 9
    assert {m.get_type() for m in flight.copter.heard} == {"HEARTBEAT"}


def test_other_component_of_the_right_system_is_not_the_autopilot(fake: type[FakeCopter]) -> None:
    copter = fake(ORIGIN)
    copter.component_id = 154
    flight = BridgeFlight(copter)
    flight.order(START)
    flight.run(5.0)
    assert {m.get_type() for m in copter.heard} == {"HEARTBEAT"}


@pytest.mark.parametrize(("mav_type", "autopilot"), [(12, 3), (10, 12), (22, 12), (2, 18)])
def test_unsupported_vehicle_is_named_and_left_alone(
    fake: type[FakeCopter], mav_type: int, autopilot: int
) -> None:
    copter = fake(ORIGIN)
    copter.mav_type, copter.autopilot = mav_type, autopilot
    flight = BridgeFlight(copter)
    flight.order(START)
    flight.run(5.0)
    assert "is not supported" in flight.reasons()[-1]
    assert not copter.count()


@pytest.mark.parametrize(
    ("fake", "stream", "name"),
    [
        (FakeCopter, 193, "EKF_STATUS_REPORT"),
        (FakeCopter, 1, "SYS_STATUS"),
        (FakePx4, 1, "SYS_STATUS"),
        (FakePx4, 33, "position"),
    ],
)
def test_stream_that_does_not_come_is_asked_for_again(
    fake: type[FakeCopter], stream: int, name: str
) -> None:
    flight = BridgeFlight(fake(ORIGIN))
    flight.copter.deaf_to = {stream}
    flight.order(START)
    flight.run(15.0)
    asked = [m for m in flight.copter.commands(INTERVAL) if m.param1 == stream]
    assert len(asked) >= 3
    assert name in flight.reasons()[-1]

    flight.copter.deaf_to = set()
    flight.run_until(VehicleReady())


def test_streams_are_asked_for_at_the_configured_rates(fake: type[FakeCopter]) -> None:
    flight = BridgeFlight(fake(ORIGIN), config=BridgeConfig(1, ORIGIN, position_rate_hz=10.0))
    flight.run(3.0)
    asked = {int(m.param1): m.param2 for m in flight.copter.commands(INTERVAL)}
    assert asked[33] == 100_000.0
    assert set(asked) == fake.streams_asked


def test_speed_goes_by_parameter_if_the_command_is_refused(fake: type[FakeCopter]) -> None:
    copter = fake(ORIGIN)
    copter.verdicts[SPEED] = [UNSUPPORTED] * 99
    name = fake.speed_names[-1]
    del copter.parameters[fake.speed_names[0]]
    copter.parameters[name] = 1000.0
    flight = BridgeFlight(copter)
    flight.order(START)
    flight.run_until(VehicleReady())

    assert copter.parameters[name] == (400.0 if name == "WPNAV_SPEED" else 4.0)
    asked = {m.param_id for m in copter.heard if m.get_type() == "PARAM_REQUEST_READ"}
    others = fake.failsafe_names | fake.limit_names | set(fake.jerk_names)
    assert asked - others == set(fake.speed_names)


def test_speed_that_cannot_be_set_at_all_is_said(fake: type[FakeCopter]) -> None:
    copter = fake(ORIGIN)
    copter.verdicts[SPEED] = [FAILED] * 99
    del copter.parameters[fake.speed_names[0]]
    flight = BridgeFlight(copter)
    flight.order(START)
    advised = flight.run_until(ReturnAdvised)
    assert isinstance(advised, ReturnAdvised)
    assert " or ".join(fake.speed_names) in advised.reason


def test_reboot_before_arming_begins_the_preparation_anew(fake: type[FakeCopter]) -> None:
    copter = fake(ORIGIN, ready_s=20.0)
    flight = BridgeFlight(copter)
    flight.order(START)
    flight.run(10.0)
    copter.ready_s = 3.0
    copter.power_on(flight.now_s)
    flight.run_until(VehicleReady())
    assert not [r for r in flight.reports if isinstance(r, HandedOver)]


def test_silence_before_arming_is_waited_out(fake: type[FakeCopter]) -> None:
    copter = fake(ORIGIN, ready_s=20.0)
    flight = BridgeFlight(copter)
    flight.order(START)
    flight.run(5.0)
    copter.silent = True
    flight.run(10.0)
    assert flight.reports[-1] == NotReady("waiting for a heartbeat of system id 1")
    copter.silent = False
    flight.run_until(VehicleReady())


def test_return_during_preparation_on_the_ground_is_home_at_once(fake: type[FakeCopter]) -> None:
    flight = BridgeFlight(fake(ORIGIN))
    flight.order(START)
    flight.run(2.0)
    assert flight.order(Return("abort")) == [Home()]
    flight.copter.heard.clear()
    flight.run(10.0)
    assert set(flight.copter.count()) <= {INTERVAL}


def test_return_of_an_armed_vehicle_on_the_ground_disarms_it(fake: type[FakeCopter]) -> None:
    flight = BridgeFlight(fake(ORIGIN))
    flight.copter.verdicts[TAKEOFF] = [None] * 99
    flight.order(START)
    while not flight.copter.armed:
        flight.step()
    assert flight.order(Return("abort")) == [Home()]
    flight.run(2.0)
    assert not flight.copter.armed


def test_climb_that_stops_ends_the_preparation(fake: type[FakeCopter]) -> None:
    flight = BridgeFlight(fake(ORIGIN))
    flight.order(START)
    while flight.copter.position_m[2] < 4.0:
        flight.step()
    flight.copter.target_m = None
    advised = flight.run_until(ReturnAdvised)
    assert advised == ReturnAdvised("the vehicle took off and then stopped climbing")

    flight.order(Return("it failed"))
    flight.run_until(Home())


def test_another_firmware_under_the_same_ids_is_spoken_to_in_its_own_terms() -> None:
    flight = BridgeFlight(FakeCopter(ORIGIN, boot_s=30.0))
    flight.order(START)
    flight.run(2.0)
    flight.copter.autopilot, flight.copter.boot_s = 12, 0.0
    flight.run(5.0)

    modes = [(m.param2, m.param3) for m in flight.copter.commands(SET_MODE)]
    assert modes
    assert set(modes) == {(4.0, 3.0)}, "AUTO.LOITER of PX4"
