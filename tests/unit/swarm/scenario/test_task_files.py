"""Files people have become tasks; what is wrong in them takes one line with its place."""

from __future__ import annotations

import contextlib
import copy
import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swarm.model import Origin
from swarm.runtime.errors import InputError
from swarm.scenario.task_files import (
    SUFFIXES,
    ImportOptions,
    ReadOptions,
    read_task_file,
    read_task_files,
)
from swarm.scenario.task_files.csv_file import read_csv
from swarm.scenario.task_files.geojson_file import read_geojson
from swarm.scenario.task_files.waypoints_file import read_waypoints
from tests.support.task_files import DATA, HOME, READERS, TERRAIN, lines, tables, wp

# Files written by hand to the published formats.


def test_plan_gives_waypoints_home_speed_and_what_is_left_out() -> None:
    found = read_task_file(DATA / "orchard.plan")

    assert found.home == HOME
    assert found.speed_m_s == 6.0
    # Each 10 m below its waypoint: above home, above sea, above terrain with the height known.
    assert tables(found) == [
        {**wp("t1", 47.001, 8.001, 440.0), "service_s": 12.5},
        wp("t2", 47.002, 8.001, 460.0),
        {**wp("t3", 47.002, 8.002, 445.0), "service_s": 30.0},
    ]
    assert found.entries[2].place == "mission.items[4]"
    (survey,) = found.areas
    assert (survey.place, survey.table["id"]) == ("mission.items[6]", "survey1")
    assert found.left_out == {
        "takeoff": 1,
        "change speed": 1,
        "set roi location": 1,
        "return to launch": 1,
    }


def test_survey_is_visits_of_its_corners_where_schema_1_asks_for_visits() -> None:
    found = read_task_files([DATA / "orchard.plan"], ImportOptions(visits_alone=True))

    assert found.areas == ()
    assert tables(found)[3:] == [
        wp("t4", 47.003, 8.001, 450.0),
        wp("t5", 47.004, 8.001, 450.0),
    ]
    assert found.entries[3].place == "mission.items[6].TransectStyleComplexItem.Items[0]"
    assert found.left_out["set cam trigg dist"] == 2


def test_home_that_is_given_counts_instead_of_the_plans() -> None:
    found = read_task_file(DATA / "orchard.plan", home=Origin(47.0, 8.0, 100.0), below_m=0.0)

    assert found.home == Origin(47.0, 8.0, 100.0)
    # What is above mean sea level stays there.
    assert [entry.table["alt_m"] for entry in found.entries] == [150.0, 470.0, 455.0]


def test_waypoint_file_has_its_home_in_the_first_row() -> None:
    found = read_task_file(DATA / "river.waypoints")

    assert found.home == HOME
    assert tables(found) == [
        {**wp("t1", 47.001, 8.001, 420.0), "service_s": 7.0},
        wp("t2", 47.002, 8.002, 440.0),
    ]
    assert [entry.place for entry in found.entries] == ["line 4", "line 5"]
    assert found.left_out == {"takeoff": 1, "change speed": 1, "return to launch": 1}


def test_geojson_gives_points_with_their_properties() -> None:
    found = read_task_file(DATA / "trees.geojson", home=HOME)

    assert tables(found) == [
        {**wp("oak", 47.002, 8.001, 430.0), "value": 5, "service_s": 20, "kind": "tree"},
        {"id": "17", "lat_deg": 47.001, "lon_deg": 8.002, "appears_s": 60.0},
        {"id": "t3", "lat_deg": 47.001, "lon_deg": 8.003},
    ]
    assert found.left_out == {"property species": 2}
    assert found.below_m is None


def test_csv_in_metres_needs_no_home() -> None:
    found = read_task_file(DATA / "grid.csv")

    assert found.home is None
    assert tables(found) == [
        {
            "id": "p1",
            "value": 5.0,
            "service_s": 10.0,
            "kind": "photo",
            "position_m": [100.0, 0.0],
        },
        {"id": "p2", "appears_s": 30.0, "position_m": [0.5, -200.25, 12.0]},
        {"id": "t3", "position_m": [50.0, 50.0]},
    ]
    assert [entry.place for entry in found.entries] == ["line 2", "line 3", "line 5"]
    assert found.left_out == {"column note": 1}


def test_csv_of_a_spreadsheet_may_have_semicolons_capitals_and_a_mark() -> None:
    assert tables(read_task_file(DATA / "posts.csv", home=HOME)) == [
        {"id": "west", "value": 2.0, "lat_deg": 47.001, "lon_deg": 7.999, "alt_m": 420.0},
        {"id": "east", "value": 3.0, "lat_deg": 47.001, "lon_deg": 8.001},
    ]


# Waypoint files.

HEAD = "QGC WPL 110\n0\t1\t0\t16\t0\t0\t0\t0\t47\t8\t400\t1\n"
ROW = "1\t0\t3\t16\t0\t0\t0\t0\t47.1\t8.1\t50\t1\n"
NO_HOME_ROW = (
    "the first item is no home, and heights are counted from it; "
    "give the home there, or --home LAT,LON,ALT, or [origin] in the scenario"
)
FIELDS = "give index, current, frame, command, four params, latitude, longitude, height, 1"

WRONG_WAYPOINTS = {
    "empty": ("", "line 1: '' is not 'QGC WPL 110'"),
    "other version": (
        HEAD.replace("110", "120"),
        "line 1: 'QGC WPL 120' is not 'QGC WPL 110'",
    ),
    "plan": ("{}", "line 1: '{}' is not 'QGC WPL 110'"),
}


@pytest.mark.parametrize("case", WRONG_WAYPOINTS)
def test_other_file_is_no_waypoint_file(case: str) -> None:
    text, line = WRONG_WAYPOINTS[case]

    assert lines(".waypoints", text) == [
        f"f: {line}; give a waypoint file that begins with QGC WPL 110"
    ]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (HEAD, "f: holds no task; add waypoints after the home"),
        (
            HEAD + ROW.replace("\t1\n", "\n"),
            f"f: line 3: has 11 fields instead of 12; {FIELDS}",
        ),
        (HEAD + ROW.replace("47.1", "47,1"), "f: line 3: '47,1' is not a number; give a number"),
        (HEAD + ROW.replace("47.1", "nan"), "f: line 3: 'nan' is not a number; give a number"),
        (
            HEAD + ROW.replace("\t16", "\t1.6"),
            "f: line 3: 1.6 is not a whole number; give a frame and a command",
        ),
        (HEAD + ROW.replace("\t3\t", "\t10\t"), f"f: line 3: {TERRAIN}"),
        (HEAD.replace("47\t8\t400", "0\t0\t0") + ROW, f"f: line 2: {NO_HOME_ROW}"),
        (HEAD.replace("47\t8", "99\t8") + ROW, f"f: line 2: {NO_HOME_ROW}"),
    ],
)
def test_wrong_row_takes_its_exact_line(text: str, expected: str) -> None:
    assert lines(".waypoints", text) == [expected]


def test_home_that_was_never_set_may_be_given() -> None:
    text = HEAD.replace("47\t8\t400", "0\t0\t0") + "# by hand\n\n" + ROW.replace("\t", "  ")

    assert tables(read_waypoints(text, ReadOptions("f", HOME))) == [wp("t1", 47.1, 8.1, 440.0)]


# GeoJSON.


def geojson(*features: object) -> str:
    return json.dumps({"type": "FeatureCollection", "features": list(features)})


def point(coordinates: object = (8.0, 47.0), **properties: object) -> dict[str, Any]:
    geometry = {"type": "Point", "coordinates": coordinates}
    return {"type": "Feature", "geometry": geometry, "properties": properties}


COLLECTION = "give a FeatureCollection of Points, LineStrings and Polygons in GeoJSON"
GIVE_SHAPES = "give Points, LineStrings or Polygons"
COORDINATES = (
    "f: features[0].geometry.coordinates: is not an array of 2 or 3 numbers; "
    "give [longitude, latitude] or [longitude, latitude, height]"
)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("3", f"f: is not a JSON object; {COLLECTION}"),
        (
            json.dumps(point()["geometry"]),
            f"f: type: 'Point' is not 'FeatureCollection'; {COLLECTION}",
        ),
        ('{"type": "FeatureCollection"}', f"f: features: is not an array; {COLLECTION}"),
        (geojson(), "f: holds no task; add Points, LineStrings or Polygons"),
        (geojson({}), f"f: features[0].geometry: has no geometry; {GIVE_SHAPES}"),
        (
            geojson({"geometry": {"type": "Circle"}}),
            f"f: features[0].geometry: 'Circle' is nothing to fly to; {GIVE_SHAPES}",
        ),
        (geojson(point([8.0])), COORDINATES),
        (geojson(point([8.0, "47"])), COORDINATES),
        (geojson(point([8.0, 47.0, 400.0, 1.0])), COORDINATES),
        (geojson(point(None)), COORDINATES),
        (
            geojson(point(servce_s=5)),
            "f: features[0].properties: 'servce_s' is unknown; did you mean 'service_s'?",
        ),
        (
            geojson(point(id="a"), point(id="a")),
            (
                "f: features[1], id: 'a' is already the id at features[0]; "
                "give every one an id of its own"
            ),
        ),
        (
            geojson(point(id=["a"])),
            "f: features[0], id: an array is not an id; give a string or a whole number",
        ),
    ],
)
def test_wrong_geojson_takes_its_exact_line(text: str, line: str) -> None:
    assert lines(".geojson", text, HOME) == [line]


def test_names_of_properties_may_be_in_capitals() -> None:
    (found,) = tables(read_geojson(geojson(point(ID="a", Value=3)), ReadOptions("f", HOME)))

    assert found == {"id": "a", "lat_deg": 47.0, "lon_deg": 8.0, "value": 3}


# CSV.

WANTED = "give columns lat_deg and lon_deg, or east_m and north_m"


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("", f"f: line 1: names no columns for the place; {WANTED}"),
        ("lat,lon\n1,2\n", f"f: line 1: names no columns for the place; {WANTED}"),
        ("lat_deg,value\n1,2\n", f"f: line 1: lacks a column for the place; {WANTED}"),
        (
            "lat_deg,lon_deg,up_m\n1,2,3\n",
            "f: line 1: gives places in degrees and in metres; keep one",
        ),
        (
            "east_m,north_m,vlaue\n1,2,3\n",
            "f: line 1: column 'vlaue' is unknown; did you mean 'value'?",
        ),
        (
            "east_m,north_m,value,Value\n1,2,3,4\n",
            "f: line 1: column 'value' is there twice; keep one of them",
        ),
        ("east_m,north_m\n", "f: holds no task; add one line per task"),
        (
            "east_m;north_m\n1,5;2\n",
            "f: line 2, east_m: '1,5' is not a number; give a number such as 12.5",
        ),
        (
            "east_m,north_m\n1,inf\n",
            "f: line 2, north_m: 'inf' is not a number; give a number such as 12.5",
        ),
        (
            "east_m,north_m\n1,\n",
            "f: line 2, north_m: is empty; give a number such as 12.5",
        ),
        (
            "east_m,north_m\n1,2,3\n",
            "f: line 2: has 3 cells for 2 columns; put cells with a separator in them in quotes",
        ),
        (
            "id,east_m,north_m\na,1,2\na,1,2\n",
            "f: line 3, id: 'a' is already the id at line 2; give every one an id of its own",
        ),
        (
            'east_m,north_m\n"1,2\n',
            "f: line 2: is not CSV: unexpected end of data; correct it as CSV",
        ),
    ],
)
def test_wrong_csv_takes_its_exact_line(text: str, line: str) -> None:
    assert lines(".csv", text) == [line]


def test_cell_may_have_lines_of_its_own() -> None:
    found = read_csv('east_m,north_m,note\n1,2,"a\nb"\n3,4,\n', ReadOptions("f"))

    assert [entry.place for entry in found.entries] == ["line 3", "line 4"]


# Any file.


def test_suffix_says_what_a_file_is(tmp_path: Path) -> None:
    assert {*READERS} < {*SUFFIXES}
    for name, problem in (("a.gpx", ".gpx"), ("a", "a name without a suffix")):
        with pytest.raises(InputError) as caught:
            read_task_file(tmp_path / name)
        expected = (
            f"{problem} is no kind of file of tasks; give one ending in {', '.join(SUFFIXES)}"
        )
        assert str(caught.value) == f"{tmp_path / name}: {expected}"


def test_places_in_degrees_need_a_home() -> None:
    with pytest.raises(InputError) as caught:
        read_task_file(DATA / "trees.geojson")

    remedy = "name it: --home LAT,LON,ALT, or [origin] in the scenario"
    expected = f"names no home, and places in degrees need one; {remedy}"
    assert str(caught.value) == f"{DATA / 'trees.geojson'}: {expected}"


def test_file_of_places_has_no_waypoints_to_lie_below() -> None:
    with pytest.raises(InputError, match=r"holds places and no waypoints.*; leave out --below-m"):
        read_task_file(DATA / "grid.csv", below_m=5.0)


def test_file_that_cannot_be_read_takes_one_line(tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        read_task_file(tmp_path / "missing.csv")

    expected = "cannot be read: No such file or directory; give a readable file of tasks"
    assert str(caught.value) == f"{tmp_path / 'missing.csv'}: {expected}"


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=4),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=3), inner),
    max_leaves=6,
)


def places_in(value: object, path: tuple[str | int, ...] = ()) -> list[tuple[str | int, ...]]:
    """Every path into a parsed JSON document."""
    match value:
        case dict():
            inner = [places_in(item, (*path, key)) for key, item in value.items()]
        case list():
            inner = [places_in(item, (*path, index)) for index, item in enumerate(value)]
        case _:
            inner = []
    return [path, *(found for group in inner for found in group)]


@settings(deadline=None)
@pytest.mark.parametrize(
    "name", ["orchard.plan", "quarry.plan", "trees.geojson", "farm-geojson-io.geojson"]
)
@given(data=st.data())
def test_any_damage_to_a_json_file_gives_tasks_or_faults(name: str, data: st.DataObject) -> None:
    document = json.loads((DATA / name).read_text())
    damaged: Any = copy.deepcopy(document)
    *above, last = data.draw(st.sampled_from(places_in(document)[1:]))
    inner = damaged
    for step in above:
        inner = inner[step]
    if data.draw(st.booleans()):
        del inner[last]
    else:
        inner[last] = data.draw(JSON)

    for line in lines(Path(name).suffix, json.dumps(damaged), HOME):
        assert line.startswith("f: ")
        assert "; " in line


@pytest.mark.parametrize("wrong", [[], {}, None, True, -1, 1e308, 10**400, ""])
@pytest.mark.parametrize(
    "name", ["orchard.plan", "quarry.plan", "trees.geojson", "farm-geojson-io.geojson"]
)
def test_a_wrong_kind_of_value_anywhere_gives_tasks_or_faults(name: str, wrong: object) -> None:
    document = json.loads((DATA / name).read_text())
    for *above, last in places_in(document)[1:]:
        damaged: Any = copy.deepcopy(document)
        inner = damaged
        for step in above:
            inner = inner[step]
        inner[last] = wrong
        for line in lines(Path(name).suffix, json.dumps(damaged), HOME):
            assert line.startswith("f: ")


@settings(deadline=None)
@pytest.mark.parametrize("suffix", READERS)
@given(data=st.data())
def test_any_text_gives_tasks_or_faults(suffix: str, data: st.DataObject) -> None:
    alphabet = st.sampled_from('\t\n\r",; 0123456789.-eE{}[]:qQWPLGC_deglatonstmrh\0é')
    text = data.draw(st.text(alphabet, max_size=80))
    head = data.draw(st.sampled_from(["", HEAD, "east_m,north_m\n", "lat_deg;lon_deg;id\n"]))

    with contextlib.suppress(InputError):
        READERS[suffix](head + text, ReadOptions("f", HOME))
