"""What every bus does, whatever carries it."""

from __future__ import annotations

import asyncio
import json
import subprocess
import sys
import threading
from collections.abc import Iterator

import pytest

from swarm.bus.port import MAX_PAYLOAD_BYTES, Answer, LinkUp, Query, Sample, TokenGone, TokenSeen
from swarm.runtime.errors import BusError
from tests.contract.bus_fleet import (
    LIMIT_S,
    Join,
    Reader,
    Seats,
    client_seats,
    memory_seats,
    mesh_seats,
    run,
    settle,
    shared_seats,
)

SWARM = "import sys; from swarm.cli import console_main; sys.exit(console_main())"


@pytest.fixture(scope="module")
def router_endpoint() -> Iterator[str]:
    """A router process for the tests of this module."""
    process = subprocess.Popen(
        [sys.executable, "-c", SWARM, "router", "--listen", "tcp/127.0.0.1:0", "--lifeline"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    with process:
        assert process.stdout is not None
        yield json.loads(process.stdout.readline())["endpoints"][0]
        process.terminate()


@pytest.fixture(params=["memory", "mesh", "clients", "shared"])
def seats(request: pytest.FixtureRequest) -> Seats:
    if request.param == "memory":
        return memory_seats()
    if request.param == "mesh":
        return mesh_seats()
    made = client_seats if request.param == "clients" else shared_seats
    return made(request.getfixturevalue("router_endpoint"))


def test_a_sample_tells_when_it_came(seats: Seats) -> None:
    async def scenario(join: Join) -> None:
        a, b, c = [Reader(await join()) for _ in range(3)]
        for reader in (a, b):
            reader.bus.subscribe("plan")
        await settle(a, b, c)

        loop = asyncio.get_running_loop()
        begin_s = loop.time()
        c.bus.publish("plan", b"runs")
        for reader in (a, b):
            sample = await reader.next_of(Sample)
            assert sample.arrived_s is not None
            assert begin_s <= sample.arrived_s <= loop.time()

    run(seats, scenario)


def test_samples_reach_all_others_and_not_the_publisher(seats: Seats) -> None:
    async def scenario(join: Join) -> None:
        a, b, c = [Reader(await join()) for _ in range(3)]
        for reader in (a, b, c):
            reader.bus.subscribe("news/*")
        await settle(a, b, c)

        a.bus.publish("news/a", b"from a")
        await b.until_event(Sample("news/a", b"from a"))
        await c.until_event(Sample("news/a", b"from a"))
        b.bus.publish("news/b", b"from b")
        await a.until_event(Sample("news/b", b"from b"))

        assert a.events == [Sample("news/b", b"from b")]

    run(seats, scenario)


def test_only_what_matches_is_delivered(seats: Seats) -> None:
    async def scenario(join: Join) -> None:
        a, one, many = [Reader(await join()) for _ in range(3)]
        one.bus.subscribe("m/*/claim")
        many.bus.subscribe("m/uav/**")
        await settle(a, one, many)
        keys = ["m/claim", "m/x/claim", "m/x/y/claim", "m/uav", "m/uav/1/claim", "m/uav/@v", "end"]
        for reader in (one, many):
            reader.bus.subscribe("end")
        await settle(a, one, many)

        for key in keys:
            a.bus.publish(key, b"")
        for reader in (one, many):
            await reader.until_event(Sample("end", b""))

        assert [sample.key for sample in one.of(Sample)] == ["m/x/claim", "end"]
        assert [sample.key for sample in many.of(Sample)] == ["m/uav", "m/uav/1/claim", "end"]

    run(seats, scenario)


def test_who_has_unsubscribed_hears_nothing_more(seats: Seats) -> None:
    async def scenario(join: Join) -> None:
        a, reader = [Reader(await join()) for _ in range(2)]
        for key_expr in ("m/*/near/1/2", "m/*/near/1/3", "end"):
            reader.bus.subscribe(key_expr)
        await settle(a, reader)
        reader.bus.unsubscribe("m/*/near/1/2")
        reader.bus.unsubscribe("m/nobody/subscribed")
        await settle(a, reader)

        for key in ("m/u1/near/1/2", "m/u1/near/1/3", "end"):
            a.bus.publish(key, b"")
        await reader.until_event(Sample("end", b""))
        assert [sample.key for sample in reader.of(Sample)] == ["m/u1/near/1/3", "end"]

        reader.bus.subscribe("m/*/near/1/2")
        await settle(a, reader)
        a.bus.publish("m/u1/near/1/2", b"again")
        await reader.until_event(Sample("m/u1/near/1/2", b"again"))

    run(seats, scenario)


def test_what_is_gathered_wakes_nobody_until_it_is_asked_for(seats: Seats) -> None:
    async def scenario(join: Join) -> None:
        a, b = [Reader(await join()) for _ in range(2)]
        key = "m/uav/u1/claim"
        for key_expr in ("m/uav/*/claim", "end"):
            b.bus.subscribe(key_expr, latest=True)
        await settle(a, b)
        a.bus.publish(key, b"told")
        await b.until_event(Sample(key, b"told"))

        b.bus.subscribe("m/uav/*/claim", latest=True, gathered=True)
        await settle(a, b)
        for payload in (b"old", b"new"):
            a.bus.publish(key, payload)
        a.bus.publish("end", b"1")
        await b.until_event(Sample("end", b"1"))
        assert b.payloads(key) == [b"told"]
        b.bus.gather()
        await b.until_event(Sample(key, b"new"))
        assert b.payloads(key) == [b"told", b"new"]

        b.bus.subscribe("m/uav/*/claim")
        await settle(a, b)
        a.bus.publish(key, b"told again")
        await b.until_event(Sample(key, b"told again"))
        b.bus.unsubscribe("m/uav/*/claim")
        await settle(a, b)
        a.bus.publish(key, b"unheard")
        a.bus.publish("end", b"2")
        await b.until_event(Sample("end", b"2"))
        b.bus.gather()
        assert b.payloads(key) == [b"told", b"new", b"told again"]

    run(seats, scenario)


def test_one_publishers_samples_keep_their_order(seats: Seats) -> None:
    async def scenario(join: Join) -> None:
        a, b = [Reader(await join()) for _ in range(2)]
        b.bus.subscribe("count/**")
        await settle(a, b)
        sent = [str(n).encode() for n in range(1000)]

        for n, payload in enumerate(sent):
            a.bus.publish(f"count/{n % 7}", payload)
        await b.until(lambda: len(b.events) == len(sent))

        assert [sample.payload for sample in b.of(Sample)] == sent

    run(seats, scenario)


def test_unreliable_samples_arrive_when_there_is_no_load(seats: Seats) -> None:
    async def scenario(join: Join) -> None:
        a, b = [Reader(await join()) for _ in range(2)]
        b.bus.subscribe("status")
        await settle(a, b)

        a.bus.publish("status", b"fine", reliable=False)
        await b.until_event(Sample("status", b"fine"))

    run(seats, scenario)


@pytest.mark.parametrize("size_bytes", [0, 1 << 20, MAX_PAYLOAD_BYTES])
def test_payloads_up_to_the_limit_arrive_whole(seats: Seats, size_bytes: int) -> None:
    async def scenario(join: Join) -> None:
        a, b = [Reader(await join()) for _ in range(2)]
        b.bus.subscribe("board")
        b.bus.serve("board/kept")
        await settle(a, b)
        payload = bytes(n % 251 for n in range(1000)) * (size_bytes // 1000)
        payload = payload.ljust(size_bytes, b"x")

        a.bus.publish("board", payload)
        assert (await b.next_of(Sample)).payload == payload

        asking = asyncio.create_task(a.bus.query("board/*", timeout_s=LIMIT_S))
        (await b.next_of(Query)).reply(payload)
        assert await asking == (Answer("board/kept", payload, 0.0),)

    run(seats, scenario)


def test_payload_beyond_the_limit_is_refused(seats: Seats) -> None:
    async def scenario(join: Join) -> None:
        bus = await join()
        with pytest.raises(ValueError, match="bytes are more than"):
            bus.publish("board", bytes(MAX_PAYLOAD_BYTES + 1))
        with pytest.raises(ValueError, match="bytes are more than"):
            await bus.query("board", bytes(MAX_PAYLOAD_BYTES + 1), timeout_s=LIMIT_S)

    run(seats, scenario)


def test_latest_keeps_the_newest_of_each_key(seats: Seats) -> None:
    async def scenario(join: Join) -> None:
        a, b = [Reader(await join()) for _ in range(2)]
        b.bus.subscribe("status/*", latest=True)
        await settle(a, b)

        for n in range(200):
            a.bus.publish(f"status/{n % 2}", n.to_bytes(2, "big"))
        await b.until_event(Sample("status/0", (198).to_bytes(2, "big")))
        await b.until_event(Sample("status/1", (199).to_bytes(2, "big")))

        for key in ("status/0", "status/1"):
            seen = b.payloads(key)
            assert seen == sorted(set(seen))
        assert b.bus.inbox.dropped == 0

    run(seats, scenario)


def test_what_a_slow_reader_loses_is_counted(seats: Seats) -> None:
    async def scenario(join: Join) -> None:
        a = Reader(await join())
        b = Reader(await join(inbox_capacity=4))
        b.bus.subscribe("flood")
        await settle(a, b)

        for n in range(500):
            a.bus.publish("flood", str(n).encode())
        await b.until(lambda: b"499" in b.payloads("flood"))

        assert len(b.events) + b.bus.inbox.dropped == 500

    run(seats, scenario)


def test_tokens_are_seen_by_early_and_late_watchers(seats: Seats) -> None:
    async def scenario(join: Join) -> None:
        early, holder = [Reader(await join()) for _ in range(2)]
        early.bus.watch_tokens("alive/*")
        holder.bus.watch_tokens("alive/*")
        await settle(early, holder)
        holder.bus.declare_token("alive/h")
        holder.bus.declare_token("elsewhere/h")
        holder.bus.declare_token("alive/i")
        await early.until_event(TokenSeen("alive/i"))
        late = Reader(await join())
        late.bus.watch_tokens("alive/*")
        await late.until_event(TokenSeen("alive/h"))
        await late.until_event(TokenSeen("alive/i"))

        assert early.of(TokenSeen) == [TokenSeen("alive/h"), TokenSeen("alive/i")]
        assert len(late.of(TokenSeen)) == 2
        await settle(early, holder, late)
        assert holder.events == []

    run(seats, scenario)


def test_token_is_gone_when_its_holder_closes(seats: Seats) -> None:
    async def scenario(join: Join) -> None:
        a, b, c = [Reader(await join()) for _ in range(3)]
        for reader in (a, c):
            reader.bus.watch_tokens("alive/*")
        b.bus.declare_token("alive/b")
        for reader in (a, c):
            await reader.until_event(TokenSeen("alive/b"))

        b.bus.close()
        for reader in (a, c):
            await reader.until_event(TokenGone("alive/b"))
        c.bus.declare_token("alive/c")
        await a.until_event(TokenSeen("alive/c"))
        of_b = [
            event for event in a.events if event in (TokenSeen("alive/b"), TokenGone("alive/b"))
        ]
        assert of_b == [TokenSeen("alive/b"), TokenGone("alive/b")]
        assert c.of(TokenGone) == [TokenGone("alive/b")]

    run(seats, scenario)


def test_token_held_by_two_is_gone_when_both_are(seats: Seats) -> None:
    async def scenario(join: Join) -> None:
        a, b, c = [Reader(await join()) for _ in range(3)]
        a.bus.watch_tokens("alive/*")
        for name, reader in (("b", b), ("c", c)):
            reader.bus.declare_token("alive/twin")
            reader.bus.declare_token(f"alive/{name}")
        await settle(a, b, c)

        b.bus.close()
        await a.until_event(TokenGone("alive/b"))
        await settle(a, c)
        assert TokenGone("alive/twin") not in a.events
        c.bus.close()
        await a.until_event(TokenGone("alive/twin"))

    run(seats, scenario)


def test_first_link_is_told(seats: Seats) -> None:
    async def scenario(join: Join) -> None:
        a, b = [Reader(await join()) for _ in range(2)]
        for reader in (a, b):
            await reader.until_event(LinkUp())

    run(seats, scenario)


def test_query_gets_the_answers_of_all_who_serve(seats: Seats) -> None:
    async def scenario(join: Join) -> None:
        asker, b, c = [Reader(await join()) for _ in range(3)]
        for name, reader in (("asker", asker), ("b", b), ("c", c)):
            reader.bus.serve(f"state/{name}")
        await settle(asker, b, c)

        asking = asyncio.create_task(asker.bus.query("state/*", timeout_s=LIMIT_S))
        for reader in (b, c):
            query = await reader.next_of(Query)
            query.reply(b"of " + query.key.encode())
            query.reply(b"once more")
        answers = await asking

        assert sorted(answers, key=lambda answer: answer.key) == [
            Answer("state/b", b"of state/b", 0.0),
            Answer("state/c", b"of state/c", 0.0),
        ]
        assert asker.bus.inbox.take() == []

    run(seats, scenario)


def test_query_carries_a_payload(seats: Seats) -> None:
    async def scenario(join: Join) -> None:
        asker, server = [Reader(await join()) for _ in range(2)]
        server.bus.serve("state/server")
        await settle(asker, server)

        for payload in (b"", b"tell"):
            asking = asyncio.create_task(
                asker.bus.query("state/server", payload, timeout_s=LIMIT_S)
            )
            query = await server.next_of(Query)
            assert query.payload == payload
            query.reply(b"told")
            await asking

    run(seats, scenario)


def test_reply_may_come_from_any_thread(seats: Seats) -> None:
    async def scenario(join: Join) -> None:
        asker, server = [Reader(await join()) for _ in range(2)]
        server.bus.serve("state/server")
        await settle(asker, server)

        asking = asyncio.create_task(asker.bus.query("state/server", timeout_s=LIMIT_S))
        query = await server.next_of(Query)
        thread = threading.Thread(target=query.reply, args=(b"from a thread",))
        thread.start()
        assert await asking == (Answer("state/server", b"from a thread", 0.0),)
        thread.join()

    run(seats, scenario)


def test_query_nobody_serves_ends_without_answers(seats: Seats) -> None:
    async def scenario(join: Join) -> None:
        a, b = [Reader(await join()) for _ in range(2)]
        await settle(a, b)
        async with asyncio.timeout(LIMIT_S / 2):
            assert await a.bus.query("nothing/**", timeout_s=LIMIT_S) == ()

    run(seats, scenario)


def test_answers_in_time_are_kept_when_others_are_late(seats: Seats) -> None:
    async def scenario(join: Join) -> None:
        asker, prompt, late, silent = [Reader(await join()) for _ in range(4)]
        for name, reader in (("prompt", prompt), ("late", late), ("silent", silent)):
            reader.bus.serve(f"state/{name}")
        await settle(asker, prompt, late, silent)

        begin_s = asyncio.get_running_loop().time()
        asking = asyncio.create_task(asker.bus.query("state/*", timeout_s=0.3))
        (await prompt.next_of(Query)).reply(b"here")
        too_late = await late.next_of(Query)
        answers = await asking
        took_s = asyncio.get_running_loop().time() - begin_s
        too_late.reply(b"sorry")

        assert answers == (Answer("state/prompt", b"here", 0.0),)
        assert 0.25 < took_s < 2.0
        assert 0.0 < answers[0].arrived_s - begin_s < took_s - 0.02, "it waited for the late"
        asking = asyncio.create_task(asker.bus.query("state/prompt", timeout_s=LIMIT_S))
        (await prompt.next_of(Query)).reply(b"again")
        assert await asking == (Answer("state/prompt", b"again", 0.0),)

    run(seats, scenario)


def test_query_ends_when_the_only_server_leaves(seats: Seats) -> None:
    async def scenario(join: Join) -> None:
        asker, server = [Reader(await join()) for _ in range(2)]
        server.bus.serve("state/server")
        await settle(asker, server)

        asking = asyncio.create_task(asker.bus.query("state/server", timeout_s=LIMIT_S))
        await server.next_of(Query)
        server.bus.close()
        async with asyncio.timeout(LIMIT_S / 2):
            assert await asking == ()

    run(seats, scenario)


def test_what_was_published_before_closing_arrives(seats: Seats) -> None:
    async def scenario(join: Join) -> None:
        a, b = [Reader(await join()) for _ in range(2)]
        b.bus.subscribe("last/*")
        await settle(a, b)

        for n in range(100):
            a.bus.publish(f"last/{n}", b"word")
        a.bus.close()
        await b.until_event(Sample("last/99", b"word"))
        assert len(b.of(Sample)) == 100

    run(seats, scenario)


def test_closed_bus_refuses_everything_but_closing(seats: Seats) -> None:
    async def scenario(join: Join) -> None:
        bus = await join()
        bus.close()
        bus.close()

        for use in (bus.subscribe, bus.declare_token, bus.watch_tokens, bus.serve):
            with pytest.raises(BusError, match="closed"):
                use("a/b")
        with pytest.raises(BusError, match="closed"):
            bus.publish("a/b", b"")
        with pytest.raises(BusError, match="closed"):
            await bus.query("a/b", timeout_s=1.0)

    run(seats, scenario)


@pytest.mark.parametrize("bad", ["", "/a", "a/", "a//b", "a?", "a#b", "a$*", "**/**"])
def test_what_is_no_key_is_refused(seats: Seats, bad: str) -> None:
    async def scenario(join: Join) -> None:
        bus = await join()
        for use in (bus.subscribe, bus.declare_token, bus.watch_tokens, bus.serve):
            with pytest.raises(ValueError, match="not a key"):
                use(bad)
        with pytest.raises(ValueError, match="not a key"):
            bus.publish(bad, b"")
        with pytest.raises(ValueError, match="not a key"):
            await bus.query(bad, timeout_s=1.0)

    run(seats, scenario)


def test_wildcards_are_for_readers(seats: Seats) -> None:
    async def scenario(join: Join) -> None:
        bus = await join()
        for use in (bus.declare_token, bus.serve):
            with pytest.raises(ValueError, match="names one thing"):
                use("a/*")
        with pytest.raises(ValueError, match="names one thing"):
            bus.publish("a/**", b"")

    run(seats, scenario)
