"""The dashboard beside missions that are flown by real processes."""

from __future__ import annotations

import json
import os
import re
import signal
import socket
import time
from pathlib import Path

import pytest

from swarm.model import Mission, Origin, Task, TaskId, Uav, UavId
from swarm.scenario.write import format_scenario
from tests.process.feed_reader import FeedReader, answers, post
from tests.process.kept_open import kept_open
from tests.process.mission import SwarmRun, alive, child_pids, wait_until
from tests.process.programs import run_swarm
from tests.process.router_processes import commanded, router

pytestmark = [pytest.mark.process]

UAVS = ["uav1", "uav2", "uav3"]
SOON_S = 60.0
"""Only bounds how long a test hangs: how soon a page shows what is said is its server's to keep."""
MISSION = Mission(
    "shown",
    9000.0,
    tuple(Uav(UavId(u), (15.0 * n, 0.0, 0.0), 8.0) for n, u in enumerate(UAVS)),
    tuple(Task(TaskId(f"t{n}"), (40.0 * n, 900.0, 0.0), 1.0) for n in range(6)),
    origin=Origin(46.8, 9.7, 1100.0),
)


def test_an_operator_sees_and_steers_a_run(tmp_path: Path) -> None:
    scenario = tmp_path / "shown.toml"
    # However long another dashboard takes to start, the mission goes on until it is aborted.
    scenario.write_text(format_scenario(kept_open(MISSION)))
    flown = ["shown.toml", "--speedup", "6", "--dashboard", "0"]
    with SwarmRun(flown, tmp_path) as run:
        run.wait_for_line("dashboard: http://127.0.0.1:")
        url = run.lines[0].removeprefix("dashboard: ")
        with FeedReader(url) as page:
            _everyone_moves(page)

            status, said = post(url, "api/task", {"position": [20.0, 30.0, 0.0], "value": 500.0})
            assert (status, said) == (200, {"n": 1})
            wait_until(lambda: "op1" in page.tasks, SOON_S, "the new task on the page")
            assert page.tasks["op1"]["by"] == "operator"

            os.kill(run.child("agent", "uav3"), signal.SIGKILL)
            wait_until(lambda: page.uavs["uav3"]["lost"], SOON_S, "the loss on the page")

            # A dashboard that dies is started again, where the page looks for it.
            os.kill(run.child("dashboard"), signal.SIGKILL)
            wait_until(lambda: page.connections == 2, SOON_S, "another connection")
            wait_until(lambda: page.head.get("phase") == "running", SOON_S, "the mission again")

            def done() -> bool:
                return page.tasks.get("op1", {}).get("state") == "done"

            wait_until(done, 120.0, "the new task done")

            assert post(url, "api/command", {"command": "hold", "uav": "uav9"})[0] == 400
            status, said = post(url, "api/command", {"command": "abort", "reason": "storm"})
            assert status == 200

            def home(uav: str) -> bool:
                return page.uavs[uav]["does"] in ("returning", "home")

            wait_until(
                lambda: page.head["aborted"] and home("uav1") and home("uav2"), SOON_S, "home"
            )
            wait_until(lambda: page.end is not None, 120.0, "the end of the feed")
        status, told = run.result()
        run.assert_nothing_left(but="shown.toml")

    assert status == 1
    assert "op1" in told["done"]
    assert told["lost_uavs"] == ["uav3"]
    assert any(
        line.endswith("the dashboard killed by SIGKILL; started again") for line in run.lines
    )


def _everyone_moves(page: FeedReader) -> None:
    """Wait until the page has seen each UAV in two places on its way."""
    seen: dict[str, set[tuple[float, ...]]] = {uav: set() for uav in UAVS}

    def moved() -> bool:
        for uav, row in page.uavs.items():
            if row["does"] == "flying" and row["position"] is not None:
                seen[uav].add(tuple(row["position"]))
        return all(len(places) >= 2 for places in seen.values())

    wait_until(moved, 60.0, "everyone's flight")


def test_a_coordinators_dashboard_lives_and_ends_beside_it() -> None:
    with router("--listen", "tcp/127.0.0.1:0") as (_, endpoint):
        words = ("coordinator", "table-1", "--connect", endpoint, "--dashboard", "0")
        with commanded(*words, "--lifeline") as coordinator:
            assert coordinator.stderr is not None
            url = coordinator.stderr.readline().removeprefix("dashboard: ").strip()
            wait_until(lambda: answers(url), SOON_S, "a dashboard")
            (first,) = child_pids(coordinator.pid).values()
            with FeedReader(url) as page:
                wait_until(lambda: page.head.get("coordinator") is True, SOON_S, "the coordinator")
                os.kill(first, signal.SIGKILL)
                wait_until(lambda: page.connections == 2, SOON_S, "another dashboard")
            (second,) = child_pids(coordinator.pid).values()
            assert coordinator.poll() is None

            coordinator.send_signal(signal.SIGKILL)
            coordinator.wait(10)
            wait_until(lambda: not alive(second), 10.0, "the end of the dashboard")

    assert second != first


def test_a_dashboard_waits_for_a_mission_and_ends_at_once() -> None:
    with router("--listen", "tcp/127.0.0.1:0") as (_, endpoint):
        words = ("dashboard", "--connect", endpoint, "--port", "0", "--json")
        with commanded(*words) as dashboard:
            assert dashboard.stdout is not None
            url = json.loads(dashboard.stdout.readline())["url"]
            with FeedReader(url) as page:
                wait_until(lambda: page.head.get("link") is True, SOON_S, "the bus")
                assert page.head["phase"] is None
                early, _ = post(url, "api/command", {"command": "abort"})
                dashboard.send_signal(signal.SIGINT)
                began_s = time.monotonic()
                status = dashboard.wait(10)
                took_s = time.monotonic() - began_s

    assert early == 409
    assert page.end is not None
    assert (status, took_s < 4.0) == (130, True)


def test_a_port_that_is_taken_is_told_in_one_line() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = str(taken.getsockname()[1])
        told = run_swarm("dashboard", "--port", port)

    assert (told.returncode, told.stdout) == (2, "")
    assert re.fullmatch(
        rf"--port: cannot listen at 127\.0\.0\.1, port {port}: Address already in use; choose .*\n",
        told.stderr,
    )
