"""A recording in the making, as the process that makes it sees it.

Leaves out: what is written (coordinator.recording.recorder) and how
(coordinator.recording.recording_file).
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TypeVar

from coordinator.observer import Observer
from coordinator.recording.recorded_core import RecordedCore
from coordinator.recording.recorder import About, Recorder
from coordinator.recording.recording_file import FileSink, RecordingThread, Sink
from coordinator.recording.records import Recorded
from swarm.clock import SystemClock, unix_s
from swarm.events import BusFact
from swarm.shell import Core

__all__ = ["FlightRecorder", "recording_or_none", "recording_to", "virtual_ns", "wall_ns"]

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
    about: About,
    time_ns: Callable[[float], int],
    say: Callable[[str], None],
    *,
    patient: bool = False,
) -> Iterator[FlightRecorder]:
    """Record into a new file while the context lasts; then it is closed.

    Args:
        path: of the file.
        about: what is recorded.
        time_ns: see `FlightRecorder`.
        say: given a line when not everything is recorded; maybe from another thread.
        patient: see `RecordingThread`.

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


def recording_or_none(
    path: Path | None,
    about: About,
    time_ns: Callable[[float], int],
    say: Callable[[str], None],
) -> contextlib.AbstractContextManager[FlightRecorder | None]:
    """`recording_to`, or nothing where there is no path."""
    if path is None:
        return contextlib.nullcontext()
    return recording_to(path, about, time_ns, say)


class FlightRecorder:
    """Takes facts and logs down, on a thread of its own; close it in ``finally``.

    Args:
        about: what is recorded.
        sink: takes the file's bytes, such as a `FileSink`.
        time_ns: wall time for people and their tools, given the core's time [s -> ns].
        on_fault: called once, from the thread, with the reason why nothing more is recorded.
        patient: see `RecordingThread`.
    """

    def __init__(
        self,
        about: About,
        sink: Sink,
        time_ns: Callable[[float], int],
        on_fault: Callable[[str], None] = lambda _: None,
        *,
        patient: bool = False,
    ) -> None:
        self.about = about
        self._recorder = Recorder(about)
        self._time_ns = time_ns
        self._thread = RecordingThread(
            self._recorder.mcap,
            sink,
            on_fault=on_fault,
            last=self._recorder.draw,
            patient=patient,
        )
        self._begun_ns: int | None = None
        self._last_ns = 0

    def around(self, core: Core[BusFact, A], observer: Observer) -> RecordedCore[A]:
        """``core``, with all it hears written down, and the plans ``observer`` is given."""
        return RecordedCore(core, self, observer)

    def note(self, what: Recorded, now_s: float) -> None:
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
        mcap = self._recorder.mcap
        size = mcap.size_bytes
        shown = f"{size / 1e6:.1f} MB" if size >= 1e5 else f"{size / 1e3:.1f} kB"
        lasted_s = 0.0 if self._begun_ns is None else (self._last_ns - self._begun_ns) / 1e9
        return f"{mcap.messages} messages over {lasted_s:.1f} s, {shown}"

    def _stamp(self, now_s: float) -> int:
        self._last_ns = self._time_ns(now_s)
        if self._begun_ns is None:
            self._begun_ns = self._last_ns
        return self._last_ns
