"""One process that has imported the whole program, and forks the processes of a run from itself.

Most of what a process of a fleet costs at its start is to import what all others import, too. The
server does that once; each process it forks begins where `python -m swarm` would be after its
imports, with standard streams, environment, working folder and session of its own, and is a child
of the process that asked for it: its exit status is read, and it is killed, like any other's.
The server runs one thread only, starts nothing else and ends with whoever has opened it.

On Linux only. Elsewhere, and when the server is gone, processes are started as ever, by exec.
"""

from __future__ import annotations

import atexit
import contextlib
import ctypes
import gc
import importlib
import json
import os
import socket
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar, NoReturn, Self

PRELOADED = (
    "agent.cli",
    "agent.core.agent_core",
    "agent.vehicle.signing",
    "agent.links.mavlink_vehicle",
    "agent.runner",
    "coordinator.core.publication",
    "coordinator.cli",
    "coordinator.core.active",
    "coordinator.dashboard.supervisor",
    "coordinator.planner.plan_report",
    "coordinator.planner.plan",
    "coordinator.daemon",
    "importlib.metadata",
    "numpy.random",
    "pydantic.dataclasses",
    "sim.autopilot.cli",
    "sim.autopilot.faulty_vehicle",
    "sim.autopilot.firmware.ardupilot",
    "sim.autopilot.firmware.px4",
    "sim.autopilot.config",
    "sim.autopilot.options",
    "sim.autopilot.server",
    "structlog",
    "swarm.bus.cli",
    "swarm.bus.router",
    "swarm.bus.zenoh_bus",
    "swarm.cli",
    "swarm.identity",
    "swarm.runtime.log",
    "swarm.runtime.process",
    "swarm.scenario.shapes",
    "swarm.protocol.seal",
    "swarm.runtime.store",
)
"""What routers, autopilots, coordinators and agents import, also inside their commands."""
PRELOADED_FOR_KEYS = ("swarm.bus.tls", "swarm.identity.certificates")
"""What they import besides when they have keys."""

_PR_SET_CHILD_SUBREAPER = 36
"""Number of prctl(2) by which a process becomes the parent of its orphaned descendants."""
_LONGEST_BYTES = 1 << 20
"""Of a request: arguments and environment."""
_TITLE_BYTES = 1 << 14
"""Room for a command line of a forked process, where `ps` looks for it."""


class ForkServerLostError(Exception):
    """The server is gone, or could not do what it was asked."""


class ForkServer:
    """A server in a process of its own, from `open`; it ends at `close`, or with this process.

    Without ``process`` it is another's to end.
    """

    shared: ClassVar[Self | None] = None
    """Given to all who open one in this process."""

    def __init__(
        self, requests: socket.socket, process: subprocess.Popen[bytes] | None = None
    ) -> None:
        self._requests = requests
        self._process = process

    @classmethod
    def open(cls, preloaded: Sequence[str] = PRELOADED) -> Self | None:
        """Start a server, which imports ``preloaded`` meanwhile; None where that cannot be.

        A module that cannot be imported is left to whoever needs it.
        """
        if not _adopts():
            return None
        if cls.shared is not None:
            return cls.shared.another()
        requests, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs:
            number = theirs.fileno()
            told = [str(number), ",".join(preloaded), " " * _TITLE_BYTES]
            process = subprocess.Popen(  # noqa: S603 - this very program
                [sys.executable, "-m", __spec__.name, *told],
                pass_fds=(number,),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                start_new_session=True,
            )
        return cls(requests, process)

    def another(self) -> Self:
        """The same server, which is not ended with what is given."""
        return type(self)(self._requests.dup())

    @property
    def pid(self) -> int | None:
        """Its process; None if it is another's to end."""
        return None if self._process is None else self._process.pid

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the server; what it has forked goes on."""
        self._requests.close()
        if self._process is not None:
            self._process.kill()
            self._process.wait()

    def fork(
        self,
        arguments: Sequence[str],
        streams: tuple[int, int, int],
        *,
        environment: Mapping[str, str],
        folder: Path | None = None,
        new_session: bool = True,
        serving: bool = False,
    ) -> socket.socket:
        """Ask for a process that runs the `swarm` command with these arguments.

        Args:
            arguments: after ``swarm``.
            streams: what its standard input, output and error are; the caller closes its own.
            environment: its variables, all of them.
            folder: its working folder; that of this process if None.
            new_session: whether it leads a session of its own.
            serving: whether it has a server of its own from the beginning, for what it starts.

        Returns:
            A socket on which its process id comes, for `pid_from`.

        Raises:
            ForkServerLostError: nobody can be asked any more.
        """
        request = json.dumps(
            {
                "arguments": list(arguments),
                "environment": dict(environment),
                "folder": str(Path.cwd() if folder is None else folder),
                "new_session": new_session,
                "serving": serving,
            }
        )
        answer, theirs = socket.socketpair()
        with theirs:
            try:
                # Blocks only while more requests wait than the kernel keeps.
                socket.send_fds(self._requests, [request.encode()], [*streams, theirs.fileno()])
            except OSError as error:
                answer.close()
                raise ForkServerLostError(str(error)) from error
        return answer

    @staticmethod
    def pid_from(said: bytes) -> int:
        """The process id that has come.

        Raises:
            ForkServerLostError: none has come.
        """
        if not said:
            raise ForkServerLostError("the fork server ended")
        return int(said)


def _adopts() -> bool:
    """Make this process the parent of what is forked for it; False where that cannot be."""
    if not sys.platform.startswith("linux"):
        return False
    try:
        # By this the end of a process that is no child by `subprocess` can be waited for.
        os.close(os.pidfd_open(os.getpid()))
        adopts: int = ctypes.CDLL(None).prctl(_PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
    except (OSError, AttributeError):
        return False
    return adopts == 0


def _serve(requests: socket.socket) -> dict[str, Any] | None:
    """Fork as asked; what was asked in a forked process, None at the end of the server."""
    while True:
        message, descriptors, _, _ = socket.recv_fds(requests, _LONGEST_BYTES, 4)
        if not message:
            return None
        *streams, answer = descriptors
        told, tell = os.pipe()
        between = os.fork()
        if between == 0:
            child = os.fork()
            if child == 0:
                requests.close()
                for descriptor in (told, tell, answer):
                    os.close(descriptor)
                request: dict[str, Any] = json.loads(message)
                _settle(request, streams)
                return request
            # Its child is an orphan then, whom the nearest subreaper adopts: whoever asked.
            os.write(tell, b"%d" % child)
            os._exit(0)
        os.close(tell)
        with contextlib.suppress(ChildProcessError):  # nobody waits where SIGCHLD is ignored
            os.waitpid(between, 0)
        with contextlib.suppress(OSError):  # whoever asked may have gone
            os.write(answer, os.read(told, 32))
        for descriptor in (told, *descriptors):
            os.close(descriptor)


def _settle(request: Mapping[str, Any], streams: Sequence[int]) -> None:
    """Make a process just forked what it was asked to be."""
    for number, stream in enumerate(streams):
        os.dup2(stream, number)
        os.close(stream)
    if request["new_session"]:
        os.setsid()
    os.chdir(request["folder"])
    os.environ.clear()
    os.environ.update(request["environment"])


def _entitle(words: Sequence[str]) -> None:
    """Show ``words`` as the command line of this process, in place of the server's."""
    try:
        fields = Path("/proc/self/stat").read_text().rpartition(")")[2].split()
        begin, end = int(fields[45]), int(fields[46])
    except (OSError, ValueError, IndexError):
        return
    if not 0 < begin < end:  # some sandboxes do not say
        return
    title = "\0".join(words).encode(errors="surrogateescape")
    ctypes.memmove(begin, title[: end - begin - 1].ljust(end - begin, b"\0"), end - begin)


def _second(requests: socket.socket) -> None:
    """Be the server of the process that has just forked this one."""
    os.setsid()
    nothing = os.open(os.devnull, os.O_RDWR)
    for number in (0, 1):
        os.dup2(nothing, number)
    os.close(nothing)
    _entitle([sys.executable, "-m", __spec__.name, str(requests.fileno())])


def main(number: int, modules: str) -> None:
    """Serve the socket of that number to its end, or run a command in a forked process."""
    requests = socket.socket(fileno=number)
    for module in modules.split(","):
        with contextlib.suppress(ImportError):  # a command tells itself what it misses
            importlib.import_module(module)
    gc.collect()
    gc.freeze()  # so that a collection in a forked process leaves shared memory shared
    while (request := _serve(requests)) is not None:
        if request["serving"]:
            ours, requests = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
            if os.fork() == 0:
                ours.close()
                _second(requests)
                continue
            requests.close()
            ForkServer.shared = ForkServer(ours)
        sys.argv[1:] = request["arguments"]
        _entitle([sys.executable, "-m", "swarm", *sys.argv[1:]])
        _run()


def _run() -> NoReturn:
    """Run the command and leave without taking the interpreter apart.

    Taken apart, it would touch all that was imported, which is shared with the server, and thereby
    copy it: half of what a short command costs.
    """
    from swarm.cli import console_main

    try:
        status = console_main()
    except SystemExit as end:
        if not isinstance(end.code, int):
            raise
        status = end.code
    # As the interpreter does, and there is no public name for either: executors end their threads
    # in the first, and a bus that is still open closes in the second, lest others wait for it.
    threading._shutdown()  # type: ignore[attr-defined]  # noqa: SLF001
    atexit._run_exitfuncs()  # noqa: SLF001
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError, AttributeError):  # closed, or never there
            stream.flush()
    os._exit(status)


if __name__ == "__main__":
    # Under its own name, not as `__main__`, since the command may open a server, too.
    importlib.import_module(__spec__.name).main(int(sys.argv[1]), sys.argv[2])
