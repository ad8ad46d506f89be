"""What a scenario says of its kinds of vehicles, and what it must not ask of them."""

from __future__ import annotations

import math
import tomllib

import pytest

from coordinator.core.publication import mission_config_of
from swarm.model import Mission
from swarm.model.layers import FlightLayers
from swarm.model.mission import kinds_of
from swarm.model.vehicles import VehicleKind
from swarm.protocol.board_arrays import fleet_of
from swarm.protocol.codec import Codec
from swarm.protocol.encoding import encode
from swarm.protocol.messages import Message, Stamp
from swarm.runtime.errors import InputError
from swarm.scenario.read import build_mission
from swarm.scenario.write import format_scenario
from swarm.separation.fleet_layers import fleet_layers_m

TEXT = """
schema = 2
name = "mixed"
[mission]
horizon_s = 500.0
[origin]
lat_deg = 47.0
lon_deg = 8.0
alt_m = 400.0
[[uav]]
id = "copter"
position_m = [0.0, 0.0]
speed_m_s = 8.0
[[uav]]
id = "rover"
vehicle = "rover"
position_m = [10.0, 0.0]
speed_m_s = 3.0
acceleration_m_s2 = 1.0
[[uav]]
id = "plane"
vehicle = "quadplane"
position_m = [20.0, 0.0]
speed_m_s = 20.0
turn_radius_m = 70.0
[[task]]
id = "t1"
kind = "place"
position_m = [100.0, 0.0]
value = 1.0
"""
RUNWAY = TEXT.replace('"quadplane"', '"plane"').replace(
    "turn_radius_m = 70.0", "turn_radius_m = 70.0\nlanding_heading_deg = 270.0"
)
LINE = '[[task]]\nid = "line"\nkind = "row"\nvalue = 1.0\npath_m = [[0.0, 9.0], [90.0, 9.0]]\n'
BASE = '[[base]]\nid = "b"\nposition_m = [0.0, 50.0]\n'
ZONE = '[[zone]]\nid = "z"\npolygon_m = [[300.0, 0.0], [310.0, 0.0], [310.0, 10.0]]\n'


def mission(text: str = TEXT) -> Mission:
    return build_mission(tomllib.loads(text), "x")


def fault(text: str) -> str:
    with pytest.raises(InputError) as caught:
        mission(text)
    return str(caught.value)


def without(*ids: str) -> str:
    """That scenario without some of its UAVs."""
    head, *tables = TEXT.split("[[uav]]")
    last, task = tables[-1].split("[[task]]")
    kept = [t for t in (*tables[:-1], last) if not any(f'id = "{each}"' in t for each in ids)]
    return head + "".join("[[uav]]" + each for each in kept) + "[[task]]" + task


def test_uavs_are_what_the_file_says_and_copters_otherwise() -> None:
    read = mission()
    assert kinds_of(read) == (VehicleKind.COPTER, VehicleKind.ROVER, VehicleKind.QUADPLANE)
    assert read.uavs[2].turn_radius_m == pytest.approx(70.0)
    assert read.uavs[2].acceleration_m_s2 == pytest.approx(20.0**2 / 70.0)
    assert [uav.turn_radius_m for uav in read.uavs[:2]] == [None, None]
    assert read.constraints == ("vehicle", "acceleration_m_s2")


def test_a_rover_has_no_height_of_its_own() -> None:
    copter_m, rover_m, plane_m = fleet_layers_m(mission())
    assert rover_m == 0.0
    assert (copter_m, plane_m) == (FlightLayers().layer_m(0), FlightLayers().layer_m(2))


def test_a_file_that_is_written_says_the_same() -> None:
    read = mission()
    assert mission(format_scenario(read)) == read


def test_agents_are_told_what_they_fly() -> None:
    brief = mission_config_of(mission(), FlightLayers(), 1)
    said = encode(Message("mixed", "coordinator", Stamp(1, 1), brief))
    heard = Codec("mixed").decode("swarm/mixed/brief", said)
    assert heard is not None
    assert heard.body == brief
    told = fleet_of(brief)
    assert [uav.vehicle for uav in told] == [uav.vehicle for uav in mission().uavs]
    assert told[2].turn_radius_m == pytest.approx(70.0)


def test_a_runway_is_read_written_and_told_to_its_agent() -> None:
    read = mission(RUNWAY)
    assert [uav.landing_heading_rad for uav in read.uavs] == [
        None,
        None,
        pytest.approx(1.5 * math.pi),
    ]
    assert mission(format_scenario(read)) == read
    brief = mission_config_of(read, FlightLayers(), 1)
    assert fleet_of(brief)[2].landing_heading_rad == read.uavs[2].landing_heading_rad
    said = encode(Message("mixed", "coordinator", Stamp(1, 1), brief))
    heard = Codec("mixed").decode("swarm/mixed/brief", said)
    assert heard is not None
    assert heard.body == brief


def test_first_edition_knows_copters_alone() -> None:
    assert "vehicle and turn_radius_m are of schema 2" in fault(
        TEXT.replace("schema = 2", "schema = 1").replace("acceleration_m_s2 = 1.0\n", "")
    )


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            TEXT.replace('"rover"\np', '"car"\np'),
            "'car' is not valid; give one of 'copter', 'rover', 'q",
        ),
        (
            TEXT.replace("turn_radius_m = 70.0\n", ""),
            "turn_radius_m: is missing, and a quadplane waits",
        ),
        (
            TEXT.replace("turn_radius_m = 70.0", "acceleration_m_s2 = 5.0"),
            "does not tell how a quadplane turns; give turn_radius_m",
        ),
        (
            TEXT.replace("acceleration_m_s2 = 1.0", "turn_radius_m = 2.0"),
            "turn_radius_m: is not known of a rover",
        ),
        (
            TEXT.replace("horizon_s = 500.0", "horizon_s = 500.0\nseparation_m = 5.0"),
            "a rover is not known beside separation_m",
        ),
        (
            TEXT.replace("horizon_s = 500.0", "horizon_s = 500.0\nband_m = [20.0, 90.0]"),
            "a quadplane is not known beside band_m",
        ),
        (
            TEXT.replace('"quadplane"', '"plane"'),
            "landing_heading_deg: is missing, and a plane lands along a runway",
        ),
        (
            TEXT.replace("turn_radius_m = 70.0", "turn_radius_m = 70.0\nlanding_heading_deg = 9.0"),
            "landing_heading_deg: does not matter to a quadplane, which lands upright",
        ),
        (RUNWAY.replace("= 270.0", "= 361.0"), "a direction within 0..360"),
        (TEXT + LINE, "a quadplane flies no lines, such as line"),
        (TEXT + BASE, "a quadplane lands where it started"),
        (RUNWAY + BASE, "a plane lands where it started"),
        (RUNWAY + ZONE, "a plane turns beside its way"),
        (TEXT + ZONE, "a quadplane turns beside its way, perhaps in a [[zone]]"),
    ],
)
def test_what_cannot_be_asked_of_them_is_refused_in_one_line(text: str, said: str) -> None:
    assert said in fault(text)


def test_a_rover_drives_lines_round_zones_and_changes_batteries_at_bases() -> None:
    read = mission(without("plane") + LINE + BASE + ZONE)
    assert kinds_of(read) == (VehicleKind.COPTER, VehicleKind.ROVER)


def test_lines_that_a_plane_does_not_take_are_left_to_others() -> None:
    text = TEXT.replace("turn_radius_m = 70.0", "turn_radius_m = 70.0\nsuccess = { row = 0.0 }")
    assert len(mission(text + LINE).tasks) == 2
