"""How sure the guards are before they speak."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from agent.vehicle.config import BridgeConfig
from agent.vehicle.firmware.ardupilot import ArduCopter
from agent.vehicle.firmware.px4 import Px4Copter
from agent.vehicle.messages import Heartbeat
from agent.vehicle.state import VehicleState
from agent.vehicle.supervision import SafetyMonitor
from tests.support.bridge_flight import ORIGIN

CONFIG = BridgeConfig(1, ORIGIN, fence_radius_m=100.0, fence_height_m=50.0)
BEAT = Heartbeat(vehicle_type=2, autopilot=3, armed=True, custom_mode=4, system_status=4)
FLAVOUR = ArduCopter()


def advice(safety: SafetyMonitor, now_s: float = 0.0) -> str | None:
    return safety.advice(VehicleState(heartbeat=BEAT), FLAVOUR, now_s)


@given(st.lists(st.floats(0.0, 1.0), max_size=30))
def test_a_battery_is_low_if_its_last_five_readings_are_and_again_when_it_has_halved(
    readings: list[float],
) -> None:
    safety = SafetyMonitor(CONFIG)
    told_frac: float | None = None
    for number, frac in enumerate(readings):
        safety.on_charge(frac)
        last = readings[: number + 1][-5:]
        low = [frac for frac in last if frac < 0.2]
        assert (safety.arming_objection(VehicleState(), float(number)) is not None) == bool(low)
        limit_frac = 0.2 if told_frac is None else told_frac / 2.0
        due = len([frac for frac in last if frac < limit_frac]) == 5
        assert (advice(safety) is not None) == due
        if due:
            told_frac = last[-1]


@given(st.lists(st.booleans(), max_size=40), st.floats(0.05, 0.5))
def test_a_vehicle_is_outside_if_it_was_for_a_second_and_five_positions(
    outside: list[bool], interval_s: float
) -> None:
    safety = SafetyMonitor(CONFIG)
    run, told = 0, False
    for number, out in enumerate(outside):
        now_s = number * interval_s
        safety.on_position((111.0 if out else 109.0, 0.0, 10.0), None, now_s)
        run = run + 1 if out else 0
        due = run >= 5 and now_s - (number - run + 1) * interval_s >= 1.0
        assert (advice(safety, now_s) is not None) == (due and not told)
        told = told or due


def test_what_was_advised_in_one_flight_is_advised_again_in_the_next() -> None:
    safety = SafetyMonitor(CONFIG)
    for _ in range(5):
        safety.on_charge(0.1)
    assert advice(safety) == "battery at 10%, below the reserve of 20%"
    assert advice(safety) is None
    safety.begin()
    assert advice(safety) == "battery at 10%, below the reserve of 20%"


def test_each_thing_is_advised_once_whatever_else_was() -> None:
    safety = SafetyMonitor(CONFIG)
    for number in range(6):
        safety.on_position((111.0, 0.0, 10.0), None, float(number))
    assert advice(safety, 5.0) == "111 m from the origin, outside the fence of 100 m"
    assert advice(safety, 5.0) is None
    for _ in range(5):
        safety.on_charge(0.1)
    assert advice(safety, 6.0) == "battery at 10%, below the reserve of 20%"
    alarmed = VehicleState(heartbeat=Heartbeat(2, 12, True, 0x3040000, 5))
    alarm = safety.advice(alarmed, Px4Copter(), 6.0)
    assert alarm == "the autopilot reports a failsafe"
    assert safety.advice(alarmed, Px4Copter(), 7.0) is None


def test_height_is_fenced_above_and_below() -> None:
    for up_m, words in ((70.0, "70 m above"), (-70.0, "70 m below")):
        safety = SafetyMonitor(CONFIG)
        for number in range(6):
            safety.on_position((0.0, 0.0, up_m), None, float(number))
        assert advice(safety, 5.0) == f"{words} the origin, outside the fence of 50 m"


def test_a_position_is_lost_only_if_heartbeats_come() -> None:
    safety = SafetyMonitor(CONFIG)
    safety.on_position((0.0, 0.0, 10.0), None, 0.0)
    assert safety.position_lost(60.0) is None
    for number in range(3):
        safety.on_message(BEAT, 60.0 + number)
    assert safety.position_lost(62.0) == "no valid position for 5 s"
    safety.on_position((0.0, 0.0, 10.0), "the estimate is lost", 63.0)
    assert safety.position_lost(63.0) == "no valid position for 5 s (the estimate is lost)"
    safety.on_position((0.0, 0.0, 10.0), None, 64.0)
    assert safety.position_lost(64.0) is None


def test_a_vehicle_that_never_told_a_position_has_none() -> None:
    safety = SafetyMonitor(CONFIG)
    for number in range(7):
        safety.on_message(BEAT, float(number))
    assert safety.position_lost(6.0) == "no valid position for 5 s"
