"""Where a recording goes: a file that is written by a thread of its own, about once a second.

Whoever flies never waits for the disk: facts are handed over, and all that costs time
(deriving, encoding, compressing, writing) happens on the thread. After each write the file
is complete, and asked to be on the disk. A disk that is full or fails ends the recording and
nothing else: the file keeps what it held, in order. Leaves out: what is recorded
(coordinator.recording.recorder).
"""

from __future__ import annotations

import contextlib
import os
import queue
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from coordinator.recording.growing_mcap import GrowingMcap, Patch
from swarm.errors import Fault, InputError

__all__ = ["FileSink", "Job", "RecordingThread", "Sink"]

PERIOD_S = 1.0
"""Wall time between two writes."""
MAX_WAITING = 50_000
"""Jobs that wait for a thread that does not keep up, as when a disk hangs; more are lost."""
HUNG_S = 30.0
"""Wall time in which at the end something is written, or nothing more will be."""

Job = Callable[[], None]
"""Something to record: adds messages to the file in the making."""


class Sink(Protocol):
    """Holds a file's bytes."""

    def apply(self, patch: Patch) -> None:
        """Put ``patch`` where it belongs.

        Raises:
            OSError: it has no room, or the disk fails; the file is as it was, if it can be.
        """
        ...

    def close(self) -> None:
        """Nothing more comes."""
        ...


class FileSink:
    """A new file.

    Args:
        path: must not exist: nobody loses an earlier flight's recording by a mistake.

    Raises:
        InputError: the file exists or cannot be made.
    """

    def __init__(self, path: Path) -> None:
        try:
            self._file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644)
        except FileExistsError:
            problem = "exists already, and a recording is never overwritten"
            raise InputError(Fault(str(path), "", problem, "give another name")) from None
        except OSError as fault:
            problem = f"cannot be written: {fault.strerror}"
            remedy = "give the path of a new file in a folder that can be written to"
            raise InputError(Fault(str(path), "", problem, remedy)) from None
        self._size = 0
        self._end = Patch(0, b"")
        """The last patch, which the next one overwrites in part."""

    def apply(self, patch: Patch) -> None:
        """Write ``patch`` and ask for it to be on the disk."""
        try:
            self._write(patch)
            os.fdatasync(self._file)
        except OSError:
            # What was overwritten had its room, so it has it again.
            with contextlib.suppress(OSError):
                kept = self._end.data[patch.offset - self._end.offset :]
                self._write(Patch(patch.offset, kept))
                os.ftruncate(self._file, self._size)
            raise
        self._end, self._size = patch, patch.offset + len(patch.data)

    def close(self) -> None:
        """Close the file."""
        os.close(self._file)

    def _write(self, patch: Patch) -> None:
        written = 0
        while written < len(patch.data):
            rest = memoryview(patch.data)[written:]
            written += os.pwrite(self._file, rest, patch.offset + written)


class RecordingThread:
    """Does jobs in the order they are handed over, and lets the file grow every second.

    Args:
        mcap: the file in the making; touched by jobs and by this thread alone.
        sink: takes its bytes.
        on_fault: called once, from the thread, with the reason why nothing more is recorded.
        last: done after all other jobs.
        patient: whether jobs that there is no room for wait for it, as nobody flies meanwhile.
        period_s: wall time between two writes.
    """

    def __init__(
        self,
        mcap: GrowingMcap,
        sink: Sink,
        *,
        on_fault: Callable[[str], None] = lambda _: None,
        last: Job = lambda: None,
        patient: bool = False,
        period_s: float = PERIOD_S,
    ) -> None:
        self._mcap = mcap
        self._sink = sink
        self._on_fault = on_fault
        self._last = last
        self._period_s = period_s
        self._patient = patient
        self._jobs: queue.Queue[Job] = queue.Queue(MAX_WAITING)
        self._stop = threading.Event()
        self.fault: str | None = None
        """Why nothing more is recorded; None while all is well."""
        self.lost = 0
        """Jobs that there was no room for."""
        self._grow(last=False)  # from the first moment there is a valid file
        self._thread = threading.Thread(target=self._work, name="recording", daemon=True)
        self._thread.start()

    def hand_over(self, job: Job) -> None:
        """Have ``job`` done; returns at once, unless the thread is patient and has no room."""
        if self.fault is not None or self._stop.is_set():
            return
        try:
            self._jobs.put(job, block=self._patient)
        except queue.Full:
            self.lost += 1

    def close(self) -> None:
        """Write all that is left, and wait until it is written; not for a disk that hangs."""
        if not self._stop.is_set():
            self._stop.set()
            while self._thread.is_alive():
                before = self._jobs.qsize()
                self._thread.join(HUNG_S)
                if self._thread.is_alive() and self._jobs.qsize() == before:
                    self._fail("the disk does not answer")
                    return
            self._sink.close()

    def _work(self) -> None:
        while not self._stop.wait(self._period_s):
            self._round(last=False)
        self._round(last=True)

    def _round(self, *, last: bool) -> None:
        try:
            # No more than there are now: new ones come while these are done.
            for _ in range(self._jobs.qsize()):
                job = self._jobs.get_nowait()
                if self.fault is None:
                    job()
            if self.fault is not None:
                return
            if last:
                self._last()
            self._grow(last=last)
        except Exception as fault:  # noqa: BLE001 - top of the thread: the flight must go on
            self._fail(f"{type(fault).__name__}: {fault}")

    def _grow(self, *, last: bool) -> None:
        patch = self._mcap.grow(last=last)
        if patch is None:
            return
        try:
            self._sink.apply(patch)
        except OSError as fault:
            self._fail(fault.strerror or str(fault))

    def _fail(self, why: str) -> None:
        self.fault = why
        self._on_fault(why)
