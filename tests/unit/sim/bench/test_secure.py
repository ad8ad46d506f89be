"""Costs of keys: flights in turn, what processes have used, and how it is shown."""

from __future__ import annotations

import io
import json
import os
from dataclasses import replace

import numpy as np
import pytest
from rich.console import Console

from sim.bench.machine import this_machine
from sim.bench.security import SecureBench, in_turn
from sim.bench.security_flights import (
    LAUNCHER,
    CostFlight,
    CostsByKind,
    FloodTotals,
    ProcessMeter,
    SecurityMode,
    kind_of,
)
from sim.fleet.launcher import Launcher
from tests.support.builders import mission, task, uav
from tests.unit.sim.fleet.test_fleet import OPTIONS

PLAIN = CostFlight(
    way=SecurityMode.PLAIN,
    start=CostsByKind({"agent": 2, "router": 1}, {"agent": 3.0, "router": 0.5}, {"agent": 8e7}),
    whole=CostsByKind({"agent": 2, "router": 1}, {"agent": 5.0, "router": 1.5}, {"agent": 8e7}),
    takeoff_wall_s=9.0,
    flight_wall_s=30.0,
    target_ms=(1.0, 2.0, 3.0),
    done=5,
    tasks=5,
    as_planned=True,
    refused={},
    poured_hz=0.0,
    load=0.5,
)
SECURE = replace(
    PLAIN,
    way=SecurityMode.SECURE,
    whole=CostsByKind({"agent": 2, "router": 1}, {"agent": 5.5, "router": 1.6}, {"agent": 9e7}),
    target_ms=(2.0, 4.0),
)
BENCH = SecureBench(
    this_machine(),
    "table-1",
    2,
    5,
    4.0,
    "router",
    0,
    (PLAIN, SECURE),
    {SecurityMode.PLAIN: (0.001,), SecurityMode.SECURE: (0.002,)},
)


def shown(bench: SecureBench) -> str:
    console = Console(file=io.StringIO(), width=120, color_system=None)
    with console.capture() as captured:
        console.print(bench)
    return captured.get()


def test_who_flies_first_takes_turns() -> None:
    plain, secure, flooded = SecurityMode
    assert in_turn([plain, secure], 0) == []
    assert in_turn([plain, secure, flooded], 2) == [
        *(plain, secure, flooded),
        *(flooded, secure, plain),
    ]


def test_processes_are_counted_by_their_command() -> None:
    assert kind_of(("agent", "--uav", "u1")) == "agent"
    assert kind_of(("/opt/px4", "-i", "0")) == "firmware"


def test_only_what_was_used_since_the_beginning_counts_for_the_launcher() -> None:
    fleet = mission([uav("u0")], [task("t0", 1.0)])
    costs = ProcessMeter(os.getpid())
    np.linalg.inv(np.eye(300))  # something to do
    costs.look(Launcher(fleet, OPTIONS))

    told = costs.costs()
    assert told.processes == {LAUNCHER: 1}
    assert 0.0 <= told.cpu_s[LAUNCHER] < 10.0
    assert told.memory_bytes[LAUNCHER] > 1e6


def test_both_ways_stand_side_by_side() -> None:
    text = shown(BENCH)

    assert "processor time in flight: 1.200 times that of plain" in text
    assert "p99 of next target sent below 20 ms, secure: held" in text
    assert "every task was done, and nothing honest was refused" in text
    (agents,) = [line.split() for line in text.splitlines() if line.startswith("agent")]
    assert agents[1:4] == ["2", "2.00", "2.50"]


@pytest.mark.parametrize(
    "broken", [replace(SECURE, done=4), replace(SECURE, refused={"wrongly signed": 1})]
)
def test_a_task_left_or_an_honest_message_refused_is_a_failure(broken: CostFlight) -> None:
    bench = replace(BENCH, flights=(PLAIN, broken))

    assert not bench.ok
    assert "FAILED" in shown(bench)


def test_a_flood_is_refused_and_the_others_are_quick_all_the_same() -> None:
    flooded = replace(
        SECURE,
        way=SecurityMode.FLOODED,
        refused={"too many": 900},
        poured_hz=9999.6,
        target_ms=(99.0,),
    )
    bench = replace(BENCH, flights=(PLAIN, SECURE, flooded))

    assert bench.ok
    text = shown(bench)
    assert "p99 of next target sent below 100 ms, flooded: held" in text
    assert "flooded with 10000 messages a second; 900 refused behind the router" in text
    slow = replace(flooded, target_ms=(101.0,))
    assert "flooded: NOT held" in shown(replace(bench, flights=(PLAIN, SECURE, slow)))


def test_a_hostile_process_tells_how_much_it_has_sent() -> None:
    poured = FloodTotals()
    for line in ('{"sent": 100, "wall_s": 1.0}', "Traceback", "[1]", '{"sent": 500, "wall_s": 4}'):
        poured.hear("hostile", line)

    assert poured.rate_hz == 125.0
    assert FloodTotals().rate_hz == 0.0


def test_programs_are_told_the_same() -> None:
    told = json.loads(json.dumps(BENCH.as_json(), allow_nan=False))

    assert told["plain"]["flight_cpu_s"] == {"agent": 2.0, "router": 1.0}
    assert told["secure"]["flight_cpu_s"]["agent"] == 2.5
    assert told["secure"]["turnaround_ms"] == {
        "count": 2,
        "p50": 2.0,
        "p90": 4.0,
        "p99": 4.0,
        "max": 4.0,
    }
    assert told["secure"]["hop_ms"]["p50"] == 2.0
    assert len(told["flights"]) == 2


def test_without_flights_only_claims_are_told() -> None:
    text = shown(replace(BENCH, flights=()))

    assert "through a router" in text
    assert "next target sent" not in text
