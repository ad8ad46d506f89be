"""Shapes, types and ranges of a scenario file, and what to say when they are wrong.

The tables are those of schema 2, of which a file of schema 1 uses a part (swarm.scenario.edition).

The upper limits are far beyond any aircraft; they keep every product of eq. 1
finite, so that a misplaced exponent is named here and not met as an infinite J.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Annotated

from pydantic import AfterValidator, BeforeValidator, Field

from swarm.model.ids import ID_RULE
from swarm.model.vehicles import VehicleKind
from swarm.scenario.edition import EDITIONS, edition_faults
from swarm.scenario.findings import Document, Finding, close_match
from swarm.scenario.validation import (
    PROBABILITY,
    Id,
    Probability,
    StrictTable,
    TableShape,
    known_schema,
    validate_tables,
    wrong,
)
from swarm.survey.cameras import CAMERAS

_SLOWEST_M_S = 1e-6
_LONGEST_AREA_ID = 56
"""So that a number fits behind it."""


def _require_speed(speed_m_s: float) -> float:
    if speed_m_s < _SLOWEST_M_S:
        least = "> 0" if speed_m_s <= 0.0 else f">= {_SLOWEST_M_S:g}"
        raise wrong("{} is not " + least)
    return speed_m_s


def _require_share(share: float) -> float:
    if not 0.0 <= share <= 1.0:
        raise wrong("{} is not within 0..1")
    return share


def _require_wind(wind_m_s: list[float]) -> list[float]:
    if len(wind_m_s) != 2:
        raise wrong(f"has {len(wind_m_s)} instead of 2 numbers")
    return wind_m_s


def _require_band(band_m: list[float]) -> list[float]:
    if len(band_m) != 2:
        raise wrong(f"has {len(band_m)} instead of 2 numbers")
    if band_m[0] >= band_m[1]:
        raise wrong(f"does not grow from {band_m[0]:g} to {band_m[1]:g}")
    return band_m


def _require_line(points: list[list[float]]) -> list[list[float]]:
    if len(points) < 2:
        raise wrong(f"has {len(points)} point{'s'[len(points) :]} instead of 2 or more")
    return points


def _require_degrees(point_deg: list[float]) -> list[float]:
    if len(point_deg) != 2:
        raise wrong(f"has {len(point_deg)} instead of 2 numbers")
    lat_deg, lon_deg = point_deg
    if not (abs(lat_deg) <= 90.0 and abs(lon_deg) <= 180.0):
        raise wrong(f"{lat_deg:g}, {lon_deg:g} is no latitude and longitude")
    return point_deg


def _require_point(point_m: list[float]) -> list[float]:
    if len(point_m) not in (2, 3):
        raise wrong(f"has {len(point_m)} instead of 2 or 3 numbers")
    return point_m


def _require_fleet(uavs: list[UavTable]) -> list[UavTable]:
    if not uavs:
        raise wrong("the fleet is empty")
    return uavs


def _numbers_of(camera: object) -> object:
    """Those of a camera that is known by name; anything else as it is."""
    if not isinstance(camera, str):
        return camera
    if camera in CAMERAS:
        return asdict(CAMERAS[camera])
    meant = close_match(camera, CAMERAS)
    raise wrong("{} is no camera that is known" + (f" (did you mean {meant!r}?)" if meant else ""))


def _require_short(name: str) -> str:
    if len(name) > _LONGEST_AREA_ID:
        raise wrong("{} is too long")
    return name


_Kind = Annotated[str, Field(min_length=1, max_length=64)]
_Seconds = Annotated[float, Field(ge=0.0, le=1e9)]
_Metres = Annotated[float, Field(ge=-1e7, le=1e7)]
_Latitude = Annotated[float, Field(ge=-90.0, le=90.0)]
_Longitude = Annotated[float, Field(ge=-180.0, le=180.0)]
_Altitude = Annotated[float, Field(ge=-1e5, le=1e5)]
_Point = Annotated[list[_Metres], AfterValidator(_require_point)]
_Degrees = Annotated[list[float], AfterValidator(_require_degrees)]
_Speed = Annotated[float, Field(le=1e6), AfterValidator(_require_speed)]
_Share = Annotated[float, AfterValidator(_require_share)]
_WindSpeed = Annotated[float, Field(ge=-1e6, le=1e6)]
_Height = Annotated[float, Field(ge=0.0, le=1e6)]
_Distance = Annotated[float, Field(ge=0.1, le=1e6)]
_Millimetres = Annotated[float, Field(ge=0.01, le=10_000.0)]
_Pixels = Annotated[int, Field(ge=1, le=1_000_000)]
_Overlap = Annotated[float, Field(ge=0.0, le=0.99)]


class MissionTable(StrictTable):
    """``[mission]``."""

    horizon_s: Annotated[float, Field(gt=0.0, le=1e9)]
    success_default: Probability = 1.0
    survival_default: Probability = 1.0
    reattempt_failed: bool = False
    wind_m_s: Annotated[list[_WindSpeed], AfterValidator(_require_wind)] | None = None
    zone_margin_m: Annotated[float, Field(ge=0.0, le=1e6)] = 0.0
    separation_m: _Distance | None = None
    band_m: Annotated[list[_Height], AfterValidator(_require_band)] | None = None


class OriginTable(StrictTable):
    """``[origin]``."""

    lat_deg: Annotated[float, Field(ge=-89.0, le=89.0)]
    lon_deg: _Longitude
    alt_m: _Altitude


class TerrainTable(StrictTable):
    """``[terrain]``."""

    file: Annotated[str, Field(min_length=1, max_length=4096)]
    clearance_m: Annotated[float, Field(ge=0.0, le=1e4)]


class _Placed(StrictTable):
    position_m: _Point | None = None
    lat_deg: _Latitude | None = None
    lon_deg: _Longitude | None = None
    alt_m: _Altitude | None = None


class UavTable(_Placed):
    """``[[uav]]``."""

    id: Id
    speed_m_s: _Speed
    success: dict[str, Probability] = Field(default_factory=dict)
    survival: dict[str, Probability] = Field(default_factory=dict)
    kind: _Kind | None = None
    acceleration_m_s2: _Speed | None = None
    airspeed_m_s: _Speed | None = None
    endurance_s: Annotated[float, Field(gt=0.0, le=1e9)] | None = None
    reserve_frac: _Share = 0.2
    charge_frac: _Share = 1.0
    vehicle: Annotated[VehicleKind, Field(strict=False)] = VehicleKind.COPTER
    turn_radius_m: _Distance | None = None
    landing_heading_deg: Annotated[float, Field(ge=0.0, le=360.0)] | None = None


class BaseTable(_Placed):
    """``[[base]]``."""

    id: Id
    swap_s: _Seconds = 0.0
    slots: Annotated[int, Field(ge=1, le=1_000_000)] | None = None


class ZoneTable(StrictTable):
    """``[[zone]]``."""

    id: Id
    polygon_m: list[_Point] | None = None
    polygon: list[_Degrees] | None = None
    holes_m: list[list[_Point]] = Field(default_factory=list)
    floor_m: _Metres | None = None
    ceiling_m: _Metres | None = None
    inclusive: bool = False


class TaskTable(_Placed):
    """``[[task]]``."""

    id: Id
    value: Annotated[float, Field(ge=0.0, le=1e12)]
    service_s: _Seconds = 0.0
    kind: _Kind | None = None
    appears_s: _Seconds = 0.0
    due_s: _Seconds | None = None
    opens_s: _Seconds = 0.0
    closes_s: _Seconds | None = None
    path_m: Annotated[list[_Point], AfterValidator(_require_line)] | None = None
    path: Annotated[list[_Degrees], AfterValidator(_require_line)] | None = None
    trigger_m: _Distance | None = None
    height_m: _Metres | None = None


class CameraTable(StrictTable):
    """``camera`` of ``[[area]]``."""

    sensor_width_mm: _Millimetres
    sensor_height_mm: _Millimetres
    focal_length_mm: _Millimetres
    image_width_px: _Pixels
    image_height_px: _Pixels
    landscape: bool = True
    exposure_s: Annotated[float, Field(gt=0.0, le=10.0)] = 0.001


class AreaTable(StrictTable):
    """``[[area]]``."""

    id: Annotated[Id, AfterValidator(_require_short)]
    polygon_m: list[_Point] | None = None
    polygon: list[_Degrees] | None = None
    holes_m: list[list[_Point]] = Field(default_factory=list)
    value: Annotated[float, Field(ge=0.0, le=1e12)]
    spacing_m: _Distance | None = None
    trigger_m: _Distance | None = None
    camera: Annotated[CameraTable, BeforeValidator(_numbers_of)] | None = None
    height_m: _Metres | None = None
    sidelap_frac: _Overlap | None = None
    frontlap_frac: _Overlap | None = None
    heading_deg: Annotated[float, Field(ge=-360.0, le=360.0)] | None = None
    max_line_m: Annotated[float, Field(ge=1.0, le=1e6)] | None = None
    kind: _Kind | None = None
    service_s: _Seconds = 0.0
    due_s: _Seconds | None = None
    opens_s: _Seconds = 0.0
    closes_s: _Seconds | None = None
    appears_s: _Seconds = 0.0


class Scenario(StrictTable):
    """A whole file."""

    version: Annotated[int, known_schema(*EDITIONS)] = Field(alias="schema")
    name: Id
    mission: MissionTable
    origin: OriginTable | None = None
    terrain: TerrainTable | None = None
    uav: Annotated[list[UavTable], AfterValidator(_require_fleet)]
    base: list[BaseTable] = Field(default_factory=list)
    zone: list[ZoneTable] = Field(default_factory=list)
    area: list[AreaTable] = Field(default_factory=list)
    task: list[TaskTable]
    tasks_from: Annotated[str, Field(min_length=1)] | None = None


_TABLES: Mapping[tuple[str, ...], TableShape] = {
    (): TableShape.of("the top", Scenario),
    ("mission",): TableShape.of("[mission]", MissionTable),
    ("origin",): TableShape.of("[origin]", OriginTable),
    ("terrain",): TableShape.of("[terrain]", TerrainTable),
    ("uav",): TableShape.of("[[uav]]", UavTable),
    ("base",): TableShape.of("[[base]]", BaseTable),
    ("zone",): TableShape.of("[[zone]]", ZoneTable),
    ("task",): TableShape.of("[[task]]", TaskTable),
    ("area",): TableShape.of("[[area]]", AreaTable),
    ("area", "camera"): TableShape.of("camera of [[area]]", CameraTable),
}

_LATITUDE = "a latitude within -90..90 [deg]"
_LONGITUDE = "a longitude within -180..180 [deg]"
_ALTITUDE = "a height above mean sea level within -1e5..1e5 [m], such as 488.0"
_SECONDS = "a number >= 0 and <= 1e9 [s]"
_SHARE = "a share within 0..1"
_CORNERS = "corners [[east, north], …], each within -1e7..1e7 [m]"
_VALUE = "a number >= 0 and <= 1e12, such as value = 5.0"
_KIND = "a word of 1 to 64 characters"
_APPEARS = "a number >= 0 and <= 1e9 [s]; 0 if known from the start"
_DISTANCE = "a distance within 0.1..1e6 [m]"
_OVERLAP = "a share within 0..0.99, such as 0.7"
_MILLIMETRES = "a length within 0.01..10000 [mm]"
_PIXELS = "an integer within 1..1000000"
_CAMERA = (
    f"one of {', '.join(CAMERAS)}, or a table of sensor_width_mm, sensor_height_mm, "
    "focal_length_mm, image_width_px and image_height_px"
)
_HEIGHT = "a height above the origin within -1e7..1e7 [m]"
_RIGHT: Mapping[tuple[str, ...], str] = {
    ("schema",): "schema = 1 or schema = 2",
    ("name",): f'an id of {ID_RULE}, such as name = "survey-1"',
    ("mission",): "a table [mission] with at least horizon_s",
    ("origin",): "a table [origin] with lat_deg, lon_deg and alt_m",
    ("terrain",): "a table [terrain] with file and clearance_m",
    ("terrain", "file"): 'a GeoTIFF or an SRTM tile, such as file = "hills.tif"',
    ("terrain", "clearance_m"): "a distance within 0..1e4 [m], such as clearance_m = 20.0",
    ("uav",): "one table [[uav]] per UAV",
    ("task",): "one table [[task]] per task, or task = [] if all come later",
    ("tasks_from",): 'a file of tasks, such as tasks_from = "survey.plan"',
    ("mission", "horizon_s"): "a number > 0 and <= 1e9 [s], such as horizon_s = 600.0",
    ("mission", "success_default"): PROBABILITY,
    ("mission", "survival_default"): PROBABILITY,
    ("mission", "reattempt_failed"): "true or false",
    ("mission", "wind_m_s"): "[east, north], where the wind blows to, such as [3.0, -1.0] [m/s]",
    ("mission", "zone_margin_m"): "a distance >= 0 and <= 1e6 [m]",
    ("mission", "separation_m"): "a distance within 0.1..1e6 [m], such as 10.0",
    ("mission", "band_m"): "[lowest, highest], heights >= 0 and <= 1e6 [m], such as [30.0, 110.0]",
    ("origin", "lat_deg"): "a latitude within -89..89 [deg]",
    ("origin", "lon_deg"): _LONGITUDE,
    ("origin", "alt_m"): _ALTITUDE,
    ("uav", "id"): f"an id of {ID_RULE}",
    ("uav", "speed_m_s"): "a cruise speed > 0 and <= 1e6 [m/s], such as speed_m_s = 12.0",
    ("uav", "success"): f"a table of task ids or kinds with {PROBABILITY} each",
    ("uav", "survival"): f"a table of task ids or kinds with {PROBABILITY} each",
    ("uav", "success", "*"): PROBABILITY,
    ("uav", "survival", "*"): PROBABILITY,
    ("uav", "kind"): _KIND,
    ("uav", "acceleration_m_s2"): "a number > 0 and <= 1e6 [m/s²], such as 2.5",
    ("uav", "airspeed_m_s"): "a speed through the air > 0 and <= 1e6 [m/s], such as 12.0",
    ("uav", "endurance_s"): "a number > 0 and <= 1e9 [s], such as endurance_s = 1200.0",
    ("uav", "vehicle"): f"one of {', '.join(map(repr, map(str, VehicleKind)))}",
    ("uav", "turn_radius_m"): "the radius of its circles within 0.1..1e6 [m], such as 60.0",
    ("uav", "landing_heading_deg"): "a direction within 0..360, clockwise from north, such as 90.0",
    ("uav", "reserve_frac"): _SHARE,
    ("uav", "charge_frac"): _SHARE,
    ("base",): "one table [[base]] per base",
    ("base", "id"): f"an id of {ID_RULE}",
    ("base", "swap_s"): _SECONDS,
    ("base", "slots"): "an integer >= 1, or leave it out for no limit",
    ("zone",): "one table [[zone]] per zone",
    ("zone", "id"): f"an id of {ID_RULE}",
    ("zone", "polygon_m"): _CORNERS,
    ("zone", "polygon"): "corners [[lat_deg, lon_deg], …]",
    ("zone", "holes_m"): f"an array of holes, each of {_CORNERS}",
    ("zone", "floor_m"): _HEIGHT,
    ("zone", "ceiling_m"): _HEIGHT,
    ("zone", "inclusive"): "true or false",
    ("area",): "one table [[area]] per area",
    ("area", "id"): f"an id of {ID_RULE}, but {_LONGEST_AREA_ID} at most",
    ("area", "polygon_m"): _CORNERS,
    ("area", "polygon"): "corners [[lat_deg, lon_deg], …]",
    ("area", "holes_m"): f"an array of holes, each of {_CORNERS}",
    ("area", "value"): _VALUE,
    ("area", "spacing_m"): _DISTANCE,
    ("area", "trigger_m"): _DISTANCE,
    ("area", "camera"): _CAMERA,
    ("area", "camera", "sensor_width_mm"): _MILLIMETRES,
    ("area", "camera", "sensor_height_mm"): _MILLIMETRES,
    ("area", "camera", "focal_length_mm"): _MILLIMETRES,
    ("area", "camera", "image_width_px"): _PIXELS,
    ("area", "camera", "image_height_px"): _PIXELS,
    ("area", "camera", "landscape"): "true or false",
    ("area", "camera", "exposure_s"): "a number > 0 and <= 10 [s], such as 0.001",
    ("area", "height_m"): _HEIGHT,
    ("area", "sidelap_frac"): _OVERLAP,
    ("area", "frontlap_frac"): _OVERLAP,
    ("area", "heading_deg"): "a direction within -360..360 [deg], clockwise from north",
    ("area", "max_line_m"): "a length within 1..1e6 [m], such as 400.0",
    ("area", "kind"): _KIND,
    ("area", "service_s"): _SECONDS,
    ("area", "due_s"): _SECONDS,
    ("area", "opens_s"): _SECONDS,
    ("area", "closes_s"): _SECONDS,
    ("area", "appears_s"): _APPEARS,
    ("task", "id"): f"an id of {ID_RULE}",
    ("task", "value"): _VALUE,
    ("task", "service_s"): _SECONDS,
    ("task", "kind"): _KIND,
    ("task", "appears_s"): _APPEARS,
    ("task", "due_s"): _SECONDS,
    ("task", "opens_s"): _SECONDS,
    ("task", "closes_s"): _SECONDS,
    ("task", "path_m"): "two points or more, [[east, north], …], each within -1e7..1e7 [m]",
    ("task", "path"): "two points or more, [[lat_deg, lon_deg], …]",
    ("task", "trigger_m"): _DISTANCE,
    ("task", "height_m"): _HEIGHT,
} | {
    (table, key): right
    for table in ("uav", "base", "task")
    for key, right in {
        "position_m": "[east, north] or [east, north, up], each within -1e7..1e7 [m]",
        "lat_deg": _LATITUDE,
        "lon_deg": _LONGITUDE,
        "alt_m": _ALTITUDE,
    }.items()
}


class _Zones(StrictTable):
    """What a file says about zones."""

    origin: OriginTable | None = None
    zone: list[ZoneTable] = Field(default_factory=list)


def validate_zones(document: Document) -> tuple[list[ZoneTable], list[Finding]]:
    """The zones of a document that has nothing else, and what is wrong with their shapes."""
    zones, findings = validate_tables(_Zones, document, _TABLES, _RIGHT)
    return [] if zones is None else zones.zone, findings


def validate(document: Document) -> tuple[Scenario | None, list[Finding]]:
    """The scenario if every shape, type and range is right, and all findings otherwise."""
    scenario, findings = validate_tables(Scenario, document, _TABLES, _RIGHT)
    return scenario, [*findings, *edition_faults(document)]
