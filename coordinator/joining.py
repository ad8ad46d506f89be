"""Join a mission on its bus to observe or to command it, without taking part in it."""

from __future__ import annotations

import asyncio
import contextlib
import math
from collections.abc import AsyncIterator, Callable, Mapping
from typing import Protocol

from coordinator.mission_view.mission_state import MissionState
from coordinator.mission_view.observation import MissionObserver, deserted
from swarm.bus.config import BusConfig
from swarm.bus.port import Bus, TokenSeen
from swarm.bus.zenoh_bus import open_zenoh_bus
from swarm.model.ids import ID_RULE, valid_id
from swarm.protocol.events import CommonAction, CommonEvent
from swarm.protocol.key_space import ANY_TOKEN, mission_of_token
from swarm.protocol.timing import PRESETS, LinkKind, Timing
from swarm.runtime.clock import Clock, ScaledClock
from swarm.runtime.console import say
from swarm.runtime.errors import Fault, InputError, SwarmError
from swarm.runtime.joining import join_mission
from swarm.runtime.shell import Core, Shell

SETTLE_S = 0.4
"""Wall time after the first token of a mission in which those of others come too."""


async def find_missions(bus: Bus, patience_s: float | None) -> list[str]:
    """Names of all missions that somebody on ``bus`` flies, once there is one.

    Waits for the first for ``patience_s`` [wall s], for as long as it takes if that is None.
    """
    bus.watch_tokens(ANY_TOKEN)
    found: set[str] = set()
    wait_s = patience_s
    try:
        while True:
            async with asyncio.timeout(wait_s):
                await bus.inbox.wait()
            tokens = [event.key for event in bus.inbox.take() if isinstance(event, TokenSeen)]
            new = {mission for token in tokens if (mission := mission_of_token(token))} - found
            found |= new
            wait_s = SETTLE_S if new else wait_s
    except TimeoutError:
        return sorted(found)


async def only_mission(bus: Bus, patience_s: float | None) -> str:
    """The mission that is meant when none is named; waits as `find_missions` does.

    Raises:
        SwarmError: there is none.
        InputError: there are several.
    """
    missions = await find_missions(bus, patience_s)
    if not missions:
        raise SwarmError(f"nobody on the bus flies a mission (looked for {patience_s:g} s)")
    if len(missions) > 1:
        problem = f"there are several missions: {', '.join(missions)}"
        raise InputError(Fault("--mission", "", problem, "name one of them"))
    return missions[0]


def check_mission(name: str | None) -> None:
    """Refuse a name that no mission can have.

    Raises:
        InputError: it is no id.
    """
    if name is not None and not valid_id(name):
        raise InputError(Fault("--mission", "", f"{name!r} is no id", f"give {ID_RULE}"))


@contextlib.asynccontextmanager
async def joined(
    mission: str | None, config: BusConfig, patience_s: float
) -> AsyncIterator[tuple[str, Bus]]:
    """The name of a mission and an open seat on its bus, which is closed at the end.

    The ``mission`` is that of the keys, or the only one there is, when None. Waits ``patience_s``
    for the bus, and then for a mission [wall s].

    Raises:
        BusError: the bus cannot be reached.
        SwarmError: there is no mission.
        InputError: none is named, and there are several.
    """
    bus = await open_zenoh_bus(config, timeout_s=patience_s, on_wait=say)
    try:
        yield mission or config.mission or await only_mission(bus, patience_s), bus
    finally:
        bus.close()


def observer_shell(
    core: Core[CommonEvent, CommonAction],
    bus: Bus,
    clock: Clock,
    mission: str,
    name: str,
    answer_s: float = PRESETS[LinkKind.NORMAL].answer_s,
    *,
    every_status: bool = False,
    known: Callable[[], Mapping[str, int]] = dict,
    left_out: Callable[[], int] = int,
) -> Shell[CommonEvent, CommonAction]:
    """A shell that tells ``core`` all that is said on the bus; it shows no token.

    ``name`` is that of this process, in logs and, where it speaks, as a writer. A question waits
    ``answer_s`` for the slowest answer [wall s]. Who looks on for long, and asks more than once,
    tells what is ``known`` (`Replica.digest`): answers leave that out.
    """
    shell: Shell[CommonEvent, CommonAction] = Shell(
        core,
        bus,
        clock,
        mission=mission,
        name=name,
        from_bus=lambda fact: fact,
        execute=lambda _: None,
        snapshot=None,
        known=known,
        left_out=left_out,
        answer_s=answer_s,
    )
    join_mission(bus, mission, None, status=True, every_status=every_status)
    return shell


FRAME_S = 0.2
"""Wall time between two pictures."""
FOREVER_S = 1e9


class MissionDisplay(Protocol):
    """Who shows what is known; called in the loop's thread."""

    def wait(self, text: str) -> None:
        """There is nothing to show yet, and ``text`` says what is waited for."""
        ...

    def update(self, mission_state: MissionState, now_s: float) -> None:
        """Show what ``mission_state`` knows at ``now_s``."""
        ...


async def watch(
    mission: str | None,
    config: BusConfig,
    timing: Timing,
    clock: ScaledClock,
    shows: MissionDisplay,
    *,
    patience_s: float | None,
) -> None:
    """Show a mission until it is over and nobody is there any more.

    The ``mission`` is that of the keys, or the only one there is, when None. Waits ``patience_s``
    for the bus, and then for the mission [wall s]; for as long as it takes when None.

    Raises:
        BusError: the bus cannot be reached, or not in that time.
        SwarmError: there is no mission in that time.
        InputError: none is named, and there are several.
    """
    limit_s = FOREVER_S if patience_s is None else patience_s
    shows.wait(f"waiting for {config.place}")
    bus = await open_zenoh_bus(config, timeout_s=limit_s)
    try:
        shows.wait(f"waiting for {'a mission' if mission is None else f'mission {mission}'}")
        name = mission or config.mission or await only_mission(bus, limit_s)
        observer = MissionObserver(name, timing, None)
        mission_state = observer.mission_state
        digest = mission_state.replica.digest
        shell = observer_shell(observer, bus, clock, name, "status", known=digest)
        looking = asyncio.get_running_loop().create_task(shell.run())
        give_up_at_s = clock.now_s() + limit_s * clock.speedup
        deserted_at_s = math.inf
        try:
            while True:
                now_s = clock.now_s()
                if observer.known:
                    shows.update(mission_state, now_s)
                elif now_s >= give_up_at_s:
                    raise SwarmError(observer.lack)
                else:
                    shows.wait(f"waiting for mission {name}: {observer.lack.partition(': ')[2]}")
                # Tokens may come a little later than what others know.
                left = deserted(mission_state)
                deserted_at_s = min(deserted_at_s, now_s) if left else math.inf
                if now_s - deserted_at_s >= timing.relink_grace_s:
                    return
                await asyncio.wait({looking}, timeout=FRAME_S)
                if looking.done() and looking.result() is not None:  # it ends only by a fault
                    return
        finally:
            looking.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await looking
    finally:
        bus.close()
