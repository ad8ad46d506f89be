"""What the simulated vehicle says and does on PX4 when something goes wrong on request."""

from __future__ import annotations

import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.autopilot.config import BatteryFailsafe, VehicleConfig
from sim.autopilot.faults import parse_fault
from sim.autopilot.firmware.px4 import Px4Model
from sim.autopilot.vehicle import SimulatedAutopilot
from tests.support.ground_station import ACCEPTED, GroundStation, only

HOLD, RETURN, LAND, POSITION = (4, 3), (4, 5), (4, 6), (3, 0)


def airborne(*texts: str, **config: Any) -> GroundStation:
    """A vehicle that is armed at 5 s and holds its place 10 m above home at 12 s."""
    parts = VehicleConfig(**{"system_id": 1, "spool_up_s": 0.0, **config})
    faults = tuple(parse_fault(f"uav1:{text}")[1] for text in texts)
    ground = GroundStation(SimulatedAutopilot(parts, Px4Model(), 0.0), faults=faults)
    ground.wait(5.0)
    assert ground.arm() == ACCEPTED
    nan, alt_m = math.nan, parts.origin.alt_m + 10.0
    take_off = mavlink.MAV_CMD_NAV_TAKEOFF
    assert ground.command(take_off, 0, 0, 0, nan, nan, nan, alt_m) == ACCEPTED
    ground.wait(7.0)
    return ground


def mode(ground: GroundStation) -> tuple[int, int]:
    """Main and sub mode in the next heartbeat."""
    ground.wait(1.0)
    custom_mode = only(ground.heard, "HEARTBEAT")[-1].custom_mode
    return custom_mode >> 16 & 0xFF, custom_mode >> 24


def test_pilot_flies_in_position_mode_and_gives_back() -> None:
    ground = airborne("pilot@10+5")
    assert mode(ground) == HOLD
    ground.wait(3.0)
    assert mode(ground) == POSITION
    ground.wait(5.0)
    assert mode(ground) == HOLD


@pytest.mark.parametrize(
    ("fault", "config", "reaction"),
    [
        ("failsafe-rtl@10", {}, RETURN),
        ("battery-low=0.15@10", {"battery_failsafe": BatteryFailsafe()}, RETURN),
        ("battery-low=0.05@10", {"battery_failsafe": BatteryFailsafe()}, LAND),
        ("gps-lost@8", {"position_failsafe_s": 2.0}, LAND),
    ],
)
def test_failsafes_change_the_mode_with_the_same_words(
    fault: str, config: dict[str, Any], reaction: tuple[int, int]
) -> None:
    ground = airborne(fault, **config)
    assert mode(ground) == HOLD
    ground.wait(2.5)

    if reaction == RETURN:
        assert mode(ground) == HOLD
        assert ground.texts()[-1] == "Failsafe activated: entering Hold for 5 seconds\t"
        ground.wait(5.0)
    assert mode(ground) == reaction
    assert "Failsafe activated\t" in ground.texts()
    ground.wait(60.0)
    assert not ground.vehicle.pilot.armed


def test_stuck_vehicle_acknowledges_a_target_and_stays() -> None:
    ground = airborne("stuck@1")
    held = ground.position_enu_m
    lat_e7, lon_e7 = ground.place_e7(0.0, 40.0)
    alt_m = ground.vehicle.config.origin.alt_m + 10.0
    reposition, frame = mavlink.MAV_CMD_DO_REPOSITION, mavlink.MAV_FRAME_GLOBAL_INT
    assert ground.command_int(reposition, frame, lat_e7, lon_e7, alt_m, -1.0, 1.0) == ACCEPTED
    ground.wait(20.0)

    assert ground.position_enu_m == held


def test_vehicle_without_gps_says_that_it_is_not_healthy_and_streams_its_last_place() -> None:
    ground = airborne("gps-lost@8")
    ground.wait(3.0)
    before = len(ground.heard)
    ground.wait(3.0)
    heard = ground.heard[before:]

    gps = mavlink.MAV_SYS_STATUS_SENSOR_GPS
    assert not only(heard, "SYS_STATUS")[-1].onboard_control_sensors_health & gps
    assert {(each.lat, each.vx) for each in only(heard, "GLOBAL_POSITION_INT")} == {
        (ground.place_e7(0.0, 0.0)[0], 0)
    }
