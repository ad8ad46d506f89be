"""What files of tasks say of times and fences is kept when a scenario is made of them."""

from __future__ import annotations

import json
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

import pytest

from swarm.cli import main
from swarm.model import Mission, Origin
from swarm.model.frames import enu_from_wgs84
from swarm.runtime.errors import InputError
from swarm.scenario import load_scenario, parse_scenario

DATA = Path(__file__).parents[3] / "data" / "task_files"
COMMANDS = {"import": EntryPoint("import", "swarm.scenario.cli:import_tasks", "peckorder.commands")}
CSV = "east_m,north_m,due_s,opens_s,closes_s\n10,20,300,60,240\n30,40,,,\n"
AROUND = [[46.99, 7.99], [46.99, 8.02], [47.02, 8.02], [47.02, 7.99]]
BESIDE = [[47.005, 8.01], [47.005, 8.011], [47.006, 8.011]]


def run(*arguments: str) -> int:
    return main(["import", *arguments], COMMANDS)


def imported(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[Mission, str]:
    """The mission of the scenario that the command prints, and its text."""
    assert run(*arguments) == 0
    out = capsys.readouterr().out
    return parse_scenario(out.encode(), "out.toml"), out


def fenced(tmp_path: Path, **fence: Any) -> Path:
    """The orchard's plan with such a geofence."""
    plan = json.loads((DATA / "orchard.plan").read_text(encoding="utf-8"))
    plan["geoFence"] |= fence
    path = tmp_path / "orchard.plan"
    path.write_text(json.dumps(plan), encoding="utf-8")
    return path


def test_times_of_a_csv_are_kept(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "t.csv"
    path.write_text(CSV)

    mission, text = imported(capsys, str(path))

    first, second = mission.tasks
    assert (first.due_s, first.opens_s, first.closes_s) == (300.0, 60.0, 240.0)
    assert (second.due_s, second.opens_s, second.closes_s) == (None, 0.0, None)
    assert "schema = 2\n" in text


def test_the_horizon_leaves_time_for_what_opens_late(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "t.csv"
    path.write_text("east_m,north_m,opens_s\n10,20,5000\n")

    assert imported(capsys, str(path))[0].horizon_s > 5000.0


def test_times_of_geojson_are_kept(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    feature = {
        "type": "Feature",
        "geometry": {"type": "Point", "coordinates": [8.0, 47.0]},
        "properties": {"due_s": 300, "OPENS_S": 60, "closes_s": None},
    }
    path = tmp_path / "t.geojson"
    path.write_text(json.dumps({"type": "FeatureCollection", "features": [feature]}))

    mission, text = imported(capsys, str(path), "--home", "47,8,400")

    (task,) = mission.tasks
    assert (task.due_s, task.opens_s, task.closes_s) == (300.0, 60.0, None)
    assert "schema = 2\n" in text


def test_a_file_without_times_and_fences_stays_in_schema_1(
    capsys: pytest.CaptureFixture[str],
) -> None:
    for file in ("river.waypoints", "grid.csv"):
        assert "schema = 1\n" in imported(capsys, str(DATA / file))[1]


def test_a_misspelled_or_negative_time_is_told_at_its_place(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "t.csv"
    for text, line in (
        (CSV.replace("closes_s", "close_s"), "line 1: column 'close_s' is unknown; did you mean"),
        (CSV.replace("300", "-300"), "line 2, due_s: -300.0 is not >= 0; give a number >= 0"),
    ):
        path.write_text(text)
        assert run(str(path)) == 2
        assert f"{path}: {line}" in capsys.readouterr().err


def test_tasks_from_a_file_with_times_take_schema_2(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text(CSV)
    path = tmp_path / "mission.toml"
    head = 'name = "m"\ntasks_from = "t.csv"\n[mission]\nhorizon_s = 600.0\n'
    text = f'schema = 1\n{head}[[uav]]\nid = "u"\nposition_m = [0, 0]\nspeed_m_s = 5\n'
    path.write_text(text)

    with pytest.raises(InputError) as caught:
        load_scenario(path)
    assert str(caught.value) == (
        f"{path}: schema: is 1, and due_s, opens_s and closes_s are of schema 2; give schema = 2"
    )
    path.write_text(text.replace("schema = 1", "schema = 2"))
    assert load_scenario(path).tasks[0].closes_s == 240.0


def test_polygons_of_the_geofence_become_zones(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    polygons = [
        {"inclusion": True, "polygon": AROUND, "version": 1},
        {"inclusion": False, "polygon": BESIDE, "version": 1},
        {"version": 1},
    ]
    circles = [{"circle": {"center": [47.01, 8.0], "radius": 0}, "inclusion": True, "version": 1}]
    path = fenced(tmp_path, polygons=polygons, circles=circles)

    assert run(str(path), "-o", str(tmp_path / "o.toml")) == 0

    mission = load_scenario(tmp_path / "o.toml")
    origin = Origin(47.0, 8.0, 400.0)
    assert [(zone.id, zone.inclusive) for zone in mission.zones] == [
        ("fence1", True),
        ("fence2", False),
    ]
    assert mission.zones[1].polygon_enu_m == tuple(
        enu_from_wgs84(origin, lat_deg, lon_deg, 400.0)[:2] for lat_deg, lon_deg in BESIDE
    )
    story = capsys.readouterr().err
    assert "3 tasks and 1 area of " in story
    assert "for 3 UAVs and 2 zones; left out: " in story
    assert "geofence polygon, geofence circle" in story


def test_a_waypoint_beyond_the_fence_is_told_and_the_fence_can_be_left_out(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    around_home = [[46.9995, 7.9995], [46.9995, 8.0005], [47.0005, 8.0005], [47.0005, 7.9995]]
    path = fenced(tmp_path, polygons=[{"inclusion": True, "polygon": around_home, "version": 1}])

    assert run(str(path)) == 2
    lines = capsys.readouterr().err.splitlines()
    assert all("lies outside of zone 'fence1', the only place where to fly" in x for x in lines)
    assert lines[0].startswith(f"{path}: mission.items[")

    mission, text = imported(capsys, str(path), "--no-fence")
    assert mission.zones == ()
    assert "[[zone]]" not in text


def test_tasks_from_a_plan_leaves_its_fence_out(tmp_path: Path) -> None:
    """A scenario has zones of its own; a file of schema 1 with a fenced plan stays valid."""
    fenced(tmp_path, polygons=[{"inclusion": False, "polygon": AROUND, "version": 1}])
    path = tmp_path / "mission.toml"
    head = 'schema = 1\nname = "m"\ntasks_from = "orchard.plan"\n[mission]\nhorizon_s = 600.0\n'
    path.write_text(f'{head}[[uav]]\nid = "u"\nposition_m = [0, 0]\nspeed_m_s = 5\n')

    assert load_scenario(path).zones == ()
