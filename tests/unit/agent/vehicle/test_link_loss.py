"""A vehicle that was handed over for its silence, and is heard again."""

from __future__ import annotations

import math
import re
from collections.abc import Callable

import pytest

from agent.core.interface import (
    Arrived,
    GoTo,
    HandedOver,
    HandOverExplained,
    HeardAgain,
    Hold,
    Home,
    Return,
)
from agent.vehicle.activity import FlightPhase
from agent.vehicle.config import BridgeConfig, CommandStyle
from tests.support.bridge_flight import ORIGIN, START, BridgeFlight
from tests.support.fake_copter import REPOSITION, SET_MODE, FakeCopter
from tests.support.fake_px4 import AUTO_LOITER, FakePx4

Fake = type[FakeCopter]
Meanwhile = Callable[[FakeCopter], None]

AGAIN = r"heard again after \d+ s"
MISSIONS = BridgeConfig(1, ORIGIN, CommandStyle.MISSION, position_rate_hz=10.0)


def fall_silent(flight: BridgeFlight, silence_s: float = 20.0) -> BridgeFlight:
    """It is handed over, and after that time it is heard again."""
    flight.copter.silent = True
    assert flight.run_until(HandedOver) == HandedOver("nothing heard for 5 s", silent=True)
    flight.copter.heard.clear()
    flight.run(silence_s - 5.0)
    flight.copter.silent = False
    return flight


def news(flight: BridgeFlight) -> HeardAgain | HandOverExplained:
    """What is said of it then, before which nothing is commanded."""
    report = flight.run_until(HeardAgain, HandOverExplained, limit_s=30.0)
    assert isinstance(report, HeardAgain | HandOverExplained)
    assert set(flight.copter.count()) <= {511}
    return report


def assert_taken_back(flight: BridgeFlight) -> None:
    report = news(flight)
    assert isinstance(report, HeardAgain)
    assert re.fullmatch(f"{AGAIN}, as it was left", report.reason)
    assert flight.bridge.phase is FlightPhase.HOVERING


def explanation(flight: BridgeFlight) -> str:
    report = news(flight)
    assert isinstance(report, HandOverExplained)
    flight.run(60.0)
    assert set(flight.copter.count()) <= {511}
    assert flight.bridge.phase is FlightPhase.HANDED_OVER
    assert not [r for r in flight.reports if isinstance(r, HeardAgain)]
    assert re.match(AGAIN, report.reason) or "rebooted" in report.reason
    return report.reason.partition(": ")[2]


# -- as it was left ----------------------------------------------------------------------


@pytest.mark.parametrize("east_m", [60.0, 2000.0], ids=["arrived", "on its way"])
def test_one_that_flew_to_its_target_is_brought_home(fake: Fake, east_m: float) -> None:
    flight = fall_silent(BridgeFlight(fake(ORIGIN)).flying(east_m=east_m))
    assert_taken_back(flight)
    flight.order(Return("heard again"))
    flight.run_until(Home(), limit_s=600.0)
    assert not [r for r in flight.reports[1:] if isinstance(r, HandedOver)]


def test_one_that_hovered_is_brought_home(fake: Fake) -> None:
    flight = BridgeFlight(fake(ORIGIN)).flying(east_m=40.0)
    flight.run_until(Arrived(1))
    assert_taken_back(fall_silent(flight))


def test_one_that_was_stopped_on_its_way_is_brought_home(fake: Fake) -> None:
    flight = BridgeFlight(fake(ORIGIN)).flying(east_m=500.0)
    flight.run(10.0)
    flight.order(Hold("look"))
    flight.run(5.0)
    assert_taken_back(fall_silent(flight))


def test_one_that_was_taking_off_is_brought_home(fake: Fake) -> None:
    flight = BridgeFlight(fake(ORIGIN))
    flight.order(START)
    while not flight.copter.in_takeoff:
        flight.step()
    flight.run(1.0)
    assert_taken_back(fall_silent(flight))


def test_one_that_never_heard_its_newest_target_is_brought_home(fake: Fake) -> None:
    flight = BridgeFlight(fake(ORIGIN)).flying(east_m=60.0)
    flight.copter.silent = True
    flight.run(1.0)
    flight.to_vehicle = lambda _: []
    flight.order(GoTo(2, (0.0, 500.0, 10.0)))
    flight.run_until(HandedOver)
    flight.to_vehicle = lambda data: [data]
    flight.copter.heard.clear()
    flight.run(15.0)
    flight.copter.silent = False
    assert_taken_back(flight)


def test_a_firmware_that_stood_still_itself_is_brought_home(fake: Fake) -> None:
    """Its time since boot goes on where it stopped."""
    flight = BridgeFlight(fake(ORIGIN)).flying(east_m=500.0)
    copter, frozen_s = flight.copter, flight.now_s
    advance, receive, late_s = copter.advance, copter.receive, math.inf
    copter.advance = (  # type: ignore[method-assign]
        lambda now_s: [] if late_s == math.inf else advance(now_s - late_s)
    )
    copter.receive = (  # type: ignore[method-assign]
        lambda data, now_s: [] if late_s == math.inf else receive(data, now_s - late_s)
    )
    flight.run_until(HandedOver)
    flight.run(10.0)
    late_s = flight.now_s - frozen_s
    copter.heard.clear()
    assert_taken_back(flight)


def test_one_that_falls_silent_again_is_watched_anew(fake: Fake) -> None:
    flight = fall_silent(BridgeFlight(fake(ORIGIN)).flying(east_m=60.0))
    flight.run(2.0)
    flight.copter.silent = True
    flight.run(20.0)
    assert [type(r) for r in flight.reports].count(HandedOver) == 1
    flight.copter.silent = False
    assert_taken_back(flight)
    flight.copter.silent = True
    assert flight.run_until(HandedOver) == HandedOver("nothing heard for 5 s")
    flight.copter.silent = False
    assert_taken_back(flight)


def test_what_waited_in_the_link_is_not_taken_for_the_present(fake: Fake) -> None:
    """Its pilot took over while it was silent; what it said before comes first."""
    flight = BridgeFlight(fake(ORIGIN)).flying(east_m=60.0)
    waiting: list[bytes] = []
    flight.to_bridge = lambda data: waiting.append(data) or []  # type: ignore[func-returns-value]
    flight.run_until(HandedOver)
    flight.run(5.0)
    flight.copter.set_mode(fake.pilot_mode)
    flight.copter.heard.clear()
    flight.run(0.2)
    flight.to_bridge = lambda data: [data]
    for data in waiting:
        flight.spoken(data)
    assert "switched it to" in explanation(flight)


# -- not as it was left ------------------------------------------------------------------


def switch(mode: str) -> Meanwhile:
    return lambda copter: copter.set_mode(getattr(copter, mode))


def land(copter: FakeCopter) -> None:
    copter.position_m = (*copter.position_m[:2], 0.0)
    copter.airborne = copter.armed = False


def touch_down(copter: FakeCopter) -> None:
    copter.airborne = False
    copter.armed_at_s = math.inf


def move(copter: FakeCopter) -> None:
    copter.position_m = (20.0, 80.0, 10.0)
    copter.target_m = None


def stop(copter: FakeCopter) -> None:
    copter.position_m = (250.0, 0.0, 10.0)
    copter.target_m = None


def fly_away(copter: FakeCopter) -> None:
    copter.position_m = (100.0, 0.0, 10.0)
    copter.target_m = (-900.0, 0.0, 10.0)


def terminate(copter: FakeCopter) -> None:
    copter.system_status = 8


@pytest.mark.parametrize(
    ("meanwhile", "why"),
    [
        (switch("pilot_mode"), "its pilot switched it to {pilot_mode}"),
        (switch("return_mode"), "it returns or lands by itself, in {return_mode}"),
        (switch("land_mode"), "it returns or lands by itself, in {land_mode}"),
        (land, "it stands on the ground"),
        (touch_down, "it stands on the ground"),
        (move, "somebody else has moved it"),
        (stop, "somebody else has moved it"),
        (fly_away, "somebody else has moved it"),
        (terminate, "the flight was terminated"),
    ],
)
def test_one_that_somebody_else_has_is_left_alone(
    fake: Fake, meanwhile: Meanwhile, why: str
) -> None:
    flight = BridgeFlight(fake(ORIGIN)).flying(east_m=2000.0)
    flight.copter.silent = True
    flight.run_until(HandedOver)
    flight.run(5.0)
    meanwhile(flight.copter)
    flight.copter.heard.clear()
    flight.copter.silent = False
    modes = {
        name: fake.mode_names.get(getattr(fake, name))
        for name in vars(FakeCopter)
        if name.endswith("_mode")
    }
    assert explanation(flight) == why.format(**modes)


def test_one_that_rebooted_is_left_alone(fake: Fake) -> None:
    flight = BridgeFlight(fake(ORIGIN)).flying(east_m=60.0)
    flight.copter.silent = True
    flight.run_until(HandedOver)
    flight.copter.power_on(flight.now_s)
    flight.copter.mode, flight.copter.armed = fake.own_mode, True
    flight.copter.heard.clear()
    flight.copter.silent = False
    assert explanation(flight) == "the autopilot rebooted"


def test_a_mode_that_was_ours_before_it_was_silent_and_is_another_one_is_a_pilots() -> None:
    flight = fall_silent(BridgeFlight(FakePx4(ORIGIN), MISSIONS).flying(east_m=60.0), 8.0)
    flight.copter.set_mode(AUTO_LOITER)
    flight.copter.silent = False
    assert "switched it to AUTO.LOITER" in explanation(flight)


def test_one_that_flies_its_mission_is_left_to_come_home_by_it(fake: Fake) -> None:
    flight = fall_silent(BridgeFlight(fake(ORIGIN), MISSIONS).flying(east_m=300.0))
    assert explanation(flight) == "it flies its mission, which ends at home"
    flight.run(300.0)
    assert set(flight.copter.count()) <= {511}
    assert not flight.copter.armed


def test_one_without_a_position_is_not_taken_back_before_it_has_one(fake: Fake) -> None:
    flight = fall_silent(BridgeFlight(fake(ORIGIN)).flying(east_m=60.0))
    flags, flight.copter.ekf_flags = flight.copter.ekf_flags, 167
    flight.run(30.0)
    assert len(flight.reports) == 1
    flight.copter.ekf_flags = flags
    assert_taken_back(flight)


def test_one_that_was_handed_over_for_another_reason_is_never_taken_back(fake: Fake) -> None:
    flight = BridgeFlight(fake(ORIGIN)).flying(east_m=60.0)
    flight.copter.set_mode(fake.pilot_mode)
    flight.run_until(HandedOver)
    flight.copter.silent = True
    flight.run(20.0)
    flight.copter.set_mode(fake.own_mode)
    flight.copter.silent = False
    flight.copter.heard.clear()
    flight.run(30.0)
    assert len(flight.reports) == 1
    assert not flight.copter.commands(SET_MODE) + flight.copter.commands(REPOSITION)


def test_an_order_ends_the_search(fake: Fake) -> None:
    flight = BridgeFlight(fake(ORIGIN)).flying(east_m=60.0)
    flight.copter.silent = True
    flight.run_until(HandedOver)
    flight.order(Return("mission ended"))
    flight.copter.silent = False
    flight.run(20.0)
    assert not [r for r in flight.reports if isinstance(r, HeardAgain | HandOverExplained)]
