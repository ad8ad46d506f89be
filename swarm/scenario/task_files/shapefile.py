"""Shapefiles (``.shp`` with ``.dbf``, ``.prj`` and ``.cpg`` beside it), also several in a ``.zip``.

Format: ESRI Shapefile Technical Description, July 1998; attributes in tables of dBASE. Points,
lines and polygons, also with heights, which then are above mean sea level. The columns of the table
are properties as those of GeoJSON; names of keys cut to the ten letters of a column are understood.
Places are in whatever projection the ``.prj`` names (swarm.scenario.task_files.projection).

Read here and by no library: what there are open names on the network, warn on standard error, or
need GDAL. Leaves out: MultiPatch, memos and dates.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import PurePosixPath

from swarm.runtime.errors import Fault, InputError
from swarm.scenario.findings import printable
from swarm.scenario.task_files.archive import members_of
from swarm.scenario.task_files.attribute_table import read_table
from swarm.scenario.task_files.features import Feature, FeatureReader, Form, Place, Shape
from swarm.scenario.task_files.projection import Projection
from swarm.scenario.task_files.shape_records import (
    RecordShape,
    read_record_shapes,
    rings_of_polygons,
)
from swarm.scenario.task_files.task_file import (
    AREA_KEYS,
    MOST_ENTRIES,
    MOST_POINTS,
    ZONE_KEYS,
    FileEntry,
    ReadOptions,
    TaskFile,
    gather,
)

PARTS = (".shp", ".dbf", ".prj", ".cpg")
"""Files of a layer that are read; an index (``.shx``) is not needed."""
_LONGEST_COLUMN = 10
_CUT = {
    key[:_LONGEST_COLUMN]: key for key in (*AREA_KEYS, *ZONE_KEYS) if len(key) > _LONGEST_COLUMN
}
"""Keys by what is left of them in the name of a column."""


@dataclass(frozen=True, slots=True)
class Layer:
    """The files of one Shapefile."""

    source: str
    """Name of the file, for messages."""
    parts: Mapping[str, bytes]
    """Contents by suffix; only ``.shp`` must be there."""
    name: str = ""
    """Of the layer in an archive."""


def read_layers(layers: Sequence[Layer], request: ReadOptions) -> TaskFile:
    """What is in Shapefiles.

    Raises:
        InputError: with every fault of the files.
    """
    reader = FeatureReader(request.source)
    found: list[FileEntry | Fault] = []
    notes: list[str] = []
    for layer in layers:
        outlines = read_record_shapes(layer.parts[".shp"], layer.source)
        projection = Projection.of(layer.parts.get(".prj"), layer.source)
        if projection.note and projection.note not in notes:
            notes.append(projection.note)
        for feature in _features(layer, outlines, projection):
            found += [feature] if isinstance(feature, Fault) else reader.entries(feature)
            if len(found) > MOST_ENTRIES:
                break
    return gather(
        request,
        found,
        "add points, lines or polygons",
        home=request.home,
        left_out=reader.left_out,
        notes=notes,
    )


def read_shapefiles_in_zip(data: bytes, request: ReadOptions) -> TaskFile:
    """What is in all Shapefiles of an archive.

    Raises:
        InputError: with every fault of the archive.
    """
    members = members_of(data, PARTS, request.source)
    layers: dict[str, dict[str, bytes]] = {}
    for name, content in members.items():
        path = PurePosixPath(name)
        if "__MACOSX" not in path.parts:  # where that system keeps what it knows of each file
            layers.setdefault(str(path.with_suffix("")), {})[path.suffix.lower()] = content
    found = [
        Layer(f"{request.source}: {printable(name)}", parts, PurePosixPath(name).name)
        for name, parts in layers.items()
        if ".shp" in parts
    ]
    if not found:
        remedy = "give a zip archive with .shp, .dbf and .prj"
        raise InputError(Fault(request.source, "", "holds no .shp file", remedy))
    return read_layers(found, request)


def _features(
    layer: Layer, outlines: Sequence[RecordShape | None], projection: Projection
) -> Iterator[Feature | Fault]:
    table = layer.parts.get(".dbf")
    rows = None
    if table is not None:
        rows = read_table(table, layer.parts.get(".cpg"), layer.source)
        if len(rows) != len(outlines):
            problem = f"has {len(outlines)} shapes and a .dbf of {len(rows)} rows"
            remedy = "give the .dbf that was saved with it"
            raise InputError(Fault(layer.source, "", problem, remedy))
    for number, outline in enumerate(outlines):
        if outline is None:  # a row without a shape
            continue
        place = f"{layer.name + ', ' if layer.name else ''}record {number + 1}"
        given = {} if rows is None else rows[number]
        properties = {_CUT.get(name, name): value for name, value in given.items()}
        if len(outline.x) > MOST_POINTS * max(1, len(outline.parts)):
            problem, remedy = f"has {len(outline.x)} points", "simplify it"
            yield Fault(layer.source, place, problem, remedy)
            continue
        placed = projection.places(outline.x, outline.y)
        if isinstance(placed, str):
            yield Fault(layer.source, place, placed, projection.remedy)
            continue
        name = properties.get("name")
        yield Feature(
            place,
            list(_shapes(outline, placed)),
            properties,
            name if isinstance(name, str) else None,
            [layer.name] if layer.name else [],
        )


def _shapes(outline: RecordShape, placed: Sequence[tuple[float, float]]) -> Iterator[Shape]:
    heights_m = outline.heights_m
    points: list[Place] = (
        list(placed)
        if heights_m is None
        else [(*place, height_m) for place, height_m in zip(placed, heights_m, strict=True)]
    )
    if outline.form is Form.POINT:
        for point in points:
            yield Shape(Form.POINT, [[point]])
        return
    ends = [*outline.parts[1:], len(points)]
    parts = [points[begin:end] for begin, end in zip(outline.parts, ends, strict=True)]
    if outline.form is Form.LINE:
        for part in parts:
            yield Shape(Form.LINE, [part])
        return
    for rings in rings_of_polygons(parts):
        yield Shape(Form.POLYGON, rings)
