"""Missions over links that lose messages: in force, or reported and the old target kept."""

from __future__ import annotations

import math

import pytest

from agent.core.interface import Arrived, GoTo, HandedOver, Hold, Home, Refused, Return
from agent.vehicle.config import BridgeConfig, CommandStyle
from tests.support.bridge_flight import ORIGIN, START, BridgeFlight, rough_link
from tests.support.fake_copter import FakeCopter
from tests.support.fake_px4 import FakePx4
from tests.support.seeds import seeds

MISSIONS = BridgeConfig(1, ORIGIN, command=CommandStyle.MISSION, mission_patience_s=30.0)
OLD, NEW, EAST = (305.0, 0.0, 12.0), (5.0, 60.0, 12.0), (45.0, 0.0, 12.0)
_MISSION_IDS = frozenset({40, 41, 43, 44, 47, 51, 73})
_MESSAGES = 15
"""Of ours in an upload to ArduCopter; PX4 takes six less."""
_SHAPES = {FakeCopter: [178, 222, 92, 16, 20], FakePx4: [178, 16, 20]}


def _every_second(first: int) -> list[object]:
    """Every message of an upload, of which every second from ``first`` on is lost by day."""
    return [
        index if index % 2 == first else pytest.param(index, marks=pytest.mark.slow)
        for index in range(_MESSAGES)
    ]


EVEN_BY_DAY, ODD_BY_DAY = _every_second(0), _every_second(1)


class Cut:
    """Loses one mission message, or everything from it on."""

    def __init__(self, index: int, *, forever: bool) -> None:
        self.index, self.forever = index, forever
        self.seen = 0

    def __call__(self, data: bytes) -> list[bytes]:
        mission = int.from_bytes(data[7:10], "little") in _MISSION_IDS
        self.seen += mission
        after = self.seen > self.index + 1 or (mission and self.seen == self.index + 1)
        lost = after if self.forever else mission and self.seen == self.index + 1
        return [] if lost else [data]


def under_way(fake: type[FakeCopter]) -> BridgeFlight:
    flight = BridgeFlight(fake(ORIGIN), MISSIONS).prepared()
    flight.order(GoTo(1, OLD))
    flight.run(10.0)
    return flight


def watch(flight: BridgeFlight, *wanted: type, limit_s: float) -> None:
    """Run on, and see that nothing but whole missions to known places is ever flown."""
    known = (START.position_enu_m, OLD, NEW, EAST)
    places = {tuple(round(c, 1) for c in place[:2]) for place in known}
    end_s = flight.now_s + limit_s
    while flight.now_s < end_s and not any(isinstance(r, wanted) for r in flight.reports):
        flight.step()
        mission = flight.copter.mission
        if mission.runs:
            shape = _SHAPES[type(flight.copter)]
            assert [item.command for item in mission.items[-len(shape) :]] == shape
        assert set(mission.flown) <= places


def target_of(flight: BridgeFlight) -> tuple[float, float, float]:
    target_m = flight.copter.target_m
    assert target_m is not None
    return target_m


def keeps(flight: BridgeFlight, target: tuple[float, float, float]) -> bool:
    """Whether the vehicle flies to that target or waits there, or was stopped."""
    copter = flight.copter
    stopped = copter.mode == copter.own_mode and copter.velocity_m_s == (0.0, 0.0, 0.0)
    return stopped or math.dist(target_of(flight), target) < 0.1


@pytest.mark.parametrize("up", [True, False], ids=["to the vehicle", "from it"])
@pytest.mark.parametrize("index", EVEN_BY_DAY)
def test_one_lost_message_only_delays(fake: type[FakeCopter], index: int, *, up: bool) -> None:
    flight = under_way(fake)
    cut = Cut(index, forever=False)
    if up:
        flight.to_vehicle = cut
    else:
        flight.to_bridge = cut
    flight.order(GoTo(2, NEW))
    watch(flight, Arrived, Refused, limit_s=200.0)
    assert flight.reports == [Arrived(2)]


@pytest.mark.parametrize("index", ODD_BY_DAY)
def test_vehicle_that_hears_nothing_more_flies_one_target_or_the_other_and_then_home(
    fake: type[FakeCopter], index: int
) -> None:
    flight = under_way(fake)
    flight.to_vehicle = Cut(index, forever=True)
    order = GoTo(2, NEW)
    flight.order(order)
    watch(flight, Refused, Arrived, HandedOver, limit_s=100.0)
    first = flight.reports[0]
    assert first == Arrived(2) or (isinstance(first, Refused) and first.order == order)
    if isinstance(first, Refused):
        assert min(math.dist(target_of(flight), place) for place in (OLD, NEW)) < 0.1
    while flight.copter.armed:
        flight.step()
        assert flight.now_s < 1_000.0
    assert math.dist(flight.copter.position_m, flight.copter.home_m) < 0.5
    assert not any(r == Arrived(1) for r in flight.reports)


@pytest.mark.parametrize("index", EVEN_BY_DAY)
def test_vehicle_that_is_heard_no_more_is_handed_over(fake: type[FakeCopter], index: int) -> None:
    flight = under_way(fake)
    flight.to_bridge = Cut(index, forever=True)
    flight.order(GoTo(2, NEW))
    watch(flight, HandedOver, Arrived, limit_s=60.0)
    if Arrived(2) not in flight.reports:
        assert flight.reports[-1] == HandedOver("nothing heard for 5 s")


@pytest.mark.parametrize("index", ODD_BY_DAY)
def test_outage_of_the_missions_alone_keeps_or_restores_the_old_target(
    fake: type[FakeCopter], index: int
) -> None:
    flight = under_way(fake)
    seen, began_s = 0, flight.now_s

    def lost(data: bytes) -> list[bytes]:
        nonlocal seen
        mission = int.from_bytes(data[7:10], "little") in _MISSION_IDS
        seen += mission
        return [] if mission and seen > index and flight.now_s < began_s + 15.0 else [data]

    flight.to_vehicle = lost
    order = GoTo(2, NEW)
    flight.order(order)
    watch(flight, Refused, Arrived, limit_s=100.0)
    if flight.reports == [Arrived(2)]:
        return
    [refused] = flight.reports
    assert isinstance(refused, Refused)
    assert refused.order == order
    flight.run(8.0)
    assert keeps(flight, OLD)
    flight.reports.clear()
    flight._read = 0
    flight.order(GoTo(3, NEW))
    flight.run_until(Arrived(3), limit_s=200.0)


def test_vehicle_whose_mission_is_not_known_is_stopped_and_told_so(
    fake: type[FakeCopter],
) -> None:
    flight = under_way(fake)
    copter = flight.copter
    flight.order(GoTo(2, NEW))
    flight.step()
    copter._handlers["MISSION_REQUEST_LIST"] = lambda _: None
    copter._handlers["MISSION_REQUEST_INT"] = lambda _: None
    flight.order(GoTo(3, EAST))
    watch_s = flight.now_s + 80.0
    while copter.mode == copter.mission_mode:
        flight.step()
        assert flight.now_s < watch_s
    flight.run(5.0)
    refused = [r for r in flight.reports if isinstance(r, Refused)]
    assert [r.order for r in refused] == [GoTo(3, EAST)]
    assert copter.mode == copter.own_mode
    assert copter.velocity_m_s == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("seed", seeds(5, 15))
def test_a_fifth_of_all_messages_lost_delays_but_does_not_break_a_flight(
    fake: type[FakeCopter], seed: int
) -> None:
    flight = BridgeFlight(fake(ORIGIN), MISSIONS).prepared()
    flight.to_vehicle = flight.to_bridge = rough_link(seed)
    leg, last = 0, None
    for target in (EAST, NEW, EAST):
        for _ in range(3):
            leg += 1
            flight.reports.clear()
            flight.order(GoTo(leg, target))
            watch(flight, Arrived, Refused, limit_s=200.0)
            [end] = flight.reports
            if end == Arrived(leg):
                assert math.dist(flight.copter.position_m, target) < 1.0
                last = target
                break
            assert isinstance(end, Refused)
            assert isinstance(end.order, GoTo | Hold)
            flight.run(10.0)
            assert last is None or keeps(flight, last)
        else:
            raise AssertionError(f"no luck with {target}: {flight.reports}")
    flight.reports.clear()
    flight._read = 0
    flight.order(Return("mission ended"))
    flight.run_until(Home(), limit_s=200.0)
