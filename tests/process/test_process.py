"""A daemon ends when its parent does, and on signals, with the right exit status."""

from __future__ import annotations

import signal
import subprocess
import sys

import pytest

pytestmark = pytest.mark.process

DAEMON = """
import asyncio, sys
from swarm.runtime.process import run_until_stopped

async def work():
    print("ready", flush=True)
    try:
        {body}
    finally:
        print("cleaned", flush=True)

sys.exit(asyncio.run(run_until_stopped(work(), lifeline={lifeline})))
"""
FOREVER = "await asyncio.Event().wait()"
LIMIT_S = 20.0


def start(body: str = FOREVER, *, lifeline: bool = True) -> subprocess.Popen[str]:
    """Start a daemon and wait until it is ready."""
    daemon = subprocess.Popen(
        [sys.executable, "-c", DAEMON.format(body=body, lifeline=lifeline)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert daemon.stdout is not None
    assert daemon.stdout.readline() == "ready\n"
    return daemon


def finish(daemon: subprocess.Popen[str]) -> tuple[int, str, str]:
    """Exit status, rest of standard output and standard error."""
    assert daemon.stdin is not None
    assert daemon.stdout is not None
    assert daemon.stderr is not None
    try:
        daemon.stdin.close()
        status = daemon.wait(LIMIT_S)
        return status, daemon.stdout.read(), daemon.stderr.read()
    finally:
        daemon.kill()
        daemon.wait()
        daemon.stdout.close()
        daemon.stderr.close()


def test_end_of_standard_input_stops_with_status_0() -> None:
    daemon = start()
    assert daemon.stdin is not None
    daemon.stdin.write("what the parent writes is ignored\n" * 1000)
    daemon.stdin.flush()
    assert daemon.poll() is None

    assert finish(daemon) == (0, "cleaned\n", "")


@pytest.mark.parametrize(
    ("number", "status"), [(signal.SIGTERM, 0), (signal.SIGINT, 130)], ids=["SIGTERM", "SIGINT"]
)
@pytest.mark.parametrize("lifeline", [True, False])
def test_signals_stop_with_their_status(
    number: signal.Signals, status: int, lifeline: bool
) -> None:
    daemon = start(lifeline=lifeline)
    daemon.send_signal(number)
    try:
        assert daemon.wait(LIMIT_S) == status
    finally:
        assert finish(daemon) == (status, "cleaned\n", "")


def test_work_that_ends_by_itself_gives_its_own_status() -> None:
    assert finish(start("return 3")) == (3, "cleaned\n", "")


def test_failure_of_the_work_is_not_hidden() -> None:
    status, out, err = finish(start("raise RuntimeError('broken')"))

    assert (status, out) == (1, "cleaned\n")
    assert "RuntimeError: broken" in err


@pytest.mark.parametrize("stdin", ["/dev/null", "regular file", "closed"])
def test_input_without_a_writer_counts_as_ended(stdin: str) -> None:
    code = DAEMON.format(body=FOREVER, lifeline=True)
    if stdin == "closed":
        code = "import os; os.close(0)\n" + code
    with open("/dev/null" if stdin == "/dev/null" else __file__) as file:  # noqa: PTH123 - a device
        ended = subprocess.run(
            [sys.executable, "-c", code],
            check=False,
            stdin=file,
            capture_output=True,
            text=True,
            timeout=LIMIT_S,
        )

    assert (ended.returncode, ended.stderr) == (0, "")


def test_second_interrupt_kills_a_daemon_that_hangs_in_its_clean_up() -> None:
    hanging = """await asyncio.Event().wait()
    except asyncio.CancelledError:
        print("hanging", flush=True)
        await asyncio.sleep(1.5)
        print("insist", flush=True)
        await asyncio.Event().wait()"""
    daemon = start(hanging)
    assert daemon.stdout is not None
    daemon.send_signal(signal.SIGINT)
    assert daemon.stdout.readline() == "hanging\n"
    assert daemon.stdout.readline() == "insist\n"
    daemon.send_signal(signal.SIGINT)
    try:
        assert daemon.wait(LIMIT_S) == -signal.SIGINT
    finally:
        finish(daemon)


LEAVE = """
import threading
from swarm.runtime.process import call_in_background, leave

print("said")
outcome = call_in_background({call}, "maybe hanging")
{then}
leave(5)
"""


@pytest.mark.parametrize(
    ("call", "then"),
    [
        ("threading.Event().wait", ""),
        ("lambda: 42", "assert outcome.result() == 42"),
        ("lambda: 1 / 0", "assert isinstance(outcome.exception(), ZeroDivisionError)"),
    ],
    ids=["hangs", "returns", "raises"],
)
def test_leaving_keeps_status_and_output_whatever_hangs(call: str, then: str) -> None:
    ended = subprocess.run(
        [sys.executable, "-c", LEAVE.format(call=call, then=then)],
        check=False,
        capture_output=True,
        text=True,
        timeout=LIMIT_S,
    )

    assert (ended.returncode, ended.stdout, ended.stderr) == (5, "said\n", "")
