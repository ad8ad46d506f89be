from __future__ import annotations

import json

import pytest

from sim.bench.bounds import measure_bounds
from swarm.cli import main
from swarm.runtime.clock import SystemClock


def test_small_missions_are_proven_and_the_trace_falls() -> None:
    done = measure_bounds([(4, 12)], [0, 1], SystemClock(), search_s=0.1, limit_s=20.0)

    assert [one.size for one in done.bounds] == ["4×12", "4×12"]
    for one in done.bounds:
        assert one.proven
        assert one.gap == 0.0
        assert one.bound == pytest.approx(one.objective, rel=1e-9)
        falls = [point.bound for point in one.trace]
        assert falls == sorted(falls, reverse=True)
        assert falls[-1] == one.bound


def test_the_command_says_which_are_proven(capsys: pytest.CaptureFixture[str]) -> None:
    flags = ["--sizes", "3x8", "--seeds", "1", "--search-s", "0.1", "--time-limit-s", "20"]

    assert main(["bench", "bound", *flags]) == 0
    assert "optimal" in capsys.readouterr().out
    assert main(["bench", "bound", *flags, "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["bounds"][0]["gap"] == 0.0
    assert said["machine"]
