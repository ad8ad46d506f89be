"""A program that knows no lifeline is ended with its launcher all the same."""

from __future__ import annotations

import asyncio
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from sim.fleet import child_process, guard
from sim.fleet.child_process import ChildFailedError, ChildProcess, ProgramEnvironment
from tests.process.mission import alive, child_pids, wait_until

pytestmark = [pytest.mark.process]

SLEEPS = ["/bin/sh", "-c", "echo here; exec sleep 100"]
STUBBORN = ["/bin/sh", "-c", "trap '' TERM; echo here; while :; do sleep 0.1; done"]


def start(command: list[str]) -> tuple[subprocess.Popen[bytes], int]:
    """A guard whose program runs, and the program's pid."""
    guarding = subprocess.Popen(
        [sys.executable, "-I", guard.__file__, *command],
        stdin=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    assert guarding.stderr is not None
    assert guarding.stderr.readline() == b"here\n"
    (program,) = child_pids(guarding.pid).values()
    return guarding, program


def assert_ends(guarding: subprocess.Popen[bytes], program: int) -> None:
    guarding.wait(10)
    wait_until(lambda: not alive(program), 10, "the end of the program")
    for pipe in (guarding.stdin, guarding.stderr):
        assert pipe is not None
        pipe.close()


@pytest.mark.parametrize("command", [SLEEPS, STUBBORN], ids=["sleeps", "stubborn"])
def test_the_end_of_the_lifeline_ends_the_program(command: list[str]) -> None:
    guarding, program = start(command)
    assert guarding.stdin is not None

    guarding.stdin.close()

    assert_ends(guarding, program)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_a_guard_that_is_ended_leaves_no_program(number: signal.Signals) -> None:
    guarding, program = start(SLEEPS)

    guarding.send_signal(number)

    assert_ends(guarding, program)


def child(command: list[str], folder: Path) -> ChildProcess:
    return ChildProcess("program", command, setting=ProgramEnvironment(folder, {"COLOUR": "green"}))


def test_a_program_runs_in_its_folder_with_its_variables(tmp_path: Path) -> None:
    async def work() -> ChildProcess:
        made = child(["/bin/sh", "-c", 'echo "$COLOUR in $(pwd)"; exit 7'], tmp_path)
        await made.start()
        await made.ended()
        return made

    made = asyncio.run(work())

    assert made.fate == "ended with exit status 7"
    assert made.last_words() == f"green in {os.path.realpath(tmp_path)}"


def test_a_program_that_ends_at_once_has_failed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(child_process, "SETTLE_S", 60.0)  # on a busy machine it starts late

    async def work() -> None:
        made = child(["/bin/sh", "-c", "echo bind failed >&2; exit 1"], tmp_path)
        await made.start()
        await made.settled()

    with pytest.raises(ChildFailedError, match="program ended with exit status 1: bind failed"):
        asyncio.run(work())


def test_a_program_that_goes_on_has_settled(tmp_path: Path) -> None:
    async def work() -> ChildProcess:
        made = child(SLEEPS, tmp_path)
        await made.start()
        try:
            await made.settled()
            assert made.returncode is None
        finally:
            await made.stop()
        return made

    made = asyncio.run(work())

    assert made.stopped
    assert list(made.log) == ["here"]
