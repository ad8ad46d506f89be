"""An area to fly over in lines, and how these are asked for.

Leaves out: which lines these are (swarm.survey).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from swarm.model.cameras import Camera
from swarm.model.ids import AreaId, TaskId, require_id
from swarm.model.rings import Ring, enclosed, sound_rings

if TYPE_CHECKING:
    import shapely


@dataclass(frozen=True, slots=True)
class Area:
    """A simple polygon on the map to be covered by lines, each a task of its mission.

    Either ``spacing_m`` says how far apart lines are, or a camera does with a height and overlaps.

    Raises:
        ValueError: an id, ring, value, length, share or time is out of range, or what says how far
            apart lines are is missing or there twice.
    """

    id: AreaId
    polygon_enu_m: Ring
    """Corners [m; east, north of the mission origin]."""
    value: float
    """m_i of eq. 1 of all lines together, shared out by length; >= 0."""
    holes_enu_m: tuple[Ring, ...] = ()
    """Inside of these nothing is to be covered; one may fly there."""
    spacing_m: float | None = None
    """Between neighbouring lines [m]; > 0."""
    trigger_m: float | None = None
    """How far apart pictures are taken along a line [m]; > 0; with ``spacing_m`` only."""
    camera: Camera | None = None
    """In the place of ``spacing_m``, with ``height_m``, ``sidelap_frac`` and ``frontlap_frac``."""
    height_m: float | None = None
    """Where lines are flown [m above the origin]; None: in the UAV's own layer."""
    sidelap_frac: float | None = None
    """Share of a picture that is on those of the next line, too; within 0..1, 1 left out."""
    frontlap_frac: float | None = None
    """Share of a picture that is on the next one of its line, too; within 0..1, 1 left out."""
    heading_deg: float | None = None
    """Of the lines, clockwise from north [deg]; None: the direction with the fewest turns."""
    max_line_m: float | None = None
    """Longer lines are cut into equal parts, so that UAVs can share them [m]; None: none is."""
    kind: str | None = None
    """Of every line, as all that follows."""
    service_s: float = 0.0
    due_s: float | None = None
    opens_s: float = 0.0
    closes_s: float | None = None
    appears_s: float = 0.0
    lines: int = 0
    """How many there are; 0 as long as it has not been cut."""

    def __post_init__(self) -> None:
        require_id(self.id, "area id")
        polygon, holes = sound_rings(self.polygon_enu_m, self.holes_enu_m, f"area {self.id}")
        object.__setattr__(self, "polygon_enu_m", polygon)
        object.__setattr__(self, "holes_enu_m", holes)
        for name in ("spacing_m", "trigger_m", "max_line_m"):
            number = getattr(self, name)
            if number is not None and not (math.isfinite(number) and number > 0.0):
                raise ValueError(f"{name} of area {self.id} must be > 0, not {number}")
        for name in ("value", "service_s", "due_s", "opens_s", "closes_s", "appears_s", "lines"):
            number = getattr(self, name)
            if number is not None and not (math.isfinite(number) and number >= 0.0):
                raise ValueError(f"{name} of area {self.id} must be >= 0, not {number}")
        for name in ("height_m", "heading_deg"):
            number = getattr(self, name)
            if number is not None and not math.isfinite(number):
                raise ValueError(f"{name} of area {self.id} must be finite, not {number}")
        self._require_one_spacing()

    def _require_one_spacing(self) -> None:
        of_camera = (self.camera, self.sidelap_frac, self.frontlap_frac)
        if self.spacing_m is not None:
            if any(each is not None for each in of_camera):
                raise ValueError(f"area {self.id} has both spacing_m and a camera or overlaps")
            return
        if self.trigger_m is not None:
            raise ValueError(f"trigger_m of area {self.id} goes with spacing_m")
        if self.camera is None or self.height_m is None or self.height_m <= 0.0:
            raise ValueError(f"area {self.id} needs spacing_m, or a camera and a height_m > 0")
        for name in ("sidelap_frac", "frontlap_frac"):
            share = getattr(self, name)
            if share is None or not 0.0 <= share < 1.0:
                raise ValueError(f"{name} of area {self.id} must be within 0..1, not {share}")

    @property
    def apart_m(self) -> float:
        """Between neighbouring lines at most [m]: as asked for, or by footprint and sidelap."""
        if self.spacing_m is not None:
            return self.spacing_m
        return self._footprint_m[0] * (1.0 - (self.sidelap_frac or 0.0))

    @property
    def picture_m(self) -> float | None:
        """Between pictures of a line [m]: as asked for, or by footprint and frontlap."""
        if self.camera is None:
            return self.trigger_m
        return self._footprint_m[1] * (1.0 - (self.frontlap_frac or 0.0))

    @property
    def _footprint_m(self) -> tuple[float, float]:
        if self.camera is None or self.height_m is None:
            raise ValueError(f"area {self.id} has no camera")
        return self.camera.footprint_m(self.height_m)

    @property
    def line_ids(self) -> tuple[TaskId, ...]:
        """Ids of its lines."""
        return self.ids_of(self.lines)

    def ids_of(self, lines: int) -> tuple[TaskId, ...]:
        """Of so many lines: the area's own with a number, from -01 on."""
        digits = max(2, len(str(lines)))
        return tuple(TaskId(f"{self.id}-{n:0{digits}d}") for n in range(1, lines + 1))

    def shape(self) -> shapely.Polygon:
        """What is to be covered, whether one may fly there or not."""
        return enclosed(self.polygon_enu_m, self.holes_enu_m)
