"""`swarm bench autopilot` measures what it says, with a few vehicles."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

pytestmark = [pytest.mark.process]


def test_few_vehicles_deliver_what_is_asked_of_them() -> None:
    words = ["bench", "autopilot", "--vehicles", "3", "--seconds", "3", "--json"]
    done = subprocess.run(
        [sys.executable, "-m", "swarm", *words],
        capture_output=True,
        text=True,
        timeout=100,
        check=False,
        stdin=subprocess.DEVNULL,
    )
    load = json.loads(done.stdout)

    assert load["vehicles"] == 3
    assert load["delivered_frac"] > 0.8  # a test machine may be busy
    assert 0.0 < load["cores"] < 1.0
    assert 0.0 < load["latency_p50_s"] <= load["latency_p99_s"]
    assert {stream["message"] for stream in load["streams"]} >= {"GLOBAL_POSITION_INT"}
