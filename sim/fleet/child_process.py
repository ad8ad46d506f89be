"""One child process: started with a lifeline, watched, and always ended.

A child runs in a session of its own, so that Ctrl-C reaches only its parent, which then ends it in
order. Its standard input is a pipe that nobody writes to: however the parent dies, the child sees
the end of it and leaves.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import signal
import sys
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from sim.fleet import guard
from sim.fleet.fork_server import ForkServer, ForkServerLostError
from swarm.runtime.errors import SwarmError

READY_TIMEOUT_S = 30.0
"""Wall time a child may take to say that it is ready."""
SETTLE_S = 1.0
"""Wall time in which a foreign program that cannot run at all, as its port is taken, ends."""
TERMINATE_TIMEOUT_S = 4.0
"""Wall time a child may take to leave after SIGTERM; then it is killed."""
RETURN_TIMEOUT_S = 17.0
"""Wall time an agent may take to leave, if it has a real vehicle to send home."""
KILL_TIMEOUT_S = 4.0
"""Wall time the kernel may take to end it and close its pipes after SIGKILL; then it is left."""
UNKNOWN_STATUS = 255
"""Of a child whose end only the kernel has seen."""
KEPT_LINES = 200
"""Lines of a child's log that are kept to explain its end."""
KEYS_VARIABLE = "SWARM_KEYS"
"""Stands for `--keys` of a command; each child has keys of its own, or none."""
LINE_LIMIT_BYTES = 4 * 1024 * 1024
"""Longest line a child may write: a plan of a large mission on one line."""


class ChildFailedError(SwarmError):
    """A child ended, or stayed silent, before it was ready."""


@dataclass(frozen=True, slots=True)
class ProgramEnvironment:
    """In what a program runs that is not `swarm`."""

    folder: Path
    """Its working folder."""
    environment: Mapping[str, str]
    """Variables beside those of this process."""


class _Forked:
    """A process that the fork server has made for us, shown as asyncio shows those it starts."""

    def __init__(self, pid: int, stdin: int) -> None:
        self.pid = pid
        self.returncode: int | None = None
        self.stdin = os.fdopen(stdin, "wb", buffering=0)
        self.stdout = asyncio.StreamReader(limit=LINE_LIMIT_BYTES)
        self.stderr = asyncio.StreamReader(limit=LINE_LIMIT_BYTES)
        self._pipes: list[asyncio.ReadTransport] = []
        self._ended = asyncio.Event()

    @classmethod
    async def start(
        cls, server: ForkServer, arguments: Sequence[str], environment: Mapping[str, str]
    ) -> _Forked:
        (stdin, near_in), (near_out, stdout), (near_err, stderr) = (os.pipe() for _ in range(3))
        try:
            with server.fork(arguments, (stdin, stdout, stderr), environment=environment) as answer:
                answer.setblocking(False)
                said = await asyncio.get_running_loop().sock_recv(answer, 32)
            pid = server.pid_from(said)
        except BaseException:
            for descriptor in (near_in, near_out, near_err):
                os.close(descriptor)
            raise
        finally:
            for descriptor in (stdin, stdout, stderr):
                os.close(descriptor)
        forked = cls(pid, near_in)
        await forked._watch(near_out, near_err)
        return forked

    async def _watch(self, *outputs: int) -> None:
        loop = asyncio.get_running_loop()
        end = os.pidfd_open(self.pid)
        loop.add_reader(end, self._note_end, end)
        for output, reader in zip(outputs, (self.stdout, self.stderr), strict=True):
            pipe, _ = await loop.connect_read_pipe(
                partial(asyncio.StreamReaderProtocol, reader),
                os.fdopen(output, "rb", buffering=0),
            )
            self._pipes.append(pipe)

    def _note_end(self, end: int) -> None:
        asyncio.get_running_loop().remove_reader(end)
        os.close(end)
        try:
            _, status = os.waitpid(self.pid, 0)
            self.returncode = os.waitstatus_to_exitcode(status)
        except ChildProcessError:  # where SIGCHLD is ignored nobody learns more, as in asyncio
            self.returncode = UNKNOWN_STATUS
        self._ended.set()

    async def wait(self) -> int:
        await self._ended.wait()
        assert self.returncode is not None  # noqa: S101 - set together with the event
        return self.returncode

    def send_signal(self, number: signal.Signals) -> None:
        if self.returncode is None:
            os.kill(self.pid, number)

    def close(self) -> None:
        """Give up its pipes, which others may hold open."""
        self.stdin.close()
        for pipe in self._pipes:
            pipe.close()


class ChildProcess:
    """One `swarm` command, or another program under a guard, as a process.

    Args:
        name: what people call it.
        arguments: of the `swarm` command; ``--lifeline`` is added. Of another program
            its whole command line.
        on_line: called with every JSON object the child prints on standard output.
        on_log: called with its name and every line of its standard error.
        setting: of another program than `swarm`.
        returns: it has a real vehicle to send home before it leaves.
        server: forks a `swarm` command, as long as it can.
    """

    def __init__(
        self,
        name: str,
        arguments: Sequence[str],
        *,
        on_line: Callable[[dict[str, Any]], None] | None = None,
        on_log: Callable[[str, str], None] | None = None,
        setting: ProgramEnvironment | None = None,
        returns: bool = False,
        server: ForkServer | None = None,
    ) -> None:
        self.name = name
        self.arguments = tuple(arguments)
        self.setting = setting
        self.log: deque[str] = deque(maxlen=KEPT_LINES)
        """Newest lines of its standard error."""
        self.stopped = False
        """Whether we ended it, or told it to end, ourselves."""
        self._returns = returns
        self._server = server
        self._on_line = on_line
        self._on_log = on_log
        self._process: asyncio.subprocess.Process | _Forked | None = None
        self._readers: list[asyncio.Task[None]] = []
        self._lines: asyncio.Queue[dict[str, Any] | None] = asyncio.Queue()
        """What it prints; None when it prints no more."""

    @property
    def pid(self) -> int:
        """Process id."""
        return self._started.pid

    @property
    def returncode(self) -> int | None:
        """Exit status, negative for a signal; None while it runs."""
        return self._started.returncode

    @property
    def fate(self) -> str:
        """How it ended, in words."""
        code = self.returncode
        if code is None:
            return "runs"
        if code >= 0:
            return f"ended with exit status {code}"
        with contextlib.suppress(ValueError):
            return f"killed by {signal.Signals(-code).name}"
        return f"killed by signal {-code}"

    async def start(self) -> None:
        """Start it; returns at once. One that is started while this is cancelled is killed."""
        starting = asyncio.ensure_future(self._start())
        try:
            await asyncio.shield(starting)
        except asyncio.CancelledError:
            await starting  # whoever was cancelled does not know of it: nobody else would end it
            await self.kill()
            raise

    async def _start(self) -> None:
        self._process = await self._forked() or await self._executed()
        loop = asyncio.get_running_loop()
        self._readers = [loop.create_task(self._read_out()), loop.create_task(self._read_err())]

    async def _forked(self) -> _Forked | None:
        if self._server is None or self.setting is not None:
            return None
        with contextlib.suppress(ForkServerLostError):
            words = [*self.arguments, "--lifeline"]
            return await _Forked.start(self._server, words, self._environment())
        return None

    async def _executed(self) -> asyncio.subprocess.Process:
        setting = self.setting
        if setting is None:
            command = [sys.executable, "-m", "swarm", *self.arguments, "--lifeline"]
        else:
            command = [sys.executable, "-I", guard.__file__, *self.arguments]
        return await asyncio.create_subprocess_exec(
            *command,
            cwd=None if setting is None else setting.folder,
            env=self._environment(),
            stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.PIPE,
            start_new_session=True,
            limit=LINE_LIMIT_BYTES,
        )

    def _environment(self) -> dict[str, str]:
        """Variables of this process, but for those that would speak to each child alike."""
        inherited = {name: value for name, value in os.environ.items() if name != KEYS_VARIABLE}
        return inherited if self.setting is None else {**inherited, **self.setting.environment}

    async def ready(self, count: int = 1) -> list[dict[str, Any]]:
        """The first ``count`` JSON objects it prints.

        Raises:
            ChildFailedError: it ended or said nothing in time.
        """
        said: list[dict[str, Any]] = []
        try:
            async with asyncio.timeout(READY_TIMEOUT_S):
                while len(said) < count:
                    if (line := await self._lines.get()) is None:
                        self._lines.put_nowait(None)
                        await self.ended()
                        raise self._failure()
                    said.append(line)
        except TimeoutError:
            raise ChildFailedError(
                f"{self.name} was not ready within {READY_TIMEOUT_S:g} s: {self.last_words()}"
            ) from None
        return said

    async def settled(self) -> None:
        """Wait a moment, in which a program that cannot run at all ends.

        Raises:
            ChildFailedError: it has ended.
        """
        # Unlike the process, the wait is cancelled at the end of that time.
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(SETTLE_S):
                await self.ended()
                raise self._failure()

    def _failure(self) -> ChildFailedError:
        return ChildFailedError(f"{self.name} {self.fate}: {self.last_words()}")

    async def ended(self) -> int:
        """Wait for its end and for all it had to say; its exit status."""
        code = await self._started.wait()
        # Unlike a gathering, a wait that is cancelled lets the readers go on.
        await asyncio.wait(self._readers)
        return code

    async def stop(self) -> None:
        """End it: SIGTERM, and SIGKILL if it does not listen. Its log is complete then."""
        if self._process is None:
            return
        if self.returncode is None:
            self.stopped = True
            self._signal(signal.SIGTERM)
            limit_s = RETURN_TIMEOUT_S if self._returns else TERMINATE_TIMEOUT_S
            try:
                async with asyncio.timeout(limit_s):
                    await self._process.wait()
            except TimeoutError:
                self._signal(signal.SIGKILL)
        await self._gone()
        if self._process.stdin is not None:
            self._process.stdin.close()

    async def kill(self) -> None:
        """End it at once, by SIGKILL, as a crash would. Its log is complete then."""
        if self.returncode is None:
            self.stopped = True
            self._signal(signal.SIGKILL)
        await self._gone()

    def pause(self) -> None:
        """Stop it in its tracks, by SIGSTOP: it hangs, and all its connections stay open."""
        self._signal(signal.SIGSTOP)

    def resume(self) -> None:
        """Let it go on after `pause`."""
        self._signal(signal.SIGCONT)

    def _signal(self, number: signal.Signals) -> None:
        with contextlib.suppress(ProcessLookupError):
            self._started.send_signal(number)

    async def _gone(self) -> None:
        """Wait for its end and its last words, but not for ever.

        What it has started itself may hold its pipes open; that ends with it. A process that
        waits for a device in the kernel dies only when that answers: it is left.
        """
        for last_try in (False, True):
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(KILL_TIMEOUT_S):
                    await self.ended()
                    break
            if not last_try:
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(self.pid, signal.SIGKILL)
        for reader in self._readers:
            reader.cancel()
        await asyncio.gather(*self._readers, return_exceptions=True)
        if isinstance(self._process, _Forked):
            self._process.close()

    def last_words(self) -> str:
        """The last line of its log."""
        return self.log[-1] if self.log else "it left no message"

    @property
    def _started(self) -> asyncio.subprocess.Process | _Forked:
        if self._process is None:
            raise ValueError(f"{self.name} has not been started")
        return self._process

    async def _read_out(self) -> None:
        stream = self._started.stdout
        try:
            while stream is not None and (line := await stream.readline()):
                try:
                    said = json.loads(line)
                except ValueError:
                    continue
                if isinstance(said, dict):
                    self._lines.put_nowait(said)
                    if self._on_line is not None:
                        self._on_line(said)
        finally:
            self._lines.put_nowait(None)

    async def _read_err(self) -> None:
        stream = self._started.stderr
        while stream is not None and (line := await stream.readline()):
            text = line.decode(errors="replace").rstrip()
            self.log.append(text)
            if self._on_log is not None:
                self._on_log(self.name, text)
