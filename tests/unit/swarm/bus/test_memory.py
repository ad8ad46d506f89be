"""What the network in memory adds to the contract: links that can be cut."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable

import pytest

from swarm.bus.port import LinkDown, LinkUp, Query, Sample, TokenGone, TokenSeen
from tests.support.memory_bus import MemoryBus, MemoryNetwork


def run(scenario: Callable[[MemoryNetwork, MemoryBus, MemoryBus], Awaitable[None]]) -> None:
    """Play with two seats that watch each other and have read all so far."""

    async def play() -> None:
        network = MemoryNetwork()
        a, b = network.join("a"), network.join("b")
        for name, bus in (("a", a), ("b", b)):
            bus.declare_token(f"alive/{name}")
            bus.watch_tokens("alive/*")
            bus.subscribe("news")
        a.inbox.take()
        b.inbox.take()
        await scenario(network, a, b)

    asyncio.run(play())


def test_cut_takes_the_link_and_the_sight_of_each_other() -> None:
    async def scenario(network: MemoryNetwork, a: MemoryBus, b: MemoryBus) -> None:
        network.cut("a")
        network.cut("a")
        a.publish("news", b"unheard")

        assert a.inbox.take() == [LinkDown(), TokenGone("alive/b")]
        assert b.inbox.take() == [TokenGone("alive/a")]

    run(scenario)


def test_heal_brings_both_back() -> None:
    async def scenario(network: MemoryNetwork, a: MemoryBus, b: MemoryBus) -> None:
        network.cut("a")
        b.declare_token("alive/new")
        a.inbox.take()
        b.inbox.take()
        network.heal("a")
        network.heal("a")
        a.publish("news", b"heard")

        assert a.inbox.take() == [LinkUp(), TokenSeen("alive/b"), TokenSeen("alive/new")]
        assert b.inbox.take() == [TokenSeen("alive/a"), Sample("news", b"heard")]

    run(scenario)


def test_cut_server_keeps_nobody_waiting() -> None:
    async def scenario(network: MemoryNetwork, a: MemoryBus, b: MemoryBus) -> None:
        b.serve("state/b")
        asking = asyncio.create_task(a.query("state/*", timeout_s=10.0))
        await b.inbox.wait()
        (query,) = b.inbox.take()
        assert isinstance(query, Query)
        network.cut("b")
        query.reply(b"too late")

        assert await asyncio.wait_for(asking, 1.0) == ()

    run(scenario)


def test_closed_seat_stays_closed() -> None:
    async def scenario(network: MemoryNetwork, a: MemoryBus, b: MemoryBus) -> None:
        a.close()
        network.heal("a")

        assert b.inbox.take() == [TokenGone("alive/a")]
        assert a.inbox.take() == []
        with pytest.raises(ValueError, match="a has a seat already"):
            network.join("a")

    run(scenario)
