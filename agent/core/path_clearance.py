"""Ways round zones with room to spare, for vehicles that do not fly quite where they are told.

Decisions reckon with the shortest ways, which touch the margin of zones at their corners. What
flies in the wind and cuts its corners is led past farther out, where there is room for that;
where there is less, less far. Lines are flown as they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from swarm.model import Zone
from swarm.protocol.fields import Point

if TYPE_CHECKING:
    from swarm.allocation.legs import PathPlanner

FloatArray = npt.NDArray[np.float64]

PATH_CLEARANCE_M = 3.0
"""How much farther than their margin vehicles are led past zones [m]: they cut
corners by 2 m at most."""

_SHARES = (1.0, 0.5, 0.25)
"""Of the clearance, tried one after the other."""

_LONGER, _LONGER_CLEARANCES = 1.05, 6.0
"""A way may become so many times as long, and by so many clearances: energy was reckoned with the
shortest."""

_SLACK = 1.0 / 3.0
"""Of the clearance, by which round corners may be flown straighter."""


class PathClearance:
    """Finds such ways.

    Args:
        zones: to keep out of, whatever their heights.
        margin_m: distance to keep from them in any case [m].
        clearance_m: to keep beyond that where there is room [m].
    """

    def __init__(self, zones: Sequence[Zone], margin_m: float, clearance_m: float) -> None:
        from swarm.allocation.legs import Airspace  # plain missions start sooner without

        self._true = Airspace(zones, margin_m)
        self._wider = [
            (share * clearance_m, Airspace(zones, margin_m + share * clearance_m))
            for share in _SHARES
        ]

    def widened(self, way_enu_m: Sequence[Point]) -> tuple[Point, ...]:
        """A way with the same ends that keeps farther away; the same where there is none.

        Args:
            way_enu_m: from where the vehicle is, corner by corner, heights as flown [m].
        """
        way = np.array(way_enu_m, dtype=np.float64)
        low_m, high_m = float(way[:, 2].min()), float(way[:, 2].max())
        true = self._true.concerning(low_m, high_m)
        for clearance_m, airspace in self._wider:
            planner = airspace.concerning(low_m, high_m)
            if planner.clear(way[:-1, :2], way[1:, :2]).all():
                break
            flat_m = _path_m(planner, true, way[0, :2], way[-1, :2], clearance_m)
            longest_m = _LONGER * _length_m(way[:, :2]) + _LONGER_CLEARANCES * clearance_m
            if flat_m is not None and _length_m(flat_m) <= longest_m:
                return _at_heights(flat_m, float(way[0, 2]), float(way[-1, 2]))
        return tuple(way_enu_m)


def _path_m(
    planner: PathPlanner,
    true: PathPlanner,
    begin_m: FloatArray,
    end_m: FloatArray,
    clearance_m: float,
) -> FloatArray | None:
    """(k, 2) corners [m] of such a path; None: it would come too near, or there is none."""
    import shapely

    ahead_m, stayed = planner.way_out_m(end_m[None])
    path_m = planner.path_m(begin_m, ahead_m[0])
    if path_m is None:
        return None
    if not stayed[0]:
        path_m = np.concatenate([path_m, end_m[None]])
    leaves = int(not true.free(begin_m[None])[0])
    for slack_m in (_SLACK * clearance_m, 0.0):
        line = shapely.simplify(shapely.LineString(path_m), slack_m)
        flat_m = shapely.get_coordinates(line)
        if true.clear(flat_m[leaves:-1], flat_m[leaves + 1 :]).all():
            return flat_m
    return None


def _length_m(flat_m: FloatArray) -> float:
    return float(np.hypot(*np.diff(flat_m, axis=0).T).sum())


def _at_heights(flat_m: FloatArray, first_m: float, last_m: float) -> tuple[Point, ...]:
    """The path with its height gained evenly on the way."""
    piece_m = np.hypot(*np.diff(flat_m, axis=0).T)
    along_m = np.concatenate([[0.0], np.cumsum(piece_m)])
    share = along_m / along_m[-1] if along_m[-1] > 0.0 else np.ones(len(along_m))
    up_m = first_m + share * (last_m - first_m)
    up_m[-1] = last_m
    return tuple(
        (float(east), float(north), float(up))
        for (east, north), up in zip(flat_m, up_m, strict=True)
    )
