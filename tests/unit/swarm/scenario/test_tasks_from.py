"""A scenario may take its tasks from a file beside it, with the same care as its own."""

from __future__ import annotations

from pathlib import Path

import pytest

from swarm.model import Mission, Origin
from swarm.model.frames import enu_from_wgs84
from swarm.runtime.errors import InputError
from swarm.scenario import format_scenario, load_scenario, parse_scenario

DATA = Path(__file__).parents[3] / "data" / "task_files"
FLEET = """
[mission]
horizon_s = 600.0

[[uav]]
id = "u1"
position_m = [0.0, 0.0]
speed_m_s = 5.0
"""


def scenario(tmp_path: Path, file: str, more: str = "") -> Path:
    """A scenario in a folder of its own, with ``file`` beside it."""
    (tmp_path / file).write_bytes((DATA / file).read_bytes())
    path = tmp_path / "mission.toml"
    path.write_text(f'schema = 1\nname = "m"\ntasks_from = "{file}"\n{FLEET}{more}')
    return path


def faults(path: Path) -> list[str]:
    with pytest.raises(InputError) as caught:
        load_scenario(path)
    return str(caught.value).replace(f"{path.parent}/", "").splitlines()


def test_plan_brings_tasks_and_the_origin(tmp_path: Path) -> None:
    mission: Mission = load_scenario(scenario(tmp_path, "orchard.plan"))

    origin = Origin(47.0, 8.0, 400.0)
    assert mission.origin == origin
    assert [task.id for task in mission.tasks] == ["t1", "t2", "t3", "t4", "t5"]
    first = mission.tasks[0]
    assert first.position_enu_m == enu_from_wgs84(origin, 47.001, 8.001, 440.0)
    assert (first.value, first.service_s) == (1.0, 12.5)


def test_origin_of_the_scenario_stands_for_the_home_of_the_plan(tmp_path: Path) -> None:
    origin = "[origin]\nlat_deg = 47.0005\nlon_deg = 8.0\nalt_m = 100.0\n"
    mission = load_scenario(scenario(tmp_path, "orchard.plan", origin))

    assert mission.origin == Origin(47.0005, 8.0, 100.0)
    assert mission.tasks[0].position_enu_m[2] == 40.0


def test_tasks_of_the_file_follow_those_of_the_scenario(tmp_path: Path) -> None:
    own = '[[task]]\nid = "own"\nposition_m = [1.0, 2.0]\nvalue = 9.0\n'
    mission = load_scenario(scenario(tmp_path, "grid.csv", own))

    assert [task.id for task in mission.tasks] == ["own", "p1", "p2", "t3"]
    assert [task.value for task in mission.tasks] == [9.0, 5.0, 1.0, 1.0]
    assert mission.known_at_start().tasks == (*mission.tasks[:2], mission.tasks[3])
    assert mission.origin is None


def test_written_out_the_mission_needs_the_file_no_more(tmp_path: Path) -> None:
    mission = load_scenario(scenario(tmp_path, "orchard.plan"))

    assert parse_scenario(format_scenario(mission).encode(), "s.toml") == mission


def test_faults_of_tasks_are_named_at_their_place_in_the_file(tmp_path: Path) -> None:
    path = scenario(tmp_path, "grid.csv", '[[task]]\nid = "p2"\nposition_m = [1.0, 2.0]\n')
    table = "id,east_m,north_m,value,kind\np1,1,2,-5,\np2,3,4,1,\nnot an id,1e9,2,1,\n"
    (tmp_path / "grid.csv").write_text(table)

    point = "give [east, north] or [east, north, up], each within -1e7..1e7 [m]"
    assert faults(path) == [
        (
            'mission.toml: task[0] "p2".value: is missing; give a number >= 0 and <= 1e12, '
            "such as value = 5.0"
        ),
        (
            "grid.csv: line 2, value: -5.0 is not >= 0; give a number >= 0 and <= 1e12, "
            "such as value = 5.0"
        ),
        "grid.csv: line 3, id: 'p2' is already the id of task[0]; give every one an id of its own",
        f"grid.csv: line 4, position_m: 1000000000.0 is not <= 1e+07; {point}",
        (
            "grid.csv: line 4, id: 'not an id' is not an id; give an id of 1 to 64 letters, "
            "digits, '_', '-' or '.', beginning with a letter or digit"
        ),
    ]


def test_task_that_no_uav_can_do_is_named_in_the_file(tmp_path: Path) -> None:
    path = scenario(tmp_path, "grid.csv", "success = { photo = 0.0 }\n")

    assert faults(path) == [
        (
            "grid.csv: line 2: no UAV can do it: success is 0 for all; "
            "give one a success > 0, or leave the task out"
        )
    ]


def test_kinds_of_the_file_may_be_referred_to(tmp_path: Path) -> None:
    mission = load_scenario(scenario(tmp_path, "grid.csv", "success = { photo = 0.5, t3 = 0.4 }\n"))

    assert [mission.success(mission.uavs[0], task) for task in mission.tasks] == [0.5, 1.0, 0.4]


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        (
            '"grid.csv"',
            '"other.csv"',
            ["other.csv: cannot be read: No such file or directory; give a readable file of tasks"],
        ),
        (
            '"grid.csv"',
            "3",
            [
                (
                    "mission.toml: tasks_from: 3 is not a string in quotes; "
                    'give a file of tasks, such as tasks_from = "survey.plan"'
                )
            ],
        ),
        (
            '"grid.csv"',
            '""',
            [
                (
                    "mission.toml: tasks_from: the word is empty; "
                    'give a file of tasks, such as tasks_from = "survey.plan"'
                )
            ],
        ),
        (
            "tasks_from",
            "task_from",
            ["mission.toml: task_from: unknown key; did you mean 'tasks_from'?"],
        ),
    ],
)
def test_wrong_name_takes_one_line(old: str, new: str, expected: list[str], tmp_path: Path) -> None:
    path = scenario(tmp_path, "grid.csv", '[[task]]\nid = "a"\nposition_m = [1, 2]\nvalue = 1\n')
    path.write_text(path.read_text().replace(old, new))

    assert faults(path) == expected


def test_wrong_origin_is_blamed_before_the_file(tmp_path: Path) -> None:
    path = scenario(
        tmp_path, "trees.geojson", "[origin]\nlat_deg = 99.0\nlon_deg = 8.0\nalt_m = 4.0\n"
    )

    assert faults(path) == [
        "mission.toml: origin.lat_deg: 99.0 is not <= 89; give a latitude within -89..89 [deg]"
    ]


def test_geojson_without_an_origin_takes_one_line(tmp_path: Path) -> None:
    assert faults(scenario(tmp_path, "trees.geojson")) == [
        (
            "trees.geojson: names no home, and places in degrees need one; "
            "name it: --home LAT,LON,ALT, or [origin] in the scenario"
        )
    ]


def test_plan_given_as_a_scenario_says_how_to_make_one() -> None:
    path = DATA / "orchard.plan"

    with pytest.raises(InputError) as caught:
        load_scenario(path)

    remedy = f"make a scenario of it: swarm import {path} --uavs 3 -o orchard.toml"
    assert str(caught.value) == f"{path}: holds tasks and no fleet; {remedy}"
