"""A vehicle is stopped at any moment, and goes on afterwards."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from agent.core.interface import (
    Arrived,
    GoTo,
    HandedOver,
    Held,
    Hold,
    Home,
    Refused,
    Return,
    VehicleReady,
)
from agent.vehicle.activity import FlightPhase
from agent.vehicle.config import BridgeConfig
from swarm.model.frames import enu_from_wgs84
from tests.support.bridge_flight import ORIGIN, START, BridgeFlight
from tests.support.fake_copter import ARM, DENIED, INTERVAL, REPOSITION, SET_MODE, FakeCopter
from tests.support.fake_px4 import FakePx4

HOLD = Hold("the operator says so")
RESUME = replace(START, resume=True)
FAR, NORTH = (205.0, 0.0, 12.0), (5.0, 40.0, 12.0)


def under_way(flight: BridgeFlight) -> BridgeFlight:
    flight.prepared()
    flight.order(GoTo(1, FAR))
    flight.run(10.0)
    assert flight.copter.velocity_m_s[0] > 3.0
    return flight


def hovers(flight: BridgeFlight) -> bool:
    """Stands in the air, in the mode that takes targets, and stays there."""
    copter = flight.copter
    place_m = copter.position_m
    flight.run(3.0)
    still = math.dist(place_m, copter.position_m) < 0.1
    return still and copter.airborne and copter.armed and copter.mode == copter.own_mode


def goes_on(flight: BridgeFlight) -> None:
    """Prepare it anew, fly somewhere, and come home."""
    flight.reports.clear()
    flight._read = 0
    flight.order(RESUME)
    flight.run_until(VehicleReady())
    flight.order(GoTo(9, NORTH))
    flight.run_until(Arrived(9))
    flight.order(Return("mission ended"))
    flight.run_until(Home())
    assert not any(isinstance(r, Refused | HandedOver) for r in flight.reports)


# -- from every state -------------------------------------------------------------------


def test_flight_is_stopped_and_its_leg_given_up(flight: BridgeFlight) -> None:
    under_way(flight)
    before_m = flight.copter.position_m
    flight.order(HOLD)
    flight.run(5.0)
    assert flight.seen == [Held()]
    assert math.dist(before_m, flight.copter.position_m) < 5.0
    assert hovers(flight)
    assert flight.bridge.phase is FlightPhase.HOVERING
    assert flight.reports == []
    goes_on(flight)


def test_targets_are_taken_at_once_after_a_hold(flight: BridgeFlight) -> None:
    under_way(flight)
    flight.order(HOLD)
    flight.order(GoTo(2, NORTH))
    flight.run_until(Arrived(2))
    assert flight.reports == [Arrived(2)]
    flight.order(HOLD)
    flight.run(5.0)
    flight.order(GoTo(3, START.position_enu_m))
    flight.run_until(Arrived(3))
    assert flight.reports == [Arrived(2), Arrived(3)]


def test_return_is_stopped_and_given_up(flight: BridgeFlight) -> None:
    under_way(flight)
    flight.order(Return("mission ended"))
    flight.run(3.0)
    assert flight.copter.mode == flight.copter.return_mode
    flight.order(HOLD)
    flight.run(5.0)
    assert hovers(flight)
    assert flight.reports == []
    goes_on(flight)


def test_vehicle_that_is_being_stopped_is_prepared_or_called_home_too(
    flight: BridgeFlight,
) -> None:
    under_way(flight)
    flight.order(Return("mission ended"))
    flight.run(3.0)
    flight.order(HOLD)
    goes_on(flight)


def test_return_under_way_ends_in_a_preparation(flight: BridgeFlight) -> None:
    under_way(flight)
    flight.order(Return("mission ended"))
    flight.run(3.0)
    goes_on(flight)


def test_held_vehicle_is_called_home_at_once(flight: BridgeFlight) -> None:
    under_way(flight)
    flight.order(HOLD)
    flight.order(Return("mission ended"))
    flight.run_until(Home())
    assert flight.reports == [Home()]


def test_climb_is_stopped(flight: BridgeFlight) -> None:
    flight.order(START)
    while flight.copter.position_m[2] < 4.0:
        flight.step()
    flight.order(HOLD)
    flight.run(5.0)
    assert hovers(flight)
    assert flight.copter.position_m[2] < 8.0
    assert VehicleReady() not in flight.reports
    goes_on(flight)


def test_vehicle_that_is_not_ready_yet_stays_on_the_ground(flight: BridgeFlight) -> None:
    flight.copter.prearm_ok = False
    flight.order(START)
    flight.run(5.0)
    flight.order(HOLD)
    flight.copter.prearm_ok = True
    flight.run(20.0)
    assert not flight.copter.armed
    assert not flight.copter.commands(ARM)
    assert flight.bridge.phase is FlightPhase.IDLE
    goes_on(flight)


def test_armed_vehicle_on_the_ground_is_disarmed(flight: BridgeFlight) -> None:
    flight.order(START)
    while not flight.copter.armed:
        flight.step()
    flight.order(HOLD)
    flight.run(2.0)
    assert not flight.copter.armed
    assert not flight.copter.airborne
    flight.run(20.0)
    assert not flight.copter.airborne
    assert VehicleReady() not in flight.reports
    goes_on(flight)


def test_vehicle_told_to_arm_is_disarmed_before_it_is_seen_armed(flight: BridgeFlight) -> None:
    flight.copter.verdicts[ARM] = [None]
    flight.order(START)
    while not flight.copter.commands(ARM):
        flight.step()
    flight.order(HOLD)
    flight.run(5.0)
    assert [m.param1 for m in flight.copter.commands(ARM)][-1] == 0.0
    assert not flight.copter.armed
    assert flight.bridge.phase is FlightPhase.IDLE
    assert not any(isinstance(r, Refused) for r in flight.reports)


def test_vehicle_on_the_ground_needs_no_stop(flight: BridgeFlight) -> None:
    flight.run(5.0)
    flight.order(HOLD)
    flight.run(20.0)
    assert set(flight.copter.count()) <= {INTERVAL}
    assert flight.seen == [Held()]
    assert not any(isinstance(r, Refused) for r in flight.reports)


def test_hold_after_the_landing_lets_the_vehicle_come_home(flight: BridgeFlight) -> None:
    under_way(flight)
    flight.order(Return("mission ended"))
    while flight.copter.armed:
        flight.step()
    flight.order(HOLD)
    flight.run(5.0)
    assert not flight.copter.armed
    assert flight.reports == [Home()]


def test_vehicle_that_lands_before_it_is_stopped_is_home(flight: BridgeFlight) -> None:
    under_way(flight)
    flight.order(Return("mission ended"))
    while flight.copter.position_m[2] > 0.5 or flight.copter.velocity_m_s[2] >= 0.0:
        flight.step()
    flight.copter.verdicts[SET_MODE] = [None] * 9
    flight.order(HOLD)
    flight.run_until(Home())
    assert not flight.copter.armed


# -- a new life -------------------------------------------------------------------------


def test_vehicle_that_an_earlier_life_left_flying_is_stopped(flight: BridgeFlight) -> None:
    under_way(flight).restart()
    flight.order(HOLD)
    flight.run(8.0)
    assert hovers(flight)
    goes_on(flight)


def test_pilots_flight_is_not_stopped(flight: BridgeFlight) -> None:
    under_way(flight)
    flight.copter.set_mode(flight.copter.pilot_mode)
    flight.run(2.0)
    assert flight.order(HOLD) == [Refused(HOLD, "the vehicle is handed over")]
    flight.restart()
    flight.copter.heard.clear()
    flight.order(HOLD)
    refused = flight.run_until(Refused)
    assert isinstance(refused, Refused)
    assert "its pilot flies it in" in refused.reason
    assert set(flight.copter.count()) <= {INTERVAL}


def test_vehicle_that_is_never_heard_cannot_be_stopped(flight: BridgeFlight) -> None:
    flight.copter.silent = True
    flight.order(HOLD)
    refused = flight.run_until(Refused)
    assert refused == Refused(HOLD, "waiting for a heartbeat of system id 1")


def test_pilot_who_takes_over_while_it_is_stopped_keeps_the_vehicle(
    flight: BridgeFlight,
) -> None:
    under_way(flight)
    flight.order(HOLD)
    flight.copter.set_mode(flight.copter.pilot_mode)
    flight.run_until(HandedOver)
    flight.copter.heard.clear()
    flight.run(10.0)
    assert set(flight.copter.count()) <= {INTERVAL}
    assert flight.copter.mode == flight.copter.pilot_mode


# -- vehicles that do not obey ------------------------------------------------------------


def test_lost_stop_is_told_again(flight: BridgeFlight) -> None:
    under_way(flight)
    flight.copter.verdicts = {REPOSITION: [None, DENIED], SET_MODE: [None, DENIED]}
    flight.order(HOLD)
    flight.run(20.0)
    assert hovers(flight)
    assert flight.reports == []


def test_vehicle_that_goes_on_is_reported(flight: BridgeFlight) -> None:
    under_way(flight)
    flight.copter.verdicts = {REPOSITION: [DENIED] * 99, SET_MODE: [DENIED] * 99}
    flight.order(HOLD)
    refused = flight.run_until(Refused)
    assert isinstance(refused, Refused)
    assert refused.order == HOLD
    assert "goes on" in refused.reason
    assert flight.seen == []
    flight.run(5.0)
    assert len(flight.reports) == 1
    flight.copter.verdicts.clear()
    flight.order(HOLD)
    flight.run(8.0)
    assert hovers(flight)


def test_return_that_cannot_be_stopped_goes_on(flight: BridgeFlight) -> None:
    under_way(flight)
    flight.order(Return("mission ended"))
    flight.run(3.0)
    flight.copter.verdicts[SET_MODE] = [DENIED] * 99
    flight.order(HOLD)
    flight.run_until(Refused)
    flight.run_until(Home())


# -- positions that are not to be believed --------------------------------------------------


def glitch(flight: BridgeFlight, east_m: float, times: int = 1) -> None:
    """Let the vehicle tell a place where it is not."""
    copter, truth_m = flight.copter, flight.copter.position_m
    copter.position_m = (east_m, *truth_m[1:])
    for _ in range(times):
        flight.step()
        copter.position()
        flight.step()
    copter.position_m = (truth_m[0] + 0.2 * times, *truth_m[1:])


def place_told(flight: BridgeFlight) -> tuple[float, float, float] | None:
    """Where the vehicle was last told to stop, in the mission's frame; None if nowhere."""
    told = [m for m in flight.copter.commands(REPOSITION) if m.get_type() == "COMMAND_INT"]
    if not told:
        return None
    return enu_from_wgs84(ORIGIN, told[-1].x / 1e7, told[-1].y / 1e7, told[-1].z)


def by_targets(fake: type[FakeCopter]) -> BridgeFlight:
    return under_way(BridgeFlight(fake(ORIGIN), BridgeConfig(1, ORIGIN, fence_radius_m=500.0)))


def test_glitch_of_the_position_does_not_lead_the_vehicle_away(fake: type[FakeCopter]) -> None:
    flight = by_targets(fake)
    here_m = flight.copter.position_m
    flight.copter.heard.clear()
    glitch(flight, -300.0)
    flight.order(HOLD)
    flight.run(8.0)
    told_m = place_told(flight)
    assert told_m is None or math.dist(told_m, here_m) < 20.0
    assert math.dist(flight.copter.position_m, here_m) < 20.0
    assert hovers(flight)


def test_vehicle_is_told_to_stop_where_it_can_and_comes_back_to_nowhere() -> None:
    """Others keep clear of its way to a stop, and not of any way back."""
    flight = by_targets(FakeCopter)
    flight.copter.heard.clear()
    (east_m, north_m, _), (speed_m_s, *_) = flight.copter.position_m, flight.copter.velocity_m_s
    flight.order(HOLD)
    flight.run(5.0)
    told_m = place_told(flight)
    assert told_m is not None
    assert told_m[:2] == pytest.approx((east_m + speed_m_s**2 / (2.0 * 2.5), north_m), abs=2.0)
    assert hovers(flight)


class BrakingCopter(FakeCopter):
    """Speeds up and brakes as a vehicle does, towards a target."""

    ACCELERATION_M_S2 = 2.5

    def _move(self, dt_s: float) -> None:
        target_m = self.target_m
        guided = self.airborne and not self.in_takeoff and self.mode == self.own_mode
        if not guided or target_m is None or dt_s <= 0.0:
            super()._move(dt_s)
            return
        to_m = [there - here for here, there in zip(self.position_m, target_m, strict=True)]
        away_m = math.hypot(*to_m)
        if away_m < 0.05 and math.hypot(*self.velocity_m_s) < 0.3:
            self.position_m, self.velocity_m_s = target_m, (0.0, 0.0, 0.0)
            return
        speed_m_s = min(self.speed_m_s, math.sqrt(2.0 * self.ACCELERATION_M_S2 * away_m))
        wanted = [speed_m_s * each / max(away_m, 1e-9) for each in to_m]
        change = [want - has for has, want in zip(self.velocity_m_s, wanted, strict=True)]
        most = 1.2 * self.ACCELERATION_M_S2 * dt_s  # it can brake a little harder than it plans to
        share = min(1.0, most / max(math.hypot(*change), 1e-9))
        east, north, up = (
            has + share * each for has, each in zip(self.velocity_m_s, change, strict=True)
        )
        self.velocity_m_s = east, north, up
        x_m, y_m, z_m = self.position_m
        self.position_m = x_m + east * dt_s, y_m + north * dt_s, z_m + up * dt_s


@pytest.mark.parametrize("speed_m_s", [5.0, 14.0])
@pytest.mark.parametrize(
    "verdicts",
    [
        pytest.param([], id="heard"),
        pytest.param([None], id="one lost"),
        pytest.param([None, None], id="two lost"),
        pytest.param([None] * 5, id="given up once"),
        pytest.param([DENIED], id="denied"),
        pytest.param([None, DENIED], id="one lost, one denied"),
    ],
)
def test_no_stop_leads_back_however_late_it_is_heard(
    verdicts: list[int | None], speed_m_s: float
) -> None:
    """It brakes for longer than its stop is waited for, and is told that again."""
    copter = BrakingCopter(ORIGIN)
    flight = BridgeFlight(copter, BridgeConfig(1, ORIGIN, fence_radius_m=2000.0))
    flight.order(replace(START, speed_m_s=speed_m_s))
    flight.run_until(VehicleReady())
    flight.order(GoTo(1, (900.0, 0.0, 12.0)))
    flight.run(14.0)
    assert copter.velocity_m_s[0] > 0.9 * speed_m_s
    copter.heard.clear()
    copter.verdicts = {REPOSITION: list(verdicts)}
    slowest_m_s = math.inf
    flight.order(HOLD)
    for _ in range(300):
        flight.run(0.1)
        slowest_m_s = min(slowest_m_s, copter.velocity_m_s[0])
    told_m = [
        enu_from_wgs84(ORIGIN, m.x / 1e7, m.y / 1e7, m.z)[0]
        for m in copter.commands(REPOSITION)
        if m.get_type() == "COMMAND_INT"
    ]

    assert len(told_m) > len(verdicts)
    assert told_m == sorted(told_m)
    assert slowest_m_s > -1.0
    assert copter.position_m[0] == pytest.approx(told_m[-1], abs=0.1)
    assert hovers(flight)


def test_while_what_it_tells_last_does_not_count_it_is_told_the_place_before() -> None:
    """Its velocity came with a place that nothing bears out."""
    flight = by_targets(FakeCopter)
    flight.copter.heard.clear()
    here_m = flight.copter.position_m
    glitch(flight, -300.0)
    flight.order(HOLD)
    flight.step()
    told_m = place_told(flight)
    assert told_m is not None
    assert math.dist(told_m[:2], here_m[:2]) < 3.0


def test_px4_is_paused_without_any_place() -> None:
    flight = by_targets(FakePx4)
    flight.copter.heard.clear()
    flight.order(HOLD)
    flight.run(5.0)
    [pause] = flight.copter.commands(REPOSITION)
    assert all(math.isnan(value) for value in (pause.param5, pause.param6, pause.param7))
    assert hovers(flight)


def test_vehicle_beyond_the_fence_is_stopped_at_its_edge() -> None:
    flight = by_targets(FakeCopter)
    flight.copter.heard.clear()
    flight.copter.position_m = (530.0, 0.0, 12.0)
    flight.run(0.6)
    flight.order(HOLD)
    flight.run(15.0)
    told_m = place_told(flight)
    assert told_m is not None
    assert 490.0 < math.hypot(*told_m[:2]) <= 500.0
    assert hovers(flight)


def test_vehicle_whose_place_is_never_clear_is_not_sent_anywhere() -> None:
    flight = by_targets(FakeCopter)
    flight.copter.deaf_to.add(33)
    flight.run(4.0)
    flight.copter.heard.clear()
    flight.order(HOLD)
    for far in range(120):
        flight.run(0.1)
        flight.copter.say(
            mavlink.MAVLink_global_position_int_message(
                round((flight.now_s - flight.copter.on_at_s) * 1e3),
                round((ORIGIN.lat_deg + (1 + far % 7) * 1e-2) * 1e7),
                round(ORIGIN.lon_deg * 1e7),
                *(500_000, 12_000, 0, 0, 0, 0),
            )
        )
    assert place_told(flight) is None
    [refused] = [r for r in flight.reports if isinstance(r, Refused)]
    assert "too far apart" in refused.reason
