"""How long an agent takes from an arrival to its next command, and a claim through a router.

A tap on the MAVLink connection of every agent notes when a position report passes, and when the
command to fly somewhere else does. Tasks need no service, so a new target is the answer to the
report in which the vehicle has arrived, and reports are too far apart to be mistaken for each
other. A claim is made into bytes, signed if there are keys, carried over a router in a process of
its own, checked and made into a message again.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.bench.fleets import options_for, started, survey_mission
from sim.bench.results import Progress, quantile, unheard
from sim.fleet.layout import BusKind, LaunchOptions, Layout
from swarm.bus.zenoh_bus import open_zenoh_bus
from swarm.model import Mission
from swarm.model.ids import COORDINATOR
from swarm.protocol.events import CommonAction, CommonEvent, MessageReceived, Publish
from swarm.protocol.key_space import KeySpace
from swarm.protocol.messages import Message, Stamp
from swarm.protocol.timing import LinkKind
from swarm.protocol.uav_messages import Claim, ClaimPhase
from swarm.runtime.clock import Clock, SystemClock
from swarm.runtime.shell import Shell

REPORT_HZ = 10.0
"""Rate of position reports; 100 ms apart, ten times what a decision may take."""
NOT_BY_ARRIVAL = 2
"""The way to its start and the first task follow from take-off and the mission's beginning."""
LIMIT_S = 300.0


@dataclass(frozen=True, slots=True)
class DecisionLatencies:
    """Times from the report of an arrival to the next command."""

    method: str
    uavs: int
    tasks: int
    times_s: tuple[float, ...]

    def quantile_s(self, share: float) -> float | None:
        """The smallest time that is not exceeded in that share of all decisions."""
        return quantile(self.times_s, share)


class MavlinkTap:
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
    tell: Progress = unheard,
) -> DecisionLatencies:
    """Fly a survey and time every decision but the first of each UAV, in wall seconds.

    Raises:
        ChildFailedError: a process did not start.
        TimeoutError: the mission took too long.
    """
    mission = survey_mission(uavs, tasks, seed, service_s=0.0)
    clock = SystemClock()
    taps: list[MavlinkTap] = []
    with options_for(mission, link=LinkKind.NORMAL, bus=BusKind.ROUTER, method=method) as options:
        layout = Layout(
            replace(options, position_rate_hz=REPORT_HZ, speedup=speedup),
            mission,
            np.random.default_rng(seed),
        )
        async with contextlib.AsyncExitStack() as stack:
            for router in layout.routers:
                await (await started(stack, router, layout.router(router))).ready()
            ids = [uav.id for uav in mission.uavs]
            vehicles = await started(stack, "autopilots", layout.autopilot(ids))
            await started(stack, COORDINATOR, layout.coordinator())
            agents = []
            for said in await vehicles.ready(len(ids)):
                tap = MavlinkTap(clock)
                taps.append(tap)
                url = await stack.enter_async_context(_tapped(str(said["url"]), tap))
                arguments = layout.agent(said["uav"], url, int(said["system_id"]))
                agents.append(await started(stack, said["uav"], arguments))
            tell(f"{method}: flying {tasks} tasks with {uavs} UAVs")
            async with asyncio.timeout(LIMIT_S):
                await asyncio.gather(*(agent.ended() for agent in agents))
    return DecisionLatencies(
        method, uavs, tasks, tuple(time_s for tap in taps for time_s in tap.times_s)
    )


@contextlib.asynccontextmanager
async def _tapped(url: str, tap: MavlinkTap) -> AsyncIterator[str]:
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


def _parser() -> mavlink.MAVLink:
    parser = mavlink.MAVLink(None)
    parser.robust_parsing = True
    return parser


SPEAKER = "speaker"
"""Who says the claims; with keys they have to be those of a UAV of that name."""
_HEARER = "hearer"
_RATE_HZ = 20.0
"""Claims a second: in between, processors that have nothing else to do have gone to sleep."""
_WARM = 20
"""Claims before those that are timed."""
_LATE_S = 0.5
"""What has not come by then counts as lost."""


async def measure_hops(mission: Mission, options: LaunchOptions, claims: int) -> tuple[float, ...]:
    """Wall times that so many claims took [s]; of one that was lost, none.

    Nobody flies ``mission``; ``options`` are of a bus with a router.

    Raises:
        ChildFailedError: the router did not start.
    """
    layout = Layout(options, mission, np.random.default_rng())
    (name, *_) = layout.routers
    clock = SystemClock()
    said, heard = _Noting(clock, says=True), _Noting(clock, says=False)
    body = Claim(ClaimPhase.HELD, "t1", 1.0, 0, 2.0)
    async with contextlib.AsyncExitStack() as stack:
        await (await started(stack, name, layout.router(name))).ready()
        async with (
            _seated(said, layout, mission, SPEAKER, clock) as speaking,
            _seated(heard, layout, mission, _HEARER, clock),
        ):
            for number in range(1, _WARM + claims + 1):
                await asyncio.sleep(1.0 / _RATE_HZ)
                claim = Message(mission.name, SPEAKER, Stamp(1, number), body)
                speaking.step(MessageReceived(claim))
            await asyncio.sleep(_LATE_S)
    timed = [number for number in heard.at_s if number > _WARM]
    return tuple(heard.at_s[number] - said.at_s[number] for number in timed)


class _Noting:
    """A core that notes when it comes by each claim, and says it if it is the speaker's."""

    def __init__(self, clock: Clock, *, says: bool) -> None:
        self.at_s: dict[int, float] = {}
        """By number of the claim."""
        self._clock = clock
        self._says = says

    def start(self, now_s: float) -> Sequence[CommonAction]:
        del now_s
        return []

    def step(self, event: CommonEvent, now_s: float) -> Sequence[CommonAction]:
        del now_s
        if isinstance(event, MessageReceived) and isinstance(event.message.body, Claim):
            self.at_s.setdefault(event.message.stamp.counter, self._clock.now_s())
            return [Publish(event.message)] if self._says else []
        return []

    def next_deadline_s(self) -> float | None:
        return None


@contextlib.asynccontextmanager
async def _seated(
    core: _Noting, layout: Layout, mission: Mission, name: str, clock: Clock
) -> AsyncIterator[Shell[CommonEvent, CommonAction]]:
    """A shell around ``core`` on the bus, for as long as the context lasts."""
    bus = await open_zenoh_bus(layout.observer_seat(name))
    try:
        if name != SPEAKER:
            bus.subscribe(KeySpace(mission.name).claim("*"))
        shell: Shell[CommonEvent, CommonAction] = Shell(
            core,
            bus,
            clock,
            mission=mission.name,
            name=name,
            from_bus=lambda fact: fact,
            execute=lambda _: None,
            snapshot=None,
        )
        running = asyncio.get_running_loop().create_task(shell.run())
        try:
            yield shell
        finally:
            running.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await running
    finally:
        bus.close()
