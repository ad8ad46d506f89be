"""A zone is drawn over a bridged vehicle that keeps a separation, on every firmware and style.

Its bridge refuses what virtual vehicles fly: no way that stays in a zone is commanded.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import pytest
import shapely

from agent.core.interface import Refused
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
DRAWN_BY_S = 120.0
LEAVES_S = 12.0
"""It has stopped by then, and is out of the zone, by 20 m at most."""
COMES_BACK_S = 40.0
"""As much for one that brakes for 20 m, and comes back so far."""
UAVS = BESIDE_EACH_OTHER.uavs


class ZonedFleet(CrossingFleet):
    """Two that fly beside each other, until a zone is drawn over one of them.

    Args:
        sent_home: whether the operator sends that one home while it leaves the zone.
        rough: what is less than ideal; None: nothing, and vehicles stop at once.
        corners: of the zone, from where the UAV is [m].
    """

    def __init__(
        self,
        monkeypatch: pytest.MonkeyPatch,
        flavour: FirmwareModelName,
        style: CommandStyle,
        *,
        sent_home: bool,
        rough: Roughness | None = None,
        corners: Sequence[tuple[float, float]] = CORNERS,
    ) -> None:
        mission = BESIDE_EACH_OTHER if rough is None else rough.mission
        super().__init__(monkeypatch, flavour, style, mission, planned=True, rough=rough)
        self._sent_home, self._corners = sent_home, corners
        self._zone: Zone | None = None
        self._drawn_s = self._inside_s = math.inf
        self.at(LOOK_S, self._look_at_zone)

    @property
    def left_after_s(self) -> float:
        """How long it was in the zone."""
        return self._inside_s - self._drawn_s

    def _look_at_zone(self) -> None:
        now_s = self.world.queue.now_s()
        place_m = self.vehicles["u0"].pilot().position_enu_m(now_s)
        if self._zone is None and place_m[0] >= DRAWN_EAST_M:
            self._draw(now_s, place_m)
        if self._zone is not None and self._zone.shape().contains(shapely.Point(place_m)):
            self._inside_s = now_s
        if "u0" in self.world.alive or now_s < DRAWN_BY_S:
            self.at(now_s + LOOK_S, self._look_at_zone)

    def _draw(self, now_s: float, place_m: Point) -> None:
        corners = tuple((place_m[0] + east, place_m[1] + north) for east, north in self._corners)
        drawn = NewZone("over", corners)
        self._zone, self._drawn_s = drawn.spec(None).zone(), now_s
        self.world.operate(drawn)
        if self._sent_home:
            self.say(now_s + 2.0, CommandKind.RETURN, "u0")


@ONE_DIAGONAL
def test_who_is_told_to_fly_home_on_its_way_out_comes_home(
    flavour: FirmwareModelName, style: CommandStyle, monkeypatch: pytest.MonkeyPatch
) -> None:
    fleet = ZonedFleet(monkeypatch, flavour, style, sent_home=True)

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
    fleet = ZonedFleet(monkeypatch, flavour, style, sent_home=False)

    fleet.fly()

    fleet.assert_all_done()
    assert fleet.books["u0"].reasons(Refused) == []
    assert 0.0 < fleet.left_after_s < LEAVES_S, fleet.left_after_s


@ONE_DIAGONAL
def test_who_stops_in_a_zone_that_it_has_shot_out_of_is_not_driven_off_by_its_own_fence(
    flavour: FirmwareModelName, style: CommandStyle, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It brakes for 20 m and comes back; a fence that was put on it meanwhile would be breached."""
    slow = roughly(acceleration_m_s2=1.6)
    rough = Roughness(
        replace(BESIDE_EACH_OTHER, uavs=tuple(replace(u, acceleration_m_s2=1.6) for u in UAVS)),
        {str(u.id): slow for u in UAVS},
        {},
        0.0,
        (),
        frozenset(),
    )
    small = ((-30.0, -12.0), (14.0, -12.0), (14.0, 12.0), (-30.0, 12.0))
    fleet = ZonedFleet(monkeypatch, flavour, style, sent_home=False, rough=rough, corners=small)

    fleet.fly()

    fleet.assert_all_done()
    assert 0.0 < fleet.left_after_s < COMES_BACK_S, fleet.left_after_s
