"""The inbox loses nothing unnoticed, whatever thread offers."""

from __future__ import annotations

import asyncio
import threading

import pytest

from swarm.bus.port import BusEvent, Inbox, LinkDown, Query, Sample, TokenGone


def sample(n: int, key: str = "k") -> Sample:
    return Sample(key, str(n).encode())


def test_gives_what_arrived_oldest_first_and_latest_last() -> None:
    async def scenario() -> None:
        inbox = Inbox(asyncio.get_running_loop())
        inbox.offer(sample(1, "status"), latest=True)
        inbox.offer(sample(2))
        inbox.offer(LinkDown())
        inbox.offer(sample(3, "status"), latest=True)

        await inbox.wait()
        assert inbox.take() == [sample(2), LinkDown(), sample(3, "status")]
        assert inbox.take() == []
        assert inbox.dropped == 0

    asyncio.run(scenario())


def test_full_inbox_drops_the_oldest_sample_or_query_and_keeps_tokens_and_links() -> None:
    async def scenario() -> None:
        inbox = Inbox(asyncio.get_running_loop(), capacity=3)
        for event in (TokenGone("t"), sample(1), Query("q", lambda _: None), LinkDown(), sample(2)):
            inbox.offer(event)

        assert inbox.take() == [TokenGone("t"), LinkDown(), sample(2)]
        assert inbox.dropped == 2

    asyncio.run(scenario())


def test_inbox_full_of_tokens_drops_the_oldest() -> None:
    async def scenario() -> None:
        inbox = Inbox(asyncio.get_running_loop(), capacity=2)
        for key in "abc":
            inbox.offer(TokenGone(key))

        assert inbox.take() == [TokenGone("b"), TokenGone("c")]
        assert inbox.dropped == 1

    asyncio.run(scenario())


def test_latest_lane_is_bounded_too() -> None:
    async def scenario() -> None:
        inbox = Inbox(asyncio.get_running_loop(), capacity=2)
        for key in "abca":
            inbox.offer(sample(0, key), latest=True)

        assert [event.key for event in inbox.take() if isinstance(event, Sample)] == ["c", "a"]
        assert inbox.dropped == 2

    asyncio.run(scenario())


def test_many_threads_lose_nothing_and_keep_their_order() -> None:
    async def scenario() -> None:
        inbox = Inbox(asyncio.get_running_loop(), capacity=100_000)

        def offer(name: str) -> None:
            for n in range(2000):
                inbox.offer_threadsafe(sample(n, name))

        threads = [threading.Thread(target=offer, args=(name,)) for name in "abc"]
        for thread in threads:
            thread.start()
        seen: dict[str, list[bytes]] = {name: [] for name in "abc"}
        async with asyncio.timeout(20.0):
            while sum(map(len, seen.values())) < 6000:
                await inbox.wait()
                for event in inbox.take():
                    assert isinstance(event, Sample)
                    seen[event.key].append(event.payload)
        for thread in threads:
            thread.join()

        assert all(payloads == [b"%d" % n for n in range(2000)] for payloads in seen.values())

    asyncio.run(scenario())


def test_bound_holds_while_the_loop_is_busy() -> None:
    async def scenario() -> None:
        inbox = Inbox(asyncio.get_running_loop(), capacity=10)

        def offer() -> None:
            for n in range(1000):
                inbox.offer_threadsafe(sample(n))

        thread = threading.Thread(target=offer)
        thread.start()
        thread.join()  # without giving the loop a turn

        assert inbox.dropped == 990
        await inbox.wait()
        assert inbox.take() == [sample(n) for n in range(990, 1000)]

    asyncio.run(scenario())


def test_ended_loop_takes_nothing_and_does_not_raise() -> None:
    async def scenario() -> Inbox:
        return Inbox(asyncio.get_running_loop())

    inbox = asyncio.run(scenario())
    inbox.offer_threadsafe(sample(1))
    inbox.offer_threadsafe(sample(2))

    assert inbox.dropped == 2


def test_capacity_below_one_is_refused() -> None:
    async def scenario() -> None:
        with pytest.raises(ValueError, match="capacity must be >= 1"):
            Inbox(asyncio.get_running_loop(), capacity=0)

    asyncio.run(scenario())


def test_who_hears_very_many_is_woken_once_for_those_that_come_together() -> None:
    async def scenario() -> list[BusEvent]:
        inbox = Inbox(asyncio.get_running_loop())
        inbox.linger_s = 0.001
        waiting = asyncio.create_task(inbox.wait())
        for n in range(5):
            inbox.offer(Sample(f"k/{n}", b""))
            await asyncio.sleep(0)
            assert not waiting.done()
        await waiting
        return inbox.take()

    assert [event.key for event in asyncio.run(scenario()) if isinstance(event, Sample)] == [
        f"k/{n}" for n in range(5)
    ]
