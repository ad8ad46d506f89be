"""What the bridge reports and sends when something is wrong with its vehicle in the air."""

from __future__ import annotations

from dataclasses import replace

import pytest

from agent.core.interface import (
    Arrived,
    GoTo,
    HandedOver,
    HandOverExplained,
    Hold,
    Home,
    Prepare,
    Refused,
    Return,
    ReturnAdvised,
)
from agent.vehicle.activity import FlightPhase
from agent.vehicle.session import TimePassed
from tests.support.bridge_flight import ORIGIN, BridgeFlight
from tests.support.fake_copter import DENIED, INTERVAL, REPOSITION, SET_MODE, FakeCopter
from tests.support.fake_px4 import FakePx4
from tests.support.mishaps import (
    CONFIG,
    CRITICAL,
    EMERGENCY,
    FENCED,
    Fake,
    Mishap,
    climb_away,
    disarm,
    drain,
    drift_off,
    fall_silent,
    flying,
    happen_and_watch,
    lose_position_stream,
    reboot,
    say,
    switch,
    terminate,
)

# -- what it hands over -----------------------------------------------------------------


@pytest.mark.parametrize(
    ("mishap", "reason"),
    [
        (lose_position_stream, "no valid position for 5 s"),
        (switch("pilot_mode"), "its pilot switched it to {pilot_mode}"),
        (switch("return_mode"), "its pilot or a failsafe switched it to {return_mode}"),
        (switch("land_mode"), "its pilot or a failsafe switched it to {land_mode}"),
        (switch("return_mode", CRITICAL), "a failsafe switched it to {return_mode}"),
        (switch("land_mode", EMERGENCY), "a failsafe switched it to {land_mode}"),
        (
            say(2, "Radio Failsafe", "return_mode"),
            "a failsafe switched it to {return_mode} (Radio Failsafe)",
        ),
        (
            say(4, "Geofence breach", "return_mode"),
            "a failsafe switched it to {return_mode} (Geofence breach)",
        ),
        (
            say(4, "Low battery", "land_mode"),
            "its pilot or a failsafe switched it to {land_mode} (Low battery)",
        ),
        (terminate, "the flight was terminated"),
        (disarm, "the vehicle disarmed by itself"),
        (fall_silent, "nothing heard for 5 s"),
        (reboot, "the autopilot rebooted"),
    ],
)
def test_a_vehicle_that_is_no_longer_ours_is_handed_over_and_not_commanded(
    fake: Fake, mishap: Mishap, reason: str
) -> None:
    flight = flying(fake)
    modes = {
        kind: fake.mode_names[getattr(fake, kind)]
        for kind in ("pilot_mode", "return_mode", "land_mode")
    }
    [handed] = happen_and_watch(flight, mishap)
    assert handed == HandedOver(reason.format(**modes))
    assert flight.bridge.phase is FlightPhase.HANDED_OVER
    assert set(flight.copter.count()) <= {INTERVAL}

    order = GoTo(2, (0.0, 0.0, 10.0))
    assert flight.order(order) == [Refused(order, "the vehicle is handed over")]
    flight.run(5.0)
    assert set(flight.copter.count()) <= {INTERVAL}


@pytest.mark.parametrize(
    ("said", "quoted"),
    [
        ([(4, "Battery 1 is low 10.40V used 3100 mAh"), (4, "Battery Failsafe")], -1),
        ([(2, "EKF variance: 0.9"), (2, "EKF Failsafe: changed to LAND Mode")], -1),
        ([(5, "Circle fence breached")], -1),
        ([(4, "GCS Failsafe")], -1),
        ([(4, "Radio Failsafe"), (4, "Something else")], 0),
    ],
)
def test_words_that_follow_the_mode_of_a_failsafe_complete_the_reason(
    fake: Fake, said: list[tuple[int, str]], quoted: int
) -> None:
    """It is handed over at once, and nothing is commanded while they are waited for."""
    flight = flying(fake)
    flight.copter.set_mode(fake.return_mode)
    handed = flight.run_until(HandedOver)
    mode, words = fake.mode_names[fake.return_mode], said[quoted][1]
    assert handed == HandedOver(f"its pilot or a failsafe switched it to {mode}")
    flight.run(0.1)
    for line in said:
        flight.copter.text(*line)
    told_s = flight.now_s
    explained = flight.run_until(HandOverExplained)
    assert explained == HandOverExplained(f"a failsafe switched it to {mode} ({words})")
    assert flight.now_s - told_s <= 0.5
    flight.run(10.0)
    assert len(flight.reports) == 2
    assert set(flight.copter.count()) <= {INTERVAL}


@pytest.mark.parametrize("text", ["", "Radio Failsafe Cleared"])
def test_a_reason_that_nothing_is_added_to_is_told_once(fake: Fake, text: str) -> None:
    """Nor by words that come later than half a second, or that end a failsafe."""
    flight = flying(fake)
    flight.copter.set_mode(fake.pilot_mode)
    flight.run_until(HandedOver)
    flight.run(0.6)
    flight.copter.text(4, "Battery Failsafe")
    flight.run(5.0)
    assert len(flight.reports) == 1

    flight = flying(fake)
    if text:
        flight.copter.text(4, text)
    flight.copter.set_mode(fake.pilot_mode)
    handed = flight.run_until(HandedOver)
    assert isinstance(handed, HandedOver)
    assert handed.reason.startswith("its pilot switched it to ")


def test_an_uploads_echo_is_the_reason_of_nothing(fake: Fake) -> None:
    flight = flying(fake)
    flight.copter.text(2, "Auto mission changed, restarted command")
    flight.copter.set_mode(fake.return_mode)
    mode = fake.mode_names[fake.return_mode]
    handed = flight.run_until(HandedOver)
    assert handed == HandedOver(f"its pilot or a failsafe switched it to {mode}")

    flight = flying(fake)
    flight.copter.text(2, "Auto mission changed, restarted command")
    flight.copter.verdicts[REPOSITION] = [DENIED]
    order = GoTo(2, (0.0, 0.0, 10.0))
    flight.order(order)
    refused = flight.run_until(Refused)
    assert refused == Refused(order, "the autopilot did not take the target (denied)")


def test_a_position_that_the_estimator_does_not_trust_counts_for_none(fake: Fake) -> None:
    flight = flying(fake)
    flight.copter.ekf_flags = 167
    flight.copter.stuck = True
    began_s = flight.now_s
    handed = flight.run_until(HandedOver)
    assert handed == HandedOver("no valid position for 5 s (the position estimate is lost)")
    assert 5.0 <= flight.now_s - began_s <= 7.0
    flight.run(20.0)
    assert not flight.copter.commands(REPOSITION)


@pytest.mark.parametrize("gap_s", [1.0, 4.0])
def test_a_short_gap_in_the_positions_is_ridden_out(fake: Fake, gap_s: float) -> None:
    flight = flying(fake)
    flight.copter.deaf_to = {33}
    flight.run(gap_s)
    flight.copter.deaf_to = set()
    flight.run_until(Arrived(1))
    assert flight.reports == [Arrived(1)]


def test_a_link_that_brings_nothing_at_all_is_not_taken_for_a_lost_position(fake: Fake) -> None:
    flight = flying(fake, replace(CONFIG, position_timeout_s=2.0))
    flight.copter.silent = True
    flight.run(3.0)
    flight.copter.silent = False
    flight.run_until(Arrived(1))
    assert flight.reports == [Arrived(1)]


def test_a_bridge_that_was_held_up_does_not_miss_positions(fake: Fake) -> None:
    flight = flying(fake)
    flight.now_s += 30.0
    flight.happen(TimePassed())
    flight.run_until(Arrived(1))
    assert flight.reports == [Arrived(1)]


def test_a_position_lost_while_it_climbs_is_told_too(fake: Fake) -> None:
    flight = BridgeFlight(fake(ORIGIN), CONFIG)
    flight.order(Prepare((5.0, 0.0, 40.0), 4.0))
    while flight.copter.position_m[2] < 5.0:
        flight.step()
    flight.copter.deaf_to = {33}
    assert flight.run_until(HandedOver) == HandedOver("no valid position for 5 s")


# -- when it should go home -------------------------------------------------------------


@pytest.mark.parametrize(
    ("mishap", "reason"),
    [
        (drain, "battery at 15%, below the reserve of 20%"),
        (drift_off, "outside the fence of 60 m"),
        (climb_away, "above the origin, outside the fence of 30 m"),
    ],
)
def test_a_vehicle_in_trouble_is_advised_to_return_and_obeys(
    fake: Fake, mishap: Mishap, reason: str
) -> None:
    flight = flying(fake, FENCED)
    [advised] = happen_and_watch(flight, mishap)
    assert isinstance(advised, ReturnAdvised)
    assert reason in advised.reason
    assert not {SET_MODE} & set(flight.copter.count()), "it only advises"

    flight.order(Return(advised.reason))
    flight.run_until(Home(), limit_s=180.0)
    assert not [r for r in flight.reports if isinstance(r, HandedOver)]


def test_a_battery_that_runs_low_after_another_advice_is_told_too(fake: Fake) -> None:
    flight = flying(fake, FENCED)
    drift_off(flight)
    first = flight.run_until(ReturnAdvised)
    drain(flight)
    second = flight.run_until(ReturnAdvised)
    assert "outside the fence" in str(first)
    assert second == ReturnAdvised("battery at 15%, below the reserve of 20%")


def test_a_battery_is_told_again_at_half_if_its_return_was_broken_off(fake: Fake) -> None:
    flight = flying(fake)
    drain(flight)
    flight.order(Return(str(flight.run_until(ReturnAdvised))))
    flight.run(2.0)
    flight.order(Hold("look at it"))
    flight.copter.battery_percent = 8
    flight.run(20.0)
    assert flight.bridge.phase is FlightPhase.HOVERING
    assert len([r for r in flight.reports if isinstance(r, ReturnAdvised)]) == 1

    flight.copter.battery_percent = 7
    advised = ReturnAdvised("battery at 7%, below the reserve of 20%")
    assert flight.run_until(ReturnAdvised) == advised
    flight.order(Return(advised.reason))
    flight.run_until(Home())


def test_an_alarm_of_a_px4_that_still_obeys_is_a_reason_to_return() -> None:
    flight = flying(FakePx4)
    flight.copter.text(4, "Failsafe warning: Low battery")
    flight.copter.system_status = CRITICAL
    advised = flight.run_until(ReturnAdvised, limit_s=2.0)
    assert advised == ReturnAdvised(
        "the autopilot reports a failsafe (Failsafe warning: Low battery)"
    )
    flight.order(Return("failsafe"))
    flight.run_until(Home())


def test_an_ardupilot_whose_owner_lets_it_fly_on_in_a_failsafe_flies_on() -> None:
    flight = flying(FakeCopter)
    flight.copter.system_status = CRITICAL
    flight.run_until(Arrived(1))
    assert flight.reports == [Arrived(1)]


def test_a_single_odd_reading_of_the_battery_is_no_reason(fake: Fake) -> None:
    flight = flying(fake)
    for _ in range(6):
        flight.copter.battery_percent = 3
        flight.copter._stream(1)
        flight.copter.battery_percent = 80
        flight.run(0.6)
    assert flight.reports == []


@pytest.mark.parametrize("percent", [20, 80, -1])
def test_an_enough_or_unknown_charge_is_no_reason(fake: Fake, percent: int) -> None:
    flight = flying(fake)
    flight.copter.battery_percent = percent
    flight.run_until(Arrived(1))
    assert flight.reports == [Arrived(1)]


def test_without_a_reserve_the_battery_is_the_autopilots_business(fake: Fake) -> None:
    flight = flying(fake, replace(CONFIG, battery_reserve_frac=None))
    drain(flight)
    flight.run_until(Arrived(1))
    assert flight.reports == [Arrived(1)]


def test_overshooting_the_fence_a_little_is_no_reason(fake: Fake) -> None:
    flight = flying(fake, FENCED)
    flight.copter.target_m = (65.0, 0.0, 10.0)
    flight.run(15.0)
    assert not [r for r in flight.reports if isinstance(r, ReturnAdvised)]


def test_one_position_far_outside_is_no_reason(fake: Fake) -> None:
    flight = flying(fake, FENCED)
    for _ in range(5):
        place_m, flight.copter.position_m = flight.copter.position_m, (900.0, 0.0, 10.0)
        flight.step()
        flight.copter.position_m = place_m
        flight.run(1.0)
    assert not [r for r in flight.reports if isinstance(r, ReturnAdvised)]


def test_on_its_way_home_nothing_is_advised(fake: Fake) -> None:
    flight = flying(fake)
    flight.order(Return("over"))
    drain(flight)
    flight.copter.deaf_to = {33}
    flight.run(8.0)
    flight.copter.deaf_to = set()
    flight.run_until(Home())
    assert flight.reports == [Home()]
