"""What comes of a report at once: an order from inside it is on its way before anything else."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from agent.core.interface import Arrived, GoTo, Refused, Telemetry, VehicleReady, VehicleReport
from agent.links.link import ByteLink
from agent.links.mavlink_vehicle import MavlinkVehicle
from agent.vehicle.config import BridgeConfig
from tests.support.bridge_flight import ORIGIN, START, STEP_S
from tests.support.fake_copter import REPOSITION, FakeCopter

NORTH = (5.0, 20.0, 10.0)
SOUTH = (5.0, -20.0, 10.0)
OUTSIDE = (500.0, 0.0, 10.0)
CONFIG = BridgeConfig(1, ORIGIN, position_rate_hz=10.0, fence_radius_m=100.0)


class Wire(ByteLink):
    """Carries what is said straight to the vehicle, and keeps what it answers."""

    def __init__(self, flight: Flight, vehicle: MavlinkVehicle) -> None:
        super().__init__("wire", vehicle)
        self._flight = flight
        self.answers: list[bytes] = []

    def _write(self, data: bytes) -> bool:
        self.answers += self._flight.copter.receive(data, self._flight.now_s())
        return True

    async def _open(self) -> None:
        """It always is."""

    def discard(self) -> None:
        """Nothing waits in it."""

    def _shut(self) -> None:
        """It never is."""


class Flight:
    """A vehicle behind a wire, in virtual time; is its own clock. Needs a running loop."""

    def __init__(self, on_report: Callable[[Flight, VehicleReport], None]) -> None:
        self.copter = FakeCopter(ORIGIN)
        self.copter.power_on(0.0)
        self.vehicle = MavlinkVehicle(CONFIG, "udpin:127.0.0.1:14550", self, self._hear)
        self._wire = Wire(self, self.vehicle)
        self.vehicle.link = self._wire
        self._on_report = on_report
        self._heard: set[type] = set()
        self.vehicle.link_up()

    def now_s(self) -> float:
        return self.copter.now_s

    def wall_delay_s(self, delay_s: float) -> float:
        return delay_s

    def targets(self) -> int:
        """How many the vehicle has been sent."""
        return len(self.copter.commands(REPOSITION))

    def run_until(self, wanted: type) -> None:
        """Fly until a report of that type has been heard."""
        for _ in range(round(60.0 / STEP_S)):
            if wanted in self._heard:
                return
            answers, self._wire.answers = self._wire.answers, []
            for data in answers + self.copter.advance(self.copter.now_s + STEP_S):
                self.vehicle.received(data)
        raise AssertionError(f"no {wanted} within 60 s, only {self._heard}")

    def _hear(self, report: VehicleReport) -> None:
        self._heard.add(type(report))
        self._on_report(self, report)


def fly_to_north(on_report: Callable[[Flight, VehicleReport], None], until: type) -> None:
    """Prepare a vehicle and send it to the north."""

    async def fly() -> None:
        flight = Flight(on_report)
        flight.vehicle.order(START)
        flight.run_until(VehicleReady)
        flight.vehicle.order(GoTo(1, NORTH))
        flight.run_until(until)
        await flight.vehicle.close()

    asyncio.run(fly())


def test_an_order_from_inside_a_report_is_sent_before_it_returns() -> None:
    sent: list[int] = []

    def on_report(flight: Flight, report: VehicleReport) -> None:
        if report == Arrived(1):
            before = flight.targets()
            flight.vehicle.order(GoTo(2, SOUTH))
            sent.append(flight.targets() - before)

    fly_to_north(on_report, until=Arrived)

    assert sent == [1]


def test_what_comes_of_an_order_is_reported_after_the_report_that_led_to_it() -> None:
    events: list[str] = []

    def on_report(flight: Flight, report: VehicleReport) -> None:
        if isinstance(report, Telemetry):
            return
        events.append(f"hears {type(report).__name__}")
        if report == Arrived(1):
            flight.vehicle.order(GoTo(2, OUTSIDE))
        events.append(f"heard {type(report).__name__}")

    fly_to_north(on_report, until=Refused)

    assert events[-4:] == ["hears Arrived", "heard Arrived", "hears Refused", "heard Refused"]
