"""Where a process keeps its memory from one life to the next: one file.

The file holds the encoded snapshot, others' statements in their envelopes so that they can
be repeated, and the wall time it was taken at. It is replaced
whole: written beside the old one, forced to the disk and renamed, so a crash at any
moment leaves one or the other. Writing waits for the disk, so a thread of its own does
it; of what waits only the newest is written.
"""

from __future__ import annotations

import contextlib
import math
import os
import threading
import zlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import msgpack

from swarm.protocol.codec import Codec
from swarm.protocol.encoding import encode_memory, fit_memory
from swarm.protocol.key_space import KeySpace
from swarm.protocol.messages import Snapshot
from swarm.protocol.seal import Seal
from swarm.runtime.clock import unix_s as system_unix_s
from swarm.runtime.errors import Fault, InputError
from swarm.runtime.log import get_logger
from swarm.runtime.writer_thread import WriterThread

FORMAT: Final = "peckorder state 1"
CLOSE_LIMIT_S = 2.0
"""How long closing waits for the disk."""
CLOCK_TOLERANCE_S = 1.0
"""A file from this far in the future is from now, by a clock that was set back a little."""


@dataclass(frozen=True, slots=True)
class Memory:
    """What an earlier life of this process left behind; in seconds of its clock."""

    snapshot: Snapshot
    """Its mission time is that of now; None when that is not known."""
    age_s: float
    """How long ago it was saved; infinite when the wall clock was set back since."""


class Store:
    """The file of one process; no two processes may have the same.

    It is in ``directory``, which is made if need be. ``speedup``, clock seconds per wall second,
    scales the age of what is found.

    Raises:
        InputError: no file can be written there.
    """

    def __init__(
        self,
        directory: Path,
        mission: str,
        writer: str,
        *,
        speedup: float = 1.0,
        unix_s: Callable[[], float] = system_unix_s,
    ) -> None:
        names = mission, writer
        self.path = directory / ".".join((*(_without_dots(name) for name in names), "state"))
        self._path_of_0_1_0 = directory / ".".join((*names, "state"))
        self._next = self.path.with_suffix(".next")
        self._directory = directory
        self._mission = mission
        self._state_key = KeySpace(mission).state(writer)
        self._speedup = speedup
        self._unix_s = unix_s
        self._log = get_logger(writer, mission=mission)
        self._lock = threading.Lock()
        self._waiting: tuple[float, Snapshot] | None = None
        self._failing = False
        self._check_writable()
        self._writer = WriterThread("state file")

    def load(self, seal: Seal | None = None) -> Memory | None:
        """What the file holds; None without one, or when it is no use and was set aside.

        ``seal`` tells whose word of all that is remembered still counts.
        """
        try:
            saved_unix_s, snapshot = self._decode(self.path.read_bytes(), seal)
        except FileNotFoundError:
            found = self._left_by_0_1_0(seal)
            if found is None:
                return None
            saved_unix_s, snapshot = found
        except OSError as fault:
            self._set_aside(fault.strerror or str(fault))
            return None
        except ValueError as fault:
            self._set_aside(str(fault))
            return None
        age_s = self._unix_s() - saved_unix_s
        if age_s < -CLOCK_TOLERANCE_S:
            return Memory(replace(snapshot, mission_s=None), math.inf)
        age_s = max(0.0, age_s) * self._speedup
        mission_s = None if snapshot.mission_s is None else snapshot.mission_s + age_s
        return Memory(replace(snapshot, mission_s=mission_s), age_s)

    def _left_by_0_1_0(self, seal: Seal | None) -> tuple[float, Snapshot] | None:
        """What a file holds whose name does not tell whose it is, if it is of this process."""
        if self._path_of_0_1_0 == self.path:
            return None
        try:
            return self._decode(self._path_of_0_1_0.read_bytes(), seal)
        except (OSError, ValueError):
            return None

    def save(self, snapshot: Snapshot) -> None:
        """Have ``snapshot`` written, unless a newer one follows soon; returns at once."""
        with self._lock:
            idle = self._waiting is None
            self._waiting = (self._unix_s(), snapshot)
        if idle:
            self._writer.submit(self._write)

    def close(self) -> None:
        """Write what was saved last; waits for a slow disk, but not for a dead one."""
        if not self._writer.close(CLOSE_LIMIT_S):
            self._log.warning("the disk does not answer; the last state may not be saved")

    # -- on the writer's thread -----------------------------------------------------------

    def _write(self) -> None:
        with self._lock:
            waiting, self._waiting = self._waiting, None
        if waiting is None:
            return
        try:
            _replace_file(self.path, self._next, _encode(*waiting))
        except OSError as fault:
            if not self._failing:  # once is enough until it works again
                reason = fault.strerror or str(fault)
                self._log.warning("cannot save the state", file=str(self.path), reason=reason)
            self._failing = True
        else:
            self._failing = False

    # -- pieces -------------------------------------------------------------------------

    def _check_writable(self) -> None:
        try:
            self._directory.mkdir(parents=True, exist_ok=True)
            self._next.write_bytes(b"")
            self._next.unlink()
        except OSError as fault:
            problem = f"cannot keep files there: {fault.strerror or fault}"
            remedy = "name a directory that can be written"
            raise InputError(Fault("--state", str(self._directory), problem, remedy)) from fault

    def _decode(self, data: bytes, seal: Seal | None) -> tuple[float, Snapshot]:
        """When the snapshot in ``data`` was taken, and the snapshot.

        Raises:
            ValueError: there is none, or another's.
        """
        try:
            parts: Any = msgpack.unpackb(data)
        except (ValueError, TypeError, msgpack.exceptions.UnpackException, RecursionError):
            raise ValueError("it is damaged") from None
        match parts:
            case [str(form), float(saved_unix_s), int(checksum), bytes(payload)] if form == FORMAT:
                pass
            case _:
                raise ValueError("it is no state file of this version")
        if checksum != zlib.crc32(payload) or not math.isfinite(saved_unix_s):
            raise ValueError("it is damaged")
        codec = Codec(self._mission, seal)
        snapshot = codec.decode_memory(self._state_key, payload)
        if snapshot is None:
            raise ValueError(f"what it holds is not ours: {', '.join(codec.dropped)}")
        if codec.dropped:
            self._log.warning(
                "left registers of the state file out",
                file=str(self.path),
                reasons=", ".join(f"{n} {reason}" for reason, n in codec.dropped.items()),
            )
        return saved_unix_s, snapshot

    def _set_aside(self, reason: str) -> None:
        bad = self.path.with_suffix(".bad")
        self._log.warning(
            "cannot use the state file; set aside",
            file=str(self.path),
            reason=reason,
            kept_as=str(bad),
        )
        with contextlib.suppress(OSError):
            self.path.replace(bad)


def _without_dots(name: str) -> str:
    """``name`` as one part of a file's name: a dot parts those, and no id has the sign for it."""
    return name.replace(".", "@")


def _encode(unix_s: float, snapshot: Snapshot) -> bytes:
    payload = encode_memory(fit_memory(snapshot))
    packed: bytes = msgpack.packb([FORMAT, unix_s, zlib.crc32(payload), payload])
    return packed


def _replace_file(path: Path, draft: Path, data: bytes) -> None:
    with draft.open("wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())
    draft.replace(path)
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(folder)  # the name, too, is then on the disk
    finally:
        os.close(folder)
