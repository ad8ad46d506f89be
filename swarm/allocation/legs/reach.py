"""From any place to each of some targets: the shortest way over arcs and tangents.

A Bellman-Ford iteration over the tangents, for all targets at once: the graph has a few hundred
edges and paths have few, so that a dozen rounds over arrays do. A way round an arc costs its
radius times the progress made, as a difference of two potentials, so that whoever arrives takes the
least of what may still be left: a minimum over the end of a list. Leaves out: places that see each
other (swarm.allocation.legs.planner).

Source: tangent visibility graph, e.g. Pocchiola & Vegter, "The visibility complex",
https://doi.org/10.1142/S0218195996000204.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from swarm.allocation.legs.arcs import SAME_RAD
from swarm.allocation.legs.tangents import Approaches, Tangents, sort_key

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Hop:
    """One arc and the straight piece after it, of each of k paths."""

    path: IntArray
    """(k,) which path."""
    node: IntArray
    """(k,) node that is passed."""
    from_rad: FloatArray
    """(k,) progress on it when it is reached [rad]."""
    to_rad: FloatArray
    """(k,) and when it is left [rad]."""
    length_m: FloatArray
    """(k,) of the straight piece after it [m]."""
    heading_rad: FloatArray
    """(k,) direction of flight there [rad; from east to north]."""


@dataclass(frozen=True, slots=True, eq=False)
class Touches:
    """k pieces that have come to an arc, and what each can do from there."""

    node: IntArray
    """(k,) node that is arrived at."""
    progress_rad: FloatArray
    """(k,) progress there [rad]."""
    turn_m: FloatArray
    """(k,) potential: radius times progress [m]."""
    onward: IntArray
    """(k,) first tangent that leaves that node from there on; their number: none."""
    last_m: FloatArray
    """(k, n_target) length if the target is what is left for next; inf: it can't be [m]."""
    last: IntArray
    """(k, n_target) approach of the target that is flown then; -1: none."""


class Reach:
    """Shortest lengths from every arc to each of n targets.

    Args:
        radius_m: of all arcs [m].
        tangents: between them.
        targets: approaches of the n targets.
        n_target: how many there are, those that nothing approaches included.
    """

    def __init__(
        self, radius_m: float, tangents: Tangents, targets: Approaches, n_target: int
    ) -> None:
        self._radius_m = radius_m
        self._tangents = tangents
        self._targets = targets
        self._n_target = n_target
        self._leave_keys = sort_key(tangents.leaves, tangents.leaves_rad)
        keys = sort_key(targets.meets ^ 1, -targets.meets_rad)
        self._ends = np.argsort(keys, kind="stable")
        self._end_keys = keys[self._ends]
        self._met = self.touches(tangents.meets, tangents.meets_rad)
        # Potential where a tangent is left plus length from there to each target, the least of it
        # and of those that leave its node later, and which that is; the last row stands for none.
        self._least_m = np.full((len(tangents) + 1, n_target), np.inf)
        self._best = np.zeros((len(tangents) + 1, n_target), dtype=np.int64)
        self._settle()

    def touches(self, node: IntArray, progress_rad: FloatArray) -> Touches:
        """What can be done from (k,) ``node`` at (k,) ``progress_rad``."""
        here = sort_key(node, progress_rad) - SAME_RAD
        past = sort_key(node, np.full(len(node), 4.0))  # more than any progress
        onward = np.searchsorted(self._leave_keys, here)
        onward[onward == np.searchsorted(self._leave_keys, past)] = len(self._tangents)
        turn_m = self._radius_m * progress_rad
        last_m = np.full((len(node), self._n_target), np.inf)
        last = np.full((len(node), self._n_target), -1, dtype=np.int64)
        first = np.searchsorted(self._end_keys, here)
        count = np.searchsorted(self._end_keys, past) - first
        touch = np.repeat(np.arange(len(node)), count)
        nth = np.arange(len(touch)) - np.repeat(np.cumsum(count) - count, count)
        end = self._ends[np.repeat(first, count) + nth]
        target = self._targets.place[end]  # each once, as a place has one approach to a node
        ahead_m = self._targets.length_m[end] - self._radius_m * self._targets.meets_rad[end]
        last_m[touch, target] = ahead_m - turn_m[touch]
        last[touch, target] = end
        return Touches(node, progress_rad, turn_m, onward, last_m, last)

    def lengths_m(self, touches: Touches) -> FloatArray:
        """(k, n_target) shortest ways on from where ``touches`` are; inf: none [m]."""
        onward_m = self._least_m[touches.onward] - touches.turn_m[:, None]
        return np.minimum(touches.last_m, onward_m)

    def hops(self, touches: Touches, rows: IntArray, targets: IntArray) -> Iterator[Hop]:
        """What follows the first piece of k shortest paths, arc by arc.

        Args:
            touches: ends of first pieces.
            rows: (k,) which of them each path begins with.
            targets: (k,) where each leads to; it can be reached.
        """
        path = np.arange(len(rows))
        while len(path):
            onward_m = self._least_m[touches.onward[rows], targets] - touches.turn_m[rows]
            ends = touches.last_m[rows, targets] <= onward_m
            yield self._last_hop(path[ends], touches, rows[ends], targets[ends])
            path, rows, targets = path[~ends], rows[~ends], targets[~ends]
            chosen = self._best[touches.onward[rows], targets]
            yield Hop(
                path,
                touches.node[rows],
                touches.progress_rad[rows],
                self._tangents.leaves_rad[chosen],
                self._tangents.length_m[chosen],
                self._tangents.heading_rad[chosen],
            )
            touches, rows = self._met, chosen

    def _last_hop(self, path: IntArray, touches: Touches, rows: IntArray, targets: IntArray) -> Hop:
        end = touches.last[rows, targets]
        return Hop(
            path,
            touches.node[rows],
            touches.progress_rad[rows],
            -self._targets.meets_rad[end],
            self._targets.length_m[end],
            self._targets.heading_rad[end] + np.pi,
        )

    def _settle(self) -> None:
        """Iterate until no length gets less."""
        n = len(self._tangents)
        left_m = self._radius_m * self._tangents.leaves_rad + self._tangents.length_m
        jumps = _jumps(self._tangents.leaves)
        own_m = np.full((n + 1, self._n_target), np.inf)
        for _ in range(n + 1):
            own_m[:n] = left_m[:, None] + self.lengths_m(self._met)
            least_m = own_m
            for jump in jumps:
                least_m = np.minimum(least_m, least_m[jump])
            if np.array_equal(least_m, self._least_m):
                break
            self._least_m = least_m.copy()
        best = np.broadcast_to(np.arange(n + 1)[:, None], own_m.shape)
        for jump in jumps:
            later = own_m[jump] < own_m
            own_m = np.where(later, own_m[jump], own_m)
            best = np.where(later, best[jump], best)
        self._best = best


def _jumps(node: IntArray) -> list[IntArray]:
    """From each of n sorted rows 1, 2, 4, … rows ahead, or to row n from where the node ends.

    The least of a row and all that follow in its node is found by as many minima as there are.
    """
    n = len(node)
    jumps: list[IntArray] = []
    while (step := 1 << len(jumps)) < n:
        same = np.flatnonzero(node[step:] == node[:-step])
        if not len(same):
            break
        jump = np.full(n + 1, n, dtype=np.int64)
        jump[same] = same + step
        jumps.append(jump)
    return jumps
