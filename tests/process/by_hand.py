"""A mission whose processes are started by hand, as an operator does."""

from __future__ import annotations

import contextlib
import json
import os
import re
import signal
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from swarm.bus.loopback import free_loopback_endpoints
from swarm.model import Mission
from swarm.scenario.write import format_scenario
from tests.process.kept_open import KEEPER
from tests.process.mission import wait_until
from tests.process.pace import pace
from tests.process.programs import Swarm

LIMIT_S = 220.0


class ByHand:
    """The processes of one mission; each logs into a file of its own.

    Args:
        folder: for scenario and logs.
        stack: ends the processes.
        mission: flown.
        speedup: mission seconds per second of the wall's clock, on a machine that is not slow.
        keys: folder of the mission's authority; None to fly without keys.
        programs: words that start `swarm` for the process of that name, where they are others
            than for everybody.
        flavour: of the simulated autopilots.
        by_itself: whether their vehicles start again without anybody's word.
        agent_options: more options of every agent.
    """

    def __init__(
        self,
        folder: Path,
        stack: contextlib.ExitStack,
        mission: Mission,
        speedup: float = 2.0,
        keys: Path | None = None,
        programs: Mapping[str, Sequence[str]] | None = None,
        *,
        flavour: str = "ardupilot",
        by_itself: bool = False,
        agent_options: Sequence[str] = (),
    ) -> None:
        self.folder = folder
        self.mission = mission
        self.uavs: list[str] = [uav.id for uav in mission.uavs]
        self._stack = stack
        self._programs = programs or {}
        self._scenario = folder / "scenario.toml"
        self._scenario.write_text(format_scenario(mission))
        self._keys = keys
        (endpoint,) = free_loopback_endpoints(1, np.random.default_rng())
        self.endpoint = endpoint if keys is None else endpoint.replace("tcp/", "tls/")
        """Of the router."""
        flown = ["--speedup", f"{pace(speedup):g}"]
        self.seat = ["--connect", self.endpoint, *flown]
        serving = ["router", "--listen", self.endpoint, "--json", *self.keys_of("router")]
        router = self.start("router", serving)
        self._line(router)
        chosen = [word for uav in self.uavs for word in ("--uav", uav)]
        listen = ["--listen", "tcp:127.0.0.1:0", *flown, "--json"]
        autopilot = ["autopilot", str(self._scenario), *chosen, *listen, "--flavour", flavour]
        self._by_itself = by_itself
        self._agent_options = agent_options
        flying = self.start("autopilot", autopilot)
        self._vehicles = {
            str(said["uav"]): said for said in map(self._line, [flying] * len(self.uavs))
        }
        self.agents = [self._agent(uav) for uav in self.uavs]

    def coordinator(self, name: str, *options: str) -> subprocess.Popen[str]:
        """Start a coordinator; ``name`` is that of its log."""
        words = ["coordinator", str(self._scenario), "--method", "greedy", "--json"]
        return self.start(name, [*words, *self.seat, *self.keys_of("coordinator"), *options])

    def keys_of(self, name: str) -> list[str]:
        """What to tell a process so that it has the keys of ``name``."""
        return [] if self._keys is None else ["--keys", str(self._keys / name)]

    def start(self, name: str, arguments: list[str]) -> subprocess.Popen[str]:
        log = self._stack.enter_context((self.folder / f"{name}.log").open("w"))
        nothing, pipe = subprocess.DEVNULL, subprocess.PIPE
        environment = {**os.environ, "NO_COLOR": "1", "SWARM_LOG_FORMAT": "lines"}
        program = self._programs.get(name)
        if program is None:
            process: subprocess.Popen[str] = Swarm(
                arguments, stdin=nothing, stdout=pipe, stderr=log, env=environment
            )
        else:
            process = subprocess.Popen(
                [*program, *arguments],
                stdin=nothing,
                stdout=pipe,
                stderr=log,
                env=environment,
                text=True,
            )
        self._stack.callback(_end, process)
        return process

    def log(self, name: str) -> str:
        """All that process has logged so far."""
        return (self.folder / f"{name}.log").read_text()

    def wait_for(self, name: str, text: str, times: int = 1) -> None:
        """Wait until a log has ``text`` so many times."""
        wait_until(
            lambda: self.log(name).count(text) >= times,
            LIMIT_S,
            f"{text!r} in {name}: {self.log(name)}",
        )

    def done(self) -> list[str]:
        """Tasks done so far, once for every visit."""
        logs = "".join(self.log(uav) for uav in self.uavs)
        return re.findall(r'event="task done".*?\btask=(\w+)', logs)

    def wait_for_done(self, count: int) -> None:
        """Wait until so many tasks are done."""
        wait_until(lambda: len(self.done()) >= count, LIMIT_S, f"the end of {count} tasks")

    def assert_all_done(self) -> None:
        """Every task but the keeper was visited once, and everybody came home."""
        assert [agent.wait(60) for agent in self.agents] == [0] * len(self.uavs)
        assert sorted(self.done()) == sorted(
            task.id for task in self.mission.tasks if task.id != KEEPER
        )

    def restart(self, uav: str, name: str) -> None:
        """Start the agent of a UAV again, as it was started; ``name`` is that of its log."""
        self.agents[self.uavs.index(uav)] = self._agent(uav, name)

    def _agent(self, uav: str, name: str = "") -> subprocess.Popen[str]:
        vehicle = self._vehicles[uav]
        words = ["agent", "--mission", self.mission.name, "--uav", uav]
        words += ["--mavlink", str(vehicle["url"]), "--system-id", str(vehicle["system_id"])]
        words += ["--ready-by-itself"] if self._by_itself else []
        words += self._agent_options
        return self.start(name or uav, [*words, *self.seat, *self.keys_of(uav)])

    @staticmethod
    def _line(process: subprocess.Popen[str]) -> dict[str, object]:
        assert process.stdout is not None
        said = json.loads(process.stdout.readline())
        assert isinstance(said, dict)
        return said


def _end(process: subprocess.Popen[str]) -> None:
    if process.poll() is None:
        process.send_signal(signal.SIGCONT)
        process.terminate()
        try:
            process.wait(20)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
    assert process.stdout is not None
    process.stdout.close()
