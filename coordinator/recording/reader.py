"""Recordings, read back: the facts that the recording core got, and when.

The same facts at the same times into a fresh `coordinator.status.onlooker.Onlooker` give the
same picture; see coordinator.recording.playback. Leaves out: what the file holds for other
tools (coordinator.recording.pictures).
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from coordinator.recording.file_records import FileRecords, is_mcap
from coordinator.recording.recorder import METADATA
from coordinator.recording.records import (
    FORMAT,
    SCHEMAS,
    Begun,
    UnreadableError,
    decode,
)
from swarm.config import Timing
from swarm.errors import Fault, InputError
from swarm.events import BusFact
from swarm.model import Plan
from swarm.model.ids import valid_id
from swarm.wire.messages import SCHEMA_VERSION

__all__ = ["Entry", "PlanEntry", "Recording", "read_recording"]


@dataclass(frozen=True, slots=True)
class Entry:
    """One fact."""

    now_s: float
    """When the recording core got it, by its clock [s]."""
    fact: BusFact
    """Ticks included, which alone tell when a silence was noticed."""


@dataclass(frozen=True, slots=True)
class PlanEntry:
    """A plan that the observer was given."""

    now_s: float
    plan: Plan


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """A mission as somebody on the bus heard it."""

    path: Path
    mission: str
    """Name of the mission."""
    scenario: str
    """What was flown, as the one who recorded called it; may be empty."""
    speedup: float
    """Seconds of the recording core's clock per wall second."""
    timing: Timing
    """Of the recording core [s of its clock]."""
    virtual: bool
    """Whether it was flown in virtual time."""
    version: str
    """Of the program that recorded."""
    start_s: float
    """When the core began, by its clock [s]."""
    entries: Sequence[Entry]
    """In the order in which the core got them."""
    plans: Sequence[PlanEntry]
    torn: str | None
    """Where the file ends before its time, in a line; None when it is whole."""

    @property
    def end_s(self) -> float:
        """When the core got its last fact, by its clock [s]."""
        return self.entries[-1].now_s if self.entries else self.start_s


def read_recording(path: Path) -> Recording:
    """The recording in ``path``, up to where it is torn, if it is.

    Raises:
        InputError: the file cannot be read, is no recording of ours, or holds nothing.
    """
    try:
        data = path.read_bytes()
    except OSError as fault:
        problem = f"cannot be read: {fault.strerror}"
        raise _fault(path, "", problem, "give the path of a recording, FILE.mcap") from None
    if not is_mcap(data):
        problem = "is empty" if not data else "is no MCAP file"
        raise _fault(path, "", problem, "give a file that swarm ... --record has written")
    records = FileRecords(data)
    entries: list[Entry] = []
    plans: list[PlanEntry] = []
    start_s: float | None = None
    about: dict[str, Any] | None = None
    known = frozenset(SCHEMAS)
    for number, logged in enumerate(records.messages(), 1):
        if about is None:
            about = _about(path, records.metadata.get(METADATA))
        if logged.schema not in known:
            continue
        try:
            now_s, what = decode(logged.schema, logged.data)
        except UnreadableError:
            problem = f"does not say what {logged.schema} promises"
            place = f"message {number} on {logged.topic}"
            remedy = "record again, or read it with the version that wrote it"
            raise _fault(path, place, problem, remedy) from None
        match what:
            case Begun():
                start_s = now_s
            case Plan():
                plans.append(PlanEntry(now_s, what))
            case _:
                entries.append(Entry(now_s, what))
    if about is None:
        about = _about(path, records.metadata.get(METADATA))
    if start_s is None:
        problem = "holds nothing that was heard"
        raise _fault(path, "", problem, "give a recording that lasted a second at least")
    torn = None
    if records.torn_at is not None:
        lasted_s = (entries[-1].now_s if entries else start_s) - start_s
        torn = f"{path}: torn after {lasted_s:.1f} s (byte {records.torn_at} of {len(data)})"
    return Recording(path=path, start_s=start_s, entries=entries, plans=plans, torn=torn, **about)


def _about(path: Path, told: dict[str, str] | None) -> dict[str, Any]:
    """What the metadata says, checked."""
    if told is None:
        problem = "is an MCAP file, but no recording of a mission"
        raise _fault(path, "", problem, "give a file that swarm ... --record has written")
    for key, mine in (("format", FORMAT), ("wire", str(SCHEMA_VERSION))):
        if told.get(key) != mine:
            problem = f"is of {key} version {told.get(key)}, not {mine}"
            remedy = f"read it with the version that wrote it, {told.get('version', 'unknown')}"
            raise _fault(path, "", problem, remedy)
    try:
        timing = TypeAdapter(Timing).validate_python(json.loads(told["timing"]))
        speedup = float(told["speedup"])
        if not (valid_id(told["mission"]) and 0.0 < speedup < float("inf")):
            raise ValueError
        return {
            "mission": told["mission"],
            "scenario": told["scenario"],
            "speedup": speedup,
            "timing": timing,
            "virtual": told["clock"] == "virtual",
            "version": told["version"],
        }
    except (KeyError, ValueError, ValidationError, RecursionError):
        problem = "has metadata that no recording has"
        remedy = "give a file as swarm ... --record has written it"
        raise _fault(path, METADATA, problem, remedy) from None


def _fault(path: Path, place: str, problem: str, remedy: str) -> InputError:
    return InputError(Fault(str(path), place, problem, remedy))
