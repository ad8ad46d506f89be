"""Points, lines and polygons of GeoJSON (RFC 7946) as tasks, areas and zones.

Properties have the names of a scenario's keys, in capitals or not. The third coordinate is the
height above mean sea level, of polygons none is heeded. Leaves out: coordinates other than
longitude and latitude.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from swarm.runtime.errors import Fault, InputError
from swarm.scenario.findings import shown
from swarm.scenario.task_files.features import Feature, FeatureReader, Form, Place, Shape, place_of
from swarm.scenario.task_files.task_file import (
    MOST_ENTRIES,
    MOST_POINTS,
    FileEntry,
    ReadOptions,
    TaskFile,
    gather,
    member,
    parse_object,
)

_WHAT = "a FeatureCollection of Points, LineStrings and Polygons in GeoJSON"
_POSITION = "give [longitude, latitude] or [longitude, latitude, height]"
_WGS84 = ("CRS84", "EPSG::4326", "EPSG:4326")
"""How names of the one system of coordinates end, in files of before RFC 7946."""
_SINGLE = {form.value: form for form in Form}
_MULTI = {f"Multi{form.value}": form for form in Form}
_DEPTH = {Form.POINT: 0, Form.LINE: 1, Form.POLYGON: 2}
"""How deep positions are nested in coordinates."""
_GIVE = "give Points, LineStrings or Polygons"


def read_geojson(text: str, request: ReadOptions) -> TaskFile:
    """What is in a feature collection.

    Raises:
        InputError: with every fault of the file.
    """
    document = parse_object(text, request.source, _WHAT)
    features = document.get("features")
    if document.get("type") == "Feature":
        features = [document]
    elif document.get("type") != "FeatureCollection":
        problem = f"{shown(document.get('type', 'nothing'))} is not 'FeatureCollection'"
        raise InputError(Fault(request.source, "type", problem, f"give {_WHAT}"))
    if not isinstance(features, list):
        raise InputError(Fault(request.source, "features", "is not an array", f"give {_WHAT}"))
    _require_wgs84(document, request.source)
    reader = FeatureReader(request.source)
    found: list[FileEntry | Fault] = []
    for index, feature in enumerate(features):
        if len(found) > MOST_ENTRIES:
            break
        place = f"features[{index}]"
        try:
            shapes = list(_shapes(member(feature, "geometry"), f"{place}.geometry"))
        except _MisshapenError as error:
            found.append(Fault(request.source, error.place, error.problem, error.remedy))
            continue
        found += reader.entries(_feature(feature, place, shapes))
    nothing = "add Points, LineStrings or Polygons"
    return gather(request, found, nothing, home=request.home, left_out=reader.left_out)


def _feature(value: object, place: str, shapes: Sequence[Shape]) -> Feature:
    properties = member(value, "properties")
    given = properties if isinstance(properties, Mapping) else {}
    named = {str(name).strip().lower(): each for name, each in given.items()}
    name = named.get("name")
    name = name if isinstance(name, str) else None
    if named.get("id") is None and name is None:  # else it is a number that a program gave
        named["id"] = member(value, "id")
    return Feature(place, shapes, named, name)


class _MisshapenError(Exception):
    """A geometry is not as it should be."""

    def __init__(self, place: str, problem: str, remedy: str) -> None:
        super().__init__(problem)
        self.place, self.problem, self.remedy = place, problem, remedy


def _require_wgs84(document: Mapping[str, object], source: str) -> None:
    name = member(document, "crs", "properties", "name")
    if name is None or (isinstance(name, str) and name.endswith(_WGS84)):
        return
    problem = f"{shown(name)} is not longitude and latitude of WGS84"
    remedy = "save the file in EPSG:4326, as RFC 7946 has it"
    raise InputError(Fault(source, "crs", problem, remedy))


def _shapes(geometry: object, place: str, *, inner: bool = False) -> Iterator[Shape]:
    kind, coordinates = member(geometry, "type"), member(geometry, "coordinates")
    where = f"{place}.coordinates"
    if kind == "GeometryCollection" and not inner:
        parts = member(geometry, "geometries")
        for index, part in enumerate(parts if isinstance(parts, list) else ()):
            yield from _shapes(part, f"{place}.geometries[{index}]", inner=True)
    elif isinstance(kind, str) and (form := _SINGLE.get(kind)) is not None:
        yield _shape(form, coordinates, where)
    elif isinstance(kind, str) and (form := _MULTI.get(kind)) is not None:
        for index, part in enumerate(_array(coordinates, where, form)):
            yield _shape(form, part, f"{where}[{index}]")
    else:
        problem = f"{shown(kind)} is nothing to fly to" if kind else "has no geometry"
        raise _MisshapenError(place, problem, _GIVE)


def _shape(form: Form, coordinates: object, place: str) -> Shape:
    match form:
        case Form.POINT:
            rings = [[_position(coordinates, place)]]
        case Form.LINE:
            rings = [_positions(coordinates, place, form)]
        case Form.POLYGON:
            parts = _array(coordinates, place, form)
            rings = [
                _positions(ring, f"{place}[{index}]", form) for index, ring in enumerate(parts)
            ]
    return Shape(form, rings)


def _array(value: object, place: str, form: Form) -> Sequence[object]:
    if not isinstance(value, list) or not value:
        nested = "[" * _DEPTH[form] + "…" + "]" * _DEPTH[form]
        raise _MisshapenError(
            place, "is not an array of coordinates", f"give {nested} of positions"
        )
    return value


def _positions(value: object, place: str, form: Form) -> list[Place]:
    positions = _array(value, place, form)
    if len(positions) > MOST_POINTS:
        problem = f"has {len(positions)} points"
        raise _MisshapenError(place, problem, f"simplify it to {MOST_POINTS} or fewer")
    return [_position(each, f"{place}[{index}]") for index, each in enumerate(positions)]


def _position(value: object, place: str) -> Place:
    position = place_of(value) if isinstance(value, list) else None
    if position is None:
        raise _MisshapenError(place, "is not an array of 2 or 3 numbers", _POSITION)
    return position
