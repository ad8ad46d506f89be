"""A vehicle lands at a base for another battery, and starts again only when it may."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from agent.core.interface import (
    Arrived,
    GoTo,
    HandedOver,
    Held,
    Hold,
    Home,
    Landed,
    Prepare,
    Ready,
    Refused,
    Return,
    ReturnAdvised,
    Swap,
    Swapped,
    VehicleReady,
)
from agent.vehicle.activity import FlightPhase
from agent.vehicle.config import BridgeConfig
from swarm.model import Zone, ZoneId
from tests.support.bridge_flight import ORIGIN, BridgeFlight
from tests.support.fake_copter import ARM, REPOSITION, SET_MODE, TAKEOFF, FakeCopter

BASE = (5.0, 0.0, 0.0)
ABOVE = (5.0, 0.0, 10.0)
SWAP = Swap(3, BASE, 20.0, 4.0)


def landed(fake: type[FakeCopter], config: BridgeConfig, percent: int = 30) -> BridgeFlight:
    """A flight that has just touched down at the base, its battery used up."""
    flight = BridgeFlight(fake(ORIGIN), config).prepared()
    flight.copter.battery_percent = percent
    flight.order(SWAP)
    flight.run_until(Landed(3))
    flight.copter.heard.clear()
    return flight


def changed(flight: BridgeFlight, silent_s: float = 8.0) -> None:
    """A person changes the battery, which switches the autopilot off and on."""
    flight.copter.silent = True
    flight.run(silent_s)
    flight.copter.power_on(flight.now_s)
    flight.copter.silent, flight.copter.battery_percent = False, 99
    flight.run(12.0)


def test_one_above_the_agents_fence_comes_down_into_it_before_it_flies_to_its_base(
    fake: type[FakeCopter], config: BridgeConfig
) -> None:
    flight = BridgeFlight(fake(ORIGIN), replace(config, fence_height_m=60.0)).prepared()
    flight.copter.position_m = (20.0, 0.0, 66.0)
    flight.copter.target_m = None
    flight.run(2.0)
    flight.copter.heard.clear()
    flight.order(SWAP)
    flight.run_until(Landed(3))
    heights_m = [told.z - ORIGIN.alt_m for told in flight.copter.commands(REPOSITION)]
    assert heights_m
    assert max(heights_m) < 60.0


def test_it_lands_waits_for_word_and_battery_and_flies_on(
    fake: type[FakeCopter], config: BridgeConfig
) -> None:
    flight = landed(fake, config)
    assert not flight.copter.armed
    assert flight.bridge.phase is FlightPhase.STANDING

    changed(flight)
    assert Swapped(3) not in flight.reports, "nobody has let it start"
    assert not flight.copter.count()[ARM]
    flight.order(Ready(3))
    flight.run_until(Swapped(3), limit_s=5.0)
    assert not flight.copter.count()[ARM], "it was not sent anywhere"

    flight.order(GoTo(4, (40.0, 0.0, 12.0)))
    flight.run_until(Arrived(4), limit_s=120.0)
    assert flight.copter.count()[TAKEOFF] == 1
    assert flight.copter.airborne
    assert not [each for each in flight.reports if isinstance(each, HandedOver)]


def test_the_word_alone_does_not_start_it_on_an_empty_battery(fake: type[FakeCopter]) -> None:
    flight = landed(fake, BridgeConfig(1, ORIGIN))

    flight.order(Ready(3))
    flight.run(30.0)

    assert Swapped(3) not in flight.reports
    assert flight.reasons()[-1] == "not ready: battery at 30%, below the 90% of a full one"
    assert isinstance(flight.order(GoTo(4, ABOVE))[-1], Refused)
    assert flight.bridge.phase is FlightPhase.STANDING


@pytest.mark.parametrize("switched_off", [True, False])
def test_a_word_that_was_refused_starts_nothing_once_the_battery_is_changed(
    fake: type[FakeCopter], switched_off: bool
) -> None:
    """Whoever changes it stands beside it then."""
    flight = landed(fake, BridgeConfig(1, ORIGIN))
    flight.order(Ready(3))
    flight.run(5.0)

    if switched_off:
        changed(flight)
        assert "swarm ready" in flight.reasons()[-1]
    else:
        flight.copter.battery_percent = 99
    flight.run(30.0)
    assert Swapped(3) not in flight.reports
    flight.order(Ready(3))
    flight.run_until(Swapped(3), limit_s=5.0)


def test_a_word_given_while_it_is_switched_off_or_boots_counts_for_what_it_boots_with(
    fake: type[FakeCopter],
) -> None:
    for percent, starts in ((99, True), (50, False)):
        flight = landed(fake, BridgeConfig(1, ORIGIN))
        flight.copter.silent = True
        flight.run(8.0)
        flight.order(Ready(3))
        flight.copter.power_on(flight.now_s)
        flight.copter.silent, flight.copter.battery_percent = False, percent
        flight.run(30.0)

        assert (Swapped(3) in flight.reports) is starts
        told = "not ready: battery at 50%, below the 90% of a full one"
        assert (told in flight.reasons()) is not starts


def test_one_that_is_switched_off_after_the_word_needs_another(fake: type[FakeCopter]) -> None:
    flight = landed(fake, BridgeConfig(1, ORIGIN), percent=99)
    flight.order(Ready(3))
    flight.run_until(Swapped(3))
    changed(flight)
    flight.run(20.0)

    assert isinstance(flight.order(GoTo(4, ABOVE))[-1], Refused)
    flight.run(20.0)
    assert not flight.copter.count()[ARM]
    flight.order(Ready(3))
    flight.run_until(Swapped(3))


def test_one_that_tells_no_charge_any_more_waits_until_it_is_told(fake: type[FakeCopter]) -> None:
    flight = landed(fake, BridgeConfig(1, ORIGIN))
    flight.copter.battery_percent = -1
    flight.run(2.0)
    flight.order(Ready(3))
    flight.run(30.0)
    assert Swapped(3) not in flight.reports
    assert flight.reasons()[-1] == "waiting to hear its charge"

    flight.copter.battery_percent = 95
    flight.run_until(Swapped(3), limit_s=5.0)


def test_one_that_never_told_its_charge_starts_by_the_word_alone(fake: type[FakeCopter]) -> None:
    copter = fake(ORIGIN)
    copter.battery_percent = -1
    flight = BridgeFlight(copter, BridgeConfig(1, ORIGIN)).prepared()
    flight.order(SWAP)
    flight.run_until(Landed(3))
    flight.order(Ready(3))
    flight.run_until(Swapped(3), limit_s=5.0)


@pytest.mark.parametrize(
    ("moved_m", "why"),
    [
        ((40.0, 0.0, 0.0), "it stands 40 m from its base: carry it there"),
        (
            (0.0, 0.0, 15.0),
            (
                "its height is +15 m off that of its base: restart it, "
                "or correct [origin] alt_m, or position_m of the base"
            ),
        ),
    ],
    ids=["aside", "above"],
)
def test_one_that_stands_elsewhere_is_not_ready(
    fake: type[FakeCopter], moved_m: tuple[float, float, float], why: str
) -> None:
    flight = landed(fake, BridgeConfig(1, ORIGIN), percent=99)
    east_m, north_m, up_m = flight.copter.position_m
    flight.copter.position_m = east_m + moved_m[0], north_m + moved_m[1], up_m + moved_m[2]
    flight.run(30.0)
    flight.order(Ready(3))
    flight.run(30.0)

    assert Swapped(3) not in flight.reports
    assert flight.reasons()[-1] == f"not ready: {why}"


def test_the_word_about_another_landing_counts_for_nothing(fake: type[FakeCopter]) -> None:
    flight = landed(fake, BridgeConfig(1, ORIGIN), percent=99)

    flight.order(Ready(2))
    flight.run(30.0)

    assert Swapped(3) not in flight.reports


def test_a_simulated_one_is_ready_once_a_swap_takes_no_longer(fake: type[FakeCopter]) -> None:
    flight = landed(fake, BridgeConfig(1, ORIGIN, ready_by_itself=True), percent=95)
    down_s = flight.now_s

    flight.run_until(Swapped(3))

    assert flight.now_s - down_s == pytest.approx(SWAP.swap_s, abs=0.5)


@pytest.mark.parametrize("order", [Prepare(ABOVE, 4.0), GoTo(4, ABOVE)], ids=["prepare", "go to"])
def test_nothing_else_starts_it(fake: type[FakeCopter], order: Prepare | GoTo) -> None:
    flight = landed(fake, BridgeConfig(1, ORIGIN), percent=99)

    assert isinstance(flight.order(order)[-1], Refused)
    flight.run(30.0)

    assert not flight.copter.count()[ARM]
    assert flight.bridge.phase is FlightPhase.STANDING


def test_one_that_somebody_armed_needs_another_word(fake: type[FakeCopter]) -> None:
    flight = landed(fake, BridgeConfig(1, ORIGIN), percent=30)
    flight.order(Ready(3))
    flight.copter.armed, flight.copter.armed_at_s = True, flight.now_s
    flight.run(5.0)
    flight.copter.armed, flight.copter.battery_percent = False, 99
    flight.run(30.0)

    assert Swapped(3) not in flight.reports

    flight.order(Ready(3))
    flight.run_until(Swapped(3))


def test_one_that_its_pilot_flies_away_is_his(fake: type[FakeCopter]) -> None:
    flight = landed(fake, BridgeConfig(1, ORIGIN))
    copter = flight.copter
    copter.mode, copter.armed, copter.airborne = copter.pilot_mode, True, True

    flight.run_until(HandedOver)


def test_one_that_does_not_disarm_is_told_to(fake: type[FakeCopter]) -> None:
    flight = BridgeFlight(fake(ORIGIN), BridgeConfig(1, ORIGIN)).prepared()
    flight.copter.stays_armed = True
    flight.copter.armed_at_s = flight.now_s + 1e3

    flight.order(SWAP)
    flight.run_until(Landed(3), limit_s=60.0)

    assert [each.param1 for each in flight.copter.commands(ARM)][-1] == 0.0


def test_it_flies_above_the_place_first(fake: type[FakeCopter], config: BridgeConfig) -> None:
    flight = BridgeFlight(fake(ORIGIN), config).prepared()

    flight.order(replace(SWAP, position_enu_m=(30.0, 5.0, 0.0)))
    flight.run_until(Landed(3), limit_s=90.0)

    assert flight.copter.position_m == pytest.approx((30.0, 5.0, 0.0), abs=1.5)


@pytest.mark.parametrize("after_s", [0.2, 2.0, 30.0], ids=["at once", "coming down", "standing"])
def test_an_agent_killed_while_it_lands_finds_it_as_it_is(
    fake: type[FakeCopter], config: BridgeConfig, after_s: float
) -> None:
    flight = BridgeFlight(fake(ORIGIN), config).prepared()
    flight.copter.battery_percent = 99
    flight.order(SWAP)
    flight.run(after_s)

    flight.restart()
    flight.order(SWAP)
    flight.run_until(Landed(3))
    assert flight.bridge.phase is FlightPhase.STANDING
    flight.order(Ready(3))
    flight.run_until(Swapped(3))
    flight.order(GoTo(4, (20.0, 0.0, 10.0)))
    flight.run_until(Arrived(4))


def test_an_agent_killed_while_it_climbs_from_its_base_takes_it_in_hand(
    fake: type[FakeCopter],
) -> None:
    flight = landed(fake, BridgeConfig(1, ORIGIN), percent=99)
    flight.order(Ready(3))
    flight.run_until(Swapped(3))
    flight.order(GoTo(4, (20.0, 0.0, 10.0)))
    for _ in range(2000):
        if flight.copter.airborne:
            break
        flight.step()

    flight.restart(down_s=0.5)
    flight.order(Prepare(ABOVE, 4.0, resume=True, left_in_air=True))
    flight.run(30.0)

    assert flight.bridge.phase is FlightPhase.HOVERING


@pytest.mark.parametrize("climbed_m", [0.0, 2.0, 6.0])
def test_one_left_climbing_far_from_its_start_climbs_on_where_it_is(
    fake: type[FakeCopter], config: BridgeConfig, climbed_m: float
) -> None:
    """A slant from there to its start would lead low over the ground, and over people."""
    flight = landed(fake, config, percent=99)
    base_m = (90.0, 40.0, 0.0)
    flight.copter.position_m = base_m
    flight.copter.power_on(flight.now_s)
    flight.run(8.0)
    flight.order(replace(SWAP, leg=4, position_enu_m=base_m))
    flight.order(Ready(4))
    flight.run_until(Swapped(4))
    flight.order(GoTo(5, (120.0, 40.0, 10.0)))
    for _ in range(4000):
        armed, up_m = flight.copter.armed, flight.copter.position_m[2]
        if armed and up_m >= climbed_m:
            break
        flight.step()

    flight.restart(down_s=0.3)
    flight.order(Prepare(ABOVE, 4.0, resume=True, ground_up_m=0.0, left_in_air=True))
    flight.run(40.0)

    assert flight.bridge.phase is FlightPhase.HOVERING
    assert flight.copter.position_m == pytest.approx((90.0, 40.0, 10.0), abs=1.5)
    recent_m = [each.position_enu_m for each in flight.telemetry[-300:]]
    assert max(math.dist(place_m[:2], base_m[:2]) for place_m in recent_m) < 1.0


def test_among_zones_one_found_in_the_air_takes_targets_once_its_place_is_known(
    fake: type[FakeCopter], config: BridgeConfig
) -> None:
    """Else the first target after a restart would be refused, and its task left alone."""
    wall = Zone(ZoneId("wall"), ((200.0, 0.0), (210.0, 0.0), (210.0, 10.0)))
    flight = BridgeFlight(fake(ORIGIN), replace(config, zones=(wall,))).prepared()
    flight.restart()
    flight.order(Prepare(ABOVE, 4.0, resume=True, left_in_air=True))
    flight.run_until(VehicleReady())
    flight.order(GoTo(1, (40.0, 0.0, 10.0)))

    flight.run_until(Arrived(1))
    assert not [each for each in flight.reports if isinstance(each, Refused)]


def test_one_left_in_a_takeoff_that_says_it_flies_climbs_before_it_takes_targets() -> None:
    """ArduCopter tells of no takeoff once it is off the ground; low targets lead into things."""
    flight = BridgeFlight(FakeCopter(ORIGIN), BridgeConfig(1, ORIGIN))
    flight.order(Prepare(ABOVE, 4.0))
    for _ in range(2000):
        if flight.copter.position_m[2] > 1.0:
            break
        flight.step()
    flight.copter.in_takeoff = False
    flight.restart(down_s=0.2)
    flight.order(Prepare(ABOVE, 4.0, resume=True, ground_up_m=0.0, left_in_air=True))
    flight.run_until(VehicleReady())

    assert flight.copter.position_m[2] > 8.0


def test_one_that_came_down_is_told_to_stand_there_once_its_place_is_known(
    fake: type[FakeCopter], config: BridgeConfig
) -> None:
    flight = landed(fake, config, percent=99)
    flight.restart()
    order = Prepare(ABOVE, 4.0, resume=True, ground_up_m=0.0, left_in_air=True)
    flight.order(order)
    refused = flight.run_until(Refused)

    assert isinstance(refused, Refused)
    assert refused.stands
    assert flight.telemetry[-1].position_enu_m == pytest.approx(BASE, abs=0.5)
    assert not flight.copter.count()[ARM]


def test_one_that_hovers_above_the_fence_comes_into_it_before_it_lands(
    fake: type[FakeCopter],
) -> None:
    flight = BridgeFlight(fake(ORIGIN), BridgeConfig(1, ORIGIN, fence_height_m=100.0)).prepared()
    flight.copter.position_m = (30.0, 0.0, 104.0)
    flight.run(6.0)
    flight.order(SWAP)
    flight.run(5.0)

    heights_m = [each.z - ORIGIN.alt_m for each in flight.copter.commands(REPOSITION)]
    assert heights_m
    assert max(heights_m) <= 100.0


def test_a_hold_stops_its_landing_in_the_air(fake: type[FakeCopter], config: BridgeConfig) -> None:
    flight = BridgeFlight(fake(ORIGIN), config).prepared()
    flight.order(SWAP)
    flight.run(1.5)

    flight.order(Hold("wait"))
    flight.run(20.0)

    assert flight.copter.airborne
    assert flight.seen == [Held()]
    flight.order(replace(SWAP, leg=4))
    flight.run_until(Landed(4))


def test_who_stands_there_is_held_and_home_without_a_word(fake: type[FakeCopter]) -> None:
    flight = landed(fake, BridgeConfig(1, ORIGIN))

    assert flight.order(Hold("wait")) == [Held()]
    assert flight.order(Return("over")) == [Home()]
    assert not flight.copter.count()[SET_MODE]


def test_a_take_off_that_fails_leaves_it_standing_and_ready(fake: type[FakeCopter]) -> None:
    flight = landed(fake, BridgeConfig(1, ORIGIN, arm_tries=2), percent=99)
    flight.order(Ready(3))
    flight.run_until(Swapped(3))
    flight.copter.verdicts[ARM] = [4, 4]
    go = GoTo(4, (20.0, 0.0, 10.0))
    flight.order(go)
    refused = flight.run_until(Refused)

    assert isinstance(refused, Refused)
    assert refused.order == go
    assert flight.order(replace(SWAP, leg=5))[0] == Landed(5)
    flight.run_until(Swapped(5))


def test_a_reboot_before_it_is_armed_takes_the_word_back(fake: type[FakeCopter]) -> None:
    flight = landed(fake, BridgeConfig(1, ORIGIN), percent=99)
    flight.order(Ready(3))
    flight.run_until(Swapped(3))
    flight.copter.prearm_ok = False
    flight.run(2.0)
    flight.order(GoTo(4, (20.0, 0.0, 10.0)))
    flight.run(3.0)
    changed(flight, silent_s=1.0)
    flight.copter.prearm_ok = True
    flight.run(30.0)

    assert flight.bridge.phase is FlightPhase.STANDING
    assert not flight.copter.armed
    assert not [each for each in flight.reports if isinstance(each, ReturnAdvised)]
