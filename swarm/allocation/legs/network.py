"""Legs of a mission: lengths, times and corners between its places, and from anywhere to them.

A leg's length is √(h² + dz²), h that of the shortest horizontal path round the zones that concern
it, dz the difference of the ends' heights, gained evenly. Where the ground is known the height
along that path is the lowest that keeps away from it, and the leg's length that of all its pieces.
Leaves out: who flies which leg.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from swarm.allocation.legs.arcs import Arcs
from swarm.allocation.legs.flight import FlightModel
from swarm.allocation.legs.ground import Ground
from swarm.allocation.legs.planner import PathPlanner, Paths, Piece, Targets
from swarm.allocation.legs.reach import Hop
from swarm.allocation.legs.tangents import arc_of, sense_of
from swarm.allocation.problem import straight_m
from swarm.model.zones import Zone

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
IntArray = npt.NDArray[np.int64]

_AT_ONCE = 50_000
"""Pairs of places that are looked at together: work arrays of some 100 MB."""

_REMEMBERED = 32
"""How many places at most legs are kept from."""

_GAUSS = np.polynomial.legendre.leggauss(32)
"""Places within -1..1 and weights by which speeds round an arc are averaged."""


class Airspace:
    """All zones of a mission, and a planner for each selection of them that was asked for.

    Args:
        zones: whatever their heights.
        margin_m: distance to keep from them [m]; >= 0.
    """

    def __init__(self, zones: Sequence[Zone] = (), margin_m: float = 0.0) -> None:
        self.zones = tuple(zones)
        """All of them."""
        self.margin_m = margin_m
        """Distance to keep [m]."""
        self._planners: dict[tuple[int, ...], PathPlanner] = {}
        self._bottom_m = np.array([zone.bottom_m for zone in self.zones])
        self._top_m = np.array([zone.top_m for zone in self.zones])

    def __reduce__(self) -> tuple[type[Airspace], tuple[object, ...]]:
        return type(self), (self.zones, self.margin_m)

    def concerning(self, low_m: float, high_m: float) -> PathPlanner:
        """For who uses heights from ``low_m`` to ``high_m`` [m above the mission origin]."""
        return self.planner((low_m < self._top_m) & (high_m > self._bottom_m))

    def planner(self, concerned: BoolArray) -> PathPlanner:
        """For (n_zone,) ``concerned`` ones."""
        numbers = tuple(int(number) for number in np.flatnonzero(concerned))
        if numbers not in self._planners:
            zones = [self.zones[number] for number in numbers]
            self._planners[numbers] = PathPlanner(zones, self.margin_m)
        return self._planners[numbers]

    def sides(self, low_m: FloatArray, high_m: FloatArray) -> list[_Side]:
        """Places by how their (n,) lowest and (n,) greatest heights [m] lie to floors and ceilings.

        Of two places it is then known at once which zones concern who flies between them.
        """
        below = low_m[:, None] < self._top_m
        above = high_m[:, None] > self._bottom_m
        if not len(low_m):
            return []
        if not self.zones:
            return [_Side(np.arange(len(low_m)), below[0], above[0])]
        patterns, members = np.unique(
            np.concatenate([below, above], axis=1), axis=0, return_inverse=True
        )
        n_zone = len(self.zones)
        return [
            _Side(np.flatnonzero(members.ravel() == number), pattern[:n_zone], pattern[n_zone:])
            for number, pattern in enumerate(patterns)
        ]


@dataclass(frozen=True, slots=True, eq=False)
class _Side:
    """Places that lie alike to all zones' floors and ceilings."""

    rows: IntArray
    below: BoolArray
    """(n_zone,) reaching below the ceiling."""
    above: BoolArray
    """(n_zone,) reaching above the floor."""

    def concerned_with(self, other: _Side) -> BoolArray:
        """(n_zone,) which zones meet the heights of a leg between the two."""
        return (self.below | other.below) & (self.above | other.above)


class LegNetwork:
    """The n nodes of a mission (starts, bases, tasks, ends of lines) and all that is between them.

    Args:
        airspace: zones.
        node_enu_m: (n, 3) places [m; east, north, up from the mission origin].
        low_m: lowest height used at each node, or everywhere [m above the origin]; by default its
            own. A leg uses all from the lower end's lowest to the higher end's greatest.
        high_m: greatest height, alike.
        ground: what legs keep away from; None: it is not known.
        room_m: (n,) how far, at each node [m]; in between it changes evenly over the distance.
    """

    def __init__(
        self,
        airspace: Airspace,
        node_enu_m: FloatArray,
        low_m: FloatArray | float | None = None,
        high_m: FloatArray | float | None = None,
        ground: Ground | None = None,
        room_m: FloatArray | float = 0.0,
    ) -> None:
        self.node_enu_m: FloatArray = np.asarray(node_enu_m, dtype=np.float64).reshape(-1, 3)
        """(n, 3) places [m]."""
        self._airspace = airspace
        self._ground = ground
        self._room_m = np.broadcast_to(np.asarray(room_m, dtype=np.float64), (len(self),))
        self._heights_m = _heights_m(self.node_enu_m, low_m, high_m)
        self._sides = airspace.sides(*self._heights_m)
        self._targets: dict[tuple[int, PathPlanner], Targets] = {}
        self._asked: dict[tuple[object, ...], Legs] = {}

    def __reduce__(self) -> tuple[type[LegNetwork], tuple[object, ...]]:
        made_of = self._airspace, self.node_enu_m, *self._heights_m, self._ground, self._room_m
        return type(self), made_of

    def __len__(self) -> int:
        return len(self.node_enu_m)

    @cached_property
    def legs(self) -> Legs:
        """From every node to every other; worked out when first asked for."""
        return self.legs_from(self.node_enu_m, *self._heights_m, self._room_m)

    def legs_from(
        self,
        place_enu_m: FloatArray,
        low_m: FloatArray | float | None = None,
        high_m: FloatArray | float | None = None,
        room_m: FloatArray | float = 0.0,
    ) -> Legs:
        """From (m, 3) places [m; ENU] to every node.

        Args:
            place_enu_m: anywhere; in a zone the leg begins with the shortest way out.
            low_m: lowest height used at each [m above the origin], as for the nodes.
            high_m: greatest height, alike.
            room_m: what a leg keeps above the ground at each [m], as for the nodes.
        """
        places_m = np.asarray(place_enu_m, dtype=np.float64).reshape(-1, 3)
        blocks = []
        at_once = max(1, _AT_ONCE // max(1, len(self)))
        for side in self._airspace.sides(*_heights_m(places_m, low_m, high_m)):
            for number, other in enumerate(self._sides):
                planner = self._airspace.planner(side.concerned_with(other))
                targets = self._targets_of(number, planner)
                for first in range(0, len(side.rows), at_once):
                    rows = side.rows[first : first + at_once]
                    paths = targets.paths_from(places_m[rows, :2])
                    blocks.append(_Block(rows, other.rows, paths, planner.arcs))
        over = None
        if self._ground is not None:
            begin_m = np.broadcast_to(np.asarray(room_m, dtype=np.float64), (len(places_m),))
            over = _Over(self._ground, begin_m, self._room_m)
        return Legs(places_m, self.node_enu_m, blocks, over)

    def legs_from_one(
        self, place_enu_m: FloatArray, low_m: float, high_m: float, room_m: float = 0.0
    ) -> Legs:
        """The same from one (3,) place; kept for a while, since many ask for the same."""
        asked = place_enu_m.tobytes(), low_m, high_m, room_m
        if asked not in self._asked:
            if len(self._asked) >= _REMEMBERED:
                self._asked.clear()
            self._asked[asked] = self.legs_from(place_enu_m, low_m, high_m, room_m)
        return self._asked[asked]

    def _targets_of(self, side: int, planner: PathPlanner) -> Targets:
        if (side, planner) not in self._targets:
            places_m = self.node_enu_m[self._sides[side].rows, :2]
            self._targets[side, planner] = planner.targets(places_m)
        return self._targets[side, planner]


@dataclass(frozen=True, slots=True, eq=False)
class _Block:
    """Some places' paths to some nodes."""

    rows: IntArray
    columns: IntArray
    paths: Paths
    arcs: Arcs


@dataclass(frozen=True, slots=True, eq=False)
class _Over:
    """The ground under legs, and what they keep above it at their ends [m]."""

    ground: Ground
    begin_m: FloatArray
    end_m: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class _Draped:
    """Legs over the ground, with the corners of all of them."""

    to: tuple[IntArray, IntArray]
    """Their (k,) places and (k,) nodes."""
    first: IntArray
    """(k,) which piece each begins with."""
    offset_m: FloatArray
    """(3, pieces) from corner to corner [m]."""

    def sums(self, of_pieces: FloatArray) -> FloatArray:
        """(k,) sums over the pieces of each."""
        return np.add.reduceat(of_pieces, self.first)


class Legs:
    """Legs from m places to n nodes, for every kind of UAV."""

    def __init__(
        self,
        place_enu_m: FloatArray,
        node_enu_m: FloatArray,
        blocks: Sequence[_Block],
        over: _Over | None = None,
    ) -> None:
        self._place_enu_m = place_enu_m
        self._node_enu_m = node_enu_m
        self._blocks = blocks
        self._over = over
        offset_m = self._offset_m()
        self.length_m: FloatArray = straight_m(offset_m)
        """(m, n) lengths [m]; inf: the zones leave no way."""
        for block in blocks:
            winding = ~block.paths.is_straight
            cells = np.ix_(block.rows, block.columns)
            flat_m, rise_m = block.paths.length_m, offset_m[2][cells]
            length_m = np.sqrt(flat_m * flat_m + rise_m * rise_m)
            self.length_m[cells] = np.where(winding, length_m, self.length_m[cells])
        for draped in self._draped():
            self.length_m[draped.to] = draped.sums(straight_m(draped.offset_m))
        self._times_s: dict[FlightModel, FloatArray] = {}

    def times_s(self, model: FlightModel) -> FloatArray:
        """(m, n) times of one kind of UAV [s]; inf: it can't. Read-only, kept for the next call."""
        if model not in self._times_s:
            times_s = self._flown_s(model)
            times_s.setflags(write=False)
            self._times_s[model] = times_s
        return self._times_s[model]

    def corners_m(self, row: int, column: int) -> FloatArray | None:
        """(k, 3) places [m; ENU] of a leg, both ends included, to be flown straight; None: no way.

        Round corners are chains, see `swarm.allocation.legs.planner.Paths.corners_m`.
        """
        for block in self._blocks:
            rows, columns = (
                np.flatnonzero(block.rows == row),
                np.flatnonzero(block.columns == column),
            )
            if not (len(rows) and len(columns)):
                continue
            if not np.isfinite(block.paths.length_m[rows[0], columns[0]]):
                return None
            flat_m = block.paths.corners_m(int(rows[0]), int(columns[0]))
            begin_up_m, end_up_m = self._place_enu_m[row, 2], self._node_enu_m[column, 2]
            if (over := self._over) is not None:
                room_m = float(over.begin_m[row]), float(over.end_m[column])
                return over.ground.over_m(flat_m, (begin_up_m, end_up_m), room_m)
            piece_m = np.hypot(*np.diff(flat_m, axis=0).T)
            flown_m = np.concatenate([[0.0], np.cumsum(piece_m)])
            share = (
                flown_m / flown_m[-1] if flown_m[-1] > 0.0 else np.linspace(0.0, 1.0, len(flat_m))
            )
            up_m = begin_up_m + share * (end_up_m - begin_up_m)
            up_m[-1] = end_up_m
            return np.column_stack([flat_m, up_m])
        raise IndexError(f"there is no leg from place {row} to node {column}")

    def _offset_m(self) -> FloatArray:
        """(3, m, n) from places to nodes [m]."""
        nodes_m = np.ascontiguousarray(self._node_enu_m.T)
        return nodes_m[:, None, :] - self._place_enu_m.T[:, :, None]

    def _draped(self) -> Iterator[_Draped]:
        """All legs that there are, over the ground if that is known; nothing if it is not."""
        over = self._over
        if over is None:
            return
        for block in self._blocks:
            paths = block.paths
            row, column = np.nonzero(np.isfinite(paths.length_m))
            if not len(row):
                continue
            to = block.rows[row], block.columns[column]
            corners_m = np.stack([self._place_enu_m[to[0], :2], self._node_enu_m[to[1], :2]], 1)
            chains_m: list[FloatArray] = list(corners_m)
            winding = np.flatnonzero(~paths.is_straight[row, column])
            for path in winding.tolist():
                chains_m[path] = paths.corners_m(int(row[path]), int(column[path]))
            first = np.concatenate([[0], np.cumsum([len(chain) for chain in chains_m])])
            ends_up_m = np.stack([self._place_enu_m[to[0], 2], self._node_enu_m[to[1], 2]], 1)
            room_m = np.stack([over.begin_m[to[0]], over.end_m[to[1]]], 1)
            flown_m, first = over.ground.draped(
                corners_m.reshape(-1, 2) if not len(winding) else np.concatenate(chains_m),
                first,
                ends_up_m,
                room_m,
            )
            # The step from the last corner of one leg to the first of the next is no piece.
            offset_m = np.delete(np.diff(flown_m, axis=0), first[1:-1] - 1, axis=0)
            yield _Draped(to, first[:-1] - np.arange(len(row)), np.ascontiguousarray(offset_m.T))

    def _flown_s(self, model: FlightModel) -> FloatArray:
        if not model.heeds_direction:
            return model.rest_to_rest_s(self.length_m)
        if self._over is not None:
            return self._flown_over_s(model)
        offset_m = self._offset_m()
        times_s = model.straight_s(offset_m)
        for block in self._blocks:
            winding = ~block.paths.is_straight
            cells = np.ix_(block.rows, block.columns)
            times_s[cells] = np.where(winding, np.inf, times_s[cells])
            row, column = np.nonzero(winding & np.isfinite(block.paths.length_m))
            if len(row):
                to = block.rows[row], block.columns[column]
                rise = offset_m[2][to] / block.paths.length_m[row, column]
                pieces = block.paths.pieces(row, column)
                slow_s = _slow_s(model, block.arcs, rise, pieces)
                times_s[to] = model.even_s(self.length_m[to], slow_s)
        return times_s

    def _flown_over_s(self, model: FlightModel) -> FloatArray:
        times_s = np.full(self.length_m.shape, np.inf)
        for draped in self._draped():
            piece_m = straight_m(draped.offset_m)
            speed_m_s = model.speed_over_m_s(draped.offset_m, piece_m)
            with np.errstate(divide="ignore", invalid="ignore"):
                piece_s = np.where(piece_m > 0.0, piece_m / speed_m_s, 0.0)
            times_s[draped.to] = model.even_s(self.length_m[draped.to], draped.sums(piece_s))
        return times_s


def _slow_s(
    model: FlightModel, arcs: Arcs, rise: FloatArray, pieces: Iterator[Piece]
) -> FloatArray:
    """(k,) Σ(piece ÷ its speed) of k paths that gain (k,) metres of height for each metre [s]."""
    flown = list(pieces)
    path = np.concatenate([piece.path for piece in flown])
    length_m = np.concatenate([piece.length_m for piece in flown])
    heading_rad = np.concatenate([piece.heading_rad for piece in flown])
    piece_s = _piece_s(model, length_m, heading_rad, rise[path])
    slow_s: FloatArray = np.bincount(path, weights=piece_s, minlength=len(rise)).astype(float)
    hops = [piece.hop for piece in flown if piece.hop is not None]
    if hops and arcs.radius_m > 0.0:
        path = np.concatenate([piece.path for piece in flown if piece.hop is not None])
        arc_s = _arc_s(model, arcs, hops, rise[path])
        slow_s += np.bincount(path, weights=arc_s, minlength=len(rise))
    return slow_s


def _arc_s(model: FlightModel, arcs: Arcs, hops: Sequence[Hop], rise: FloatArray) -> FloatArray:
    """(k,) times round all arcs of ``hops``, by Gauss and Legendre, as if of many pieces [s]."""
    node = np.concatenate([hop.node for hop in hops])
    from_rad = np.concatenate([hop.from_rad for hop in hops])
    to_rad = np.concatenate([hop.to_rad for hop in hops])
    sense = sense_of(node)
    begin_rad = arcs.begin_rad[arc_of(node)]
    begins_rad = [from_rad, *_kinks_rad(model, begin_rad, sense, from_rad, to_rad, rise), to_rad]
    low_rad, high_rad = np.stack(begins_rad[:-1]), np.stack(begins_rad[1:])
    half_rad = np.maximum(0.0, high_rad - low_rad) / 2.0
    middle_rad = (high_rad + low_rad) / 2.0
    place, weight = (column[:, None, None] for column in _GAUSS)
    progress_rad = (middle_rad + place * half_rad).reshape(-1, len(node))
    # Counter-clockwise the progress is the angle from where the arc begins, clockwise minus it.
    heading_rad = begin_rad + sense * (progress_rad + np.pi / 2.0)
    length_m = (weight * (half_rad * arcs.radius_m)).reshape(-1, len(node))
    # Added up one by one: numpy's sum goes another way for one path than for many.
    piece_s: FloatArray = np.add.accumulate(_piece_s(model, length_m, heading_rad, rise))[-1]
    return piece_s


def _kinks_rad(
    model: FlightModel,
    begin_rad: FloatArray,
    sense: IntArray,
    from_rad: FloatArray,
    to_rad: FloatArray,
    rise: FloatArray,
) -> FloatArray:
    """(2, k) where on arcs wind begins or ends to keep UAVs below their speed; else an end [rad].

    There the speed over ground has a kink, across which no quadrature is good. At that speed v
    the air is met at the airspeed a: |v·e − w| = a, so w·e = (v² + w² − a²) ÷ 2·v.
    """
    wind_m_s = math.hypot(*model.wind_enu_m_s)
    if model.airspeed_m_s is None or wind_m_s == 0.0:
        return np.stack([from_rad, to_rad])
    v_m_s = model.speed_m_s
    along_m_s = (v_m_s**2 + wind_m_s**2 - model.airspeed_m_s**2) / (2.0 * v_m_s)
    cosine = along_m_s / wind_m_s * np.sqrt(1.0 + rise * rise)
    off_rad = np.arccos(np.clip(cosine, -1.0, 1.0))
    wind_rad = math.atan2(model.wind_enu_m_s[1], model.wind_enu_m_s[0])
    heading_rad = wind_rad + np.stack([off_rad, -off_rad])
    progress_rad = sense * (heading_rad - begin_rad) - np.pi / 2.0
    progress_rad = from_rad + np.mod(progress_rad - from_rad, 2.0 * np.pi)
    return np.sort(np.minimum(progress_rad, np.maximum(from_rad, to_rad)), axis=0)


def _piece_s(
    model: FlightModel, length_m: FloatArray, heading_rad: FloatArray, rise: FloatArray
) -> FloatArray:
    """(..., k) times of pieces of so many horizontal lengths [m], unaccelerated; inf: can't [s]."""
    offset_m = np.empty((3, *length_m.shape))
    offset_m[0] = length_m * np.cos(heading_rad)
    offset_m[1] = length_m * np.sin(heading_rad)
    offset_m[2] = length_m * rise
    inclined_m = straight_m(offset_m)
    speed_m_s = model.speed_over_m_s(offset_m, inclined_m)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(inclined_m > 0.0, inclined_m / speed_m_s, 0.0)


def _heights_m(
    place_enu_m: FloatArray, low_m: FloatArray | float | None, high_m: FloatArray | float | None
) -> tuple[FloatArray, FloatArray]:
    """(n,) lowest and (n,) greatest heights used at (n, 3) places [m above the origin]."""
    up_m = place_enu_m[:, 2]
    low_m = up_m if low_m is None else np.broadcast_to(low_m, up_m.shape)
    high_m = up_m if high_m is None else np.broadcast_to(high_m, up_m.shape)
    return low_m, high_m
