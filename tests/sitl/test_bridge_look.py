"""A ring round a structure: the bridge keeps the nose on its middle, whatever flies.

In virtual time with the simulated autopilots; and, where SWARM_SITL_ARDUCOPTER or SWARM_SITL_PX4
says where real firmware is, with that at wall speed. Neither has a gimbal.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
import os
import subprocess
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from agent.core.interface import (
    Arrived,
    Caution,
    GoTo,
    Home,
    Prepare,
    Refused,
    Return,
    VehicleReady,
    VehicleReport,
)
from agent.links.mavlink_vehicle import MavlinkVehicle
from agent.vehicle.config import BridgeConfig, CommandStyle
from sim.autopilot.firmware import FirmwareModelName
from sim.fleet.firmware import FirmwareKind, find_firmware
from swarm.model import Mission, Task, TaskId, Uav, UavId
from swarm.model.frames import enu_from_wgs84
from swarm.runtime.clock import ScaledClock
from tests.sitl.test_bridge_autopilot import FLAVOURS, START, STYLES, joined
from tests.support.bridge_flight import ORIGIN

pytestmark = pytest.mark.sitl

BEGIN, MIDDLE = (20.0, 0.0, 15.0), (40.0, 20.0)
CORNERS = ((60.0, 0.0, 15.0), (60.0, 40.0, 15.0), (20.0, 40.0, 15.0))
RING = GoTo(2, BEGIN, via_enu_m=CORNERS, look_at_m=MIDDLE)
AWAY = GoTo(3, (100.0, 0.0, 15.0))


def beside_deg(place_enu_m: Sequence[float], heading_deg: float) -> float:
    """How far the nose points beside the middle."""
    bearing = math.atan2(MIDDLE[0] - place_enu_m[0], MIDDLE[1] - place_enu_m[1])
    return abs(math.remainder(math.degrees(bearing) - heading_deg, 360.0))


def middle_of(values: list[float], share: float) -> float:
    """That quantile."""
    return sorted(values)[min(len(values) - 1, int(share * len(values)))]


@FLAVOURS
@STYLES
def test_simulated_autopilots_keep_their_noses_on_the_middle(
    flavour: FirmwareModelName, style: CommandStyle
) -> None:
    flight = joined(flavour, style)
    flight.to_bridge(START)
    flight.run_until(VehicleReady)
    flight.to_bridge(GoTo(1, BEGIN))
    flight.run_until(Arrived(1))
    flight.to_bridge(RING)
    beside: list[float] = []
    camera = flight.vehicle.pilot.camera
    while not any(report == Arrived(2) for _, report in flight.reports):
        flight.wait(0.1)
        if camera.looks and (heading_deg := camera.heading_deg(flight.now_s)) is not None:
            beside.append(beside_deg(flight.track_enu_m[-1], heading_deg))
    flight.to_bridge(AWAY)
    flight.wait(6.0)

    assert len(beside) > 150
    assert middle_of(beside, 0.98) <= 17.0
    assert camera.heading_deg(flight.now_s) is None
    assert camera.looks[-1] is None
    first = camera.looks[0]
    assert first is not None
    assert first == pytest.approx((*MIDDLE, 15.0), abs=0.02)
    assert flight.reports[-1][1] == Arrived(2)


# -- real firmware ------------------------------------------------------------------------


def real(kind: FirmwareKind) -> Any:
    reason = f"{kind.variable} does not say where it is"
    return pytest.param(
        kind, marks=pytest.mark.skipif(kind.variable not in os.environ, reason=reason)
    )


@contextlib.contextmanager
def firmware_running(kind: FirmwareKind, folder: Path) -> Iterator[str]:
    """One vehicle of it at the origin; its URL."""
    uav, task = Uav(UavId("uav1"), (0.0, 0.0, 0.0), 5.0), Task(TaskId("t"), BEGIN, 1.0)
    mission = Mission("ring", 600.0, (uav,), (task,), origin=ORIGIN)
    process = find_firmware(kind, 1, None, os.environ).processes(mission, 1.0)["uav1"]
    for name, text in process.files.items():
        (folder / name).write_text(text)
    with (folder / "said").open("wb") as said:
        started = subprocess.Popen(
            process.command,
            cwd=folder,
            env={**os.environ, **process.environment},
            stdin=subprocess.DEVNULL,
            stdout=said,
            stderr=said,
        )
    try:
        yield process.url
    finally:
        started.terminate()
        try:
            started.wait(10.0)
        except subprocess.TimeoutExpired:
            started.kill()
            started.wait()


@dataclass
class Watched:
    """What a ground station sees, and what the bridge reports."""

    beside_deg: list[float] = field(default_factory=list)
    """While the ring is flown."""
    reports: list[VehicleReport] = field(default_factory=list)
    on_ring: bool = False
    _codec: Any = field(default_factory=lambda: mavlink.MAVLink(None))

    def datagram_received(self, data: bytes) -> None:
        for message in self._codec.parse_buffer(data) or ():
            if message.get_type() == "GLOBAL_POSITION_INT" and self.on_ring:
                place = enu_from_wgs84(ORIGIN, message.lat / 1e7, message.lon / 1e7, 0.0)
                self.beside_deg.append(beside_deg(place, message.hdg / 100.0))


class _Protocol(asyncio.DatagramProtocol):
    def __init__(self, watched: Watched) -> None:
        self._watched = watched

    def datagram_received(self, data: bytes, addr: object) -> None:
        self._watched.datagram_received(data)


async def flown(url: str, style: CommandStyle) -> Watched:
    """Take off, fly the ring and go home."""
    watched = Watched()
    told = asyncio.Event()

    def hear(report: VehicleReport) -> None:
        watched.reports.append(report)
        told.set()

    async def until(*wanted: VehicleReport | type, limit_s: float) -> None:
        async with asyncio.timeout(limit_s):
            while not any(
                r == w or (isinstance(w, type) and isinstance(r, w))
                for r in watched.reports
                for w in wanted
            ):
                told.clear()
                await told.wait()

    loop = asyncio.get_running_loop()
    ground, _ = await loop.create_datagram_endpoint(
        lambda: _Protocol(watched), local_addr=("127.0.0.1", 0)
    )
    port = ground.get_extra_info("sockname")[1]
    config = BridgeConfig(1, ORIGIN, command=style, silence_timeout_s=30.0, accept_no_failsafe=True)
    vehicle = MavlinkVehicle(config, url, ScaledClock(1.0), hear, forward=[f"udp:127.0.0.1:{port}"])
    try:
        await vehicle.start()
        vehicle.order(Prepare((0.0, 0.0, 15.0), 5.0))
        await until(VehicleReady, limit_s=180.0)
        vehicle.order(GoTo(1, BEGIN))
        await until(Arrived(1), Refused, limit_s=90.0)
        vehicle.order(RING)
        await asyncio.sleep(4.0)
        watched.on_ring = True
        await until(Arrived(2), Refused, limit_s=180.0)
        watched.on_ring = False
        vehicle.order(Return("over"))
        await until(Home, limit_s=180.0)
    finally:
        await vehicle.close()
        ground.close()
    return watched


@pytest.mark.slow
@pytest.mark.process
@pytest.mark.parametrize("kind", [real(kind) for kind in FirmwareKind])
@STYLES
def test_real_firmware_keeps_its_nose_on_the_middle(
    tmp_path: Path, kind: FirmwareKind, style: CommandStyle
) -> None:
    with firmware_running(kind, tmp_path) as url:
        watched = asyncio.run(flown(url, style))

    assert Arrived(2) in watched.reports
    assert not [r for r in watched.reports if isinstance(r, Refused | Caution) and "look" in str(r)]
    assert len(watched.beside_deg) > 50
    assert middle_of(watched.beside_deg, 0.5) <= 15.0
    assert middle_of(watched.beside_deg, 0.9) <= 35.0
