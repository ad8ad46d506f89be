"""Flying over the ground: its heights, paths that keep away from it, and lines that follow it.

Leaves out: which way is shortest on the map (swarm.allocation.legs.planner), and who flies how
high above the ground (swarm.allocation.field.network).
"""

from __future__ import annotations

from functools import lru_cache
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from swarm.kernels.ground import drape_paths, ground_up_m
from swarm.model.terrain import STEP_M, Terrain

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

LINE_ABOVE_M = 1.0
"""How much higher than it is asked for a line may be flown [m]; lower it is nowhere."""

_SAMPLES = 8
"""Places at which a line is looked at between two lines of the grid, besides where it crosses."""
_SOON_M = 3.0
"""A line has a corner so soon after its ends [m]: PX4 climbs to the first of a mission, then flies.
"""
_BETWEEN_M = 0.05
"""What the ground may rise between them, and is allowed for [m]."""


class Ground:
    """The ground of one mission.

    Args:
        terrain: its heights.
    """

    def __init__(self, terrain: Terrain) -> None:
        steps = np.frombuffer(terrain.steps, dtype="<u2").reshape(-1, terrain.columns)
        self.terrain = terrain
        """Whose heights these are."""
        self._up_m: FloatArray = terrain.lowest_m + steps * STEP_M
        self._frame_m = np.array(
            [terrain.west_m, terrain.south_m, terrain.east_step_m, terrain.north_step_m]
        )

    def up_m(self, place_m: FloatArray) -> FloatArray:
        """(n,) heights of the ground at (n, 2) places [m above the mission origin]."""
        return ground_up_m(self._up_m, self._frame_m, place_m)

    def one_up_m(self, east_m: float, north_m: float) -> float:
        """Height of the ground at one place [m above the mission origin]."""
        return float(self.up_m(np.array([[east_m, north_m]]))[0])

    def range_m(self, west_m: float, south_m: float, east_m: float, north_m: float) -> FloatArray:
        """(2,) lowest and greatest height of the ground within a box [m]."""
        low, high = (
            (np.array(corner) - self._frame_m[:2]) / self._frame_m[2:]
            for corner in ((west_m, south_m), (east_m, north_m))
        )
        last = np.array(self._up_m.shape[::-1]) - 1
        begin = np.clip(np.floor(low), 0, last).astype(int)
        end = np.clip(np.ceil(high), 0, last).astype(int) + 1
        inside_m = self._up_m[begin[1] : end[1], begin[0] : end[0]]
        return np.array([inside_m.min(), inside_m.max()])

    def draped(
        self, place_m: FloatArray, first: IntArray, ends_up_m: FloatArray, room_m: FloatArray
    ) -> tuple[FloatArray, IntArray]:
        """Shortest paths over the ground along horizontal ones; see `drape_paths`."""
        return drape_paths(self._up_m, self._frame_m, place_m, first, ends_up_m, room_m)

    def over_m(
        self, place_m: FloatArray, ends_up_m: tuple[float, float], room_m: tuple[float, float]
    ) -> FloatArray:
        """(m, 3) corners [m; ENU] of one such path along (n, 2) places [m]."""
        first = np.array([0, len(place_m)])
        return self.draped(place_m, first, np.array([ends_up_m]), np.array([room_m]))[0]

    def along_m(self, points_m: FloatArray) -> FloatArray:
        """(m, 3) corners of a chain [m; ENU] that follows the ground along (n, 2) points [m].

        It is nowhere below the ground, and `LINE_ABOVE_M` above at most. From the last point to
        the first it is the same, the other way round.
        """
        corners = [self._piece_m(*ends) for ends in pairwise(points_m)]
        for before, after in pairwise(corners):
            after[0, 2] = before[-1, 2] = max(after[0, 2], before[-1, 2])
        chain_m = np.concatenate([corners[0][:1], *(piece[1:] for piece in corners)])
        return _with_room(chain_m)

    def _piece_m(self, begin_m: FloatArray, end_m: FloatArray) -> FloatArray:
        if (end_m < begin_m).any() and tuple(end_m) < tuple(begin_m):
            return self._piece_m(end_m, begin_m)[::-1].copy()
        length_m = float(np.hypot(*(end_m - begin_m)))
        share = self._shares(begin_m, end_m)
        flat_m = begin_m + share[:, None] * (end_m - begin_m)
        flat_m[-1] = end_m
        up_m = self.up_m(np.ascontiguousarray(flat_m)) + _BETWEEN_M
        kept = _straightened(share * length_m, up_m, LINE_ABOVE_M / 2.0 - _BETWEEN_M)
        chord_m = np.interp(share, share[kept], up_m[kept])
        lacks_m = np.maximum.reduceat(up_m - chord_m, kept[:-1])
        lift_m = np.maximum(np.append(lacks_m, 0.0), np.insert(lacks_m, 0, 0.0))
        return np.column_stack([flat_m[kept], up_m[kept] + np.maximum(0.0, lift_m)])

    def _shares(self, begin_m: FloatArray, end_m: FloatArray) -> FloatArray:
        """Of a straight piece, where it crosses lines of the grid, and places in between."""
        low, high = ((each - self._frame_m[:2]) / self._frame_m[2:] for each in (begin_m, end_m))
        count = 2 + int(_SAMPLES * min(np.abs(high - low).max(), sum(self._up_m.shape)))
        shares = [np.linspace(0.0, 1.0, count)]
        for axis, last in enumerate(self._up_m.shape[::-1]):
            first, by = low[axis], high[axis] - low[axis]
            lines = np.arange(
                max(0.0, np.ceil(min(first, first + by))),
                min(last - 1.0, np.floor(max(first, first + by))) + 1.0,
            )
            if by != 0.0:
                shares.append(np.clip((lines - first) / by, 0.0, 1.0))
        return np.unique(np.concatenate(shares))


def _with_room(chain_m: FloatArray) -> FloatArray:
    """A chain with two more corners, soon after the first and soon before the last."""
    most = 0.5 if len(chain_m) > 2 else 1.0 / 3.0
    begin_m = _soon_m(chain_m[0], chain_m[1], most)
    end_m = _soon_m(chain_m[-1], chain_m[-2], most)
    return np.concatenate([chain_m[:1], begin_m, chain_m[1:-1], end_m, chain_m[-1:]])


def _soon_m(here_m: FloatArray, there_m: FloatArray, most: float) -> FloatArray:
    """The place soon after one on a piece, of which it is that share at most; else none."""
    step_m = there_m - here_m
    share = _SOON_M / max(float(np.hypot(*step_m[:2])), _SOON_M)
    return np.empty((0, 3)) if share > most else (here_m + share * step_m)[None]


def _straightened(along_m: FloatArray, up_m: FloatArray, most_m: float) -> IntArray:
    """(k,) which of (n,) heights to keep, so that chords between these miss none by more [m].

    By Douglas and Peucker, https://doi.org/10.3138/FM57-6770-U75U-7727, with vertical distances.
    """
    kept = {0, len(up_m) - 1}
    spans = [(0, len(up_m) - 1)]
    while spans:
        begin, end = spans.pop()
        span = slice(begin, end + 1)
        chord_m = np.interp(along_m[span], along_m[[begin, end]], up_m[[begin, end]])
        off_m = np.abs(up_m[span] - chord_m)
        worst = begin + int(off_m.argmax())
        if begin < worst < end and off_m.max() > most_m:
            kept.add(worst)
            spans += [(begin, worst), (worst, end)]
    return np.array(sorted(kept))


@lru_cache(maxsize=8)
def ground_of(terrain: Terrain) -> Ground:
    """The ground with those heights, made once."""
    return Ground(terrain)
