"""From order to order in the air, and home."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from agent.core.interface import Arrived, GoTo, HandedOver, Home, Refused, Return, VehicleReady
from agent.vehicle.activity import FlightPhase
from agent.vehicle.commands import CommandPolicy
from agent.vehicle.config import BridgeConfig
from agent.vehicle.session import LinkClosed, LinkOpened, TimePassed
from tests.support.bridge_flight import ORIGIN, START, BridgeFlight, rough_link
from tests.support.fake_copter import (
    ACCEPTED,
    BUSY,
    DENIED,
    FAILED,
    INTERVAL,
    REPOSITION,
    SET_MODE,
    FakeCopter,
)
from tests.support.fake_px4 import FakePx4

HERE = (5.0, 0.0, 10.0)
NORTH = (5.0, 40.0, 12.0)
SOUTH = (5.0, -40.0, 12.0)


def last_target_enu_m(flight: BridgeFlight) -> tuple[float, float, float]:
    target_m = flight.copter.target_m
    assert target_m is not None
    return target_m


def test_target_is_sent_in_the_step_of_its_order(fake: type[FakeCopter]) -> None:
    flight = BridgeFlight(fake(ORIGIN)).prepared()
    flight.copter.heard.clear()
    flight.order(GoTo(1, NORTH))

    [sent] = flight.copter.commands(REPOSITION)
    speed_m_s, flags = {FakeCopter: (-1.0, 0.0), FakePx4: (4.0, 1.0)}[fake]
    assert (sent.get_type(), sent.frame) == ("COMMAND_INT", 5)
    assert (sent.param1, sent.param2) == (speed_m_s, flags)
    assert sent.z == pytest.approx(ORIGIN.alt_m + 12.0)
    assert last_target_enu_m(flight) == pytest.approx(NORTH, abs=0.02)


def test_vehicle_arrives_once_and_stands_at_the_target(fake: type[FakeCopter]) -> None:
    flight = BridgeFlight(fake(ORIGIN)).prepared()
    before_s = flight.now_s
    flight.order(GoTo(1, NORTH))
    flight.run_until(Arrived(1))

    assert math.dist(flight.copter.position_m, NORTH) < 1.0
    assert flight.now_s - before_s == pytest.approx(math.dist(HERE, NORTH) / 4.0, abs=0.1)
    flight.run(10.0)
    assert flight.reports == [Arrived(1)]


def test_legs_follow_each_other_without_mixing_up_arrivals(fake: type[FakeCopter]) -> None:
    flight = BridgeFlight(fake(ORIGIN)).prepared()
    for leg, target in enumerate((NORTH, SOUTH, NORTH, HERE), start=1):
        flight.order(GoTo(leg, target))
        flight.run_until(Arrived(leg))
    assert flight.reports == [Arrived(1), Arrived(2), Arrived(3), Arrived(4)]


def test_target_at_the_present_place_is_arrived_at_too(fake: type[FakeCopter]) -> None:
    flight = BridgeFlight(fake(ORIGIN)).prepared()
    flight.order(GoTo(1, HERE))
    flight.run_until(Arrived(1), limit_s=1.0)
    flight.order(GoTo(2, HERE))
    flight.run_until(Arrived(2), limit_s=1.0)


def test_retarget_in_mid_flight_leads_to_the_new_target_only(fake: type[FakeCopter]) -> None:
    flight = BridgeFlight(fake(ORIGIN)).prepared()
    flight.order(GoTo(1, NORTH))
    flight.run(3.0)
    flight.order(GoTo(2, SOUTH))
    flight.run_until(Arrived(2))
    assert flight.reports == [Arrived(2)]
    assert math.dist(flight.copter.position_m, SOUTH) < 1.0


def test_passing_by_the_target_is_no_arrival(fake: type[FakeCopter]) -> None:
    config = BridgeConfig(1, ORIGIN, position_rate_hz=10.0, acceptance_radius_m=5.0)
    flight = BridgeFlight(fake(ORIGIN), config=config).prepared()
    flight.order(GoTo(1, (5.0, 60.0, 10.0)))
    flight.run(6.0)
    # The vehicle is told a place ahead; near it, but still moving, it has not arrived.
    flight.order(GoTo(2, (5.0, 30.0, 10.0)))
    while flight.copter.position_m[1] < 29.5:
        flight.step()
        assert not flight.reports
    flight.run_until(Arrived(2))


def test_target_that_was_not_taken_yet_is_not_arrived_at(fake: type[FakeCopter]) -> None:
    flight = BridgeFlight(fake(ORIGIN)).prepared()
    flight.copter.verdicts[REPOSITION] = [None]
    flight.order(GoTo(1, HERE))  # the vehicle stands there, but does not know
    flight.run(0.9)
    assert not flight.reports
    flight.run_until(Arrived(1))


def test_acknowledgement_of_the_old_target_is_not_taken_for_the_new_one(
    fake: type[FakeCopter],
) -> None:
    flight = BridgeFlight(fake(ORIGIN)).prepared()
    copter = flight.copter
    copter.verdicts[REPOSITION] = [None, None, ACCEPTED]  # both lost, then a third answered
    flight.order(GoTo(1, NORTH))
    flight.order(GoTo(2, HERE))
    copter.ack(REPOSITION, ACCEPTED)  # a late answer to the first
    flight.run(0.5)
    assert not flight.reports
    flight.run_until(Arrived(2))


def test_lost_target_is_sent_again(fake: type[FakeCopter]) -> None:
    flight = BridgeFlight(fake(ORIGIN)).prepared()
    flight.copter.verdicts[REPOSITION] = [None, None, BUSY, BUSY]
    flight.order(GoTo(1, NORTH))
    flight.run_until(Arrived(1))


@pytest.mark.parametrize(
    ("verdicts", "words"),
    [
        ([DENIED], "denied"),
        ([FAILED], "failed"),
        ([None] * 5, "no answer"),
        ([BUSY] * 99, "reject"),
    ],
)
def test_target_that_is_refused_for_good_is_reported(
    fake: type[FakeCopter], verdicts: list[int | None], words: str
) -> None:
    flight = BridgeFlight(fake(ORIGIN)).prepared()
    flight.copter.verdicts[REPOSITION] = list(verdicts)
    order = GoTo(1, NORTH)
    flight.order(order)
    refused = flight.run_until(Refused)
    assert isinstance(refused, Refused)
    assert refused.order == order
    assert words in refused.reason
    assert flight.bridge.phase is FlightPhase.HOVERING

    flight.copter.verdicts.clear()
    flight.order(GoTo(2, SOUTH))  # and the vehicle is still ours
    flight.run_until(Arrived(2))


def test_a_px4_that_is_paused_on_its_way_is_handed_over() -> None:
    flight = BridgeFlight(FakePx4(ORIGIN)).flying()
    flight.copter.heard.clear()
    flight.copter.target_m = flight.copter.position_m
    handed = flight.run_until(HandedOver)
    assert isinstance(handed, HandedOver)
    assert "short of its target: paused by a ground station?" in handed.reason
    flight.run(20.0)
    assert not flight.copter.commands(REPOSITION)


def test_vehicle_that_stands_still_elsewhere_is_told_again_and_then_given_up(
    fake: type[FakeCopter],
) -> None:
    flight = BridgeFlight(fake(ORIGIN)).prepared()
    flight.copter.stuck = True
    flight.copter.heard.clear()
    flight.order(GoTo(1, NORTH))
    refused = flight.run_until(Refused)
    assert isinstance(refused, Refused)
    assert "stands still 40.0 m from the target" in refused.reason
    assert len(flight.copter.commands(REPOSITION)) == {FakeCopter: 4, FakePx4: 1}[fake]


def test_an_ardupilot_that_forgot_its_target_gets_there_after_all() -> None:
    flight = BridgeFlight(FakeCopter(ORIGIN)).prepared()
    flight.order(GoTo(1, NORTH))
    flight.run(2.0)
    flight.copter.target_m = None
    flight.run_until(Arrived(1))


@pytest.mark.parametrize(
    "target",
    [(math.nan, 0.0, 10.0), (0.0, math.inf, 10.0), (25_000.0, 0.0, 10.0), (0.0, 0.0, -1_500.0)],
)
def test_target_outside_the_fence_is_never_sent(
    fake: type[FakeCopter], target: tuple[float, float, float]
) -> None:
    flight = BridgeFlight(fake(ORIGIN)).prepared()
    flight.order(GoTo(1, NORTH))
    flight.copter.heard.clear()
    [refused] = flight.order(GoTo(2, target))
    assert isinstance(refused, Refused)
    assert not flight.copter.commands(REPOSITION)
    flight.run_until(Arrived(1))  # what was flown to before still is


def test_order_before_the_vehicle_is_prepared_is_refused(fake: type[FakeCopter]) -> None:
    flight = BridgeFlight(fake(ORIGIN))
    order = GoTo(1, NORTH)
    assert flight.order(order) == [Refused(order, "the vehicle is idle")]
    flight.order(START)
    assert flight.order(order) == [Refused(order, "the vehicle is preparing")]


def test_doubled_and_late_positions_change_nothing(fake: type[FakeCopter]) -> None:
    flight = BridgeFlight(fake(ORIGIN)).prepared()
    flight.order(GoTo(1, NORTH))
    flight.run_until(Arrived(1))
    flight.order(GoTo(2, SOUTH))
    flight.run(2.0)
    boot_ms = round((flight.now_s - flight.copter.on_at_s) * 1e3)
    told = len(flight.telemetry)
    place_m, flight.copter.position_m = flight.copter.position_m, SOUTH
    for late_ms in (0, 40, 500, 1_000, 5_000, 9_000, 9_000):
        flight.copter.position(boot_ms - late_ms)
    flight.copter.position_m = place_m
    flight.step()
    assert len(flight.telemetry) - told <= 2
    assert not [r for r in flight.reports if r != Arrived(1)]
    assert flight.bridge.stale_positions >= 5
    flight.run_until(Arrived(2))


def test_telemetry_is_in_the_missions_frame(fake: type[FakeCopter]) -> None:
    flight = BridgeFlight(fake(ORIGIN)).prepared()
    flight.order(GoTo(1, NORTH))
    flight.run(4.0)
    newest = flight.telemetry[-1]
    assert newest.position_enu_m == pytest.approx(flight.copter.position_m, abs=0.2)
    assert newest.velocity_enu_m_s == pytest.approx(flight.copter.velocity_m_s, abs=0.02)
    assert newest.battery_frac == pytest.approx(0.8)


@pytest.mark.parametrize("kind", ["pilot_mode", "land_mode", "return_mode"])
def test_pilot_who_takes_over_keeps_the_vehicle(fake: type[FakeCopter], kind: str) -> None:
    flight = BridgeFlight(fake(ORIGIN)).flying()
    mode: int = getattr(fake, kind)
    flight.copter.set_mode(mode)
    flight.copter.heard.clear()
    handed = flight.run_until(HandedOver)
    who = "its pilot" if kind == "pilot_mode" else "its pilot or a failsafe"
    assert handed == HandedOver(f"{who} switched it to {fake.mode_names[mode]}")
    order = GoTo(2, NORTH)
    assert flight.order(order) == [Refused(order, "the vehicle is handed over")]
    flight.run(20.0)
    assert set(flight.copter.count()) <= {INTERVAL}
    assert len([r for r in flight.reports if isinstance(r, HandedOver)]) == 1


def test_target_sent_before_the_take_over_is_seen_does_not_pull_an_ardupilot_back() -> None:
    flight = BridgeFlight(FakeCopter(ORIGIN)).prepared()
    flight.copter.mode = FakeCopter.pilot_mode  # no heartbeat has said so yet
    flight.order(GoTo(1, NORTH))
    flight.run_until(HandedOver)
    assert flight.copter.mode == FakeCopter.pilot_mode
    assert flight.copter.target_m is None or flight.copter.target_m[1] < 1.0


def test_a_px4_can_be_pulled_back_only_until_a_heartbeat_has_told_of_the_take_over() -> None:
    flight = BridgeFlight(FakePx4(ORIGIN)).prepared()
    flight.copter.set_mode(FakePx4.pilot_mode)
    flight.order(GoTo(1, NORTH))
    assert flight.copter.mode == FakePx4.own_mode, "no heartbeat has told of it yet"

    flight.copter.set_mode(FakePx4.pilot_mode)  # by the sticks
    flight.run_until(HandedOver, limit_s=1.0)
    flight.order(GoTo(2, SOUTH))
    flight.run(10.0)
    assert flight.copter.mode == FakePx4.pilot_mode


def test_return_leaves_the_vehicle_to_a_pilot_who_flies_it(fake: type[FakeCopter]) -> None:
    flight = BridgeFlight(fake(ORIGIN)).flying()
    flight.copter.set_mode(fake.pilot_mode)
    flight.run_until(HandedOver)
    flight.copter.heard.clear()
    assert flight.order(Return("mission ended")) == [
        HandedOver(f"its pilot flies it in {fake.mode_names[fake.pilot_mode]}")
    ]
    flight.run(5.0)
    assert not flight.copter.commands(SET_MODE)


def test_return_of_a_vehicle_that_returns_by_failsafe_waits_for_the_landing(
    fake: type[FakeCopter],
) -> None:
    flight = BridgeFlight(fake(ORIGIN)).flying()
    flight.copter.set_mode(fake.return_mode)
    flight.run_until(HandedOver)
    flight.copter.heard.clear()
    flight.order(Return("mission ended"))
    flight.run_until(Home())
    assert not flight.copter.armed
    assert not flight.copter.commands(SET_MODE)


def test_vehicle_that_a_pilot_gives_back_returns(fake: type[FakeCopter]) -> None:
    flight = BridgeFlight(fake(ORIGIN)).flying()
    flight.copter.set_mode(fake.pilot_mode)
    flight.run_until(HandedOver)
    flight.copter.set_mode(fake.own_mode)
    flight.run(1.0)
    flight.order(Return("mission ended"))
    flight.run_until(Home())


def test_reboot_in_flight_hands_over(fake: type[FakeCopter]) -> None:
    flight = BridgeFlight(fake(ORIGIN)).flying()
    flight.copter.boot_s = 0.0  # its heartbeat does not give it away
    flight.copter.power_on(flight.now_s)
    flight.copter.mode, flight.copter.armed = fake.own_mode, True
    flight.copter._intervals_s = {33: 0.1}
    flight.copter._due_s = {33: flight.now_s}
    flight.copter.heard.clear()
    assert flight.run_until(HandedOver) == HandedOver("the autopilot rebooted")
    flight.run(10.0)
    assert set(flight.copter.count()) == {INTERVAL}


def test_reboot_is_seen_in_the_heartbeat_too(fake: type[FakeCopter]) -> None:
    flight = BridgeFlight(fake(ORIGIN)).flying()
    flight.copter.power_on(flight.now_s)
    flight.run_until(HandedOver("the autopilot rebooted"), limit_s=2.0)


def test_vehicle_that_disarms_in_flight_is_handed_over(fake: type[FakeCopter]) -> None:
    flight = BridgeFlight(fake(ORIGIN)).flying()
    flight.copter.armed = False
    flight.run_until(HandedOver("the vehicle disarmed by itself"))


def test_a_bridge_that_was_itself_held_up_does_not_take_its_vehicle_for_silent(
    fake: type[FakeCopter],
) -> None:
    flight = BridgeFlight(fake(ORIGIN)).flying()
    flight.now_s += 30.0  # nobody steps the bridge meanwhile, and nothing is read
    reports = flight.happen(TimePassed())
    flight.run_until(Arrived(1))
    assert not any(isinstance(report, HandedOver) for report in [*reports, *flight.reports])


def test_a_vehicle_that_stays_silent_after_the_bridge_was_held_up_is_handed_over(
    fake: type[FakeCopter],
) -> None:
    flight = BridgeFlight(fake(ORIGIN)).flying()
    flight.copter.silent = True
    flight.now_s += 30.0
    held_up_s = flight.now_s
    assert flight.run_until(HandedOver) == HandedOver("nothing heard for 5 s")
    assert 4.0 <= flight.now_s - held_up_s <= 6.0


def test_silent_vehicle_is_handed_over_and_can_be_prepared_again(fake: type[FakeCopter]) -> None:
    flight = BridgeFlight(fake(ORIGIN)).flying()
    flight.copter.silent = True
    before_s = flight.now_s
    assert flight.run_until(HandedOver) == HandedOver("nothing heard for 5 s")
    assert 4.0 <= flight.now_s - before_s <= 6.0
    order = Return("mission ended")
    assert flight.order(order) == [Refused(order, "the autopilot is silent")]

    flight.copter.silent = False
    flight.run(3.0)
    flight.copter.heard.clear()
    flight.order(replace(START, resume=True))
    flight.run_until(VehicleReady())
    assert not flight.copter.commands(SET_MODE)


def test_silent_vehicle_that_speaks_again_can_be_called_home(fake: type[FakeCopter]) -> None:
    flight = BridgeFlight(fake(ORIGIN)).flying()
    flight.copter.silent = True
    flight.run_until(HandedOver)
    flight.copter.silent = False
    flight.run(2.0)
    flight.order(Return("mission ended"))
    flight.run_until(Home())


def test_short_loss_of_the_link_is_ridden_out(fake: type[FakeCopter]) -> None:
    flight = BridgeFlight(fake(ORIGIN)).prepared()
    flight.order(GoTo(1, NORTH))
    flight.happen(LinkClosed())
    flight.copter.silent = True
    flight.run(3.0)
    flight.copter.silent = False
    flight.copter.heard.clear()
    flight.happen(LinkOpened())
    flight.run_until(Arrived(1))
    assert len(flight.copter.commands(INTERVAL)) >= len(fake.streams_asked)
    assert flight.reports == [Arrived(1)]


def test_position_stream_that_stops_in_flight_is_asked_for_again(fake: type[FakeCopter]) -> None:
    flight = BridgeFlight(fake(ORIGIN)).flying(east_m=40.0)
    del flight.copter._intervals_s[33]
    flight.run_until(Arrived(1))


def test_vehicle_returns_lands_and_disarms(fake: type[FakeCopter]) -> None:
    flight = BridgeFlight(fake(ORIGIN)).flying()
    flight.copter.heard.clear()
    flight.order(Return("mission ended"))
    flight.run(2.0)
    assert flight.copter.mode == fake.return_mode
    assert not flight.reports
    flight.order(Return("again"))
    flight.run_until(Home())
    assert not flight.copter.armed
    assert flight.reports == [Home()]
    assert len(flight.copter.commands(SET_MODE)) == 1
    assert flight.order(Return("again")) == [Home()]


def test_return_mode_that_is_refused_is_set_again_and_then_reported(fake: type[FakeCopter]) -> None:
    flight = BridgeFlight(fake(ORIGIN)).prepared()
    flight.copter.verdicts[SET_MODE] = [FAILED] * 99
    order = Return("mission ended")
    flight.order(order)
    refused = flight.run_until(Refused)
    assert refused == Refused(order, "the return mode cannot be set (failed)")


def test_pilot_who_stops_the_return_keeps_the_vehicle(fake: type[FakeCopter]) -> None:
    for mode in (fake.pilot_mode, fake.own_mode):
        flight = BridgeFlight(fake(ORIGIN)).flying()
        flight.order(Return("mission ended"))
        flight.run(2.0)
        flight.copter.set_mode(mode)
        flight.run_until(HandedOver)
        flight.copter.heard.clear()
        flight.run(5.0)
        assert not flight.copter.commands(SET_MODE)


def test_return_of_a_vehicle_never_heard_is_home_at_once(fake: type[FakeCopter]) -> None:
    assert BridgeFlight(fake(ORIGIN)).order(Return("abort")) == [Home()]


def test_second_mission_follows_the_first(fake: type[FakeCopter]) -> None:
    flight = BridgeFlight(fake(ORIGIN)).flying()
    flight.order(Return("mission ended"))
    flight.run_until(Home())
    flight.order(START)
    flight.run_until(VehicleReady())


@pytest.mark.parametrize("seed", range(6))
def test_lossy_doubling_link_delays_but_does_not_break_a_flight(
    fake: type[FakeCopter], seed: int
) -> None:
    rough = rough_link(seed)
    config = BridgeConfig(1, ORIGIN, position_rate_hz=10.0, commands=CommandPolicy(tries=9))
    flight = BridgeFlight(fake(ORIGIN), config, to_vehicle=rough, to_bridge=rough)
    flight.order(START)
    flight.run_until(VehicleReady(), limit_s=120.0)
    for leg, target in enumerate((NORTH, SOUTH, HERE), start=1):
        flight.order(GoTo(leg, target))
        flight.run_until(Arrived(leg), limit_s=120.0)
        assert math.dist(flight.copter.position_m, target) < 1.0
    flight.order(Return("mission ended"))
    flight.run_until(Home(), limit_s=120.0)
