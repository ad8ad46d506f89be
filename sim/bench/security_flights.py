"""One flight of real processes, plain, with keys, or flooded, and what it costs.

Of each flight: processor time and memory by kind of process (Linux alone tells them), the
turnarounds of the agents, and how long it took to take off.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import sys
from collections import Counter
from collections.abc import AsyncIterator, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

from coordinator.mission_view.mission_state import MissionState
from coordinator.mission_view.results import refusals
from sim.bench.latency import SPEAKER
from sim.bench.machine import cpu_s, held_bytes
from sim.bench.turnaround import told_turnarounds
from sim.fleet.child_process import ChildProcess, ProgramEnvironment
from sim.fleet.launcher import Launcher
from sim.fleet.layout import LaunchOptions
from sim.fleet.run import Run, open_run
from sim.fleet.security import protected
from swarm.model import Mission
from swarm.protocol.messages import MissionPhase

LAUNCHER = "swarm run"


@dataclass(frozen=True, slots=True)
class CostsByKind:
    """Of all processes of a run, by kind."""

    processes: Mapping[str, int]
    """How many there were."""
    cpu_s: Mapping[str, float]
    """Processor time of all of them together [s]."""
    memory_bytes: Mapping[str, float]
    """Most that one of them held in RAM at a look, on average over them."""


class ProcessMeter:
    """Looks at every process of one launch, begun by the process ``pid``."""

    def __init__(self, pid: int) -> None:
        self._kinds = {pid: LAUNCHER}
        self._began_s = {pid: cpu_s(pid)}
        self._cpu_s: dict[int, float] = {}
        self._most_bytes: dict[int, int] = {}

    def look(self, launch: Launcher) -> None:
        """Note what each living process has used so far."""
        for child in launch.lives:
            if child.returncode is None:
                self._kinds.setdefault(child.pid, kind_of(child.arguments))
        for pid in self._kinds:
            with contextlib.suppress(OSError, IndexError):  # gone meanwhile
                used_s, held = cpu_s(pid), held_bytes(pid)
                if held:  # a process that has ended and was not waited for holds nothing
                    self._cpu_s[pid] = used_s - self._began_s.get(pid, 0.0)
                    self._most_bytes[pid] = max(held, self._most_bytes.get(pid, 0))

    def costs(self) -> CostsByKind:
        """As they stood at the last look."""
        count = Counter(self._kinds[pid] for pid in self._cpu_s)
        used_s, held = dict.fromkeys(count, 0.0), dict.fromkeys(count, 0.0)
        for pid, time_s in self._cpu_s.items():
            kind = self._kinds[pid]
            used_s[kind] += time_s
            held[kind] += self._most_bytes[pid] / count[kind]
        return CostsByKind(dict(count), used_s, held)


def kind_of(arguments: tuple[str, ...]) -> str:
    """The kind of a process with that command line: the `swarm` command, or firmware."""
    return arguments[0] if arguments[0].isalpha() else "firmware"


HOSTILE = "hostile"
"""Its name among the UAVs of the keys; the mission has no such UAV."""
_LIMIT_S = 86_400.0
"""A run gives up long before that."""


@dataclass(slots=True)
class FloodTotals:
    """What a flood came to, as far as has been told."""

    sent: int = 0
    """Messages it has handed over, whether its router still hears it or has shut it out."""
    wall_s: float = 0.0
    """In so many seconds."""

    @property
    def rate_hz(self) -> float:
        """Messages a second."""
        return self.sent / self.wall_s if self.wall_s > 0.0 else 0.0

    def hear(self, _name: str, line: str) -> None:
        """Take note of a line of the hostile process."""
        with contextlib.suppress(ValueError, KeyError, TypeError):
            said = json.loads(line)
            self.sent, self.wall_s = int(said["sent"]), float(said["wall_s"])


@contextlib.asynccontextmanager
async def flooded(run: Run, rate_hz: float) -> AsyncIterator[FloodTotals]:
    """Flood ``run``, which has routers and keys for `HOSTILE`, as long as its mission lasts.

    The hostile process tries to send ``rate_hz`` messages a second.
    """
    poured = FloodTotals()
    pouring = asyncio.get_running_loop().create_task(_pour(run, rate_hz, poured))
    try:
        yield poured
    finally:
        pouring.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await pouring


async def _pour(run: Run, rate_hz: float, poured: FloodTotals) -> None:
    keys, layout = run.launch.options.keys, run.launch.layout
    if keys is None or not layout.routers:
        raise ValueError("only a run with keys and routers is flooded")
    command = [
        *(sys.executable, "-m", "sim.fleet.faults.torrent"),
        *("--keys", str(keys.of_seat(HOSTILE)), "--mission", run.launch.mission.name),
        *("--connect", layout.endpoint(layout.routers[0]), "--rate-hz", repr(rate_hz)),
        *(word for uav in run.launch.mission.uavs for word in ("--other", uav.id)),
    ]
    child = ChildProcess(
        HOSTILE, command, setting=ProgramEnvironment(Path.cwd(), {}), on_log=poured.hear
    )
    mission_state, clock = run.mission_state, run.clock
    await run.until(
        lambda: mission_state.mission_s(clock.now_s()) is not None,
        limit_s=_LIMIT_S,
        what="the start",
    )
    try:
        await child.start()
        await run.until(
            lambda: mission_state.phase is MissionPhase.ENDED, limit_s=_LIMIT_S, what="the end"
        )
    finally:
        await child.stop()


class SecurityMode(StrEnum):
    """How a mission is flown."""

    PLAIN = "plain"
    SECURE = "secure"
    FLOODED = "flooded"
    """Secure, while a hostile agent with valid keys floods the bus."""


@dataclass(frozen=True, slots=True)
class CostFlight:
    """One flight."""

    way: SecurityMode
    start: CostsByKind
    """Until the mission began: interpreters, imports, keys, preparation, take-off."""
    whole: CostsByKind
    """Until it ended."""
    takeoff_wall_s: float
    """From the first process to mission time 0."""
    flight_wall_s: float
    """From there to the end."""
    target_ms: tuple[float, ...]
    """Wall times of agents from an arrival or the end of a service to the next target sent."""
    done: int
    tasks: int
    as_planned: bool
    """Whether every list flown was the one planned."""
    refused: Mapping[str, int]
    poured_hz: float
    """Messages a second of the hostile agent; 0 without one."""
    load: float
    """Processes that wanted to run during the last minute of the flight."""

    @property
    def ok(self) -> bool:
        """Whether every task was done."""
        return self.done == self.tasks

    def flight_cpu_s(self, kind: str) -> float:
        """Processor time of all processes of a kind from the mission's beginning to its end."""
        return self.whole.cpu_s.get(kind, 0.0) - self.start.cpu_s.get(kind, 0.0)


def prepared(
    mission: Mission, options: LaunchOptions, way: SecurityMode
) -> AbstractContextManager[LaunchOptions]:
    """``options`` with keys where there are to be any."""
    strangers = (SPEAKER, HOSTILE)
    secure = way is not SecurityMode.PLAIN
    return protected(mission, options, secure=secure, keys=None, strangers=strangers)


async def fly_metered(
    mission: Mission, options: LaunchOptions, way: SecurityMode, flood_hz: float
) -> CostFlight:
    """Fly ``mission`` once and count what it costs."""
    told: list[dict[str, Any]] = []
    meter = _FlightMeter()
    async with open_run(
        mission,
        options,
        on_frame=meter.look,
        on_log=lambda _name, line: told.extend(told_turnarounds(line)),
    ) as run:
        meter.run = run
        async with flooded(run, flood_hz) if flood_hz else nullcontext(FloodTotals()) as poured:
            await run.finish()
    flight = run.flight()
    planned = {} if flight.plan is None else flight.plan.routes
    takeoff_s = 0.0 if flight.takeoff_s is None else flight.takeoff_s
    start = meter.costs.costs() if meter.start is None else meter.start
    return CostFlight(
        way=way,
        start=start,
        whole=start if meter.end is None else meter.end,
        takeoff_wall_s=takeoff_s / options.speedup,
        flight_wall_s=flight.result.makespan_s / options.speedup,
        target_ms=tuple(time_ms for each in told for time_ms in each["target_ms"]),
        done=len(flight.result.done),
        tasks=len(mission.tasks),
        as_planned=all(
            tuple(planned.get(uav, ())) == route
            for uav, route in flight.result.executed_routes.items()
        ),
        refused=refusals(flight.dropped),
        poured_hz=poured.rate_hz,
        load=os.getloadavg()[0],
    )


class _FlightMeter:
    """Looks at the processes with every frame of a run."""

    def __init__(self) -> None:
        self.run: Run | None = None
        self.costs = ProcessMeter(os.getpid())
        self.start: CostsByKind | None = None
        self.end: CostsByKind | None = None

    def look(self, mission_state: MissionState, now_s: float) -> None:
        if self.run is None or self.end is not None:
            return
        self.costs.look(self.run.launch)
        if self.start is None and mission_state.mission_s(now_s) is not None:
            self.start = self.costs.costs()
        if mission_state.phase is MissionPhase.ENDED:
            self.end = self.costs.costs()
