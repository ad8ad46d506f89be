"""Shortest horizontal paths round zones, with their margin.

A `PathPlanner` knows some zones, all of which concern whoever flies; it is made once and asked
often. Leaves out: heights and times (swarm.allocation.legs.network).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from swarm.allocation.legs.arcs import Arcs, arcs_of, unit
from swarm.allocation.legs.obstacles import Obstacles
from swarm.allocation.legs.reach import Hop, Reach, Touches
from swarm.allocation.legs.tangents import Approaches, approaches, arc_of, sense_of, tangents
from swarm.model.zones import Zone

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
IntArray = npt.NDArray[np.int64]

EXCESS_FRAC = 1e-6
"""How much longer a path told by its corners may be than the true one with its arcs."""

_CHORD_RAD = 0.2
"""Greatest angle that a chord stands for [rad]."""

_FINER = 8
"""How often chords are halved at most: beyond, 1e-6 m of a gap are told from none."""


class PathPlanner:
    """Shortest paths that meet no zone's inside and stay a margin away.

    Paths are exact: tangents and arcs. A place in a zone is left by the shortest way out, and from
    there on as from any other; no path leads to one.

    Args:
        zones: what to heed.
        margin_m: distance to keep from them [m]; >= 0.

    Raises:
        ValueError: the margin is below 0.
    """

    def __init__(self, zones: Iterable[Zone], margin_m: float = 0.0) -> None:
        self._obstacles = Obstacles(zones, margin_m)
        self.arcs: Arcs = arcs_of(self._obstacles)
        """What paths bend round."""
        self._tangents = tangents(self.arcs, self._obstacles)

    def free(self, place_m: FloatArray) -> BoolArray:
        """(n,) whether (n, 2) places [m; east, north] are in no zone nor nearer than the margin."""
        return self._obstacles.free(place_m)

    def clear(self, from_m: FloatArray, to_m: FloatArray) -> BoolArray:
        """(n,) whether straight pieces between (n, 2) places [m] may be flown."""
        return self._obstacles.clear(from_m, to_m)

    def targets(self, place_m: FloatArray) -> Targets:
        """Whatever can be known beforehand of paths to (n, 2) places [m]."""
        return Targets(self, np.ascontiguousarray(place_m, dtype=np.float64))

    def path_m(self, from_m: FloatArray, to_m: FloatArray) -> FloatArray | None:
        """(k, 2) corners of the shortest path between two (2,) places [m]; None: there is none."""
        paths = self.targets(to_m[None]).paths_from(from_m[None])
        return paths.corners_m(0, 0) if np.isfinite(paths.length_m[0, 0]) else None

    def approaches(self, place_m: FloatArray) -> Approaches:
        """All clear pieces from (n, 2) places [m] that touch an arc."""
        return approaches(self.arcs, self._obstacles, place_m)

    def reach(self, targets: Approaches, n_target: int) -> Reach:
        """Lengths from everywhere to ``n_target`` places that ``targets`` lead to."""
        return Reach(self.arcs.radius_m, self._tangents, targets, n_target)

    def way_out_m(self, place_m: FloatArray) -> tuple[FloatArray, BoolArray]:
        """(n, 2) places [m], those in a zone replaced by the nearest outside; (n,) which stayed."""
        free = self.free(place_m)
        if free.all():
            return place_m, free
        out_m = place_m.copy()
        for row in np.flatnonzero(~free):
            out_m[row] = self._obstacles.way_out_m(place_m[row])
        return out_m, free


class Targets:
    """n places to fly to, and all that can be worked out before anyone does."""

    def __init__(self, planner: PathPlanner, place_m: FloatArray) -> None:
        self.planner = planner
        """Who knows the zones."""
        self.place_m = place_m
        """(n, 2) [m; east, north]."""
        self.reach = planner.reach(planner.approaches(place_m), len(place_m))
        """From the arcs to them."""

    def paths_from(self, place_m: FloatArray) -> Paths:
        """Shortest paths from (m, 2) places [m] to each of them."""
        return Paths(self, np.ascontiguousarray(place_m, dtype=np.float64))


class Paths:
    """Shortest paths from m places to n targets."""

    def __init__(self, targets: Targets, place_m: FloatArray) -> None:
        planner = targets.planner
        self._planner = planner
        self._targets = targets
        self._place_m = place_m
        self._begin_m, stayed = planner.way_out_m(place_m)
        out_m = self._begin_m - place_m
        self._out_m = np.hypot(out_m[:, 0], out_m[:, 1])
        self._start = planner.approaches(self._begin_m)
        shape = (len(place_m), len(targets.place_m))
        row, column = (index.ravel() for index in np.indices(shape))
        begin_m, end_m = self._begin_m[row], targets.place_m[column]
        self._direct: BoolArray = planner.clear(begin_m, end_m).reshape(shape)
        self.is_straight: BoolArray = self._direct & stayed[:, None]
        """(m, n) whether the path is one straight piece."""
        offset_m = end_m - begin_m
        straight_m = np.hypot(offset_m[:, 0], offset_m[:, 1]).reshape(shape)
        round_m, self._chosen = self._round_m(shape)
        ahead_m = np.where(self._direct, straight_m, np.maximum(round_m, straight_m))
        self.length_m: FloatArray = self._out_m[:, None] + ahead_m
        """(m, n) horizontal lengths [m]; inf: there is no path."""

    def _round_m(self, shape: tuple[int, int]) -> tuple[FloatArray, IntArray]:
        """(m, n) shortest lengths over arcs, and which first piece each begins with."""
        round_m = np.full(shape, np.inf)
        chosen = np.full(shape, -1, dtype=np.int64)
        start = self._start
        if not len(start) or self._direct.all():
            return round_m, chosen
        onward_m = self._targets.reach.lengths_m(self._touches(np.arange(len(start))))
        onward_m += start.length_m[:, None]
        places, first = np.unique(start.place, return_index=True)
        round_m[places] = np.minimum.reduceat(onward_m, first, axis=0)
        piece, column = np.nonzero(onward_m == round_m[start.place])
        chosen[start.place[piece[::-1]], column[::-1]] = piece[::-1]  # the first of several stays
        return round_m, chosen

    def _touches(self, pieces: IntArray) -> Touches:
        start = self._start
        return self._targets.reach.touches(start.meets[pieces], start.meets_rad[pieces])

    def pieces(self, row: IntArray, column: IntArray) -> Iterator[Piece]:
        """Everything that k paths are made of, in the order of flight, for all of them at once.

        Args:
            row: (k,) their beginnings.
            column: (k,) their targets; there is a path to each.
        """
        out_m = self._begin_m[row] - self._place_m[row]
        yield Piece.straight(np.arange(len(row)), out_m)
        direct = np.flatnonzero(self._direct[row, column])
        yield Piece.straight(
            direct, self._targets.place_m[column[direct]] - self._begin_m[row[direct]]
        )
        winding = np.flatnonzero(~self._direct[row, column])
        used, nth = np.unique(self._chosen[row[winding], column[winding]], return_inverse=True)
        yield Piece(
            winding, self._start.length_m[used[nth]], self._start.heading_rad[used[nth]], None
        )
        for hop in self._targets.reach.hops(self._touches(used), nth, column[winding]):
            yield Piece(winding[hop.path], hop.length_m, hop.heading_rad, hop)

    def corners_m(self, row: int, column: int) -> FloatArray:
        """(k, 2) places [m] of the path between the two, both included, to be flown straight.

        Arcs become chains of chords outside of them, so that the margin is kept; all of them
        lengthen the path by less than 1e-6 of its length. In a gap with no room for that they are
        shorter.
        """
        hops = [
            piece.hop
            for piece in self.pieces(np.array([row]), np.array([column]))
            if piece.hop is not None and len(piece.hop.path)
        ]
        bent_m = self._planner.arcs.radius_m * sum(
            float(hop.to_rad[0] - hop.from_rad[0]) for hop in hops
        )
        excess_m = EXCESS_FRAC * float(self.length_m[row, column])
        # Chords of angle s are longer than their arc by s²/12 of it, and a little more.
        step_rad = _CHORD_RAD if bent_m <= 0.0 else min(_CHORD_RAD, np.sqrt(11 * excess_m / bent_m))
        begin_m, end_m = self._begin_m[row][None], self._targets.place_m[column][None]
        for _ in range(_FINER):
            ahead_m = np.concatenate(
                [begin_m, *(self._chain_m(hop, step_rad) for hop in hops), end_m]
            )
            if bent_m <= 0.0 or self._planner.clear(ahead_m[:-1], ahead_m[1:]).all():
                break
            step_rad /= 2.0
        if self._out_m[row] > 0.0:
            return np.concatenate([self._place_m[row][None], ahead_m])
        return ahead_m

    def _chain_m(self, hop: Hop, step_rad: float) -> FloatArray:
        """(k, 2) corners [m] of chords round the arc of a hop of one path."""
        arc = arc_of(hop.node)[0]
        if self._planner.arcs.radius_m == 0.0:
            return self._planner.arcs.centre_m[[arc]]
        turn_rad = max(0.0, float(hop.to_rad[0] - hop.from_rad[0]))
        n_chord = max(1, int(np.ceil(turn_rad / step_rad)))
        middle_rad = hop.from_rad[0] + turn_rad * (np.arange(n_chord) + 0.5) / n_chord
        direction_rad = self._planner.arcs.begin_rad[arc] + sense_of(hop.node)[0] * middle_rad
        reach_m = self._planner.arcs.radius_m / np.cos(turn_rad / (2 * n_chord))
        chain_m: FloatArray = self._planner.arcs.centre_m[arc] + reach_m * unit(direction_rad)
        return chain_m


@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """A straight piece of each of k paths, and the arc before it."""

    path: IntArray
    """(k,) which path."""
    length_m: FloatArray
    """(k,) of the straight piece [m]."""
    heading_rad: FloatArray
    """(k,) its direction of flight [rad; from east to north]."""
    hop: Hop | None
    """The arc and, once more, the piece after it; None: the piece follows none."""

    @classmethod
    def straight(cls, path: IntArray, offset_m: FloatArray) -> Piece:
        """Pieces with (k, 2) ``offset_m`` [m] from begin to end."""
        heading_rad = np.arctan2(offset_m[:, 1], offset_m[:, 0])
        return cls(path, np.hypot(offset_m[:, 0], offset_m[:, 1]), heading_rad, None)
