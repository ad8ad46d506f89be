"""Lines, ways round zones, swaps and zones of a plan, as QGroundControl is told them and back."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from coordinator.export import ExportFirmware, require_exportable, write_plans
from coordinator.planner.plan import make_plan
from swarm.cli import main
from swarm.model import (
    Base,
    BaseId,
    Mission,
    Origin,
    Plan,
    Task,
    TaskId,
    Uav,
    UavId,
    Zone,
    ZoneId,
)
from swarm.model.frames import enu_from_wgs84
from swarm.runtime.clock import SystemClock
from swarm.runtime.errors import InputError
from swarm.scenario import load_scenario
from swarm.scenario.files import resolve_scenario
from swarm.scenario.task_files import ImportOptions, TaskFile, read_task_file, read_task_files
from tests.support.hills import above_m
from tests.support.qgroundcontrol import faults

PLAN = {"plan": EntryPoint("plan", "coordinator.cli:plan", "peckorder.commands")}
IMPORT = {"import": EntryPoint("import", "swarm.scenario.cli:import_tasks", "peckorder.commands")}
DATA = Path(__file__).parents[2] / "data" / "task_files"
ORIGIN = Origin(47.0, 8.0, 400.0)
HOME = (0.0, 0.0, 0.0)
U = UavId("u")
LINE = Task(
    TaskId("line"),
    (100.0, 0.0, 0.0),
    3.0,
    service_s=4.0,
    path_enu_m=((100.0, 0.0, 0.0), (100.0, 80.0, 0.0), (60.0, 120.0, 0.0)),
    trigger_m=12.5,
    height_m=60.0,
)
WALL = Zone(ZoneId("wall"), ((40.0, -50.0), (60.0, -50.0), (60.0, 50.0), (40.0, 50.0)))


def mission(*tasks: Task, **changes: object) -> Mission:
    base = Mission("m", 6000.0, (Uav(U, HOME, 8.0),), tasks, origin=ORIGIN, schema=2)
    return replace(base, **changes)  # type: ignore[arg-type]  # names come from the tests


def planned(what: Mission) -> Plan:
    return make_plan(what, "greedy", clock=SystemClock(), seed=0, bound_s=None)


def exported(what: Mission, folder: Path) -> list[Any]:
    """The documents of all sorties, in order; each as QGroundControl's loader asks for."""
    made = write_plans(folder, what, planned(what), ExportFirmware.ARDUPILOT)
    documents = [json.loads(path.read_text(encoding="utf-8")) for path in made.files]
    for document in documents:
        assert faults(document) == []
        items = document["mission"]["items"]
        assert [item["doJumpId"] for item in items] == [*range(1, len(items) + 1)]
        for item in items:
            if item["frame"] == 3:
                assert item["Altitude"] == item["params"][6]
    return documents


@pytest.mark.parametrize(
    ("spoil", "fault"),
    [
        (lambda plan: plan.pop("rallyPoints"), "plan.rallyPoints is missing"),
        (lambda plan: plan.update(version=2), "plan.version is 2"),
        (lambda plan: plan["mission"].update(version=1), "mission.version is 1"),
        (lambda plan: plan["mission"].pop("firmwareType"), "mission.firmwareType is missing"),
        (lambda plan: plan["mission"]["items"][2].pop("Altitude"), "items[2].Altitude is missing"),
        (
            lambda plan: plan["mission"]["items"][2].update(autoContinue=1),
            "items[2].autoContinue is 1",
        ),
        (lambda plan: plan["mission"]["items"][0]["params"].pop(), "items[0].params is"),
        (
            lambda plan: plan["geoFence"]["polygons"][0]["polygon"][0].pop(),
            "polygons[0] has",
        ),
        (
            lambda plan: plan["geoFence"]["polygons"][0].pop("inclusion"),
            "polygons[0].inclusion is missing",
        ),
    ],
)
def test_what_qgroundcontrol_would_refuse_is_seen(
    tmp_path: Path, spoil: Callable[[Any], object], fault: str
) -> None:
    (document,) = exported(mission(LINE, zones=(WALL,)), tmp_path)
    spoil(document)

    assert any(each.startswith(fault) for each in faults(document))


def test_what_qgroundcontrol_has_written_passes() -> None:
    for name in ("orchard.plan", "quarry.plan"):
        document = json.loads((DATA / name).read_text(encoding="utf-8"))
        simple = [i for i in document["mission"]["items"] if i["type"] == "SimpleItem"]
        document["mission"]["items"] = simple
        assert faults(document) == [], name


def commands(document: Any) -> list[int]:
    return [item["command"] for item in document["mission"]["items"]]


def place(item: Any) -> tuple[float, float, float]:
    """East, north and height above home [m]."""
    lat_deg, lon_deg, up_m = item["params"][4:]
    return (*enu_from_wgs84(ORIGIN, lat_deg, lon_deg, 400.0)[:2], up_m)


def test_a_line_is_flown_from_end_to_end_with_the_camera_on_along_it(tmp_path: Path) -> None:
    (document,) = exported(mission(LINE), tmp_path)

    assert commands(document) == [22, 178, 16, 206, 16, 16, 206, 20]
    items = document["mission"]["items"]
    on, off = items[3], items[6]
    assert (on["params"], on["frame"]) == ([12.5, 0, 1, 0, 0, 0, 0], 2)
    assert off["params"] == [0, 0, 1, 0, 0, 0, 0]
    waypoints = [place(items[number]) for number in (2, 4, 5)]
    np.testing.assert_allclose(
        waypoints, [(100.0, 0.0, 60.0), (100.0, 80.0, 60.0), (60.0, 120.0, 60.0)], atol=1e-3
    )
    assert [items[number]["params"][0] for number in (2, 4, 5)] == [0.0, 0.0, 4.0]


def test_the_camera_looks_at_what_a_closed_line_leads_round(tmp_path: Path) -> None:
    ring = ((80.0, 0.0), (120.0, 0.0), (120.0, 40.0), (80.0, 40.0), (80.0, 0.0))
    tower = replace(
        LINE,
        path_enu_m=tuple((*corner, 0.0) for corner in ring),
        position_enu_m=(80.0, 0.0, 0.0),
        kind="structure",
    )
    (document,) = exported(mission(tower), tmp_path)

    assert commands(document) == [22, 178, 16, 195, 206, 16, 16, 16, 16, 206, 197, 20]
    look = document["mission"]["items"][3]
    assert place(look) == pytest.approx((100.0, 20.0, 60.0), abs=1e-3)
    assert look["params"][:4] == [0.0, 0, 0, 0.0]  # ArduPilot refuses NaN there
    back = read_task_file(tmp_path / "m.u.plan")
    (entry,) = back.entries
    assert entry.table["kind"] == "structure"
    assert entry.table["path"][0] == pytest.approx(entry.table["path"][-1])  # type: ignore[index]
    open_line = replace(tower, path_enu_m=tower.path_enu_m[:4])
    assert 195 not in commands(exported(mission(open_line), tmp_path)[0])
    assert 195 not in commands(exported(mission(replace(tower, kind=None)), tmp_path)[0])


def test_a_line_without_a_camera_and_height_is_flown_in_the_layer(tmp_path: Path) -> None:
    plain = replace(LINE, trigger_m=None, height_m=None)
    (document,) = exported(mission(plain), tmp_path)

    assert commands(document) == [22, 178, 16, 16, 16, 20]
    assert {item["Altitude"] for item in document["mission"]["items"] if "Altitude" in item} == {
        10.0
    }


def test_ways_lead_round_zones_by_waypoints_that_are_no_tasks(tmp_path: Path) -> None:
    beyond = Task(TaskId("beyond"), (100.0, 0.0, 20.0), 1.0)
    what = mission(beyond, zones=(WALL,))
    (document,) = exported(what, tmp_path)

    assert commands(document) == [22, 178, 16, 16, 16, 16, 16, 20]
    items = document["mission"]["items"]
    corners = [place(item)[:2] for item in items[2:4]]
    assert [abs(north_m) for _, north_m in corners] == pytest.approx([50.0, 50.0], abs=1e-3)
    heights_m = [place(item)[2] for item in items[2:5]]
    assert heights_m == sorted(heights_m)  # it climbs on the way, to 20 m and its layer
    assert heights_m[-1] == pytest.approx(30.0)
    back = read_task_file(tmp_path / "m.u.plan")
    assert [entry.table["id"] for entry in back.entries] == ["beyond"]


def test_zones_are_the_geofence_and_come_back_as_zones(tmp_path: Path) -> None:
    around = Zone(
        ZoneId("around"),
        ((-500.0, -500.0), (500.0, -500.0), (500.0, 500.0), (-500.0, 500.0)),
        holes_enu_m=(((-300.0, -300.0), (-200.0, -300.0), (-200.0, -200.0)),),
        inclusive=True,
    )
    what = mission(LINE, zones=(WALL, around))
    (document,) = exported(what, tmp_path)

    fence = document["geoFence"]
    assert [polygon["inclusion"] for polygon in fence["polygons"]] == [False, True, False]
    assert all(polygon["version"] == 1 for polygon in fence["polygons"])
    assert (fence["circles"], fence["version"]) == ([], 2)
    back = read_task_file(tmp_path / "m.u.plan")
    assert [zone.table.get("inclusive", False) for zone in back.zones] == [False, True, False]
    corners: Any = back.zones[0].table["polygon"]
    found = [enu_from_wgs84(ORIGIN, lat, lon, 400.0)[:2] for lat, lon in corners]
    np.testing.assert_allclose(np.array(found), np.array(WALL.polygon_enu_m), atol=1e-6)


def test_a_zone_that_may_be_flown_over_is_no_fence_and_told(tmp_path: Path) -> None:
    low, high = replace(WALL, ceiling_m=30.0), replace(WALL, id=ZoneId("high"), floor_m=5.0)
    what = mission(LINE, zones=(low, high))

    made = write_plans(tmp_path, what, planned(what), ExportFirmware.PX4)

    assert made.unfenced == ("wall", "high")
    (document,) = (json.loads(path.read_text()) for path in made.files)
    assert document["geoFence"]["polygons"] == []


def test_each_sortie_is_a_plan_that_takes_off_where_the_last_one_landed(tmp_path: Path) -> None:
    tasks = [Task(TaskId(f"t{n}"), (400.0, 100.0 * n, 0.0), 1.0) for n in range(4)]
    uav = Uav(U, HOME, 8.0, endurance_s=160.0)
    base = Base(BaseId("b"), (200.0, 0.0, 5.0), swap_s=30.0)
    what = mission(*tasks, uavs=(uav,), bases=(base,))

    documents = exported(what, tmp_path)

    assert len(documents) > 1
    names = sorted(path.name for path in tmp_path.iterdir())
    assert names == ["m.u.plan", *(f"m.u.sortie{n}.plan" for n in range(2, len(documents) + 1))]
    homes = [document["mission"]["plannedHomePosition"] for document in documents]
    assert homes[0] == [47.0, 8.0, 400.0]
    assert homes[1][2] == 405.0
    first_end = documents[0]["mission"]["items"][-1]
    assert first_end["command"] == 21
    assert first_end["params"][4:6] == homes[1][:2]
    assert first_end["params"][6] == 5.0  # above the home of its own plan
    told = [
        entry["task"]["id"] for document in documents for entry in document["peckorder"]["tasks"]
    ]
    assert sorted(told) == ["t0", "t1", "t2", "t3"]


class Tidal(Mission):
    """A mission that asks for what no exported plan tells."""

    constraints = ("path_m", "tide_m")


def test_what_plans_do_not_tell_is_refused() -> None:
    require_exportable(mission(LINE, zones=(WALL,)), "s.toml")

    with pytest.raises(InputError) as caught:
        require_exportable(Tidal("m", 60.0, (Uav(U, HOME, 8.0),), (LINE,)), "s.toml")
    assert str(caught.value) == (
        "s.toml: asks for tide_m, which exported plans do not heed; plan without --export"
    )


def test_over_hills_every_way_keeps_its_distance_and_ends_in_a_landing(tmp_path: Path) -> None:
    ridge = load_scenario(resolve_scenario("ridge"))
    assert ridge.terrain is not None
    assert ridge.origin is not None

    documents = exported(ridge, tmp_path)

    assert len(documents) == 3
    assert sum(commands(each).count(206) for each in documents) == 4  # two lines with pictures
    for document in documents:
        items = [item for item in document["mission"]["items"] if item["frame"] == 3]
        assert [item["command"] for item in items[-2:]] == [16, 21]
        home_m = document["mission"]["plannedHomePosition"][2] - ridge.origin.alt_m
        flown = []
        for item in items[:-1]:
            lat_deg, lon_deg, up_m = item["params"][4:]
            flat_m = enu_from_wgs84(ridge.origin, lat_deg, lon_deg, 0.0)[:2]
            flown.append((*flat_m, up_m + home_m))
        assert above_m(ridge.terrain, np.array(flown)).min() >= ridge.terrain.planned_m - 0.2
    back = read_task_files([tmp_path / "ridge.uav1.plan"], ImportOptions(has_terrain=True))
    assert back.entries


def test_waits_are_hold_times_and_no_service_when_it_comes_back(tmp_path: Path) -> None:
    late = Task(TaskId("late"), (80.0, 0.0, 0.0), 1.0, service_s=5.0, opens_s=60.0)
    (document,) = exported(mission(late), tmp_path)

    assert document["mission"]["items"][2]["params"][0] == pytest.approx(55.0)
    (entry,) = read_task_file(tmp_path / "m.u.plan").entries
    assert (entry.table["service_s"], entry.table["opens_s"]) == (5.0, 60.0)


def test_saved_by_qgroundcontrol_lines_are_told_by_the_camera(tmp_path: Path) -> None:
    exported(mission(LINE), tmp_path)
    path = tmp_path / "m.u.plan"
    document = json.loads(path.read_text())
    del document["peckorder"]
    path.write_text(json.dumps(document))

    (entry,) = read_task_file(path).entries
    assert (entry.table["trigger_m"], entry.table["height_m"]) == (12.5, 60.0)
    assert entry.table["service_s"] == 4.0
    path_deg: Any = entry.table["path"]
    assert len(path_deg) == 3


@pytest.mark.parametrize(
    "damage",
    [
        {"tasks": 5},
        {"tasks": [5]},
        {"tasks": [{"task": {"id": "a"}, "first": 0, "last": 1, "in_layer": True}]},
        {"tasks": [{"task": {"id": "a"}, "first": 3, "last": 99, "in_layer": True}]},
        {"tasks": [{"task": {"id": "a", "zone": 1}, "first": 3, "last": 3, "in_layer": True}]},
        {"tasks": [{"task": {"id": "a"}, "first": 2, "last": 2, "in_layer": True}]},
        {"tasks": [{"task": {"id": "a"}, "first": 3, "last": 3, "in_layer": 1}]},
    ],
)
def test_what_a_plan_says_wrongly_of_itself_is_passed_over(damage: Any, tmp_path: Path) -> None:
    exported(mission(LINE), tmp_path)
    path = tmp_path / "m.u.plan"
    document = json.loads(path.read_text())
    document["peckorder"] |= damage
    path.write_text(json.dumps(document))

    (entry,) = read_task_file(path).entries
    assert entry.table["id"] == "t1"
    assert "path" in entry.table


@st.composite
def missions(draw: st.DrawFn) -> Mission:
    """Places and lines round a wall, in layers and at heights of their own."""
    metres = st.floats(-400.0, 400.0).map(lambda number: round(number, 3))
    heights = st.floats(-20.0, 50.0).map(lambda number: round(number, 3))
    points = st.tuples(metres.map(lambda east: east + 600.0), metres, heights)
    tasks = []
    for number in range(draw(st.integers(1, 5))):
        line = draw(st.lists(points, min_size=1, max_size=4, unique=True))
        path = tuple(line) if line[1:] else ()
        tasks.append(
            Task(
                TaskId(f"task-{number}"),
                line[0],
                draw(st.sampled_from([0.5, 1.0, 7.0])),
                service_s=draw(st.sampled_from([0.0, 3.0])),
                kind=draw(st.sampled_from([None, "photo"])),
                due_s=draw(st.sampled_from([None, 5000.0])),
                opens_s=draw(st.sampled_from([0.0, 100.0])),
                path_enu_m=path,
                trigger_m=draw(st.sampled_from([None, 12.5])) if path else None,
                height_m=draw(st.sampled_from([None, 45.0])),
            )
        )
    start = (0.0, draw(metres), draw(heights))
    zones = (WALL,) if abs(start[1]) > 1.0 and draw(st.booleans()) else ()
    origin = draw(st.builds(Origin, st.floats(20.0, 60.0), st.floats(-170.0, 170.0), heights))
    uav = Uav(U, start, 8.0)
    return mission(*tasks, uavs=(uav,), zones=zones, origin=origin, horizon_s=9000.0)


def same_task(back: TaskFile, what: Mission, task: Task) -> None:
    (entry,) = (entry for entry in back.entries if entry.table["id"] == task.id)
    table: Any = entry.table
    home, origin = back.home, what.origin
    assert home is not None
    assert origin is not None
    start_up_m = what.uavs[0].position_enu_m[2]
    lift_m = home.alt_m - origin.alt_m
    assert lift_m == pytest.approx(start_up_m)
    for key, default in (
        ("value", 1.0),
        ("service_s", 0.0),
        ("kind", None),
        ("due_s", None),
        ("opens_s", 0.0),
        ("trigger_m", None),
    ):
        assert table.get(key, default) == getattr(task, key)
    if task.height_m is None:
        assert "height_m" not in table
    else:
        assert table["height_m"] + lift_m == pytest.approx(task.height_m)
    middle = what.uavs[0].position_enu_m
    if "lat_deg" in table:
        alt_m = table.get("alt_m", home.alt_m)
        found = [enu_from_wgs84(origin, table["lat_deg"], table["lon_deg"], alt_m)]
    elif "path" in table:
        found = [enu_from_wgs84(origin, lat, lon, home.alt_m) for lat, lon in table["path"]]
    else:  # metres from its own home, whose scale is that of its latitude
        found = [(x + middle[0], y + middle[1], up + start_up_m) for x, y, up in table["path_m"]]
    expected = task.path_enu_m or (task.position_enu_m,)
    assert len(found) == len(expected)
    np.testing.assert_allclose(
        [point[:2] for point in found], [point[:2] for point in expected], rtol=0.0, atol=0.5
    )
    if task.height_m is None:
        heights_m = [point[2] for point in found]
        np.testing.assert_allclose(heights_m, [point[2] for point in expected], atol=1e-6)


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(what=missions())
def test_exported_tasks_come_back_the_same(
    tmp_path_factory: pytest.TempPathFactory, what: Mission
) -> None:
    folder = tmp_path_factory.mktemp("plans")
    made = planned(what)
    written = write_plans(folder, what, made, ExportFirmware.PX4)

    assert len(written.files) == 1
    back = read_task_file(written.files[0])
    assert sorted(str(entry.table["id"]) for entry in back.entries) == sorted(made.routes[U])
    for task in what.tasks:
        if task.id in made.routes[U]:
            same_task(back, what, task)


def test_a_survey_is_imported_planned_exported_and_imported_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scenario, folder = tmp_path / "s.toml", tmp_path / "plans"
    assert main(["import", str(DATA / "quarry.plan"), "-o", str(scenario)], IMPORT) == 0

    arguments = [str(scenario), "--method", "greedy", "--no-bound", "--export", str(folder)]
    assert main(["plan", *arguments], PLAN) == 0

    what = load_scenario(scenario)
    back = [read_task_file(path) for path in sorted(folder.iterdir())]
    names = sorted(str(entry.table["id"]) for file in back for entry in file.entries)
    assert names == sorted(task.id for task in what.tasks)
    assert all(len(file.zones) == len(what.zones) for file in back)
    assert f"exported: {len(back)} plans into {folder}" in capsys.readouterr().err
