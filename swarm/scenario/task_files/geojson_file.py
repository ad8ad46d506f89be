"""Points of GeoJSON (RFC 7946) as tasks.

Properties are id, value, service_s, kind, appears_s, due_s, opens_s and closes_s; their names may
be in capitals. The third coordinate is the height above mean sea level. Leaves out: lines,
polygons, and coordinates other than longitude and latitude.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

from swarm.runtime.errors import Fault, InputError
from swarm.scenario.findings import number_of, printable, shown
from swarm.scenario.task_files.task_file import (
    TASK_KEYS,
    FileTask,
    ReadOptions,
    TaskFile,
    gather,
    member,
    parse_object,
    slip_of,
)

_WHAT = "a FeatureCollection of Points in GeoJSON"


def read_geojson(text: str, request: ReadOptions) -> TaskFile:
    """The tasks of a feature collection.

    Raises:
        InputError: with every fault of the file.
    """
    document = parse_object(text, request.source, _WHAT)
    features = document.get("features")
    if document.get("type") != "FeatureCollection":
        problem = f"{shown(document.get('type', 'nothing'))} is not 'FeatureCollection'"
        raise InputError(Fault(request.source, "type", problem, f"give {_WHAT}"))
    if not isinstance(features, list):
        raise InputError(Fault(request.source, "features", "is not an array", f"give {_WHAT}"))
    left_out: Counter[str] = Counter()
    found: list[FileTask | Fault] = []
    for index, feature in enumerate(features):
        properties = member(feature, "properties")
        given = properties if isinstance(properties, Mapping) else {}
        named = {str(name).strip().lower(): value for name, value in given.items()}
        found.append(_entry(f"features[{index}]", feature, named, request.source))
        left_out.update(f"property {printable(name)}" for name in named if name not in TASK_KEYS)
    return gather(request, found, "add Points", home=request.home, left_out=left_out)


def _entry(
    place: str, feature: object, properties: Mapping[str, object], source: str
) -> FileTask | Fault:
    geometry = member(feature, "geometry", "type")
    if geometry != "Point":
        problem = f"{shown(geometry)} is not 'Point'" if geometry else "has no geometry"
        return Fault(source, f"{place}.geometry", problem, "give Points alone")
    coordinates = member(feature, "geometry", "coordinates")
    given = coordinates if isinstance(coordinates, list) else []
    numbers = [number for value in given if (number := number_of(value)) is not None]
    if not 2 <= len(numbers) == len(given) <= 3:
        remedy = "give [longitude, latitude] or [longitude, latitude, height]"
        place = f"{place}.geometry.coordinates"
        return Fault(source, place, "is not an array of 2 or 3 numbers", remedy)
    table: dict[str, object] = {}
    identity = properties.get("id", member(feature, "id"))
    if isinstance(identity, int) and not isinstance(identity, bool):
        identity = str(identity)  # as RFC 7946 allows
    if isinstance(identity, str):
        table["id"] = identity
    elif identity is not None:
        problem = f"{shown(identity)} is not an id"
        return Fault(source, f"{place}, id", problem, "give a string or a whole number")
    table |= dict(zip(("lon_deg", "lat_deg", "alt_m"), numbers, strict=False))
    for name, value in properties.items():
        if slip := slip_of(name, TASK_KEYS):
            where = f"{place}.properties"
            return Fault(source, where, f"{shown(name)} is unknown", f"did you mean {slip!r}?")
        if name in TASK_KEYS and name != "id" and value is not None:
            table[name] = value
    return FileTask(table, place)
