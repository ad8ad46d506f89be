"""`swarm new` writes a scenario that loads as it is and leaves no field unexplained."""

from __future__ import annotations

import re
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest
from pydantic import BaseModel

from swarm.cli import main
from swarm.model import Origin
from swarm.model.frames import DEFAULT_ORIGIN
from swarm.scenario import blank, format_scenario, load_scenario, parse_scenario
from swarm.scenario.blank import Blank, blank_scenario
from swarm.scenario.shapes import (
    AreaTable,
    BaseTable,
    MissionTable,
    OriginTable,
    Scenario,
    TaskTable,
    TerrainTable,
    UavTable,
    ZoneTable,
)

COMMANDS = {"new": EntryPoint("new", "swarm.scenario.cli:new", "peckorder.commands")}
TABLES: dict[str, type[BaseModel]] = {
    "": Scenario,
    "mission": MissionTable,
    "origin": OriginTable,
    "terrain": TerrainTable,
    "uav": UavTable,
    "base": BaseTable,
    "zone": ZoneTable,
    "area": AreaTable,
    "task": TaskTable,
}


def run(*arguments: object) -> int:
    return main(["new", *map(str, arguments)], COMMANDS)


def test_a_new_scenario_loads_without_a_change(tmp_path: Path) -> None:
    path = tmp_path / "north-field.toml"

    assert run(path, "--uavs", 5, "--tasks", 20, "--origin", "46.8,9.7,1100") == 0

    mission = load_scenario(path)
    assert (mission.name, len(mission.uavs), len(mission.tasks)) == ("north-field", 5, 20)
    assert mission.origin == Origin(46.8, 9.7, 1100.0)
    assert len({task.position_enu_m for task in mission.tasks}) == 20
    assert parse_scenario(format_scenario(mission).encode(), "again.toml") == mission
    assert mission.constraints == ()  # so that every command takes it


@pytest.mark.parametrize(("uavs", "tasks"), [(1, 0), (1, 1), (3, 6), (40, 200)])
def test_fleets_of_any_size_stand_apart_and_reach_their_tasks_in_time(
    uavs: int, tasks: int
) -> None:
    text = blank_scenario(Blank("field", uavs, tasks, DEFAULT_ORIGIN))

    mission = parse_scenario(text.encode(), "field.toml")
    assert len({uav.position_enu_m for uav in mission.uavs}) == uavs
    assert len(mission.tasks) == tasks
    assert mission.horizon_s >= 60.0
    assert max(map(len, text.splitlines())) <= 100


@pytest.mark.parametrize("tasks", [0, 2])
def test_every_field_of_the_format_is_there_with_its_meaning(tasks: int) -> None:
    text = blank_scenario(Blank("field", 2, tasks, DEFAULT_ORIGIN))
    heads = re.finditer(r"^(?:# )?\[+(\w+)\]+$", text, re.MULTILINE)  # prose names tables, too
    first = {head[1]: head.start() for head in reversed(list(heads))}
    at = {name: first[name] for name in list(TABLES)[1:]}
    begins = [0, *at.values(), len(text)]
    for (name, table), begin, end in zip(TABLES.items(), begins, begins[1:], strict=False):
        keys = {field.alias or key for key, field in table.model_fields.items()}
        shown = set(re.findall(r"^(?:# )?(\w+) = ", text[begin:end], re.MULTILINE))
        assert keys - set(TABLES) <= shown, name
        assert set(blank._ABOUT[name]) == keys


def test_fields_in_comments_are_right_when_they_are_taken_in() -> None:
    text = blank_scenario(Blank("field", 1, 1, DEFAULT_ORIGIN))
    text = text[: text.index("# [[base]]")] + text[text.index("[[task]]") :]
    for key in ("success", "survival", "kind", "service_s", "appears_s"):
        text = re.sub(rf"^# ({key} = )", r"\1", text, flags=re.MULTILINE)
    (placed, count) = re.subn(r"^# ((lat|lon|alt)_\w+ = )", r"\1", text, flags=re.MULTILINE)
    placed = re.sub(r"^position_m = .*\n", "", placed, flags=re.MULTILINE)

    for changed in (text, placed):
        mission = parse_scenario(changed.encode(), "field.toml")
        assert (mission.uavs[0].kind, mission.tasks[0].kind) == ("quad", "inspect")
        assert mission.tasks[0].appears_s == 60.0
    assert count == 6


def test_bases_zones_and_windows_in_comments_are_right_when_they_are_taken_in() -> None:
    text = blank_scenario(Blank("field", 1, 1, DEFAULT_ORIGIN))
    commented = re.compile(r"^# (\w+ = |\[\[\w+\]\]$)", re.MULTILINE)
    text = re.sub(
        r"^# (lat_deg|lon_deg|alt_m|polygon|path|tasks_from|camera|turn_\w+|landing_\w+)"
        r" = .*\n|^# \w+lap_frac = .*\n",
        "",
        text,
        flags=re.MULTILINE,
    )
    text = text.replace("position_m = [60.0, 0.0]\n", "")  # for the line that takes its place
    text = re.sub(r"^# \[terrain\]\n(# .*\n)+", "", text, flags=re.MULTILINE)  # it takes a file

    mission = parse_scenario(commented.sub(r"\1", text).encode(), "field.toml")
    (uav,), (base,), (zone,), (area,) = mission.uavs, mission.bases, mission.zones, mission.areas
    task = mission.tasks[0]
    assert (uav.endurance_s, uav.acceleration_m_s2, uav.airspeed_m_s) == (1200.0, 2.5, 12.0)
    assert (base.slots, base.swap_s) == (2, 120.0)
    assert (zone.top_m, len(zone.holes_enu_m), zone.inclusive) == (120.0, 1, False)
    assert (area.trigger_m, area.kind, area.due_s) == (20.0, "photograph", 300.0)
    assert [line.id for line in mission.tasks[1:]] == list(area.line_ids) != []
    assert (task.due_s, task.opens_s, task.closes_s, len(task.path_enu_m)) == (
        300.0,
        60.0,
        240.0,
        2,
    )
    assert (mission.band_m, mission.wind_enu_m_s) == ((30.0, 110.0), (3.0, -1.0))


def test_what_is_there_is_never_overwritten(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "field.toml"
    path.write_text("mine")

    assert run(path) == 2
    assert path.read_text() == "mine"
    assert "is there already" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["field.json"], "is no name of a scenario file; end it in .toml"),
        (["f.toml", "--origin", "north"], "--origin: 'north' is no place; give LAT,LON,ALT"),
        (["f.toml", "--name", "a/b"], "--name: 'a/b' is not an id"),
        (["no/such/folder/f.toml"], "cannot be written: No such file or directory"),
    ],
)
def test_wrong_wishes_are_refused_in_one_line(
    arguments: list[str],
    line: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)

    assert run(*arguments) == 2
    assert line in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
