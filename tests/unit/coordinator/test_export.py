"""Exported plans are what QGroundControl's loader asks for, and come back as the same places."""

from __future__ import annotations

import json
from dataclasses import replace
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coordinator.export import ExportFirmware, sortie_plan, write_plans
from coordinator.planner.plan import make_plan
from coordinator.sorties import Leg, Sortie, SortieItems
from swarm.cli import main
from swarm.model import Mission, Origin, Plan, Task, TaskId, Uav, UavId, Zone
from swarm.model.frames import enu_from_wgs84
from swarm.model.layers import FlightLayers
from swarm.runtime.clock import SystemClock
from swarm.runtime.errors import InputError
from swarm.scenario.task_files import read_task_file
from swarm.scenario.task_files.mission_items import BELOW_M

COMMANDS = {"plan": EntryPoint("plan", "coordinator.cli:plan", "peckorder.commands")}
ORIGIN = Origin(47.0, 8.0, 400.0)
UAV = Uav(UavId("u1"), (10.0, 0.0, 2.0), 7.5)
A, B = TaskId("a"), TaskId("b")
TASKS = (
    Task(A, (100.0, 0.0, 5.0), 1.0, service_s=12.5),
    Task(B, (0.0, 200.0, 0.0), 1.0),
)

SHARED = [("type", str), ("frame", int), ("command", int), ("autoContinue", bool)]
"""What QGroundControl asks of every simple item."""


def exported(
    *legs: Leg, zones: tuple[Zone, ...] = (), firmware: ExportFirmware = ExportFirmware.PX4
) -> Any:
    start = UAV.position_enu_m
    sortie = Sortie(start, legs or [Leg(task) for task in TASKS], start)
    items = SortieItems(sortie, UAV, 13.0, ORIGIN)
    return json.loads(json.dumps(sortie_plan(items, zones, firmware)))


def mission(**changes: object) -> Mission:
    base = Mission("m", 600.0, (UAV, replace(UAV, id=UavId("u2"))), TASKS, origin=ORIGIN)
    return replace(base, **changes)  # type: ignore[arg-type]  # names come from the tests


def planned(what: Mission) -> Plan:
    return make_plan(what, "greedy", clock=SystemClock(), seed=0, bound_s=None)


def test_plan_has_everything_qgroundcontrol_insists_on() -> None:
    found = exported()

    assert (found["fileType"], found["version"]) == ("Plan", 1)
    assert isinstance(found["groundStation"], str)
    assert found["geoFence"] == {"circles": [], "polygons": [], "version": 2}
    assert found["rallyPoints"] == {"points": [], "version": 2}
    mission = found["mission"]
    assert (mission["version"], mission["firmwareType"], mission["vehicleType"]) == (2, 12, 2)
    assert mission["cruiseSpeed"] == mission["hoverSpeed"] == 7.5
    assert mission["plannedHomePosition"][2] == 402.0
    for item in mission["items"]:
        assert all(type(item[key]) is kind for key, kind in SHARED)
        assert len(item["params"]) == 7
        assert item["type"] == "SimpleItem"
        if item["frame"] == 3:
            assert {"AltitudeMode", "Altitude", "AMSLAltAboveTerrain"} <= item.keys()
            assert item["Altitude"] == item["params"][6]
    assert [item["doJumpId"] for item in mission["items"]] == [1, 2, 3, 4, 5]


def test_plan_takes_off_visits_the_tasks_and_returns_in_the_layer_of_its_uav() -> None:
    takeoff, speed, first, second, back = exported()["mission"]["items"]

    assert (takeoff["command"], takeoff["params"][6]) == (22, 13.0)
    assert (speed["command"], speed["params"][:3]) == (178, [1, 7.5, -1])
    assert (first["command"], first["params"][0]) == (16, 12.5)
    # Heights are above the UAV's start, which lies 2 m above the origin.
    assert first["params"][6] == 5.0 - 2.0 + 13.0
    assert (second["command"], second["params"][0], second["params"][6]) == (16, 0.0, 11.0)
    assert (back["command"], back["frame"], back["params"]) == (20, 2, [0] * 7)


def test_ardupilot_is_told_from_px4() -> None:
    found = exported(firmware=ExportFirmware.ARDUPILOT)

    assert found["mission"]["firmwareType"] == 3


def test_tasks_of_a_foreign_plan_lie_below_it_by_the_lowest_layer() -> None:
    assert FlightLayers().lowest_m == BELOW_M


def test_every_uav_with_tasks_gets_a_file_and_an_older_one_of_an_idle_uav_goes(
    tmp_path: Path,
) -> None:
    folder = tmp_path / "new" / "plans"
    both = mission()
    split = replace(planned(both), routes={UavId("u1"): (A,), UavId("u2"): (B,)})
    alone = replace(split, routes={UavId("u1"): (A, B), UavId("u2"): ()})

    assert write_plans(folder, both, split, ExportFirmware.PX4).files == [
        folder / "m.u1.plan",
        folder / "m.u2.plan",
    ]
    (folder / "of somebody else.plan").touch()
    (folder / "m.u2.sortie2.plan").touch()
    written = write_plans(folder, both, alone, ExportFirmware.PX4)
    assert written.files == [folder / "m.u1.plan"]
    assert sorted(path.name for path in folder.iterdir()) == ["m.u1.plan", "of somebody else.plan"]


def test_mission_without_an_origin_cannot_be_exported(tmp_path: Path) -> None:
    lost = mission(origin=None)

    with pytest.raises(InputError, match="origin: is missing, and --export needs it"):
        write_plans(tmp_path, lost, planned(lost), ExportFirmware.PX4)


@st.composite
def scenarios(draw: st.DrawFn) -> Mission:
    """Fleets and tasks within some kilometres, anywhere on Earth but at the poles."""
    metres = st.floats(-5000.0, 5000.0)
    points = st.tuples(metres, metres, st.floats(-200.0, 200.0))
    uavs = draw(st.lists(points, min_size=1, max_size=4))
    # 0, 0 stands for "no place" in a mission item.
    latitudes = st.floats(-80.0, 80.0).filter(lambda lat_deg: abs(lat_deg) > 0.1)
    return Mission(
        name="any",
        horizon_s=5000.0,
        uavs=tuple(Uav(UavId(f"u{n}"), point, 10.0) for n, point in enumerate(uavs)),
        tasks=tuple(
            Task(TaskId(f"task-{n}"), point, 1.0, service_s=draw(st.floats(0.0, 900.0)))
            for n, point in enumerate(draw(st.lists(points, min_size=1, max_size=8)))
        ),
        origin=draw(
            st.builds(Origin, latitudes, st.floats(-180.0, 180.0), st.floats(-400.0, 5000.0))
        ),
    )


@settings(max_examples=60, deadline=None)
@given(what=scenarios())
def test_exported_lists_come_back_as_the_same_places(
    tmp_path_factory: pytest.TempPathFactory, what: Mission
) -> None:
    folder = tmp_path_factory.mktemp("plans")
    made = planned(what)
    tasks = {task.id: task for task in what.tasks}
    origin = what.origin
    assert origin is not None

    written = write_plans(folder, what, made, ExportFirmware.ARDUPILOT)

    assert len(written.files) == sum(1 for route in made.routes.values() if route)
    for uav, route in made.routes.items():
        if not route:
            continue
        back = read_task_file(folder / f"any.{uav}.plan")
        assert len(back.entries) == len(route)
        assert back.speed_m_s == 10.0
        for entry, task in zip(back.entries, route, strict=True):
            table: Any = entry.table
            place = enu_from_wgs84(origin, table["lat_deg"], table["lon_deg"], table["alt_m"])
            np.testing.assert_allclose(place, tasks[task].position_enu_m, rtol=0.0, atol=0.01)
            assert table.get("service_s", 0.0) == tasks[task].service_s
            assert table["id"] == task


def plan(*arguments: str) -> int:
    return main(["plan", *arguments], COMMANDS)


def test_command_exports_beside_the_json(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "plans"

    assert plan("table-1", "--json", "--export", str(folder), "--firmware", "px4") == 0

    captured = capsys.readouterr()
    routes = json.loads(captured.out)["routes"]
    assert captured.err == f"exported: 3 plans into {folder}\n"
    for uav, route in routes.items():
        items = json.loads((folder / f"table-1.{uav}.plan").read_text())["mission"]["items"]
        assert [item["command"] for item in items] == [22, 178, *[16] * len(route), 20]


def test_command_names_uavs_without_tasks(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scenario = tmp_path / "one.toml"
    scenario.write_text(
        """
schema = 1
name = "one"
mission = { horizon_s = 60.0 }
origin = { lat_deg = 47.0, lon_deg = 8.0, alt_m = 400.0 }
uav = [
    { id = "near", position_m = [0.0, 0.0], speed_m_s = 5.0 },
    { id = "far", position_m = [90.0, 0.0], speed_m_s = 5.0 },
]
task = [{ id = "t1", position_m = [1.0, 0.0], value = 1.0 }]
"""
    )

    assert plan(str(scenario), "--export", str(tmp_path)) == 0

    expected = f"exported: 1 plan into {tmp_path}; none for far, without tasks\n"
    assert capsys.readouterr().err == expected


def test_command_needs_an_origin_before_it_plans(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scenario = tmp_path / "lost.toml"
    scenario.write_text(
        """
schema = 1
name = "lost"
mission = { horizon_s = 60.0 }
uav = [{ id = "u", position_m = [0.0, 0.0], speed_m_s = 5.0 }]
task = [{ id = "t1", position_m = [1.0, 0.0], value = 1.0 }]
"""
    )

    assert plan(str(scenario), "--export", str(tmp_path / "plans")) == 2

    captured = capsys.readouterr()
    assert captured.out == ""
    remedy = "add a table [origin] with lat_deg, lon_deg and alt_m"
    assert captured.err == f"{scenario}: origin: is missing, and --export needs it; {remedy}\n"
    assert not (tmp_path / "plans").exists()


def test_folder_that_cannot_be_is_one_line_and_status_2(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    taken = tmp_path / "taken"
    taken.touch()

    assert plan("table-1", "--export", str(taken)) == 2

    captured = capsys.readouterr()
    assert captured.out == ""
    assert (
        captured.err
        == f"--export: cannot write into {taken}: File exists; name a folder that can be\n"
    )


def test_unknown_firmware_is_one_line_and_status_2(capsys: pytest.CaptureFixture[str]) -> None:
    assert plan("table-1", "--firmware", "betaflight") == 2

    expected = "--firmware: betaflight: no such firmware; choose one of ardupilot, px4\n"
    assert capsys.readouterr().err == expected
