"""`swarm status` beside a mission that is flown by real processes."""

from __future__ import annotations

import contextlib
import json
import signal
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from swarm.bus.loopback import free_loopback_endpoints
from swarm.scenario.write import format_scenario
from tests.process.chaos_play import survey
from tests.process.kept_open import kept_open, let_end
from tests.process.mission import SwarmRun, wait_until
from tests.process.programs import Swarm, run_swarm
from tests.process.router_processes import router

pytestmark = [pytest.mark.process]


def status(*words: str) -> subprocess.CompletedProcess[str]:
    return run_swarm("status", *words)


def wait_for_text(file: Path, text: str) -> None:
    """Wait until it is in the file, which may not be there yet."""
    wait_until(lambda: file.exists() and text in file.read_text(), 100, f"{text!r} in {file.name}")


def router_of(run: SwarmRun) -> str:
    """Endpoint of the router that the run has started."""
    (words,) = [words for words in run.children() if words.startswith("coordinator ")]
    return words.split("--connect ")[1].split()[0]


def test_a_running_mission_is_found_and_told(tmp_path: Path) -> None:
    # Whoever has set off is under way or at work whenever it is asked for.
    endless = replace(survey(3, 12, service_s=1e5), horizon_s=1e6)
    (scenario := tmp_path / "scenario.toml").write_text(format_scenario(endless))
    logs = tmp_path / "logs"
    options = ["--bus", "router", "--method", "greedy", "--speedup", "1", "--logs", str(logs)]
    with SwarmRun([str(scenario), *options], tmp_path) as run:
        run.wait_for_line("epoch 1")
        for uav in endless.uavs:
            wait_for_text(logs / f"{uav.id}.jsonl", '"decided"')
        table = status("--connect", router_of(run))
        told = json.loads(status("--connect", router_of(run), "--json").stdout)

        assert table.returncode == 0, table.stderr
        # A slow machine may keep it waiting for the bus, which it says.
        assert all(" waiting for " in line for line in table.stderr.splitlines()), table.stderr
        assert table.stdout.startswith("chaos · RUNNING · mission time ")
        assert max(len(line) for line in table.stdout.splitlines()) <= 80
        assert (told["mission"], told["phase"], told["epoch"]) == ("chaos", "running", 1)
        assert told["coordinator"]
        assert len(told["uavs"]) == 3
        assert all(uav["does"] in ("flying", "serving") for uav in told["uavs"])
        assert all(uav["position_enu_m"] and uav["link_age_s"] < 3.0 for uav in told["uavs"])
        assert told["tasks"]["open"] == 12
        assert told["mission_s"] > 0.0


def test_a_mission_is_watched_to_its_end(tmp_path: Path) -> None:
    (scenario := tmp_path / "scenario.toml").write_text(format_scenario(kept_open(survey(3, 8))))
    arguments = [str(scenario), "--bus", "router", "--method", "greedy", "--speedup", "6"]
    with SwarmRun(arguments, tmp_path) as run:
        wait_until(lambda: any(w.startswith("coord") for w in run.children()), 100, "coordinator")
        words = ["status", "--watch", "--connect", router_of(run)]
        with contextlib.ExitStack() as stack:

            def watching(name: str, *more: str) -> Swarm:
                said = stack.enter_context((tmp_path / name).open("w"))
                process = stack.enter_context(
                    Swarm([*words, *more], stdin=subprocess.DEVNULL, stdout=said, stderr=said)
                )
                stack.callback(process.kill)  # none of them ends by itself after a failure
                return process

            watchers = [watching("lines", "--json"), watching("story"), watching("stopped")]
            run.wait_for_line("epoch 1")
            for name in ("lines", "story", "stopped"):
                wait_for_text(tmp_path / name, "\n")
            *stay, stopped = watchers
            stopped.send_signal(signal.SIGINT)
            assert stopped.wait(60) == 130
            let_end()
            status, result = run.result()
            assert [process.wait(60) for process in stay] == [0, 0]
            told = [json.loads(line) for line in (tmp_path / "lines").read_text().splitlines()]
            text = (tmp_path / "story").read_text()

        assert status == 0, run.story()
        assert [each["tasks"]["done"] for each in told] == sorted(
            each["tasks"]["done"] for each in told
        )
        assert (told[-1]["phase"], told[-1]["tasks"]["done"]) == ("ended", 8)
        assert told[-1]["planned_objective"] == pytest.approx(result["objective"], abs=5e-5)
        # Nobody has told how fast the mission is flown.
        ended_s = float(text.split("  mission ends")[0].split()[-2])
        (end_s,) = [each["mission_s"] for each in result["story"] if "ends" in each["text"]]
        assert ended_s == pytest.approx(end_s, rel=0.2)
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
