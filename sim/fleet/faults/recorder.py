"""Everything that is said on the bus of a run, with the time at which it arrived.

The recorder has seats of its own, none behind a relay: one at each router, so that it hears both
sides when they are parted, or one in the mesh, linked to every peer. It says nothing and answers
nothing.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

from sim.fleet.layout import Layout
from swarm.bus.config import BusConfig, ClientTopology
from swarm.bus.port import Bus, BusEvent, Sample
from swarm.bus.zenoh_bus import open_zenoh_bus
from swarm.protocol.codec import Codec
from swarm.protocol.key_space import KeySpace
from swarm.protocol.messages import Message
from swarm.runtime.clock import Clock

RECORDER = "recorder"
"""Name of its place in a mesh."""


@dataclass(frozen=True, slots=True)
class BusEntry:
    """A message heard at one seat."""

    at_s: float
    """When, on the recorder's clock [s]."""
    seat: int
    what: Message
    size_bytes: int
    """Of the payload."""


def recorder_seats(layout: Layout) -> tuple[BusConfig, ...]:
    """Seats from which everything in a run is heard.

    In a mesh, the run must have been opened with `RECORDER` among its observers.
    """
    seat = layout.observer_seat(RECORDER)
    if isinstance(seat.topology, ClientTopology):
        routers = seat.topology.routers
        return tuple(replace(seat, topology=ClientTopology((router,))) for router in routers)
    return (seat,)


class BusRecorder:
    """Records one mission from when its context is entered until it is left.

    A message that is heard at two seats is recorded twice.
    """

    def __init__(self, mission: str, seats: Sequence[BusConfig], clock: Clock) -> None:
        self.entries: list[BusEntry] = []
        """All that was heard, in order of arrival."""
        self._mission = mission
        self._seats = tuple(seats)
        self._clock = clock
        self._codec = Codec(mission)
        self._buses: list[Bus] = []
        self._readers: list[asyncio.Task[None]] = []

    async def __aenter__(self) -> Self:
        try:
            for config in self._seats:
                self._sit(await open_zenoh_bus(config))
        except BaseException:
            await self._close()
            raise
        return self

    async def __aexit__(self, *_: object) -> None:
        await self._close()

    def messages(self, seat: int = 0) -> list[Message]:
        """What was said, as heard at one seat."""
        return [entry.what for entry in self.entries if entry.seat == seat]

    def take(self, seat: int, event: BusEvent) -> None:
        """Record what was said at a seat, if it can be read."""
        if isinstance(event, Sample):
            what = self._codec.decode(event.key, event.payload)
            if what is not None:
                entry = BusEntry(self._clock.now_s(), seat, what, len(event.payload))
                self.entries.append(entry)

    def _sit(self, bus: Bus) -> None:
        seat = len(self._buses)
        if bus.seal is not None:
            self._codec = Codec(self._mission, bus.seal)
        self._buses.append(bus)
        bus.subscribe(f"{KeySpace(self._mission).root}/**")
        self._readers.append(asyncio.get_running_loop().create_task(self._read(seat, bus)))

    async def _read(self, seat: int, bus: Bus) -> None:
        while True:
            await bus.inbox.wait()
            for event in bus.inbox.take():
                self.take(seat, event)

    async def _close(self) -> None:
        for reader in self._readers:
            reader.cancel()
        for reader in self._readers:
            with contextlib.suppress(asyncio.CancelledError):
                await reader
        for bus in self._buses:
            bus.close()
