"""What the bridge reports of a vehicle that is not fit to be armed, or refuses its orders."""

from __future__ import annotations

import pytest

from agent.core.interface import (
    Arrived,
    GoTo,
    HandedOver,
    Refused,
    Return,
    ReturnAdvised,
    VehicleReady,
)
from agent.vehicle.activity import FlightPhase
from tests.support.bridge_flight import ORIGIN, START, BridgeFlight
from tests.support.fake_copter import FAILED, INTERVAL, REPOSITION, SET_MODE, FakeCopter
from tests.support.fake_px4 import FakePx4
from tests.support.mishaps import (
    CONFIG,
    Fake,
    drain,
    flying,
    terminate,
)


def test_a_vehicle_with_a_low_battery_is_not_armed(fake: Fake) -> None:
    flight = BridgeFlight(fake(ORIGIN), CONFIG)
    drain(flight)
    flight.order(START)
    flight.run(30.0)
    reason = "battery at 15%, below the reserve of 20%: charge or change it"
    assert flight.reasons()[-1] == reason
    assert set(flight.copter.count()) <= {INTERVAL, SET_MODE}

    flight.copter.battery_percent = 95
    flight.run_until(VehicleReady())


def test_a_single_good_reading_of_a_low_battery_does_not_arm_it(fake: Fake) -> None:
    flight = BridgeFlight(fake(ORIGIN), CONFIG)
    drain(flight)
    flight.order(START)
    flight.run(8.0)
    flight.copter.battery_percent = 80
    flight.copter._stream(1)
    drain(flight)
    flight.run(5.0)
    assert set(flight.copter.count()) <= {INTERVAL, SET_MODE}


def test_a_vehicle_that_stopped_telling_its_position_is_not_armed(fake: Fake) -> None:
    flight = BridgeFlight(fake(ORIGIN), CONFIG)
    flight.copter.prearm_ok = False
    flight.order(START)
    flight.run(8.0)
    flight.copter.deaf_to = {33}
    flight.run(8.0)
    flight.copter.prearm_ok = True
    flight.run(5.0)
    assert flight.reasons()[-1] == "no valid position for 5 s"
    assert set(flight.copter.count()) <= {INTERVAL, SET_MODE}
    flight.copter.deaf_to = set()
    flight.run_until(VehicleReady())


def test_a_terminated_vehicle_is_not_armed(fake: Fake) -> None:
    flight = BridgeFlight(fake(ORIGIN), CONFIG)
    terminate(flight)
    flight.order(START)
    flight.run(8.0)
    assert flight.reasons()[-1] == "the flight was terminated: restart the autopilot"
    assert set(flight.copter.count()) <= {INTERVAL, SET_MODE}


def test_a_target_the_autopilot_refuses_is_told_with_its_own_words(fake: Fake) -> None:
    flight = flying(fake)
    flight.copter.verdicts[REPOSITION] = [FAILED]
    order = GoTo(2, (0.0, 0.0, 10.0))
    flight.copter.text(4, "No terrain data there")
    flight.order(order)
    refused = flight.run_until(Refused)
    assert refused == Refused(
        order,
        "the autopilot did not take the target (failed): No terrain data there",
    )


FENCE_WORDS = {
    FakeCopter: "the autopilot did not take the target (failed, probably by its own fence)",
    FakePx4: "the autopilot did not take the target: Reposition is outside geofence",
}
"""ArduCopter refuses without a word; PX4 acknowledges, and then says why it does not fly."""


@pytest.mark.parametrize("moving", [True, False])
def test_a_target_beyond_the_autopilots_own_fence_is_refused_and_the_fence_named(
    fake: Fake, moving: bool
) -> None:
    flight = flying(fake)
    flight.copter.fence_radius_m = 80.0
    flight.run(1.0)
    if not moving:
        flight.run_until(Arrived(1))
    order = GoTo(2, (0.0, 100.0, 10.0))
    ordered_s = flight.now_s
    flight.order(order)
    assert flight.run_until(Refused) == Refused(order, FENCE_WORDS[fake])
    assert flight.now_s - ordered_s < 1.0
    flight.order(GoTo(3, (0.0, 70.0, 10.0)))
    flight.run_until(Arrived(3))


def test_a_failure_of_a_vehicle_without_a_fence_is_not_laid_to_one(fake: Fake) -> None:
    flight = flying(fake)
    flight.copter.verdicts[REPOSITION] = [FAILED]
    order = GoTo(2, (0.0, 0.0, 10.0))
    flight.order(order)
    refused = flight.run_until(Refused)
    assert refused == Refused(order, "the autopilot did not take the target (failed)")


def test_a_start_beyond_the_autopilots_own_fence_is_named(fake: Fake) -> None:
    copter = fake(ORIGIN)
    copter.fence_radius_m = 3.0
    flight = BridgeFlight(copter)
    flight.order(START)
    assert flight.run_until(ReturnAdvised) == ReturnAdvised(FENCE_WORDS[fake])


def test_a_return_that_is_refused_is_told_with_the_autopilots_own_words(fake: Fake) -> None:
    flight = flying(fake)
    flight.copter.verdicts[SET_MODE] = [FAILED] * 99
    order = Return("mission ended")
    flight.order(order)
    words = "Mode change to RTL failed: in fence recovery"
    while not any(isinstance(report, Refused) for report in flight.reports):
        flight.copter.text(4, words)
        flight.run(1.0)
    refusal = f"the return mode cannot be set (failed): {words}"
    assert flight.reports == [Refused(order, refusal)]


def test_lost_heartbeats_are_no_silence_while_other_messages_come(fake: type[FakeCopter]) -> None:
    flight = BridgeFlight(fake(ORIGIN)).flying()

    def without_heartbeats(data: bytes) -> list[bytes]:
        return [] if data[7:10] == bytes(3) else [data]

    flight.to_bridge = without_heartbeats
    flight.run(12.0)
    assert flight.bridge.phase is FlightPhase.FLYING
    handed_over = flight.run_until(HandedOver, limit_s=5.0)
    assert isinstance(handed_over, HandedOver)
    assert handed_over.reason.startswith("no heartbeat for 15 s, though other messages come")


def test_nobody_arrives_at_a_place_that_the_vehicle_itself_distrusts(fake: Fake) -> None:
    flight = flying(fake)
    flight.copter.ekf_flags = 167
    flight.run(1.0)
    flight.copter.position_m = (50.0, 0.0, 10.0)
    flight.run(3.0)
    assert not [r for r in flight.reports if isinstance(r, Arrived)]
