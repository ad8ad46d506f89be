"""A place on the bus for who joins a mission to look on or to command, and takes no part.

Leaves out: what such a process does there (coordinator.status, coordinator.operator).
"""

from __future__ import annotations

import contextlib
from collections.abc import AsyncIterator, Callable

from coordinator.status.onlooker import only_mission
from swarm.bus.config import BusConfig
from swarm.bus.port import Bus
from swarm.bus.zenoh_bus import open_zenoh_bus
from swarm.clock import Clock
from swarm.config import PRESETS, Link
from swarm.errors import Fault, InputError
from swarm.events import BusFact, Wish
from swarm.model.ids import ID_RULE, valid_id
from swarm.shell import Core, Shell, take_seat
from swarm.terminal import say

__all__ = ["check_mission", "joined", "onlooking"]


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

    Args:
        mission: its name; None for that of the keys, or the only one there is.
        config: how to reach the others.
        patience_s: how long to wait for the bus, and then for a mission [wall s].

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


def onlooking(
    core: Core[BusFact, Wish],
    bus: Bus,
    clock: Clock,
    mission: str,
    name: str,
    answer_s: float = PRESETS[Link.NORMAL].answer_s,
    *,
    every_status: bool = False,
    left_out: Callable[[], int] = int,
) -> Shell[BusFact, Wish]:
    """A shell that tells ``core`` all that is said on the bus; it shows no token.

    Args:
        core: looks on, and may speak.
        bus: open.
        clock: gives ``now_s``.
        mission: name of the mission.
        name: of this process, in logs and, where it speaks, as a writer.
        answer_s: how long a question waits for the slowest answer [wall s].
        every_status: see `take_seat`.
        left_out: see `Shell`.
    """
    shell: Shell[BusFact, Wish] = Shell(
        core,
        bus,
        clock,
        mission=mission,
        name=name,
        from_bus=lambda fact: fact,
        execute=lambda _: None,
        snapshot=None,
        left_out=left_out,
        answer_s=answer_s,
    )
    take_seat(bus, mission, None, status=True, every_status=every_status)
    return shell
