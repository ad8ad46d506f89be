"""Height layers that a fleet shares, and the slabs into which the air is cut.

A slab reaches half-way to the neighbouring layers; the lowest and the highest have no end. Over
hills, where a layer is as high above the ground and so not level, slabs are so thin that what is a
layer apart touches none in common. Two paths that come closer than the separation anywhere are both
within half of it from one slab at least, so whoever keeps the paths of each slab apart, as seen
from above, keeps all apart. Between level layers that holds for the separation and a metre: both
may be wrong by one, and it is kept but for one error of a place.
"""

from __future__ import annotations

import itertools
import math
from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from swarm.kernels.paths import paths_apart

FloatArray = npt.NDArray[np.float64]
Path = npt.NDArray[np.float64]
"""(k, 3) corners of what a UAV flies [m; east, north, up from the mission origin]; one: it
hovers."""

SEATS = 3
"""Keepers of a stack where not each UAV has air of its own; two of them grant."""
POSITION_ERROR_M = 1.0
"""By which a UAV may be elsewhere, or higher or lower, than it takes itself to be [m]."""
_ROUNDED_M = 1e-6
"""What is forgiven of a distance that was planned to be just as large as asked."""
_MOST_SLABS = 256
"""Over ground whose heights differ more, slabs are thicker."""


def planned_apart_m(separation_m: float) -> float:
    """How far from each other ways are planned, beside and above each other [m].

    Both UAVs may be wrong about where they are. And who gives way in the air keeps a metre more
    than the separation (swarm.separation.tactical_traffic): it would act all the time on ways
    that are no farther apart than that.
    """
    return separation_m + 2.0 * POSITION_ERROR_M


def shared_layers_m(
    separation_m: float, n_uav: int, band_m: tuple[float, float] | None, lowest_m: float
) -> tuple[float, ...]:
    """Heights that a fleet shares, lowest first [m above the places that are visited].

    Args:
        separation_m: smallest distance of two UAVs [m]; > 0.
        n_uav: how many there are; without a band each finds a layer of its own.
        band_m: lowest and greatest height [m]; None: from ``lowest_m`` up.
        lowest_m: height of the lowest layer where there is no band [m].
    """
    spacing_m = planned_apart_m(separation_m)
    if band_m is None:
        return tuple(lowest_m + index * spacing_m for index in range(n_uav))
    low_m, high_m = band_m
    # A band of exactly so many layers has room for the last one, whatever is rounded.
    count = 1 + math.floor((high_m - low_m) / spacing_m + 1e-9)
    return tuple(low_m + index * spacing_m for index in range(count))


@dataclass(frozen=True, slots=True)
class Slabs:
    """The air, cut at heights.

    Raises:
        ValueError: layers do not grow by `planned_apart_m` at least, or there are none, or cuts do
            not grow.
    """

    separation_m: float
    """Smallest distance of two UAVs [m]."""
    layers_m: tuple[float, ...]
    """Heights of the layers above the places that are visited [m]."""
    cuts_m: tuple[float, ...]
    """Where one slab ends and the next begins, lowest first [m above the mission origin]."""
    level: bool = True
    """Whether layers are level, so that each has a slab of its own."""
    cut_array_m: FloatArray = field(init=False, repr=False, compare=False)
    """The cuts as kernels take them."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "cut_array_m", np.array(self.cuts_m, dtype=np.float64))
        gaps_m = np.diff(self.layers_m)
        least_m = planned_apart_m(self.separation_m) - _ROUNDED_M
        if not self.layers_m or (gaps_m < least_m).any():
            raise ValueError(f"layers {self.layers_m} are nearer than {least_m:g} m")
        if (np.diff(self.cuts_m) <= 0.0).any():
            raise ValueError(f"cuts {self.cuts_m} do not grow")

    @classmethod
    def between(cls, separation_m: float, layers_m: tuple[float, ...]) -> Slabs:
        """Of a mission whose places are all about as high as its origin: one round each layer."""
        cuts_m = tuple(0.5 * (low_m + high_m) for low_m, high_m in itertools.pairwise(layers_m))
        return cls(separation_m, layers_m, cuts_m)

    @classmethod
    def over(
        cls, separation_m: float, layers_m: tuple[float, ...], ground_m: tuple[float, float]
    ) -> Slabs:
        """Over ground of such heights [m above the mission origin], the lowest and the greatest.

        Two who are level and a layer apart are both near no slab as thin as what layers are farther
        apart than the separation.
        """
        low_m, high_m = ground_m[0] + layers_m[0], ground_m[1] + layers_m[-1]
        thin_m = planned_apart_m(separation_m) - separation_m
        count = max(2, min(_MOST_SLABS, math.ceil((high_m - low_m) / thin_m)))
        thick_m = max(thin_m, (high_m - low_m) / count)
        cuts_m = tuple(low_m + each * thick_m for each in range(1, count))
        return cls(separation_m, layers_m, cuts_m, level=False)

    def __len__(self) -> int:
        return len(self.cuts_m) + 1

    @property
    def stacks(self) -> tuple[frozenset[int], ...]:
        """Neighbouring slabs that the same UAVs keep: as many stacks as layers."""
        count = min(len(self.layers_m), len(self))
        ends = [stack * len(self) // count for stack in range(count + 1)]
        return tuple(frozenset(range(low, high)) for low, high in itertools.pairwise(ends))

    @property
    def near_m(self) -> float:
        """Who is no farther than that from a slab may meet somebody in it [m].

        Half of the separation, and as much more for errors of places as lets level flight, half
        a metre too high or too low, still touch the slab of its layer alone.
        """
        return 0.5 * (self.separation_m + (POSITION_ERROR_M if self.level else 0.0))

    def reach_m(self, slab: int) -> tuple[float, float]:
        """Heights from which one may come too near to somebody in ``slab`` [m]."""
        near_m = self.near_m
        low_m = self.cuts_m[slab - 1] - near_m if slab > 0 else -math.inf
        high_m = self.cuts_m[slab] + near_m if slab < len(self.cuts_m) else math.inf
        return low_m, high_m

    def touched(self, path_enu_m: Path) -> frozenset[int]:
        """Slabs in whose reach any of ``path_enu_m`` is."""
        if not len(path_enu_m):
            return frozenset()
        lowest_m, highest_m = float(path_enu_m[:, 2].min()), float(path_enu_m[:, 2].max())
        near_m = self.near_m
        first = bisect_right(self.cuts_m, lowest_m, key=lambda cut_m: cut_m + near_m)
        last = bisect_left(self.cuts_m, highest_m, key=lambda cut_m: cut_m - near_m)
        return frozenset(range(first, last + 1))

    def asked(self, path_enu_m: Path, *, grounded: bool = False) -> frozenset[int]:
        """Slabs whose keepers are to be asked before ``path_enu_m`` is flown.

        All that it touches, but for the one that a UAV leaves straight up or down from where it
        hovers: the whole height of that slab above and below it is its own already.

        Args:
            path_enu_m: (k, 3) from where it is on [m].
            grounded: it stands on the ground, and so has no air of its own yet.
        """
        return _asked(self, path_enu_m.tobytes(), grounded=grounded)


@lru_cache(maxsize=1024)
def _asked(slabs: Slabs, path: bytes, *, grounded: bool) -> frozenset[int]:
    """`Slabs.asked`, of a path as bytes: the same ones are looked at again with every word."""
    path_enu_m = np.frombuffer(path).reshape(-1, 3)
    touched = slabs.touched(path_enu_m)
    if grounded or len(path_enu_m) < 2 or not is_upright(path_enu_m[:2]):
        return touched if len(path_enu_m) > 1 or grounded else frozenset()
    return slabs.touched(path_enu_m[1:]) | (touched - slabs.touched(path_enu_m[:1]))


def is_upright(path_enu_m: Path) -> bool:
    """Whether all of it is above one place."""
    offset_m = path_enu_m[:, :2] - path_enu_m[:1, :2]
    return bool((np.abs(offset_m) < 1e-6).all())


def apart(
    slabs: Slabs, one_enu_m: Path, other_enu_m: Path, within: frozenset[int] | None = None
) -> bool:
    """Whether two paths stay apart, whenever and however fast either is flown.

    Args:
        slabs: the air.
        one_enu_m: (k, 3) corners [m].
        other_enu_m: (l, 3) corners [m].
        within: slabs that matter; None: all.
    """
    asked_m = planned_apart_m(slabs.separation_m) - _ROUNDED_M
    return paths_apart(slabs.cut_array_m, slabs.near_m, asked_m, one_enu_m, other_enu_m, within)


def start_layers(
    slabs: Slabs, starts_enu_m: Sequence[tuple[float, float, float]], preferred: Sequence[int]
) -> tuple[int, ...] | None:
    """In which layer each UAV is airborne at mission time 0, all of them apart.

    The first that is free, from the preferred one up and round; None: there are too few.

    Args:
        slabs: the air.
        starts_enu_m: where they start, without a layer [m].
        preferred: layer that suits each best.
    """
    chosen: list[int] = []
    paths: list[Path] = []
    for (east_m, north_m, up_m), first in zip(starts_enu_m, preferred, strict=True):
        for step in range(len(slabs.layers_m)):
            layer = (first + step) % len(slabs.layers_m)
            path = np.array([[east_m, north_m, up_m + slabs.layers_m[layer]]])
            if all(apart(slabs, path, other) for other in paths):
                chosen.append(layer)
                paths.append(path)
                break
        else:
            return None
    return tuple(chosen)


def keeper_rows(n_slab: int, n_uav: int) -> tuple[int, ...]:
    """By slab, the UAV that keeps it first; neighbouring slabs where one keeps several."""
    if n_uav >= n_slab:
        return tuple(range(n_slab))
    return tuple(slab * n_uav // n_slab for slab in range(n_slab))


def keeper_seats(n_stack: int, n_uav: int, *, level: bool = True) -> tuple[tuple[int, ...], ...]:
    """By stack, the UAVs that keep it together first.

    Three, or one where each can have air of its own: over hills no way stays in one stack.
    """
    rows = keeper_rows(n_stack, n_uav)
    if (level and n_uav <= n_stack) or n_uav < SEATS:
        return tuple((row,) for row in rows)
    apart = n_uav // SEATS
    return tuple(tuple((row + seat * apart) % n_uav for seat in range(SEATS)) for row in rows)
