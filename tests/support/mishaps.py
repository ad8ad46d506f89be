"""What may go wrong with a vehicle in the air, as a fake autopilot shows it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from agent.core.interface import (
    Arrived,
    VehicleReport,
)
from agent.vehicle.config import BridgeConfig
from tests.support.bridge_flight import ORIGIN, BridgeFlight
from tests.support.fake_copter import FakeCopter

Fake = type[FakeCopter]
Mishap = Callable[[BridgeFlight], None]

CONFIG = BridgeConfig(1, ORIGIN, position_rate_hz=10.0)
FENCED = replace(CONFIG, fence_radius_m=60.0, fence_height_m=30.0)
CRITICAL, EMERGENCY, TERMINATION = 5, 6, 8


def flying(fake: Fake, config: BridgeConfig = CONFIG) -> BridgeFlight:
    flight = BridgeFlight(fake(ORIGIN), config).flying(east_m=50.0)
    flight.copter.heard.clear()
    return flight


def happen_and_watch(flight: BridgeFlight, mishap: Mishap) -> list[VehicleReport]:
    """What is reported beside arrivals, within 30 s."""
    mishap(flight)
    flight.run(30.0)
    return [report for report in flight.reports if not isinstance(report, Arrived)]


def drain(flight: BridgeFlight) -> None:
    flight.copter.battery_percent = 15


def drift_off(flight: BridgeFlight) -> None:
    flight.copter.target_m = (400.0, 0.0, 10.0)


def climb_away(flight: BridgeFlight) -> None:
    flight.copter.target_m = (30.0, 0.0, 200.0)


def lose_position_stream(flight: BridgeFlight) -> None:
    flight.copter.deaf_to = {33}


def say(severity: int, text: str, mode: str) -> Mishap:
    def mishap(flight: BridgeFlight) -> None:
        flight.copter.text(severity, text)
        flight.copter.set_mode(getattr(flight.copter, mode))

    return mishap


def switch(mode: str, status: int | None = None) -> Mishap:
    def mishap(flight: BridgeFlight) -> None:
        flight.copter.system_status = status
        flight.copter.set_mode(getattr(flight.copter, mode))

    return mishap


def terminate(flight: BridgeFlight) -> None:
    flight.copter.system_status = TERMINATION


def disarm(flight: BridgeFlight) -> None:
    flight.copter.armed = False


def fall_silent(flight: BridgeFlight) -> None:
    flight.copter.silent = True


def reboot(flight: BridgeFlight) -> None:
    flight.copter.power_on(flight.now_s)
