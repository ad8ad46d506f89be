"""What befalls vehicles over hills: ways into the ground, bases up the slope, zones over them."""

from __future__ import annotations

import pytest
import shapely

from agent.core.interface import (
    Arrived,
    GoTo,
    HandedOver,
    Landed,
    Prepare,
    Refused,
    VehicleReady,
    VehicleReport,
)
from agent.vehicle.config import BridgeConfig, CommandStyle
from coordinator.operator.zone_edits import NewZone
from sim.autopilot.config import fleet_of
from sim.autopilot.firmware import FirmwareModelName
from sim.world.bridged_vehicle import BridgedVehicle, Equipment
from sim.world.engine import EventQueue
from swarm.allocation.legs.ground import ground_of
from swarm.model import Mission
from swarm.scenario import load_scenario
from swarm.scenario.files import resolve_scenario
from swarm.scenario.read import parse_scenario
from tests.support.bridged_fleet import long_flight
from tests.support.bridged_ridge import RidgeFleet

BARN = """
[[base]]
id = "barn"
position_m = [150.0, -20.0]
swap_s = 15.0
slots = 1
"""
ZONE_M = 35.0


@pytest.fixture(scope="module", name="ridge")
def _ridge() -> Mission:
    return load_scenario(resolve_scenario("ridge"))


@pytest.fixture(scope="module", name="with_base")
def _with_base() -> Mission:
    """The ridge with a base half up its slope, and batteries that are not full at first."""
    path = resolve_scenario("ridge")
    text = path.read_text("utf-8").replace(
        "acceleration_m_s2 = 2.5", "acceleration_m_s2 = 2.5\nendurance_s = 260.0\ncharge_frac = 0.6"
    )
    return parse_scenario((text + BARN).encode(), "barn.toml", path.parent)


class LedVehicle:
    """A vehicle of that mission in the air above its start, and what is heard of it."""

    def __init__(self, mission: Mission, flavour: FirmwareModelName, *, guard: bool) -> None:
        assert mission.terrain is not None
        assert mission.origin is not None
        self.queue = EventQueue()
        self.heard: list[VehicleReport] = []
        config = fleet_of(mission)[0].config
        terrain = mission.terrain if guard else None
        bridge = BridgeConfig(1, mission.origin, ready_by_itself=True, terrain=terrain)
        self.ground = ground_of(mission.terrain)
        self.vehicle = BridgedVehicle(
            self.queue, "uav1", self.heard.append, Equipment(config, bridge, flavour), 0
        )
        east_m, north_m, up_m = config.start_enu_m
        self.vehicle.order(Prepare((east_m, north_m, up_m + 20.0), 10.0), VehicleReady())
        self.until(VehicleReady)

    def until(self, kind: type, patience_s: float = 120.0) -> VehicleReport:
        end_s = self.queue.now_s() + patience_s
        while self.queue.now_s() < end_s:
            self.queue.run(self.queue.now_s() + 0.5)
            for each in self.heard:
                if isinstance(each, kind):
                    return each
        raise AssertionError(f"no {kind}; heard {self.heard[-5:]}")


@pytest.mark.parametrize("flavour", FirmwareModelName)
def test_who_is_led_into_a_hill_is_wrecked_there(
    flavour: FirmwareModelName, ridge: Mission
) -> None:
    led = LedVehicle(ridge, flavour, guard=False)
    behind = next(task for task in ridge.tasks if task.id == "behind").position_enu_m

    led.vehicle.order(GoTo(1, (*behind[:2], behind[2] + 20.0)), VehicleReady())
    told = led.until(HandedOver)

    assert isinstance(told, HandedOver)
    assert told.reason
    assert not any(isinstance(each, Arrived) for each in led.heard)
    led.queue.run(led.queue.now_s() + 30.0)
    pilot = led.vehicle.pilot()
    assert not pilot.armed
    east_m, north_m, up_m = pilot.position_enu_m(led.queue.now_s())
    assert 100.0 < east_m < 320.0
    assert up_m == pytest.approx(led.ground.one_up_m(east_m, north_m), abs=0.6)


@pytest.mark.parametrize("flavour", FirmwareModelName)
def test_a_bridge_that_knows_the_ground_does_not_lead_into_it(
    flavour: FirmwareModelName, ridge: Mission
) -> None:
    led = LedVehicle(ridge, flavour, guard=True)
    behind = next(task for task in ridge.tasks if task.id == "behind").position_enu_m

    led.vehicle.order(GoTo(1, (*behind[:2], behind[2] + 20.0)), VehicleReady())
    told = led.until(Refused)

    assert isinstance(told, Refused)
    assert "the ground lies in the way" in told.reason
    assert led.vehicle.pilot().armed


@long_flight(FirmwareModelName.ARDUPILOT, CommandStyle.REPOSITION)
def test_batteries_are_changed_up_the_slope(
    flavour: FirmwareModelName, style: CommandStyle, with_base: Mission
) -> None:
    (barn,) = with_base.bases
    assert barn.position_enu_m[2] > with_base.uavs[0].position_enu_m[2] + 10.0
    fleet = RidgeFleet(flavour, style, with_base)

    fleet.fly(1500.0)

    assert with_base.terrain is not None
    fleet.assert_all_done()
    landings = [
        each for book in fleet.books.values() for _, each in book.reported if type(each) is Landed
    ]
    assert landings
    assert fleet.lowest_m >= with_base.terrain.clearance_m, fleet.lowest_at


@long_flight(FirmwareModelName.PX4, CommandStyle.REPOSITION)
def test_a_zone_drawn_over_a_uav_over_hills_is_left_above_the_ground(
    flavour: FirmwareModelName, style: CommandStyle, ridge: Mission
) -> None:
    fleet = RidgeFleet(flavour, style, ridge)
    drawn: list[tuple[str, shapely.Polygon, float]] = []
    inside_s: dict[str, float] = {}

    def seen(uav: str, place: tuple[float, float, float]) -> None:
        now_s, (east_m, north_m) = fleet.world.queue.now_s(), place[:2]
        if not drawn and 150.0 < east_m < 230.0:
            west_m, south_m = east_m - ZONE_M, north_m - ZONE_M
            box = shapely.box(west_m, south_m, east_m + ZONE_M, north_m + ZONE_M)
            if any(box.intersects(shapely.Point(task.position_enu_m[:2])) for task in ridge.tasks):
                return
            drawn.append((uav, box, now_s))
            corners = tuple((x, y) for x, y in box.exterior.coords[:-1])
            fleet.seats.append(fleet.world.operate(NewZone("sudden", corners)))
        elif drawn and uav == drawn[0][0] and drawn[0][1].contains(shapely.Point(place[:2])):
            inside_s[uav] = now_s - drawn[0][2]

    fleet.when_seen = seen
    fleet.fly(900.0)

    assert ridge.terrain is not None
    assert len(drawn) == 1
    assert inside_s[drawn[0][0]] <= 15.0
    fleet.assert_all_done()
    assert fleet.lowest_m >= ridge.terrain.clearance_m, fleet.lowest_at
