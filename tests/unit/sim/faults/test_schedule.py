"""Schedules and cases as text: what is written is read back, and mistakes are told in a line."""

from __future__ import annotations

import pytest

from sim.faults.case import FIRST_IN_FIELD, Case, format_case, parse_case
from sim.faults.generator import kinds_of, random_case
from sim.faults.schedule import (
    PLAIN_KINDS,
    Disturbance,
    DisturbanceKind,
    format_schedule,
    parse_schedule,
    shape_of,
)
from sim.world.network import Topology
from sim.world.settings import RestartMemory
from swarm.runtime.errors import InputError
from tests.support.builders import mission, task, uav

PROCESSES, TASKS = ("coordinator", "u0", "u1"), ("t0", "t1")


def parsed(text: str) -> tuple[Disturbance, ...]:
    return parse_schedule(text.splitlines(), "faults.txt", PROCESSES, TASKS)


@pytest.mark.parametrize("seed", [*range(50), *range(FIRST_IN_FIELD, FIRST_IN_FIELD + 10)])
def test_a_case_is_read_as_it_was_written(seed: int) -> None:
    case = random_case(seed, bug="ignore-incarnations" if seed % 2 else "")

    assert parse_case(format_case(case).splitlines(), "case") == case


def test_a_line_says_what_when_whom_how_badly_how_long_and_with_what_memory() -> None:
    assert parsed(
        "4 weather by 0.3 for 10 # rain\n\n12.5 crash u1 for 3.2 with disk\n2 cut u0 u1 for 1"
    ) == (
        Disturbance(2.0, DisturbanceKind.CUT, ("u0", "u1"), lasts_s=1.0),
        Disturbance(4.0, DisturbanceKind.WEATHER, lasts_s=10.0, amount=0.3),
        Disturbance(12.5, DisturbanceKind.CRASH, ("u1",), lasts_s=3.2, memory=RestartMemory.DISK),
    )


@pytest.mark.parametrize(
    ("line", "problem"),
    [
        ("soon blink", "'soon' is no number"),
        ("1 quake", "'quake' is none of"),
        ("1", "a time and a kind are wanted"),
        ("-1 blink", "time >= 0"),
        ("nan blink", "time >= 0"),
        ("1 lose", "lose takes 1 name"),
        ("1 lose u9", "u9 is none of"),
        ("1 lose t0", "t0 is none of"),
        ("1 refuse u0 u1 for 2", "u1 is none of"),
        ("1 mute u0 u0 for 2", "twice"),
        ("1 cut for 2", "one or more names"),
        ("1 cut u0", "must have an end"),
        ("1 cut u0 for 0", "cannot last"),
        ("1 lose u0 for 3", "cannot last"),
        ("1 blink by 0.1", "takes no amount"),
        ("1 weather for 3", "takes an amount"),
        ("1 weather by 1.5 for 3", "within 0..1"),
        ("1 crash u0 for 3", "finds a memory"),
        ("1 crash u0 with disk", "finds a memory"),
        ("1 crash u0 for", "is no number"),
        ("1 zone u0", "takes an amount"),
        ("1 drain u0 by 0.5 for 3", "cannot last"),
    ],
)
def test_a_mistake_is_told_with_its_line(line: str, problem: str) -> None:
    with pytest.raises(InputError) as fault:
        parsed(f"# faults\n{line}")

    assert str(fault.value).startswith("faults.txt: line 2: ")
    assert problem in str(fault.value)
    assert "\n" not in str(fault.value)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", "no fleet"),
        ("1 blink", "no fleet"),
        ("fleet seed=1 uavs=7 tasks=3", "1..6 UAVs"),
        ("fleet seed=1 uavs=x tasks=3", "invalid literal"),
        ("fleet seed=1 uavs=2 tasks=3 colour=red", "unknown: colour"),
        ("fleet seed=1 uavs=2 tasks=3 bug=none", "'none' is none of"),
        ("fleet seed=1 uavs=2 tasks=3\n1 lose u2", "u2 is none of"),
    ],
)
def test_a_case_that_cannot_be_is_told(text: str, problem: str) -> None:
    with pytest.raises(InputError, match=problem):
        parse_case(text.splitlines(), "case")


def test_kinds_are_all_or_named() -> None:
    assert kinds_of("all", "--faults") == tuple(DisturbanceKind)
    assert kinds_of("cut,crash", "--faults") == (DisturbanceKind.CUT, DisturbanceKind.CRASH)
    with pytest.raises(InputError, match="earthquake: no kind of fault"):
        kinds_of("cut,earthquake", "--faults")


def test_only_the_kinds_asked_for_happen() -> None:
    for seed in range(30):
        assert {each.kind for each in random_case(seed, (DisturbanceKind.CUT,)).schedule} == {
            DisturbanceKind.CUT
        }


def test_every_kind_can_be_drawn_and_written() -> None:
    field = range(FIRST_IN_FIELD, FIRST_IN_FIELD + 40)
    plain = [each for seed in range(60) for each in random_case(seed).schedule]
    schedule = [*plain, *(each for seed in field for each in random_case(seed).schedule)]

    assert {each.kind for each in plain} == set(PLAIN_KINDS)
    assert {each.kind for each in schedule} == set(DisturbanceKind)
    assert all(shape_of(each.kind).must_end <= (each.lasts_s is not None) for each in schedule)
    assert len(format_schedule(schedule).splitlines()) == len(schedule)


def test_a_smaller_fleet_is_a_part_of_the_larger_one() -> None:
    small, large = Case(5, 2, 4).flown(), Case(5, 6, 15).flown()

    assert small.uavs == large.uavs[:2]
    assert small.tasks == large.tasks[:4]


def test_a_scenario_takes_the_place_of_a_drawn_mission() -> None:
    flown = mission([uav("a")], [task("x", 1.0)])

    assert Case(1, 1, 1, topology=Topology.MESH, mission=flown).flown() is flown
