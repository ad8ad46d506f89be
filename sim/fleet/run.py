"""Fly one mission with real processes on this machine, and tell how it went.

Starts the processes, watches the bus as an observer, starts a router or a dashboard that dies
anew, and ends every process whatever happens.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
from collections import Counter
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, TypedDict, Unpack

from coordinator.mission_view.mission_state import MissionState
from coordinator.mission_view.results import MissionResult, ProtectionSummary
from coordinator.planner.plan_report import plan_from_json
from coordinator.terminal.report import MissionReport
from sim.fleet.child_process import ChildFailedError, ChildProcess
from sim.fleet.launcher import Launcher, OnLog, Through
from sim.fleet.layout import DASHBOARD, LaunchOptions
from sim.world.motion import flown_s
from swarm.bus.local_runs import announced
from swarm.bus.zenoh_bus import open_zenoh_bus
from swarm.model import Mission, Plan
from swarm.model.ids import COORDINATOR
from swarm.protocol.events import CommonAction, CommonEvent
from swarm.protocol.messages import MissionPhase
from swarm.protocol.timing import UNSTRETCHED_UAVS, preset
from swarm.runtime.clock import ScaledClock
from swarm.runtime.joining import join_mission
from swarm.runtime.shell import Core, Shell

FRAME_S = 0.2
"""Wall time between two pictures."""
PATIENCE = 4.0
"""A mission may take this many times its planned time..."""
PATIENCE_S = 60.0
"""...and this much longer, before it is given up [s of mission or wall, whichever is slower]."""
LINGER_S = 0.02
"""Wall time for which what UAVs of a large fleet say is collected: hundreds a second otherwise wake
this process one by one."""
MAX_DEATHS = 10
"""A router, or a dashboard, that dies more often than this is not started again."""
CONDITION_S = 0.02
"""Wall time between two looks at a condition that is waited for."""

OnFrame = Callable[[MissionState, float], None]
"""Called with what the observer knows, and its time."""


class RunRecorder(Protocol):
    """Takes down what the observer hears, and what the processes log."""

    def around(
        self, core: Core[CommonEvent, CommonAction], mission_state: MissionState
    ) -> Core[CommonEvent, CommonAction]:
        """``core``, with all it hears written down."""

    def log(self, name: str, line: str, now_s: float) -> None:
        """Write down a line that the process ``name`` has logged."""


class RunHooks(TypedDict, total=False):
    """Who takes part in a run besides its processes."""

    on_frame: OnFrame
    """Called a few times a second."""
    on_log: OnLog | None
    """Called with process name and line for everything the processes log."""
    through: Through | None
    """See `Launcher`."""
    observers: Sequence[str]
    """See `Launcher`."""
    recorder: RunRecorder | None
    """Writes down what the observer hears; closed by whoever made it."""


@dataclass(frozen=True, slots=True)
class RunResult:
    """What came of a run."""

    plan: Plan | None
    result: MissionResult
    mission_state: MissionState
    takeoff_s: float | None
    """Vehicle seconds from the first process to mission time 0; None if it never came."""
    wall_s: float
    fates: tuple[str, ...]
    """How processes ended that should not have, in words."""
    dropped: tuple[Mapping[str, int], ...]
    """What each UAV, and the observer, has dropped, by reason."""

    def report(self, speedup: float, security: ProtectionSummary | None = None) -> MissionReport:
        """All there is to tell of it; ``security`` is what protected it."""
        flown = self.mission_state
        return MissionReport(
            mission=flown.mission,
            plan=self.plan,
            result=self.result,
            story=tuple(flown.story),
            takeoff_s=self.takeoff_s,
            wall_s=self.wall_s,
            speedup=speedup,
            fates=self.fates,
            executed_schedule=flown.executed_schedule(),
            closest_approach=flown.nearest,
            nearest_zone_m=flown.limits.nearest_zone_m,
            lowest_clearance_m=flown.limits.lowest_clearance_m,
            lowest_charge_frac=flown.limits.lowest_charge_frac,
            left_out=flown.left_out,
            security=security,
        )


class Run:
    """A mission being flown, made by `open_run`: its processes, and what an observer knows."""

    def __init__(self, mission: Mission, options: LaunchOptions, **hooks: Unpack[RunHooks]) -> None:
        self.recorder = hooks.get("recorder")
        self._on_log = hooks.get("on_log")
        self.launch = Launcher(
            mission,
            options,
            on_log=self._on_log if self.recorder is None else self._hear_log,
            on_plan=self._hear_plan,
            through=hooks.get("through"),
            observers=hooks.get("observers", ()),
        )
        self.clock = ScaledClock(options.speedup)
        timing = preset(options.link).timing
        self.mission_state = MissionState(mission, timing.scaled(options.speedup))
        self.fates: list[str] = []
        """How processes ended that should not have, in words."""
        self.dropped: Mapping[str, int] = {}
        """What the observer itself has dropped so far, by reason."""
        self._on_frame = hooks.get("on_frame")
        self._zero_s: float | None = None
        self._told: set[ChildProcess] = set()
        self._deaths: Counter[str] = Counter()

    def frame(self) -> None:
        """Look at everything once, and show it."""
        now_s = self.clock.now_s()
        self._note_fates()
        if self._zero_s is None and (mission_s := self.mission_state.mission_s(now_s)) is not None:
            self._zero_s = now_s - mission_s
        if self._on_frame is not None:
            self._on_frame(self.mission_state, now_s)

    async def until(self, condition: Callable[[], bool], *, limit_s: float, what: str) -> None:
        """Wait until ``condition`` holds.

        Raises:
            TimeoutError: ``what`` did not happen within ``limit_s`` wall seconds.
        """
        try:
            async with asyncio.timeout(limit_s):
                while True:
                    if condition():
                        return
                    await asyncio.sleep(CONDITION_S)
        except TimeoutError:
            raise TimeoutError(f"{what}: not within {limit_s:g} s") from None

    async def finish(self) -> None:
        """Wait until nothing more is to be waited for."""
        while True:
            self.frame()
            if not any(self.launch.runs(uav.id) for uav in self.launch.mission.uavs):
                return
            if (reason := self._hopeless() or await self._mend_routers()) is not None:
                self.fates.append(f"given up: {reason}")
                return
            await self._mend_dashboard()
            await asyncio.sleep(FRAME_S)

    def flight(self) -> RunResult:
        """What came of it; complete once all processes are gone."""
        self._note_fates()
        return RunResult(
            plan=self.mission_state.plan,
            result=self.mission_state.result(),
            mission_state=self.mission_state,
            takeoff_s=self._zero_s,
            wall_s=self.clock.now_s() / self.launch.options.speedup,
            fates=tuple(self.fates),
            dropped=(*self.mission_state.dropped.values(), dict(self.dropped)),
        )

    def _hear_plan(self, said: dict[str, Any]) -> None:
        self.mission_state.take_plan(plan_from_json(said))

    def _hear_log(self, name: str, line: str) -> None:
        """Write down what the processes log, besides."""
        if self.recorder is not None:
            self.recorder.log(name, line, self.clock.now_s())
        if self._on_log is not None:
            self._on_log(name, line)

    def _note_fates(self) -> None:
        """Remember who ended against our will."""
        for child in self.launch.lives:
            if child.returncode in (None, 0) or child.stopped or child in self._told:
                continue
            self._told.add(child)
            words = f" ({child.last_words()})" if (child.returncode or 0) > 0 else ""
            self.fates.append(f"{child.name}: {child.fate}{words}")

    async def _mend_routers(self) -> str | None:
        """Start routers anew that have died; why that has no use any more, None while it has."""
        for name in self.launch.layout.routers:
            child = self.launch.child(name)
            if child.returncode is None or child.stopped:
                continue
            if self._deaths[name] >= MAX_DEATHS:
                return f"{name} dies again and again"
            try:
                await self._mend(child)
            except ChildFailedError as fault:
                return str(fault)
        return None

    async def _mend_dashboard(self) -> None:
        """Start the dashboard anew if it has died; the run goes on without it, too."""
        if self.launch.options.dashboard is None:
            return
        child = self.launch.child(DASHBOARD)
        dead = child.returncode is not None and not child.stopped
        if dead and self._deaths[DASHBOARD] < MAX_DEATHS:
            with contextlib.suppress(OSError):  # no room for a process just now
                await self._mend(child)

    async def _mend(self, child: ChildProcess) -> None:
        """Start it anew, and tell so."""
        self._deaths[child.name] += 1
        self.mission_state.tell(f"{child.name} {child.fate}; started again", self.clock.now_s())
        await self.launch.restart(child.name)

    def _hopeless(self) -> str | None:
        """Why there is nothing more to wait for, though agents run; None while there is."""
        coordinator = self.launch.child(COORDINATOR)
        if (
            self.mission_state.phase is MissionPhase.PREPARING
            and coordinator.returncode is not None
            and not coordinator.stopped
        ):
            return f"the coordinator {coordinator.fate} before the start"
        return "it took far longer than planned" if self.clock.now_s() > self._limit_s() else None

    def _limit_s(self) -> float:
        options, plan = self.launch.options, self.mission_state.plan
        fast = max(1.0, options.speedup)
        patience_s = PATIENCE_S * fast
        if self._zero_s is None or plan is None:
            return options.start_timeout_s * fast + patience_s
        flown = self.mission_state.mission  # with what the operator has added to it
        latest_s = max((task.appears_s for task in flown.tasks), default=0.0)
        planned_s = max(plan.completion_s.values(), default=0.0)
        for task in flown.tasks:
            if task.id not in plan.completion_s:
                away_m = max(math.dist(task.position_enu_m, u.position_enu_m) for u in flown.uavs)
                planned_s += task.service_s + max(
                    flown_s(away_m, u.speed_m_s, u.acceleration_m_s2) for u in flown.uavs
                )
        # In air that all share they may have to fly and to land one after the other.
        turns = 1 if flown.separation_m is None else len(flown.uavs)
        return self._zero_s + latest_s + PATIENCE * planned_s * turns + patience_s


@contextlib.asynccontextmanager
async def open_run(
    mission: Mission,
    options: LaunchOptions,
    *,
    on_private: Callable[[str], object] | None = None,
    **hooks: Unpack[RunHooks],
) -> AsyncIterator[Run]:
    """Start to fly ``mission``; all processes are gone when the context ends.

    Wait for the end by `Run.finish`, or do something to the processes first.

    Args:
        mission: the scenario of ``options``.
        options: how to fly it.
        on_private: commands on this machine shall find the run by themselves; called with the
            reason if they cannot. None to keep it to itself.
        hooks: see `RunHooks`.

    Raises:
        ChildFailedError: a process could not be started.
        BusError: the bus could not be opened.
    """
    run = Run(mission, options, **hooks)
    launch = run.launch
    run.frame()
    told = contextlib.nullcontext() if on_private is None else announced(launch.layout.local_run)
    with told as fault:
        if fault is not None and on_private is not None:
            on_private(fault)
        try:
            await launch.start()
            async with _watching(run):
                yield run
        finally:
            await launch.stop()


async def fly(
    mission: Mission,
    options: LaunchOptions,
    *,
    on_private: Callable[[str], object] | None = None,
    **hooks: Unpack[RunHooks],
) -> RunResult:
    """Fly ``mission`` to its end, see `open_run`; processes are gone when it returns."""
    async with open_run(mission, options, on_private=on_private, **hooks) as run:
        await run.finish()
    return run.flight()


@contextlib.asynccontextmanager
async def _watching(run: Run) -> AsyncIterator[None]:
    """Keep the mission state up to date from the bus."""
    mission = run.launch.mission.name
    bus = await open_zenoh_bus(run.launch.layout.observer_seat())
    if len(run.launch.mission.uavs) > UNSTRETCHED_UAVS:
        bus.inbox.linger_s = LINGER_S
    recorder = run.recorder
    shell: Shell[CommonEvent, CommonAction] = Shell(
        run.mission_state
        if recorder is None
        else recorder.around(run.mission_state, run.mission_state),
        bus,
        run.clock,
        mission=mission,
        name="onlooker",
        from_bus=lambda fact: fact,
        execute=lambda _: None,
        snapshot=None,
        known=run.mission_state.replica.digest,
        register=run.mission_state.replica.register,
        left_out=lambda: run.mission_state.replica.overfull,
    )
    run.dropped = shell.dropped
    join_mission(bus, mission, None, status=True, every_status=recorder is not None)
    watch = asyncio.get_running_loop().create_task(shell.run())
    try:
        yield
    finally:
        watch.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await watch
        bus.close()
