"""When UAVs of a whole fleet could not hear each other, as seen by who knows all.

What was said before, or after, those that are told about here may know all the same.
"""

from __future__ import annotations

from itertools import combinations

from sim.world.rough_network import RoughNetwork
from sim.world.virtual_world import World

LOOK_EVERY_S = 0.5
"""How often it is looked who can hear whom."""


class OutOfHearing:
    """The times at which two UAVs had no link to each other.

    Args:
        world: in which they fly.
        network: tells who can talk to whom.
        settles_s: as long after that it takes until both know all again [s].
    """

    def __init__(self, world: World, network: RoughNetwork, settles_s: float) -> None:
        self._world, self._network, self._settles_s = world, network, settles_s
        self._apart_s: dict[frozenset[str], list[tuple[float, float]]] = {}
        """By pair: from when until when, one after the other [s]."""

    def look(self) -> None:
        """Find out who can't hear whom now; to be asked every `LOOK_EVERY_S`."""
        now_s, processes = self._world.queue.now_s(), self._world.processes
        for one, other in combinations(self._world.agents, 2):
            if self._network.joined(processes[one], processes[other]):
                continue
            spans = self._apart_s.setdefault(frozenset((one, other)), [])
            goes_on = spans and now_s - spans[-1][1] < 1.5 * LOOK_EVERY_S
            since_s = spans.pop()[0] if goes_on else now_s
            spans.append((since_s, now_s))

    def all_along(self, one: str, other: str, since_s: float, until_s: float) -> bool:
        """Whether nothing that one of them said from then until then can be known to the other."""
        return any(
            begin_s <= since_s + LOOK_EVERY_S and until_s <= end_s + LOOK_EVERY_S + self._settles_s
            for begin_s, end_s in self._apart_s.get(frozenset((one, other)), ())
        )
