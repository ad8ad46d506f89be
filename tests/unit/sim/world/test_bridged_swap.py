"""The real bridge changes a battery at a base of simulated autopilots, and flies on from there."""

from __future__ import annotations

import pytest

from agent.core.interface import (
    Arrived,
    GoTo,
    HandedOver,
    Landed,
    Prepare,
    Swap,
    Swapped,
    VehicleReady,
    VehicleReport,
)
from agent.vehicle.config import BridgeConfig, CommandStyle
from sim.autopilot.config import ServedBase, VehicleConfig
from sim.autopilot.firmware import FirmwareModelName
from sim.world.bridged_vehicle import BridgedVehicle, Equipment
from sim.world.engine import EventQueue
from swarm.model.frames import DEFAULT_ORIGIN

BASE = (60.0, 0.0, 0.0)
SWAP_S = 40.0
PREPARE = Prepare((0.0, 0.0, 20.0), 10.0)


class SwapFlight:
    """A vehicle that has flown to its base, and what its agent hears of it."""

    def __init__(
        self, flavour: FirmwareModelName, command: CommandStyle, *, reboots: bool = True
    ) -> None:
        self.queue = EventQueue()
        self.heard: list[tuple[float, VehicleReport]] = []
        config = VehicleConfig(
            1,
            endurance_s=300.0,
            drains_in_flight=True,
            bases=(ServedBase(BASE, SWAP_S),),
            swap_reboots=reboots,
        )
        bridge = BridgeConfig(1, DEFAULT_ORIGIN, command=command, ready_by_itself=True)
        self.vehicle = BridgedVehicle(
            self.queue,
            "u0",
            lambda report: self.heard.append((self.queue.now_s(), report)),
            Equipment(config, bridge, flavour),
            0,
        )
        self.vehicle.order(PREPARE, VehicleReady())
        self.until(VehicleReady())
        self.vehicle.order(GoTo(1, (*BASE[:2], 20.0)), VehicleReady())
        self.until(Arrived(1))

    def until(self, report: VehicleReport, patience_s: float = 150.0) -> float:
        """Wait for a report; when it came [s]."""
        end_s = self.queue.now_s() + patience_s
        while self.queue.now_s() < end_s:
            self.queue.run(self.queue.now_s() + 0.5)
            found = [at_s for at_s, each in self.heard if each == report]
            if found:
                return found[0]
        raise AssertionError(f"no {report}; heard {[each for _, each in self.heard][-5:]}")


@pytest.mark.parametrize("command", CommandStyle)
@pytest.mark.parametrize("flavour", FirmwareModelName)
@pytest.mark.parametrize("reboots", [True, False])
def test_a_battery_is_changed_in_time_and_the_vehicle_flies_on(
    flavour: FirmwareModelName, command: CommandStyle, reboots: bool
) -> None:
    flight = SwapFlight(flavour, command, reboots=reboots)
    flight.vehicle.order(Swap(2, BASE, SWAP_S, 10.0), VehicleReady())
    landed_s = flight.until(Landed(2))
    swapped_s = flight.until(Swapped(2))
    assert 0.0 < swapped_s - landed_s < SWAP_S + 10.0
    assert flight.vehicle.pilot().battery.remaining_frac(flight.queue.now_s()) == 1.0

    flight.vehicle.order(GoTo(3, (0.0, 30.0, 20.0)), VehicleReady())
    flight.until(Arrived(3))
    assert not [each for _, each in flight.heard if isinstance(each, HandedOver)]
