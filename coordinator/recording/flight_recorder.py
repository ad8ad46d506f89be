"""A recording in the making, as the process that makes it sees it.

Leaves out: what is written (coordinator.recording.recorder) and how
(coordinator.recording.recording_file).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from coordinator.recording.recorded_core import RecordedCore
from coordinator.recording.recorder import About, Recorder
from coordinator.recording.recording_file import RecordingThread, Sink
from coordinator.recording.records import Recorded
from swarm.events import BusFact
from swarm.model import Plan
from swarm.shell import Core

__all__ = ["FlightRecorder", "virtual_ns"]

A = TypeVar("A")


def virtual_ns(now_s: float) -> int:
    """Virtual time as a recording has it: from nought."""
    return round(now_s * 1e9)


class FlightRecorder:
    """Takes facts and logs down, on a thread of its own; close it in ``finally``.

    Args:
        about: what is recorded.
        sink: takes the file's bytes, such as a `FileSink`.
        time_ns: wall time for people and their tools, given the core's time [s -> ns].
        on_fault: called once, from the thread, with the reason why nothing more is recorded.
    """

    def __init__(
        self,
        about: About,
        sink: Sink,
        time_ns: Callable[[float], int],
        on_fault: Callable[[str], None] = lambda _: None,
    ) -> None:
        self.about = about
        self._recorder = Recorder(about)
        self._time_ns = time_ns
        self._thread = RecordingThread(
            self._recorder.mcap, sink, on_fault=on_fault, last=self._recorder.draw
        )
        self._begun_ns: int | None = None
        self._last_ns = 0

    def around(self, core: Core[BusFact, A]) -> RecordedCore[A]:
        """``core``, with all it hears written down."""
        return RecordedCore(core, self)

    def note(self, what: Recorded, now_s: float) -> None:
        """Write a fact down; returns at once."""
        time_ns = self._stamp(now_s)
        self._thread.hand_over(lambda: self._recorder.note(what, now_s, time_ns))

    def plan(self, plan: Plan, now_s: float) -> None:
        """Write down a plan that the observer has been given."""
        self.note(plan, now_s)

    def log(self, name: str, text: str, now_s: float, level: str = "info") -> None:
        """Write down a line that a process has logged."""
        time_ns = self._stamp(now_s)
        self._thread.hand_over(lambda: self._recorder.log(name, text, level, time_ns))

    def close(self) -> None:
        """Write what is left; the file is whole then, unless there is a `fault`."""
        self._thread.close()

    @property
    def fault(self) -> str | None:
        """Why not everything is recorded; None if it is."""
        if self._thread.fault is not None:
            return self._thread.fault
        lost = self._thread.lost
        return None if not lost else f"the disk was too slow: {lost} facts are missing"

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
