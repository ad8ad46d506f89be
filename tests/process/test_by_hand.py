"""The processes of a mission started by hand, one terminal each, as the README shows it."""

from __future__ import annotations

import contextlib
import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from swarm.bus.loopback import free_loopback_endpoints

pytestmark = [pytest.mark.process]

README = Path(__file__).parents[2] / "README.md"


def commands() -> list[list[str]]:
    """The commands of the README's section on starting every process by hand."""
    section = README.read_text().split("### Every process by hand")[1].split("###")[0]
    lines = re.findall(r"^    swarm (.*?)(?:\s+#.*)?$", section, re.MULTILINE)
    return [line.split() for line in lines]


@contextlib.contextmanager
def started(arguments: list[str]) -> Iterator[subprocess.Popen[str]]:
    process = subprocess.Popen(
        [sys.executable, "-m", "swarm", *arguments],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        env={**os.environ, "NO_COLOR": "1"},
    )
    try:
        yield process
    finally:
        if process.poll() is None:
            process.send_signal(signal.SIGTERM)
            process.wait(20)
        assert process.stdout is not None
        process.stdout.close()


def first_line(process: subprocess.Popen[str]) -> dict[str, object]:
    assert process.stdout is not None
    said = json.loads(process.stdout.readline())
    assert isinstance(said, dict)
    return said


def test_processes_started_by_hand_fly_the_paper_mission() -> None:
    router, autopilot, coordinator, *agents = commands()
    assert [words[0] for words in (router, autopilot, coordinator)] == [
        "router",
        "autopilot",
        "coordinator",
    ]
    (endpoint,) = free_loopback_endpoints(1, np.random.default_rng())
    pace = ["--speedup", "4"]
    seat = ["--connect", endpoint, *pace]
    autopilot[autopilot.index("--listen") + 1] = "tcp:127.0.0.1:0"
    with contextlib.ExitStack() as stack:
        serving = stack.enter_context(started([*router, "--listen", endpoint]))
        assert first_line(serving)["endpoints"] == [endpoint]
        flying = stack.enter_context(started([*autopilot, *pace]))
        urls = [str(first_line(flying)["url"]) for _ in agents]
        planning = stack.enter_context(started([*coordinator, *seat, "--json"]))
        pilots = []
        for words, url in zip(agents, urls, strict=True):
            words[words.index("--mavlink") + 1] = url
            pilots.append(stack.enter_context(started([*words, *seat])))

        assert first_line(planning)["sequence"] == ["uav1", "uav3", "uav2"]
        assert planning.wait(100) == 0
        assert [pilot.wait(20) for pilot in pilots] == [0, 0, 0]
        flying.send_signal(signal.SIGTERM)
        serving.send_signal(signal.SIGTERM)
        assert (flying.wait(20), serving.wait(20)) == (0, 0)
