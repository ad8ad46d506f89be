"""How long a claim takes from one process to another through a router, with keys and without.

A router runs as a process of its own; both ends sit in this one, each in a shell as agents have
it. What is timed is what agents do: a message is made into bytes, signed if there are keys,
carried over the router, checked and made into a message again. Leaves out: what an agent then
makes of it, and a machine that is busy.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Sequence

import numpy as np

from sim.launch.fleet import LaunchOptions, Layout
from sim.launch.process import Child
from swarm.bus.zenoh_bus import open_zenoh_bus
from swarm.clock import Clock, SystemClock
from swarm.events import BusFact, Heard, Publish, Wish
from swarm.model import Mission
from swarm.shell import Shell
from swarm.wire.keys import Keys
from swarm.wire.messages import Claim, ClaimPhase, Message, Stamp

__all__ = ["SPEAKER", "measure_hops"]

SPEAKER = "speaker"
"""Who says the claims; with keys they have to be those of a UAV of that name."""
_HEARER = "hearer"
_RATE_HZ = 20.0
"""Claims a second: in between, processors that have nothing else to do have gone to sleep."""
_WARM = 20
"""Claims before those that are timed."""
_LATE_S = 0.5
"""What has not come by then counts as lost."""


async def measure_hops(mission: Mission, options: LaunchOptions, claims: int) -> tuple[float, ...]:
    """Wall times that so many claims took [s]; of one that was lost, none.

    Args:
        mission: whose bus it is; nobody flies it.
        options: of a bus with a router.
        claims: how many are timed.

    Raises:
        ChildFailedError: the router did not start.
    """
    layout = Layout(options, mission, np.random.default_rng())
    (name, *_) = layout.routers
    router = Child(name, layout.router(name))
    clock = SystemClock()
    said, heard = _Speaker(mission.name, clock), _Hearer(clock)
    await router.start()
    try:
        await router.ready()
        async with (
            _seated(said, layout, mission, SPEAKER, clock) as speaking,
            _seated(heard, layout, mission, _HEARER, clock),
        ):
            for _ in range(_WARM + claims):
                await asyncio.sleep(1.0 / _RATE_HZ)
                speaking.step(Heard(said.claim()))
            await asyncio.sleep(_LATE_S)
    finally:
        await router.stop()
    timed = [number for number in heard.at_s if number > _WARM]
    return tuple(heard.at_s[number] - said.at_s[number] for number in timed)


class _Silent:
    """What both cores have in common: they want nothing of their own accord."""

    def start(self, now_s: float) -> Sequence[Wish]:
        del now_s
        return []

    def next_deadline_s(self) -> float | None:
        return None


class _Speaker(_Silent):
    """Says what it is told as its own, and notes when."""

    def __init__(self, mission: str, clock: Clock) -> None:
        self.at_s: dict[int, float] = {}
        self._mission = mission
        self._clock = clock

    def claim(self) -> Message:
        """The next one to say."""
        stamp = Stamp(1, len(self.at_s) + 1)
        body = Claim(ClaimPhase.HELD, "t1", 1.0, 0, 2.0)
        return Message(self._mission, SPEAKER, stamp, body)

    def step(self, event: BusFact, now_s: float) -> Sequence[Wish]:
        del now_s
        if isinstance(event, Heard) and isinstance(event.message.body, Claim):
            self.at_s[event.message.stamp.counter] = self._clock.now_s()
            return [Publish(event.message)]
        return []


class _Hearer(_Silent):
    """Notes when it hears each claim."""

    def __init__(self, clock: Clock) -> None:
        self.at_s: dict[int, float] = {}
        self._clock = clock

    def step(self, event: BusFact, now_s: float) -> Sequence[Wish]:
        del now_s
        if isinstance(event, Heard) and isinstance(event.message.body, Claim):
            self.at_s.setdefault(event.message.stamp.counter, self._clock.now_s())
        return []


@contextlib.asynccontextmanager
async def _seated(
    core: _Speaker | _Hearer, layout: Layout, mission: Mission, name: str, clock: Clock
) -> AsyncIterator[Shell[BusFact, Wish]]:
    """A shell around ``core`` on the bus, for as long as the context lasts."""
    bus = await open_zenoh_bus(layout.seat_of_onlooker(name))
    try:
        if name != SPEAKER:
            bus.subscribe(Keys(mission.name).claim("*"))
        shell: Shell[BusFact, Wish] = Shell(
            core,
            bus,
            clock,
            mission=mission.name,
            name=name,
            from_bus=lambda fact: fact,
            execute=lambda _: None,
            snapshot=None,
        )
        running = asyncio.get_running_loop().create_task(shell.run())
        try:
            yield shell
        finally:
            running.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await running
    finally:
        bus.close()
