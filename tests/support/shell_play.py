"""Small cores, vehicles and a clock of one's own, to play shells on a network in memory."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Sequence
from typing import TypeVar

from swarm.bus.port import BusEvent
from tests.support.memory_bus import MemoryBus

LIMIT_S = 5.0
"""Longest wait for anything that must happen."""

T = TypeVar("T")


class HandClock:
    """A clock that stands still until it is moved; its delays take no wall time."""

    def __init__(self, now_s: float = 0.0) -> None:
        self.time_s = now_s

    def now_s(self) -> float:
        return self.time_s

    def wall_delay_s(self, delay_s: float) -> float:
        """No wall time for what is due, and for ever for what is not."""
        return 0.0 if delay_s <= 0.0 else 10.0 * LIMIT_S


def play(scenario: Callable[[], Awaitable[T]]) -> T:
    """Run ``scenario`` in a loop of its own and see that it leaves no task behind."""

    async def watched() -> T:
        async with asyncio.timeout(2.0 * LIMIT_S):
            result = await scenario()
        left = asyncio.all_tasks() - {asyncio.current_task()}
        assert not left, f"still running: {left}"
        return result

    return asyncio.run(watched())


async def until(condition: Callable[[], bool], what: str) -> None:
    """Give way to the loop until ``condition`` holds; fail with ``what`` if it never does."""
    try:
        async with asyncio.timeout(LIMIT_S):
            while not condition():  # noqa: ASYNC110 - any condition, of anybody
                await asyncio.sleep(0)
    except TimeoutError:
        raise AssertionError(f"{what} did not happen within {LIMIT_S} s") from None


async def take_until(bus: MemoryBus, condition: Callable[[Sequence[BusEvent]], bool]) -> None:
    """Read the inbox of ``bus`` until what has come satisfies ``condition``."""
    seen: list[BusEvent] = []
    async with asyncio.timeout(LIMIT_S):
        while not condition(seen):
            await bus.inbox.wait()
            seen += bus.inbox.take()
