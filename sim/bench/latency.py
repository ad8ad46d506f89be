"""How long a UAV takes from seeing its arrival to commanding the next task.

A tap on the MAVLink connection of every agent notes when a position report passes, and
when the command to fly somewhere else does. Tasks need no service, so a new target is the
answer to the report in which the vehicle has arrived, and reports are too far apart to be
mistaken for each other. Both the way in and the way out through the agent's sockets are
part of it. Leaves out: the vehicle's and the radio's own delays.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass, replace

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.bench.takeover import options_for
from sim.bench.trouble import survey
from sim.launch.fleet import BusKind, Layout
from sim.launch.process import Child
from swarm.clock import Clock, SystemClock
from swarm.config import Link
from swarm.model.ids import COORDINATOR

__all__ = ["Latencies", "Tap", "measure_latencies"]

REPORT_HZ = 10.0
"""Rate of position reports; 100 ms apart, ten times what a decision may take."""
NOT_BY_ARRIVAL = 2
"""The way to its start and the first task follow from take-off and the mission's beginning."""
LIMIT_S = 300.0


@dataclass(frozen=True, slots=True)
class Latencies:
    """Times from the report of an arrival to the next command."""

    method: str
    uavs: int
    tasks: int
    times_s: tuple[float, ...]

    def quantile_s(self, share: float) -> float | None:
        """The smallest time that is not exceeded in that share of all decisions."""
        if not self.times_s:
            return None
        return float(np.quantile(self.times_s, share, method="inverted_cdf"))


class Tap:
    """Listens to both directions of one MAVLink connection, and times targets by reports."""

    def __init__(self, clock: Clock) -> None:
        self.times_s: list[float] = []
        """From the newest position report to each new target that follows from an arrival."""
        self._clock = clock
        self._vehicle, self._agent = _parser(), _parser()
        self._reported_s: float | None = None
        self._target: tuple[int, int, float] | None = None
        self._targets = 0

    def from_vehicle(self, data: bytes) -> None:
        """The vehicle has said this."""
        now_s = self._clock.now_s()
        for message in self._vehicle.parse_buffer(data) or ():
            if message.get_type() == "GLOBAL_POSITION_INT":
                self._reported_s = now_s

    def from_agent(self, data: bytes) -> None:
        """The agent has said this."""
        now_s = self._clock.now_s()
        for message in self._agent.parse_buffer(data) or ():
            if message.get_type() != "COMMAND_INT":
                continue
            if message.command != mavlink.MAV_CMD_DO_REPOSITION:
                continue
            target = message.x, message.y, message.z
            self._targets += target != self._target
            by_arrival = target != self._target and self._targets > NOT_BY_ARRIVAL
            self._target = target
            if by_arrival and self._reported_s is not None:
                self.times_s.append(now_s - self._reported_s)


async def measure_latencies(
    method: str,
    *,
    uavs: int = 5,
    tasks: int = 40,
    seed: int = 0,
    speedup: float = 1.0,
    on_progress: Callable[[str], None] | None = None,
) -> Latencies:
    """Fly a survey and time every decision but the first of each UAV, in wall seconds.

    Raises:
        ChildFailedError: a process did not start.
        TimeoutError: the mission took too long.
    """
    tell = on_progress or (lambda _: None)
    mission = survey(uavs, tasks, seed, service_s=0.0)
    clock = SystemClock()
    taps: list[Tap] = []
    with options_for(mission, link=Link.NORMAL, bus=BusKind.ROUTER, method=method) as options:
        layout = Layout(
            replace(options, position_rate_hz=REPORT_HZ, speedup=speedup),
            mission,
            np.random.default_rng(seed),
        )
        async with contextlib.AsyncExitStack() as stack:
            for router in layout.routers:
                await (await _started(stack, router, layout.router(router))).ready()
            ids = [uav.id for uav in mission.uavs]
            vehicles = await _started(stack, "autopilots", layout.autopilot(ids))
            await _started(stack, COORDINATOR, layout.coordinator())
            agents = []
            for said in await vehicles.ready(len(ids)):
                tap = Tap(clock)
                taps.append(tap)
                url = await stack.enter_async_context(_tapped(str(said["url"]), tap))
                arguments = layout.agent(said["uav"], url, int(said["system_id"]))
                agents.append(await _started(stack, said["uav"], arguments))
            tell(f"{method}: flying {tasks} tasks with {uavs} UAVs")
            async with asyncio.timeout(LIMIT_S):
                await asyncio.gather(*(agent.ended() for agent in agents))
    return Latencies(method, uavs, tasks, tuple(time_s for tap in taps for time_s in tap.times_s))


@contextlib.asynccontextmanager
async def _tapped(url: str, tap: Tap) -> AsyncIterator[str]:
    """Where to reach the TCP server ``url`` through ``tap``."""
    _, host, port = url.split(":")
    connections: set[asyncio.Task[None]] = set()

    async def accept(near: asyncio.StreamReader, back: asyncio.StreamWriter) -> None:
        far, forth = await asyncio.open_connection(host, int(port))
        ways = [
            asyncio.ensure_future(_pass_on(near, forth, tap.from_agent)),
            asyncio.ensure_future(_pass_on(far, back, tap.from_vehicle)),
        ]
        connections.update(ways)
        try:
            await asyncio.wait(ways, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for way in ways:
                way.cancel()
            await asyncio.gather(*ways, return_exceptions=True)
            connections.difference_update(ways)
            back.transport.abort()
            forth.transport.abort()

    server = await asyncio.start_server(accept, "127.0.0.1", 0)
    try:
        yield f"tcp:127.0.0.1:{server.sockets[0].getsockname()[1]}"
    finally:
        server.close()
        for connection in connections:
            connection.cancel()
        await asyncio.gather(*connections, return_exceptions=True)


async def _pass_on(
    reader: asyncio.StreamReader, writer: asyncio.StreamWriter, tell: Callable[[bytes], None]
) -> None:
    with contextlib.suppress(OSError):
        while data := await reader.read(65_536):
            tell(data)
            writer.write(data)
            await writer.drain()


async def _started(stack: contextlib.AsyncExitStack, name: str, arguments: list[str]) -> Child:
    child = Child(name, arguments)
    stack.push_async_callback(child.stop)
    await child.start()
    return child


def _parser() -> mavlink.MAVLink:
    parser = mavlink.MAVLink(None)
    parser.robust_parsing = True
    return parser
