"""`swarm doctor` beside a router and simulated autopilots."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tests.process.programs import run_swarm
from tests.process.router_processes import commanded, router

pytestmark = [pytest.mark.process]


def doctor(*words: str) -> tuple[int, dict[str, dict[str, Any]]]:
    """Exit status, and the checks by name."""
    done = run_swarm("doctor", *words, "--json")
    assert done.stderr == ""
    told = json.loads(done.stdout)
    assert told["ok"] == (done.returncode == 0)
    return done.returncode, {check["check"]: check for check in told["checks"]}


def test_a_sound_flight_passes_and_every_fault_is_named(tmp_path: Path) -> None:
    key = tmp_path / "uav.key"
    key.write_text("0" * 63 + "1")
    key.chmod(0o600)
    # Half as fast as time, so that it still boots while the doctor comes to look at it.
    flying = ["autopilot", "table-1", "--uav", "uav1", "--listen", "tcp:127.0.0.1:0", "--json"]
    flying += ["--speedup", "0.5"]
    with (
        router("--listen", "tcp/127.0.0.1:0") as (serving, endpoint),
        commanded(*flying) as autopilot,
    ):
        assert autopilot.stdout is not None
        url = json.loads(autopilot.stdout.readline())["url"]
        seat = ["--connect", endpoint, "--mavlink", url]

        status, checks = doctor("table-1", *seat, "--state", str(tmp_path), "--timeout-s", "50")

        fails = {name: check["text"] for name, check in checks.items() if check["state"] == "fails"}
        assert (status, fails) == (0, {})
        assert checks["scenario"]["text"] == "table-1: 3 UAVs, 8 tasks, D = 5 s"
        assert checks[f"bus {endpoint}"]["state"] == checks["session"]["state"] == "ok"
        assert checks["zenoh"]["state"] == checks["kernels"]["state"] == "ok"
        assert checks[url]["text"] == "system id 1, ArduPilot, mode STABILIZE, not armed"
        assert checks[f"{url} ready"]["text"].startswith("pre-arm checks pass, position known")
        assert " 0 lost" in checks[f"{url} link"]["text"]

        port = endpoint.rpartition(":")[2]
        status, checks = doctor(
            *("--mission", "table-1", "--connect", endpoint, "--port", port),
            *("--mavlink", f"{url}#9", "--signing-key", str(key), "--timeout-s", "1"),
        )

        assert status == 1
        wrong = {name for name, check in checks.items() if check["state"] == "fails"}
        assert wrong == {"mission", "port", url}
        assert f"(pid {serving.pid})" in checks["port"]["text"]
        assert "not to be believed: unsigned" in checks[url]["text"]
