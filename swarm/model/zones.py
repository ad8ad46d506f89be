"""A zone: where not to fly, or the only place where to.

Leaves out: which way round it is shortest (swarm.allocation.legs) and whether a task lies in one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

from swarm.model.ids import ZoneId, require_id

if TYPE_CHECKING:
    import shapely

Corner = tuple[float, float]
"""East and north [m; mission origin]."""

_LEAST_CORNERS = 3
_FAULTS = (
    ("Hole lies outside shell", "a hole lies outside the polygon"),
    ("Nested holes", "a hole lies in another"),
    ("Holes are nested", "a hole lies in another"),
    ("Duplicate Rings", "a hole is there twice"),
    ("Interior is disconnected", "holes cut the polygon into pieces: make a zone of each"),
    ("Self-intersection", "a hole crosses the polygon's border or another hole"),
)
"""GEOS's beginnings of reasons, and ours."""


@dataclass(frozen=True, slots=True)
class Zone:
    """A simple polygon on the map with a range of heights; its border counts as outside.

    Corners go round either way; a last one that repeats the first is dropped.

    Raises:
        ValueError: says which ring is wrong, where and why, or which height.
    """

    id: ZoneId
    polygon_enu_m: tuple[Corner, ...]
    """Corners [m; east, north of the mission origin]."""
    holes_enu_m: tuple[tuple[Corner, ...], ...] = ()
    """Inside of these the zone is not; they touch each other and the border in points at most."""
    floor_m: float | None = None
    """Lowest height [m above the mission origin]; None: from the ground up."""
    ceiling_m: float | None = None
    """Greatest height [m above the mission origin]; None: unlimited."""
    inclusive: bool = False
    """Keeps out of all that is not inside, instead of what is."""

    def __post_init__(self) -> None:
        require_id(self.id, "zone id")
        polygon = _ring(self.polygon_enu_m, f"polygon of zone {self.id}")
        holes = tuple(
            _ring(hole, f"hole {number} of zone {self.id}")
            for number, hole in enumerate(self.holes_enu_m, start=1)
        )
        object.__setattr__(self, "polygon_enu_m", polygon)
        object.__setattr__(self, "holes_enu_m", holes)
        if holes:
            self._require_holes_inside()
        for name in ("floor_m", "ceiling_m"):
            height_m = getattr(self, name)
            if height_m is not None and not math.isfinite(height_m):
                raise ValueError(f"{name} of zone {self.id} must be finite, not {height_m}")
        if self.bottom_m >= self.top_m:
            raise ValueError(
                f"ceiling_m of zone {self.id} must be above its floor_m of {self.floor_m}, "
                f"not {self.ceiling_m}"
            )

    @property
    def bottom_m(self) -> float:
        """Lowest height as a number: minus infinity from the ground up [m above the origin]."""
        return -math.inf if self.floor_m is None else self.floor_m

    @property
    def top_m(self) -> float:
        """Greatest height as a number: infinity if unlimited [m above the origin]."""
        return math.inf if self.ceiling_m is None else self.ceiling_m

    def concerns(self, low_m: float, high_m: float) -> bool:
        """Whether who uses heights from ``low_m`` to ``high_m`` [m above the origin] must heed it.

        Floor and ceiling are borders and count as outside, as all borders.
        """
        return low_m < self.top_m and high_m > self.bottom_m

    def shape(self) -> shapely.Polygon:
        """What the rings enclose, whether one may fly there or not."""
        import shapely  # only where there are zones: it takes longer than all of swarm.model

        return shapely.Polygon(self.polygon_enu_m, self.holes_enu_m)

    def _require_holes_inside(self) -> None:
        import shapely

        reason = shapely.is_valid_reason(self.shape())
        if reason == "Valid Geometry":
            return
        fault, _, place = reason.partition("[")
        words = next((ours for theirs, ours in _FAULTS if fault.startswith(theirs)), fault)
        near = f" near ({', '.join(place.rstrip(']').split())})" if place else ""
        raise ValueError(f"holes of zone {self.id}: {words}{near}")


def _ring(corners: Sequence[Sequence[float]], what: str) -> tuple[Corner, ...]:
    """``corners`` as a simple ring, the first not repeated, or a ``ValueError`` about ``what``."""
    ring: list[Corner] = []
    for number, corner in enumerate(corners, start=1):
        if len(corner) != 2 or not all(math.isfinite(number) for number in corner):
            raise ValueError(
                f"{what}: corner {number} must be two finite numbers [m], not {tuple(corner)}"
            )
        ring.append((float(corner[0]), float(corner[1])))
    if len(ring) > 1 and ring[0] == ring[-1]:
        ring.pop()
    if len(ring) < _LEAST_CORNERS:
        raise ValueError(f"{what} must have at least three corners, not {len(ring)}")
    for number, (before, corner) in enumerate(pairwise(ring), start=2):
        if before == corner:
            raise ValueError(f"{what}: corner {number} repeats the one before it, {corner}")
    _require_simple(ring, what)
    return tuple(ring)


def _require_simple(ring: list[Corner], what: str) -> None:
    import shapely

    if shapely.Polygon(ring).area == 0.0:
        raise ValueError(f"{what} encloses nothing: {ring}")
    if not shapely.LinearRing(ring).is_simple:
        reason = shapely.is_valid_reason(shapely.Polygon(ring))
        place = reason.partition("[")[2].rstrip("]").split()
        near = f" near ({', '.join(place)})" if place else ""
        raise ValueError(f"{what} crosses or touches itself{near}")
