"""The whole suite, as `make test` runs it: flights, and beside them, in their pauses, all else.

    python -m tests.whole

Flights of real processes wait for most of the time, so everything else runs along with them on
the same processors, at the lowest priority that there is: whenever a flight wants to go on, it
goes first. What the flights say is shown as they say it, what the other part says once both are
done; last comes the closing line of the flights. Exit status 1 if either part fails.
"""

from __future__ import annotations

import contextlib
import subprocess
import sys
import tempfile
from pathlib import Path

__all__ = ["main"]

PYTEST = [sys.executable, "-m", "pytest"]
FLIGHTS = [*PYTEST, "-n", "3", "--dist", "worksteal", "tests/process", "tests/sitl"]
ALL_ELSE = [*PYTEST, "-n", "2", "tests/unit", "tests/contract", "tests/faults"]


def main() -> int:
    """Run both parts; the exit status."""
    with tempfile.TemporaryFile("w+", encoding="utf-8") as said:
        beside = subprocess.Popen(
            ["nice", "-n", "19", *ALL_ELSE],  # noqa: S607 - every Unix has it on its path
            stdout=said,
            stderr=said,
            start_new_session=True,
        )
        try:
            # Linux counts the priority of each session, too, where it schedules by sessions.
            with contextlib.suppress(OSError):
                Path(f"/proc/{beside.pid}/autogroup").write_text("19")
            status, closing = _shown(FLIGHTS)
            status = beside.wait() or status
        finally:
            if beside.poll() is None:  # interrupted
                beside.terminate()
                beside.wait()
        said.seek(0)
        print(said.read(), end="")
    print(closing, end="", flush=True)
    return 1 if status else 0


def _shown(command: list[str]) -> tuple[int, str]:
    """Exit status and last line of ``command``; the lines before are shown as they come."""
    last = ""
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as running:
        assert running.stdout is not None
        for line in running.stdout:
            print(last, end="", flush=True)
            last = line
    return running.returncode, last


if __name__ == "__main__":
    sys.exit(main())
