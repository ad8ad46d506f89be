"""Landing away from home, batteries that drain in flight, and their change at a base."""

from __future__ import annotations

import itertools
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.autopilot.config import ServedBase
from sim.autopilot.firmware.px4 import Px4Model
from tests.support.ground_station import ACCEPTED, GUIDED, GroundStation, ground_station, only, the

BASE = (0.0, 60.0, 2.0)
SWAP_S = 40.0
SERVED: dict[str, Any] = {
    "endurance_s": 400.0,
    "drains_in_flight": True,
    "bases": (ServedBase(BASE, SWAP_S),),
    "grounds_enu_m": ((0.0, 0.0, 0.0), BASE),
}
HOLD = 4, 3


def landed_at_the_base(ground: GroundStation) -> float:
    """Fly there and land by command; when the motors stood [s]."""
    ground.take_off(10.0)
    assert ground.reposition(BASE[0], BASE[1] - 3.0, 10.0) == ACCEPTED
    ground.wait(8.0)
    return landed(ground)


def landed(ground: GroundStation) -> float:
    assert ground.command(mavlink.MAV_CMD_NAV_LAND) == ACCEPTED
    for _ in range(400):
        ground.wait(0.1)
        if not ground.vehicle.pilot.armed:
            return ground.now_s
    raise AssertionError("still in the air")


def charge_percent(ground: GroundStation) -> int:
    ground.heard.clear()
    ground.command(mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_BATTERY_STATUS)
    return int(the(ground.heard, "BATTERY_STATUS").battery_remaining)


def heartbeats_s(ground: GroundStation) -> list[float]:
    pairs = zip(ground.heard, ground.heard_s[-len(ground.heard) :], strict=True)
    return [at_s for message, at_s in pairs if message.get_type() == "HEARTBEAT"]


def test_only_time_in_flight_drains_where_plans_count_it() -> None:
    ground = ground_station(**{**SERVED, "bases": (), "charge_frac": 0.9})
    ground.wait(5.0)
    ground.set_mode(GUIDED)
    ground.arm()
    ground.wait(8.0)
    assert ground.vehicle.pilot.battery.remaining_frac(ground.now_s) == 0.9

    assert ground.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, 10.0) == ACCEPTED
    lifted_s = ground.now_s
    ground.wait(20.0)
    down_s = landed(ground)
    left_frac = 0.9 - (down_s - lifted_s) / 400.0
    ground.wait(100.0)
    assert ground.vehicle.pilot.battery.remaining_frac(ground.now_s) == pytest.approx(
        left_frac, abs=0.1 / 400.0
    )


def test_landing_ends_on_the_ground_of_the_base_and_is_slow_near_it() -> None:
    ground = ground_station(**SERVED, land_m_s=0.5, descent_m_s=2.0)
    ground.take_off(30.0)
    ground.reposition(BASE[0], BASE[1], 30.0)
    ground.wait(8.0)
    began_s = ground.now_s
    down_s = landed(ground)

    assert ground.position_enu_m == pytest.approx(BASE, abs=0.02)
    # 18 m at 2 m/s, 10 m at 0.5 m/s, and a second to be sure.
    assert down_s - began_s == pytest.approx(9.0 + 20.0 + 1.0, abs=0.2)


def test_a_changed_battery_is_full_after_a_silence_and_in_time() -> None:
    ground = ground_station(**SERVED)
    down_s = landed_at_the_base(ground)
    assert charge_percent(ground) < 97
    ground.heard.clear()
    ground.wait(SWAP_S)

    heard_s = heartbeats_s(ground)
    pauses = [(a, b) for a, b in itertools.pairwise(heard_s) if b - a > 1.5]
    [(last_s, first_s)] = pauses
    # 5 s without power and 3 s of boot before the base's 40 s are over.
    assert last_s - down_s == pytest.approx(SWAP_S - 8.0, abs=1.1)
    assert first_s - down_s == pytest.approx(SWAP_S - 3.0, abs=0.2)
    assert charge_percent(ground) == 100
    assert ground.set_mode(GUIDED) == ACCEPTED
    assert ground.arm() == ACCEPTED


def test_nothing_is_heard_nor_said_without_power() -> None:
    ground = ground_station(**SERVED)
    landed_at_the_base(ground)
    ground.wait(SWAP_S - 6.0)
    before = len(ground.heard)

    ping = mavlink.MAVLink_ping_message(0, 7, 0, 0)
    assert ground.send(ping) == []
    assert ground.wait(1.0) == []
    assert len(ground.heard) == before


def test_it_takes_off_again_from_the_base_with_its_home_there() -> None:
    ground = ground_station(**SERVED)
    landed_at_the_base(ground)
    ground.wait(SWAP_S)
    ground.heard.clear()
    ground.set_mode(GUIDED)
    assert ground.arm() == ACCEPTED
    assert ground.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, 10.0) == ACCEPTED
    ground.wait(5.0)

    assert ground.vehicle.pilot.flight.home_enu_m == pytest.approx((0.0, 57.0, 2.0), abs=0.01)
    assert ground.position_enu_m == pytest.approx((0.0, 57.0, 12.0), abs=0.01)


def test_batteries_that_overlap_cut_no_power() -> None:
    ground = ground_station(**SERVED, swap_reboots=False)
    landed_at_the_base(ground)
    boot_s = ground.vehicle.pilot.readiness.boot_s
    ground.wait(SWAP_S - 2.0)
    assert charge_percent(ground) < 97
    ground.wait(3.0)

    assert charge_percent(ground) == 100
    assert ground.vehicle.pilot.readiness.boot_s == boot_s


def test_nobody_changes_a_battery_away_from_a_base_or_before_a_flight() -> None:
    away = ground_station(**{**SERVED, "start_enu_m": (0.0, -20.0, 0.0)})
    away.take_off(10.0)
    landed(away)
    away.wait(2.0 * SWAP_S)
    assert charge_percent(away) < 100

    fresh = ground_station(**{**SERVED, "start_enu_m": BASE, "charge_frac": 0.5})
    fresh.wait(2.0 * SWAP_S)
    assert charge_percent(fresh) == 50


def test_who_is_armed_before_keeps_its_battery() -> None:
    ground = ground_station(**SERVED)
    landed_at_the_base(ground)
    ground.wait(10.0)
    ground.set_mode(GUIDED)
    ground.arm()
    ground.wait(SWAP_S)

    assert charge_percent(ground) < 97


def test_a_late_call_changes_nothing_of_it() -> None:
    ground = ground_station(**SERVED)
    down_s = landed_at_the_base(ground)
    ground.now_s = down_s + 10.0 * SWAP_S
    ground.send(mavlink.MAVLink_ping_message(0, 7, 0, 0))

    assert charge_percent(ground) == 100
    assert ground.vehicle.pilot.readiness.boot_s == pytest.approx(down_s + SWAP_S - 3.0, abs=0.2)


def test_px4_says_where_it_lands_and_has_its_home_there() -> None:
    ground = ground_station(Px4Model())
    ground.wait(5.0)
    ground.set_mode(*HOLD)
    assert ground.arm() == ACCEPTED
    ground.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, 498.0)
    ground.wait(10.0)
    lat_e7, lon_e7 = ground.place_e7(0.0, 30.0)
    ground.command_int(mavlink.MAV_CMD_DO_REPOSITION, 5, lat_e7, lon_e7, 498.0, -1.0, 1.0)
    ground.wait(10.0)
    ground.heard.clear()
    landed(ground)

    assert "Landing at current position\t" in ground.texts()
    assert only(ground.heard, "HOME_POSITION")
    assert ground.vehicle.pilot.flight.home_enu_m == pytest.approx((0.0, 30.0, 0.0), abs=0.02)
