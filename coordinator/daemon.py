"""The coordinator's process: its core on a bus, plans made beside it.

Publishes ``brief``, ``plan`` and ``board/<task>``, holds ``alive/coordinator`` and
answers on ``state/coordinator``; subscribes to ``uav/*/claim`` and
``uav/*/outcome/*`` and watches ``alive/*``. Leaves out: every decision
(coordinator.core).
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from coordinator.core import CoordinatorCore
from coordinator.events import Action, Event, MakePlan, PlanFailed, PlanMade
from swarm.bus.port import Bus
from swarm.clock import Clock
from swarm.model import Mission, Plan
from swarm.model.ids import COORDINATOR
from swarm.process import call_in_background
from swarm.shell import Shell, take_seat

__all__ = ["run_coordinator"]


async def run_coordinator(
    core: CoordinatorCore,
    mission: Mission,
    bus: Bus,
    clock: Clock,
    make_plan: Callable[[Mission, str, int], Plan],
) -> int:
    """Coordinate ``mission`` until it has ended and all agents have left.

    Returns:
        Exit status: 0 when every task was done, 1 otherwise.
    """
    planning: set[asyncio.Task[None]] = set()

    async def plan(request: MakePlan) -> None:
        def call() -> Plan:
            return make_plan(request.mission, request.method, request.seed)

        try:
            # On a thread that does not hold the process up when it is told to end.
            made = await asyncio.wrap_future(call_in_background(call, "planner"))
        except ValueError as fault:
            shell.step(PlanFailed(request.request, str(fault)))
        else:
            shell.step(PlanMade(request.request, made))

    def execute(action: Action) -> None:
        if isinstance(action, MakePlan):
            task = asyncio.get_running_loop().create_task(plan(action))
            planning.add(task)
            task.add_done_callback(planned)

    def planned(task: asyncio.Task[None]) -> None:
        planning.discard(task)
        if not task.cancelled() and (fault := task.exception()):
            shell.fail(fault)

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
    )
    take_seat(bus, mission.name, COORDINATOR, status=False)
    try:
        return await shell.run()
    finally:
        tasks = list(planning)
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
