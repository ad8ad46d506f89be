"""How well `swarm plan` keeps to its limit: the whole command, by the wall clock.

Run it: ``python -m tests.benchmarks.time_limit [SECONDS …]``, on a machine that does nothing else.
Missions of one UAV and 318 tasks, of 50 × 500 and 200 × 5000, and table-1, by each method. What
starting a command takes that does nothing is not counted, since no limit can.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from sim.study.generator import mission_of, random_mission
from swarm.model import Mission
from swarm.runtime.clock import SystemClock
from swarm.scenario.write import format_scenario

SIZES = ((1, 318), (50, 500), (200, 5000))
METHODS = ("greedy", "lookahead", "guided")
ALLOWED_FRAC, ALLOWED_S = 0.1, 0.2


def scenario(n_uav: int, n_task: int) -> Mission:
    """A random mission in which every UAV can do everything, so that its file stays small."""
    mission = mission_of(random_mission(n_uav, n_task, 1), f"r{n_uav}x{n_task}")
    uavs = tuple(replace(uav, success={}, survival={}) for uav in mission.uavs)
    return replace(mission, uavs=uavs)


def wall_s(arguments: Sequence[str]) -> tuple[float, str]:
    """How long the command takes, and what it prints."""
    clock = SystemClock()
    begin_s = clock.now_s()
    command = [str(Path(sys.executable).with_name("swarm")), *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return clock.now_s() - begin_s, done.stdout


def main(limits_s: Sequence[float]) -> None:
    """Measure and print."""
    start_s = min(wall_s(["--version"])[0] for _ in range(3))
    print(f"swarm --version takes {start_s:.2f} s")
    with tempfile.TemporaryDirectory() as folder:
        files = ["table-1"]
        for n_uav, n_task in SIZES:
            files.append(f"{folder}/r{n_uav}x{n_task}.toml")
            Path(files[-1]).write_text(format_scenario(scenario(n_uav, n_task)), encoding="utf-8")
        for file in files:
            for method in METHODS:
                for limit_s in limits_s:
                    limit = ["--time-limit-s", str(limit_s)]
                    took_s, said = wall_s(["plan", file, "--method", method, "--json", *limit])
                    plan = json.loads(said)
                    over_s = took_s - start_s - limit_s
                    kept = over_s <= ALLOWED_FRAC * limit_s + ALLOWED_S
                    print(
                        f"{plan['scenario']:10} {method:9} limit {limit_s:g} s: {took_s:.2f} s, "
                        f"{'kept' if kept else 'NOT KEPT'}; J {plan['objective']:.6g}, bound "
                        f"{plan['bound'] or plan['optimum'] or float('nan'):.6g}, "
                        f"{plan['evaluations']} evaluations",
                        flush=True,
                    )


if __name__ == "__main__":
    main([float(word) for word in sys.argv[1:]] or [1.0, 5.0])
