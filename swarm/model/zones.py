"""A zone: where not to fly, or the only place where to.

Leaves out: which way round it is shortest (swarm.allocation.legs) and whether a task lies in one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from swarm.model.ids import ZoneId, require_id
from swarm.model.rings import Ring, enclosed, sound_rings

if TYPE_CHECKING:
    import shapely


@dataclass(frozen=True, slots=True)
class Zone:
    """A simple polygon on the map with a range of heights; its border counts as outside.

    Corners go round either way; a last one that repeats the first is dropped.

    Raises:
        ValueError: says which ring is wrong, where and why, or which height.
    """

    id: ZoneId
    polygon_enu_m: Ring
    """Corners [m; east, north of the mission origin]."""
    holes_enu_m: tuple[Ring, ...] = ()
    """Inside of these the zone is not; they touch each other and the border in points at most."""
    floor_m: float | None = None
    """Lowest height [m above the mission origin]; None: from the ground up."""
    ceiling_m: float | None = None
    """Greatest height [m above the mission origin]; None: unlimited."""
    inclusive: bool = False
    """Keeps out of all that is not inside, instead of what is."""

    def __post_init__(self) -> None:
        require_id(self.id, "zone id")
        polygon, holes = sound_rings(self.polygon_enu_m, self.holes_enu_m, f"zone {self.id}")
        object.__setattr__(self, "polygon_enu_m", polygon)
        object.__setattr__(self, "holes_enu_m", holes)
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
        return enclosed(self.polygon_enu_m, self.holes_enu_m)
