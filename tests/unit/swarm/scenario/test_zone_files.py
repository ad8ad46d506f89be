"""One zone out of a file, as an operator gives it in flight."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from swarm.model.frames import Origin, enu_from_wgs84
from swarm.runtime.errors import InputError
from swarm.scenario.zone_files import read_zone

HERE = Origin(47.0, 8.0, 400.0)
TABLE = """
[[zone]]
id = "village"
polygon_m = [[0, 0], [90, 0], [90, 90], [0, 90]]
holes_m = [[[10, 10], [20, 10], [20, 20]]]
ceiling_m = 120.0
"""
RING = [[8.0, 47.0], [8.1, 47.0], [8.1, 47.1], [8.0, 47.0]]


def read(folder: Path, text: str, name: str = "z", suffix: str = ".toml") -> object:
    file = folder / f"zones{suffix}"
    file.write_text(text)
    return read_zone(file, name)


def refused(folder: Path, text: str, suffix: str = ".toml", name: str = "z") -> str:
    with pytest.raises(InputError) as caught:
        read(folder, text, name, suffix)
    return str(caught.value).removeprefix(f"{folder}/zones{suffix}: ")


def test_metres_without_an_origin_are_from_the_missions(tmp_path: Path) -> None:
    file = tmp_path / "village.toml"
    file.write_text(TABLE)
    drawn = read_zone(file, "anything")

    assert not drawn.in_degrees
    assert drawn.polygon == ((0.0, 0.0), (90.0, 0.0), (90.0, 90.0), (0.0, 90.0))
    assert drawn.holes == (((10.0, 10.0), (20.0, 10.0), (20.0, 20.0)),)
    assert (drawn.floor_m, drawn.ceiling_m, drawn.inclusive) == (None, 120.0, False)


def test_metres_of_a_file_with_an_origin_lie_where_that_says(tmp_path: Path) -> None:
    """The mission may have another one."""
    file = tmp_path / "village.toml"
    file.write_text("[origin]\nlat_deg = 47.0\nlon_deg = 8.0\nalt_m = 400.0\n" + TABLE)
    drawn = read_zone(file, "village")

    assert drawn.in_degrees
    east_m, north_m, _ = enu_from_wgs84(HERE, *drawn.polygon[2], HERE.alt_m)
    assert [east_m, north_m] == pytest.approx([90.0, 90.0])


def test_degrees_need_no_origin(tmp_path: Path) -> None:
    text = '[[zone]]\nid = "z"\npolygon = [[47.0, 8.0], [47.1, 8.0], [47.1, 8.1]]\n'
    file = tmp_path / "z.toml"
    file.write_text(text)

    assert read_zone(file, "z").polygon == ((47.0, 8.0), (47.1, 8.0), (47.1, 8.1))


@pytest.mark.parametrize(
    "document",
    [
        {"type": "Polygon", "coordinates": [RING]},
        {"type": "Feature", "geometry": {"type": "Polygon", "coordinates": [RING]}},
        {
            "type": "FeatureCollection",
            "features": [
                {"type": "Feature", "geometry": {"type": "Point", "coordinates": [8.0, 47.0]}},
                {
                    "type": "Feature",
                    "properties": {"id": "z"},
                    "geometry": {"type": "Polygon", "coordinates": [RING]},
                },
                {"type": "Feature", "geometry": {"type": "Polygon", "coordinates": [RING[::-1]]}},
            ],
        },
    ],
)
def test_polygons_of_geojson_have_longitudes_first(
    document: dict[str, object], tmp_path: Path
) -> None:
    file = tmp_path / "z.geojson"
    file.write_text(json.dumps(document))
    drawn = read_zone(file, "z")

    assert drawn.in_degrees
    assert drawn.polygon == ((47.0, 8.0), (47.0, 8.1), (47.1, 8.1), (47.0, 8.0))


def test_of_several_zones_the_one_of_that_name_is_meant(tmp_path: Path) -> None:
    more = TABLE + TABLE.replace("village", "school").replace("120.0", "60.0")
    (tmp_path / "both.toml").write_text(more)
    assert read_zone(tmp_path / "both.toml", "school").ceiling_m == 60.0

    told = refused(tmp_path, more, name="scool")
    assert (
        told
        == "'scool' is none of its 2 zones; did you mean 'school'? Choose one of village, school"
    )


@pytest.mark.parametrize(
    ("text", "suffix", "complaint"),
    [
        ("zone = 3", ".toml", "zone: 3 is not an array; give one table [[zone]] per zone"),
        ("", ".toml", "holds no zone; give one with a table [[zone]], or a Polygon in GeoJSON"),
        (
            TABLE.replace("ceiling_m", "ceilng_m"),
            ".toml",
            'zone[0] "village".ceilng_m: unknown key',
        ),
        (TABLE.replace("[90, 90]", "[-90, 45]"), ".toml", 'zone[0] "village".polygon_m: crosses'),
        ("{}", ".geojson", "'nothing' holds no zone; give a Polygon in GeoJSON"),
        ("[", ".geojson", "line 1, column 2: is not JSON"),
        (
            json.dumps({"type": "Feature", "geometry": {"type": "MultiPolygon"}}),
            ".json",
            "is a MultiPolygon; make a zone of each of its polygons",
        ),
        (
            json.dumps({"type": "Polygon", "coordinates": [[[8.0, 47.0], ["x", 1]]]}),
            ".json",
            "coordinates: corner 2 is no place; give rings of [longitude, latitude]",
        ),
        ("", ".kml", ".kml is no kind of file with a zone; give one ending in .toml, .geojson"),
    ],
)
def test_what_holds_no_sound_zone_is_refused(
    text: str, suffix: str, complaint: str, tmp_path: Path
) -> None:
    assert refused(tmp_path, text, suffix).startswith(complaint)
