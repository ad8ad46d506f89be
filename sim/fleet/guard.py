"""Runs a program that knows no lifeline, and ends it when its own standard input ends.

Run this file with the program's command line as arguments. What the program prints goes to
standard error; its exit status becomes this process's. SIGTERM and the end of standard input end
the program, and nobody who kills this process leaves it behind. Imports nothing of this project,
so that a guard costs little.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import subprocess
import sys
import threading
from types import FrameType

TERMINATE_TIMEOUT_S = 2.0
"""Wall time the program may take to leave after SIGTERM; then it is killed."""
_PR_SET_PDEATHSIG = 1
"""Number of prctl(2) by which a process asks for a signal when its parent dies."""


def main(command: list[str]) -> int:
    """Run the program to its end; its exit status."""
    program = subprocess.Popen(  # noqa: S603 - the caller's own command line
        command,
        stdin=subprocess.DEVNULL,
        stdout=sys.stderr.fileno(),
        preexec_fn=_die_with_parent,  # noqa: PLW1509 - no thread has been started yet
    )

    def end(*_: int | FrameType | None) -> None:
        program.terminate()
        killing = threading.Timer(TERMINATE_TIMEOUT_S, program.kill)
        killing.daemon = True
        killing.start()

    def watch() -> None:
        # Not through sys.stdin: its lock, held by a thread, would abort the interpreter's exit.
        while os.read(0, 4096):
            pass
        end()

    signal.signal(signal.SIGTERM, end)
    threading.Thread(target=watch, daemon=True).start()
    status = program.wait()
    return status if status >= 0 else 128 - status


def _die_with_parent() -> None:
    with contextlib.suppress(OSError, AttributeError):  # Linux has it
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
