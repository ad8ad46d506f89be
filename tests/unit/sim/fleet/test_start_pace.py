"""Agents are started no faster than they join."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence

import pytest

from sim.fleet.child_process import ChildFailedError
from sim.fleet.start_pace import StartPace


class FakeChild:
    """Says lines when it is told to, or ends."""

    def __init__(self) -> None:
        self.said = asyncio.Event()
        self.ends = False
        self.asked = 0

    async def ready(self, count: int = 1) -> Sequence[object]:
        self.asked = count
        await self.said.wait()
        if self.ends:
            raise ChildFailedError("it ended")
        return [{}] * count


async def settle() -> None:
    for _ in range(10):
        await asyncio.sleep(0)


async def has_room(pace: StartPace) -> bool:
    """Whether one more may start now."""
    waiting = asyncio.create_task(pace.room())
    await settle()
    if waiting.done():
        return True
    waiting.cancel()
    return False


@pytest.mark.parametrize("ends", [False, True])
def test_the_next_starts_when_one_has_joined_or_ended(ends: bool) -> None:
    async def scenario() -> None:
        pace = StartPace(2, patience_s=1000.0)
        children = [FakeChild(), FakeChild()]
        for child in children:
            child.ends = ends
            assert await has_room(pace)
            pace.started(child, 3)
        assert not await has_room(pace)
        assert [child.asked for child in children] == [3, 3]

        children[1].said.set()
        await settle()
        assert await has_room(pace)
        assert not await has_room(pace)
        pace.close()

    asyncio.run(scenario())


def test_one_that_never_joins_holds_up_nobody_for_ever() -> None:
    async def scenario() -> None:
        pace = StartPace(1, patience_s=0.0)
        await pace.room()
        pace.started(FakeChild())

        await pace.room()

    asyncio.run(scenario())


def test_after_the_end_nobody_is_waited_for() -> None:
    async def scenario() -> None:
        pace = StartPace(1, patience_s=1000.0)
        await pace.room()
        pace.started(FakeChild())
        await settle()
        pace.close()
        await settle()
        assert asyncio.all_tasks() == {asyncio.current_task()}

    asyncio.run(scenario())
