"""Places of a scenario file, in metres or degrees: where they are, and whether each is given once.

Everything here reads the parsed document itself and passes over whatever has the wrong shape.
Leaves out: whether a place may be where it is (swarm.scenario.keep_out).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

from swarm.model.frames import Origin, enu_from_wgs84
from swarm.scenario.findings import Document, Finding, Path, absent, number_of

FARTHEST_M = 1e7
"""Greatest coordinate of a place [m]."""
DEGREES = ("lat_deg", "lon_deg", "alt_m")
"""Keys that give a place by latitude, longitude and height."""

Entry = tuple[int, Mapping[str, object]]
"""One table of an array, and its index."""
FlatPoint = tuple[float, float]
"""East and north [m]."""


@dataclass(frozen=True, slots=True)
class Outline:
    """Two keys of which one gives a chain of points, in metres or in degrees."""

    metres: str
    degrees: str


LINE = Outline("path_m", "path")
"""Of a task, in the place of a position."""
POLYGON = Outline("polygon_m", "polygon")
"""Of a zone or an area."""


def entries(document: Document, name: str) -> Iterator[Entry]:
    """The tables of the array ``name``, whatever else is in it left out."""
    array = document.get(name)
    for index, entry in enumerate(array if isinstance(array, list) else ()):
        if isinstance(entry, Mapping):
            yield index, entry


def origin_of(table: object) -> Origin | None:
    """The origin that the table ``[origin]`` gives; None unless it is there and right."""
    if not isinstance(table, Mapping):
        return None
    lat_deg, lon_deg, alt_m = (number_of(table.get(key)) for key in DEGREES)
    if lat_deg is None or lon_deg is None or alt_m is None:
        return None
    try:
        return Origin(lat_deg, lon_deg, alt_m)
    except ValueError:
        return None  # named by the shapes


def misplaced(document: Document, name: str, found: Iterable[Entry]) -> Iterator[Finding]:
    """Tables without a place, with two, or with one that nobody can find."""
    origin = document.get("origin")
    frame = origin_of(origin)
    for index, entry in found:
        path: Path = (name, index)
        if "trigger_m" in entry and not (LINE.metres in entry or LINE.degrees in entry):
            remedy = f"give {LINE.metres}, or leave it out"
            yield Finding((*path, "trigger_m"), "is of lines, not of places", remedy)
        if name == "task" and (LINE.metres in entry or LINE.degrees in entry):
            yield from _beside_line(path, entry)
            yield from outline_faults(document, path, entry, LINE)
            continue
        if "position_m" in entry:
            yield from _not_both(path, entry)
            continue
        if not {*DEGREES} & entry.keys():
            remedy = "give position_m = [east, north], or lat_deg and lon_deg"
            yield absent((*path, "position_m"), remedy)
            continue
        for key, other in (("lat_deg", "lon_deg"), ("lon_deg", "lat_deg")):
            if key not in entry:
                there = other if other in entry else "alt_m"
                remedy = f"give {key} beside {there}, or position_m = [east, north]"
                yield absent((*path, key), remedy)
        if origin is None:
            key = next(key for key in entry if key in DEGREES)
            yield _without_origin((*path, key), "position_m")
        elif frame is not None and _too_far(frame, entry.get("lat_deg"), entry.get("lon_deg")):
            yield _beyond((*path, "lat_deg"))


def outline_faults(
    document: Document, path: Path, entry: Mapping[str, object], outline: Outline
) -> Iterator[Finding]:
    """What is wrong with where the chain of points of one table lies, or with how often."""
    if outline.metres in entry:
        if outline.degrees in entry:
            remedy = f"keep either {outline.metres} or {outline.degrees}"
            problem = f"is given beside {outline.metres}"
            yield Finding((*path, outline.degrees), problem, remedy)
        return
    if outline.degrees not in entry:
        remedy = f"give {outline.metres} = [[east, north], …], or {outline.degrees} in degrees"
        yield absent((*path, outline.metres), remedy)
        return
    origin = document.get("origin")
    frame = origin_of(origin)
    if origin is None:
        yield _without_origin((*path, outline.degrees), outline.metres)
    elif frame is not None:
        for number, point in enumerate(_list(entry[outline.degrees])):
            if isinstance(point, list) and len(point) == 2 and _too_far(frame, *point):
                yield _beyond((*path, outline.degrees, number))


def place_m(entry: Mapping[str, object], frame: Origin | None) -> FlatPoint | None:
    """Where one table has its place; None if that cannot be told."""
    if "position_m" in entry:
        return _in_metres(entry["position_m"])
    if frame is None:
        return None
    return _in_degrees(frame, entry.get("lat_deg"), entry.get("lon_deg"))


def outline_m(
    entry: Mapping[str, object], outline: Outline, frame: Origin | None
) -> list[FlatPoint] | None:
    """Where one table has its chain of points; None if that cannot be told of all of them."""
    in_metres = outline.metres in entry
    chain = entry.get(outline.metres if in_metres else outline.degrees)
    if not isinstance(chain, list):
        return None
    points_m: list[FlatPoint] = []
    for point in chain:
        if in_metres:
            point_m = _in_metres(point)
        elif frame is not None and isinstance(point, list) and len(point) == 2:
            point_m = _in_degrees(frame, *point)
        else:
            point_m = None
        if point_m is None:
            return None
        points_m.append(point_m)
    return points_m


def _beside_line(path: Path, entry: Mapping[str, object]) -> Iterator[Finding]:
    line = LINE.metres if LINE.metres in entry else LINE.degrees
    if place := [key for key in ("position_m", *DEGREES) if key in entry]:
        problem = f"is given beside {place[0]}"
        remedy = f"keep {line} for a line, or {place[0]} for a place"
        yield Finding((*path, line), problem, remedy)


def _not_both(path: Path, entry: Mapping[str, object]) -> Iterator[Finding]:
    if "lat_deg" in entry or "lon_deg" in entry:
        key = "lat_deg" if "lat_deg" in entry else "lon_deg"
        remedy = "keep either position_m or lat_deg, lon_deg and alt_m"
        yield Finding((*path, key), "a second position beside position_m", remedy)
    elif "alt_m" in entry:
        remedy = "give the height above the origin as a third number of position_m"
        yield Finding((*path, "alt_m"), "goes with lat_deg and lon_deg only", remedy)


def _without_origin(path: Path, metres: str) -> Finding:
    remedy = f"add a table [origin] with lat_deg, lon_deg and alt_m, or give {metres}"
    return Finding(path, "a place in degrees needs an origin", remedy)


def _beyond(path: Path) -> Finding:
    problem = f"is more than {FARTHEST_M:g} m from the origin"
    return Finding(path, problem, "give an origin near the mission")


def _too_far(frame: Origin, lat: object, lon: object) -> bool:
    lat_deg, lon_deg = number_of(lat), number_of(lon)
    if lat_deg is None or lon_deg is None:
        return False
    point_enu_m = enu_from_wgs84(frame, lat_deg, lon_deg, frame.alt_m)
    return max(abs(coordinate_m) for coordinate_m in point_enu_m) > FARTHEST_M


def _in_metres(point: object) -> FlatPoint | None:
    numbers = [number_of(value) for value in _list(point)]
    if len(numbers) not in (2, 3):
        return None
    east_m, north_m = numbers[:2]
    if east_m is None or north_m is None or max(abs(east_m), abs(north_m)) > FARTHEST_M:
        return None
    return east_m, north_m


def _in_degrees(frame: Origin, lat: object, lon: object) -> FlatPoint | None:
    lat_deg, lon_deg = number_of(lat), number_of(lon)
    if lat_deg is None or lon_deg is None or abs(lat_deg) > 90.0 or abs(lon_deg) > 180.0:
        return None
    if _too_far(frame, lat_deg, lon_deg):
        return None
    return enu_from_wgs84(frame, lat_deg, lon_deg, frame.alt_m)[:2]


def _list(value: object) -> list[object]:
    return value if isinstance(value, list) else []
