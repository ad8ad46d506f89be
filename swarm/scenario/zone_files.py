"""One zone out of a file: a table ``[[zone]]`` of a scenario, or a Polygon in GeoJSON.

For who draws a zone in flight: it has the same rules as a scenario's. Of metres in a file without
an origin the mission's origin is meant. Leaves out: whether anything lies in the zone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from swarm.model import Origin
from swarm.model.frames import wgs84_from_enu
from swarm.runtime.errors import Fault, InputError, remedy_for_name
from swarm.scenario.files import decode, read_bytes
from swarm.scenario.findings import Document, faults_of, number_of, printable, shown
from swarm.scenario.keep_out import field_faults
from swarm.scenario.places import FlatPoint, origin_of
from swarm.scenario.read import parse_toml
from swarm.scenario.shapes import ZoneTable, validate_zones
from swarm.scenario.task_files.task_file import member, parse_object

_WHAT = "file with a zone"
_POLYGON = "a Polygon in GeoJSON"
_SUFFIXES = (".toml", ".geojson", ".json")


@dataclass(frozen=True, slots=True)
class ZoneDrawing:
    """A zone as a file has it, wherever the mission's origin is."""

    polygon: tuple[FlatPoint, ...]
    """Corners: east and north of the mission's origin [m], or latitude and longitude [deg]."""
    holes: tuple[tuple[FlatPoint, ...], ...]
    in_degrees: bool
    floor_m: float | None = None
    ceiling_m: float | None = None
    inclusive: bool = False


def read_zone(path: Path, name: str) -> ZoneDrawing:
    """The zone of that ``name`` in the file ``path``; its only one whatever that is called.

    Raises:
        InputError: with every fault of the file's zones, or that it is not among them.
    """
    source = printable(str(path))
    suffix = path.suffix.lower()
    if suffix not in _SUFFIXES:
        problem = f"{suffix or 'a name without a suffix'} is no kind of {_WHAT}"
        raise InputError(Fault(source, "", problem, f"give one ending in {', '.join(_SUFFIXES)}"))
    data = read_bytes(path, _WHAT)
    if suffix == ".toml":
        return _of_tables(parse_toml(data, source, _WHAT), source, name)
    return _of_geojson(parse_object(decode(data, source, _WHAT), source, _POLYGON), source, name)


def _chosen(name: str, names: Sequence[str], source: str) -> int:
    """Which of the zones of those ``names`` is meant."""
    if not names:
        remedy = f"give one with a table [[zone]], or {_POLYGON}"
        raise InputError(Fault(source, "", "holds no zone", remedy))
    if name in names or len(names) == 1:
        return names.index(name) if name in names else 0
    problem = f"{name!r} is none of its {len(names)} zones"
    raise InputError(Fault(source, "", problem, remedy_for_name(name, names)))


def _of_tables(document: Document, source: str, name: str) -> ZoneDrawing:
    part = {key: document[key] for key in ("origin", "zone") if key in document}
    if "origin" not in part and (near := _somewhere(part.get("zone"))) is not None:
        part["origin"] = near
    tables, findings = validate_zones(part)
    findings += field_faults(part)
    if findings:
        raise InputError(*faults_of(part, source, findings))
    table = tables[_chosen(name, [str(each.id) for each in tables], source)]
    return _drawing(table, origin_of(part.get("origin")) if "origin" in part else None)


def _somewhere(zones: object) -> Mapping[str, float] | None:
    """An origin beside the first corner in degrees, where the file itself has none."""
    for zone in zones if isinstance(zones, list) else ():
        corners = member(zone, "polygon")
        corner = corners[0] if isinstance(corners, list) and corners else None
        numbers = [number_of(each) for each in corner] if isinstance(corner, list) else []
        match numbers:
            case [float(lat_deg), float(lon_deg)] if abs(lat_deg) <= 89.0 and abs(lon_deg) <= 180.0:
                return {"lat_deg": lat_deg, "lon_deg": lon_deg, "alt_m": 0.0}
    return None


def _drawing(table: ZoneTable, origin: Origin | None) -> ZoneDrawing:
    """In degrees wherever the file tells an origin: the mission may have another one."""

    def placed(corner: Sequence[float]) -> FlatPoint:
        east_m, north_m = corner[0], corner[1]
        if origin is None:
            return east_m, north_m
        lat_deg, lon_deg, _ = wgs84_from_enu(origin, (east_m, north_m, 0.0))
        return lat_deg, lon_deg

    if table.polygon_m is not None:
        polygon = tuple(map(placed, table.polygon_m))
    else:
        polygon = tuple((corner[0], corner[1]) for corner in table.polygon or ())
    holes = tuple(tuple(map(placed, hole)) for hole in table.holes_m)
    return ZoneDrawing(
        polygon, holes, origin is not None, table.floor_m, table.ceiling_m, table.inclusive
    )


def _of_geojson(document: Mapping[str, object], source: str, name: str) -> ZoneDrawing:
    features = document.get("features") if document.get("type") == "FeatureCollection" else None
    listed = features if isinstance(features, list) else [document]
    found: list[tuple[str, str, object]] = []
    for index, feature in enumerate(listed):
        place = f"features[{index}]" if isinstance(features, list) else ""
        geometry = feature if member(feature, "type") == "Polygon" else member(feature, "geometry")
        if member(geometry, "type") == "Polygon":
            identity = member(feature, "id") or member(feature, "properties", "id")
            found.append((str(identity or ""), place, member(geometry, "coordinates")))
        elif member(geometry, "type") == "MultiPolygon":
            problem = "is a MultiPolygon"
            raise InputError(Fault(source, place, problem, "make a zone of each of its polygons"))
    if not found:
        kind = member(document, "geometry", "type") or document.get("type", "nothing")
        raise InputError(Fault(source, "", f"{shown(kind)} holds no zone", f"give {_POLYGON}"))
    _, place, coordinates = found[_chosen(name, [each[0] for each in found], source)]
    rings = coordinates if isinstance(coordinates, list) and coordinates else [None]
    polygon, *holes = (_ring(ring, source, place) for ring in rings)
    return ZoneDrawing(polygon, tuple(holes), in_degrees=True)


def _ring(ring: object, source: str, place: str) -> tuple[FlatPoint, ...]:
    """A ring of GeoJSON, which has longitudes first."""
    corners: list[FlatPoint] = []
    for number, corner in enumerate(ring if isinstance(ring, list) else [None], 1):
        numbers = [number_of(each) for each in corner] if isinstance(corner, list) else []
        match numbers:
            case [float(lon_deg), float(lat_deg), *_]:
                corners.append((lat_deg, lon_deg))
            case _:
                problem = f"corner {number} is no place"
                remedy = "give rings of [longitude, latitude]"
                where = f"{place}.geometry.coordinates" if place else "coordinates"
                raise InputError(Fault(source, where, problem, remedy))
    return tuple(corners)
