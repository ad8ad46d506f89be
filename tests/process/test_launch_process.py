"""A child says when it is ready, explains its failure, and always ends."""

from __future__ import annotations

import asyncio
import os
import signal
import sys
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest

from sim.fleet import child_process
from sim.fleet.child_process import ChildFailedError, ChildProcess
from tests.process.mission import alive, wait_until

pytestmark = pytest.mark.process

ROUTER = ["router", "--listen", "tcp/127.0.0.1:0", "--json"]
LIMIT_S = 40.0


def play(scenario: Callable[[], Awaitable[None]]) -> None:
    async def watched() -> None:
        async with asyncio.timeout(LIMIT_S):
            await scenario()
        left = asyncio.all_tasks() - {asyncio.current_task()}
        assert not left, f"still running: {left}"

    asyncio.run(watched())


@asynccontextmanager
async def started(child: ChildProcess) -> AsyncIterator[ChildProcess]:
    """The child at work; it is ended whatever happens."""
    await child.start()
    try:
        yield child
    finally:
        await child.stop()
        assert not alive(child.pid)


def script(monkeypatch: pytest.MonkeyPatch, folder: Path, body: str) -> None:
    """Let a child run ``body`` in place of Python, whatever its arguments."""
    stand_in = folder / "stand-in"
    stand_in.write_text(f"#!/bin/sh\n{body}\n")
    stand_in.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(stand_in))


def test_a_child_tells_that_it_is_ready_and_leaves_when_told() -> None:
    lines: list[dict[str, Any]] = []

    async def scenario() -> None:
        async with started(ChildProcess("router", ROUTER, on_line=lines.append)) as child:
            (said,) = await child.ready()
            assert said["endpoints"][0].startswith("tcp/127.0.0.1:")
            assert lines == [said]
            assert child.returncode is None
            assert child.fate == "runs"

            await child.stop()
            assert child.returncode == 0
            assert child.stopped
            assert child.fate == "ended with exit status 0"

    play(scenario)


def test_wrong_usage_is_told_in_the_childs_last_words() -> None:
    logged: list[tuple[str, str]] = []

    def on_log(name: str, line: str) -> None:
        logged.append((name, line))

    async def scenario() -> None:
        arguments = ["coordinator", "no-such.toml"]
        async with started(ChildProcess("coordinator", arguments, on_log=on_log)) as child:
            with pytest.raises(ChildFailedError, match=r"no-such\.toml") as told:
                await child.ready()

            assert str(told.value).startswith("coordinator ended with exit status 2: ")
            assert str(told.value).endswith(child.last_words())
            assert ("coordinator", child.last_words()) in logged
            assert not child.stopped

    play(scenario)


def test_a_child_that_ends_after_its_words_is_heard_to_the_end(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    script(monkeypatch, tmp_path, """echo '{"a": 1}'; seq 1 20000 >&2; echo '{"b": 2}'; exit 3""")

    async def scenario() -> None:
        async with started(ChildProcess("talker", [])) as child:
            assert await child.ready() == [{"a": 1}]
            assert await child.ended() == 3
            assert child.last_words() == "20000"
            assert await child.ready() == [{"b": 2}]
            await child.stop()
            assert not child.stopped

    play(scenario)


def test_to_stop_waiting_for_the_end_does_not_stop_the_reading(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    script(monkeypatch, tmp_path, "read -r go; echo the end >&2")

    async def scenario() -> None:
        async with started(ChildProcess("talker", [])) as child:
            process_ended = asyncio.get_running_loop().create_future()
            process_ended.set_result(0)
            monkeypatch.setattr(child._started, "wait", lambda: process_ended)
            waiting = asyncio.create_task(child.ended())
            await asyncio.sleep(0.1)
            waiting.cancel()
            await asyncio.gather(waiting, return_exceptions=True)
            monkeypatch.undo()
            assert child._started.stdin is not None
            child._started.stdin.write(b"go\n")
            await child.ended()
            assert child.last_words() == "the end"

    play(scenario)


def test_a_child_that_says_too_little_before_it_ends_has_failed(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    script(monkeypatch, tmp_path, "echo '{}'; echo enough >&2")

    async def scenario() -> None:
        async with started(ChildProcess("talker", [])) as child:
            with pytest.raises(ChildFailedError, match="talker ended with exit status 0: enough"):
                await child.ready(2)

    play(scenario)


def test_a_silent_child_is_not_waited_for_longer_than_stated(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    script(monkeypatch, tmp_path, "echo thinking >&2; exec cat")
    monkeypatch.setattr(child_process, "READY_TIMEOUT_S", 1.0)

    async def scenario() -> None:
        async with started(ChildProcess("thinker", [])) as child:
            with pytest.raises(ChildFailedError, match="not ready within 1 s: thinking"):
                await child.ready()
            others = asyncio.all_tasks() - {asyncio.current_task(), *child._readers}
            assert not others, f"still waiting: {others}"

    play(scenario)


def test_a_child_that_does_not_listen_is_killed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(child_process, "TERMINATE_TIMEOUT_S", 0.3)

    async def scenario() -> None:
        async with started(ChildProcess("router", ROUTER)) as child:
            await child.ready()
            os.kill(child.pid, signal.SIGSTOP)
            await child.stop()

            assert child.returncode == -signal.SIGKILL
            assert child.fate == "killed by SIGKILL"
            assert child.stopped

    play(scenario)


def test_a_child_that_was_killed_by_somebody_says_so() -> None:
    async def scenario() -> None:
        async with started(ChildProcess("router", ROUTER)) as child:
            await child.ready()
            os.kill(child.pid, signal.SIGKILL)

            assert await child.ended() == -signal.SIGKILL
            assert child.fate == "killed by SIGKILL"
            await child.stop()
            assert not child.stopped

    play(scenario)


def test_a_child_killed_by_us_is_gone_and_was_stopped() -> None:
    async def scenario() -> None:
        async with started(ChildProcess("router", ROUTER)) as child:
            await child.ready()
            await child.kill()
            assert child.returncode == -signal.SIGKILL
            assert child.stopped
            child.resume()  # the dead hear nothing
            await child.kill()

    play(scenario)


def test_a_paused_child_hangs_until_it_is_resumed() -> None:
    async def scenario() -> None:
        async with started(ChildProcess("router", ROUTER)) as child:
            await child.ready()
            child.pause()
            child._signal(signal.SIGTERM)
            await asyncio.sleep(0.5)
            assert child.returncode is None
            child.resume()
            assert await child.ended() == 0

    play(scenario)


def test_what_a_child_has_started_itself_ends_with_it(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    script(monkeypatch, tmp_path, "sleep 60 & echo $! >&2; echo {}; exec cat")
    monkeypatch.setattr(child_process, "TERMINATE_TIMEOUT_S", 0.3)
    monkeypatch.setattr(child_process, "KILL_TIMEOUT_S", 0.3)

    async def scenario() -> None:
        child = ChildProcess("parent", [])
        await child.start()
        assert await child.ready() == [{}]
        begin_s = asyncio.get_running_loop().time()
        await child.stop()
        assert asyncio.get_running_loop().time() - begin_s < 20.0
        orphan = int(child.log[0])
        await asyncio.to_thread(wait_until, lambda: not alive(orphan), 10.0, "the end of the child")

    play(scenario)


def test_a_child_leaves_when_its_parent_closes_the_lifeline() -> None:
    async def scenario() -> None:
        async with started(ChildProcess("router", ROUTER)) as child:
            await child.ready()
            assert child._process is not None
            assert child._process.stdin is not None
            child._process.stdin.close()

            assert await child.ended() == 0

    play(scenario)


def test_what_is_no_json_object_is_passed_over(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    words = r"""printf 'hello\n[1]\n\377\n{"half": \n"text"\n{"a": 1}\n{"b": 2}'"""
    script(monkeypatch, tmp_path, words)

    async def scenario() -> None:
        async with started(ChildProcess("talker", [])) as child:
            assert await child.ready(2) == [{"a": 1}, {"b": 2}]

    play(scenario)


def test_only_the_newest_lines_of_a_log_are_kept(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    script(monkeypatch, tmp_path, "seq 1 1000 >&2")

    async def scenario() -> None:
        async with started(ChildProcess("talker", [])) as child:
            await child.ended()
            assert list(child.log) == [str(n) for n in range(801, 1001)]

    play(scenario)


def test_a_child_that_was_never_started_can_be_stopped_but_not_asked() -> None:
    async def scenario() -> None:
        child = ChildProcess("nobody", [])
        await child.stop()
        assert child.last_words() == "it left no message"
        with pytest.raises(ValueError, match="has not been started"):
            _ = child.pid

    play(scenario)
