"""The state file: the newest comes back whole, and nothing else ever does."""

from __future__ import annotations

import math
import os
import threading
import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgpack
import pytest

from swarm.protocol.encoding import encode
from swarm.protocol.messages import Snapshot
from swarm.runtime.errors import InputError
from swarm.runtime.store import FORMAT, Memory, Store
from tests.support.builders import MISSION, done, held, message

CLAIM, OUTCOME = message("u0", held("t0", 1.0)), message("u0", done("t1"))
SNAPSHOT = Snapshot(MISSION, "u0", 7, 40.0, (CLAIM, OUTCOME))


class WallClock:
    def __init__(self) -> None:
        self.time_s = 1_700_000_000.0

    def __call__(self) -> float:
        return self.time_s


def saved(folder: Path, *snapshots: Snapshot, wall: Callable[[], float] | None = None) -> Path:
    store = Store(folder, MISSION, "u0", unix_s=wall or WallClock())
    for snapshot in snapshots:
        store.save(snapshot)
    store.close()
    return store.path


def loaded(
    folder: Path, *, wall: Callable[[], float] | None = None, speedup: float = 1.0
) -> Memory | None:
    store = Store(folder, MISSION, "u0", speedup=speedup, unix_s=wall or WallClock())
    try:
        return store.load()
    finally:
        store.close()


def test_nothing_is_remembered_at_first(tmp_path: Path) -> None:
    assert loaded(tmp_path / "new" / "folder") is None


def test_what_was_saved_comes_back(tmp_path: Path) -> None:
    path = saved(tmp_path, SNAPSHOT)

    assert loaded(tmp_path) == Memory(SNAPSHOT, 0.0)
    assert path.name == f"{MISSION}.u0.state"
    assert list(tmp_path.iterdir()) == [path]


def state(mission: str, writer: str) -> Snapshot:
    said = replace(CLAIM, mission=mission, writer=writer)
    return Snapshot(mission, writer, 7, 40.0, (said,))


PAIRS = [("a", "b"), ("a.b", "c"), ("a", "b.c"), ("a.b.c", "d"), ("a.b", "c.d"), ("a", "b.c.d")]


def test_no_two_processes_share_a_file_whatever_dots_their_names_have(tmp_path: Path) -> None:
    paths = set[Path]()
    for mission, writer in PAIRS:
        store = Store(tmp_path, mission, writer, unix_s=WallClock())
        assert store.load() is None
        store.save(state(mission, writer))
        store.close()
        paths.add(store.path)

    assert len(paths) == len(PAIRS)
    for mission, writer in PAIRS:
        store = Store(tmp_path, mission, writer, unix_s=WallClock())
        assert store.load() == Memory(state(mission, writer), 0.0)
        store.close()
    assert set(tmp_path.iterdir()) == paths


def test_a_file_that_0_1_0_has_left_is_read_by_whom_it_is_of(tmp_path: Path) -> None:
    """It put no more than a dot between two names that may have dots."""
    store = Store(tmp_path, "a.b", "c", unix_s=WallClock())
    store.save(state("a.b", "c"))
    store.close()
    store.path.rename(tmp_path / "a.b.c.state")

    other = Store(tmp_path, "a", "b.c", unix_s=WallClock())
    assert other.load() is None
    other.save(state("a", "b.c"))
    other.close()
    assert not list(tmp_path.glob("*.bad"))

    again = Store(tmp_path, "a.b", "c", unix_s=WallClock())
    assert again.load() == Memory(state("a.b", "c"), 0.0)
    again.save(replace(state("a.b", "c"), mission_s=50.0))
    again.close()
    last = Store(tmp_path, "a.b", "c", unix_s=WallClock())
    assert last.load() == Memory(replace(state("a.b", "c"), mission_s=50.0), 0.0)
    last.close()


def test_mission_time_goes_on_while_nobody_runs(tmp_path: Path) -> None:
    wall = WallClock()
    saved(tmp_path, SNAPSHOT, wall=wall)
    wall.time_s += 3.0

    assert loaded(tmp_path, wall=wall, speedup=8.0) == Memory(
        replace(SNAPSHOT, mission_s=40.0 + 24.0), 24.0
    )


def test_an_unknown_mission_time_stays_unknown(tmp_path: Path) -> None:
    before_the_start = replace(SNAPSHOT, mission_s=None)
    saved(tmp_path, before_the_start)

    assert loaded(tmp_path) == Memory(before_the_start, 0.0)


@pytest.mark.parametrize(("set_back_s", "age_s"), [(0.5, 0.0), (2.0, math.inf)])
def test_a_wall_clock_that_was_set_back_tells_no_age(
    tmp_path: Path, set_back_s: float, age_s: float
) -> None:
    wall = WallClock()
    saved(tmp_path, SNAPSHOT, wall=wall)
    wall.time_s -= set_back_s

    memory = loaded(tmp_path, wall=wall)
    assert memory is not None
    assert memory.age_s == age_s
    assert memory.snapshot.mission_s == (40.0 if age_s == 0.0 else None)
    assert memory.snapshot.messages == SNAPSHOT.messages


def test_the_last_one_saved_is_written_at_the_close(tmp_path: Path) -> None:
    saved(tmp_path, *(replace(SNAPSHOT, mission_s=float(n)) for n in range(200)))

    memory = loaded(tmp_path)
    assert memory is not None
    assert memory.snapshot.mission_s == 199.0


def test_while_the_disk_is_busy_only_the_newest_waits(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    written, busy, free = list[str](), threading.Event(), threading.Event()
    real = os.fsync

    def slow(descriptor: int) -> None:
        written.append(threading.current_thread().name)
        busy.set()
        assert free.wait(5.0)
        real(descriptor)

    monkeypatch.setattr(os, "fsync", slow)
    store = Store(tmp_path, MISSION, "u0", unix_s=WallClock())
    store.save(SNAPSHOT)
    assert busy.wait(5.0)
    for n in range(50):
        store.save(replace(SNAPSHOT, mission_s=float(n)))
    free.set()
    store.close()

    assert len(written) == 2 * 2  # file and folder, twice
    assert threading.current_thread().name not in written
    memory = loaded(tmp_path)
    assert memory is not None
    assert memory.snapshot.mission_s == 49.0


def test_a_crash_before_the_rename_leaves_the_old_state(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    saved(tmp_path, SNAPSHOT)

    def crash(path: Path, target: Path) -> Path:
        raise OSError("power cut")

    with monkeypatch.context() as patch:
        patch.setattr(Path, "replace", crash)
        saved(tmp_path, replace(SNAPSHOT, mission_s=99.0))

    assert (tmp_path / f"{MISSION}.u0.next").exists()
    assert loaded(tmp_path) == Memory(SNAPSHOT, 0.0)
    saved(tmp_path, replace(SNAPSHOT, mission_s=99.0))
    assert loaded(tmp_path) == Memory(replace(SNAPSHOT, mission_s=99.0), 0.0)


def test_a_disk_that_fails_is_told_once_and_stops_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    written = threading.Semaphore(0)
    real_release = written.release

    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", full)
        store = Store(tmp_path, MISSION, "u0", unix_s=WallClock())
        write = store._write
        patch.setattr(store, "_write", lambda: (write(), real_release()))
        for n in range(3):
            store.save(replace(SNAPSHOT, mission_s=float(n)))
            assert written.acquire(timeout=5.0)
        store.close()

    assert "".join(capsys.readouterr()).count("No space left on device") == 1
    assert loaded(tmp_path) is None


def packed(*parts: object) -> bytes:
    data: bytes = msgpack.packb(list(parts))
    return data


PAYLOAD = encode(SNAPSHOT)
FOREIGN = encode(replace(SNAPSHOT, mission="other"))
OTHERS = encode(replace(SNAPSHOT, writer="u1"))
USELESS: dict[str, Any] = {
    "empty": b"",
    "truncated": packed(FORMAT, 1.7e9, zlib.crc32(PAYLOAD), PAYLOAD)[:-5],
    "noise": bytes(range(256)),
    "another format": packed("peckorder state 9", 1.7e9, zlib.crc32(PAYLOAD), PAYLOAD),
    "a flipped bit": packed(FORMAT, 1.7e9, zlib.crc32(PAYLOAD) ^ 1, PAYLOAD),
    "no time": packed(FORMAT, math.nan, zlib.crc32(PAYLOAD), PAYLOAD),
    "another mission": packed(FORMAT, 1.7e9, zlib.crc32(FOREIGN), FOREIGN),
    "another writer": packed(FORMAT, 1.7e9, zlib.crc32(OTHERS), OTHERS),
    "no snapshot": packed(FORMAT, 1.7e9, zlib.crc32(b"x"), b"x"),
}


@pytest.mark.parametrize("name", USELESS)
def test_a_file_of_no_use_is_reported_and_set_aside(
    tmp_path: Path, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / f"{MISSION}.u0.state"
    path.write_bytes(USELESS[name])

    assert loaded(tmp_path) is None
    assert "set aside" in "".join(capsys.readouterr())
    assert (tmp_path / f"{MISSION}.u0.bad").read_bytes() == USELESS[name]
    saved(tmp_path, SNAPSHOT)
    assert loaded(tmp_path) == Memory(SNAPSHOT, 0.0)


def test_what_cannot_be_read_at_all_is_set_aside_too(tmp_path: Path) -> None:
    (tmp_path / f"{MISSION}.u0.state").mkdir()

    assert loaded(tmp_path) is None
    saved(tmp_path, SNAPSHOT)
    assert loaded(tmp_path) == Memory(SNAPSHOT, 0.0)


def test_every_single_flipped_bit_is_noticed_or_harmless(tmp_path: Path) -> None:
    path = saved(tmp_path, SNAPSHOT)
    whole = path.read_bytes()
    for place in range(0, len(whole), 7):
        flipped = bytearray(whole)
        flipped[place] ^= 0x10
        path.write_bytes(bytes(flipped))
        memory = loaded(tmp_path)

        assert memory is None or memory.snapshot.messages == SNAPSHOT.messages


def test_a_directory_that_cannot_be_written_is_one_clear_line(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.touch()
    with pytest.raises(
        InputError, match=r"^--state: .*file/sub: cannot keep files there: .*; name"
    ):
        Store(file / "sub", MISSION, "u0")
