"""Straight pieces that touch arcs: between two of them, and from a place to one.

An arc is passed in one of two senses, counter-clockwise or clockwise; `nodes` are these, two an
arc. How far along an arc a piece touches it is told by its *progress*, an angle that grows in the
sense of the node, so that whoever arrives at progress a can leave at any b >= a.
Leaves out: the shortest chain of pieces (swarm.allocation.legs.reach).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from swarm.allocation.legs.arcs import Arcs
from swarm.allocation.legs.obstacles import TOUCH_M, Obstacles

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
IntArray = npt.NDArray[np.int64]

_QUARTER_RAD = np.pi / 2.0
_SENSES = (1, -1)
_NEAREST_M = TOUCH_M / 10.0
"""A place nearer than this to a corner without margin is that corner [m]."""


def node_of(arc: IntArray, sense: int) -> IntArray:
    """Nodes of (...) arcs passed in a sense: 1 counter-clockwise, -1 clockwise."""
    return 2 * arc + (sense < 0)


def arc_of(node: IntArray) -> IntArray:
    """Arcs of (...) nodes."""
    return node // 2


def sense_of(node: IntArray) -> IntArray:
    """1 for each of (...) nodes that is passed counter-clockwise, -1 clockwise."""
    return 1 - 2 * (node % 2)


def sort_key(node: IntArray, progress_rad: FloatArray) -> FloatArray:
    """Numbers that order touches by node, then by progress, which is within -π..π."""
    return 8.0 * node + progress_rad


@dataclass(frozen=True, slots=True, eq=False)
class Tangents:
    """Pieces between two arcs, one each way, in the order of node and progress where they leave."""

    leaves: IntArray
    """(n,) node that is left."""
    leaves_rad: FloatArray
    """(n,) progress there [rad]."""
    meets: IntArray
    """(n,) node that is arrived at."""
    meets_rad: FloatArray
    """(n,) progress there [rad]."""
    length_m: FloatArray
    """(n,) [m]; > 0."""
    heading_rad: FloatArray
    """(n,) direction of flight [rad; from east to north]."""

    def __len__(self) -> int:
        return len(self.length_m)


@dataclass(frozen=True, slots=True, eq=False)
class Approaches:
    """Pieces from places to arcs, in the order of the places.

    Flown the other way they leave node ``meets ^ 1`` at progress ``-meets_rad``.
    """

    place: IntArray
    """(n,) row of the place."""
    meets: IntArray
    """(n,) node that is arrived at."""
    meets_rad: FloatArray
    """(n,) progress there [rad]."""
    length_m: FloatArray
    """(n,) [m]; >= 0."""
    heading_rad: FloatArray
    """(n,) direction of flight towards the arc [rad; from east to north]."""

    def __len__(self) -> int:
        return len(self.length_m)


def tangents(arcs: Arcs, obstacles: Obstacles) -> Tangents:
    """All clear pieces that touch an arc at both ends."""
    first, second = np.triu_indices(len(arcs), 1)
    offset_m = arcs.centre_m[second] - arcs.centre_m[first]
    apart_m = np.hypot(offset_m[:, 0], offset_m[:, 1])
    straight_rad = np.arctan2(offset_m[:, 1], offset_m[:, 0])
    parts = [
        _joining(arcs, first, second, apart_m, straight_rad, senses=(one, other))
        for one in _SENSES
        for other in _SENSES
    ]
    found = _concatenated(parts)
    start_m = arcs.place_m(arc_of(found.leaves), np.abs(found.leaves_rad))
    end_m = arcs.place_m(arc_of(found.meets), np.abs(found.meets_rad))
    found = _taken(found, np.flatnonzero(obstacles.clear(start_m, end_m)))
    back = Tangents(
        leaves=found.meets ^ 1,
        leaves_rad=-found.meets_rad,
        meets=found.leaves ^ 1,
        meets_rad=-found.leaves_rad,
        length_m=found.length_m,
        heading_rad=found.heading_rad + np.pi,
    )
    both = _concatenated([found, back])
    return _taken(both, np.argsort(sort_key(both.leaves, both.leaves_rad), kind="stable"))


def _joining(
    arcs: Arcs,
    first: IntArray,
    second: IntArray,
    apart_m: FloatArray,
    straight_rad: FloatArray,
    senses: tuple[int, int],
) -> Tangents:
    """Pieces from each of ``first`` to each of ``second``, passed in ``senses``, clear or not."""
    width_m = 0.0 if senses[0] == senses[1] else 2.0 * arcs.radius_m
    rows = np.flatnonzero(apart_m > max(width_m, _NEAREST_M))
    first, second, apart_m = first[rows], second[rows], apart_m[rows]
    heading_rad = straight_rad[rows] + senses[0] * np.arcsin(width_m / apart_m)
    leaves_rad, leaves_on = arcs.along_rad(first, heading_rad - senses[0] * _QUARTER_RAD)
    meets_rad, meets_on = arcs.along_rad(second, heading_rad - senses[1] * _QUARTER_RAD)
    found = Tangents(
        leaves=node_of(first, senses[0]),
        leaves_rad=senses[0] * leaves_rad,
        meets=node_of(second, senses[1]),
        meets_rad=senses[1] * meets_rad,
        length_m=np.sqrt((apart_m - width_m) * (apart_m + width_m)),
        heading_rad=heading_rad,
    )
    return _taken(found, np.flatnonzero(leaves_on & meets_on))


def approaches(arcs: Arcs, obstacles: Obstacles, place_m: FloatArray) -> Approaches:
    """All clear pieces from (n, 2) places [m] that touch an arc."""
    offset_m = arcs.centre_m[None] - place_m[:, None]
    apart_m = np.hypot(offset_m[..., 0], offset_m[..., 1])
    within = apart_m > (arcs.radius_m - TOUCH_M if arcs.radius_m > 0.0 else _NEAREST_M)
    place, arc = np.nonzero(within)
    apart_m = np.maximum(apart_m[within], arcs.radius_m)
    offset_m = offset_m[within]
    straight_rad = np.arctan2(offset_m[:, 1], offset_m[:, 0])
    aside_rad = np.arcsin(arcs.radius_m / apart_m)
    length_m = np.sqrt((apart_m - arcs.radius_m) * (apart_m + arcs.radius_m))
    parts = []
    for sense in _SENSES:
        heading_rad = straight_rad - sense * aside_rad
        meets_rad, on_arc = arcs.along_rad(arc, heading_rad - sense * _QUARTER_RAD)
        found = Approaches(place, node_of(arc, sense), sense * meets_rad, length_m, heading_rad)
        parts.append(_taken(found, np.flatnonzero(on_arc)))
    found = _concatenated(parts)
    from_m = place_m[found.place]
    end_m = arcs.place_m(arc_of(found.meets), np.abs(found.meets_rad))
    here = found.length_m <= TOUCH_M  # on the arc already: a piece too short to ask about
    clear = here | obstacles.clear(from_m, np.where(here[:, None], from_m, end_m))
    rows = np.flatnonzero(clear)
    return _taken(found, rows[np.argsort(found.place[rows], kind="stable")])


_Pieces = TypeVar("_Pieces", Tangents, Approaches)


def _taken(pieces: _Pieces, rows: IntArray) -> _Pieces:
    return type(pieces)(*(getattr(pieces, item.name)[rows] for item in fields(pieces)))


def _concatenated(parts: Sequence[_Pieces]) -> _Pieces:
    columns = fields(parts[0])
    return type(parts[0])(
        *(np.concatenate([getattr(part, item.name) for part in parts]) for item in columns)
    )
