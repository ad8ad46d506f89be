"""Round corners: the arcs of a margin that a shortest path may lean on.

A shortest path among obstacles is made of straight pieces and of arcs about their convex corners,
each within the directions in which the corner is the nearest point of its obstacle. With no margin
an arc is the corner itself, and its angles are directions of touching. Leaves out: which arcs are
joined by which pieces (swarm.allocation.legs.tangents).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from swarm.allocation.legs.obstacles import TOUCH_M, Obstacles

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
IntArray = npt.NDArray[np.int64]

SAME_RAD = 1e-9
"""Directions nearer than this are the same: they are sums of rounded angles [rad]."""

_TURN = 2.0 * np.pi


@dataclass(frozen=True, slots=True, eq=False)
class Arcs:
    """n arcs of one radius, each clear of every obstacle."""

    radius_m: float
    """Distance from the corners [m]; 0 without a margin."""
    centre_m: FloatArray
    """(n, 2) corners [m; east, north]."""
    begin_rad: FloatArray
    """(n,) direction from the corner to the arc's clockwise end [rad; from east to north]."""
    extent_rad: FloatArray
    """(n,) angle from there to its other end, counter-clockwise [rad]; 0..π."""

    def __len__(self) -> int:
        return len(self.begin_rad)

    def along_rad(self, arc: IntArray, direction_rad: FloatArray) -> tuple[FloatArray, BoolArray]:
        """(...) angles from where (...) arcs begin, and whether they are on the arcs."""
        angle_rad = np.mod(direction_rad - self.begin_rad[arc] + SAME_RAD, _TURN) - SAME_RAD
        extent_rad = self.extent_rad[arc]
        on_arc = angle_rad <= extent_rad + SAME_RAD
        return np.clip(angle_rad, 0.0, extent_rad), on_arc

    def place_m(self, arc: IntArray, angle_rad: FloatArray) -> FloatArray:
        """(..., 2) places [m] on (...) arcs at (...) angles from their beginnings."""
        direction_rad = self.begin_rad[arc] + angle_rad
        return self.centre_m[arc] + self.radius_m * unit(direction_rad)


def unit(direction_rad: FloatArray) -> FloatArray:
    """(..., 2) unit vectors [east, north] of (...) directions [rad; from east to north]."""
    return np.stack([np.cos(direction_rad), np.sin(direction_rad)], axis=-1)


def arcs_of(obstacles: Obstacles) -> Arcs:
    """The arcs about all convex corners, without what lies in an obstacle."""
    radius_m = obstacles.margin_m if obstacles.margin_m > TOUCH_M else 0.0
    corners = [_convex(ring_m) for ring_m in obstacles.rings_m]
    whole = Arcs(
        radius_m,
        np.concatenate([np.empty((0, 2)), *(centre_m for centre_m, _, _ in corners)]),
        np.concatenate([np.empty(0), *(begin_rad for _, begin_rad, _ in corners)]),
        np.concatenate([np.empty(0), *(extent_rad for _, _, extent_rad in corners)]),
    )
    return _without_hidden(whole, obstacles)


def _convex(ring_m: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Centres, beginnings and extents of the corners at which a ring turns left."""
    ahead_m = np.roll(ring_m, -1, axis=0) - ring_m
    ahead_rad = np.arctan2(ahead_m[:, 1], ahead_m[:, 0])
    behind_rad = np.roll(ahead_rad, 1)
    turn_rad = np.mod(ahead_rad - behind_rad + np.pi, _TURN) - np.pi
    left = turn_rad > SAME_RAD
    return ring_m[left], behind_rad[left] - np.pi / 2, turn_rad[left]


def _without_hidden(whole: Arcs, obstacles: Obstacles) -> Arcs:
    """What of ``whole`` is clear: pieces between the crossings with borders of other margins."""
    edges = _Edges.of(obstacles.rings_m)
    cuts = [_cuts_rad(whole, arc, edges) for arc in range(len(whole))]
    arc = np.repeat(np.arange(len(whole)), [len(angles_rad) - 1 for angles_rad in cuts])
    begin_rad = np.concatenate([np.empty(0), *(angles_rad[:-1] for angles_rad in cuts)])
    end_rad = np.concatenate([np.empty(0), *(angles_rad[1:] for angles_rad in cuts)])
    clear = obstacles.free(whole.place_m(arc, (begin_rad + end_rad) / 2))
    joined: list[tuple[int, float, float]] = []
    for number, low_rad, high_rad in zip(arc[clear], begin_rad[clear], end_rad[clear], strict=True):
        if joined and joined[-1][0] == number and joined[-1][2] == low_rad:
            joined[-1] = (number, joined[-1][1], high_rad)
        else:
            joined.append((number, low_rad, high_rad))
    rows = np.array([number for number, _, _ in joined], dtype=np.int64)
    low_rad = np.array([low_rad for _, low_rad, _ in joined])
    high_rad = np.array([high_rad for _, _, high_rad in joined])
    return Arcs(
        whole.radius_m, whole.centre_m[rows], whole.begin_rad[rows] + low_rad, high_rad - low_rad
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Edges:
    """All borders' edges."""

    from_m: FloatArray
    """(m, 2) where each begins [m]; every corner is the beginning of one."""
    normal_rad: FloatArray
    """(m,) direction to its left [rad]."""

    @classmethod
    def of(cls, rings_m: list[FloatArray]) -> _Edges:
        ahead_m = [np.roll(ring_m, -1, axis=0) - ring_m for ring_m in rings_m]
        edge_m = np.concatenate([np.empty((0, 2)), *ahead_m])
        normal_rad = np.arctan2(edge_m[:, 1], edge_m[:, 0]) + np.pi / 2
        return cls(np.concatenate([np.empty((0, 2)), *rings_m]), normal_rad)


def _cuts_rad(arcs: Arcs, arc: int, edges: _Edges) -> FloatArray:
    """Angles of an arc at which it may go into another margin or leave it; both its ends, too."""
    extent_rad = arcs.extent_rad[arc]
    radius_m = arcs.radius_m
    if radius_m == 0.0:
        return np.array([0.0, extent_rad])
    corner_m = edges.from_m - arcs.centre_m[arc]
    beside_m = -(unit(edges.normal_rad) * corner_m).sum(axis=1)  # of the centre, to the left
    corner_rad = np.arctan2(corner_m[:, 1], corner_m[:, 0])
    axis_rad = np.concatenate([edges.normal_rad, edges.normal_rad, corner_rad])
    cosine = np.concatenate(
        [
            1.0 - beside_m / radius_m,  # crosses the line beside an edge, on its left
            -1.0 - beside_m / radius_m,  # on its right
            np.hypot(corner_m[:, 0], corner_m[:, 1]) / (2.0 * radius_m),  # the circle of a corner
        ]
    )
    meets = np.abs(cosine) <= 1.0
    half_rad = np.arccos(cosine[meets])
    angle_rad = np.concatenate([axis_rad[meets] + half_rad, axis_rad[meets] - half_rad])
    angle_rad = np.mod(angle_rad - arcs.begin_rad[arc], _TURN)
    inner = angle_rad[(angle_rad > SAME_RAD) & (angle_rad < extent_rad - SAME_RAD)]
    return np.concatenate([[0.0], np.unique(inner), [extent_rad]])
