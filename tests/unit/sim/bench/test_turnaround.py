"""What agents tell of their turnarounds is gathered and summed up."""

from __future__ import annotations

import json

import pytest
from rich.console import Console

from agent.links.mavlink_vehicle import TURNAROUNDS
from sim.bench.machine import this_machine
from sim.bench.turnaround import (
    TurnaroundFlight,
    Turnarounds,
    told_turnarounds,
)

FLIGHTS = Turnarounds(
    this_machine(),
    7,
    "valley",
    2,
    4.0,
    20.0,
    (
        TurnaroundFlight((1.0, 2.0, 9.0), (30.0,), 2, 101.0, 100.0, 3, 3, 0.5),
        TurnaroundFlight((4.0,), (), 1, 50.0, None, 3, 2, 0.5),
    ),
)


def test_turnarounds_are_read_from_lines_of_a_log() -> None:
    said = {"event": TURNAROUNDS, "target_ms": [1.5], "in_force_ms": [], "idled": 0}

    assert list(told_turnarounds(json.dumps(said))) == [said]


@pytest.mark.parametrize(
    "line",
    ["", "no JSON", f"no JSON about {TURNAROUNDS}", f'["{TURNAROUNDS}"]', '{"event": "airborne"}'],
)
def test_other_lines_tell_of_none(line: str) -> None:
    assert list(told_turnarounds(line)) == []


def test_times_of_all_flights_are_summed_up_and_each_flight_is_set_beside_its_plan() -> None:
    told = FLIGHTS.as_json()

    assert told["sent_ms"] == {"count": 4, "p50": 2.0, "p90": 9.0, "p99": 9.0, "max": 9.0}
    assert told["in_force_ms"]["count"] == 1
    assert told["idled"] == 3
    first, second = told["rounds"]
    assert first["ratio"] == pytest.approx(1.01)
    assert second["ratio"] is None
    assert second["in_force_ms"] == {
        "count": 0,
        **dict.fromkeys(("p50", "p90", "p99", "max")),
    }
    json.dumps(told, allow_nan=False)
    assert not FLIGHTS.ok


def test_people_are_shown_times_ratio_and_what_was_wanted() -> None:
    console = Console(width=120)
    with console.capture() as captured:
        console.print(FLIGHTS)

    shown = captured.get()
    for words in (
        "next target sent",
        "its mission in force",
        "1.0100",
        "tasks done",
        "below 20 ms",
    ):
        assert words in shown
