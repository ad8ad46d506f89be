"""How much of an area lines cover: what is nearer to one than half of what lies between them.

A metre more counts as well, since nobody flies truer than that.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Sequence
from typing import TYPE_CHECKING

from swarm.model import Area, Task, TaskId, Zone
from swarm.survey.ground import to_cover

if TYPE_CHECKING:
    import shapely

OFF_M = 1.0
"""How far beside its line a UAV may fly [m]."""
_ROUND_STEPS = 16
"""Chords per quarter of a circle round the ends of lines."""


def reach_m(area: Area) -> float:
    """How far beside a line the ground counts as covered [m]."""
    return area.apart_m / 2.0 + OFF_M


def covered(area: Area, lines: Iterable[Task]) -> shapely.Geometry:
    """The ground that ``lines`` cover, whether it is to be covered or not [m; east, north]."""
    import shapely

    paths = [[point[:2] for point in line.path_enu_m] for line in lines]
    drawn = [shapely.LineString(path) for path in paths]
    wide_m = reach_m(area) / math.cos(math.pi / (4 * _ROUND_STEPS))
    return shapely.union_all(shapely.buffer(drawn, wide_m, quad_segs=_ROUND_STEPS))


class AreaCoverage:
    """What of one area sets of its lines cover.

    Args:
        area: cut into lines.
        tasks: of the mission; those that are its lines are looked up by their ids.
        zones: with their margin [m] they are nothing to cover.
    """

    def __init__(
        self, area: Area, tasks: Iterable[Task], zones: Sequence[Zone], margin_m: float
    ) -> None:
        names = set(area.line_ids)
        self.area = area
        self.lines = {task.id: task for task in tasks if task.id in names}
        """Those lines that there are, by id."""
        self.to_cover = to_cover(area, zones, margin_m)
        """What is to be covered [m; east, north]."""

    @property
    def to_cover_m2(self) -> float:
        """How large that is [m²]."""
        import shapely

        return float(shapely.area(self.to_cover))

    def share(self, flown: Collection[TaskId]) -> float:
        """How much of what is to be covered those of the ``flown`` tasks cover; within 0..1.

        All of it where zones leave nothing.
        """
        import shapely

        whole_m2 = self.to_cover_m2
        if whole_m2 == 0.0:
            return 1.0
        names = set(flown)
        lines = [line for name, line in self.lines.items() if name in names]
        met = shapely.intersection(self.to_cover, covered(self.area, lines))
        return min(1.0, float(shapely.area(met)) / whole_m2)
