"""Seats on each kind of bus, and readers that wait for events with a deadline."""

from __future__ import annotations

import asyncio
import contextlib
import itertools
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from typing import Protocol, TypeVar

import numpy as np

from swarm.bus.config import BusConfig, ClientTopology, MeshTopology
from swarm.bus.loopback import free_loopback_endpoints
from swarm.bus.port import Bus, BusEvent, LinkUp, Sample, TokenSeen
from swarm.bus.shared_seats import SharedSeats
from swarm.bus.zenoh_bus import open_zenoh_bus
from tests.support.memory_bus import MemoryNetwork

LIMIT_S = 10.0
"""Longest wait for anything that must happen."""
MAX_SEATS = 4

E = TypeVar("E", bound=BusEvent)


class Join(Protocol):
    """Take one more seat."""

    async def __call__(self, *, inbox_capacity: int = 4096) -> Bus: ...


Seats = Callable[[], "contextlib.AbstractAsyncContextManager[Join]"]


def memory_seats() -> Seats:
    @contextlib.asynccontextmanager
    async def seats() -> AsyncIterator[Join]:
        network = MemoryNetwork()
        names = (str(n) for n in itertools.count())

        async def join(*, inbox_capacity: int = 4096) -> Bus:
            return network.join(next(names), inbox_capacity=inbox_capacity)

        yield join

    return seats


def mesh_seats() -> Seats:
    """Peers on loopback, each dialing those before it."""

    @contextlib.asynccontextmanager
    async def seats() -> AsyncIterator[Join]:
        endpoints = free_loopback_endpoints(MAX_SEATS, np.random.default_rng())
        taken = itertools.count()

        def configs() -> Iterator[BusConfig]:
            for n in taken:
                yield BusConfig(MeshTopology(endpoints[n], endpoints[:n]))

        async with _zenoh_seats(configs()) as join:
            yield join

    return seats


def client_seats(*routers: str) -> Seats:
    """Clients of the first router that answers."""

    def seats() -> contextlib.AbstractAsyncContextManager[Join]:
        return _zenoh_seats(itertools.repeat(BusConfig(ClientTopology(routers))))

    return seats


@contextlib.asynccontextmanager
async def _zenoh_seats(configs: Iterator[BusConfig]) -> AsyncIterator[Join]:
    with contextlib.ExitStack() as open_buses:

        async def join(*, inbox_capacity: int = 4096) -> Bus:
            bus = await open_zenoh_bus(
                next(configs), timeout_s=LIMIT_S, inbox_capacity=inbox_capacity
            )
            open_buses.callback(bus.close)
            return bus

        yield join


def shared_seats(*routers: str) -> Seats:
    """Seats of one process that share a client's; every second one has another process's."""

    @contextlib.asynccontextmanager
    async def seats() -> AsyncIterator[Join]:
        config = BusConfig(ClientTopology(routers))
        processes = [SharedSeats(lambda: open_zenoh_bus(config, timeout_s=LIMIT_S)) for _ in "ab"]
        turns = itertools.cycle((0, 0, 1))
        with contextlib.ExitStack() as open_seats:

            async def join(*, inbox_capacity: int = 4096) -> Bus:
                seat = await processes[next(turns)].seat(inbox_capacity=inbox_capacity)
                open_seats.callback(seat.close)
                return seat

            yield join

    return seats


class Reader:
    """Keeps all that arrived at one seat, in order."""

    def __init__(self, bus: Bus) -> None:
        self.bus = bus
        self.events: list[BusEvent] = []

    async def until(self, satisfied: Callable[[], bool]) -> None:
        """Read until a condition on `events` holds."""
        async with asyncio.timeout(LIMIT_S):
            while not satisfied():
                await self.bus.inbox.wait()
                self.events += self.bus.inbox.take()

    async def until_event(self, event: BusEvent, times: int = 1) -> None:
        """Read until ``event`` has arrived so often."""
        try:
            await self.until(lambda: self.events.count(event) >= times)
        except TimeoutError:
            raise AssertionError(f"{event} did not arrive; {self.events} did") from None

    async def next_of(self, kind: type[E]) -> E:
        """The first event of a kind, read and still to be read; it is taken out."""
        await self.until(lambda: any(isinstance(event, kind) for event in self.events))
        found = next(event for event in self.events if isinstance(event, kind))
        self.events.remove(found)
        return found

    def of(self, kind: type[E]) -> list[E]:
        """What has arrived of one kind."""
        return [event for event in self.events if isinstance(event, kind)]

    def payloads(self, key: str) -> list[bytes]:
        """What has arrived on one key."""
        return [sample.payload for sample in self.of(Sample) if sample.key == key]


_rounds = itertools.count()


async def settle(*readers: Reader) -> None:
    """Return when each seat knows what all others have declared until now.

    Declarations of one seat travel in order, so whoever sees a later token of it
    knows the earlier subscriptions too.
    """
    this = next(_rounds)
    for n, reader in enumerate(readers):
        reader.bus.watch_tokens(f"settle/{this}/*")
        reader.bus.declare_token(f"settle/{this}/{n}")
    for n, reader in enumerate(readers):
        for other in range(len(readers)):
            if other != n:
                await reader.until_event(TokenSeen(f"settle/{this}/{other}"))
        reader.events = [
            event for event in reader.events if not isinstance(event, TokenSeen | LinkUp)
        ]


Scenario = Callable[[Join], Awaitable[None]]


def run(seats: Seats, scenario: Scenario) -> None:
    """Play a scenario in a loop of its own and close all seats."""

    async def play() -> None:
        async with seats() as join:
            await scenario(join)

    asyncio.run(play())
