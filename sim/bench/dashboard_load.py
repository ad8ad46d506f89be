"""What a dashboard costs: a large mission acted out on a real bus, and pages that follow it.

This process acts the mission and reads the feed; router and dashboard are processes of their own.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import re
from collections.abc import AsyncIterator, Iterable
from dataclasses import dataclass, field

import numpy as np
import websockets.asyncio.client as websockets
from rich.console import RenderableType

from sim.bench.fleets import started, survey_mission
from sim.bench.machine import cpu_s, held_bytes, this_machine
from sim.bench.results import BenchResult, Progress, table_of, unheard
from sim.bench.scripted_mission import MARK, ScriptedMission
from sim.fleet.child_process import ChildFailedError, ChildProcess
from swarm.bus.config import BusConfig, ClientTopology
from swarm.bus.zenoh_bus import open_zenoh_bus
from swarm.runtime.clock import Clock, SystemClock
from swarm.runtime.table import Column

SETTLE_S = 5.0
"""Wall time before a measurement: those who have just come are told everything."""
RESTATE_S = 2.0
KNOWN_WITHIN_S = 60.0
"""Wall time in which the dashboard has to know the whole mission."""
MAX_FRAME_BYTES = 64 * 1024 * 1024
_MARK = re.compile(rf'"{MARK}(\d+)"')


@dataclass(frozen=True, slots=True)
class FollowerLoad:
    """What it takes to be followed by so many pages."""

    clients: int
    cores: float
    """Processor time of the dashboard's process per second."""
    memory_bytes: int
    bytes_per_s: float
    """To each page; 0 without any."""
    frames_per_s: float
    """To each page; 0 without any."""
    latency_p50_s: float | None
    """From a UAV's word to the frame that holds it; half a second between frames included."""
    latency_p99_s: float | None


@dataclass(frozen=True, slots=True)
class DashboardLoad(BenchResult):
    """What was measured."""

    uavs: int
    tasks: int
    rate_hz: float
    """Statuses of each UAV per second."""
    seconds: float
    """Of each measurement."""
    seed: int
    messages_per_s: float
    """Said on the bus by all together."""
    whole_bytes: int
    """Of the first frame to a page."""
    followings: tuple[FollowerLoad, ...]

    def parts(self) -> Iterable[RenderableType]:
        """See `BenchResult`."""
        yield (
            f"seed {self.seed}; {self.uavs} UAVs × {self.tasks} tasks, statuses at "
            f"{self.rate_hz:g} Hz, {self.messages_per_s:.0f} messages per second on the bus, "
            f"{self.seconds:g} s each; a whole frame has {self.whole_bytes / 1000.0:.0f} kB:"
        )
        yield table_of(
            self.followings,
            Column("pages", key="clients"),
            Column("cores", ".3f", key="cores"),
            Column("RAM", ".0f", "MiB", 2.0**-20, key="memory_bytes"),
            Column("to each page", ".1f", "kB/s", 1e-3, key="bytes_per_s"),
            Column("frames/s", ".2f", key="frames_per_s"),
            Column("latency p50", ".0f", "ms", 1e3, key="latency_p50_s"),
            Column("p99", ".0f", "ms", 1e3, key="latency_p99_s"),
        )
        yield "Latency is from a UAV's word to the frame that holds it, of two a second."


@dataclass(slots=True)
class _Page:
    """One page that follows the feed."""

    clock: Clock
    known: set[str] | None = None
    """Tasks it has been told of; None not to read so closely, which takes time."""
    whole_bytes: int = 0
    bytes: int = 0
    frames: int = 0
    seen_s: dict[int, float] = field(default_factory=dict)
    """When each mark was first seen."""

    async def follow(self, url: str) -> None:
        """Read the feed until cancelled."""
        async with websockets.connect(url, max_size=MAX_FRAME_BYTES, compression=None) as feed:
            async for text in feed:
                now_s = self.clock.now_s()
                self.bytes += len(text)
                if not isinstance(text, str) or '"type":"frame"' not in text[:20]:
                    continue
                self.frames += 1
                if '"whole":true' in text[:40]:
                    self.whole_bytes = len(text)
                if self.known is not None:
                    self.known |= {row["id"] for row in json.loads(text)["tasks"]}
                for mark in _MARK.findall(text):
                    self.seen_s.setdefault(int(mark), now_s)


async def measure_dashboard(
    uavs: int,
    tasks: int,
    rate_hz: float,
    clients: tuple[int, ...],
    seconds: float,
    seed: int,
    tell: Progress = unheard,
) -> DashboardLoad:
    """Act a mission and let it be followed by so many pages at a time, one number after the other.

    Raises:
        ChildFailedError: a process did not start, or does not show the mission.
        OSError: there is no /proc.
    """
    machine, clock = this_machine(), SystemClock()
    mission = survey_mission(uavs, tasks, seed)
    async with served(mission.name) as (endpoint, dashboard, url):
        bus = await open_zenoh_bus(BusConfig(ClientTopology((endpoint,))))
        try:
            acted = ScriptedMission(mission, bus, clock, rate_hz, seed)
            tell(f"acting {uavs} UAVs and {tasks} tasks")
            acted.appear()
            whole_bytes = await _until_known(acted, url, clock, tasks)
            acting = asyncio.get_running_loop().create_task(acted.run())
            try:
                followings = []
                began_s, said = clock.now_s(), acted.said
                for count in clients:
                    tell(f"following by {count} pages")
                    followings.append(
                        await _follow(count, url, dashboard.pid, acted, clock, seconds)
                    )
                    if acting.done():
                        acting.result()
                rate = (acted.said - said) / (clock.now_s() - began_s)
            finally:
                acting.cancel()
                await asyncio.gather(acting, return_exceptions=True)
        finally:
            bus.close()
    return DashboardLoad(
        machine=machine,
        uavs=uavs,
        tasks=tasks,
        rate_hz=rate_hz,
        seconds=seconds,
        seed=seed,
        messages_per_s=rate,
        whole_bytes=whole_bytes,
        followings=tuple(followings),
    )


@contextlib.asynccontextmanager
async def served(mission: str) -> AsyncIterator[tuple[str, ChildProcess, str]]:
    """A router's endpoint, the dashboard's process and its feed."""
    async with contextlib.AsyncExitStack() as stack:
        listening = ["router", "--json", "--listen", "tcp/127.0.0.1:0"]
        router = await started(stack, "router", listening)
        endpoint = str((await router.ready())[0]["endpoints"][0])
        words = ["dashboard", "--json", "--port", "0", "--mission", mission]
        dashboard = await started(stack, "dashboard", [*words, "--connect", endpoint])
        url = str((await dashboard.ready())[0]["url"])
        yield endpoint, dashboard, url.replace("http", "ws", 1) + "feed"


async def _until_known(acted: ScriptedMission, url: str, clock: Clock, tasks: int) -> int:
    """Tell the mission until a page shows it; bytes of a whole frame."""
    try:
        async with asyncio.timeout(KNOWN_WITHIN_S):
            while True:
                acted.begin()
                await asyncio.sleep(RESTATE_S)
                page = await _glimpse(url, clock)
                if len(page.known or ()) == tasks:
                    return page.whole_bytes
    except TimeoutError:
        raise ChildFailedError("the dashboard does not show the mission") from None


async def _glimpse(url: str, clock: Clock) -> _Page:
    page = _Page(clock, set())
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(1.0):
            await page.follow(url)
    return page


async def _follow(
    count: int, url: str, pid: int, acted: ScriptedMission, clock: Clock, seconds: float
) -> FollowerLoad:
    pages = [_Page(clock) for _ in range(count)]
    loop = asyncio.get_running_loop()
    reading = [loop.create_task(page.follow(url)) for page in pages]
    try:
        await asyncio.sleep(SETTLE_S)
        for page in pages:
            page.bytes = page.frames = 0
            page.seen_s.clear()
        first, began_s, before_s = len(acted.marked_s), clock.now_s(), cpu_s(pid)
        await asyncio.sleep(seconds)
        passed_s, spent_s = clock.now_s() - began_s, cpu_s(pid) - before_s
        memory = held_bytes(pid)
        for task in reading:
            if task.done():
                task.result()
    finally:
        for task in reading:
            task.cancel()
        await asyncio.gather(*reading, return_exceptions=True)
    times_s = [
        seen_s - acted.marked_s[mark]
        for page in pages
        for mark, seen_s in page.seen_s.items()
        if mark >= first
    ]
    some = max(1, count)
    return FollowerLoad(
        clients=count,
        cores=spent_s / passed_s,
        memory_bytes=memory,
        bytes_per_s=sum(page.bytes for page in pages) / passed_s / some,
        frames_per_s=sum(page.frames for page in pages) / passed_s / some,
        latency_p50_s=float(np.median(times_s)) if times_s else None,
        latency_p99_s=float(np.quantile(times_s, 0.99)) if times_s else None,
    )
