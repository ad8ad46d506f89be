"""Ctrl-C during `swarm plan` ends the search and prints the best plan so far."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.process.mission import wait_until

pytestmark = pytest.mark.process

SEARCHING_CPU_S = 2.0
"""Start-up takes half a second of processor time: beyond this the search is on."""


def cpu_s(pid: int) -> float:
    """Processor time a process has used."""
    fields = (Path("/proc") / str(pid) / "stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


@pytest.mark.parametrize("method", ["guided", "greedy"])
def test_interrupted_search_gives_the_best_so_far(method: str) -> None:
    command = ["plan", "valley-survey", "--method", method, "--time-limit-s", "100", "--no-bound"]
    with subprocess.Popen(
        [sys.executable, "-m", "swarm", *command, "--json"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        try:
            wait_until(lambda: cpu_s(process.pid) > SEARCHING_CPU_S, 60.0, "the search")
            process.send_signal(signal.SIGINT)
            out, err = process.communicate(timeout=20)
        finally:
            process.kill()

    found = json.loads(out)
    assert process.returncode == 130
    assert err == ""
    assert found["method"] == method
    assert found["elapsed_s"] < 90.0
    assert sum(map(len, found["routes"].values())) == 60
