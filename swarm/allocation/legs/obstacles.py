"""What zones keep out of, with their margin: which pieces and places are clear of it.

The predicates are GEOS's, by way of shapely, which is imported where the first zone is: it takes
longer than all else here. Leaves out: ways round them (swarm.allocation.legs.planner).
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from swarm.model.zones import Zone

if TYPE_CHECKING:
    import shapely

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
IntArray = npt.NDArray[np.int64]

TOUCH_M = 1e-6
"""Who is no deeper inside than this only touches [m]: places on a border are rounded."""

_FAR_M = 1e8
"""Where the world ends that an inclusive zone keeps out of [m]."""

_BORDER_PIECES = 256
"""Of a border, of which each is tried as a way out where the nearest will not do."""

_ROUND_STEPS = 64
"""Chords per quarter of a circle where a shape is needed, not a distance."""


class Obstacles:
    """Keep-out shapes of some zones, each by itself: where two touch one may fly between.

    Args:
        zones: all of them, whatever their heights.
        margin_m: who is nearer than this to a shape is inside it [m]; >= 0.

    Raises:
        ValueError: the margin is below 0.
    """

    def __init__(self, zones: Iterable[Zone], margin_m: float = 0.0) -> None:
        if not 0.0 <= margin_m < _FAR_M:
            raise ValueError(f"margin_m must be >= 0, not {margin_m}")
        self.margin_m = margin_m
        """Distance to keep [m]."""
        self.rings_m: list[FloatArray] = []
        """(k, 2) corners of each border, with what is kept out of on the left."""
        self._depth_m = max(0.0, margin_m - TOUCH_M)
        self._shapes: list[shapely.Geometry] = []  # nearer to these than _depth_m is inside
        self._boxes: list[FloatArray] = []  # west, south, east, north of what is inside
        self._circles: list[FloatArray] = []  # middle and radius of one round what is inside
        self._solids = [part for zone in zones for part in self._add(zone)]
        self._boxes_m = np.array(self._boxes).reshape(-1, 4)
        self._circles_m = np.array(self._circles).reshape(-1, 3)

    def __len__(self) -> int:
        return len(self._shapes)

    def _add(self, zone: Zone) -> list[shapely.Polygon]:
        import shapely

        shape = shapely.orient_polygons(zone.shape())
        rings = [np.array(ring.coords)[:-1] for ring in (shape.exterior, *shape.interiors)]
        self.rings_m += [ring[::-1] for ring in rings] if zone.inclusive else rings
        touch_m = TOUCH_M if self._depth_m == 0.0 else 0.0
        if zone.inclusive:
            keeps_out: shapely.Geometry = _around(_grown(shape, touch_m))
            solids = list(_around(shape).geoms)
        else:
            keeps_out, solids = _grown(shape, -touch_m), [shape]
        if shapely.is_empty(keeps_out):  # narrower than what counts as a touch
            return solids
        shapely.prepare(keeps_out)
        self._shapes.append(keeps_out)
        corners_m = shapely.get_coordinates(keeps_out)
        low_m, high_m = corners_m.min(axis=0), corners_m.max(axis=0)
        middle_m = (low_m + high_m) / 2.0
        radius_m = np.hypot(*(corners_m - middle_m).T).max() + self._depth_m + TOUCH_M
        self._boxes.append(np.concatenate([low_m - self._depth_m, high_m + self._depth_m]))
        self._circles.append(np.append(middle_m, radius_m))
        return solids

    def clear(self, from_m: FloatArray, to_m: FloatArray) -> BoolArray:
        """(n,) whether straight pieces between (n, 2) places [m] stay outside of every shape."""
        clear = np.ones(len(from_m), dtype=np.bool_)
        low_m, high_m = np.minimum(from_m, to_m), np.maximum(from_m, to_m)
        near = self._near(low_m, high_m)
        row, shape = np.nonzero(near)
        near[row, shape] = self._in_reach(shape, from_m[row], to_m[row])
        some = near.any(axis=1)
        if not some.any():
            return clear
        import shapely

        pieces = np.empty(len(from_m), dtype=object)
        pieces[some] = shapely.linestrings(np.stack([from_m[some], to_m[some]], axis=1))
        for number in range(len(self._shapes)):
            open_question = clear & near[:, number]
            clear[open_question] = ~self._inside(number, pieces[open_question])
        return clear

    def free(self, place_m: FloatArray) -> BoolArray:
        """(n,) whether (n, 2) places [m] are outside of every shape."""
        free = np.ones(len(place_m), dtype=np.bool_)
        near = self._near(place_m, place_m)
        if not near.any():
            return free
        import shapely

        for number in np.flatnonzero(near.any(axis=0)):
            open_question = free & near[:, number]
            points = shapely.points(place_m[open_question])
            free[open_question] = ~self._inside(int(number), points)
        return free

    def way_out_m(self, place_m: FloatArray) -> FloatArray:
        """(2,) the nearest place [m] to a (2,) place inside that is outside of every shape.

        If the straight way there leads through shapes that the place is not in, and another way
        out does not, the nearest such. The margin's round corners are cut into chords here, which
        lie at most 0.01 % of the margin further out. Whoever has nowhere to go stays where it is.
        """
        import shapely

        point = shapely.Point(place_m)
        out: shapely.Geometry = shapely.shortest_line(self._border, point)
        if self._enters(out, point):
            ways = self._ways_out(point)
            out = next((way for way in ways if not self._enters(way, point)), out)
        out_m = shapely.get_coordinates(out)[0]
        return out_m if self.free(out_m[None])[0] else np.array(place_m, dtype=np.float64)

    def _ways_out(self, point: shapely.Geometry) -> list[shapely.Geometry]:
        """Straight ways to every piece of the border of what the place is in, shortest first."""
        import shapely

        holds = shapely.intersects(self._solids_with_margin, point)
        border = shapely.boundary(shapely.union_all(self._solids_with_margin[holds]))
        border = shapely.segmentize(border, max(border.length / _BORDER_PIECES, TOUCH_M))
        others = shapely.union_all(self._solids_with_margin[~holds])
        lines = shapely.get_parts(shapely.difference(border, others))
        corners_m = [shapely.get_coordinates(line) for line in lines]
        ends_m = [np.stack([each[:-1], each[1:]], axis=1) for each in corners_m]
        if not ends_m:
            return []
        pieces = np.asarray(shapely.linestrings(np.concatenate(ends_m)))
        ways = np.asarray(shapely.shortest_line(pieces, point))
        return list(ways[np.argsort(shapely.length(ways), kind="stable")])

    def _enters(self, way: shapely.Geometry, begin: shapely.Geometry) -> bool:
        """Whether ``way`` comes into a shape in which it does not begin."""
        return any(
            bool(self._inside(number, way)) and not bool(self._inside(number, begin))
            for number in range(len(self._shapes))
        )

    @cached_property
    def _solids_with_margin(self) -> npt.NDArray[np.object_]:
        """And a little more."""
        import shapely

        reach_m = (self.margin_m + TOUCH_M) / np.cos(np.pi / (4 * _ROUND_STEPS))
        return np.asarray(shapely.buffer(self._solids, reach_m, quad_segs=_ROUND_STEPS))

    @cached_property
    def _border(self) -> shapely.Geometry:
        """Of all shapes together."""
        import shapely

        return shapely.boundary(shapely.union_all(self._solids_with_margin))

    def _near(self, low_m: FloatArray, high_m: FloatArray) -> BoolArray:
        """(n, shapes) whose bounding boxes meet those from (n, 2) ``low_m`` to ``high_m``."""
        west_m, south_m, east_m, north_m = self._boxes_m.T
        near: BoolArray = (
            (high_m[:, :1] >= west_m)
            & (high_m[:, 1:] >= south_m)
            & (low_m[:, :1] <= east_m)
            & (low_m[:, 1:] <= north_m)
        )
        return near

    def _in_reach(self, shape: IntArray, from_m: FloatArray, to_m: FloatArray) -> BoolArray:
        """(k,) whether pieces come into the circles round (k,) shapes: cheaper than to ask GEOS."""
        piece_m = to_m - from_m
        centre_m = self._circles_m[shape, :2] - from_m
        square_m2 = np.maximum((piece_m * piece_m).sum(axis=1), TOUCH_M * TOUCH_M)
        share = np.clip((centre_m * piece_m).sum(axis=1) / square_m2, 0.0, 1.0)
        apart_m = centre_m - share[:, None] * piece_m
        reach_m = self._circles_m[shape, 2]
        in_reach: BoolArray = (apart_m * apart_m).sum(axis=1) <= reach_m * reach_m
        return in_reach

    def _inside(self, number: int, pieces: npt.NDArray[np.object_] | shapely.Geometry) -> BoolArray:
        import shapely

        shape = self._shapes[number]
        if self._depth_m == 0.0:
            return np.asarray(shapely.intersects(shape, pieces))
        return np.asarray(shapely.dwithin(shape, pieces, self._depth_m))


def _grown(shape: shapely.Polygon, by_m: float) -> shapely.Geometry:
    if by_m == 0.0:
        return shape
    import shapely

    return shapely.buffer(shape, by_m, join_style="mitre")


def _around(shape: shapely.Geometry) -> shapely.MultiPolygon:
    """All the world but ``shape``."""
    import shapely

    world = shapely.box(-_FAR_M, -_FAR_M, _FAR_M, _FAR_M)
    parts = shapely.get_parts(shape)
    shells = [part.exterior for part in parts]
    holes = [shapely.Polygon(hole) for part in parts for hole in part.interiors]
    return shapely.MultiPolygon([shapely.Polygon(world.exterior, shells), *holes])
