"""The ground of a mission: heights on a grid, small enough to be told to every UAV.

Leaves out: where heights come from (swarm.scenario.terrain_files), and how one flies over them
(swarm.allocation.legs.ground).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

STEP_M = 0.1
"""Heights are whole multiples of it above the lowest [m]."""
MOST_STEPS = 2**16 - 1
"""Of a height above the lowest: 6.5 km."""
MOST_HEIGHTS = 2**18
"""On a grid: half a megabyte at most, whatever the ground is like."""
LEEWAY_M = 3.0
"""So much farther than the clearance from the ground is planned [m]: what flies cuts corners by 2 m
at most, and hovers not quite where it was told."""


@dataclass(frozen=True, slots=True)
class Terrain:
    """Heights of the ground on a grid of rows from south to north, each from west to east.

    Between them the ground is bilinear, beyond the edges as high as at the nearest edge.

    Raises:
        ValueError: a number is out of range, or there are no such many heights.
    """

    clearance_m: float
    """No path comes closer to the ground [m]; >= 0."""
    west_m: float
    """Of the first height of each row [m; east of the mission origin]."""
    south_m: float
    """Of the first row [m; north of the mission origin]."""
    east_step_m: float
    """Between two heights of a row [m]; > 0."""
    north_step_m: float
    """Between two rows [m]; > 0."""
    columns: int
    """Heights of a row; two or more."""
    lowest_m: float
    """What all heights are above [m above the mission origin]."""
    steps: bytes = field(repr=False)
    """Row by row, how many `STEP_M` each height is above the lowest: two bytes, the lower first."""
    file: str | None = field(default=None, compare=False)
    """Path of the file that they are from; None where nobody knows it, as in flight."""

    def __post_init__(self) -> None:
        numbers = ("clearance_m", "west_m", "south_m", "east_step_m", "north_step_m", "lowest_m")
        for name in numbers:
            number = getattr(self, name)
            least = {"clearance_m": 0.0, "east_step_m": 1e-3, "north_step_m": 1e-3}.get(name, -1e7)
            if not (math.isfinite(number) and least <= number <= 1e7):
                raise ValueError(f"{name} of the terrain must be >= {least:g}, not {number}")
        count, rest = divmod(len(self.steps), 2)
        if count > MOST_HEIGHTS:
            raise ValueError(f"a terrain has at most {MOST_HEIGHTS} heights, not {count}")
        rows, beside = divmod(count, max(2, self.columns))
        if rest or beside or rows < 2 or self.columns < 2:
            raise ValueError(f"{len(self.steps)} bytes are no rows of {self.columns} heights")

    @property
    def rows(self) -> int:
        """Of heights."""
        return len(self.steps) // 2 // self.columns

    def check_band(self, band_m: tuple[float, float]) -> None:
        """Refuse heights above the ground that come too near to it.

        Raises:
            ValueError: the lowest is less than paths are planned at.
        """
        if band_m[0] < self.planned_m:
            raise ValueError(
                f"band_m must begin at {self.planned_m:g} or higher, not {band_m[0]:g}"
            )

    @property
    def highest_m(self) -> float:
        """The greatest height [m above the mission origin]."""
        import numpy as np  # most missions have no terrain, and commands start without it

        return self.lowest_m + STEP_M * int(np.frombuffer(self.steps, dtype="<u2").max())

    @property
    def planned_m(self) -> float:
        """How far paths stay from the ground as they are planned [m]."""
        return self.clearance_m + LEEWAY_M
