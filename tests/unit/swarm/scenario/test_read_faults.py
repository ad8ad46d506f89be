"""Every rule of the scenario format: one wrong place, one exact line."""

from __future__ import annotations

import pytest

from tests.support.small_scenario import PROBABILITY, VALID, faults

ID = "an id of 1 to 64 letters, digits, '_', '-' or '.', beginning with a letter or digit"
POSITION = "give [east, north] or [east, north, up], each within -1e7..1e7 [m]"
SPEED = "give a cruise speed > 0 and <= 1e6 [m/s], such as speed_m_s = 12.0"
VALUE = "give a number >= 0 and <= 1e12, such as value = 5.0"
HORIZON = "give a number > 0 and <= 1e9 [s], such as horizon_s = 600.0"
SECONDS = "give a number >= 0 and <= 1e9 [s]"
ALTITUDE = "give a height above mean sea level within -1e5..1e5 [m], such as 488.0"
SCHEMA = "give schema = 1 or schema = 2"
TOP_KEYS = "schema, name, mission, origin, terrain, uav, base, zone, area, task, tasks_from"
TASK_KEYS = (
    "id, position_m, lat_deg, lon_deg, alt_m, value, service_s, kind, appears_s, "
    "due_s, opens_s, closes_s, path_m, path, trigger_m, height_m"
)

# What is replaced in VALID, by what, and the lines it takes.
WRONG: dict[str, tuple[str, str, list[str]]] = {
    # the file as a whole
    "no schema": ("schema = 1\n", "", [f"schema: is missing; {SCHEMA}"]),
    "other schema": (
        "schema = 1",
        "schema = 3",
        [f"schema: version 3 of the format is not known; {SCHEMA}"],
    ),
    "schema is no integer": (
        "schema = 1",
        'schema = "1"',
        [f"schema: '1' is not an integer; {SCHEMA}"],
    ),
    "schema is a boolean": (
        "schema = 1",
        "schema = true",
        [f"schema: true is not an integer; {SCHEMA}"],
    ),
    "no name": (
        'name = "small"\n',
        "",
        [f'name: is missing; give {ID}, such as name = "survey-1"'],
    ),
    "name is no id": (
        '"small"',
        '"a/b"',
        [f"name: 'a/b' is not an id; give {ID}, such as name = \"survey-1\""],
    ),
    "unknown key": (
        "schema = 1",
        "colour = 3\nschema = 1",
        [f"colour: unknown key; the keys here are {TOP_KEYS}"],
    ),
    "key that is no bare key": (
        "schema = 1",
        '"a\\nb" = 3\nschema = 1',
        [f'"a\\nb": unknown key; the keys here are {TOP_KEYS}'],
    ),
    "misspelled table": (
        "[mission]",
        "[misson]",
        ["misson: unknown key; did you mean 'mission'?"],
    ),
    "key of another table": (
        "schema = 1",
        "schema = 1\nhorizon_s = 5.0",
        ["horizon_s: unknown key here; it belongs in [mission]"],
    ),
    "no such table": (
        "[origin]",
        "[orbit]\na = 1\n[origin]",
        [
            f"orbit: unknown key; the keys here are {TOP_KEYS}",
        ],
    ),
    # [mission]
    "no horizon": ("horizon_s = 60.0\n", "", [f"mission.horizon_s: is missing; {HORIZON}"]),
    "horizon is 0": ("60.0", "0", [f"mission.horizon_s: 0 is not > 0; {HORIZON}"]),
    "horizon is infinite": (
        "60.0",
        "inf",
        [f"mission.horizon_s: inf is not a finite number; {HORIZON}"],
    ),
    "horizon overflows": (
        "60.0",
        "1e999",
        [f"mission.horizon_s: inf is not a finite number; {HORIZON}"],
    ),
    "horizon is beyond all bounds": (
        "60.0",
        "1e10",
        [f"mission.horizon_s: 10000000000.0 is not <= 1e+09; {HORIZON}"],
    ),
    "horizon is a boolean": (
        "60.0",
        "true",
        [f"mission.horizon_s: true is not a number; {HORIZON}"],
    ),
    "horizon is a string": (
        "60.0",
        '"60"',
        [f"mission.horizon_s: '60' is not a number; {HORIZON}"],
    ),
    "horizon is a date": (
        "60.0",
        "2030-01-01",
        [f"mission.horizon_s: the date or time 2030-01-01 is not a number; {HORIZON}"],
    ),
    "success_default above 1": (
        "success_default = 0.5",
        "success_default = 1.5",
        [f"mission.success_default: 1.5 is not within 0..1; {PROBABILITY}"],
    ),
    "survival_default below 0": (
        "success_default = 0.5",
        "survival_default = -0.1",
        [f"mission.survival_default: -0.1 is not within 0..1; {PROBABILITY}"],
    ),
    "survival_default is no number": (
        "success_default = 0.5",
        "survival_default = nan",
        [f"mission.survival_default: nan is not a finite number; {PROBABILITY}"],
    ),
    "reattempt_failed is an integer": (
        "success_default = 0.5",
        "reattempt_failed = 1",
        ["mission.reattempt_failed: 1 is not true or false; give true or false"],
    ),
    "misspelled key counts once": (
        "horizon_s = 60.0",
        "horizn_s = 60.0",
        ["mission.horizn_s: unknown key; did you mean 'horizon_s'?"],
    ),
    # [origin]
    "origin is incomplete": (
        "alt_m = 400.0\n",
        "",
        [f"origin.alt_m: is missing; {ALTITUDE}"],
    ),
    "origin at the pole": (
        "lat_deg = 47.0\n",
        "lat_deg = 89.5\n",
        [
            "origin.lat_deg: 89.5 is not <= 89; give a latitude within -89..89 [deg]",
        ],
    ),
    "origin beyond the date line": (
        "lon_deg = 8.0\n",
        "lon_deg = 180.1\n",
        [
            "origin.lon_deg: 180.1 is not <= 180; give a longitude within -180..180 [deg]",
        ],
    ),
    "no origin for a place in degrees": (
        "[origin]\nlat_deg = 47.0\nlon_deg = 8.0\nalt_m = 400.0\n",
        "",
        [
            (
                'task[1] "t2".lat_deg: a place in degrees needs an origin; '
                "add a table [origin] with lat_deg, lon_deg and alt_m, or give position_m"
            ),
        ],
    ),
    "origin on the other side of the earth": (
        "lon_deg = 8.0\n",
        "lon_deg = -172.0\n",
        [
            (
                'task[1] "t2".lat_deg: is more than 1e+07 m from the origin; '
                "give an origin near the mission"
            ),
        ],
    ),
    # [[uav]]
    "uav is a table": (
        (
            '[[uav]]\nid = "uav1"\nposition_m = [0.0, 0.0]\nspeed_m_s = 10.0\n'
            "success = { t1 = 0.9, photo = 0.8 }\n\n[[uav]]"
        ),
        "[uav]",
        ["uav: a table is not an array; give one table [[uav]] per UAV"],
    ),
    "uav id is missing": ('id = "uav2"\n', "", [f"uav[1].id: is missing; give {ID}"]),
    "uav id is empty": ('"uav2"', '""', [f"uav[1].id: '' is not an id; give {ID}"]),
    "uav id is a number": ('"uav2"', "2", [f"uav[1].id: 2 is not a string in quotes; give {ID}"]),
    "uav id is long": (
        '"uav2"',
        f'"{"x" * 65}"',
        [
            f'uav[1] "{"x" * 47}…".id: \'{"x" * 46}… is not an id; give {ID}',
        ],
    ),
    "uav id with a line break": (
        '"uav2"',
        '"u\\n2"',
        [f"uav[1] \"u\\n2\".id: 'u\\n2' is not an id; give {ID}"],
    ),
    "uav id reserved": (
        '"uav2"',
        '"fleet"',
        [
            (
                "uav[1] \"fleet\".id: 'fleet' is the name of the whole fleet on the bus; "
                "give the UAV another id"
            )
        ],
    ),
    "uav id doubled": (
        '"uav2"',
        '"uav1"',
        [
            (
                "uav[1] \"uav1\".id: 'uav1' is already the id of uav[0]; "
                "give every one an id of its own"
            ),
        ],
    ),
    "uav without position": (
        "position_m = [5, 0, 2]\n",
        "",
        [
            (
                'uav[1] "uav2".position_m: is missing; '
                "give position_m = [east, north], or lat_deg and lon_deg"
            ),
        ],
    ),
    "position of one number": (
        "[5, 0, 2]",
        "[5]",
        [f'uav[1] "uav2".position_m: has 1 instead of 2 or 3 numbers; {POSITION}'],
    ),
    "position of four numbers": (
        "[5, 0, 2]",
        "[5, 0, 2, 1]",
        [f'uav[1] "uav2".position_m: has 4 instead of 2 or 3 numbers; {POSITION}'],
    ),
    "position of a string": (
        "[5, 0, 2]",
        '"5, 0"',
        [f"uav[1] \"uav2\".position_m: '5, 0' is not an array; {POSITION}"],
    ),
    "position with a boolean": (
        "[5, 0, 2]",
        "[5, false]",
        [f'uav[1] "uav2".position_m[1]: false is not a number; {POSITION}'],
    ),
    "position that is not finite": (
        "[5, 0, 2]",
        "[nan, -inf]",
        [
            f'uav[1] "uav2".position_m[0]: nan is not a finite number; {POSITION}',
            f'uav[1] "uav2".position_m[1]: -inf is not a finite number; {POSITION}',
        ],
    ),
    "position on another planet": (
        "[5, 0, 2]",
        "[5, 2e7]",
        [f'uav[1] "uav2".position_m[1]: 20000000.0 is not <= 1e+07; {POSITION}'],
    ),
    "position with a huge integer": (
        "[5, 0, 2]",
        f"[5, 1{'0' * 400}]",
        [f'uav[1] "uav2".position_m[1]: a huge integer is out of range; {POSITION}'],
    ),
    "speed is missing": (
        "speed_m_s = 12\n",
        "",
        [f'uav[1] "uav2".speed_m_s: is missing; {SPEED}'],
    ),
    "speed is 0": ("= 12\n", "= 0\n", [f'uav[1] "uav2".speed_m_s: 0 is not > 0; {SPEED}']),
    "speed is negative": (
        "= 12\n",
        "= -1.5\n",
        [f'uav[1] "uav2".speed_m_s: -1.5 is not > 0; {SPEED}'],
    ),
    "speed is next to nothing": (
        "= 12\n",
        "= 1e-300\n",
        [f'uav[1] "uav2".speed_m_s: 1e-300 is not >= 1e-06; {SPEED}'],
    ),
    "speed misspelled": (
        "speed_m_s = 12",
        "speed_ms = 12",
        ["uav[1] \"uav2\".speed_ms: unknown key; did you mean 'speed_m_s'?"],
    ),
    "position misspelled": (
        "position_m = [5, 0, 2]",
        "positon_m = [5, 0, 2]",
        ["uav[1] \"uav2\".positon_m: unknown key; did you mean 'position_m'?"],
    ),
    "success above 1": (
        "t1 = 0.9",
        "t1 = 1.1",
        [f'uav[0] "uav1".success.t1: 1.1 is not within 0..1; {PROBABILITY}'],
    ),
    "success is no number": (
        "t1 = 0.9",
        't1 = "0.9"',
        [f"uav[0] \"uav1\".success.t1: '0.9' is not a number; {PROBABILITY}"],
    ),
    "success is no table": (
        "{ t1 = 0.9, photo = 0.8 }",
        "0.9",
        [
            (
                'uav[0] "uav1".success: 0.9 is not a table; '
                f"give a table of task ids or kinds with {PROBABILITY.removeprefix('give ')} each"
            ),
        ],
    ),
    "survival below 0": (
        "t2 = 0.99",
        "t2 = -1",
        [f'uav[1] "uav2".survival.t2: -1 is not within 0..1; {PROBABILITY}'],
    ),
    "success of an unknown task": (
        "t1 = 0.9",
        "boat = 0.9",
        [
            (
                'uav[0] "uav1".success.boat: no task has this id or kind; '
                "give the id or kind of a task"
            ),
        ],
    ),
    "success of a misspelled kind": (
        "photo = 0.8",
        "foto = 0.8",
        [
            "uav[0] \"uav1\".success.foto: no task has this id or kind; did you mean 'photo'?",
        ],
    ),
    "survival of an unknown task": (
        "t2 = 0.99",
        '"mount everest" = 0.99',
        [
            (
                'uav[1] "uav2".survival."mount everest": no task has this id or kind; '
                "give the id or kind of a task"
            ),
        ],
    ),
    "uav kind is empty": (
        '"quad"',
        '""',
        ['uav[1] "uav2".kind: the word is empty; give a word of 1 to 64 characters'],
    ),
    "uav with a task's key": (
        'kind = "quad"',
        "value = 3.0",
        ['uav[1] "uav2".value: unknown key here; it belongs in [[task]]'],
    ),
    # [[task]]
    "task id doubled": (
        'id = "t2"',
        'id = "t1"',
        [
            'uav[1] "uav2".survival.t2: no task has this id or kind; give the id or kind of a task',
            "task[1] \"t1\".id: 't1' is already the id of task[0]; give every one an id of its own",
        ],
    ),
    "task without position": (
        "position_m = [100.0, 0.0]\n",
        "",
        [
            (
                'task[0] "t1".position_m: is missing; '
                "give position_m = [east, north], or lat_deg and lon_deg"
            ),
        ],
    ),
    "task with both positions": (
        "lat_deg = 47.001",
        "position_m = [1, 2]\nlat_deg = 47.001",
        [
            (
                'task[1] "t2".lat_deg: a second position beside position_m; '
                "keep either position_m or lat_deg, lon_deg and alt_m"
            ),
        ],
    ),
    "height beside position_m": (
        "position_m = [100.0, 0.0]",
        "position_m = [100.0, 0.0]\nalt_m = 430.0",
        [
            (
                'task[0] "t1".alt_m: goes with lat_deg and lon_deg only; '
                "give the height above the origin as a third number of position_m"
            ),
        ],
    ),
    "latitude without longitude": (
        "lon_deg = 8.001\n",
        "",
        [
            (
                'task[1] "t2".lon_deg: is missing; '
                "give lon_deg beside lat_deg, or position_m = [east, north]"
            ),
        ],
    ),
    "height without a place": (
        "lat_deg = 47.001\nlon_deg = 8.001\n",
        "",
        [
            f'task[1] "t2".{key}: is missing; '
            f"give {key} beside alt_m, or position_m = [east, north]"
            for key in ("lat_deg", "lon_deg")
        ],
    ),
    "latitude beyond the pole": (
        "47.001",
        "90.5",
        ['task[1] "t2".lat_deg: 90.5 is not <= 90; give a latitude within -90..90 [deg]'],
    ),
    "value is missing": ("value = 3\n", "", [f'task[1] "t2".value: is missing; {VALUE}']),
    "value is negative": (
        "value = 5.0",
        "value = -5.0",
        [f'task[0] "t1".value: -5.0 is not >= 0; {VALUE}'],
    ),
    "service time is negative": (
        "service_s = 10.0",
        "service_s = -1",
        [f'task[1] "t2".service_s: -1 is not >= 0; {SECONDS}'],
    ),
    "appears before the start": (
        "appears_s = 20.0",
        "appears_s = -20.0",
        [f'task[1] "t2".appears_s: -20.0 is not >= 0; {SECONDS}; 0 if known from the start'],
    ),
    "task kind is long": (
        'kind = "photo"',
        f'kind = "{"p" * 65}"',
        [
            (
                'uav[0] "uav1".success.photo: no task has this id or kind; '
                "give the id or kind of a task"
            ),
            f'task[1] "t2".kind: \'{"p" * 46}… is too long; give a word of 1 to 64 characters',
        ],
    ),
    "task with an unknown key": (
        'kind = "photo"',
        'kind = "photo"\ncolour = "red"',
        [f'task[1] "t2".colour: unknown key; the keys here are {TASK_KEYS}'],
    ),
    "task nobody can do": (
        "success_default = 0.5\n",
        "success_default = 0.0\n\n[[task]]\nid = 't0'\nposition_m = [1, 1]\nvalue = 1\n",
        [
            (
                'task[0] "t0": no UAV can do it: success is 0 for all; '
                "give one a success > 0, or leave the task out"
            ),
        ],
    ),
    "task is no table": (
        '[[task]]\nid = "t1"\nposition_m = [100.0, 0.0]\nvalue = 5.0\n\n[[task]]',
        "[task]",
        [
            (
                "task: a table is not an array; "
                "give one table [[task]] per task, or task = [] if all come later"
            ),
        ],
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_one_wrong_place_takes_its_exact_line(case: str) -> None:
    old, new, lines = WRONG[case]
    assert old in VALID

    assert faults(VALID.replace(old, new, 1)) == [f"s.toml: {line}" for line in lines]
