"""The agent's process: its core between a bus and a vehicle.

Publishes ``uav/<id>/claim``, for some alone ``…/claim/<name>``, ``…/outcome/<task>``,
``…/status`` and ``…/choice``, holds ``alive/<id>`` and answers on ``state/<id>``; subscribes to
``brief``, ``plan``, ``board/*``, ``uav/*/claim``, ``uav/*/claim/<id>``, ``uav/*/outcome/*`` and
``operator/*`` and watches ``alive/*``. Leaves out: every decision (agent.core.agent_core) and
flying (agent.vehicle).
"""

from __future__ import annotations

import asyncio
import contextlib
from collections import Counter
from collections.abc import Awaitable, Callable, Mapping
from functools import partial
from typing import Protocol

from agent.core.agent_core import AgentCore
from agent.core.interface import (
    Action,
    Event,
    Home,
    OrderVehicle,
    Return,
    ReturnBegun,
    Telemetry,
    VehicleOrder,
    VehicleReport,
)
from agent.core.station_words import StationAction, StationAsked
from swarm.bus.port import Bus
from swarm.protocol.events import Stop
from swarm.protocol.messages import MissionConfig, Snapshot
from swarm.protocol.sync import some_of
from swarm.protocol.timing import PRESETS, LinkKind
from swarm.runtime.clock import Clock
from swarm.runtime.errors import BusError
from swarm.runtime.joining import join_mission
from swarm.runtime.process import SERVICE_NOTIFIER, ServiceNotifier, StopRequest
from swarm.runtime.shell import Shell
from swarm.runtime.store import Memory, Store
from swarm.runtime.turns import SharedProcess

RETRY_S = 0.5
"""Wall time between a failed try for a seat on the bus and the next."""
NEXT_LIFE_S = 30.0
"""Wall time from having left a mission in order to looking for the next one."""
FAREWELL_S = 15.0
"""Longest wall time from being told to stop to leaving: what it takes to find a vehicle, and
to see it return."""


class Vehicle(Protocol):
    """A vehicle that can be commanded and reports back in the loop's thread."""

    @property
    def dropped(self) -> Mapping[str, int]:
        """What was heard of it and dropped so far, by reason."""
        ...

    async def start(self) -> None:
        """Open the link."""
        ...

    def order(self, order: VehicleOrder) -> None:
        """Command it."""
        ...

    def tell_stations(self, action: StationAction) -> None:
        """Tell the ground stations that are shown it."""
        ...

    async def close(self) -> None:
        """Close the link; the vehicle goes on with what it does."""
        ...


OnReport = Callable[[VehicleReport | StationAsked], None]
"""Hears what a vehicle reports, and what ground stations that are shown it ask for."""
MakeVehicle = Callable[[MissionConfig, OnReport], Vehicle]
"""Makes the vehicle for a mission."""


class _Dropping(Protocol):
    """Something that drops and counts."""

    @property
    def dropped(self) -> Mapping[str, int]: ...


def _dropped_by(*parts: _Dropping) -> Counter[str]:
    """What all of them have dropped so far, by reason."""
    dropped = Counter[str]()
    for part in parts:
        dropped.update(part.dropped)
    return dropped


async def seat_or_stop(
    open_bus: Callable[[], Awaitable[Bus]], stop: StopRequest, on_wait: Callable[[str], None]
) -> Bus | None:
    """A seat on the bus, tried for until there is one; None when told to stop first.

    Each try takes a bounded time; ``on_wait`` is told why it failed.
    """
    loop = asyncio.get_running_loop()
    trying, stopped = loop.create_task(_seat(open_bus, on_wait)), loop.create_task(stop.wait())
    try:
        await asyncio.wait((trying, stopped), return_when=asyncio.FIRST_COMPLETED)
        return trying.result() if trying.done() else None
    finally:
        for task in (trying, stopped):
            task.cancel()
        await asyncio.gather(trying, stopped, return_exceptions=True)


async def pause_between_lives(
    stop: StopRequest, manager: ServiceNotifier = SERVICE_NOTIFIER
) -> None:
    """Wait a little before leaving where a service manager starts this process again at once.

    A coordinator stays until all agents have left: one that comes back every second
    would keep it.
    """
    if manager.supervised and stop.exit_status is None:
        manager.ready(f"left its mission; looks for the next in {NEXT_LIFE_S:g} s")
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(NEXT_LIFE_S):
                await stop.wait()


async def _seat(open_bus: Callable[[], Awaitable[Bus]], on_wait: Callable[[str], None]) -> Bus:
    while True:
        try:
            return await open_bus()
        except BusError as fault:
            on_wait(str(fault))
        # A try may fail at once, such as when the endpoint to listen on is taken.
        await asyncio.sleep(RETRY_S)


async def live_once(
    open_bus: Callable[[], Awaitable[Bus]],
    make_core: Callable[[Memory | None], AgentCore],
    make_vehicle: MakeVehicle,
    clock: Clock,
    stop: StopRequest,
    *,
    mission: str,
    uav: str,
    store: Store | None,
    answer_s: float,
    on_wait: Callable[[str], None],
    shared: SharedProcess | None = None,
) -> int:
    """One life of an agent, from its seat on the bus to its end; the exit status.

    Args:
        open_bus: tries once to get a seat.
        make_core: makes the agent, given what its earlier life has kept.
        make_vehicle: as for `run_agent`.
        clock: gives the core's time.
        stop: asks to leave early.
        mission: mission name.
        uav: id of its UAV.
        store: keeps what the core knows for its next life; None: nothing is kept.
        answer_s: how long a question waits for the slowest answer [wall s].
        on_wait: called with the reason whenever there was no seat.
        shared: as for `run_agent`.
    """
    SERVICE_NOTIFIER.waiting(f"{uav}: looks for the bus")
    seat = await seat_or_stop(open_bus, stop, on_wait)
    if seat is None:
        return stop.exit_status or 0
    SERVICE_NOTIFIER.ready(f"{uav}: on the bus, in mission {mission}")
    # Only now: waiting for a seat may have taken long.
    core = make_core(None if store is None else store.load(seat.seal))
    save = None if store is None else store.save
    try:
        status = await run_agent(
            core,
            mission,
            seat,
            clock,
            make_vehicle,
            stop,
            save=save,
            answer_s=answer_s,
            shared=shared,
        )
    finally:
        seat.close()
    await pause_between_lives(stop)
    return status


async def run_agent(
    core: AgentCore,
    mission: str,
    bus: Bus,
    clock: Clock,
    make_vehicle: MakeVehicle,
    stop: StopRequest,
    *,
    save: Callable[[Snapshot], None] | None = None,
    answer_s: float = PRESETS[LinkKind.NORMAL].answer_s,
    shared: SharedProcess | None = None,
) -> int:
    """Fly one UAV until the mission has ended and the vehicle is home.

    Args:
        core: the agent.
        mission: mission name.
        bus: open; closed by the caller.
        clock: gives the core's time.
        make_vehicle: makes the vehicle once the mission is known.
        stop: asks to leave early: the vehicle is told to return first, and seen to.
        save: keeps what the core knows for its next life.
        answer_s: how long a question waits for the slowest answer [wall s].
        shared: what it has in common with other agents in this process.

    Returns:
        Exit status.
    """
    flight = _Flight(
        core, bus, clock, mission, make_vehicle, save=save, answer_s=answer_s, shared=shared
    )
    join_mission(bus, mission, core.uav, status=False, addressed=True)
    loop = asyncio.get_running_loop()
    flying = loop.create_task(flight.shell.run())
    leaving = loop.create_task(_farewell(flight, flying, stop))
    try:
        await asyncio.wait((flying, leaving), return_when=asyncio.FIRST_COMPLETED)
        if stop.exit_status is None:
            return flying.result()
        told = await leaving
        if flying.done():
            flying.result()  # raises what went wrong while leaving
        return told
    finally:
        tasks = [task for task in (flying, leaving, flight.starting) if task is not None]
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        if flight.vehicle is not None:
            await flight.vehicle.close()


class _Flight:
    """An agent's shell and, once the mission is known, its vehicle; see `run_agent`."""

    def __init__(
        self,
        core: AgentCore,
        bus: Bus,
        clock: Clock,
        mission: str,
        make_vehicle: MakeVehicle,
        *,
        save: Callable[[Snapshot], None] | None,
        answer_s: float,
        shared: SharedProcess | None,
    ) -> None:
        self.vehicle: Vehicle | None = None
        self.starting: asyncio.Task[None] | None = None
        self.returns = asyncio.Event()
        """Set while the vehicle is seen to fly home."""
        self._core = core
        self._make_vehicle = make_vehicle
        self._save = save
        self.shell: Shell[Event, Action] = Shell(
            core,
            bus,
            clock,
            mission=mission,
            name=core.uav,
            from_bus=lambda fact: fact,
            execute=self._execute,
            snapshot=core.snapshot,
            whole=core.whole,
            known=core.replica.digest,
            register=core.replica.register,
            left_out=lambda: core.replica.overfull,
            save=self._keep,
            answer_s=answer_s,
            together=lambda heard: heard,
            settled=lambda: not core.is_contested,
            pressing_s=core.next_own_deadline_s,
            runs_since=core.run_since,
            crowd=lambda there: some_of(core.uav, there),
            shared=shared,
        )
        core.dropped = partial(_dropped_by, self.shell)

    def _execute(self, action: Action) -> None:
        if isinstance(action, StationAction) and self.vehicle is not None:
            self.vehicle.tell_stations(action)
        if not isinstance(action, OrderVehicle):
            return
        brief, order = self._core.replica.brief, action.order
        if not isinstance(order, Return):
            self.returns.clear()
        flown = not isinstance(order, Return) or order.resume
        if self.vehicle is None and brief is not None and flown:
            self.vehicle = self._make_vehicle(brief, self._report)
            self._core.dropped = partial(_dropped_by, self.shell, self.vehicle)
            self.starting = asyncio.get_running_loop().create_task(self.vehicle.start())
            self.starting.add_done_callback(self._failed)
        if self.vehicle is not None:
            self.vehicle.order(order)
        elif isinstance(order, Return):
            asyncio.get_running_loop().call_soon(self._report, Home())

    def _report(self, news: VehicleReport | StationAsked) -> None:
        if isinstance(news, ReturnBegun):
            self.returns.set()
        if not isinstance(news, Telemetry):
            self.shell.gather()  # what the next task is may follow
            self.shell.step(news)
        elif self.shell.is_due:  # such as who gives way
            self.shell.step_in_turn(news)
        else:
            self.shell.step(news)

    def _failed(self, task: asyncio.Task[None]) -> None:
        if not task.cancelled() and (fault := task.exception()):
            self.shell.fail(fault)

    def _keep(self, now_s: float) -> None:
        if self._save is not None:
            self._save(self._core.memory(now_s))


async def _farewell(flight: _Flight, flying: asyncio.Task[int], stop: StopRequest) -> int:
    """Told to stop: have the vehicle return, and see it do so; the exit status."""
    status = await stop.wait()
    flight.shell.step(Stop("the agent was told to stop"))
    seen = asyncio.get_running_loop().create_task(flight.returns.wait())
    try:
        first = asyncio.FIRST_COMPLETED
        await asyncio.wait((flying, seen), timeout=FAREWELL_S, return_when=first)
    finally:
        seen.cancel()
    return status
