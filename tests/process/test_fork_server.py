"""Processes that the fork server makes are like those that are executed, but sooner there."""

from __future__ import annotations

import asyncio
import importlib.util
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from sim.fleet.child_process import ChildProcess
from sim.fleet.fork_server import PRELOADED, PRELOADED_FOR_KEYS, ForkServer, ForkServerLostError
from tests.process.mission import alive, wait_until
from tests.process.programs import Swarm, run_swarm

pytestmark = [pytest.mark.process]

ROUTER = ["router", "--listen", "tcp/127.0.0.1:0", "--json"]
LIMIT_S = 60.0
OPENS = """
import sys
from sim.fleet.fork_server import ForkServer
server = ForkServer.open()
print(server.pid, flush=True)
sys.stdin.read()
"""


@pytest.fixture(scope="module")
def server() -> Iterator[ForkServer]:
    """One that this test has started, as `swarm run` does."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ForkServer, "shared", None)
        server = ForkServer.open((*PRELOADED, *PRELOADED_FOR_KEYS))
    assert server is not None
    with server:
        yield server


def stat(pid: int) -> list[str]:
    """State, parent, process group, session and so on of a process."""
    return (Path("/proc") / str(pid) / "stat").read_text().rpartition(")")[2].split()


@pytest.mark.parametrize("module", [*PRELOADED, *PRELOADED_FOR_KEYS])
def test_what_is_to_be_preloaded_is_there(module: str) -> None:
    assert importlib.util.find_spec(module) is not None


def test_what_is_preloaded_starts_no_thread(server: ForkServer) -> None:
    """Else what a thread holds at the time of a fork would be held for ever in the child."""

    async def scenario() -> None:
        child = ChildProcess("router", ROUTER, server=server)
        await child.start()
        await child.ready()
        await child.stop()

    asyncio.run(scenario())
    assert server.pid is not None
    assert len(list((Path("/proc") / str(server.pid) / "task").iterdir())) == 1


@pytest.mark.parametrize("forked", [True, False])
def test_nothing_lives_on_whose_start_was_cancelled(server: ForkServer, *, forked: bool) -> None:
    async def scenario() -> ChildProcess:
        child = ChildProcess("router", ROUTER, server=server if forked else None)
        starting = asyncio.ensure_future(child.start())
        await asyncio.sleep(0)  # it has begun
        starting.cancel()
        with pytest.raises(asyncio.CancelledError):
            await starting
        return child

    assert asyncio.run(scenario()).returncode == -signal.SIGKILL


def test_a_forked_child_is_ours_in_a_session_of_its_own_under_its_own_name(
    server: ForkServer,
) -> None:
    async def scenario() -> None:
        child = ChildProcess("router", ROUTER, server=server)
        async with asyncio.timeout(LIMIT_S):
            await child.start()
            try:
                (said,) = await child.ready()
                assert said["endpoints"][0].startswith("tcp/127.0.0.1:")
                _, parent, _, session, *_ = stat(child.pid)
                assert (int(parent), int(session)) == (os.getpid(), child.pid)
                line = (Path("/proc") / str(child.pid) / "cmdline").read_bytes().decode()
                words = [sys.executable, "-m", "swarm", *ROUTER, "--lifeline"]
                assert line.rstrip("\0").split("\0") == words
            finally:
                await child.stop()
        assert (child.returncode, child.stopped) == (0, True)
        assert not alive(child.pid)

    asyncio.run(scenario())


def test_its_end_is_told_as_it_was(server: ForkServer) -> None:
    async def ends(words: list[str], number: signal.Signals | None) -> int:
        child = ChildProcess("child", words, server=server)
        async with asyncio.timeout(LIMIT_S):
            await child.start()
            try:
                if number is not None:
                    await child.ready()
                    os.kill(child.pid, number)
                return await child.ended()
            finally:
                await child.stop()

    wrong = ["router", "--listen", "nowhere"]
    assert asyncio.run(ends(wrong, None)) == 2
    assert asyncio.run(ends(ROUTER, signal.SIGINT)) == 130
    assert asyncio.run(ends(ROUTER, signal.SIGKILL)) == -signal.SIGKILL


def test_it_leaves_when_its_parent_closes_the_lifeline(server: ForkServer) -> None:
    async def scenario() -> None:
        child = ChildProcess("router", ROUTER, server=server)
        async with asyncio.timeout(LIMIT_S):
            await child.start()
            try:
                await child.ready()
                assert child._process is not None
                assert child._process.stdin is not None
                child._process.stdin.close()
                assert await child.ended() == 0
            finally:
                await child.stop()

    asyncio.run(scenario())


def test_without_its_server_a_child_is_executed() -> None:
    async def scenario() -> None:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(ForkServer, "shared", None)
            server = ForkServer.open(())
        assert server is not None
        server.close()
        with pytest.raises(ForkServerLostError):
            server.fork(ROUTER, (0, 1, 2), environment={})
        child = ChildProcess("router", ROUTER, server=server)
        async with asyncio.timeout(LIMIT_S):
            await child.start()
            await child.ready()
            await child.stop()
        assert child.returncode == 0

    asyncio.run(scenario())


def test_a_server_ends_with_whoever_opened_it() -> None:
    with subprocess.Popen(
        [sys.executable, "-c", OPENS], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as opener:
        assert opener.stdout is not None
        pid = int(opener.stdout.readline())
        assert alive(pid)
        opener.kill()
    wait_until(lambda: not alive(pid), LIMIT_S, "the end of the server")


def test_environment_and_folder_of_a_forked_command_are_those_given(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text("no scenario at all")
    with Swarm(
        ["plan", "mine.toml", "--json"],
        cwd=tmp_path,
        env={**os.environ, "NO_COLOR": "1"},
        stderr=subprocess.PIPE,
    ) as process:
        _, told = process.communicate(timeout=LIMIT_S)
    assert process.returncode == 2
    assert told.startswith("mine.toml")


def test_whoever_is_forked_has_a_chance_of_its_own(tmp_path: Path) -> None:
    """Two processes of one image draw different keys, as those of two interpreters do."""
    authorities = []
    for name in ("one", "other"):
        folder = tmp_path / name
        done = run_swarm("keys", "init", "table-1", "--out", str(folder))
        assert done.returncode == 0, done.stderr
        authorities.append((folder / "authority.pem").read_bytes())
    assert authorities[0] != authorities[1]
