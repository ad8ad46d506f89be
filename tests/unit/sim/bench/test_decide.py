from __future__ import annotations

import io
import json

from rich.console import Console

from sim.bench.decisions import measure_decisions
from swarm.runtime.clock import SystemClock


def test_decisions_of_every_rule_are_timed() -> None:
    bench = measure_decisions(4, 20, 0, SystemClock(), sequences=10)
    assert [row.name for row in bench.times] == [
        "greedy", "lookahead", "guided", "guided, disturbed"
    ]  # fmt: skip
    for row in bench.times:
        assert 0.0 <= row.median_s <= row.p99_s <= row.largest_s
        assert row.first_s <= row.largest_s
    assert [row.decisions >= 20 for row in bench.times[:3]] == [True] * 3
    assert bench.times[3].decisions > 0
    assert bench.sequences_per_s > 0.0
    assert bench.sequences_per_s_threaded > 0.0


class _SlowClock(SystemClock):
    """Every look at it takes a second, and so every decision."""

    def __init__(self) -> None:
        self._looks = 0

    def now_s(self) -> float:
        self._looks += 1
        return float(self._looks)


def test_of_a_large_mission_the_beginning_is_decided() -> None:
    bench = measure_decisions(4, 40, 0, _SlowClock(), sequences=2)
    assert [row.decisions for row in bench.times] == [21, 21, 21, 21]


def test_it_is_told_to_people_and_programs() -> None:
    bench = measure_decisions(3, 9, 1, SystemClock(), sequences=5)
    stream = io.StringIO()
    Console(file=stream, width=80).print(bench)
    text = stream.getvalue()
    assert "One online decision at 3 × 9, seed 1" in text
    assert "guided, disturbed" in text
    assert "…" not in text
    said = json.loads(json.dumps(bench.as_json(), allow_nan=False))
    assert said["n_task"] == 9
    assert len(said["times"]) == 4
