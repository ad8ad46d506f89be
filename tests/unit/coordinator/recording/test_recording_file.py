"""The thread that writes: nobody waits for it, and a disk that fails ends the recording alone."""

from __future__ import annotations

import errno
import os
import threading
from pathlib import Path

import pytest

from coordinator.recording.flight_recorder import (
    FileSink,
    FlightRecorder,
    RecordingThread,
    recording_to,
    virtual_ns,
)
from coordinator.recording.growing_mcap import GrowingMcap, Patch
from coordinator.recording.reader import read_recording
from coordinator.recording.recorder import RecordingInfo
from coordinator.recording.records import RecordingStarted
from swarm.model.ids import COORDINATOR
from swarm.protocol.events import MessageReceived
from swarm.protocol.timing import Timing
from swarm.runtime.errors import InputError
from tests.support.builders import MISSION, brief, epoch, message, uav
from tests.support.recordings import Disk

ABOUT = RecordingInfo(MISSION, Timing(), virtual=True)


def mission_begins(recorder: FlightRecorder, count: int = 1) -> None:
    recorder.note(RecordingStarted(), 0.0)
    recorder.note(MessageReceived(message(COORDINATOR, brief(uav("u0")))), 0.5)
    for number in range(count):
        recorder.note(MessageReceived(message(COORDINATOR, epoch("u0"), counter=number + 2)), 1.0)


def test_everything_handed_over_is_written_when_it_closes(tmp_path: Path) -> None:
    path, said = tmp_path / "flight.mcap", list[str]()

    with recording_to(path, ABOUT, virtual_ns, said.append) as recorder:
        assert path.stat().st_size > 0  # a valid file from the first moment
        mission_begins(recorder, 100)

    found = read_recording(path)
    assert len(found.entries) == 101
    assert found.torn is None
    assert said == []
    assert recorder.fault is None
    assert "over 1.0 s" in recorder.told


def test_an_earlier_recording_is_never_overwritten(tmp_path: Path) -> None:
    path = tmp_path / "flight.mcap"
    path.write_text("dear")

    with pytest.raises(InputError, match="exists already"):
        FileSink(path)

    assert path.read_text() == "dear"


def test_a_folder_that_is_not_there_is_told_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be written: No such file") as refused:
        FileSink(tmp_path / "none" / "flight.mcap")

    assert "\n" not in str(refused.value)


class FullDisk(Disk):
    """Takes so many writes and no more."""

    def __init__(self, room: int) -> None:
        super().__init__()
        self.room = room

    def apply(self, patch: Patch) -> None:
        if len(self.patches) == self.room:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        super().apply(patch)


def test_a_full_disk_ends_the_recording_and_nothing_else(tmp_path: Path) -> None:
    disk, said = FullDisk(1), list[str]()
    recorder = FlightRecorder(ABOUT, disk, virtual_ns, said.append)

    mission_begins(recorder)
    recorder.close()
    recorder.note(RecordingStarted(), 2.0)

    assert said == ["No space left on device"]
    assert recorder.fault == "No space left on device"
    assert disk.closed


def test_a_write_that_fails_half_way_leaves_the_file_as_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "flight.mcap"
    sink, mcap = FileSink(path), GrowingMcap("test", {}, "about")
    mcap.define("thing", b"{}")
    for number in range(3):
        mcap.add("a", "thing", b'{"value":%d}' % number, number)
        patch = mcap.grow()
        assert patch is not None
        sink.apply(patch)
    before = path.read_bytes()
    mcap.add("a", "thing", b'{"value":3}', 3)
    patch = mcap.grow()
    assert patch is not None
    write, calls = os.pwrite, list[int]()

    def half(file: int, data: memoryview, offset: int) -> int:
        calls.append(len(data))
        if len(calls) == 1:
            return write(file, data[: len(data) // 2], offset)
        if len(calls) == 2:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return write(file, data, offset)

    monkeypatch.setattr(os, "pwrite", half)
    with pytest.raises(OSError, match="No space"):
        sink.apply(patch)
    sink.close()

    assert path.read_bytes() == before


def test_a_hung_disk_costs_facts_and_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("coordinator.recording.flight_recorder.MAX_WAITING", 5)
    path, said = tmp_path / "flight.mcap", list[str]()

    with recording_to(path, ABOUT, virtual_ns, said.append) as recorder:
        mission_begins(recorder, 50)

    assert recorder.lost == 47
    assert said == [f"{path}: the disk was too slow: 47 facts are missing"]
    assert len(read_recording(path).entries) == 4


def test_who_has_time_waits_for_the_disk(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("coordinator.recording.flight_recorder.MAX_WAITING", 5)
    disk, done = Disk(), list[int]()
    thread = RecordingThread(GrowingMcap("test", {}, "about"), disk, patient=True, period_s=0.001)

    for number in range(100):
        thread.hand_over(lambda number=number: done.append(number))  # type: ignore[misc]  # bound
    thread.close()

    assert done == list(range(100))
    assert thread.lost == 0


def test_a_bug_in_the_recorder_does_not_reach_the_flight() -> None:
    said = list[str]()
    thread = RecordingThread(
        GrowingMcap("test", {}, "about"), Disk(), on_fault=said.append, period_s=0.001
    )
    failed = threading.Event()

    def fail() -> None:
        failed.set()
        raise KeyError("oops")

    thread.hand_over(fail)
    assert failed.wait(5.0)
    thread.close()

    assert said == ["KeyError: 'oops'"]
    assert thread.fault == "KeyError: 'oops'"


class BrokenSink(Disk):
    """Has a bug."""

    def apply(self, patch: Patch) -> None:
        if self.patches:
            raise MemoryError
        super().apply(patch)


def test_what_goes_wrong_while_writing_keeps_nobody_waiting(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("coordinator.recording.flight_recorder.MAX_WAITING", 2)
    said = list[str]()
    mcap = GrowingMcap("test", {}, "about")
    mcap.define("thing", b"{}")
    thread = RecordingThread(mcap, BrokenSink(), on_fault=said.append, patient=True, period_s=0.001)

    for number in range(20):
        thread.hand_over(lambda number=number: mcap.add("a", "thing", b"{}", number))  # type: ignore[misc]  # bound
    thread.close()

    assert said == ["MemoryError: "]


class HungSink(Disk):
    """Answers no second write until it is let go."""

    def __init__(self) -> None:
        super().__init__()
        self.go_on = threading.Event()

    def apply(self, patch: Patch) -> None:
        if self.patches:
            self.go_on.wait()
        super().apply(patch)


def test_a_disk_that_hangs_keeps_nobody_from_leaving(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("coordinator.recording.flight_recorder.HUNG_S", 0.05)
    disk, said = HungSink(), list[str]()
    recorder = FlightRecorder(ABOUT, disk, virtual_ns, said.append)
    mission_begins(recorder)

    recorder.close()
    disk.go_on.set()

    assert said == ["the disk does not answer"]
    assert recorder.fault == "the disk does not answer"
