"""A relay on every link of a run, so that links and whole groups can be degraded and cut.

Leaves out: one relay (sim.chaos.relay), processes (sim.launch).
"""

from __future__ import annotations

import asyncio
import re
from collections.abc import Collection, Iterable
from typing import Self

import numpy as np

from sim.chaos.relay import Quality, Relay
from sim.launch.fleet import DialedLink

__all__ = ["RelayNetwork"]

ENDPOINT = re.compile(r"tcp/(127\.0\.0\.1):(\d+)")


class RelayNetwork:
    """The relays of one run.

    Give `through` to `sim.launch.run.open_run`::

        async with RelayNetwork(seed=1) as network, open_run(…, through=network.through) as run:
            network.degrade(Quality(delay_s=0.03, loss_frac=0.05))
            network.isolate({"uav01", "uav02"})
            network.heal()

    Args:
        seed: of all jitter and losses.
    """

    def __init__(self, *, seed: int = 0) -> None:
        self._sequence = np.random.SeedSequence(seed)
        self._quality = Quality()
        self.relays: dict[DialedLink, Relay] = {}

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *_: object) -> None:
        await asyncio.gather(*(relay.close() for relay in self.relays.values()))

    async def through(self, link: DialedLink, endpoint: str) -> str:
        """Put a relay on ``link``, which is accepted at ``endpoint``; where to dial it now."""
        match = ENDPOINT.fullmatch(endpoint)
        if match is None:
            raise ValueError(f"only TCP over IPv4's loopback is relayed, not {endpoint}")
        (seed,) = self._sequence.spawn(1)
        relay = Relay(match[1], int(match[2]), np.random.default_rng(seed))
        relay.quality = self._quality
        await relay.start()
        self.relays[link] = relay
        return f"tcp/127.0.0.1:{relay.port}"

    def degrade(self, quality: Quality, links: Iterable[DialedLink] | None = None) -> None:
        """Make all links, or these, as good as ``quality`` says."""
        if links is None:
            self._quality = quality
        for link in self.relays if links is None else links:
            self.relays[link].quality = quality

    def links_of(self, name: str) -> list[DialedLink]:
        """Links at one of whose ends that process is."""
        return [link for link in self.relays if name in (link.dialer, link.listener)]

    def links_between(self, group: Collection[str]) -> list[DialedLink]:
        """Links of which one end is in ``group`` and the other is not."""
        return [link for link in self.relays if (link.dialer in group) != (link.listener in group)]

    def cut(self, links: Iterable[DialedLink]) -> None:
        """Let nothing pass on these."""
        for link in links:
            self.relays[link].cut()

    def isolate(self, group: Collection[str]) -> None:
        """Cut ``group`` off from all others.

        Of clients, each is alone then, unless a router they can reach is in the group too.
        """
        self.cut(self.links_between(group))

    def heal(self) -> None:
        """End all cuts."""
        for relay in self.relays.values():
            relay.heal()
