"""The coordinator's process: its core on a bus, and plans that are made beside it.

Publishes ``brief``, ``plan`` and ``board/<task>``, holds ``alive/coordinator`` and answers on
``state/coordinator``; while it stands by, none of that. Subscribes to ``brief``, ``plan``,
``board/*``, ``uav/*/claim``, ``uav/*/claim/coordinator``, ``uav/*/outcome/*`` and ``operator/*``
and watches ``alive/*``. One that stands by takes a seat as an observer; when it takes over it keeps
that seat. When it has to stand down, it leaves it and watches from a new one: a token cannot be
taken back.
"""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass
from functools import partial

from coordinator.core.active import CoordinatorCore
from coordinator.core.lifecycle import (
    CoordinatorAction,
    CoordinatorEvent,
    MakePlan,
    PlanFailed,
    PlanMade,
    Replan,
    Replanned,
    StopPlanning,
    TakeSeat,
)
from coordinator.core.standby import MakeCoordinator, StandbyCore
from coordinator.planner.online import replan, replan_limit_s
from coordinator.planner.options import ShouldStop, after_time, first_of
from swarm.bus.port import Bus
from swarm.bus.zenoh_bus import ZenohBus
from swarm.model import Mission, Plan
from swarm.model.ids import COORDINATOR
from swarm.protocol.key_space import KeySpace
from swarm.protocol.messages import Message, Snapshot
from swarm.protocol.seal import Seal
from swarm.protocol.timing import PRESETS, UNSTRETCHED_UAVS, LinkKind, Timing
from swarm.runtime.clock import Clock, SystemClock
from swarm.runtime.joining import join_mission
from swarm.runtime.log import get_logger
from swarm.runtime.process import SERVICE_NOTIFIER, call_in_background
from swarm.runtime.shell import Shell
from swarm.runtime.store import Store

MissionPlanner = Callable[[MakePlan, ShouldStop], Plan]
_ENDS_S = 1.0
"""How long the end of the process waits for a plan that has been told to stop; it takes 50 ms."""


async def run_coordinator(
    core: CoordinatorCore | StandbyCore,
    mission: Mission,
    bus: Bus,
    clock: Clock,
    make_plan: MissionPlanner,
    *,
    save: Callable[[Snapshot], None] | None = None,
    answer_s: float = PRESETS[LinkKind.NORMAL].answer_s,
) -> int:
    """Coordinate ``mission``, or stand by for it, until it has ended and all agents have left.

    ``save`` keeps what the core knows for its next life. A question waits ``answer_s`` for the
    slowest answer [wall s]. Whoever opened ``bus`` closes it.

    Returns:
        Exit status: 0 when every task was done, 1 otherwise, also when the core has stood
        down for another coordinator.
    """
    keys = KeySpace(mission.name)

    def execute(action: CoordinatorAction) -> None:
        match action:
            case MakePlan() | Replan():
                planner.begin(action)
            case StopPlanning():
                planner.cancel()
            case TakeSeat():
                bus.serve(keys.state(COORDINATOR))
                bus.declare_token(keys.alive(COORDINATOR))

    def known() -> Mapping[str, int]:
        return core.replica.digest()  # of another one once it has taken over

    def register(key: str) -> Message | None:
        return core.replica.register(key)

    def context() -> Mapping[str, object]:
        epoch = core.replica.epoch
        return {} if epoch is None else {"epoch": epoch.number}

    shell: Shell[CoordinatorEvent, CoordinatorAction] = Shell(
        core,
        bus,
        clock,
        mission=mission.name,
        name=COORDINATOR,
        from_bus=lambda fact: fact,
        execute=execute,
        snapshot=core.snapshot,
        whole=core.whole,
        known=known,
        register=register,
        left_out=lambda: core.replica.overfull,
        save=None if save is None else lambda now_s: save(core.memory(now_s)),
        answer_s=answer_s,
        context=context,
        together=lambda heard: heard,
    )
    log = get_logger(COORDINATOR, mission=mission.name)

    def note(fault: Exception, failed: int) -> None:
        reason = f"{type(fault).__name__}: {fault}"
        log.warning("a plan that nobody waits for failed", reason=reason, failed=failed)

    planner = BackgroundPlanner(make_plan, shell.step, shell.fail, note)
    watches = isinstance(core, StandbyCore)
    join_mission(bus, mission.name, None if watches else COORDINATOR, status=False)
    if (
        mission.constraints and not watches
    ):  # agents of earlier releases cannot read it, which shows there alone
        bus.subscribe(KeySpace(mission.name).status("*"), latest=True)
    shell.suit_fleet(len(mission.uavs))
    # What keepers of air grant: it can tell one of them that has forgotten it. That is not urgent.
    granted = KeySpace(mission.name).claim_to("*", COORDINATOR)
    bus.subscribe(granted, gathered=len(mission.uavs) > UNSTRETCHED_UAVS)
    try:
        return await shell.run()
    finally:
        await planner.close()


class BackgroundPlanner:
    """Plans beside a core, on a thread that does not hold the process up; one plan at a time.

    A plan that is superseded is told to stop, which takes it some 50 ms, and the newest one that is
    wanted begins once it has. Of others nobody hears.

    Args:
        make_plan: plans a mission as it is wanted; told to stop once nobody waits for the plan.
        tell: takes the plan.
        fail: takes what a planner raises, unless it says that there is no plan.
        note: told what it raises once nobody waits for the plan, and how often it has done so.
    """

    def __init__(
        self,
        make_plan: MissionPlanner,
        tell: Callable[[CoordinatorEvent], None],
        fail: Callable[[BaseException], None],
        note: Callable[[Exception, int], None],
    ) -> None:
        self._make_plan = make_plan
        self._tell = tell
        self._fail = fail
        self._note = note
        self._failed = 0
        """Plans that failed once nobody waited for them."""
        self._wanted: MakePlan | Replan | None = None
        """What is to be planned next."""
        self._unwanted = threading.Event()
        """Set once nobody waits any more for what is being planned."""
        self._planning: asyncio.Task[None] | None = None

    def begin(self, request: MakePlan | Replan) -> None:
        """Make that plan; whatever was planned before is superseded."""
        self.cancel()
        self._wanted = request
        if self._planning is None:
            self._planning = asyncio.get_running_loop().create_task(self._plan_wanted())
            self._planning.add_done_callback(self._planned)

    def cancel(self) -> None:
        """Nobody waits for a plan any more."""
        self._wanted = None
        self._unwanted.set()

    async def close(self) -> None:
        """Wait until nothing is being planned."""
        self.cancel()
        if (planning := self._planning) is not None:
            await asyncio.wait({planning}, timeout=_ENDS_S)
            planning.cancel()
            await asyncio.gather(planning, return_exceptions=True)

    async def _plan_wanted(self) -> None:
        """Plan until nothing is wanted, one after the other."""
        try:
            while (request := self._wanted) is not None:
                self._wanted, self._unwanted = None, (unwanted := threading.Event())
                call = partial(self._outcome, request, _once_set(unwanted))
                name = "planner" if isinstance(request, MakePlan) else "replanner"
                try:
                    outcome = await asyncio.wrap_future(call_in_background(call, name))
                except Exception as fault:
                    if not unwanted.is_set():
                        raise
                    self._failed += 1
                    self._note(fault, self._failed)
                    continue
                if not unwanted.is_set():
                    self._tell(outcome)
        finally:  # before anybody else has a turn, who would not be heard any more
            self._planning = None

    def _outcome(self, request: MakePlan | Replan, unwanted: ShouldStop) -> CoordinatorEvent:
        """Plan, on a thread of its own."""
        if isinstance(request, Replan):
            limit = after_time(SystemClock(), replan_limit_s(request.situation))
            made = replan(
                request.situation,
                request.course,
                request.method,
                seed=request.seed,
                stop=first_of(limit, unwanted),
                threads=1,  # agents on this machine must not wait for a processor
            )
            return Replanned(request.request, made)
        try:
            return PlanMade(request.request, self._make_plan(request, unwanted))
        except ValueError as fault:
            return PlanFailed(request.request, str(fault))

    def _planned(self, task: asyncio.Task[None]) -> None:
        if not task.cancelled() and (fault := task.exception()):
            self._fail(fault)


def _once_set(event: threading.Event) -> ShouldStop:
    return lambda _: event.is_set()


@dataclass(frozen=True, slots=True)
class CoordinatorProcess:
    """What one coordinator's process needs."""

    mission: Mission
    make_core: MakeCoordinator
    make_plan: MissionPlanner
    open_bus: Callable[[], Awaitable[ZenohBus]]
    clock: Clock
    timing: Timing
    """In the seconds of ``clock``."""
    answer_s: float
    """How long a question waits for the slowest answer [wall s]."""
    store: Store | None
    seal: Seal | None
    """Tells whose word of what it kept still counts; None without keys."""

    async def coordinate(self) -> tuple[int, str | None]:
        """Coordinate the mission; exit status, and why it stood down if it did."""
        memory = self._recall()
        core = self.make_core(*memory)
        return await self._serve(core), core.stood_down

    async def stand_by(self) -> int:
        """Watch the coordinator, and take its place whenever it is lost; exit status."""
        memory, age_s = self._recall()
        while True:
            core = StandbyCore(self.mission, self.make_core, self.timing, memory, age_s)
            status = await self._serve(core)
            if core.stood_down is None:
                return status
            memory, age_s = core.memory(self.clock.now_s()), 0.0

    def _recall(self) -> tuple[Snapshot | None, float]:
        found = None if self.store is None else self.store.load(self.seal)
        return (None, 0.0) if found is None else (found.snapshot, found.age_s)

    async def _serve(self, core: CoordinatorCore | StandbyCore) -> int:
        seat = await self.open_bus()
        stands_by = isinstance(core, StandbyCore)
        SERVICE_NOTIFIER.ready(
            f"{'stands by for' if stands_by else 'coordinates'} {self.mission.name}"
        )
        try:
            return await run_coordinator(
                core,
                self.mission,
                seat,
                self.clock,
                self.make_plan,
                save=None if self.store is None else self.store.save,
                answer_s=self.answer_s,
            )
        finally:
            seat.close()
