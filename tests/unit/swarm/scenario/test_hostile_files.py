"""Files that are made to hurt take one line and status 2, in little memory.

Limits are told by what is read and unpacked, never by how long it takes: the largest file that is
read at all has 16 MiB.
"""

from __future__ import annotations

import json
import math
import resource
import struct
import tracemalloc
import zipfile
from collections.abc import Callable
from importlib.metadata import EntryPoint
from pathlib import Path

import pyproj
import pytest
import shapefile
from hypothesis import given, settings
from hypothesis import strategies as st

from swarm.cli import main
from swarm.runtime.errors import InputError
from swarm.scenario.files import LARGEST_FILE_BYTES
from swarm.scenario.task_files import ReadOptions
from swarm.scenario.task_files.kml_file import read_kml, read_kmz
from swarm.scenario.task_files.shapefile import Layer, read_layers, read_shapefiles_in_zip
from tests.support.map_files import HOME, LayerFiles, kml, zipped
from tests.support.task_files import DATA

COMMANDS = {"import": EntryPoint("import", "swarm.scenario.cli:import_tasks", "peckorder.commands")}
MOST_BYTES = 400 * 2**20
"""Of memory that Python itself takes for any of these files."""
WGS84 = pyproj.CRS.from_epsg(4326).to_wkt("WKT1_ESRI")
POINT = "<Placemark><name>a</name><Point><coordinates>8,47</coordinates></Point></Placemark>"


def geojson(kind: str, coordinates: object, **more: object) -> bytes:
    feature = {
        "type": "Feature",
        "properties": {"spacing_m": 25.0},
        "geometry": {"type": kind, "coordinates": coordinates},
    }
    return json.dumps({"type": "FeatureCollection", "features": [feature], **more}).encode()


def ring(*corners: tuple[float, float]) -> list[list[list[float]]]:
    return [[[8.0 + east / 1e5, 47.0 + north / 1e5] for east, north in (*corners, corners[0])]]


def circle(corners: int) -> list[list[list[float]]]:
    angles = [2.0 * math.pi * number / corners for number in range(corners)]
    return ring(*((900.0 * math.sin(a), 900.0 * math.cos(a)) for a in angles))


def star(corners: int) -> list[list[list[float]]]:
    """A polygon of so many corners that every line across it is cut into a thousand pieces."""
    angles = [2.0 * math.pi * number / corners for number in range(corners)]
    reach = [900.0 if number % 2 else 100.0 for number in range(corners)]
    return ring(*((r * math.sin(a), r * math.cos(a)) for r, a in zip(reach, angles, strict=True)))


def areas(count: int) -> bytes:
    """Areas that are each cut into some thousands of lines."""
    rings = [ring(*((x + 3000.0 * n, y) for x, y in CORNERS)) for n in range(count)]
    geometry = {"type": "MultiPolygon", "coordinates": rings}
    feature = {"type": "Feature", "properties": {"spacing_m": 0.3}, "geometry": geometry}
    return json.dumps(feature).encode()


CORNERS = ((0.0, 0.0), (0.0, 1300.0), (1300.0, 1300.0), (1300.0, 0.0))


def plan(**more: object) -> bytes:
    mission = {"items": [], "plannedHomePosition": [47.0, 8.0, 400.0], "version": 2}
    return json.dumps({"fileType": "Plan", "version": 1, "mission": mission | more}).encode()


def corridor(points: int, width_m: float) -> bytes:
    line = [[47.0 + 1e-5 * number, 8.0] for number in range(points)]
    camera = {"AdjustedFootprintSide": 1.0, "DistanceToSurface": 50, "DistanceMode": 1}
    item = {
        "type": "ComplexItem",
        "complexItemType": "CorridorScan",
        "CorridorWidth": width_m,
        "polyline": line,
        "TransectStyleComplexItem": {"CameraCalc": camera},
    }
    return plan(items=[item])


def squares(kind: int, count: int) -> dict[str, bytes]:
    files = LayerFiles()
    with files.writer(kind) as writer:
        writer.field("kind", "C", 4)
        for number in range(count):
            writer.point(8.0 + 1e-6 * number, 47.0)
            writer.record("a")
    return files.members("p", WGS84)


BILLION_LAUGHS = (
    b'<?xml version="1.0"?><!DOCTYPE kml [<!ENTITY a "ha">'
    + b"".join(b'<!ENTITY %c "%s">' % (98 + n, b"&%c;" % (97 + n) * 10) for n in range(9))
    + b"]><kml><Document><name>&j;</name></Document></kml>"
)
EXTERNAL = (
    b'<?xml version="1.0"?><!DOCTYPE kml [<!ENTITY x SYSTEM "file:///etc/passwd">]>'
    b"<kml><Document><name>&x;</name></Document></kml>"
)

HOSTILE: dict[str, tuple[str, Callable[[], bytes], str]] = {
    "polygon round the Earth": (
        "a.geojson",
        lambda: geojson("Polygon", [[[-179, -80], [179, -80], [179, 80], [-179, 80], [-179, -80]]]),
        "features[0]: lies 19299 km from home",
    ),
    "longitude and latitude swapped": (
        "a.geojson",
        lambda: geojson("Point", [47.0, 8.0]),
        "give another --home, or latitude and longitude the other way round",
    ),
    "polygon as large as a country": (
        "a.geojson",
        lambda: geojson("Polygon", [[[6, 46], [10, 46], [10, 48], [6, 48], [6, 46]]]),
        "features[0], spacing_m: ",
    ),
    "ragged polygon": (
        "a.geojson",
        lambda: geojson("Polygon", star(9998)),
        "features[0], spacing_m: 25 m between lines take ",
    ),
    "areas of many lines": (
        "a.geojson",
        lambda: areas(9),
        "lines make more than 20000 tasks of the mission; make several missions of it",
    ),
    "self-intersection": (
        "a.geojson",
        lambda: geojson("Polygon", ring((0, 0), (100, 100), (100, 0), (0, 50))),
        "features[0], polygon: crosses or touches itself",
    ),
    "two corners": (
        "a.geojson",
        lambda: geojson("Polygon", ring((0, 0), (100, 100))),
        "features[0], polygon: ",
    ),
    "nothing inside": (
        "a.geojson",
        lambda: geojson("Polygon", ring((0, 0), (50, 0), (100, 0))),
        "features[0], polygon: ",
    ),
    "NaN": ("a.geojson", lambda: geojson("Point", [math.nan, 47.0]), "is not an array of 2 or 3"),
    "Infinity": (
        "a.geojson",
        lambda: geojson("LineString", [[8.0, 47.0], [8.0, math.inf]]),
        "features[0].geometry.coordinates[1]: is not an array of 2 or 3 numbers",
    ),
    "line of a million points": (
        "a.kml",
        lambda: kml(
            "<Placemark><LineString><coordinates>"
            + "8,47 8,47.1 " * 500_000
            + "</coordinates></LineString></Placemark>"
        ),
        "has 1000000 points; simplify it to 10000 or fewer",
    ),
    "polygon of many corners": (
        "a.geojson",
        lambda: geojson("Polygon", circle(200_000)),
        "has 200001 points; simplify it to 10000 or fewer",
    ),
    "hundred thousand points": (
        "a.kml",
        lambda: kml(POINT * 100_000),
        "has more than 10000 placemarks; give fewer at a time",
    ),
    "hundred thousand features": (
        "a.geojson",
        lambda: json.dumps(
            {
                "type": "FeatureCollection",
                "features": [{"geometry": {"type": "Point", "coordinates": [8, 47]}}] * 100_000,
            }
        ).encode(),
        "is one more than the 10000 entries that a file may hold",
    ),
    "nested JSON": ("a.geojson", lambda: b'{"a":' * 200_000, "is not JSON of any use"),
    "nested collections": (
        "a.geojson",
        lambda: json.dumps(
            {
                "type": "Feature",
                "geometry": {
                    "type": "GeometryCollection",
                    "geometries": [{"type": "GeometryCollection", "geometries": []}],
                },
            }
        ).encode(),
        "features[0].geometry.geometries[0]: 'GeometryCollection' is nothing to fly to",
    ),
    "nested XML": ("a.kml", lambda: b"<kml>" + b"<Folder>" * 500_000, "is nested too deeply"),
    "entities in entities": ("a.kml", lambda: BILLION_LAUGHS, "has a DOCTYPE"),
    "entity of another file": ("a.kml", lambda: EXTERNAL, "has a DOCTYPE"),
    "no XML": ("a.kml", lambda: b"\x89PNG\r\n\x1a\n", "is not XML: "),
    "XML that is cut off": ("a.kml", lambda: kml(POINT)[:-9], "is not XML: "),
    "other XML": ("a.kml", lambda: b"<svg/>", "is not KML; give a KML file"),
    "unknown encoding": (
        "a.kml",
        lambda: b'<?xml version="1.0" encoding="klingon"?><kml/>',
        "is not XML: ",
    ),
    "KML that is not UTF-8": ("a.kml", lambda: b"<kml><name>\xe4</name></kml>", "is not XML: "),
    "GeoJSON that is not UTF-8": (
        "a.geojson",
        lambda: geojson("Point", [8.0, 47.0])[:-1] + b"\xff",
        "byte 0xff is not UTF-8",
    ),
    "UTF-16": (
        "a.geojson",
        lambda: geojson("Point", [8.0, 47.0]).decode().encode("utf-16"),
        "is not UTF-8; save the file as UTF-8",
    ),
    "zip bomb in a KMZ": (
        "a.kmz",
        lambda: zipped({"doc.kml": bytes(200 * 2**20)}),
        "doc.kml: unpacks to more than 16 MiB",
    ),
    "zip bomb of many layers": (
        "a.zip",
        lambda: zipped({f"p{number}.shp": bytes(2**20) for number in range(64)}),
        "unpacks to more than 16 MiB",
    ),
    "archive of many files": (
        "a.kmz",
        lambda: zipped({f"{number}.kml": b"" for number in range(20_000)}, zipfile.ZIP_STORED),
        "holds 20000 files, more than 1000",
    ),
    "archive of another method": (
        "a.kmz",
        lambda: zipped({"doc.kml": b"<kml/>"}, zipfile.ZIP_LZMA),
        "doc.kml: is packed by method 14; pack it by deflate",
    ),
    "archive of nothing": ("a.kmz", lambda: zipped({"a.txt": b""}), "holds no .kml file"),
    "archive in an archive": (
        "a.kmz",
        lambda: zipped({"a.kmz": zipped({"doc.kml": kml(POINT)})}),
        "holds no .kml file",
    ),
    "archive that is none": ("a.zip", lambda: b"PK\x03\x04 and no more", "is no zip archive"),
    "archive whose content is damaged": (
        "a.kmz",
        lambda: zipped({"doc.kml": kml(POINT * 50)}).replace(b"\x04", b"\x05"),
        "is no ",
    ),
    "larger than files may be": (
        "a.kml",
        lambda: b"<kml>" + b" " * LARGEST_FILE_BYTES,
        "is larger than 16 MiB; give a smaller file of tasks",
    ),
    "Shapefile that is none": ("a.shp", lambda: b"<kml/>", "is no Shapefile; give a .shp file"),
    "Shapefile of other shapes": (
        "a.zip",
        lambda: zipped(
            {
                "p.shp": struct.pack(">7i", 9994, *[0] * 5, 60)
                + bytes(72)
                + struct.pack(">2i", 1, 10)
                + struct.pack("<i", 31)
                + bytes(16),
                "p.prj": WGS84.encode(),
            }
        ),
        "record 1: is of type 31, which is nothing to fly to",
    ),
    "Shapefile that says more than it has": (
        "a.zip",
        lambda: zipped(
            {
                "p.shp": struct.pack(">7i", 9994, *[0] * 5, 60)
                + bytes(72)
                + struct.pack(">2i", 1, 24)
                + struct.pack("<i4d2i", 3, 0, 0, 1, 1, 2**31 - 1, 2**31 - 1)
                + bytes(4),
                "p.prj": WGS84.encode(),
            }
        ),
        "record 1: has fewer points than it says",
    ),
    "Shapefile with another's table": (
        "a.zip",
        lambda: zipped(
            squares(shapefile.POINT, 2) | {"p.dbf": squares(shapefile.POINT, 3)["p.dbf"]}
        ),
        "has 2 shapes and a .dbf of 3 rows",
    ),
    "table of endless rows": (
        "a.zip",
        lambda: zipped(
            squares(shapefile.POINT, 1)
            | {"p.dbf": struct.pack("<4sIHH", b"\3", 2**32 - 1, 33, 1) + bytes(2**20)}
        ),
        "has 4294967295 rows, more than 10000",
    ),
    "table in an encoding that is none": (
        "a.zip",
        lambda: zipped(squares(shapefile.POINT, 1) | {"p.cpg": b"../../etc/passwd"}),
        "is no encoding that is known",
    ),
    "Shapefile of many points": (
        "a.zip",
        lambda: zipped(squares(shapefile.POINT, 10_001)),
        "has more than 10000 records",
    ),
    "prj of brackets": (
        "a.zip",
        lambda: zipped(squares(shapefile.POINT, 1) | {"p.prj": b'GEOGCS["a",' * 100_000}),
        "is no projection that is known",
    ),
    "corridor of a thousand lines": (
        "a.plan",
        lambda: corridor(3, 1000.0),
        "a width of 1000 m with lines 1 m apart cannot be flown",
    ),
    "corridor of many points": (
        "a.plan",
        lambda: corridor(9000, 90.0),
        "has 90 lines of 9000 points; simplify its line",
    ),
    "fence of many corners": (
        "a.plan",
        lambda: json.dumps(
            json.loads(plan())
            | {
                "geoFence": {
                    "polygons": [{"inclusion": True, "polygon": [[47.0, 8.0]] * 100_000}],
                    "version": 2,
                }
            }
        ).encode(),
        "geoFence.polygons[0]: has 100000 points; simplify it to 10000 or fewer",
    ),
    "fence of an endless radius": (
        "a.plan",
        lambda: json.dumps(
            json.loads(plan())
            | {
                "geoFence": {
                    "circles": [
                        {"circle": {"center": [47.0, 8.0], "radius": 1e300}, "inclusion": True}
                    ],
                }
            }
        ).encode(),
        "geoFence.circles[0]: 1e+300 is no radius of a circle",
    ),
    "fence that says more corners than follow": (
        "a.waypoints",
        lambda: b"QGC WPL 110\n0\t0\t3\t5001\t4000000000\t0\t0\t0\t47\t8\t0\t1\n",
        "line 2: says 4000000000.0 corners, which do not follow",
    ),
}


@pytest.mark.parametrize("case", HOSTILE)
def test_a_hostile_file_takes_one_line_and_status_2(
    case: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    name, make, expected = HOSTILE[case]
    path = tmp_path / name
    path.write_bytes(make())
    tracemalloc.start()
    try:
        status = main(["import", str(path), "--home", "47,8,400"], COMMANDS)
        _, peak_bytes = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()

    captured = capsys.readouterr()
    assert captured.out == ""
    assert status == 2, captured.err
    (line,) = captured.err.splitlines()
    assert line.startswith(f"{path}: ")
    assert expected in line
    assert len(line) < 400
    assert peak_bytes < MOST_BYTES


def test_an_archive_is_never_unpacked_beyond_what_a_file_may_have() -> None:
    """An archive that lies about the size of what is in it is cut off, too."""
    data = zipped({"doc.kml": kml(POINT) + bytes(64 * 2**20)})
    size = struct.pack("<I", len(kml(POINT)) + 64 * 2**20)
    lying = data.replace(size, struct.pack("<I", 100))

    before_kib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(InputError):
        read_kmz(lying, ReadOptions("f", HOME))
    after_kib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert after_kib - before_kib < 3 * LARGEST_FILE_BYTES // 1024


@settings(max_examples=100, deadline=None)
@given(data=st.data(), name=st.sampled_from(["valley.kml", "valley.kmz", "parcels.zip"]))
def test_any_damage_to_bytes_gives_entries_or_faults(data: st.DataObject, name: str) -> None:
    content = bytearray((DATA / name).read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(content)))
        content[at : at + data.draw(st.integers(0, 3))] = data.draw(st.binary(max_size=3))
    reader = {"l": read_kml, "z": read_kmz, "p": read_shapefiles_in_zip}[name[-1]]

    try:
        reader(bytes(content), ReadOptions("f", HOME))
    except InputError as error:
        for line in str(error).splitlines():
            assert line.startswith("f")
            assert "; " in line


@settings(max_examples=150, deadline=None)
@given(data=st.data(), part=st.sampled_from([".shp", ".dbf", ".prj", ".cpg"]))
def test_any_damage_to_a_shapefile_gives_entries_or_faults(data: st.DataObject, part: str) -> None:
    parts = {
        suffix: (DATA / f"parcels{suffix}").read_bytes() for suffix in (".shp", ".dbf", ".prj")
    }
    parts[".cpg"] = b"UTF-8"
    content = bytearray(parts[part])
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(content)))
        content[at : at + data.draw(st.integers(0, 4))] = data.draw(st.binary(max_size=4))
    parts[part] = bytes(content)

    try:
        read_layers([Layer("f", parts)], ReadOptions("f", HOME))
    except InputError as error:
        for line in str(error).splitlines():
            assert line.startswith("f: ")
            assert "; " in line
