"""Starts `swarm` commands for tests: forked from a server that has imported them, as that is soon.

What is tested so is what happens after the imports; that commands can be executed, too, is tested
by those tests that start them by name, such as tests.process.test_by_hand.
"""

from __future__ import annotations

import atexit
import inspect
import os
import subprocess
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from sim.fleet.fork_server import PRELOADED, PRELOADED_FOR_KEYS, ForkServer

_PRELOADED = (
    *PRELOADED,
    *PRELOADED_FOR_KEYS,
    "coordinator.dashboard.app",
    "coordinator.dashboard.cli",
    "coordinator.dashboard.server",
    "coordinator.operator.cli",
    "coordinator.operator.submission",
    "coordinator.recording.cli",
    "coordinator.recording.flight_recorder",
    "coordinator.terminal.cli",
    "coordinator.joining",
    "coordinator.terminal.live_view",
    "coordinator.terminal.report",
    "pygments.lexers",
    "rich.live",
    "sim.fleet.cli",
    "sim.fleet.fork_server",
    "sim.fleet.passthrough",
    "sim.fleet.security",
    "sim.fleet.run",
)


class Swarm(subprocess.Popen[str]):
    """A `swarm` command in a process of its own, with text on its streams.

    Args:
        words: after ``swarm``.
        options: of `subprocess.Popen`; streams, ``cwd`` and ``env``.
    """

    def __init__(self, words: Sequence[str], **options: Any) -> None:
        super().__init__(["swarm", *words], text=True, **options)

    def _execute_child(self, *args: Any) -> None:
        """Where `subprocess` would fork and execute, ask the server; nothing else is different."""
        popen: Any = subprocess.Popen
        told = inspect.signature(popen._execute_child).bind(self, *args).arguments
        given = (told["p2cread"], told["c2pwrite"], told["errwrite"])
        stdin, stdout, stderr = (
            number if stream == -1 else stream for number, stream in enumerate(given)
        )
        words = told["args"][1:]
        server = fork_server()
        with server.fork(
            words,
            (stdin, stdout, stderr),
            environment=told["env"] or os.environ,
            folder=None if told["cwd"] is None else Path(told["cwd"]),
            new_session=told["start_new_session"],
            serving=words[0] == "run",
        ) as answer:
            self.pid = server.pid_from(answer.recv(32))
        self._child_created = True
        pipes = ("p2cread", "p2cwrite", "c2pread", "c2pwrite", "errread", "errwrite")
        popen._close_pipe_fds(self, *(told[pipe] for pipe in pipes))


def run_swarm(
    *words: str, timeout_s: float = 100.0, env: Mapping[str, str] | None = None
) -> subprocess.CompletedProcess[str]:
    """Run a command to its end, with nothing on its standard input."""
    with Swarm(
        words,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env=env,
    ) as process:
        try:
            said, told = process.communicate(timeout=timeout_s)
        finally:
            process.kill()
    return subprocess.CompletedProcess(process.args, process.returncode, said, told)


@cache
def fork_server() -> ForkServer:
    """The server of this process; what is launched within it uses it, too."""
    server = ForkServer.open(_PRELOADED)
    assert server is not None, "tests of processes need Linux"
    atexit.register(server.close)
    ForkServer.shared = server
    return server
