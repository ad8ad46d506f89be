"""`swarm status` beside a mission that is flown by real processes."""

from __future__ import annotations

import contextlib
import json
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from swarm.bus.endpoints import free_loopback_endpoints
from swarm.scenario.write import format_scenario
from tests.process.chaos_play import survey
from tests.process.mission import SwarmRun, wait_until
from tests.process.pace import pace
from tests.process.router_processes import router

pytestmark = [pytest.mark.process]


def status(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "swarm", "status", *words],
        capture_output=True,
        text=True,
        timeout=100,
        check=False,
        stdin=subprocess.DEVNULL,
    )


def router_of(run: SwarmRun) -> str:
    """Endpoint of the router that the run has started."""
    (words,) = [words for words in run.children() if words.startswith("coordinator ")]
    return words.split("--connect ")[1].split()[0]


def test_a_running_mission_is_found_and_told(tmp_path: Path) -> None:
    (scenario := tmp_path / "scenario.toml").write_text(format_scenario(survey(5, 30)))
    options = ["--bus", "router", "--method", "greedy", "--speedup", f"{pace(3.0):g}"]
    with SwarmRun([str(scenario), *options], tmp_path) as run:
        run.wait_for_line("epoch 1")
        table = status("--connect", router_of(run))
        told = json.loads(status("--connect", router_of(run), "--json").stdout)

        assert (table.returncode, table.stderr) == (0, "")
        assert table.stdout.startswith("chaos · RUNNING · mission time ")
        assert max(len(line) for line in table.stdout.splitlines()) <= 80
        assert (told["mission"], told["phase"], told["epoch"]) == ("chaos", "running", 1)
        assert told["coordinator"]
        assert len(told["uavs"]) == 5
        # On a busy machine a UAV may not have made it to its start in time.
        assert sum(uav["does"] in ("flying", "serving") for uav in told["uavs"]) >= 3
        assert all(uav["position_enu_m"] and uav["link_age_s"] < 3.0 for uav in told["uavs"])
        assert sum(told["tasks"][state] for state in ("open", "done", "failed")) == 30
        assert told["mission_s"] > 0.0


def test_a_mission_is_watched_to_its_end(tmp_path: Path) -> None:
    arguments = ["table-1", "--bus", "router", "--method", "greedy", "--speedup", f"{pace(2.0):g}"]
    with SwarmRun(arguments, tmp_path) as run:
        wait_until(lambda: any(w.startswith("coord") for w in run.children()), 30, "coordinator")
        words = [sys.executable, "-m", "swarm", "status", "--watch", "--connect", router_of(run)]
        with contextlib.ExitStack() as stack:
            lines, story, stopped = (
                stack.enter_context(
                    subprocess.Popen(
                        [*words, *more],
                        stdin=subprocess.DEVNULL,
                        stdout=subprocess.PIPE,
                        stderr=subprocess.PIPE,
                        text=True,
                    )
                )
                for more in (["--json"], [], [])
            )
            for watching in (lines, story, stopped):
                stack.callback(watching.kill)  # none of them ends by itself after a failure
            run.wait_for_line("epoch 1")
            stopped.send_signal(signal.SIGINT)
            assert stopped.wait(20) == 130
            status, _ = run.result()
            told = [json.loads(line) for line in lines.communicate(timeout=60)[0].splitlines()]
            text, complaints = story.communicate(timeout=60)

        assert status == 0, run.story()
        assert (lines.returncode, story.returncode, complaints) == (0, 0, "")
        assert [each["tasks"]["done"] for each in told] == sorted(
            each["tasks"]["done"] for each in told
        )
        assert (told[-1]["phase"], told[-1]["tasks"]["done"]) == ("ended", 8)
        assert told[-1]["planned_objective"] == pytest.approx(118.4939, abs=5e-5)
        # Nobody has told how fast the mission is flown.
        ended_s = float(text.split("  mission ends")[0].split()[-2])
        assert 3.0 < ended_s < 9.0
        assert text.splitlines()[-1] == "the mission is over, and everybody has left"


def test_a_bus_without_a_mission_is_told_in_one_line() -> None:
    with router("--listen", "tcp/127.0.0.1:0") as (_, endpoint):
        any_mission = status("--connect", endpoint, "--timeout-s", "0.5")
        one = status("--connect", endpoint, "--timeout-s", "0.5", "--mission", "table-1")

    assert any_mission.returncode == one.returncode == 1
    assert any_mission.stdout == one.stdout == ""
    assert any_mission.stderr == "swarm: nobody on the bus flies a mission (looked for 0.5 s)\n"
    assert one.stderr == "swarm: nothing is known of mission table-1: nobody is there\n"


def test_no_bus_at_all_is_told_in_one_line() -> None:
    (endpoint,) = free_loopback_endpoints(1, np.random.default_rng())

    told = status("--connect", endpoint, "--timeout-s", "0.5")

    assert told.returncode == 1
    assert told.stderr.startswith("swarm: cannot reach the bus within 0.5 s")
    assert len(told.stderr.splitlines()) == 1


def test_who_waits_for_a_bus_is_told_for_what() -> None:
    (endpoint,) = free_loopback_endpoints(1, np.random.default_rng())

    told = status("--connect", endpoint, "--timeout-s", "2.5")

    assert told.returncode == 1
    waits, fails = told.stderr.splitlines()
    assert waits == f"swarm: waiting for a router at {endpoint}, up to 2.5 s"
    assert fails.startswith("swarm: cannot reach the bus within 2.5 s")


def test_a_mission_that_can_have_no_keys_is_refused() -> None:
    told = status("--mission", "a/b")

    assert told.returncode == 2
    assert "--mission" in told.stderr
    assert len(told.stderr.splitlines()) == 1
