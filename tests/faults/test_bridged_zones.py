"""A zone is drawn over a bridged vehicle that keeps a separation, on every firmware and style.

Its bridge refuses what virtual vehicles fly: no way that stays in a zone is commanded.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import pytest
import shapely

from agent.core.interface import Refused, ReturnBegun
from agent.vehicle.config import CommandStyle
from coordinator.operator.zone_edits import NewZone
from sim.autopilot.firmware import FirmwareModelName
from swarm.model import Zone
from swarm.protocol.fields import Point
from swarm.protocol.messages import CommandKind
from tests.support.bridged_crossings import LOOK_S, CrossingFleet, Roughness, mission_of, roughly
from tests.support.bridged_fleet import ONE_DIAGONAL, OTHER_DIAGONAL

BESIDE_EACH_OTHER = replace(
    mission_of(((-80.0, 0.0), (80.0, 0.0)), ((-80.0, -60.0), (80.0, -60.0))), zone_margin_m=3.0
)
DRAWN_EAST_M = -40.0
"""Where u0 is then, on its way east at 8 m/s."""
CORNERS = ((-18.0, -20.0), (18.0, -20.0), (18.0, 20.0), (-18.0, 20.0))
"""Of the zone, from there [m]."""
HOMEWARD_EAST_M = 70.0
"""Where u0 is sent home, of 80 m to its task."""
AT_HOME_M = 2.0
DRAWN_BY_S = 120.0
LEAVES_S = 12.0
"""It has stopped by then, and is out of the zone, by 20 m at most."""
COMES_BACK_S = 40.0
"""As much for one that brakes for 20 m, and comes back so far."""


def braking(acceleration_m_s2: float) -> Roughness:
    """The two that fly beside each other, with so much to brake."""
    uavs = [replace(u, acceleration_m_s2=acceleration_m_s2) for u in BESIDE_EACH_OTHER.uavs]
    mission = replace(BESIDE_EACH_OTHER, uavs=tuple(uavs))
    change = roughly(acceleration_m_s2)
    return Roughness(mission, {str(u.id): change for u in uavs}, {}, 0.0, (), frozenset())


class ZonedFleet(CrossingFleet):
    """Two that fly beside each other, until a zone is drawn over one of them.

    Args:
        sent_home_s: how long after that the operator sends that one home; None: not.
        rough: what is less than ideal; None: nothing, and vehicles stop at once.
        corners: of the zone, from where the UAV is [m].
    """

    mission = BESIDE_EACH_OTHER

    def __init__(
        self,
        monkeypatch: pytest.MonkeyPatch,
        flavour: FirmwareModelName,
        style: CommandStyle,
        *,
        sent_home_s: float | None,
        rough: Roughness | None = None,
        corners: Sequence[tuple[float, float]] = CORNERS,
    ) -> None:
        mission = self.mission if rough is None else rough.mission
        super().__init__(monkeypatch, flavour, style, mission, planned=True, rough=rough)
        self._sent_home_s, self._corners = sent_home_s, corners
        self._zone: Zone | None = None
        self._drawn_s = self._inside_s = math.inf
        self._places_m: list[tuple[float, Point]] = []
        self.at(LOOK_S, self._look_at_zone)

    @property
    def left_after_s(self) -> float:
        """How long it was in the zone; infinite: never."""
        return self._inside_s - self._drawn_s

    @property
    def away_m(self) -> float:
        """How far from above its start the return mode took it over, which flies straight [m]."""
        begins_s = self.books["u0"].first_s(ReturnBegun)
        begins_m = next(place_m for at_s, place_m in self._places_m if at_s >= begins_s)
        return math.dist(begins_m[:2], self.mission.uavs[0].position_enu_m[:2])

    def _look_at_zone(self) -> None:
        now_s = self.world.queue.now_s()
        place_m = self.vehicles["u0"].pilot().position_enu_m(now_s)
        self._places_m.append((now_s, place_m))
        if self._zone is None and self._is_time(now_s, place_m):
            self._draw(now_s, place_m)
        if self._zone is not None and self._zone.shape().contains(shapely.Point(place_m)):
            self._inside_s = now_s
        if "u0" in self.world.alive or now_s < DRAWN_BY_S:
            self.at(now_s + LOOK_S, self._look_at_zone)

    def _is_time(self, now_s: float, place_m: Point) -> bool:
        """Whether the zone is drawn now."""
        del now_s
        return place_m[0] >= DRAWN_EAST_M

    def _draw(self, now_s: float, place_m: Point) -> None:
        """The zone, from there."""
        corners = tuple((place_m[0] + east, place_m[1] + north) for east, north in self._corners)
        drawn = NewZone("over", corners)
        self._zone, self._drawn_s = drawn.spec(None).zone(), now_s
        self.world.operate(drawn)
        if self._sent_home_s is not None:
            self.say(now_s + self._sent_home_s, CommandKind.RETURN, "u0")


@ONE_DIAGONAL
def test_who_is_told_to_fly_home_on_its_way_out_comes_home(
    flavour: FirmwareModelName, style: CommandStyle, monkeypatch: pytest.MonkeyPatch
) -> None:
    fleet = ZonedFleet(monkeypatch, flavour, style, sent_home_s=2.0)

    fleet.fly()

    told = "\n".join(fleet.told())
    assert fleet.done_by("u1") == ("t1",), told
    assert fleet.world.finished["u0"] == 0, told
    assert fleet.books["u0"].reasons(Refused) == []
    assert 0.0 < fleet.left_after_s < LEAVES_S, fleet.left_after_s


@OTHER_DIAGONAL
def test_who_flies_leaves_it_and_does_its_task(
    flavour: FirmwareModelName, style: CommandStyle, monkeypatch: pytest.MonkeyPatch
) -> None:
    fleet = ZonedFleet(monkeypatch, flavour, style, sent_home_s=None)

    fleet.fly()

    fleet.assert_all_done()
    assert fleet.books["u0"].reasons(Refused) == []
    assert 0.0 < fleet.left_after_s < LEAVES_S, fleet.left_after_s


@ONE_DIAGONAL
def test_who_stops_in_a_zone_that_it_has_shot_out_of_is_not_driven_off_by_its_own_fence(
    flavour: FirmwareModelName, style: CommandStyle, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It brakes for 20 m and comes back; a fence that was put on it meanwhile would be breached."""
    small = ((-30.0, -12.0), (14.0, -12.0), (14.0, 12.0), (-30.0, 12.0))
    slow = braking(1.6)
    fleet = ZonedFleet(monkeypatch, flavour, style, sent_home_s=None, rough=slow, corners=small)

    fleet.fly()

    fleet.assert_all_done()
    assert 0.0 < fleet.left_after_s < COMES_BACK_S, fleet.left_after_s


@pytest.mark.parametrize(
    ("brakes_m_s2", "later_s", "ahead_m"), [(4.0, 1.0, 15.0), (2.5, 0.3, 6.0)], ids=["late", "soon"]
)
@ONE_DIAGONAL
def test_who_is_told_to_fly_home_while_it_stops_goes_from_where_it_stands(
    flavour: FirmwareModelName,
    style: CommandStyle,
    brakes_m_s2: float,
    later_s: float,
    ahead_m: float,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """And leaves the zone for good, in the air that was granted to it."""
    corners = ((-12.0, -12.0), (ahead_m, -12.0), (ahead_m, 12.0), (-12.0, 12.0))
    slow = braking(brakes_m_s2)
    fleet = ZonedFleet(
        monkeypatch, flavour, style, sent_home_s=later_s, rough=slow, corners=corners
    )

    fleet.fly()

    told = "\n".join(fleet.told())
    assert fleet.world.finished["u0"] == 0, told
    assert fleet.books["u0"].reasons(Refused) == []
    assert 0.0 < fleet.left_after_s < COMES_BACK_S, fleet.left_after_s
    assert fleet.away_m < AT_HOME_M, told


class HomewardFleet(ZonedFleet):
    """One of them is sent home before it is at its task; then a zone is drawn across its way."""

    mission = replace(
        mission_of(((-80.0, 0.0), (80.0, 0.0)), ((-80.0, -160.0), (480.0, -160.0))),
        zone_margin_m=3.0,
    )
    """The other one is on its way all the while: a mission that has ended takes no zones."""
    _turned = False
    """Whether it has been told to."""

    def _is_time(self, now_s: float, place_m: Point) -> bool:
        if place_m[0] > HOMEWARD_EAST_M and not self._turned:
            self._turned = True
            self.say(now_s + LOOK_S, CommandKind.RETURN, "u0")
        return self._turned and place_m[0] < HOMEWARD_EAST_M - 10.0


@OTHER_DIAGONAL
def test_who_flies_home_stops_for_a_zone_across_its_way_and_flies_round_it(
    flavour: FirmwareModelName, style: CommandStyle, monkeypatch: pytest.MonkeyPatch
) -> None:
    ahead = ((-75.0, -15.0), (-45.0, -15.0), (-45.0, 15.0), (-75.0, 15.0))
    fleet = HomewardFleet(monkeypatch, flavour, style, sent_home_s=None, corners=ahead)

    fleet.fly()

    told = "\n".join(fleet.told())
    assert fleet.world.finished["u0"] == 0, told
    assert fleet.books["u0"].reasons(Refused) == []
    assert math.isinf(fleet.left_after_s), told
    assert fleet.away_m < AT_HOME_M, told
