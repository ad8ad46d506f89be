"""Maps become tasks, areas and zones, whichever program has written them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pyproj
import pytest
import shapefile
from hypothesis import given, settings
from hypothesis import strategies as st

from swarm.runtime.errors import InputError
from swarm.scenario.task_files import FileEntry, ReadOptions, TaskFile, read_task_file
from swarm.scenario.task_files.geojson_file import read_geojson
from swarm.scenario.task_files.kml_file import read_kml, read_kmz
from swarm.scenario.task_files.shapefile import read_shapefiles_in_zip
from tests.support.map_files import (
    HOME,
    UTM,
    Drawn,
    LayerFiles,
    as_geojson,
    as_kml,
    as_shapefiles,
    drawings,
    kml,
    square,
    zipped,
)
from tests.support.task_files import DATA

REQUEST = ReadOptions("f", HOME)


def named(entries: tuple[FileEntry, ...]) -> dict[str, Any]:
    return {str(entry.table["id"]): entry.table for entry in entries}


def faults(data: bytes, *, kmz: bool = False, zipped_layers: bool = False) -> list[str]:
    reader = read_kmz if kmz else read_shapefiles_in_zip if zipped_layers else read_kml
    with pytest.raises(InputError) as caught:
        reader(data, REQUEST)
    return str(caught.value).splitlines()


# Samples, as the programs named write them.


@pytest.mark.parametrize("name", ["valley.kml", "valley.kmz"])
def test_google_earth_gives_areas_with_holes_lines_points_and_zones_by_folder(name: str) -> None:
    found = read_task_file(DATA / name, home=HOME)

    (field,) = found.areas
    assert field.table["id"] == "Grosses-Feld"
    assert field.table["spacing_m"] == 30.0
    assert field.place == "line 20, Placemark 'Großes Feld'"
    holes: Any = field.table["holes_m"]
    (hole,) = holes
    np.testing.assert_allclose(hole, [(300, 500), (300, 650), (450, 650), (450, 500)], atol=1e-3)
    tasks = named(found.entries)
    assert [*tasks] == ["Pipeline", "Mast"]
    assert len(tasks["Pipeline"]["path"]) == 3
    assert tasks["Mast"]["alt_m"] == 430.0
    assert [*named(found.zones)] == ["Hof", "Weiler"]
    assert found.left_out == {"property owner": 1}


def test_qgis_gives_areas_named_after_their_features() -> None:
    found = read_task_file(DATA / "fields-qgis.geojson", home=HOME)

    areas = named(found.areas)
    assert [*areas] == ["Nordacker", "Sudacker-1", "Sudacker-2"]
    assert areas["Nordacker"]["spacing_m"] == 20.0
    assert "value" not in areas["Nordacker"]
    assert areas["Sudacker-1"]["value"] == 12.5
    assert len(areas["Nordacker"]["holes_m"]) == 1


def test_geojson_io_gives_lines_points_and_what_its_properties_call_a_zone() -> None:
    found = read_task_file(DATA / "farm-geojson-io.geojson", home=HOME)

    assert [*named(found.entries)] == ["0", "2"]
    assert len(named(found.entries)["0"]["path"]) == 3
    assert [*named(found.zones)] == ["barn"]
    assert found.areas == ()


@pytest.mark.parametrize("name", ["parcels.shp", "parcels.zip"])
def test_a_shapefile_of_qgis_in_utm_gives_areas_where_they_are(name: str) -> None:
    found = read_task_file(DATA / name, home=HOME)

    areas = named(found.areas)
    assert [*areas] == ["7", "8-1", "8-2"]
    assert areas["7"]["heading_deg"] == 45.0  # its column is cut to heading_de
    corners = np.array(areas["7"]["polygon"])
    np.testing.assert_allclose(corners[1], (47.0031483075532, 8.003944462063519), atol=1e-9)
    assert len(areas["7"]["holes_m"]) == 1
    assert found.left_out == {"property crop": 2}


# The same features in each format.


def tables(found: TaskFile) -> list[tuple[str, dict[str, Any]]]:
    """By id, rings begun at their first corner to the south-west and turned one way."""
    return sorted(
        (str(entry.table["id"]), {**entry.table, "array": entry.array})
        for entry in found.all_entries
    )


def same_ring(ring: Any, other: Any, *, closed: bool) -> bool:
    one, two = np.array(ring), np.array(other)
    if one.shape != two.shape:
        return False
    if not closed:
        return bool(np.allclose(one, two, rtol=0.0, atol=1e-8))
    turns = [np.roll(each, n, axis=0) for each in (two, two[::-1]) for n in range(len(two))]
    return any(np.allclose(one, turned, rtol=0.0, atol=1e-8) for turned in turns)


@settings(max_examples=40, deadline=None)
@given(drawn=drawings())
def test_geojson_kml_and_shapefiles_of_the_same_features_give_the_same(drawn: list[Drawn]) -> None:
    text = read_geojson(as_geojson(drawn), REQUEST)
    for other in (
        read_kml(as_kml(drawn), REQUEST),
        read_kmz(zipped({"doc.kml": as_kml(drawn)}), REQUEST),
        read_shapefiles_in_zip(as_shapefiles(drawn), REQUEST),
    ):
        assert len(other.all_entries) == len(drawn)
        for (name, table), (other_name, told) in zip(tables(text), tables(other), strict=True):
            assert name == other_name
            assert table.keys() == told.keys()
            for key in table.keys() - {"path", "polygon", "holes"}:
                assert table[key] == told[key]
            for key in table.keys() & {"path", "polygon"}:
                assert same_ring(table[key], told[key], closed=key == "polygon")
            holes = zip(table.get("holes", []), told.get("holes", []), strict=True)
            assert all(same_ring(hole, other_hole, closed=True) for hole, other_hole in holes)


# KML by itself.

RING = "8,47 8.001,47 8.001,47.001 8,47"
POLYGON = (
    "<Polygon>{}<outerBoundaryIs><LinearRing><coordinates>"
    f"{RING}</coordinates></LinearRing></outerBoundaryIs></Polygon>"
)


def placemark(shape: str, name: str = "a", data: str = "") -> str:
    return f"<Placemark><name>{name}</name>{data}{shape}</Placemark>"


def data_of(**values: str) -> str:
    inner = "".join(f'<Data name="{k}"><value>{v}</value></Data>' for k, v in values.items())
    return f"<ExtendedData>{inner}</ExtendedData>"


def test_shapes_of_a_multigeometry_are_numbered_and_equal_names_too() -> None:
    point = "<Point><coordinates>8,47</coordinates></Point>"
    line = "<LineString><coordinates>8,47 8.01,47</coordinates></LineString>"
    body = placemark(f"<MultiGeometry>{point}<MultiGeometry>{line}</MultiGeometry></MultiGeometry>")
    again = placemark(point) + placemark(point) + placemark(point, name="")
    found = read_kml(kml(body + again), REQUEST)

    assert [*named(found.entries)] == ["a-1", "a-2", "a", "a-3", "t5"]


def test_properties_of_kml_are_words_and_read_as_numbers_and_truths() -> None:
    data = data_of(spacing_m="12.5", value=" 3 ", kind="wheat", Camera="")
    found = read_kml(kml(placemark(POLYGON.format(""), data=data)), REQUEST)

    (area,) = found.areas
    assert (area.table["spacing_m"], area.table["value"]) == (12.5, 3.0)
    assert area.table["kind"] == "wheat"
    assert "camera" not in area.table


def test_simple_data_of_a_schema_counts_as_well() -> None:
    inner = '<SchemaData><SimpleData name="value">7</SimpleData></SchemaData>'
    data = f"<ExtendedData>{inner}</ExtendedData>"
    found = read_kml(kml(placemark(POLYGON.format(""), data=data)), REQUEST)

    assert found.areas[0].table["value"] == 7.0


@pytest.mark.parametrize(
    ("name", "data", "inclusive"),
    [
        ("Zone 3", {}, None),
        ("no fly: airfield", {}, None),
        ("Keep-out", {}, None),
        ("field", {"zone": "yes"}, None),
        ("field", {"kind": "zone"}, None),
        ("field", {"zone": "inclusive"}, True),
        ("field", {"zone": "true", "inclusive": "true"}, True),
    ],
)
def test_a_polygon_is_a_zone_by_its_name_or_a_property(
    name: str, data: dict[str, str], inclusive: bool | None
) -> None:
    found = read_kml(kml(placemark(POLYGON.format(""), name, data_of(**data))), REQUEST)

    (zone,) = found.zones
    assert found.areas == ()
    assert zone.table.get("inclusive") is inclusive


def test_a_property_goes_before_the_name_of_a_zone() -> None:
    found = read_kml(kml(placemark(POLYGON.format(""), "Zone", data_of(zone="no"))), REQUEST)

    assert len(found.areas) == 1


@pytest.mark.parametrize(
    ("mode", "expected"),
    [("", {}), ("clampToGround", {}), ("absolute", {"alt_m": 470.0})],
)
def test_heights_count_where_the_altitude_mode_says_so(
    mode: str, expected: dict[str, float]
) -> None:
    told = f"<altitudeMode>{mode}</altitudeMode>" if mode else ""
    point = f"<Point>{told}<coordinates>8,47,470</coordinates></Point>"
    found = read_kml(kml(placemark(point)), REQUEST)

    (task,) = found.entries
    assert task.table == {"id": "a", "lat_deg": 47.0, "lon_deg": 8.0, **expected}


def test_heights_above_the_ground_need_the_ground() -> None:
    line = (
        "<LineString><altitudeMode>relativeToGround</altitudeMode>"
        "<coordinates>8,47,60 8.01,47,60</coordinates></LineString>"
    )
    body = kml(placemark(line))

    (told,) = faults(body)
    assert told.startswith("f: line 2, Placemark 'a': its height is above the ground there")
    found = read_kml(body, ReadOptions("f", HOME, has_terrain=True))
    assert found.entries[0].table["height_m"] == 60.0
    (uneven,) = faults(body.replace(b"8.01,47,60", b"8.01,47,70"))
    assert uneven == told
    with pytest.raises(InputError, match="several heights above the ground; give all its points"):
        read_kml(body.replace(b",60<", b",70<"), ReadOptions("f", HOME, has_terrain=True))


def test_absolute_heights_of_a_line_are_kept_in_metres(tmp_path: Path) -> None:
    path = tmp_path / "l.kml"
    line = (
        "<LineString><altitudeMode>absolute</altitudeMode>"
        "<coordinates>8,47,420 8,47.001,440</coordinates></LineString>"
    )
    path.write_bytes(kml(placemark(line)))

    (task,) = read_task_file(path, home=HOME).entries
    points: Any = task.table["path_m"]
    np.testing.assert_allclose(points, [(0.0, 0.0, 20.0), (0.0, 111.17, 40.0)], atol=0.01)


@pytest.mark.parametrize(
    ("body", "line"),
    [
        (
            placemark("<Point><coordinates>8;47</coordinates></Point>"),
            (
                "f: line 2, Placemark 'a': '8;47' is no place; "
                "give longitude,latitude,height with spaces between places alone"
            ),
        ),
        (
            placemark("<Point><coordinates>nan,47</coordinates></Point>"),
            (
                "f: line 2, Placemark 'a': 'nan,47' is no place; "
                "give longitude,latitude,height with spaces between places alone"
            ),
        ),
        (
            placemark("<Point><coordinates></coordinates></Point>"),
            "f: line 2, Placemark 'a': has a shape without coordinates; draw it again",
        ),
        (
            placemark("<Polygon></Polygon>"),
            "f: line 2, Placemark 'a': has a shape without coordinates; draw it again",
        ),
        (
            placemark(
                POLYGON.format("<altitudeMode>high</altitudeMode>").replace("8,47 ", "8,47,9 ")
            ),
            (
                "f: line 2, Placemark 'a': 'high' is no altitudeMode; "
                "give absolute, relativeToGround or clampToGround"
            ),
        ),
        (
            placemark(POLYGON.format(""), data=data_of(value="much")),
            "f: line 2, Placemark 'a', value: 'much' is not a number; give a number such as 12.5",
        ),
        (
            placemark(POLYGON.format(""), data=data_of(spacing="5")),
            "f: line 2, Placemark 'a'.properties: 'spacing' is unknown; did you mean 'spacing_m'?",
        ),
        (
            placemark("<Point><coordinates>8,47</coordinates></Point>", data=data_of(zone="1")),
            "f: line 2, Placemark 'a': is a zone, and Point encloses nothing; give a Polygon",
        ),
        ("", "f: holds no task; add placemarks with points, paths or polygons"),
    ],
)
def test_a_wrong_placemark_takes_its_exact_line(body: str, line: str) -> None:
    assert faults(kml(body)) == [line]


def test_what_is_no_placemark_is_told() -> None:
    body = (
        "<NetworkLink><Link><href>https://example.org/a.kml</href></Link></NetworkLink>"
        "<Placemark><name>here</name></Placemark>" + placemark(POLYGON.format(""))
    )

    found = read_kml(kml(body), REQUEST)
    assert found.left_out == {"NetworkLink": 1, "placemark without a shape": 1}


# Shapefiles by themselves.


def shapes_in(epsg: int | None, *points: tuple[float, float], prj: str | None = None) -> bytes:
    files = LayerFiles()
    with files.writer(shapefile.POINT) as writer:
        writer.field("value", "N", 10, 2)
        for point in points:
            writer.point(*point)
            writer.record(4.5)
    told = prj if epsg is None else pyproj.CRS.from_epsg(epsg).to_wkt("WKT1_ESRI")
    return zipped(files.members("p", told))


@settings(max_examples=40, deadline=None)
@given(
    lat_deg=st.floats(47.3, 48.5),
    lon_deg=st.floats(7.6, 10.4),
    epsg=st.sampled_from([4326, UTM, 3857, 25832, 31467]),
)
def test_places_in_any_projection_are_found_again(
    lat_deg: float, lon_deg: float, epsg: int
) -> None:
    point = pyproj.Transformer.from_crs(4326, epsg, always_xy=True).transform(lon_deg, lat_deg)
    found = read_shapefiles_in_zip(shapes_in(epsg, point), REQUEST)

    (task,) = found.entries
    place: Any = [task.table["lat_deg"], task.table["lon_deg"]]
    # A datum of its own is known to some metres.
    np.testing.assert_allclose(place, [lat_deg, lon_deg], atol=1e-4 if epsg == 31467 else 1e-8)
    assert task.table["value"] == 4.5


@pytest.mark.parametrize(
    ("data", "line"),
    [
        (
            shapes_in(None, (8.0, 47.0)),
            (
                "f: p: has no .prj beside it, so nobody knows its projection; "
                "save it in EPSG:4326, with its .prj"
            ),
        ),
        (
            shapes_in(None, (8.0, 47.0), prj="somewhere"),
            (
                "f: p: .prj: 'somewhere' is no projection that is known; "
                "save it in EPSG:4326, with its .prj"
            ),
        ),
        (
            shapes_in(None, (8.0, 47.0), prj='LOCAL_CS["x",UNIT["m",1]]'),
            "f: p: .prj: x is no projection of the Earth; save it in EPSG:4326, with its .prj",
        ),
        (
            shapes_in(4326, (500000.0, 5200000.0)),
            (
                "f: p, record 1: 500000, 5.2e+06 is no longitude and latitude of WGS 84; "
                "save it with the right .prj, or in EPSG:4326"
            ),
        ),
        (
            shapes_in(UTM, (8.0, 47.0)),
            (
                "f: p, record 1: 8, 47 lies outside of where WGS 84 / UTM zone 32N holds; "
                "save it with the right .prj, or in EPSG:4326"
            ),
        ),
        (
            shapes_in(UTM, (-1.4e300, 5.2e6)),
            (
                "f: p, record 1: -1.4e+300, 5.2e+06 lies outside of where WGS 84 / UTM zone 32N "
                "holds; save it with the right .prj, or in EPSG:4326"
            ),
        ),
        (
            shapes_in(UTM, (float("nan"), 47.0)),
            (
                "f: p, record 1: has a coordinate that is no number; "
                "save it with the right .prj, or in EPSG:4326"
            ),
        ),
    ],
)
def test_wrong_or_unknown_projections_take_their_exact_line(data: bytes, line: str) -> None:
    assert [told.replace("f: p: p,", "f: p,") for told in faults(data, zipped_layers=True)] == [
        line
    ]


def test_a_datum_that_is_known_to_some_metres_is_told() -> None:
    point = pyproj.Transformer.from_crs(4326, 31467, always_xy=True).transform(8.0, 47.0)
    found = read_shapefiles_in_zip(shapes_in(31467, point), REQUEST)

    assert all("DHDN" in note and "WGS84" in note for note in found.notes)


def test_holes_belong_to_the_smallest_border_round_them_and_alone_are_areas() -> None:
    def closed(ring: tuple[tuple[float, float], ...]) -> list[list[float]]:
        return [[8.0 + x / 1e5, 47.0 + y / 1e5] for x, y in [*ring, ring[0]]]

    files = LayerFiles()
    with files.writer(shapefile.POLYGON) as writer:
        writer.field("name", "C", 10)
        outer, inner = closed(square(0, 0, 100)[::-1]), closed(square(200, 0, 50)[::-1])
        writer.poly([outer, inner, closed(square(10, 10, 20)), closed(square(210, 10, 20))])
        writer.record("two")
        writer.poly([closed(square(400, 0, 50))])  # turned the wrong way round
        writer.record("odd")
    prj = pyproj.CRS.from_epsg(4326).to_wkt("WKT1_ESRI")
    found = read_shapefiles_in_zip(zipped(files.members("p", prj)), REQUEST)

    holes = {name: len(table.get("holes", ())) for name, table in named(found.areas).items()}
    assert holes == {"two-1": 1, "two-2": 1, "odd": 0}


def test_heights_of_a_shapefile_are_above_the_sea_unless_all_are_0() -> None:
    for height_m, expected in ((0.0, False), (420.0, True)):
        files = LayerFiles()
        with files.writer(shapefile.POINTZ) as writer:
            writer.field("kind", "C", 10)
            writer.pointz(8.0, 47.0, height_m)
            writer.record("pole")
        prj = pyproj.CRS.from_epsg(4326).to_wkt("WKT1_ESRI")
        found = read_shapefiles_in_zip(zipped(files.members("p", prj)), REQUEST)
        assert ("alt_m" in found.entries[0].table) is expected


def test_the_layers_name_may_say_that_all_of_it_are_zones() -> None:
    files = LayerFiles()
    with files.writer(shapefile.POLYGON) as writer:
        writer.field("name", "C", 10)
        writer.poly([[[8.0, 47.0], [8.0, 47.01], [8.01, 47.01], [8.0, 47.0]]])
        writer.record("barn")
    prj = pyproj.CRS.from_epsg(4326).to_wkt("WKT1_ESRI")
    found = read_shapefiles_in_zip(zipped(files.members("no-fly", prj)), REQUEST)

    assert [*named(found.zones)] == ["barn"]
