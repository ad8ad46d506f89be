"""Complex items of QGroundControl's plans as what they are meant for: areas to cover and lines.

A survey becomes an area with its angle, spacing and trigger distance, or with its camera and
overlaps; a corridor scan lines side by side along its middle; a structure scan one closed line
round the structure for each layer. Where an item lacks what this takes, None is returned and its
stored waypoints are left to be read instead.

Format: https://docs.qgroundcontrol.com/master/en/qgc-dev-guide/file_formats/plan.html. In its
CameraCalc AdjustedFootprintSide is the distance between lines and AdjustedFootprintFrontal the one
between pictures, in a structure scan the other way round, as pictures are upright there.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum

from swarm.model import Origin
from swarm.model.frames import enu_from_wgs84, wgs84_from_enu
from swarm.runtime.errors import Fault
from swarm.scenario.findings import number_of
from swarm.scenario.task_files.mission_items import Heights, above_ground, whole_of
from swarm.scenario.task_files.task_file import Array, FileEntry, member, too_many_points
from swarm.survey.structures import STRUCTURE_KIND

TRANSECTS = "TransectStyleComplexItem"
_PREFIXES = {"survey": "survey", "CorridorScan": "corridor", "StructureScan": "structure"}
_MOST_LINES = 100
"""A corridor or structure of more lines than that is refused."""
_MOST_CORNERS = 50_000
"""So is a corridor with more corners, those of all its lines counted."""
_CAMERA = {
    "sensor_width_mm": "SensorWidth",
    "sensor_height_mm": "SensorHeight",
    "focal_length_mm": "FocalLength",
    "image_width_px": "ImageWidth",
    "image_height_px": "ImageHeight",
}
"""Keys of a camera, and what QGroundControl calls them."""
_LEAST_SPACING_M = 0.5
"""With less QGroundControl flies one line, whatever the width [m]."""
_FARTHEST_M = 1e4
"""From a structure, and greatest width of a corridor [m]."""
_GIVE = "save the plan again in QGroundControl"


class _CountedFrom(IntEnum):
    """What DistanceToSurface is measured from: QGroundControl's AltitudeMode."""

    HOME = 1
    SEA = 2
    GROUND = 3
    GROUND_BY_AUTOPILOT = 4


@dataclass(slots=True)
class PatternReader:
    """Makes entries of complex items, one after the other."""

    source: str
    heights: Heights
    left_out: Counter[str] = field(default_factory=Counter)
    """What of them is not heeded."""
    notes: list[str] = field(default_factory=list)

    def entries(self, place: str, item: object) -> Sequence[FileEntry | Fault] | None:
        """What a complex item becomes; None if it lacks what that takes."""
        match member(item, "complexItemType"):
            case "survey":
                found = self._survey(place, item)
            case "CorridorScan":
                found = self._corridor(place, item)
            case "StructureScan":
                found = self._structure(place, item)
            case _:
                return None
        return found

    def _survey(self, place: str, item: object) -> Sequence[FileEntry | Fault] | None:
        polygon = _points_deg(member(item, "polygon"), least=3)
        camera = member(item, TRANSECTS, "CameraCalc")
        spacing_m = number_of(member(camera, "AdjustedFootprintSide"))
        height_m = self._height_m(camera, place)
        if polygon is None or spacing_m is None or spacing_m <= 0.0 or height_m is None:
            return None
        if isinstance(height_m, Fault):
            return [height_m]
        if (fault := too_many_points(polygon, self.source, place)) is not None:
            return [fault]
        table: dict[str, object] = {
            "polygon": [list(corner) for corner in polygon],
            "height_m": height_m,
            **(_camera_of(camera, height_m) or _distances_of(camera, spacing_m)),
        }
        angle_deg = number_of(member(item, "angle")) or 0.0
        angles_deg = [angle_deg]
        if member(item, TRANSECTS, "Refly90Degrees") is True:
            angles_deg.append(angle_deg + 90.0)
        self._pass_over(item)
        return [
            FileEntry(
                {**table, "heading_deg": angle % 180.0}, place, Array.AREA, _PREFIXES["survey"]
            )
            for angle in angles_deg
        ]

    def _corridor(self, place: str, item: object) -> Sequence[FileEntry | Fault] | None:
        middle = _points_deg(member(item, "polyline"), least=2)
        camera = member(item, TRANSECTS, "CameraCalc")
        width_m = number_of(member(item, "CorridorWidth"))
        spacing_m = number_of(member(camera, "AdjustedFootprintSide"))
        height_m = self._height_m(camera, place)
        if middle is None or width_m is None or spacing_m is None or height_m is None:
            return None
        if isinstance(height_m, Fault):
            return [height_m]
        if (fault := too_many_points(middle, self.source, place)) is not None:
            return [fault]
        offsets_m: Sequence[float] = [0.0]
        if spacing_m >= _LEAST_SPACING_M:
            if not 0.0 <= width_m <= min(_MOST_LINES * spacing_m, _FARTHEST_M):
                problem = f"a width of {width_m:g} m with lines {spacing_m:g} m apart"
                return [Fault(self.source, place, f"{problem} cannot be flown", _GIVE)]
            offsets_m = _offsets_m(width_m, spacing_m)
        if len(offsets_m) * len(middle) > _MOST_CORNERS:
            problem = f"has {len(offsets_m)} lines of {len(middle)} points"
            return [Fault(self.source, place, problem, "simplify its line")]
        table = {"height_m": height_m, **_trigger(camera, "AdjustedFootprintFrontal")}
        self._pass_over(item)
        return [
            FileEntry({"path": path, **table}, place, prefix=_PREFIXES["CorridorScan"])
            for path in _beside(middle, offsets_m)
        ]

    def _structure(self, place: str, item: object) -> Sequence[FileEntry | Fault] | None:
        polygon = _points_deg(member(item, "polygon"), least=3)
        camera = member(item, "CameraCalc")
        away_m = number_of(member(camera, "DistanceToSurface"))
        layers = whole_of(member(item, "Layers"))
        layer_m = number_of(member(camera, "AdjustedFootprintFrontal"))
        bottom_m = self._bottom_m(item)
        if polygon is None or away_m is None or layers is None or bottom_m is None:
            return None
        if (fault := too_many_points(polygon, self.source, place)) is not None:
            return [fault]
        if isinstance(bottom_m, Fault):
            return [bottom_m]
        is_flown = 1 <= layers <= _MOST_LINES and 0.0 <= away_m <= _FARTHEST_M
        if not is_flown or layer_m is None or layer_m <= 0.0:
            problem = f"{layers} layers, {away_m:g} m from the structure, cannot be flown"
            return [Fault(self.source, place, problem, _GIVE)]
        ring = _around(polygon, away_m)
        if ring is None:
            problem = "its polygon crosses itself or encloses nothing"
            return [Fault(self.source, place, problem, "draw it again in QGroundControl")]
        trigger = _trigger(camera, "AdjustedFootprintSide")
        self.notes.append(
            f"{place}: along lines round the structure the camera is pointed at its middle; a "
            "vehicle without a gimbal turns its nose there"
        )
        return [
            FileEntry(
                {
                    "path": ring,
                    "kind": STRUCTURE_KIND,
                    "height_m": bottom_m + (number + 0.5) * layer_m,
                    **trigger,
                },
                place,
                prefix=_PREFIXES["StructureScan"],
            )
            for number in range(layers)
        ]

    def _height_m(self, camera: object, place: str) -> float | Fault | None:
        """How high a scan is flown above home, or above the ground where that is known [m]."""
        distance_m = number_of(member(camera, "DistanceToSurface"))
        if distance_m is None:
            return None
        counted = whole_of(member(camera, "DistanceMode"))
        if member(camera, "DistanceToSurfaceRelative") is False:
            counted = _CountedFrom.SEA
        if counted in (_CountedFrom.GROUND, _CountedFrom.GROUND_BY_AUTOPILOT):
            known = self.heights.has_terrain
            return distance_m if known else above_ground(self.source, place)
        if self.heights.home is None:
            return self.heights.homeless
        if counted == _CountedFrom.SEA:
            return distance_m - self.heights.home.alt_m
        return distance_m

    def _bottom_m(self, item: object) -> float | Fault | None:
        """Where the lowest layer of a structure scan begins, above home [m]."""
        bottom_m = number_of(member(item, "ScanBottomAlt"))
        if bottom_m is None:  # before version 3
            bottom_m = number_of(member(item, "Altitude"))
            if member(item, "altitudeRelative") is False and bottom_m is not None:
                if self.heights.home is None:
                    return self.heights.homeless
                bottom_m -= self.heights.home.alt_m
        return bottom_m

    def _pass_over(self, item: object) -> None:
        if member(item, TRANSECTS, "HoverAndCapture") is True:
            self.left_out["hover and capture"] += 1


def _points_deg(value: object, *, least: int) -> list[tuple[float, float]] | None:
    """Latitudes and longitudes; None unless there are so many of them, and nothing else."""
    if not isinstance(value, list) or len(value) < least:
        return None
    points = []
    for each in value:
        numbers = [number_of(part) for part in each[:2]] if isinstance(each, list) else []
        match numbers:
            case [float(lat_deg), float(lon_deg)] if abs(lat_deg) <= 89.0 and abs(lon_deg) <= 180.0:
                points.append((lat_deg, lon_deg))
            case _:
                return None
    return points


def _camera_of(camera: object, height_m: float) -> dict[str, object] | None:
    """Camera and overlaps, where QGroundControl knows them and works by them."""
    numbers = {key: number_of(member(camera, theirs)) for key, theirs in _CAMERA.items()}
    counted = whole_of(member(camera, "DistanceMode"))
    laps = [number_of(member(camera, key)) for key in ("SideOverlap", "FrontalOverlap")]
    if counted == _CountedFrom.SEA or height_m <= 0.0:
        return None
    if any(not number or number < 0.0 for number in numbers.values()):
        return None
    if not all(lap is not None and 0.0 <= lap <= 99.0 for lap in laps):
        return None
    found: dict[str, object] = {
        key: round(number) if key.endswith("_px") else number
        for key, number in numbers.items()
        if number is not None
    }
    if member(camera, "Landscape") is False:
        found["landscape"] = False
    side, frontal = (lap / 100.0 for lap in laps if lap is not None)
    return {"camera": found, "sidelap_frac": side, "frontlap_frac": frontal}


def _distances_of(camera: object, spacing_m: float) -> dict[str, object]:
    return {"spacing_m": spacing_m, **_trigger(camera, "AdjustedFootprintFrontal")}


def _trigger(camera: object, key: str) -> Mapping[str, object]:
    trigger_m = number_of(member(camera, key))
    return {"trigger_m": trigger_m} if trigger_m else {}


def _offsets_m(width_m: float, spacing_m: float) -> Sequence[float]:
    """How far lines lie from the middle of a corridor, to its left; evenly, as many as cover it."""
    count = max(1, math.ceil(width_m / spacing_m))
    return [spacing_m * ((count - 1) / 2.0 - number) for number in range(count)]


def _beside(
    middle: Sequence[tuple[float, float]], offsets_m: Sequence[float]
) -> Iterator[list[list[float]]]:
    """Lines along ``middle``, so far to its left; of one that meets itself what remains."""
    import shapely

    origin = Origin(*middle[0], 0.0)
    line = shapely.LineString([enu_from_wgs84(origin, *point, 0.0)[:2] for point in middle])
    for offset_m in offsets_m:
        curve = line if offset_m == 0.0 else line.offset_curve(offset_m, join_style="mitre")
        for part in shapely.get_parts(shapely.line_merge(curve)):
            if part.is_empty:
                continue
            yield [
                list(wgs84_from_enu(origin, (east_m, north_m, 0.0))[:2])
                for east_m, north_m in part.coords
            ]


def _around(polygon: Sequence[tuple[float, float]], away_m: float) -> list[list[float]] | None:
    """The closed line round ``polygon`` that far away; None if it is no polygon."""
    import shapely

    origin = Origin(*polygon[0], 0.0)
    shape = shapely.Polygon([enu_from_wgs84(origin, *point, 0.0)[:2] for point in polygon])
    if not shape.is_valid or shape.area == 0.0:
        return None
    ring = shape.buffer(away_m, join_style="mitre").exterior
    return [
        list(wgs84_from_enu(origin, (east_m, north_m, 0.0))[:2]) for east_m, north_m in ring.coords
    ]
