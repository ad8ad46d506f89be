"""Commands beside a `swarm run` of this machine, which find it without being told where it is."""

from __future__ import annotations

import contextlib
import json
import signal
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from sim.fleet.faults.flood import long_mission
from swarm.bus.local_runs import local_runs
from tests.process.mission import SwarmRun
from tests.process.test_secure_run import swarm, written

pytestmark = [pytest.mark.process]

LONG, FAST = 5000.0, ["--speedup", "20"]
"""The paper's mission, drawn out to more than ten minutes: nobody is done before the commands."""


def told(*words: str) -> dict[str, Any]:
    """What a command that ends well says as JSON."""
    done = swarm(*words, "--json")
    assert (done.returncode, done.stderr) == (0, ""), (words, done.stdout)
    found: dict[str, Any] = json.loads(done.stdout)
    return found


@pytest.mark.parametrize("keys", [["--secure"], pytest.param([], marks=pytest.mark.slow)])
def test_an_operator_commands_the_run_of_this_machine(tmp_path: Path, keys: list[str]) -> None:
    mission, folder = long_mission(LONG), tmp_path / "run"
    folder.mkdir()
    with SwarmRun([written(mission, tmp_path), *FAST, "--bus", "mesh", *keys], folder) as run:
        run.wait_for_line("epoch 1")
        assert [each.mission for each in local_runs()] == [mission.name]

        assert told("status")["mission"] == mission.name
        assert told("hold", "uav1", "--reason", "helicopter")["uavs"] == {"uav1": "holding"}
        assert told("task", "add", "--position", "1,2", "--mission", mission.name)["obeyed"]
        late = swarm("start", "--without", "uav3")
        assert late.returncode == 1
        assert late.stderr == "swarm: the mission has started already: nobody waits for uav3\n"
        assert told("abort", "--yes")["obeyed"]
        status, result = run.result()

        run.assert_nothing_left()
    assert status == 1
    assert "operator aborts the mission" in [line["text"] for line in result["story"]]
    assert local_runs() == []


def test_of_two_runs_the_mission_is_to_be_named(tmp_path: Path) -> None:
    with contextlib.ExitStack() as stack:
        runs = {}
        for name in ("north", "south"):
            folder, mission = tmp_path / name, replace(long_mission(LONG), name=name)
            folder.mkdir()
            words = [written(mission, folder), *FAST]
            runs[name] = stack.enter_context(SwarmRun(words, folder))
        for run in runs.values():
            run.wait_for_line("epoch 1")

        unclear: subprocess.CompletedProcess[str] = swarm("abort", "--yes")
        assert told("hold", "uav1", "--mission", "north")["mission"] == "north"
        runs["north"].end(signal.SIGINT)
        assert told("status")["mission"] == "south"

    assert unclear.returncode == 2
    (line,) = unclear.stderr.splitlines()
    for name, run in runs.items():
        assert f"{name} (pid {run.process.pid})" in line
