"""The bridge's zones as the fence of simulated autopilots, which heed it as real ones do."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
import shapely
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from agent.core.interface import (
    Arrived,
    Caution,
    GoTo,
    HandedOver,
    Home,
    KeepOut,
    Return,
    ReturnAdvised,
    VehicleReady,
)
from agent.vehicle.config import CommandStyle
from sim.autopilot import events as autopilot
from sim.autopilot.config import VehicleConfig
from sim.autopilot.firmware import FirmwareModelName
from swarm.model import Zone, ZoneId
from swarm.model.frames import wgs84_from_enu
from tests.sitl.test_bridge_autopilot import FLAVOURS, START, STYLES, VEHICLE, JoinedFlight, joined
from tests.support.bridge_flight import ORIGIN

pytestmark = pytest.mark.sitl

WALL = Zone(ZoneId("wall"), ((20.0, -40.0), (30.0, -40.0), (30.0, 30.0), (20.0, 30.0)))
FIELD = Zone(
    ZoneId("field"),
    ((-90.0, -90.0), (90.0, -90.0), (90.0, 90.0), (-90.0, 90.0)),
    inclusive=True,
)
AROUND = Zone(ZoneId("new"), ((-55.0, -15.0), (-25.0, -15.0), (-25.0, 15.0), (-55.0, 15.0)))
ROUND = ((17.0, 36.0, 10.0), (33.0, 36.0, 10.0))
BEHIND = (50.0, 0.0, 10.0)


def corners_on(flight: JoinedFlight) -> int:
    return len(flight.vehicle.pilot.fence_store.items)


def forbids(flight: JoinedFlight, east_m: float, north_m: float) -> bool:
    """Whether the autopilot heeds a fence there."""
    return not flight.vehicle.pilot.fence.allows((east_m, north_m, 10.0))


def fenced(
    flavour: FirmwareModelName,
    style: CommandStyle,
    *zones: Zone,
    vehicle: VehicleConfig = VEHICLE,
) -> JoinedFlight:
    """A vehicle that hovers at its start, with these zones told before."""
    flight = joined(flavour, style, vehicle)
    flight.to_bridge(KeepOut(zones, 3.0))
    flight.to_bridge(START)
    flight.run_until(VehicleReady())
    return flight


def undisturbed(flight: JoinedFlight) -> bool:
    return not any(isinstance(report, HandedOver | Caution) for _, report in flight.reports)


@FLAVOURS
@STYLES
def test_a_mission_round_a_zone_is_flown_within_the_autopilots_own_fence(
    flavour: FirmwareModelName, style: CommandStyle
) -> None:
    flight = fenced(flavour, style, FIELD, WALL)
    assert corners_on(flight) == 8
    assert forbids(flight, 25.0, 0.0)
    assert forbids(flight, 100.0, 0.0)
    flight.to_bridge(GoTo(1, BEHIND, via_enu_m=ROUND))
    flight.run_until(Arrived(1))
    flight.to_bridge(Return("done", via_enu_m=(5.0, 1.0, 10.0), path_enu_m=ROUND[::-1], land=True))
    flight.run_until(Home())
    way = shapely.LineString([place[:2] for place in flight.track_enu_m])
    assert shapely.distance(WALL.shape(), way) >= 3.0 - 0.05
    assert corners_on(flight) == 0
    assert undisturbed(flight)


@FLAVOURS
@STYLES
def test_a_zone_that_is_gone_is_flown_through_at_once(
    flavour: FirmwareModelName, style: CommandStyle
) -> None:
    flight = fenced(flavour, style, FIELD, WALL)
    flight.to_bridge(GoTo(1, (16.0, 0.0, 10.0)))
    flight.run_until(Arrived(1))
    flight.to_bridge(KeepOut((FIELD,), 3.0))
    flight.to_bridge(GoTo(2, (25.0, 0.0, 10.0)))
    flight.run_until(Arrived(2))
    flight.wait(5.0)
    assert corners_on(flight) == 4
    assert forbids(flight, 100.0, 0.0)
    assert undisturbed(flight)


@FLAVOURS
@STYLES
def test_a_zone_drawn_over_it_is_heeded_once_it_has_left(
    flavour: FirmwareModelName, style: CommandStyle
) -> None:
    flight = fenced(flavour, style, WALL)
    flight.to_bridge(GoTo(1, (-40.0, 0.0, 10.0)))
    flight.run_until(Arrived(1))
    flight.to_bridge(KeepOut((WALL, AROUND), 0.0))
    flight.wait(5.0)
    assert corners_on(flight) == 4
    flight.to_bridge(GoTo(2, (-40.0, 30.0, 10.0)))
    flight.run_until(Arrived(2))
    flight.wait(5.0)
    assert corners_on(flight) == 8
    assert undisturbed(flight)


@FLAVOURS
@STYLES
def test_a_zone_drawn_right_before_it_is_not_on_it_before_it_has_turned_away(
    flavour: FirmwareModelName, style: CommandStyle
) -> None:
    heavy = replace(VEHICLE, acceleration_m_s2=1.5, rounds_corners=True)
    flight = fenced(flavour, style, vehicle=heavy)
    flight.to_bridge(GoTo(1, (200.0, 0.0, 10.0)))
    flight.wait(12.0)
    east_m, north_m, _ = flight.track_enu_m[-1]
    near_m = east_m + 2.0
    ahead = ((near_m, -40.0), (near_m + 30.0, -40.0), (near_m + 30.0, 40.0), (near_m, 40.0))
    flight.to_bridge(KeepOut((Zone(ZoneId("ahead"), ahead),), 0.0))
    flight.to_bridge(GoTo(2, (east_m - 30.0, north_m, 10.0)))
    flight.run_until(Arrived(2))
    assert max(at[0] for at in flight.track_enu_m) > near_m  # nobody stops in no time
    flight.wait(5.0)
    assert corners_on(flight) == 4
    assert undisturbed(flight)


@FLAVOURS
def test_somebody_who_sends_it_through_a_zone_meets_its_fence(flavour: FirmwareModelName) -> None:
    """ArduCopter returns, PX4 holds and is alarmed: the last line, behind the agent's check."""
    flight = fenced(flavour, CommandStyle.REPOSITION, WALL)
    lat_deg, lon_deg, alt_m = wgs84_from_enu(ORIGIN, BEHIND)
    place = (round(lat_deg * 1e7), round(lon_deg * 1e7), alt_m)
    params = (-1.0, 1.0, 0.0, math.nan)
    flight.to_vehicle(
        autopilot.MavlinkReceived(
            0, mavlink.MAVLink_command_int_message(1, 1, 5, 192, 0, 0, *params, *place)
        )
    )
    acts = HandedOver if flavour is FirmwareModelName.ARDUPILOT else ReturnAdvised
    flight.run_until(acts, limit_s=20.0)
    inside = [at for at in flight.track_enu_m if WALL.shape().contains(shapely.Point(at[:2]))]
    assert inside
    assert max(east_m for east_m, _, _ in inside) < 23.0


@FLAVOURS
def test_a_link_that_dies_in_the_middle_of_an_upload_leaves_the_old_fence(
    flavour: FirmwareModelName,
) -> None:
    flight = fenced(flavour, CommandStyle.REPOSITION, WALL)
    sent = 0
    decode = flight.codec.decode

    def cut(data: bytes) -> list[object]:
        nonlocal sent
        messages = decode(data)
        sent += sum(message.get_type() == "MISSION_ITEM_INT" for message in messages)
        return [] if sent > 2 else messages

    flight.codec.decode = cut  # type: ignore[method-assign]
    flight.to_bridge(KeepOut((WALL, FIELD), 3.0))
    flight.wait(20.0)
    assert corners_on(flight) == 4
    assert forbids(flight, 25.0, 0.0)
    flight.codec.decode = decode  # type: ignore[method-assign]
    flight.wait(90.0)
    assert corners_on(flight) == 8
