"""Changes who belongs to a mission while it flies: opens a seat, makes the change, and tells.

The seat comes first, so that nothing is changed where nobody can be told.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextlib import suppress
from typing import Final

from swarm.bus.config import BusConfig
from swarm.bus.zenoh_bus import open_zenoh_bus
from swarm.identity.announcer import RosterAnnouncer
from swarm.identity.roster import Role, Roster
from swarm.model.ids import COORDINATOR
from swarm.protocol.events import CommonAction, CommonEvent
from swarm.protocol.messages import roster_message
from swarm.runtime.clock import SystemClock
from swarm.runtime.console import say
from swarm.runtime.errors import SwarmError
from swarm.runtime.joining import join_mission
from swarm.runtime.log import LogLevel, configure_logging
from swarm.runtime.shell import Shell

CONNECT_S: Final = 10.0
"""How long to wait for the bus [s]."""
CONFIRM_S: Final = 10.0
"""How long to wait for everyone who is there [s]."""


def publish(config: BusConfig, change: Callable[[], bytes]) -> list[str]:
    """Make a change and tell the fleet from an operator's or a coordinator's seat.

    ``change`` makes it once the bus is reached, and gives the signed roster that follows.

    Returns:
        Who has confirmed it; empty if nobody was there who could.

    Raises:
        BusError: the bus cannot be reached; nothing was changed.
        SwarmError: somebody who was there has not confirmed it, or the fleet has a roster
            that this one cannot replace.
    """
    configure_logging(LogLevel.ERROR)
    announcer = asyncio.run(_tell(config, change))
    if announcer.other_version is not None:
        raise SwarmError(
            f"the fleet has another roster, of version {announcer.other_version}: this is not the "
            "newest copy of the authority's folder"
        )
    if announcer.lacking:
        raise SwarmError(
            f"published, but within {CONFIRM_S:g} s not confirmed by "
            f"{', '.join(announcer.lacking)}: out of reach, from where they learn it of the "
            "others later, or with replaced keys"
        )
    return sorted(announcer.has)


async def _tell(config: BusConfig, change: Callable[[], bytes]) -> RosterAnnouncer:
    bus = await open_zenoh_bus(config, timeout_s=CONNECT_S, on_wait=say)
    try:
        identity, seal = config.identity, bus.seal
        if identity is None or seal is None:
            raise ValueError("a roster is told on a bus with keys alone")
        before = seal.roster
        signed = change().decode("ascii")
        with suppress(OSError):  # its folder may have been taken away
            seal.put_in_force(signed)
        roster = seal.read_roster(signed)
        message = roster_message(identity.mission, roster.version, signed)
        announcer = RosterAnnouncer(message, _writers(roster, before), CONFIRM_S)
        shell: Shell[CommonEvent, CommonAction] = Shell(
            announcer,
            bus,
            SystemClock(),
            mission=identity.mission,
            name=identity.name,
            from_bus=lambda fact: fact,
            execute=lambda _: None,
            snapshot=None,
            known=announcer.known,
        )
        join_mission(bus, identity.mission, None, status=False)
        await shell.run()
        return announcer
    finally:
        bus.close()


def _writers(roster: Roster, before: Roster) -> set[str]:
    """Who may show a token and answer questions with the keys that they had before."""
    return {
        COORDINATOR if entry.role is Role.COORDINATOR else entry.name
        for entry in roster.entries
        if entry.role in (Role.UAV, Role.COORDINATOR) and entry == before.entry(entry.name)
    }
