"""The coordinator's process: its core on a bus, plans made beside it.

Publishes ``brief``, ``plan`` and ``board/<task>``, holds ``alive/coordinator`` and
answers on ``state/coordinator``; while it stands by, none of that. Subscribes to
``brief``, ``plan``, ``board/*``, ``uav/*/claim``, ``uav/*/outcome/*`` and
``operator/*`` and watches ``alive/*``. Leaves out: every decision (coordinator.core,
coordinator.standby).
"""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable, Coroutine, Mapping
from typing import TypeVar

from coordinator.core import CoordinatorCore
from coordinator.events import (
    Action,
    Event,
    MakePlan,
    PlanFailed,
    PlanMade,
    Replan,
    Replanned,
    StopPlanning,
    TakeSeat,
)
from coordinator.planner.live import NewPlan, replan
from coordinator.planner.stop import ShouldStop, after_time, first_of
from coordinator.standby import StandbyCore
from swarm.bus.port import Bus
from swarm.clock import Clock, SystemClock
from swarm.config import PRESETS, Link
from swarm.model import Mission, Plan
from swarm.model.ids import COORDINATOR
from swarm.process import call_in_background
from swarm.shell import Shell, take_seat
from swarm.wire.keys import Keys
from swarm.wire.messages import Snapshot

__all__ = ["run_coordinator"]

T = TypeVar("T")

REPLAN_S = 2.0
"""Wall time that a running mission waits for a better plan, valuing it included."""


async def run_coordinator(
    core: CoordinatorCore | StandbyCore,
    mission: Mission,
    bus: Bus,
    clock: Clock,
    make_plan: Callable[[Mission, str, int, ShouldStop], Plan],
    *,
    save: Callable[[Snapshot], None] | None = None,
    answer_s: float = PRESETS[Link.NORMAL].answer_s,
) -> int:
    """Coordinate ``mission``, or stand by for it, until it has ended and all agents have left.

    Args:
        core: decides; one that stands by says nothing before it takes the seat.
        mission: the scenario.
        bus: open; closed by whoever opened it.
        clock: gives ``now_s``.
        make_plan: plans a mission by method and seed; told to stop once nobody waits for the plan.
        save: keeps what the core knows for its next life.
        answer_s: how long a question waits for the slowest answer [wall s].

    Returns:
        Exit status: 0 when every task was done, 1 otherwise, also when the core has stood
        down for another coordinator.
    """
    planning: set[asyncio.Task[None]] = set()
    keys = Keys(mission.name)

    async def plan(request: MakePlan) -> None:
        def call(unwanted: ShouldStop) -> Plan:
            return make_plan(request.mission, request.method, request.seed, unwanted)

        try:
            made = await _planned_beside(call, "planner")
        except ValueError as fault:
            shell.step(PlanFailed(request.request, str(fault)))
        else:
            shell.step(PlanMade(request.request, made))

    async def plan_anew(request: Replan) -> None:
        def call(unwanted: ShouldStop) -> NewPlan:
            return replan(
                request.situation,
                request.course,
                request.method,
                seed=request.seed,
                stop=first_of(after_time(SystemClock(), REPLAN_S), unwanted),
                threads=1,  # agents on this machine must not wait for a processor
            )

        made = await _planned_beside(call, "replanner")
        shell.step(Replanned(request.request, made))

    def cancel_all() -> list[asyncio.Task[None]]:
        tasks = list(planning)
        for task in tasks:
            task.cancel()
        return tasks

    def begin(work: Coroutine[None, None, None]) -> None:
        cancel_all()  # whatever was planned before is superseded
        task = asyncio.get_running_loop().create_task(work)
        planning.add(task)
        task.add_done_callback(planned)

    def execute(action: Action) -> None:
        match action:
            case MakePlan():
                begin(plan(action))
            case Replan():
                begin(plan_anew(action))
            case StopPlanning():
                cancel_all()
            case TakeSeat():
                bus.serve(keys.state(COORDINATOR))
                bus.declare_token(keys.alive(COORDINATOR))

    def planned(task: asyncio.Task[None]) -> None:
        planning.discard(task)
        if not task.cancelled() and (fault := task.exception()):
            shell.fail(fault)

    def known() -> Mapping[str, int]:
        return core.replica.digest()  # of another one once it has taken over

    def context() -> Mapping[str, object]:
        epoch = core.replica.epoch
        return {} if epoch is None else {"epoch": epoch.number}

    def as_event(fact: Event) -> Event:
        return fact

    shell: Shell[Event, Action] = Shell(
        core,
        bus,
        clock,
        mission=mission.name,
        name=COORDINATOR,
        from_bus=as_event,
        execute=execute,
        snapshot=core.snapshot,
        known=known,
        left_out=lambda: core.replica.overfull,
        save=None if save is None else lambda now_s: save(core.memory(now_s)),
        answer_s=answer_s,
        context=context,
    )
    watches = isinstance(core, StandbyCore)
    take_seat(bus, mission.name, None if watches else COORDINATOR, status=False)
    try:
        return await shell.run()
    finally:
        await asyncio.gather(*cancel_all(), return_exceptions=True)


async def _planned_beside(call: Callable[[ShouldStop], T], name: str) -> T:
    """Plan on a thread that does not hold the process up, and learns when nobody waits for it."""
    unwanted = threading.Event()
    try:
        return await asyncio.wrap_future(
            call_in_background(lambda: call(lambda _: unwanted.is_set()), name)
        )
    finally:
        unwanted.set()
