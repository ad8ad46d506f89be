"""An agent that is killed while its vehicle takes off flies on with it in its next life."""

from __future__ import annotations

import pytest

from agent.vehicle.config import CommandStyle
from sim.autopilot.firmware import FirmwareModelName
from sim.faults.injector import FaultInjector
from sim.faults.schedule import Disturbance, DisturbanceKind
from sim.world.engine import EventQueue
from sim.world.network import NetworkConditions
from sim.world.rough_network import RoughNetwork
from sim.world.settings import RestartMemory
from tests.support.bridged_crossings import CrossingFleet, mission_of
from tests.support.bridged_fleet import ONE_DIAGONAL

CROSSING = mission_of(((-80.0, 0.0), (80.0, 0.0)), ((0.0, -80.0), (0.0, 80.0)))
"""In one layer, whose air `u0` keeps: without it nobody flies."""


@pytest.mark.parametrize(
    ("at_s", "lasts_s"),
    [(3.5, 1.0), (9.0, 1.0), (9.0, 12.0)],
    ids=["arming", "climbing", "until it hovers"],
)
@ONE_DIAGONAL
def test_it_knows_its_vehicle_again_and_all_is_done(
    flavour: FirmwareModelName,
    style: CommandStyle,
    at_s: float,
    lasts_s: float,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    networks = list[RoughNetwork]()

    def network(queue: EventQueue) -> RoughNetwork:
        networks.append(RoughNetwork(queue, NetworkConditions(), 0))
        return networks[0]

    fleet = CrossingFleet(monkeypatch, flavour, style, CROSSING, network=network, planned=True)
    killed = Disturbance(
        at_s, DisturbanceKind.CRASH, ("u0",), lasts_s=lasts_s, memory=RestartMemory.DISK
    )
    FaultInjector(fleet.world, networks[0], (killed,))

    fleet.fly()

    assert fleet.books["u0"].lives == 2
    fleet.assert_all_done()
