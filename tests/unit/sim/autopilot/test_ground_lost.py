"""What a simulated vehicle does when its ground station falls silent, by its parameters."""

from __future__ import annotations

import math
import struct

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.autopilot.firmware.ardupilot import ArduCopterModel
from sim.autopilot.firmware.px4 import Px4Model
from sim.autopilot.flight import FlightMode
from tests.support.ground_station import ACCEPTED, GroundStation, ground_station

HEARTBEAT = mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, 8, 0, 0, 0, 3)
RETURNS = {ArduCopterModel: {"FS_GCS_ENABLE": 1.0}, Px4Model: {"NAV_DLL_ACT": 2.0}}
LANDS = {ArduCopterModel: {"FS_GCS_ENABLE": 5.0}, Px4Model: {"NAV_DLL_ACT": 3.0}}
AFTER_S = {ArduCopterModel: 5.0, Px4Model: 32.5}
HOLD_S = {ArduCopterModel: 0.0, Px4Model: 5.0}
"""How long it warns before it returns."""
CRITICAL = 5

Kind = type[ArduCopterModel] | type[Px4Model]


@pytest.fixture(params=[ArduCopterModel, Px4Model])
def kind(request: pytest.FixtureRequest) -> Kind:
    """The firmware."""
    chosen: Kind = request.param
    return chosen


def hovering(kind: Kind, parameters: dict[str, float]) -> GroundStation:
    """A vehicle in the air whose ground station has been heard this instant."""
    ground = ground_station(kind())
    for name, value in parameters.items():
        number = value
        if kind is Px4Model:
            [number] = struct.unpack("<f", struct.pack("<i", round(value)))
        answer = ground.send(mavlink.MAVLink_param_set_message(1, 1, name.encode(), number, 6))
        assert {each.get_type() for each in answer} <= {"PARAM_VALUE"}
    if kind is ArduCopterModel:
        ground.take_off(10.0)
    else:
        ground.wait(5.0)
        assert ground.arm() == ACCEPTED
        height_m = ground.vehicle.config.origin.alt_m + 10.0
        place = (math.nan, math.nan, math.nan, height_m)
        assert ground.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, *place) == ACCEPTED
        ground.wait(8.0)
    ground.send(HEARTBEAT)
    return ground


def mode(ground: GroundStation) -> FlightMode:
    return ground.vehicle.pilot.mode


def test_it_hovers_for_ever_unless_it_is_told_otherwise(kind: Kind) -> None:
    ground = hovering(kind, {})
    before = mode(ground)
    ground.wait(200.0)

    assert mode(ground) is before


@pytest.mark.parametrize(
    ("parameters", "then"), [(RETURNS, FlightMode.RTL), (LANDS, FlightMode.LAND)]
)
def test_it_comes_down_when_nobody_is_heard(
    kind: Kind, parameters: dict[Kind, dict[str, float]], then: FlightMode
) -> None:
    ground = hovering(kind, parameters[kind])
    before = mode(ground)
    hold_s = HOLD_S[kind] if then is FlightMode.RTL else 0.0
    ground.wait(AFTER_S[kind] + hold_s - 0.1)
    assert mode(ground) is before

    ground.wait(0.2)
    assert mode(ground) is then
    ground.wait(60.0)
    assert not ground.vehicle.pilot.armed


def test_heartbeats_keep_it_where_it_is(kind: Kind) -> None:
    ground = hovering(kind, RETURNS[kind])
    before = mode(ground)
    for _ in range(60):
        ground.wait(1.0)
        ground.send(HEARTBEAT)

    assert mode(ground) is before


def test_who_was_never_heard_is_not_missed(kind: Kind) -> None:
    ground = ground_station(kind())
    ground.vehicle.pilot.parameters.write(next(iter(RETURNS[kind])), 2.0)
    ground.wait(100.0)

    assert "GCS Failsafe" not in ground.texts()


def test_arducopter_misses_only_whom_it_listens_to() -> None:
    ground = hovering(ArduCopterModel, {"FS_GCS_ENABLE": 1.0, "MAV_GCS_SYSID": 252.0})
    ground.wait(60.0)
    assert mode(ground) is FlightMode.GUIDED

    ground = hovering(
        ArduCopterModel, {"FS_GCS_ENABLE": 1.0, "MAV_GCS_SYSID": 252.0, "MAV_GCS_SYSID_HI": 255.0}
    )
    ground.wait(6.0)
    assert mode(ground) is FlightMode.RTL


def test_px4_spares_the_modes_that_are_excepted() -> None:
    ground = hovering(Px4Model, {"NAV_DLL_ACT": 2.0, "COM_DLL_EXCEPT": 2.0})
    ground.wait(100.0)

    assert mode(ground) is FlightMode.LOITER
