"""The battery: what is measured of it, and what the firmware does when it is low."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.autopilot.battery import BatteryModel, ChargeLevel
from sim.autopilot.config import BatteryFailsafe
from tests.support.ground_station import GroundStation, ground_station, only

FAILSAFE = BatteryFailsafe(low_frac=0.2, critical_frac=0.1)


def texts_since(ground: GroundStation, before: int) -> list[str]:
    return ground.texts()[before:]


def test_reports_agree_with_each_other() -> None:
    ground = ground_station(endurance_s=100.0)
    ground.take_off(10.0)  # armed at 5 s
    ground.wait(45.0 - ground.now_s)
    for message_id in (mavlink.MAVLINK_MSG_ID_SYS_STATUS, mavlink.MAVLINK_MSG_ID_BATTERY_STATUS):
        ground.command(mavlink.MAV_CMD_REQUEST_MESSAGE, message_id)
    [status] = only(ground.heard, "SYS_STATUS")
    [battery] = only(ground.heard, "BATTERY_STATUS")

    assert status.battery_remaining == battery.battery_remaining == 60
    assert status.voltage_battery == battery.voltages[0] == round(10_500 + 0.6 * 2100)
    assert status.current_battery == battery.current_battery == 3000
    used_mah = 30.0 * 40.0 / 3600.0 * 1e3
    assert battery.current_consumed == round(used_mah)


def test_low_battery_is_told_and_brings_the_vehicle_home_and_a_critical_one_down() -> None:
    ground = ground_station(endurance_s=100.0, battery_failsafe=FAILSAFE)
    ground.take_off(10.0)
    ground.reposition(0.0, 4000.0, 10.0)
    ground.wait(84.9 - ground.now_s)
    before = len(ground.texts())
    ground.wait(0.2)
    assert only(ground.heard, "HEARTBEAT")[-1].custom_mode == 6
    assert texts_since(ground, before) == [
        "Battery 1 is low 10.92V used 667 mAh",
        "Battery Failsafe",
    ]

    ground.wait(10.0)
    assert only(ground.heard, "HEARTBEAT")[-1].custom_mode == 9
    assert "Battery 1 is critical 10.71V used 750 mAh" in texts_since(ground, before)
    assert ground.texts().count("Battery Failsafe") == 2


def test_low_battery_on_the_ground_stops_the_motors() -> None:
    ground = ground_station(battery_failsafe=FAILSAFE)
    ground.wait(5.0)
    ground.set_mode(4)
    ground.arm()
    ground.vehicle.pilot.battery.drop_to(0.15, ground.now_s)
    ground.wait(0.1)

    assert ground.texts()[-1] == "Disarming motors"


def test_firmware_without_a_failsafe_flies_until_the_battery_is_empty() -> None:
    ground = ground_station(endurance_s=20.0)
    ground.take_off(10.0)
    ground.wait(30.0)

    assert ground.vehicle.pilot.battery.remaining_frac(ground.now_s) == 0.0
    assert only(ground.heard, "HEARTBEAT")[-1].custom_mode == 4


def test_battery_that_falls_through_both_levels_is_critical_at_once() -> None:
    battery = BatteryModel(None, FAILSAFE)
    battery.start(3.0)
    battery.drop_to(0.05, 8.0)

    assert battery.deadline_s() == 8.0
    assert battery.advance(8.0) is ChargeLevel.CRITICAL
    assert battery.deadline_s() is None


@given(
    endurance_s=st.floats(1.0, 1e4),
    flights_s=st.lists(st.tuples(st.floats(0.0, 1e3), st.floats(0.0, 1e3)), max_size=5),
)
def test_charge_falls_by_armed_time_only(
    endurance_s: float, flights_s: list[tuple[float, float]]
) -> None:
    battery = BatteryModel(endurance_s, None)
    now_s = 0.0
    for pause_s, flight_s in flights_s:
        now_s += pause_s
        battery.start(now_s)
        now_s += flight_s
        battery.stop(now_s)

    armed_s = sum(flight_s for _, flight_s in flights_s)
    left_frac = max(0.0, 1.0 - armed_s / endurance_s)
    assert battery.remaining_frac(now_s + 50.0) == pytest.approx(left_frac, abs=1e-9)


@given(endurance_s=st.floats(1.0, 1e4), start_s=st.floats(0.0, 1e6))
def test_each_level_is_reached_once_and_in_order(endurance_s: float, start_s: float) -> None:
    battery = BatteryModel(endurance_s, FAILSAFE)
    battery.start(start_s)
    levels = []
    while (deadline_s := battery.deadline_s()) is not None:
        levels.append(battery.advance(deadline_s))

    assert levels == [ChargeLevel.LOW, ChargeLevel.CRITICAL]


@pytest.mark.parametrize(("low", "critical"), [(0.1, 0.2), (1.2, 0.1), (0.2, -0.1)])
def test_failsafe_charges_must_be_in_order(low: float, critical: float) -> None:
    with pytest.raises(ValueError, match="charges must be"):
        BatteryFailsafe(low, critical)
