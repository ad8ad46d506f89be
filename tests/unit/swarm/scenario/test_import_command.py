"""`swarm import` makes a scenario that loads, and says what it made."""

from __future__ import annotations

import json
import tomllib
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from swarm.cli import main
from swarm.model import Mission, Origin
from swarm.model.frames import wgs84_from_enu
from swarm.scenario import load_scenario, parse_scenario
from swarm.survey.cameras import CAMERAS

DATA = Path(__file__).parents[3] / "data" / "task_files"
COMMANDS = {"import": EntryPoint("import", "swarm.scenario.cli:import_tasks", "peckorder.commands")}


def run(*arguments: str) -> int:
    return main(["import", *arguments], COMMANDS)


def imported(capsys: pytest.CaptureFixture[str], *arguments: str) -> Mission:
    """The mission of the scenario that the command prints."""
    assert run(*arguments) == 0
    return parse_scenario(capsys.readouterr().out.encode(), "out.toml")


def test_plan_becomes_a_scenario_of_a_fleet_at_its_home(tmp_path: Path) -> None:
    path = tmp_path / "orchard.toml"

    assert run(str(DATA / "orchard.plan"), "--uavs", "3", "-o", str(path)) == 0

    mission = load_scenario(path)
    assert (mission.name, mission.origin) == ("orchard", Origin(47.0, 8.0, 400.0))
    assert [uav.id for uav in mission.uavs] == ["uav1", "uav2", "uav3"]
    assert [uav.position_enu_m for uav in mission.uavs] == [
        (0.0, 0.0, 0.0),
        (5.0, 0.0, 0.0),
        (10.0, 0.0, 0.0),
    ]
    assert {uav.speed_m_s for uav in mission.uavs} == {6.0}
    (area,) = mission.areas
    assert len(mission.tasks) == 3 + area.lines
    assert next(task.service_s for task in mission.tasks if task.id == "t1") == 12.5


def test_places_keep_all_their_digits(capsys: pytest.CaptureFixture[str]) -> None:
    mission = imported(capsys, str(DATA / "orchard.plan"))
    assert mission.origin is not None

    (first,) = (task for task in mission.tasks if task.id == "t1")
    place = wgs84_from_enu(mission.origin, first.position_enu_m)

    assert place == pytest.approx((47.001, 8.001, 440.0), abs=1e-12)


def test_story_goes_to_standard_error(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source, path = DATA / "orchard.plan", tmp_path / "o.toml"

    assert run(str(source), "-o", str(path)) == 0

    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err == (
        f"{source}: 3 tasks and 1 area of 4 lines for 3 UAVs; left out: takeoff, change speed, "
        "set roi location, return to launch\n"
        "note: areas without a value are worth 1 for every hectare (--value)\n"
        f"fly it with: swarm run {path}\n"
    )


def test_horizon_leaves_one_uav_the_time_for_everything(capsys: pytest.CaptureFixture[str]) -> None:
    mission = imported(capsys, str(DATA / "grid.csv"), "--speed-m-s", "2")

    # To (50, 50), (100, 0), (0.5, -200.25, 12), 10 s of service, after the pop-up at 30 s.
    flight_m = 70.71 + 70.71 + 223.91
    assert flight_m / 2.0 + 40.0 < mission.horizon_s <= flight_m / 2.0 + 50.0


def test_horizon_of_an_endless_journey_is_the_longest_allowed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "far.csv"
    path.write_text("east_m,north_m\n1e7,0\n-1e7,0\n")

    assert imported(capsys, str(path), "--speed-m-s", "0.01").horizon_s == 1e9


def test_options_say_the_rest(capsys: pytest.CaptureFixture[str]) -> None:
    options = "--uavs 2 --speed-m-s 7.5 --horizon-s 900 --value 4 --service-s 8 --name my-trees"
    mission = imported(capsys, str(DATA / "trees.geojson"), "--home", "47,8,390", *options.split())

    assert (mission.name, mission.horizon_s) == ("my-trees", 900.0)
    assert [uav.speed_m_s for uav in mission.uavs] == [7.5, 7.5]
    assert mission.origin == Origin(47.0, 8.0, 390.0)
    assert [(task.value, task.service_s) for task in mission.tasks] == [
        (5.0, 20.0),
        (4.0, 8.0),
        (4.0, 8.0),
    ]
    assert [task.position_enu_m[2] for task in mission.tasks] == [40.0, 0.0, 0.0]


def test_heights_of_waypoints_can_be_kept(capsys: pytest.CaptureFixture[str]) -> None:
    mission = imported(capsys, str(DATA / "river.waypoints"), "--below-m", "0")

    assert [task.position_enu_m[2] for task in mission.tasks] == [30.0, 50.0]


def test_scenario_is_commented(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(str(DATA / "river.waypoints"), "--uavs", "1") == 0

    out = capsys.readouterr().out
    assert "# D: a task done t seconds after the start is worth p · value · (D − t).\n" in out
    assert "# Each place is 10 m below its waypoint for that reason.\n[[task]]\n" in out
    assert list(tomllib.loads(out)) == ["schema", "name", "mission", "origin", "uav", "task"]


@pytest.mark.parametrize(
    ("file", "name"),
    [("Süd feld (2).csv", "S-d-feld-2"), ("..csv.csv", "csv"), ("___.csv", "mission")],
)
def test_mission_is_named_after_the_file(
    file: str, name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / file).write_bytes((DATA / "grid.csv").read_bytes())

    assert imported(capsys, str(tmp_path / file)).name == name


def test_scenario_that_is_there_is_not_overwritten(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "mine.toml"
    path.write_text("worked on")

    assert run(str(DATA / "grid.csv"), "-o", str(path)) == 2

    expected = f"--output: {path}: is there already; remove it, or name another file\n"
    assert capsys.readouterr().err == expected
    assert path.read_text() == "worked on"


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (
            ["--home", "47.4"],
            (
                "--home: '47.4' is no place; "
                "give LAT,LON,ALT in degrees and metres, such as 47.397742,8.545594,488"
            ),
        ),
        (
            ["--home", "97,8,4"],
            (
                "--home: '97,8,4' is no place; "
                "give LAT,LON,ALT in degrees and metres, such as 47.397742,8.545594,488"
            ),
        ),
        (
            ["--camera", "dji-mavic-3"],
            (
                "--camera: 'dji-mavic-3' is no camera that is known; "
                "did you mean 'dji-mavic-3e'? Choose one of "
            ),
        ),
        (
            ["--camera", "dji-mavic-3e"],
            "--camera: needs to know how high it flies; add --height-m, above 0",
        ),
        (
            ["--camera", "dji-mavic-3e", "--height-m", "60", "--spacing-m", "20"],
            "--camera: says how far apart lines are, as --spacing-m does; leave out one",
        ),
        (
            ["--name", "a b"],
            (
                "--name: 'a b' is not an id; give 1 to 64 letters, digits, '_', '-' or '.', "
                "beginning with a letter or digit"
            ),
        ),
        (
            ["-o", "no/such/folder.toml"],
            (
                "--output: no/such/folder.toml: cannot be written: No such file or directory; "
                "name a file that can be"
            ),
        ),
    ],
)
def test_wrong_option_is_one_line_and_status_2(
    arguments: list[str], line: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(str(DATA / "grid.csv"), *arguments) == 2

    captured = capsys.readouterr()
    assert captured.out == ""
    (told,) = captured.err.splitlines()
    assert told == line or (line.endswith("one of ") and told.startswith(line))


def test_areas_that_say_nothing_of_it_get_a_spacing_that_is_told(
    capsys: pytest.CaptureFixture[str],
) -> None:
    fields, home = str(DATA / "fields-qgis.geojson"), ("--home", "47,8,400")

    assert run(fields, *home) == 0
    captured = capsys.readouterr()
    mission = parse_scenario(captured.out.encode(), "out.toml")
    assert [area.spacing_m for area in mission.areas] == [20.0, 25.0, 25.0]
    assert [area.value for area in mission.areas] == [8.58, 12.5, 12.5]
    assert (
        "note: Sudacker-1, Sudacker-2: lines 25 m apart are a guess; --spacing-m M, or "
        "--camera NAME with --height-m H, says better\n"
        "note: areas without a value are worth 1 for every hectare (--value)\n"
    ) in captured.err

    assert run(fields, *home, "--spacing-m", "30") == 0
    captured = capsys.readouterr()
    mission = parse_scenario(captured.out.encode(), "out.toml")
    assert [area.spacing_m for area in mission.areas] == [20.0, 30.0, 30.0]
    assert "guess" not in captured.err


def test_a_camera_and_its_height_serve_areas_that_name_none(
    capsys: pytest.CaptureFixture[str],
) -> None:
    camera = ("--camera", "dji-mavic-3e", "--height-m", "60")
    mission = imported(capsys, str(DATA / "fields-qgis.geojson"), "--home", "47,8,400", *camera)

    first, second, _ = mission.areas
    assert (first.spacing_m, first.camera, first.height_m) == (20.0, None, 60.0)
    assert second.camera == CAMERAS["dji-mavic-3e"]
    assert (second.height_m, second.sidelap_frac, second.frontlap_frac) == (60.0, 0.7, 0.8)


def test_the_camera_of_a_plan_is_written_by_its_numbers(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert run(str(DATA / "quarry.plan")) == 0

    out = capsys.readouterr().out
    assert "image_width_px = 5456, image_height_px = 3632 }" in out
    (area,) = parse_scenario(out.encode(), "out.toml").areas
    assert area.camera is not None
    assert area.camera.sensor_width_mm == 23.2


def test_the_horizon_leaves_time_to_fly_along_lines(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "l.geojson"
    line = {"type": "LineString", "coordinates": [[8.0, 47.0], [8.0, 47.09]]}
    path.write_text(json.dumps({"type": "Feature", "geometry": line, "properties": {}}))

    horizon_s = imported(capsys, str(path), "--home", "47,8,400", "--speed-m-s", "10").horizon_s
    assert 1000.0 < horizon_s <= 1020.0  # 10 km


def test_wrong_task_is_one_line_and_status_2(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "t.csv"
    path.write_text("east_m,north_m,value\n1,2,-1\n")

    assert run(str(path)) == 2

    remedy = "give a number >= 0 and <= 1e12, such as value = 5.0"
    assert capsys.readouterr().err == f"{path}: line 2, value: -1.0 is not >= 0; {remedy}\n"


def test_help_shows_one_command_from_a_plan_to_a_flight(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("--help") == 0

    example = "swarm import survey.plan --uavs 3 -o survey.toml && swarm run survey.toml"
    assert example in capsys.readouterr().out
