"""Points, lines and polygons with names and properties, as maps have them, and what they become.

A point becomes a task, a line a task along it, a polygon an area to cover, or a zone if its
properties, its name or its folder say so. Shared by GeoJSON, KML and Shapefiles, which all have
features of this shape; leaves out how each of them writes it.
"""

from __future__ import annotations

import re
import unicodedata
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum

from swarm.model.ids import valid_id
from swarm.runtime.errors import Fault
from swarm.scenario.findings import number_of, printable, shown
from swarm.scenario.task_files.task_file import (
    AREA_KEYS,
    LINE_KEYS,
    TASK_KEYS,
    ZONE_KEYS,
    Array,
    FileEntry,
    slip_of,
    spelt_number,
    too_many_points,
)

Place = tuple[float, ...]
"""Latitude and longitude [deg], and height above mean sea level [m] or not."""

ID_LENGTH = 48
"""Longest id that is made of a name: lines of an area have theirs with a number."""
_NO_FLY = re.compile(r"(zone|no[-_ ]?fly|keep[-_ ]?out)", re.IGNORECASE)
"""How names of zones begin."""
_WORDS = {"id", "kind", "camera"}
_TRUTHS = {
    "true": True,
    "yes": True,
    "1": True,
    "false": False,
    "no": False,
    "0": False,
    "": False,
}
_POINT_KEYS = (*TASK_KEYS, "height_m")
_OF_NAMES = ("name", "zone")
"""Properties that are heeded and become no key."""


class Form(Enum):
    """What a shape is."""

    POINT = "Point"
    LINE = "LineString"
    POLYGON = "Polygon"


@dataclass(frozen=True, slots=True)
class Shape:
    """One geometry of a feature."""

    form: Form
    rings: Sequence[Sequence[Place]]
    """Of a polygon its border, then its holes; of a line its points; of a point that one."""
    height_m: float | None = None
    """Above the ground there [m], where the file says so of all its points."""


@dataclass(frozen=True, slots=True)
class Feature:
    """One object on a map."""

    place: str
    """Where it stands in its file."""
    shapes: Sequence[Shape]
    properties: Mapping[str, object]
    """By name in small letters."""
    name: str | None = None
    """As a person reads it; not unique."""
    folders: Sequence[str] = ()
    """Names of the folders or layers that it lies in."""
    spelt: bool = False
    """Whether all properties are words, numbers among them."""


@dataclass(slots=True)
class FeatureReader:
    """Makes entries of features, one after the other."""

    source: str
    """Name of the file, for messages."""
    left_out: Counter[str] = field(default_factory=Counter)
    """Names of what was passed over."""
    _taken: set[str] = field(default_factory=set)
    """Ids that were made of names."""
    _again: Counter[str] = field(default_factory=Counter)
    """How often a name has been met again."""

    def entries(self, feature: Feature) -> Iterator[FileEntry | Fault]:
        """The tasks, areas and zones of a feature, or what is wrong with it."""
        keep_out = _is_zone(feature)
        known: set[str] = set()
        for shape in feature.shapes:
            known |= {*_keys_of(shape.form, keep_out=keep_out)}
        for name in feature.properties:
            if slip := slip_of(name, known):
                problem, remedy = f"{shown(name)} is unknown", f"did you mean {slip!r}?"
                yield Fault(self.source, f"{feature.place}.properties", problem, remedy)
                return
        self.left_out.update(
            f"property {printable(name)}"
            for name, value in feature.properties.items()
            if name not in known and name not in _OF_NAMES and value is not None
        )
        given = feature.properties.get("id")
        if isinstance(given, float) and given.is_integer():
            given = int(given)  # as tables of attributes have it
        if isinstance(given, int) and not isinstance(given, bool):
            given = str(given)  # as RFC 7946 allows
        if given is not None and not isinstance(given, str):
            problem, remedy = f"{shown(given)} is not an id", "give a string or a whole number"
            yield Fault(self.source, f"{feature.place}, id", problem, remedy)
            return
        for number, shape in enumerate(feature.shapes, start=1):
            suffix = f"-{number}" if feature.shapes[1:] else ""
            identity = f"{given}{suffix}" if given else self._id_of(feature.name, suffix)
            yield self._entry(feature, shape, identity, keep_out=keep_out)

    def _id_of(self, name: str | None, suffix: str) -> str | None:
        """``name`` as an id that nothing else of the file has had made of its name."""
        plain = unicodedata.normalize("NFKD", (name or "").replace("ß", "ss"))
        plain = "".join(letter for letter in plain if not unicodedata.combining(letter))
        words = re.sub(r"[^A-Za-z0-9_.-]+", "-", plain).strip("-_.")[:ID_LENGTH] + suffix
        if not words or not valid_id(words):
            return None
        identity = words
        while identity in self._taken:
            self._again[words] += 1
            identity = f"{words}-{self._again[words] + 1}"
        self._taken.add(identity)
        return identity

    def _entry(
        self, feature: Feature, shape: Shape, identity: str | None, *, keep_out: bool
    ) -> FileEntry | Fault:
        place, source = feature.place, self.source
        for ring in shape.rings:
            if (fault := too_many_points(ring, source, place)) is not None:
                return fault
        if keep_out and shape.form is not Form.POLYGON:
            problem = f"is a zone, and {shape.form.value} encloses nothing"
            return Fault(source, place, problem, "give a Polygon")
        table: dict[str, object] = {} if identity is None else {"id": identity}
        match shape.form:
            case Form.POINT:
                table |= zip(("lat_deg", "lon_deg", "alt_m"), shape.rings[0][0], strict=False)
            case Form.LINE:
                table["path"] = [list(point) for point in shape.rings[0]]
            case Form.POLYGON:
                border, *holes = (_open_ring(ring) for ring in shape.rings)
                table["polygon"] = border
                if holes:
                    table["holes"] = holes
        if shape.height_m is not None and not keep_out:
            table["height_m"] = shape.height_m
        for key in _keys_of(shape.form, keep_out=keep_out):
            value = feature.properties.get(key)
            if key == "id" or value is None or value == "":
                continue
            if feature.spelt:
                value = _spelt(key, value)
            if value is None:
                problem = f"{shown(feature.properties[key])} is not a number"
                where = f"{place}, {key}"
                return Fault(source, where, problem, "give a number such as 12.5")
            table[key] = value
        if keep_out and _word(feature.properties.get("zone")) == "inclusive":
            table["inclusive"] = True
        return FileEntry(table, place, _array_of(shape.form, keep_out=keep_out))


def place_of(numbers: Sequence[object]) -> Place | None:
    """Longitude, latitude and maybe a height, as maps write them; None if that is no place."""
    given = [number_of(value) for value in numbers]
    if not 2 <= len(given) <= 3 or None in given:
        return None
    lon_deg, lat_deg, *alt_m = (number for number in given if number is not None)
    return (lat_deg, lon_deg, *alt_m)


def _is_zone(feature: Feature) -> bool:
    """Whether it says that it is a zone: a property before its kind, its name and its folders."""
    told = feature.properties.get("zone")
    if told is not None:
        return _TRUTHS.get(_word(told), True)
    names = [feature.name, *feature.folders]
    return _word(feature.properties.get("kind")) == "zone" or (
        any(shape.form is Form.POLYGON for shape in feature.shapes)
        and any(_NO_FLY.match(name.strip()) for name in names if name)
    )


def _word(value: object) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return str(value).strip().lower() if isinstance(value, str | int) else ""


def _spelt(key: str, value: object) -> object:
    """A property that is a word in the file; None if it had to be a number and is none."""
    if key in _WORDS or not isinstance(value, str):
        return value
    if key == "inclusive":
        return _TRUTHS.get(_word(value), value)
    return spelt_number(value.strip())


def _keys_of(form: Form, *, keep_out: bool) -> Collection[str]:
    if keep_out:
        return (*ZONE_KEYS, "kind")
    return {Form.POINT: _POINT_KEYS, Form.LINE: LINE_KEYS, Form.POLYGON: AREA_KEYS}[form]


def _array_of(form: Form, *, keep_out: bool) -> Array:
    if keep_out:
        return Array.ZONE
    return Array.AREA if form is Form.POLYGON else Array.TASK


def _open_ring(ring: Iterable[Place]) -> list[list[float]]:
    """Corners without heights, the first not repeated at the end."""
    corners = [list(point[:2]) for point in ring]
    if len(corners) > 1 and corners[0] == corners[-1]:
        corners.pop()
    return corners
