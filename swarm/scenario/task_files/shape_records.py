"""The records of a ``.shp`` file: points, lines and rings, in the coordinates of the file.

Format: ESRI Shapefile Technical Description, July 1998. Every length is checked against the bytes
that are there before anything is made of it.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from swarm.runtime.errors import Fault, InputError
from swarm.scenario.task_files.features import Form, Place
from swarm.scenario.task_files.task_file import MOST_ENTRIES

_FILE_CODE = 9994
_HEADER = 100
_NULL = 0
_FORMS = {1: Form.POINT, 8: Form.POINT, 3: Form.LINE, 5: Form.POLYGON}
"""Types of shapes; ten more is the type with heights, twenty more with measures."""
_WITH_HEIGHTS = 10
_WITH_MEASURES = 20
_BOX = 32
_LEAST_VALUE = -1e38
"""Smaller numbers stand for none."""
_MOST_RINGS = 1000
"""More in one polygon are refused: borders and holes have to be told from each other."""
_GIVE = "save the Shapefile again"


@dataclass(frozen=True, slots=True)
class RecordShape:
    """The shape of one record."""

    form: Form
    x: npt.NDArray[np.float64]
    """(n,) to the east or longitudes, in the units of the projection."""
    y: npt.NDArray[np.float64]
    parts: Sequence[int]
    """Index of the first point of each line or ring; empty of points."""
    heights_m: Sequence[float] | None = None
    """Of each point, if the file has any other than 0 [m]."""


def read_record_shapes(data: bytes, source: str) -> list[RecordShape | None]:
    """The shapes of a file, None where a record has none.

    Raises:
        InputError: it is no such file, or is cut off.
    """
    if len(data) < _HEADER or struct.unpack_from(">i", data)[0] != _FILE_CODE:
        raise InputError(Fault(source, "", "is no Shapefile", "give a .shp file"))
    outlines: list[RecordShape | None] = []
    at = _HEADER
    while at < len(data):
        if len(outlines) == MOST_ENTRIES:
            problem = f"has more than {MOST_ENTRIES} records"
            raise InputError(Fault(source, "", problem, "give fewer at a time"))
        place = f"record {len(outlines) + 1}"
        if at + 12 > len(data):
            raise InputError(Fault(source, place, "is cut off", _GIVE))
        length = 2 * struct.unpack_from(">i", data, at + 4)[0]
        begin, end = at + 8, at + 8 + length
        if length < 4 or end > len(data):
            raise InputError(Fault(source, place, "is cut off", _GIVE))
        try:
            outlines.append(_outline(data[begin:end]))
        except (struct.error, ValueError) as error:
            problem = "is damaged" if isinstance(error, struct.error) else str(error)
            raise InputError(Fault(source, place, problem, _GIVE)) from error
        at = end
    return outlines


def _outline(record: bytes) -> RecordShape | None:
    """The shape of a record's content.

    Raises:
        ValueError: with words about what is wrong with it.
        struct.error: it is too short.
    """
    kind = struct.unpack_from("<i", record)[0]
    if kind == _NULL:
        return None
    form = _FORMS.get(kind % 10)
    more = kind - kind % 10
    if form is None or more not in (0, _WITH_HEIGHTS, _WITH_MEASURES):
        raise ValueError(f"is of type {kind}, which is nothing to fly to")
    if kind % 10 == 1:
        x, y = struct.unpack_from("<2d", record, 4)
        z = struct.unpack_from("<d", record, 20) if more == _WITH_HEIGHTS else None
        return RecordShape(form, np.array([x]), np.array([y]), (), _heights_m(z))
    at = 4 + _BOX
    n_part = 0
    if form is not Form.POINT:
        n_part = struct.unpack_from("<i", record, at)[0]
        at += 4
    n_point = struct.unpack_from("<i", record, at)[0]
    at += 4
    parts_end = at + 4 * n_part
    points_end = parts_end + 16 * n_point
    if n_part < 0 or n_point < 0 or points_end > len(record):
        raise ValueError("has fewer points than it says")
    parts = np.frombuffer(record, "<i4", n_part, at).tolist()
    points = np.frombuffer(record, "<f8", 2 * n_point, parts_end).reshape(-1, 2)
    bounds = [*parts, n_point]
    if form is not Form.POINT and (
        n_part == 0 or parts[0] != 0 or any(a >= b for a, b in pairwise(bounds))
    ):
        raise ValueError("has parts that are none")
    if form is Form.POLYGON and n_part > _MOST_RINGS:
        raise ValueError(f"has {n_part} rings, more than {_MOST_RINGS}")
    z = None
    if more == _WITH_HEIGHTS:
        if points_end + 16 + 8 * n_point > len(record):
            raise ValueError("has fewer heights than points")
        z = np.frombuffer(record, "<f8", n_point, points_end + 16).tolist()
    return RecordShape(form, points[:, 0], points[:, 1], parts, _heights_m(z))


def _heights_m(values: Sequence[float] | None) -> Sequence[float] | None:
    """Heights that are meant; programs write 0, or a huge negative number, where there is none."""
    if values is None or all(not value or value < _LEAST_VALUE for value in values):
        return None
    return values


def rings_of_polygons(parts: Sequence[Sequence[Place]]) -> Iterator[list[Sequence[Place]]]:
    """Polygons of the rings of a record: each border, clockwise, with the holes inside of it.

    A hole in no border is a polygon of its own: some programs turn borders the other way.
    """
    import shapely

    clockwise = [_turn(ring) < 0.0 for ring in parts]
    borders = [ring for ring, is_border in zip(parts, clockwise, strict=True) if is_border]
    holes = [ring for ring, is_border in zip(parts, clockwise, strict=True) if not is_border]
    polygons: list[list[Sequence[Place]]] = [[border] for border in borders]
    shapes = [shapely.Polygon([p[:2] for p in ring]) for ring in borders if len(ring) >= 4]
    if len(shapes) < len(borders):  # told of when it is made an area
        shapes = []
    for shape in shapes:
        shapely.prepare(shape)
    for hole in holes:
        corner = shapely.Point(hole[0][:2])
        around = [number for number, shape in enumerate(shapes) if shape.covers(corner)]
        if around:
            polygons[min(around, key=lambda number: shapes[number].area)].append(hole)
        else:
            polygons.append([hole])
    yield from polygons


def _turn(ring: Sequence[Place]) -> float:
    """Twice the area of a ring of latitudes and longitudes; negative if it turns clockwise."""
    lat, lon = np.array([point[:2] for point in ring]).T
    return float(np.sum(lon * np.roll(lat, -1) - np.roll(lon, -1) * lat))
