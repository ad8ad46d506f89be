"""The agents of one process, each with a core, a seat and a vehicle of its own.

A process is the agent of one UAV, so that nothing but its own faults can end it. Where vehicles are
simulated it may be that of several: they share what is imported, an interpreter and its lock.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass
from typing import Final

from agent.core.agent_core import AgentCore
from agent.runner import MakeVehicle, OnReport, Vehicle, live_once
from swarm.bus.config import BusConfig, ClientTopology
from swarm.bus.port import Bus
from swarm.bus.shared_seats import SharedBus, SharedSeats
from swarm.protocol.messages import MissionConfig
from swarm.runtime import garbage
from swarm.runtime.clock import Clock
from swarm.runtime.errors import Fault, InputError
from swarm.runtime.log import get_logger, identify_task
from swarm.runtime.process import SERVICE_NOTIFIER, StopRequest, stop_requests
from swarm.runtime.store import Memory, Store
from swarm.runtime.turns import SharedProcess

JOIN_S: Final = 3.0
"""Wall time that one of several agents gets to join before the next one begins."""


@dataclass(frozen=True, slots=True)
class Member:
    """One of the UAVs that a process flies."""

    uav: str
    mavlink: str
    """Where its autopilot is."""
    system_id: int


@dataclass(frozen=True, slots=True)
class Life:
    """What the agent of one UAV is made of."""

    uav: str
    make_core: Callable[[Memory | None], AgentCore]
    make_vehicle: MakeVehicle
    store: Store | None


def members_of(
    uavs: Sequence[str], links: Sequence[str], system_ids: Sequence[int], config: BusConfig
) -> list[Member]:
    """The UAVs that a process is told to fly, of which each is to have a seat by ``config``.

    Raises:
        InputError: that cannot be.
    """
    if len(uavs) > 1 and config.identity is not None:
        problem = "each UAV has keys of its own, and a process those of one"
        raise InputError(Fault("--keys", "", problem, "start a process for each UAV"))
    if len(uavs) > 1 and not isinstance(config.topology, ClientTopology):
        problem = f"there is one place for {len(uavs)} UAVs"
        raise InputError(Fault("--bus", "", problem, "let them meet at a router"))
    if len(set(uavs)) < len(uavs):
        raise InputError(Fault("--uav", ", ".join(uavs), "one is named twice", "name each once"))
    for option, given in (("--mavlink", links), ("--system-id", system_ids)):
        if len(given) != len(uavs):
            problem = f"{len(given)} for {len(uavs)} UAVs"
            raise InputError(Fault(option, "", problem, "give one for each, in the same order"))
    return list(map(Member, uavs, links, system_ids))


def live(
    lives: Sequence[Life],
    open_bus: Callable[[], Awaitable[SharedBus]],
    clock: Clock,
    *,
    mission: str,
    answer_s: float,
    lifeline: bool,
) -> int:
    """Live on the bus to the end of all, and close the stores; the exit status of the process.

    Args:
        lives: one or more.
        open_bus: tries once to get a seat; several share one.
        clock: gives the cores' time.
        mission: mission name.
        answer_s: how long a question waits for the slowest answer [wall s].
        lifeline: whether the end of standard input ends the process.
    """

    async def live_one(
        each: Life,
        stop: StopRequest,
        joined: asyncio.Event,
        open_seat: Callable[[], Awaitable[Bus]],
        shared: SharedProcess | None,
    ) -> int:
        def make_vehicle(brief: MissionConfig, report: OnReport) -> Vehicle:
            joined.set()
            return each.make_vehicle(brief, report)

        return await live_once(
            open_seat,
            each.make_core,
            make_vehicle,
            clock,
            stop,
            mission=mission,
            uav=each.uav,
            store=each.store,
            answer_s=answer_s,
            on_wait=lambda reason: _tell_no_bus(each.uav, reason),
            shared=shared,
        )

    async def live_all() -> int:
        async with stop_requests(lifeline=lifeline) as stop:
            if len(lives) == 1:
                return await live_one(lives[0], stop, asyncio.Event(), open_bus, None)
            seats, shared = SharedSeats(open_bus), SharedProcess()
            return await live_together(
                lives, lambda each, joined: live_one(each, stop, joined, seats.seat, shared)
            )

    try:
        return asyncio.run(live_all())
    finally:
        for life in lives:
            if life.store is not None:
                life.store.close()


async def live_together(
    lives: Sequence[Life],
    live_one: Callable[[Life, asyncio.Event], Awaitable[int]],
    join_s: float = JOIN_S,
) -> int:
    """Several lives; each begins when the one before has joined, so that none is held up.

    Args:
        lives: in this order.
        live_one: lives one of them to its end; sets the event when it has joined.
        join_s: after so long the next one begins anyway [wall s].

    Returns:
        The highest exit status.
    """
    loop = asyncio.get_running_loop()
    running = []
    for each in lives:
        joined = asyncio.Event()
        running.append(loop.create_task(_live_among_others(each.uav, live_one(each, joined))))
        waiting = loop.create_task(joined.wait())
        first = asyncio.FIRST_COMPLETED
        await asyncio.wait((running[-1], waiting), timeout=join_s, return_when=first)
        waiting.cancel()
    with garbage.kept():  # it takes tens of milliseconds to look through what dozens have learned
        return max(await asyncio.gather(*running))


async def _live_among_others(uav: str, life: Awaitable[int]) -> int:
    """One life of several; its own fault is told and ends no other."""
    identify_task(uav=uav)
    try:
        return await life
    except Exception:  # noqa: BLE001 - the top of what would be a process of its own
        get_logger(uav).exception("crashed")
        return 1


def _tell_no_bus(uav: str, reason: str) -> None:
    get_logger(uav).warning("no bus yet", reason=reason)
    SERVICE_NOTIFIER.waiting(f"{uav}: no bus yet: {reason}")
