"""`swarm bench failover` measures what it says, in a few trials."""

from __future__ import annotations

import asyncio
import json
import os
import signal
import subprocess
import sys
from dataclasses import replace

import pytest

from sim.bench.latency import measure_latencies
from sim.bench.links import BAD_LINKS, measure_false_losses
from sim.bench.takeover import stuck_on_demand
from swarm.protocol.timing import LinkKind

pytestmark = [pytest.mark.process]


def test_another_holds_the_task_of_a_killed_agent() -> None:
    words = ["bench", "failover", "--what", "kill", "--trials", "2", "--json"]
    done = subprocess.run(
        [sys.executable, "-m", "swarm", *words],
        capture_output=True,
        text=True,
        timeout=180,
        check=True,
        stdin=subprocess.DEVNULL,
    )
    (kill,) = json.loads(done.stdout)["takeovers"]

    assert (kill["blow"], kill["trials"], kill["missed"]) == ("kill", 2, 0)
    assert 0.2 < kill["p50_s"] <= kill["p99_s"] < 5.0  # a test machine may be busy


@pytest.mark.parametrize("relay", [False, True])
def test_nobody_is_lost_on_links_that_lose_some_packets(relay: bool) -> None:
    # By the preset for bad links: on a slow machine the shorter lease ends without any loss.
    bad = replace(BAD_LINKS[0], link=LinkKind.BAD)

    watched = measure_false_losses(bad, 4.0, uavs=2, relay=relay)

    assert watched.losses == 0
    assert (watched.path == "relay") >= relay
    if watched.path == "tun":  # where the system permits it
        assert 0.01 < watched.dropped / watched.packets < 0.12


def test_decisions_are_timed() -> None:
    measured = asyncio.run(measure_latencies("greedy", uavs=2, tasks=8, speedup=5.0))

    # Who hears of a better claim in time turns round, which is a decision more.
    assert len(measured.times_s) >= 6
    assert 0.0 < (measured.quantile_s(0.5) or 0.0) < 0.1


def test_a_program_stands_still_on_demand_while_its_threads_go_on() -> None:
    program = """
import sys, threading, time
def other():
    while True:
        print("other", flush=True); time.sleep(0.02)
threading.Thread(target=other, daemon=True).start()
while True:
    print("main", flush=True); time.sleep(0.02)
"""
    before = os.environ.get("PYTHONPATH")
    with stuck_on_demand():
        process = subprocess.Popen(
            [sys.executable, "-c", program], stdout=subprocess.PIPE, text=True
        )
        try:
            assert process.stdout is not None
            lines = process.stdout
            while lines.readline() != "main\n":
                pass
            process.send_signal(signal.SIGUSR1)
            said = [lines.readline() for _ in range(30)]
            assert set(said[10:]) == {"other\n"}
            process.send_signal(signal.SIGUSR2)
            while lines.readline() != "main\n":
                pass
        finally:
            process.kill()
            process.communicate()
    assert os.environ.get("PYTHONPATH") == before
