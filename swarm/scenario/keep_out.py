"""Wind and zones of a scenario file: sound by themselves, and heeded by whatever has a place.

Whether a place or a line is clear of a zone is answered by swarm.allocation.legs, as for those
who fly. Heights do not matter here: a place in a zone is a fault whatever the zone's floor and
ceiling. Like all checks these read the parsed document and pass over what has the wrong shape.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

from swarm.model import Origin, Zone, ZoneId
from swarm.scenario.findings import Document, Finding, Path, number_of, shown
from swarm.scenario.ground import terrain_faults
from swarm.scenario.places import (
    LINE,
    POLYGON,
    FlatPoint,
    entries,
    origin_of,
    outline_faults,
    outline_m,
    place_m,
)

_GREATEST_MARGIN_M = 1e6
_NAMELESS = ZoneId("z")
_LONG = re.compile(r"-?\d+\.\d{4,}")
"""Numbers of more digits than a person wants to read."""
_SIMPLE = "give three corners or more, round a simple polygon"


def field_faults(document: Document) -> Iterator[Finding]:
    """What is wrong with wind and zones, and with places because of them."""
    yield from _slow_uavs(document)
    yield from terrain_faults(document)
    frame = origin_of(document.get("origin"))
    zones: list[_Keeping] = []
    for index, entry in entries(document, "zone"):
        path: Path = ("zone", index)
        faults = [
            *outline_faults(document, path, entry, POLYGON),
            *unsound_rings(path, entry, frame),
        ]
        yield from faults
        yield from _unsound_heights(path, entry)
        if not faults and (keeping := _keeping(entry, index, frame)) is not None:
            zones.append(keeping)
    if zones:
        yield from _forbidden(zones, _margin_m(document), _Spots.of(document, frame))


def _slow_uavs(document: Document) -> Iterator[Finding]:
    mission = document.get("mission")
    wind = mission.get("wind_m_s") if isinstance(mission, Mapping) else None
    numbers = [number_of(value) for value in wind] if isinstance(wind, list) else []
    match numbers:
        case [float(east_m_s), float(north_m_s)]:
            wind_m_s = math.hypot(east_m_s, north_m_s)
        case _:
            return
    for index, entry in entries(document, "uav"):
        airspeed_m_s = number_of(entry.get("airspeed_m_s"))
        if airspeed_m_s is not None and 0.0 < airspeed_m_s <= wind_m_s:
            problem = f"{shown(airspeed_m_s)} is not more than the wind's {wind_m_s:g} m/s"
            remedy = "give a faster UAV or a weaker wind_m_s"
            yield Finding(("uav", index, "airspeed_m_s"), problem, remedy)


# -- zones by themselves ------------------------------------------------------------------


def unsound_rings(
    path: Path, entry: Mapping[str, object], frame: Origin | None
) -> Iterator[Finding]:
    """Rings that are no polygons, one by one; then, of sound ones, holes that do not fit."""
    key = POLYGON.metres if POLYGON.metres in entry else POLYGON.degrees
    border = outline_m(entry, POLYGON, frame)
    rings = [((*path, key), border), *_holes(path, entry)]
    sound = True
    for place, ring in rings:
        problem = None if ring is None else _problem_of(ring)
        sound = sound and ring is not None and problem is None
        if problem is not None:
            yield Finding(place, problem, _SIMPLE)
    if sound and border is not None and rings[1:]:
        holes = [ring for _, ring in rings[1:] if ring is not None]
        if (problem := _problem_of(border, holes)) is not None:
            remedy = "give holes inside the polygon, apart from each other"
            yield Finding((*path, "holes_m"), problem, remedy)


def _holes(
    path: Path, entry: Mapping[str, object]
) -> Iterator[tuple[Path, list[FlatPoint] | None]]:
    holes = entry.get("holes_m")
    for number, hole in enumerate(holes if isinstance(holes, list) else ()):
        yield (*path, "holes_m", number), outline_m({POLYGON.metres: hole}, POLYGON, None)


def _problem_of(ring: Sequence[FlatPoint], holes: Iterable[Sequence[FlatPoint]] = ()) -> str | None:
    """What the model has against such a zone, in its words; None if nothing."""
    try:
        Zone(_NAMELESS, tuple(ring), tuple(map(tuple, holes)))
    except ValueError as error:
        # "polygon of zone z crosses …", "holes of zone z: a hole …", "… encloses nothing: [(…"
        words = str(error).partition(f" of zone {_NAMELESS}")[2].lstrip(": ")
        return _LONG.sub(lambda found: f"{float(found[0]):g}", words.partition(": [")[0])
    return None


def _unsound_heights(path: Path, entry: Mapping[str, object]) -> Iterator[Finding]:
    floor_m, ceiling_m = number_of(entry.get("floor_m")), number_of(entry.get("ceiling_m"))
    if floor_m is not None and ceiling_m is not None and floor_m >= ceiling_m:
        problem = f"{shown(ceiling_m)} is not above floor_m = {shown(floor_m)}"
        yield Finding((*path, "ceiling_m"), problem, "give a ceiling above the floor")


# -- places in zones ----------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class _Keeping:
    """A sound zone, and how to speak of it."""

    zone: Zone
    name: str


def _keeping(entry: Mapping[str, object], index: int, frame: Origin | None) -> _Keeping | None:
    ring = outline_m(entry, POLYGON, frame)
    holes = [hole for _, hole in _holes((), entry)]
    inclusive = entry.get("inclusive", False)
    if ring is None or not isinstance(inclusive, bool) or any(hole is None for hole in holes):
        return None
    rings = tuple(tuple(hole) for hole in holes if hole is not None)
    zone = Zone(_NAMELESS, tuple(ring), rings, inclusive=inclusive)
    identity = entry.get("id")
    named = isinstance(identity, str) and identity != ""
    return _Keeping(zone, f"zone {shown(identity)}" if named else f"zone[{index}]")


@dataclass(frozen=True, slots=True)
class _Spots:
    """All places of a document, and the straight pieces of its lines."""

    paths: Sequence[Path]
    """Where each place stands in the file."""
    places_m: Sequence[FlatPoint]
    pieces: Sequence[tuple[int, int]]
    """Numbers of the places between which lines go."""

    @classmethod
    def of(cls, document: Document, frame: Origin | None) -> _Spots:
        paths: list[Path] = []
        places_m: list[FlatPoint] = []
        pieces: list[tuple[int, int]] = []
        for name in ("uav", "base", "task"):
            for index, entry in entries(document, name):
                key = next((key for key in (LINE.metres, LINE.degrees) if key in entry), None)
                if name == "task" and key is not None:
                    line = outline_m(entry, LINE, frame) or []
                    numbers = range(len(paths), len(paths) + len(line))
                    pieces += pairwise(numbers)
                    paths += [(name, index, key, number) for number in range(len(line))]
                    places_m += line
                elif (place := place_m(entry, frame)) is not None:
                    key = "position_m" if "position_m" in entry else "lat_deg"
                    paths.append((name, index, key))
                    places_m.append(place)
        return cls(paths, places_m, pieces)


def _margin_m(document: Document) -> float:
    mission = document.get("mission")
    margin_m = number_of(mission.get("zone_margin_m")) if isinstance(mission, Mapping) else None
    return margin_m if margin_m is not None and 0.0 <= margin_m <= _GREATEST_MARGIN_M else 0.0


def _forbidden(zones: Iterable[_Keeping], margin_m: float, spots: _Spots) -> Iterator[Finding]:
    """Places and lines in zones or nearer than the margin, zone by zone."""
    import numpy as np

    from swarm.allocation.legs.obstacles import Obstacles

    places_m = np.array(spots.places_m, dtype=np.float64).reshape(-1, 2)
    from_, to = np.array(spots.pieces, dtype=np.int64).reshape(-1, 2).T
    for keeping in zones:
        kept, bare = Obstacles([keeping.zone], margin_m), Obstacles([keeping.zone])
        free, outside = kept.free(places_m), bare.free(places_m)
        for number in np.flatnonzero(~free).tolist():
            yield _in_zone(spots.paths[number], keeping, margin_m, inside=not outside[number])
        # A piece with an end that is told of already says nothing new.
        new = free[from_] & free[to]
        met = ~kept.clear(places_m[from_], places_m[to]) & new
        crossed = ~bare.clear(places_m[from_], places_m[to])
        for piece in np.flatnonzero(met).tolist():
            path = spots.paths[spots.pieces[piece][1]]
            yield _through_zone(path, keeping, margin_m, inside=bool(crossed[piece]))


def _in_zone(path: Path, keeping: _Keeping, margin_m: float, *, inside: bool) -> Finding:
    if not inside:
        problem = f"is nearer than zone_margin_m = {margin_m:g} to {_border(keeping)}"
        return Finding(path, problem, "move it away, or give a smaller margin")
    if keeping.zone.inclusive:
        problem = f"lies outside of {keeping.name}, the only place where to fly"
        return Finding(path, problem, "move it into the zone, or change the zone")
    return Finding(path, f"lies in {keeping.name}", "move it out of the zone, or change the zone")


def _through_zone(path: Path, keeping: _Keeping, margin_m: float, *, inside: bool) -> Finding:
    """Of a piece between two places that are right themselves."""
    way = "the line to it"
    if not inside:
        problem = f"{way} comes nearer than zone_margin_m = {margin_m:g} to {_border(keeping)}"
        return Finding(path, problem, "lead it round, or give a smaller margin")
    if keeping.zone.inclusive:
        problem = f"{way} leaves {keeping.name}, the only place where to fly"
        return Finding(path, problem, "lead it inside the zone, or change the zone")
    return Finding(
        path, f"{way} crosses {keeping.name}", "lead it round the zone, or make two tasks of it"
    )


def _border(keeping: _Keeping) -> str:
    return f"the border of {keeping.name}" if keeping.zone.inclusive else keeping.name
