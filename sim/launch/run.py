"""Fly one mission with real processes on this machine, and tell how it went.

Starts router or mesh, coordinator, simulated autopilots and agents, watches the bus
as an onlooker, and ends every process whatever happens. Leaves out: what the
processes do, and how the run is shown (sim.view).
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from coordinator.observer import MissionResult, Observer
from coordinator.plan_report import plan_from_json
from sim.launch.fleet import BusKind, LaunchOptions, Layout, autopilot_groups
from sim.launch.process import Child
from swarm.bus.zenoh_bus import open_zenoh_bus
from swarm.clock import ScaledClock
from swarm.config import Timing
from swarm.events import BusFact, Wish
from swarm.model import Mission, Plan
from swarm.model.ids import COORDINATOR
from swarm.shell import Shell, take_seat
from swarm.wire.messages import EpochPhase

__all__ = ["Flight", "fly"]

FRAME_S = 0.2
"""Wall time between two pictures."""
ROUTER = "router"
PATIENCE = 4.0
"""A mission may take this many times its planned time..."""
PATIENCE_S = 60.0
"""...and this much longer, before it is given up [s of mission or wall, whichever is slower]."""


@dataclass(frozen=True, slots=True)
class Flight:
    """What came of a run."""

    plan: Plan | None
    result: MissionResult
    observer: Observer
    takeoff_s: float | None
    """Vehicle seconds from the first process to mission time 0; None if it never came."""
    wall_s: float
    fates: tuple[str, ...]
    """How processes ended that should not have, in words."""


class _Launch:
    """The processes of one run, and what is known of them."""

    def __init__(self, mission: Mission, options: LaunchOptions, on_log: OnLog | None) -> None:
        self.mission = mission
        self.options = options
        self.clock = ScaledClock(options.speedup)
        self.timing = Timing().scaled(options.speedup)
        self.observer = Observer(mission, self.timing)
        self.children: list[Child] = []
        self.fates: list[str] = []
        self.zero_s: float | None = None
        self._on_log = on_log
        self._rng = np.random.default_rng()

    async def start(self) -> Layout:
        """Start everything, in the order in which one needs the other."""
        uavs = [uav.id for uav in self.mission.uavs]
        router = None
        if self.options.bus.for_fleet(len(uavs)) is BusKind.ROUTER:
            child = await self._start(ROUTER, ["router", "--listen", "tcp/127.0.0.1:0", "--json"])
            router = str((await child.ready())[0]["endpoints"][0])
        layout = Layout(self.options, self.mission, router, self._rng)
        groups = autopilot_groups(uavs)
        autopilots = [
            await self._start(f"autopilot of {', '.join(group)}", layout.autopilot(group))
            for group in groups
        ]
        await self._start(COORDINATOR, layout.coordinator(), on_line=self._hear_plan)
        for child, group in zip(autopilots, groups, strict=True):
            for said in await child.ready(len(group)):
                uav, url, system_id = said["uav"], said["url"], int(said["system_id"])
                await self._start(uav, layout.agent(uav, url, system_id))
        return layout

    async def stop(self) -> None:
        """End every process that is left."""
        await asyncio.gather(*(child.stop() for child in self.children))

    def child(self, name: str) -> Child | None:
        """The process of that name."""
        return next((child for child in self.children if child.name == name), None)

    async def _start(
        self,
        name: str,
        arguments: list[str],
        on_line: Callable[[dict[str, Any]], None] | None = None,
    ) -> Child:
        child = Child(name, arguments, on_line=on_line, on_log=self._on_log)
        self.children.append(child)
        await child.start()
        return child

    def _hear_plan(self, said: dict[str, Any]) -> None:
        self.observer.plan = plan_from_json(said)

    def note_fates(self) -> None:
        """Remember who ended against our will."""
        for child in self.children:
            failed = child.returncode not in (None, 0) and not child.stopped
            told = any(fate.startswith(f"{child.name}:") for fate in self.fates)
            if failed and not told:
                words = f" ({child.last_words()})" if (child.returncode or 0) > 0 else ""
                self.fates.append(f"{child.name}: {child.fate}{words}")

    @property
    def over(self) -> str | None:
        """Why there is nothing more to wait for; None while there is."""
        agents = [self.child(uav.id) for uav in self.mission.uavs]
        if all(child is not None and child.returncode is not None for child in agents):
            return "every agent has ended"
        coordinator = self.child(COORDINATOR)
        if (
            self.observer.phase is EpochPhase.PREPARING
            and coordinator is not None
            and coordinator.returncode is not None
        ):
            return f"the coordinator {coordinator.fate} before the start"
        router = self.child(ROUTER)
        if router is not None and router.returncode is not None:
            return f"the router {router.fate}"
        if self.clock.now_s() > self._limit_s():
            return "it took far longer than planned"
        return None

    def _limit_s(self) -> float:
        plan, fast = self.observer.plan, max(1.0, self.options.speedup)
        patience_s = PATIENCE_S * fast
        if self.zero_s is None or plan is None:
            return self.options.start_timeout_s * fast + patience_s
        latest_s = max((task.appears_s for task in self.mission.tasks), default=0.0)
        planned_s = max(plan.completion_s.values(), default=0.0)
        return self.zero_s + latest_s + PATIENCE * planned_s + patience_s


OnLog = Callable[[str, str], None]
OnFrame = Callable[[Observer, float], None]


async def fly(
    mission: Mission, options: LaunchOptions, *, on_frame: OnFrame, on_log: OnLog | None = None
) -> Flight:
    """Fly ``mission`` to its end.

    Args:
        mission: the scenario of ``options``.
        options: how to fly it.
        on_frame: called a few times a second with what the onlooker knows, and its time.
        on_log: called with process name and line for everything the processes log.

    Returns:
        What came of it; processes are gone by then.

    Raises:
        ChildFailedError: a process could not be started.
        BusError: the bus could not be opened.
    """
    launch = _Launch(mission, options, on_log)
    on_frame(launch.observer, launch.clock.now_s())
    try:
        layout = await launch.start()
        async with _watching(launch, layout):
            await _until_over(launch, on_frame)
    finally:
        await launch.stop()
    launch.note_fates()
    return Flight(
        plan=launch.observer.plan,
        result=launch.observer.result(),
        observer=launch.observer,
        takeoff_s=launch.zero_s,
        wall_s=launch.clock.now_s() / options.speedup,
        fates=tuple(launch.fates),
    )


async def _until_over(launch: _Launch, on_frame: OnFrame) -> None:
    """Show pictures until nothing more is to be waited for."""
    while True:
        now_s = launch.clock.now_s()
        launch.note_fates()
        if launch.zero_s is None and (mission_s := launch.observer.mission_s(now_s)) is not None:
            launch.zero_s = now_s - mission_s
        on_frame(launch.observer, now_s)
        if (reason := launch.over) is not None:
            if reason != "every agent has ended":
                launch.fates.append(f"given up: {reason}")
            return
        await asyncio.sleep(FRAME_S)


@contextlib.asynccontextmanager
async def _watching(launch: _Launch, layout: Layout) -> AsyncIterator[None]:
    """Keep the observer informed from the bus."""
    bus = await open_zenoh_bus(layout.bus_of_onlooker())
    shell: Shell[BusFact, Wish] = Shell(
        launch.observer,
        bus,
        launch.clock,
        mission=launch.mission.name,
        name="onlooker",
        from_bus=lambda fact: fact,
        execute=lambda _: None,
        snapshot=None,
    )
    take_seat(bus, launch.mission.name, None, status=True)
    watch = asyncio.get_running_loop().create_task(shell.run())
    try:
        yield
    finally:
        watch.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await watch
        bus.close()
