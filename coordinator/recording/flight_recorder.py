"""A recording in the making: a file that a thread of its own writes, about once a second.

Whoever flies never waits for the disk: facts are handed over, and all that costs time (deriving,
encoding, compressing, writing) happens on the thread. After each write the file is complete, and
asked to be on the disk. A disk that is full or fails ends the recording and nothing else: the file
keeps what it held, in order.
"""

from __future__ import annotations

import contextlib
import os
import queue
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Protocol, TypeVar

from coordinator.mission_view.mission_state import MissionState
from coordinator.recording.growing_mcap import GrowingMcap, Patch
from coordinator.recording.recorder import (
    RecordedCore,
    Recorder,
    RecordingInfo,
    new_mcap,
)
from coordinator.recording.records import RecordableFact
from swarm.protocol.events import CommonEvent
from swarm.runtime.clock import SystemClock, unix_s
from swarm.runtime.errors import Fault, InputError
from swarm.runtime.shell import Core

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
        on_fault: called once, from the thread, with the reason why nothing more is recorded.
        last: done after all other jobs.
        patient: whether jobs that there is no room for wait for it, as nobody flies meanwhile.
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


A = TypeVar("A")


def wall_ns() -> Callable[[float], int]:
    """Wall time from now on, which goes on evenly whoever sets the machine's clock."""
    clock = SystemClock()
    began_ns = round((unix_s() - clock.now_s()) * 1e9)
    return lambda _: began_ns + round(clock.now_s() * 1e9)


def virtual_ns(now_s: float) -> int:
    """Virtual time as a recording has it: from nought."""
    return round(now_s * 1e9)


@contextlib.contextmanager
def recording_to(
    path: Path,
    about: RecordingInfo,
    time_ns: Callable[[float], int],
    say: Callable[[str], None],
    *,
    patient: bool = False,
) -> Iterator[FlightRecorder]:
    """Record into a new file while the context lasts; then it is closed.

    ``say`` is given a line when not everything is recorded, maybe from another thread. For
    ``time_ns`` and ``patient`` see `FlightRecorder` and `RecordingThread`.

    Raises:
        InputError: the file exists or cannot be made.
    """

    def fail(why: str) -> None:
        say(f"{path}: nothing more is recorded: {why}; the flight goes on")

    recorder = FlightRecorder(about, FileSink(path), time_ns, fail, patient=patient)
    try:
        yield recorder
    finally:
        recorder.close()
        if recorder.lost:
            say(f"{path}: {recorder.fault}")


class FlightRecorder:
    """Takes facts and logs down, on a thread of its own; close it in ``finally``.

    Args:
        time_ns: wall time for people and their tools, given the core's time [s -> ns].
        on_fault: called once, from the thread, with the reason why nothing more is recorded.
    """

    def __init__(
        self,
        about: RecordingInfo,
        sink: Sink,
        time_ns: Callable[[float], int],
        on_fault: Callable[[str], None] = lambda _: None,
        *,
        patient: bool = False,
    ) -> None:
        self.about = about
        self._mcap = new_mcap(about)
        self._recorder = Recorder(about, self._mcap)
        self._time_ns = time_ns
        self._thread = RecordingThread(
            self._mcap,
            sink,
            on_fault=on_fault,
            last=self._recorder.draw,
            patient=patient,
        )
        self._begun_ns: int | None = None
        self._last_ns = 0

    def around(self, core: Core[CommonEvent, A], mission_state: MissionState) -> RecordedCore[A]:
        """``core``, with all it hears written down, and the plans ``mission_state`` is given."""
        return RecordedCore(core, self, mission_state)

    def note(self, what: RecordableFact, now_s: float) -> None:
        """Write a fact down; returns at once."""
        time_ns = self._stamp(now_s)
        self._thread.hand_over(lambda: self._recorder.note(what, now_s, time_ns))

    def log(self, name: str, line: str, now_s: float) -> None:
        """Write down a line that a process has logged; returns at once."""
        time_ns = self._stamp(now_s)
        self._thread.hand_over(lambda: self._recorder.log(name, line, time_ns))

    def close(self) -> None:
        """Write what is left; the file is whole then, unless there is a `fault`."""
        self._thread.close()

    @property
    def fault(self) -> str | None:
        """Why not everything is recorded; None if it is."""
        if self._thread.fault is not None:
            return self._thread.fault
        return f"the disk was too slow: {self.lost} facts are missing" if self.lost else None

    @property
    def lost(self) -> int:
        """Facts that were not written down, since the disk did not keep up."""
        return self._thread.lost

    @property
    def told(self) -> str:
        """How much has been written, in words."""
        mcap = self._mcap
        size = mcap.size_bytes
        shown = f"{size / 1e6:.1f} MB" if size >= 1e5 else f"{size / 1e3:.1f} kB"
        lasted_s = 0.0 if self._begun_ns is None else (self._last_ns - self._begun_ns) / 1e9
        return f"{mcap.messages} messages over {lasted_s:.1f} s, {shown}"

    def _stamp(self, now_s: float) -> int:
        self._last_ns = self._time_ns(now_s)
        if self._begun_ns is None:
            self._begun_ns = self._last_ns
        return self._last_ns
