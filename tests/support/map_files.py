"""Features on a map, and how programs write them: GeoJSON, KML and Shapefiles in UTM."""

from __future__ import annotations

import io
import itertools
import json
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any
from xml.sax.saxutils import escape

import pyproj
import shapefile
from hypothesis import strategies as st

from swarm.model.frames import Origin, wgs84_from_enu

HOME = Origin(47.0, 8.0, 400.0)
UTM = 32632
Corner = tuple[float, float]
"""East and north of `HOME` [m]."""


@dataclass(frozen=True)
class Drawn:
    """A line, or a polygon with holes: rings of corners, the first not repeated."""

    name: str
    rings: tuple[tuple[Corner, ...], ...]
    is_line: bool
    spacing_m: float | None = None

    def rings_deg(self) -> list[list[list[float]]]:
        """Longitudes and latitudes; rings of polygons closed."""
        rings = [[*ring] if self.is_line else [*ring, ring[0]] for ring in self.rings]
        return [
            [list(wgs84_from_enu(HOME, (*corner, 0.0))[1::-1]) for corner in ring] for ring in rings
        ]


def square(east_m: float, north_m: float, side_m: float) -> tuple[Corner, ...]:
    return (
        (east_m, north_m),
        (east_m + side_m, north_m),
        (east_m + side_m, north_m + side_m),
        (east_m, north_m + side_m),
    )


@st.composite
def drawings(draw: st.DrawFn) -> list[Drawn]:
    """A few lines and squares, some with a hole, none of which meet."""
    found = []
    for number in range(draw(st.integers(1, 4))):
        east_m, north_m = 1000.0 * number - 2000.0, draw(st.floats(-3000.0, 3000.0))
        spacing_m = draw(st.none() | st.sampled_from([12.5, 30.0]))
        if draw(st.booleans()):
            steps = draw(st.lists(st.floats(10.0, 100.0), min_size=1, max_size=4))
            line = [(east_m, north_m)]
            for step_m in steps:
                line.append((line[-1][0] + step_m, line[-1][1] - step_m))
            found.append(Drawn(f"n{number}", (tuple(line),), True))
        else:
            rings = [square(east_m, north_m, draw(st.floats(50.0, 400.0)))]
            if draw(st.booleans()):
                rings.append(square(east_m + 10.0, north_m + 10.0, 20.0)[::-1])
            found.append(Drawn(f"n{number}", tuple(rings), False, spacing_m))
    return found


def as_geojson(drawn: Sequence[Drawn]) -> str:
    features = []
    for each in drawn:
        rings = each.rings_deg()
        coordinates: Any = rings[0] if each.is_line else rings
        kind = "LineString" if each.is_line else "Polygon"
        features.append(
            {
                "type": "Feature",
                "properties": {"name": each.name, "spacing_m": each.spacing_m},
                "geometry": {"type": kind, "coordinates": coordinates},
            }
        )
    return json.dumps({"type": "FeatureCollection", "features": features})


def as_kml(drawn: Sequence[Drawn]) -> bytes:
    return kml("".join(_placemark(each) for each in drawn))


def kml(body: str) -> bytes:
    head = '<?xml version="1.0" encoding="UTF-8"?>\n<kml xmlns="http://www.opengis.net/kml/2.2">'
    return f"{head}<Document>{body}</Document></kml>".encode()


def _placemark(drawn: Drawn) -> str:
    rings = [
        "<coordinates>" + " ".join(f"{lon!r},{lat!r},0" for lon, lat in ring) + "</coordinates>"
        for ring in drawn.rings_deg()
    ]
    if drawn.is_line:
        shape = f"<LineString>{rings[0]}</LineString>"
    else:
        border, *holes = (f"<LinearRing>{ring}</LinearRing>" for ring in rings)
        inner = "".join(f"<innerBoundaryIs>{hole}</innerBoundaryIs>" for hole in holes)
        shape = f"<Polygon><outerBoundaryIs>{border}</outerBoundaryIs>{inner}</Polygon>"
    data = ""
    if drawn.spacing_m is not None:
        value = f'<Data name="spacing_m"><value>{drawn.spacing_m!r}</value></Data>'
        data = f"<ExtendedData>{value}</ExtendedData>"
    return f"<Placemark><name>{escape(drawn.name)}</name>{data}{shape}</Placemark>"


def as_shapefiles(drawn: Sequence[Drawn]) -> bytes:
    """A zip archive with a layer of lines and one of polygons, in UTM, written by pyshp."""
    transform = pyproj.Transformer.from_crs(4326, UTM, always_xy=True).transform
    members: dict[str, bytes] = {}
    for name, kind in (("lines", shapefile.POLYLINE), ("polygons", shapefile.POLYGON)):
        chosen = [each for each in drawn if each.is_line is (name == "lines")]
        if not chosen:
            continue
        files = LayerFiles()
        with files.writer(kind) as writer:
            writer.field("name", "C", 40)
            writer.field("spacing_m", "N", 20, 6)
            for each in chosen:
                rings = [
                    [list(transform(lon, lat)) for lon, lat in ring] for ring in each.rings_deg()
                ]
                if each.is_line:
                    writer.line(rings)
                else:
                    writer.poly([_turned(ring, index > 0) for index, ring in enumerate(rings)])
                writer.record(each.name, each.spacing_m)
        members |= files.members(name, pyproj.CRS.from_epsg(UTM).to_wkt("WKT1_ESRI"))
    return zipped(members)


def _turned(ring: list[list[float]], is_hole: bool) -> list[list[float]]:
    """Borders clockwise and holes the other way, as the format has it."""
    twice = sum(a[0] * b[1] - b[0] * a[1] for a, b in itertools.pairwise(ring))
    return ring if (twice > 0.0) is is_hole else ring[::-1]


class LayerFiles:
    """A Shapefile in memory."""

    def __init__(self) -> None:
        self.files = {suffix: io.BytesIO() for suffix in ("shp", "shx", "dbf")}

    def writer(self, kind: int) -> shapefile.Writer:
        """What writes it, once it is left."""
        return shapefile.Writer(shapeType=kind, encoding="utf-8", **self.files)

    def members(self, name: str, prj: str | None) -> dict[str, bytes]:
        """Its files by name."""
        found = {f"{name}.{suffix}": file.getvalue() for suffix, file in self.files.items()}
        found[f"{name}.cpg"] = b"UTF-8"
        if prj is not None:
            found[f"{name}.prj"] = prj.encode()
        return found


def zipped(members: Mapping[str, bytes], method: int = zipfile.ZIP_DEFLATED) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", method) as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    return file.getvalue()
