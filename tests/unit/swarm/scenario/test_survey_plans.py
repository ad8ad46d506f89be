"""Surveys, scans and fences of ground stations become what they are meant for."""

from __future__ import annotations

import json
import math
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from swarm.cli import main
from swarm.model import Origin
from swarm.model.frames import enu_from_wgs84
from swarm.runtime.errors import InputError
from swarm.scenario import load_scenario
from swarm.scenario.task_files import (
    ImportOptions,
    ReadOptions,
    TaskFile,
    read_task_file,
    read_task_files,
)
from swarm.scenario.task_files.fences import circle_zone
from swarm.scenario.task_files.plan_file import read_plan
from swarm.scenario.task_files.point_lists import read_fence, read_rally, read_text_file
from swarm.scenario.task_files.task_file import FileEntry
from swarm.scenario.task_files.waypoints_file import read_waypoints
from tests.support.task_files import DATA, HOME, lines

COMMANDS = {"import": EntryPoint("import", "swarm.scenario.cli:import_tasks", "peckorder.commands")}
QUARRY: Any = json.loads((DATA / "quarry.plan").read_text(encoding="utf-8"))
SURVEY, CORRIDOR, STRUCTURE = QUARRY["mission"]["items"][2:5]


def read(*items: object, home: Any = (47.0, 8.0, 400.0), **request: Any) -> TaskFile:
    mission = {"items": list(items), "plannedHomePosition": list(home), "version": 2}
    text = json.dumps({"fileType": "Plan", "version": 1, "mission": mission})
    return read_plan(text, ReadOptions("f", **request))


def changed(item: Any, **changes: Any) -> Any:
    """A copy with other values, those of its camera among them."""
    copy = json.loads(json.dumps(item))
    parts = [copy, copy.get("TransectStyleComplexItem", {})]
    parts.append(parts[1].get("CameraCalc", copy.get("CameraCalc", {})))
    for key, value in changes.items():
        (part,) = (part for part in parts if key in part)
        part[key] = value
    return copy


def local(points: Any) -> np.ndarray[Any, Any]:
    return np.array([enu_from_wgs84(HOME, lat, lon, HOME.alt_m)[:2] for lat, lon in points])


# QGroundControl.


def test_a_survey_is_an_area_with_its_camera_height_and_angle() -> None:
    (area,) = read(SURVEY).areas

    assert area.table["camera"] == {
        "sensor_width_mm": 23.2,
        "sensor_height_mm": 15.4,
        "focal_length_mm": 16.0,
        "image_width_px": 5456,
        "image_height_px": 3632,
    }
    assert (area.table["sidelap_frac"], area.table["frontlap_frac"]) == (0.7, 0.68)
    assert (area.table["height_m"], area.table["heading_deg"]) == (60.0, 30.0)
    assert "spacing_m" not in area.table
    np.testing.assert_allclose(
        local(area.table["polygon"]), [(100, 100), (100, 400), (350, 420), (380, 120)], atol=1e-6
    )


def test_the_areas_camera_gives_the_distances_that_qgroundcontrol_had(tmp_path: Path) -> None:
    path = tmp_path / "s.toml"
    assert main(["import", str(DATA / "quarry.plan"), "-o", str(path)], COMMANDS) == 0

    (area,) = load_scenario(path).areas
    camera = SURVEY["TransectStyleComplexItem"]["CameraCalc"]
    assert area.apart_m == pytest.approx(camera["AdjustedFootprintSide"], rel=2e-3)
    assert area.picture_m == pytest.approx(camera["AdjustedFootprintFrontal"], rel=2e-2)


def test_a_survey_without_a_camera_keeps_its_distances() -> None:
    manual = CORRIDOR["TransectStyleComplexItem"]["CameraCalc"]
    item = json.loads(json.dumps(SURVEY))
    item["TransectStyleComplexItem"]["CameraCalc"] = manual

    (area,) = read(item).areas
    assert (area.table["spacing_m"], area.table["trigger_m"]) == (20.0, 25.0)
    assert "camera" not in area.table


def test_a_survey_that_is_flown_again_across_is_two_areas() -> None:
    found = read(changed(SURVEY, Refly90Degrees=True, HoverAndCapture=True))

    assert [area.table["heading_deg"] for area in found.areas] == [30.0, 120.0]
    assert [area.table["id"] for area in found.areas] == ["survey1", "survey2"]
    assert found.left_out == {"hover and capture": 1}


def test_a_height_above_the_sea_counts_from_home_and_no_camera_works_by_it() -> None:
    (area,) = read(changed(SURVEY, DistanceMode=2, DistanceToSurface=470)).areas

    assert area.table["height_m"] == 70.0
    assert area.table["spacing_m"] == 26.1


@pytest.mark.parametrize("mode", [3, 4])
@pytest.mark.parametrize("item", [SURVEY, CORRIDOR])
def test_a_height_above_the_ground_needs_the_ground(item: Any, mode: int) -> None:
    above = changed(item, DistanceMode=mode)

    with pytest.raises(InputError, match=r"its height is above the ground there"):
        read(above)
    found = read(above, has_terrain=True)
    assert {entry.table["height_m"] for entry in found.all_entries} <= {50.0, 60.0}


def test_a_corridor_is_lines_side_by_side_along_its_middle() -> None:
    found = read(CORRIDOR)

    assert [entry.table["id"] for entry in found.entries] == [
        "corridor1",
        "corridor2",
        "corridor3",
    ]
    first = local(found.entries[0].table["path"])
    np.testing.assert_allclose(first, [(-400, 20), (-220, 20), (-220, 250)], atol=1e-3)
    assert all(entry.table["trigger_m"] == 25.0 for entry in found.entries)
    assert all(entry.table["height_m"] == 50.0 for entry in found.entries)


def test_a_corridor_without_a_spacing_is_its_middle_as_in_qgroundcontrol() -> None:
    found = read(changed(CORRIDOR, AdjustedFootprintSide=0, AdjustedFootprintFrontal=0))

    (entry,) = found.entries
    np.testing.assert_allclose(
        local(entry.table["path"]), [(-400, 0), (-200, 0), (-200, 250)], atol=1e-3
    )
    assert "trigger_m" not in entry.table


@given(
    width_m=st.floats(0.0, 200.0),
    spacing_m=st.floats(5.0, 50.0),
    bend_m=st.floats(-300.0, 300.0),
)
def test_lines_of_a_corridor_leave_nothing_of_it_farther_than_half_a_spacing(
    width_m: float, spacing_m: float, bend_m: float
) -> None:
    middle = [(0.0, 0.0), (400.0, 0.0), (800.0, bend_m)]
    corners = [[47.0 + y / 111_200.0, 8.0 + x / 76_000.0] for x, y in middle]
    item = changed(
        CORRIDOR, CorridorWidth=width_m, AdjustedFootprintSide=spacing_m, polyline=corners
    )

    found = read(item)

    assert len(found.entries) == max(1, math.ceil(width_m / spacing_m))
    flown = shapely.union_all(
        [shapely.LineString(local(entry.table["path"])) for entry in found.entries]
    )
    covered = flown.buffer(spacing_m / 2.0 + 0.01, cap_style="flat", join_style="mitre")
    strip = shapely.LineString(local(corners)).buffer(
        width_m / 2.0, cap_style="flat", join_style="mitre"
    )
    assert strip.difference(covered.buffer(0.02)).area <= 1e-3 * max(strip.area, 1.0)


def test_a_structure_is_one_closed_line_for_each_layer() -> None:
    found = read(STRUCTURE)

    assert [entry.table["height_m"] for entry in found.entries] == [9.0, 17.0, 25.0]
    assert all(entry.table["trigger_m"] == 6.0 for entry in found.entries)
    ring = local(found.entries[0].table["path"])
    np.testing.assert_allclose(ring[0], ring[-1])
    around = shapely.Polygon(ring)
    assert around.bounds == pytest.approx((-10.0, -210.0, 30.0, -170.0), abs=1e-3)
    (note,) = found.notes
    assert note == (
        "mission.items[0]: along lines round the structure the camera is pointed at its middle; "
        "a vehicle without a gimbal turns its nose there"
    )
    assert {entry.table["kind"] for entry in found.entries} == {"structure"}


def test_structures_of_before_version_3_count_from_their_altitude() -> None:
    old = {key: value for key, value in STRUCTURE.items() if key != "ScanBottomAlt"}

    for relative, bottom_m in ((True, 405.0), (False, 5.0)):
        item = old | {"Altitude": 405.0, "altitudeRelative": relative, "version": 2}
        assert read(item).entries[0].table["height_m"] == bottom_m + 4.0


@pytest.mark.parametrize(
    ("item", "line"),
    [
        (
            changed(CORRIDOR, CorridorWidth=-5),
            (
                "a width of -5 m with lines 20 m apart cannot be flown; "
                "save the plan again in QGroundControl"
            ),
        ),
        (
            changed(STRUCTURE, Layers=0),
            (
                "0 layers, 10 m from the structure, cannot be flown; "
                "save the plan again in QGroundControl"
            ),
        ),
        (
            changed(STRUCTURE, polygon=[[47.0, 8.0], [47.1, 8.1], [47.1, 8.0], [47.0, 8.1]]),
            ("its polygon crosses itself or encloses nothing; draw it again in QGroundControl"),
        ),
    ],
)
def test_what_cannot_be_flown_takes_its_exact_line(item: Any, line: str) -> None:
    with pytest.raises(InputError) as caught:
        read(item)
    assert str(caught.value) == f"f: mission.items[0]: {line}"


def test_heights_above_home_need_a_home() -> None:
    for item in (SURVEY, CORRIDOR):
        with pytest.raises(InputError, match="plannedHomePosition: is no place with a height"):
            read(item, home=(47.0, 8.0, None))


# Fences and rally points.


def test_polygons_and_circles_of_a_geofence_are_zones() -> None:
    found = read_task_file(DATA / "quarry.plan")

    assert [zone.table.get("inclusive", False) for zone in found.zones] == [True, False, False]
    assert [zone.table["id"] for zone in found.zones] == ["fence1", "fence2", "fence3"]
    assert found.left_out["rally point"] == 1
    circle = shapely.Polygon(local(found.zones[2].table["polygon"]))
    assert circle.centroid.coords[0] == pytest.approx((-50.0, 300.0), abs=0.01)


@given(radius_m=st.floats(1.0, 5000.0), inclusive=st.booleans())
def test_a_circle_becomes_a_polygon_on_its_safe_side(radius_m: float, inclusive: bool) -> None:
    zone = circle_zone([47.0, 8.0], radius_m, "f", "here", inclusive=inclusive)

    assert isinstance(zone, FileEntry)
    corners: Any = zone.table["polygon"]
    ring = shapely.Polygon(local(corners)).exterior
    middle = shapely.Point(0.0, 0.0)
    nearest_m, farthest_m = ring.distance(middle), middle.hausdorff_distance(ring)
    if inclusive:
        assert farthest_m == pytest.approx(radius_m)
        assert nearest_m > 0.996 * radius_m
    else:
        assert nearest_m == pytest.approx(radius_m)
        assert farthest_m < 1.004 * radius_m


MEADOW = [DATA / name for name in ("meadow.waypoints", "meadow-fence.waypoints")]


def test_mission_fence_and_rally_points_of_mission_planner_are_put_together() -> None:
    found = read_task_files([*MEADOW, DATA / "meadow-rally.waypoints"], ImportOptions())

    assert found.home == HOME
    assert [entry.table["id"] for entry in found.entries] == ["t1", "t2", "t3"]
    assert [entry.table.get("trigger_m") for entry in found.entries] == [25.0, 25.0, None]
    assert [zone.table.get("inclusive", False) for zone in found.zones] == [True, False, False]
    assert found.left_out["rally point"] == 1
    assert found.left_out["fence return point"] == 1
    assert {entry.source for entry in found.zones} == {str(MEADOW[1])}


def test_fences_of_before_are_one_polygon_to_stay_in() -> None:
    (zone,) = read_fence((DATA / "meadow.fen").read_text(), ReadOptions("f", HOME)).zones

    assert zone.table["inclusive"] is True
    corners: Any = zone.table["polygon"]
    assert len(corners) == 5  # closed, as the program has it


@pytest.mark.parametrize(
    ("name", "tasks", "zones"),
    [("meadow-fence.txt", 0, 1), ("meadow-rally.txt", 0, 0)],
)
def test_files_that_end_in_txt_tell_what_they_are(name: str, tasks: int, zones: int) -> None:
    found = read_text_file((DATA / name).read_text(), ReadOptions("f", HOME))

    assert (len(found.entries), len(found.zones)) == (tasks, zones)
    waypoints = (DATA / "river.waypoints").read_text()
    assert len(read_text_file(waypoints, ReadOptions("f")).entries) == 2


@pytest.mark.parametrize(
    ("suffix", "text", "line"),
    [
        (".fen", "47 8\n47 8.1\n", "f: has 2 points; give the point to return to, then three"),
        (".fen", "47 8\n47,1 8\n", "f: line 2: '47,1 8' is no latitude and longitude; give two"),
        (".fen", "47 8\n47 nan\n", "f: line 2: '47 nan' is no latitude and longitude; give two"),
        (".rally", "RALLY 47 8\n47 8\n", "f: line 2: '47 8' is no rally point; give lines that"),
        (
            ".waypoints",
            "QGC WPL 110\n0\t0\t3\t5001\t3\t0\t0\t0\t47\t8\t0\t1\n",
            "f: line 2: says 3.0 corners, which do not follow; save the fence again",
        ),
        (
            ".waypoints",
            "QGC WPL 110\n0\t0\t3\t5003\t0\t0\t0\t0\t47\t8\t0\t1\n",
            "f: line 2: 0.0 is no radius of a circle; give a radius within 0..1e6 [m]",
        ),
    ],
)
def test_a_wrong_fence_takes_its_line(suffix: str, text: str, line: str) -> None:
    (told,) = lines(suffix, text, HOME)
    assert told.startswith(line)


def test_rally_points_alone_are_no_mission(tmp_path: Path) -> None:
    assert read_rally("RALLY 47 8 20 0 0 0\n", ReadOptions("f")).left_out == {"rally point": 1}
    path = DATA / "meadow-rally.waypoints"

    with pytest.raises(InputError) as caught:
        read_task_file(path)
    remedy = "give the file of the tasks, too"
    assert str(caught.value) == f"{path}: holds rally point and no task; {remedy}"


# Cameras that are triggered along waypoints.

HEAD = "QGC WPL 110\n0\t1\t0\t16\t0\t0\t0\t0\t47\t8\t400\t1\n"


def waypoints(*rows: tuple[int, float] | float) -> TaskFile:
    """A mission north of home: places by their distance [km], or a command and its parameter."""
    text = HEAD
    for number, row in enumerate(rows, start=1):
        command, first = (16, 0.0) if isinstance(row, int | float) else row
        lat_deg = 47.0 + 0.01 * row if isinstance(row, int | float) else 0.0
        fields = [number, 0, 3, command, first, 0, 0, 0, lat_deg, 8.0, 60, 1]
        text += "\t".join(map(str, fields)) + "\n"
    return read_waypoints(text, ReadOptions("f"))


ON, OFF = (206, 25.0), (206, 0.0)


@pytest.mark.parametrize(
    ("rows", "points"),
    [
        ((1, ON, 2, OFF, 3), [2, 1]),
        ((1, ON, 2, 3, OFF), [3]),
        ((1, ON, 2, 3), [3]),
        ((ON, 1, 2, OFF), [2]),
        ((1, ON, OFF, 2), [1, 1]),
        ((1, 2, ON, 3, (206, 10.0), 4, OFF, 5), [1, 2, 2, 1]),
        ((1, ON, 2, ON, 3, OFF), [3]),
        ((OFF, 1, 2), [1, 1]),
    ],
)
def test_waypoints_with_the_camera_on_are_one_line(rows: Any, points: list[int]) -> None:
    found = waypoints(*rows)

    path: list[Any] = [entry.table.get("path", [0]) for entry in found.entries]
    assert [len(each) for each in path] == points


# Several files.


def test_what_has_no_id_is_numbered_through_all_files(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("id,east_m,north_m\n,1,2\nt2,3,4\n")
    (tmp_path / "b.csv").write_text("east_m,north_m\n5,6\n7,8\n")

    found = read_task_files([tmp_path / "a.csv", tmp_path / "b.csv"], ImportOptions())
    assert [entry.table["id"] for entry in found.entries] == ["t1", "t2", "t3", "t4"]


def test_an_id_in_two_files_is_told_with_both_places(tmp_path: Path) -> None:
    for name in ("a.csv", "b.csv"):
        (tmp_path / name).write_text("id,east_m,north_m\npost,1,2\n")
    first, second = tmp_path / "a.csv", tmp_path / "b.csv"

    with pytest.raises(InputError) as caught:
        read_task_files([first, second], ImportOptions())
    assert str(caught.value) == (
        f"{second}: line 2, id: 'post' is already the id at {first}, line 2; "
        "give every one an id of its own"
    )


def test_heights_of_a_second_plan_count_from_the_home_of_the_first(tmp_path: Path) -> None:
    low = json.loads(json.dumps(QUARRY))
    low["mission"]["plannedHomePosition"] = [47.0, 8.0, 380.0]
    low["mission"]["items"] = [SURVEY]
    low["geoFence"] = {}
    path = tmp_path / "low.plan"
    path.write_text(json.dumps(low))

    found = read_task_files([DATA / "meadow.waypoints", path], ImportOptions())
    assert found.home == Origin(47.0, 8.0, 400.0)
    (area,) = found.areas
    assert area.table["height_m"] == 40.0


def test_the_fence_of_several_plans_is_there_once(tmp_path: Path) -> None:
    other = json.loads(json.dumps(QUARRY))
    other["geoFence"]["polygons"].pop()
    (tmp_path / "other.plan").write_text(json.dumps(other))

    found = read_task_files([tmp_path / "other.plan", DATA / "quarry.plan"], ImportOptions())
    assert [zone.table["id"] for zone in found.zones] == ["fence1", "fence2", "fence3"]


def test_faults_of_all_files_are_told_at_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "a.csv").write_text("east_m\n")
    (tmp_path / "b.kml").write_text("<svg/>")

    assert main(["import", str(tmp_path / "a.csv"), str(tmp_path / "b.kml")], COMMANDS) == 2
    starts = [line.partition(": ")[0] for line in capsys.readouterr().err.splitlines()]
    assert starts == [str(tmp_path / "a.csv"), str(tmp_path / "b.kml")]


# On the ground.


def test_where_the_ground_is_known_places_stand_on_it_and_lines_keep_their_heights() -> None:
    files = [DATA / "meadow.waypoints", DATA / "quarry.plan"]
    found = read_task_files(files, ImportOptions(has_terrain=True))

    assert not any("alt_m" in entry.table for entry in found.entries)
    assert not any("path_m" in entry.table for entry in found.entries)
    assert [area.table["height_m"] for area in found.areas] == [60.0]
    assert found.notes[-2:] == (
        "heights of 2 tasks are left out, as they stand on the ground now",
        "lines are flown as high above the ground as they were planned above home",
    )


def test_a_waypoint_above_the_ground_is_flown_as_high_above_it() -> None:
    text = HEAD + "1\t0\t10\t16\t0\t0\t0\t0\t47.1\t8\t55\t1\n"
    found = read_waypoints(text, ReadOptions("f", has_terrain=True))

    assert found.entries[0].table == {
        "id": "t1",
        "lat_deg": 47.1,
        "lon_deg": 8.0,
        "height_m": 55.0,
    }
