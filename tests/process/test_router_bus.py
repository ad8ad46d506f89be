"""What a seat on the bus notices when other processes die, hang, or come late."""

from __future__ import annotations

import asyncio
import os
import signal
import sys
from pathlib import Path

import numpy as np
import pytest

from swarm.bus.config import BusConfig, ClientTopology, FileTopology, MeshTopology
from swarm.bus.loopback import free_loopback_endpoints
from swarm.bus.port import LinkDown, LinkUp, Query, TokenGone, TokenSeen
from swarm.bus.zenoh_bus import open_zenoh_bus
from swarm.runtime.errors import BusError, InputError
from tests.contract.bus_fleet import Join, Reader, client_seats, run, settle
from tests.process.router_processes import finish, router, started, token_holder

pytestmark = pytest.mark.process


def endpoint_to_come() -> str:
    return free_loopback_endpoints(1, np.random.default_rng())[0]


@pytest.mark.parametrize("kind", ["client", "mesh"])
def test_killed_token_holder_is_seen(kind: str) -> None:
    async def scenario(config: BusConfig, *holders_endpoints: str) -> None:
        bus = await open_zenoh_bus(config)
        try:
            reader = Reader(bus)
            bus.watch_tokens("alive/*")
            with token_holder(kind, "alive/h", *holders_endpoints) as holder:
                await reader.until_event(TokenSeen("alive/h"))
                holder.kill()
                await reader.until_event(TokenGone("alive/h"))
        finally:
            bus.close()

    if kind == "mesh":
        own, holders = free_loopback_endpoints(2, np.random.default_rng())
        asyncio.run(scenario(BusConfig(MeshTopology(own)), holders, own))
    else:
        with router("--listen", "tcp/127.0.0.1:0") as (_, endpoint):
            asyncio.run(scenario(BusConfig(ClientTopology((endpoint,))), endpoint))


def test_killed_router_takes_the_link_and_a_new_one_brings_it_back() -> None:
    endpoint = endpoint_to_come()

    async def scenario(join: Join) -> None:
        with router("--listen", endpoint) as (process, _):
            a, b = [Reader(await join()) for _ in range(2)]
            for name, reader in (("a", a), ("b", b)):
                reader.bus.watch_tokens("alive/*")
                reader.bus.declare_token(f"alive/{name}")
            for reader, other in ((a, "alive/b"), (b, "alive/a")):
                await reader.until_event(TokenSeen(other))
                reader.events.clear()
            process.kill()
            for reader, other in ((a, "alive/b"), (b, "alive/a")):
                await reader.until_event(TokenGone(other))
                assert reader.events == [LinkDown(), TokenGone(other)]
        with router("--listen", endpoint):
            for reader, other in ((a, "alive/b"), (b, "alive/a")):
                reader.events.clear()
                await reader.until_event(TokenSeen(other))
                assert reader.events == [LinkUp(), TokenSeen(other)]

    run(client_seats(endpoint), scenario)


def test_hung_router_takes_the_link_after_its_lease() -> None:
    async def scenario(join: Join) -> None:
        a, b = [Reader(await join()) for _ in range(2)]
        a.bus.watch_tokens("alive/*")
        b.bus.declare_token("alive/b")
        await a.until_event(TokenSeen("alive/b"))
        a.events.clear()
        process.send_signal(signal.SIGSTOP)
        await a.until_event(TokenGone("alive/b"))
        assert a.events == [LinkDown(), TokenGone("alive/b")]
        process.send_signal(signal.SIGCONT)
        await a.until_event(TokenSeen("alive/b"))
        assert LinkUp() in a.events

    with router("--listen", "tcp/127.0.0.1:0", "--lease-s", "0.5") as (process, endpoint):
        run(client_seats(endpoint), scenario)


def test_client_starts_before_its_router() -> None:
    endpoint = endpoint_to_come()

    async def scenario() -> None:
        opening = asyncio.create_task(
            open_zenoh_bus(BusConfig(ClientTopology((endpoint,))), timeout_s=20.0)
        )
        await asyncio.sleep(0.3)
        assert not opening.done()
        with router("--listen", endpoint):
            bus = await opening
            try:
                await Reader(bus).until_event(LinkUp())
            finally:
                bus.close()

    asyncio.run(scenario())


def test_client_without_any_router_gives_up_in_time() -> None:
    endpoint = endpoint_to_come()

    async def scenario() -> None:
        with pytest.raises(
            BusError, match=r"cannot reach the bus within 0\.5 s: Unable to connect"
        ):
            await open_zenoh_bus(BusConfig(ClientTopology((endpoint,))), timeout_s=0.5)

    asyncio.run(scenario())


def test_taken_endpoint_of_a_peer_is_told_at_once() -> None:
    endpoint = endpoint_to_come()

    async def scenario() -> None:
        bus = await open_zenoh_bus(BusConfig(MeshTopology(endpoint)))
        try:
            with pytest.raises(BusError, match="already in use"):
                await open_zenoh_bus(BusConfig(MeshTopology(endpoint)))
        finally:
            bus.close()

    asyncio.run(scenario())


def test_client_moves_to_the_next_router_when_its_own_dies() -> None:
    async def scenario(join: Join) -> None:
        a = Reader(await join())
        await a.until_event(LinkUp())
        first.kill()
        await a.until_event(LinkUp(), times=2)
        assert a.events == [LinkUp(), LinkDown(), LinkUp()]

    with (
        router("--listen", "tcp/127.0.0.1:0") as (first, one),
        router("--listen", "tcp/127.0.0.1:0") as (_, other),
    ):
        run(client_seats(one, other), scenario)


def test_clients_of_linked_routers_see_each_other() -> None:
    async def scenario(join: Join) -> None:
        a = Reader(await join())
        a.bus.watch_tokens("alive/*")
        with token_holder("client", "alive/far", other):
            await a.until_event(TokenSeen("alive/far"))

    with (
        router("--listen", "tcp/127.0.0.1:0") as (_, one),
        router("--listen", "tcp/127.0.0.1:0", "--connect", one) as (_, other),
    ):
        run(client_seats(one), scenario)


def test_held_query_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("swarm.bus.zenoh_bus.REPLY_WITHIN_S", 0.2)

    async def scenario(join: Join) -> None:
        asker, server = [Reader(await join()) for _ in range(2)]
        server.bus.serve("state/s")
        await settle(asker, server)

        asking = asyncio.create_task(asker.bus.query("state/*", timeout_s=20.0))
        query = await server.next_of(Query)
        async with asyncio.timeout(5.0):
            assert await asking == ()
        query.reply(b"too late")

    with router("--listen", "tcp/127.0.0.1:0") as (_, endpoint):
        run(client_seats(endpoint), scenario)


def test_query_thrown_away_unanswered_keeps_nobody_waiting() -> None:
    async def scenario(join: Join) -> None:
        asker, server = [Reader(await join()) for _ in range(2)]
        server.bus.serve("state/s")
        await settle(asker, server)

        asking = asyncio.create_task(asker.bus.query("state/*", timeout_s=20.0))
        await server.next_of(Query)
        async with asyncio.timeout(5.0):
            assert await asking == ()

    with router("--listen", "tcp/127.0.0.1:0") as (_, endpoint):
        run(client_seats(endpoint), scenario)


CLIENT_FILE = """{
  mode: "client",
  connect: { endpoints: ["ENDPOINT"] },
  scouting: { multicast: { enabled: false } },
}"""


def test_configuration_file_of_the_user_is_followed(tmp_path: Path) -> None:
    file = tmp_path / "client.json5"

    async def scenario() -> None:
        bus = await open_zenoh_bus(BusConfig(FileTopology(file)))
        try:
            await Reader(bus).until_event(LinkUp())
        finally:
            bus.close()

    with router("--listen", "tcp/127.0.0.1:0") as (_, endpoint):
        file.write_text(CLIENT_FILE.replace("ENDPOINT", endpoint))
        asyncio.run(scenario())


def test_missing_configuration_file_is_named(tmp_path: Path) -> None:
    config = BusConfig(FileTopology(tmp_path / "none.json5"))
    with pytest.raises(InputError, match=r"none\.json5: there is no such file"):
        asyncio.run(open_zenoh_bus(config))


DEAD_NETWORK = """
import asyncio, os, signal, sys, threading, time
from swarm.bus import zenoh_session
from swarm.bus.config import BusConfig, ClientTopology
from swarm.bus.zenoh_bus import open_zenoh_bus
from swarm.runtime.process import leave

zenoh_session.BLOCKED_CLOSE_S = 3.0  # longer than a busy machine is ever late
late_s = 0.0

def watch():
    global late_s
    while True:
        due_s = time.monotonic() + 0.005
        time.sleep(0.005)
        late_s += max(0.0, time.monotonic() - due_s)

async def main(endpoint, router_pid):
    loop = asyncio.get_running_loop()
    bus = await open_zenoh_bus(BusConfig(ClientTopology((endpoint,)), lease_s=60.0))
    bus.subscribe("others/**")
    os.kill(router_pid, signal.SIGSTOP)
    slowest_s = 0.0
    for n in range(300):
        before_s = loop.time()
        bus.publish(f"mine/{n}", bytes(200_000))
        await asyncio.sleep(0.005)
        slowest_s = max(slowest_s, loop.time() - before_s)
    threading.Thread(target=watch, daemon=True).start()
    before_s = loop.time()
    answers = await bus.query("state/*", timeout_s=0.3)
    asked_s = loop.time() - before_s
    before_s = loop.time()
    bus.close()
    closed_s = loop.time() - before_s
    print(f"{slowest_s:.3f} {asked_s:.3f} {closed_s:.3f} {late_s:.3f} {len(answers)}", flush=True)

asyncio.run(main(sys.argv[1], int(sys.argv[2])))
leave(7)
"""


def test_dead_network_holds_up_neither_the_loop_nor_closing_nor_the_exit() -> None:
    with router("--listen", "tcp/127.0.0.1:0", "--lease-s", "60") as (process, endpoint):
        try:
            with started("-c", DEAD_NETWORK, endpoint, str(process.pid)) as publisher:
                status, out, err = finish(publisher)
        finally:
            os.kill(process.pid, signal.SIGCONT)

    assert status == 7, err
    slowest_s, asked_s, closed_s, late_s, answers = (float(word) for word in out.split())
    assert slowest_s < 1.5  # a blocked link alone would take 3 s
    assert asked_s < 0.6 + late_s
    assert closed_s < 2.5 + late_s  # the session alone would take 10 s
    assert answers == 0


THREADS = """
import asyncio, os, sys
from pathlib import Path
from swarm.bus.config import BusConfig, ClientTopology
from swarm.bus.zenoh_bus import open_zenoh_bus

async def main(endpoint):
    bus = await open_zenoh_bus(BusConfig(ClientTopology((endpoint,))))
    bus.publish("mine", b"said")
    await bus.query("state/*", timeout_s=5.0)
    bus.close()

asyncio.run(main(sys.argv[1]))
threads = Path("/proc/self/task").glob("*/comm")
names = {path.read_text().partition("-")[0].strip() for path in threads}
print(sorted(names & {"app", "net", "rx", "tx"}), os.environ.get("ZENOH_RUNTIME"))
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="tells no names of threads")
def test_a_client_reads_delivers_and_sends_on_the_same_threads() -> None:
    with (
        router("--listen", "tcp/127.0.0.1:0") as (_, endpoint),
        started("-c", THREADS, endpoint) as client,
    ):
        status, out, err = finish(client)

    assert (status, out) == (0, "['net'] None\n"), err


UNCLOSED = """
import asyncio, sys
from swarm.bus.config import BusConfig, ClientTopology
from swarm.bus.zenoh_bus import open_zenoh_bus

async def main(endpoint):
    bus = await open_zenoh_bus(BusConfig(ClientTopology((endpoint,))))
    bus.subscribe("others/**")
    bus.watch_tokens("alive/*")
    bus.serve("state/me")
    bus.declare_token("alive/me")
    raise RuntimeError("forgot to close")

asyncio.run(main(sys.argv[1]))
"""


def test_process_that_never_closes_its_bus_still_ends() -> None:
    with (
        router("--listen", "tcp/127.0.0.1:0") as (_, endpoint),
        started("-c", UNCLOSED, endpoint) as process,
    ):
        status, _, err = finish(process)
    assert status == 1
    assert err.endswith("RuntimeError: forgot to close\n")
