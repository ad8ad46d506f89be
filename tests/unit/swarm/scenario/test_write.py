"""Any mission survives being written and read; no bytes break the reader."""

from __future__ import annotations

import contextlib
import string

from hypothesis import example, given, settings
from hypothesis import strategies as st

from swarm.model import Mission, Origin, Task, TaskId, Uav, UavId
from swarm.runtime.errors import InputError
from swarm.scenario import format_scenario, parse_scenario
from tests.support.small_scenario import VALID, faults

IDS = st.from_regex(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,15}", fullmatch=True)
KINDS = st.none() | st.text(st.characters(exclude_categories=["Cs"]), min_size=1, max_size=20)
PROBABILITIES = st.floats(0.0, 1.0)
POINTS = st.tuples(*[st.floats(-1e7, 1e7)] * 3)
SECONDS = st.floats(0.0, 1e9)


@st.composite
def missions(draw: st.DrawFn) -> Mission:
    tasks = tuple(
        Task(
            id=TaskId(name),
            position_enu_m=draw(POINTS),
            value=draw(st.floats(0.0, 1e12)),
            service_s=draw(SECONDS),
            kind=draw(KINDS),
            appears_s=draw(SECONDS),
        )
        for name in draw(st.lists(IDS, unique=True, max_size=4))
    )
    known = [task.id for task in tasks] + [task.kind for task in tasks if task.kind]
    tables = st.dictionaries(st.sampled_from(known), PROBABILITIES) if known else st.just({})
    uavs = tuple(
        Uav(
            id=UavId(name),
            position_enu_m=draw(POINTS),
            speed_m_s=draw(st.floats(1e-6, 1e6)),
            success=draw(tables),
            survival=draw(tables),
            kind=draw(KINDS),
        )
        for name in draw(st.lists(IDS, unique=True, min_size=1, max_size=3))
    )
    # One able UAV for whatever the tables forbid: impossible tasks are refused.
    able = Uav(UavId("__able__".strip("_")), (0.0, 0.0, 0.0), 1.0, {task.id: 1.0 for task in tasks})
    return Mission(
        name=draw(IDS),
        horizon_s=draw(st.floats(1e-6, 1e9)),
        uavs=(*(uav for uav in uavs if uav.id != able.id), able),
        tasks=tasks,
        success_default=draw(PROBABILITIES),
        survival_default=draw(PROBABILITIES),
        reattempt_failed=draw(st.booleans()),
        origin=draw(
            st.none()
            | st.builds(
                Origin, st.floats(-89.0, 89.0), st.floats(-180.0, 180.0), st.floats(-1e5, 1e5)
            )
        ),
    )


@given(missions())
def test_written_mission_reads_back_the_same(mission: Mission) -> None:
    assert parse_scenario(format_scenario(mission).encode(), "s.toml") == mission


def test_mission_is_written_with_defaults_left_out() -> None:
    mission = Mission(
        name="tiny",
        horizon_s=60.0,
        uavs=(Uav(UavId("uav1"), (0.0, 0.0, 0.0), 10.0, {"t1": 0.9, "a b": 0.5}),),
        tasks=(Task(TaskId("t1"), (1.5, 2.0, 3.0), 5.0, kind="a b"),),
    )

    assert (
        format_scenario(mission)
        == """\
schema = 1
name = "tiny"

[mission]
horizon_s = 60.0
success_default = 1.0
survival_default = 1.0
reattempt_failed = false

[[uav]]
id = "uav1"
position_m = [0.0, 0.0]
speed_m_s = 10.0
success = { t1 = 0.9, "a b" = 0.5 }

[[task]]
id = "t1"
position_m = [1.5, 2.0, 3.0]
value = 5.0
kind = "a b"
"""
    )


@settings(deadline=None)
@given(st.binary(max_size=400))
@example(b"a=" + b"{a=" * 3000)
@example(b"a" + b".a" * 3000 + b"=1")
@example(b"uav=" + b"[" * 200 + b"]" * 200)
def test_any_bytes_give_a_mission_or_faults(data: bytes) -> None:
    with contextlib.suppress(InputError):
        parse_scenario(data, "s.toml")


# Valid TOML that knows the words of the format but not their meaning.
_WORDS = st.sampled_from(
    [
        "schema",
        "name",
        "mission",
        "origin",
        "uav",
        "task",
        "id",
        "position_m",
        "lat_deg",
        "lon_deg",
        "alt_m",
        "speed_m_s",
        "success",
        "survival",
        "kind",
        "value",
        "service_s",
        "appears_s",
        "horizon_s",
        "success_default",
        "reattempt_failed",
        "t1",
    ]
)
VALUES = st.recursive(
    st.booleans()
    | st.integers()
    | st.just(10**400)
    | st.floats()
    | st.text(st.characters(exclude_categories=["Cs"]), max_size=5)
    | st.datetimes()
    | st.sampled_from(["t1", "uav1", "photo", 1, 0, 0.5]),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(_WORDS, inner, max_size=6),
    max_leaves=30,
)


def toml_of(value: object) -> str:
    match value:
        case bool():
            return str(value).lower()
        case str():
            return '"' + "".join(f"\\U{ord(c):08x}" for c in value) + '"'
        case list():
            return "[" + ", ".join(map(toml_of, value)) + "]"
        case dict():
            return "{" + ", ".join(f"{key} = {toml_of(item)}" for key, item in value.items()) + "}"
        case float():
            return repr(value)
        case int():
            return str(value)
        case _:
            return str(value)


@given(st.dictionaries(_WORDS, VALUES, max_size=6))
def test_any_toml_gives_a_mission_or_faults_of_one_line_each(document: dict[str, object]) -> None:
    text = "".join(f"{key} = {toml_of(value)}\n" for key, value in document.items())
    lines = faults(text)

    assert all(line.startswith("s.toml: ") and "; " in line for line in lines)


@given(st.data())
def test_any_damage_to_a_valid_file_gives_a_mission_or_faults(data: st.DataObject) -> None:
    lines = VALID.splitlines(keepends=True)
    line = data.draw(st.integers(0, len(lines) - 1))
    value = data.draw(VALUES)
    match data.draw(st.sampled_from(["drop", "value", "key", "cut", "swap"])):
        case "drop":
            del lines[line]
        case "value":
            lines[line] = f"{lines[line].partition('=')[0].strip()} = {toml_of(value)}\n"
        case "key":
            key = data.draw(st.text(string.ascii_letters + "_", min_size=1, max_size=9))
            lines.insert(line, f"{key} = {toml_of(value)}\n")
        case "cut":
            lines[line] = lines[line][: data.draw(st.integers(0, len(lines[line])))]
        case "swap":
            other = data.draw(st.integers(0, len(lines) - 1))
            lines[line], lines[other] = lines[other], lines[line]

    assert all(fault.startswith("s.toml: ") for fault in faults("".join(lines)))
