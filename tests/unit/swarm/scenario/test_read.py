"""Scenario files are read whole or refused with every fault that they have."""

from __future__ import annotations

from pathlib import Path

import pytest

from swarm.model import Mission, Origin
from swarm.model.frames import enu_from_wgs84
from swarm.runtime.errors import InputError
from swarm.scenario import files, load_scenario, parse_scenario
from tests.support.small_scenario import PROBABILITY, VALID, faults


def test_valid_file_becomes_its_mission() -> None:
    mission = parse_scenario(VALID.encode(), "s.toml")
    origin = Origin(lat_deg=47.0, lon_deg=8.0, alt_m=400.0)
    uav1, uav2 = mission.uavs
    t1, t2 = mission.tasks

    assert (mission.name, mission.horizon_s, mission.origin) == ("small", 60.0, origin)
    assert (mission.success_default, mission.survival_default) == (0.5, 1.0)
    assert not mission.reattempt_failed
    assert uav1.position_enu_m == (0.0, 0.0, 0.0)
    assert uav2.position_enu_m == (5.0, 0.0, 2.0)
    assert isinstance(uav2.speed_m_s, float)
    assert (uav2.speed_m_s, uav2.kind) == (12.0, "quad")
    assert t2.position_enu_m == enu_from_wgs84(origin, 47.001, 8.001, 430.0)
    assert (t2.value, t2.service_s, t2.kind, t2.appears_s) == (3.0, 10.0, "photo", 20.0)
    assert (t1.service_s, t1.kind, t1.appears_s) == (0.0, None, 0.0)
    assert [mission.success(uav1, task) for task in mission.tasks] == [0.9, 0.8]
    assert [mission.success(uav2, task) for task in mission.tasks] == [0.5, 0.5]
    assert [mission.survival(uav2, task) for task in mission.tasks] == [1.0, 0.99]


def test_place_in_degrees_without_height_lies_at_the_height_of_the_origin() -> None:
    mission = parse_scenario(VALID.replace("alt_m = 430.0\n", "").encode(), "s.toml")

    assert mission.tasks[1].position_enu_m[2] == 0.0


def test_ten_faults_take_ten_lines_in_the_order_of_the_file() -> None:
    text = """\
schema = 3
name = "ten faults"

[mission]
horizon_s = -5.0
reattempt_faild = true

[[uav]]
id = "uav1"
position_m = [0.0]
speed_m_s = 0
success = { t9 = 0.5 }

[[uav]]
id = "uav1"
position_m = [0.0, 0.0]
speed_m_s = 5.0

[[task]]
id = "t1"
lat_deg = 47.0
lon_deg = 8.0
value = nan
"""
    assert [line.split(": ")[1] for line in faults(text)] == [
        "schema",
        "name",
        "mission.horizon_s",
        "mission.reattempt_faild",
        'uav[0] "uav1".position_m',
        'uav[0] "uav1".speed_m_s',
        'uav[0] "uav1".success.t9',
        'uav[1] "uav1".id',
        'task[0] "t1".lat_deg',
        'task[0] "t1".value',
    ]


def test_empty_fleet_is_a_fault() -> None:
    text = "schema = 1\nname = 'none'\nuav = []\ntask = []\n[mission]\nhorizon_s = 1.0\n"

    assert faults(text) == ["s.toml: uav: the fleet is empty; give one table [[uav]] per UAV"]


def test_mission_without_tasks_must_say_so() -> None:
    head = "schema = 1\nname = 'idle'\n"
    rest = "[mission]\nhorizon_s = 1.0\n[[uav]]\nid = 'u'\nposition_m = [0, 0]\nspeed_m_s = 1\n"

    assert faults(head + rest) == [
        "s.toml: task: is missing; give one table [[task]] per task, or task = [] if all come later"
    ]
    assert parse_scenario(f"{head}task = []\n{rest}".encode(), "s.toml").tasks == ()


def test_mission_of_pop_ups_only_is_fine() -> None:
    text = VALID.replace("value = 5.0", "value = 5.0\nappears_s = 1.0")

    assert parse_scenario(text.encode(), "s.toml").known_at_start().tasks == ()


def test_misspelled_tasks_do_not_make_every_reference_wrong() -> None:
    text = VALID.replace("[[task]]", "[[tasks]]")

    assert faults(text) == ["s.toml: tasks: unknown key; did you mean 'task'?"]


def test_wrong_probability_does_not_make_a_task_impossible_as_well() -> None:
    text = VALID.replace("success_default = 0.5", "success_default = 0").replace("0.9,", "-1,")

    assert faults(text) == [
        f's.toml: uav[0] "uav1".success.t1: -1 is not within 0..1; {PROBABILITY}'
    ]


@pytest.mark.parametrize(
    ("data", "line"),
    [
        (
            b"name = 'caf\xe9'\n",
            "line 1, column 12: byte 0xe9 is not UTF-8; save the file as UTF-8",
        ),
        (
            b"schema = 1\nna\xff\xfe",
            "line 2, column 3: byte 0xff is not UTF-8; save the file as UTF-8",
        ),
        (
            b"schema = 1\nname = small\n",
            "line 2, column 8: is not TOML: invalid value; correct it as TOML",
        ),
        (
            b"schema = 1\nname = ",
            "line 2, column 8: is not TOML: invalid value; correct it as TOML",
        ),
        (
            b"a = 1\na = 2\n",
            "line 2, column 6: is not TOML: cannot overwrite a value; correct it as TOML",
        ),
        (b"\x00", "line 1, column 1: is not TOML: invalid statement; correct it as TOML"),
        (b"a = " + b"[" * 5000, "is nested too deeply; give a scenario file in TOML"),
        (
            b"a = " + b"1" * 5000,
            (
                "is not TOML: Exceeds the limit (4300 digits) for integer string conversion: "
                "value has 5000 digits; correct it as TOML"
            ),
        ),
    ],
)
def test_file_that_is_no_toml_takes_one_line(data: bytes, line: str) -> None:
    assert faults(data) == [f"s.toml: {line}"]


def test_byte_order_mark_is_passed_over() -> None:
    assert faults(b"\xef\xbb\xbf" + VALID.encode()) == []


def test_dos_line_ends_are_fine() -> None:
    assert faults(VALID.replace("\n", "\r\n")) == []


def test_huge_file_is_refused_unread(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(files, "LARGEST_FILE_BYTES", 2**20)
    path = tmp_path / "huge.toml"
    path.write_bytes(b"#" * (2**20 + 1))

    with pytest.raises(InputError, match="is larger than 1 MiB; give a smaller scenario file"):
        load_scenario(path)


def test_file_is_loaded_under_its_name(tmp_path: Path) -> None:
    path = tmp_path / "small.toml"
    path.write_text(VALID)
    mission: Mission = load_scenario(path)

    assert mission == parse_scenario(VALID.encode(), "elsewhere")


def test_file_that_cannot_be_read_takes_one_line(tmp_path: Path) -> None:
    for path, reason in (
        (tmp_path / "missing.toml", "No such file or directory"),
        (tmp_path, "Is a directory"),
        (Path("\0"), "embedded null byte"),
    ):
        with pytest.raises(InputError) as caught:
            load_scenario(path)
        shown = "'\\x00'" if path == Path("\0") else str(path)
        expected = f"{shown}: cannot be read: {reason}; give a readable scenario file"
        assert str(caught.value) == expected


def test_many_unknown_references_are_named_in_time() -> None:
    entries = ", ".join(f"x{i} = 0.5" for i in range(20_000))
    tasks = "".join(f"[[task]]\nid = 'y{i}'\nposition_m = [0, 0]\nvalue = 1\n" for i in range(1500))

    assert len(faults(VALID.replace("photo = 0.8", entries) + tasks)) == 20_000
