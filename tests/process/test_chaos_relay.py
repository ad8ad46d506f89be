"""A relay passes bytes on, late, and swallows them while it is cut."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, field

import numpy as np
import pytest

from sim.fleet.faults.relay import Relay, RelayNetwork, RelayQuality
from sim.fleet.layout import DialedLink

pytestmark = pytest.mark.process

LIMIT_S = 20.0
LINK = DialedLink("u1", "router 1")


def play(scenario: Callable[[], Awaitable[None]]) -> None:
    async def watched() -> None:
        try:
            async with asyncio.timeout(LIMIT_S):
                await scenario()
        finally:
            await dial.close()
            await asyncio.sleep(0.01)

    asyncio.run(watched())


def now_s() -> float:
    return asyncio.get_running_loop().time()


@dataclass
class Far:
    """The real endpoint: keeps what arrives and answers when told to."""

    port: int = 0
    arrived: bytearray = field(default_factory=bytearray)
    ends: int = 0
    writers: list[asyncio.StreamWriter] = field(default_factory=list)

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.writers.append(writer)
        while data := await reader.read(1 << 16):
            self.arrived += data
        self.ends += 1
        writer.close()


@asynccontextmanager
async def far_end() -> AsyncIterator[Far]:
    far = Far()
    server = await asyncio.start_server(far.serve, "127.0.0.1", 0)
    far.port = server.sockets[0].getsockname()[1]
    try:
        yield far
    finally:
        server.close()
        for writer in far.writers:
            writer.close()


@asynccontextmanager
async def relayed(quality: RelayQuality | None = None) -> AsyncIterator[tuple[Relay, Far]]:
    async with far_end() as far:
        relay = Relay("127.0.0.1", far.port, np.random.default_rng(0))
        relay.quality = quality or RelayQuality()
        await relay.start()
        try:
            yield relay, far
        finally:
            await relay.close()
            assert not relay.connections


class Dialed:
    """Connections to a relay, all closed in the end."""

    def __init__(self) -> None:
        self.writers: list[asyncio.StreamWriter] = []

    async def __call__(self, relay: Relay) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
        reader, writer = await asyncio.open_connection("127.0.0.1", relay.port)
        self.writers.append(writer)
        return reader, writer

    async def close(self) -> None:
        for writer in self.writers:
            writer.transport.abort()
        self.writers.clear()
        await asyncio.sleep(0)  # lets aborted transports close their sockets


dial = Dialed()


async def until(condition: Callable[[], bool]) -> None:
    for _ in range(1000):
        if condition():
            return
        await asyncio.sleep(0.01)
    pytest.fail("the condition never held")


def test_bytes_pass_in_order_and_in_both_directions() -> None:
    data = np.random.default_rng(1).bytes(3_000_000)

    async def scenario() -> None:
        async with relayed() as (relay, far):
            reader, writer = await dial(relay)
            writer.write(data)
            await until(lambda: len(far.arrived) == len(data))
            assert far.arrived == data
            far.writers[0].write(data)
            assert await reader.readexactly(len(data)) == data
            assert relay.relayed_bytes == 2 * len(data)

    play(scenario)


def test_the_end_of_a_connection_is_passed_on_after_its_last_bytes() -> None:
    async def scenario() -> None:
        async with relayed(RelayQuality(delay_s=0.2)) as (relay, far):
            reader, writer = await dial(relay)
            writer.write(b"last words")
            writer.close()
            await until(lambda: far.ends == 1)
            assert far.arrived == b"last words"
            assert await reader.read() == b""
            await until(lambda: not relay.connections)

    play(scenario)


def test_a_reset_connection_ends_at_the_other_side_too() -> None:
    async def scenario() -> None:
        async with relayed() as (relay, far):
            reader, writer = await dial(relay)
            writer.write(b"hello")
            await until(lambda: bool(far.arrived))
            far.writers[0].transport.abort()
            assert await reader.read() == b""

    play(scenario)


def test_an_endpoint_that_is_not_there_refuses() -> None:
    async def scenario() -> None:
        async with relayed() as (relay, far):
            port = far.port
        nowhere = Relay("127.0.0.1", port, np.random.default_rng(0))
        await nowhere.start()
        try:
            reader, _ = await dial(nowhere)
            assert await reader.read() == b""
        except ConnectionResetError:
            pass  # refused as well
        finally:
            await nowhere.close()
        assert relay.relayed_bytes == nowhere.relayed_bytes == 0

    play(scenario)


def test_delay_holds_in_each_direction() -> None:
    async def scenario() -> None:
        async with relayed(RelayQuality(delay_s=0.15, jitter_s=0.05)) as (relay, far):
            reader, writer = await dial(relay)
            await until(lambda: bool(far.writers))
            begin_s = now_s()
            writer.write(b"ping")
            await until(lambda: bool(far.arrived))
            assert now_s() - begin_s >= 0.15
            begin_s = now_s()
            far.writers[0].write(b"pong")
            await reader.readexactly(4)
            assert now_s() - begin_s >= 0.15

    play(scenario)


def test_bandwidth_holds() -> None:
    async def scenario() -> None:
        async with relayed(RelayQuality(rate_bytes_s=100_000.0)) as (relay, far):
            _, writer = await dial(relay)
            begin_s = now_s()
            writer.write(bytes(50_000))
            await until(lambda: len(far.arrived) == 50_000)
            assert now_s() - begin_s >= 0.5

    play(scenario)


def test_lost_segments_come_late_and_nothing_is_missing_or_out_of_order() -> None:
    async def scenario() -> None:
        async with relayed(RelayQuality(loss_frac=0.3)) as (relay, far):
            _, writer = await dial(relay)
            begin_s, sent = now_s(), b""
            for number in range(20):
                sent += bytes([number])
                writer.write(bytes([number]))
                await asyncio.sleep(0.01)
            await until(lambda: len(far.arrived) == 20)
            assert far.arrived == sent
            assert now_s() - begin_s >= 0.2

    play(scenario)


def test_a_cut_swallows_bytes_until_it_heals_and_closes_nothing() -> None:
    async def scenario() -> None:
        async with relayed() as (relay, far):
            reader, writer = await dial(relay)
            writer.write(b"before")
            await until(lambda: far.arrived == b"before")
            relay.cut()
            assert relay.is_cut
            writer.write(b" during")
            far.writers[0].write(b"answer")
            await asyncio.sleep(0.3)
            assert far.arrived == b"before"
            assert far.ends == 0
            assert relay.relayed_bytes == len(b"before")

            relay.heal()
            begin_s = now_s()
            await until(lambda: far.arrived == b"before during")
            assert await reader.readexactly(6) == b"answer"
            assert now_s() - begin_s < 5.0

    play(scenario)


def test_a_connection_closed_during_a_cut_stays_open_at_the_other_side() -> None:
    async def scenario() -> None:
        async with relayed() as (relay, far):
            _, writer = await dial(relay)
            writer.write(b"x")
            await until(lambda: bool(far.arrived))
            relay.cut()
            writer.close()
            await asyncio.sleep(0.3)
            assert far.ends == 0
            relay.heal()
            await until(lambda: far.ends == 1)

    play(scenario)


def test_a_connection_begun_during_a_cut_hangs_and_is_closed_afterwards() -> None:
    async def scenario() -> None:
        async with relayed() as (relay, far):
            relay.cut()
            reader, writer = await dial(relay)
            writer.write(b"hello?")
            await until(lambda: len(relay.connections) == 1)
            await asyncio.sleep(0.2)
            assert not far.writers
            relay.heal()
            assert await reader.read() == b""
            assert not far.writers
            assert not far.arrived
            await dial(relay)
            await until(lambda: len(far.writers) == 1)

    play(scenario)


def test_a_network_diverts_links_and_cuts_those_of_a_group() -> None:
    async def scenario() -> None:
        async with far_end() as far, RelayNetwork(seed=3) as network:
            links = [DialedLink(name, "router 1") for name in ("u1", "u2", "u3")]
            endpoint = f"tcp/127.0.0.1:{far.port}"
            diverted = [await network.through(link, endpoint) for link in links]
            assert len({endpoint, *diverted}) == 4

            network.isolate({"u1", "u2"})
            assert [network.relays[link].is_cut for link in links] == [True, True, False]
            network.heal()
            assert not any(relay.is_cut for relay in network.relays.values())

            bad = RelayQuality(delay_s=0.1)
            network.degrade(bad)
            assert all(relay.quality == bad for relay in network.relays.values())

    play(scenario)


def test_a_group_with_a_router_in_it_keeps_that_router() -> None:
    async def scenario() -> None:
        async with RelayNetwork() as network:
            inside, outside = DialedLink("u1", "router 2"), DialedLink("u1", "router 1")
            between = DialedLink("router 2", "router 1")
            for link in (inside, outside, between):
                await network.through(link, "tcp/127.0.0.1:9")
            network.isolate({"u1", "router 2"})
            cut = {link for link, relay in network.relays.items() if relay.is_cut}
            assert cut == {outside, between}

    play(scenario)


@pytest.mark.parametrize("endpoint", ["tls/127.0.0.1:1", "tcp/192.168.1.1:1", "tcp/127.0.0.1"])
def test_only_loopback_tcp_is_relayed(endpoint: str) -> None:
    async def scenario() -> None:
        async with RelayNetwork() as network:
            with pytest.raises(ValueError, match="only TCP over IPv4's loopback"):
                await network.through(LINK, endpoint)

    play(scenario)
