"""Recordings, read back: the facts that the recording core got, and when.

The same facts at the same times into a fresh `MissionObserver` give the same picture. A file may be
cut off or torn anywhere: it is read from its beginning, chunk by chunk, each checked by its
checksum, so that whatever is whole is found.

Format: https://mcap.dev/spec.
"""

from __future__ import annotations

import io
import json
import struct
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import breakup_chunk
from mcap.writer import MCAP0_MAGIC
from pydantic import TypeAdapter, ValidationError

from coordinator.recording.recorder import METADATA
from coordinator.recording.records import FORMAT, SCHEMAS, RecordingStarted, UnreadableError, decode
from swarm.model import Plan
from swarm.model.ids import valid_id
from swarm.protocol.events import CommonEvent
from swarm.protocol.messages import SCHEMA_VERSION
from swarm.protocol.timing import Timing
from swarm.runtime.errors import Fault, InputError

_HEAD: Final = struct.Struct("<BQ")
_FOOTER: Final = struct.Struct("<BQQQI")
_LARGEST_CHUNK: Final = 256 << 20
"""Bytes of a chunk that is unpacked; ours hold what is heard in about a second."""

_DAMAGES: Final = (
    McapError,
    MemoryError,
    OverflowError,
    RuntimeError,
    ValueError,
    struct.error,
    zstandard.ZstdError,
)
"""What comes of bytes that are no records."""


@dataclass(frozen=True, slots=True)
class LoggedMessage:
    """One message, with what its channel says of it."""

    topic: str
    schema: str
    data: bytes
    log_ns: int


def is_mcap(data: bytes) -> bool:
    """Whether a file begins as MCAP files do."""
    return data.startswith(MCAP0_MAGIC)


@dataclass(slots=True)
class FileRecords:
    """What a file holds, found by iterating once over `messages`."""

    data: bytes
    torn_at: int | None = None
    """Where the file is torn or cut off; None when it is whole."""
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    """By name, as far as it has been come across."""
    _schemas: dict[int, Schema] = field(default_factory=dict)
    _channels: dict[int, Channel] = field(default_factory=dict)

    def messages(self) -> Iterator[LoggedMessage]:
        """All messages, in the order in which they were written."""
        place = len(MCAP0_MAGIC)
        while True:
            if place + _HEAD.size > len(self.data):
                break
            opcode, length = _HEAD.unpack_from(self.data, place)
            end = place + _HEAD.size + length
            if end > len(self.data):
                break
            if opcode == Opcode.DATA_END:
                if not self._ends_well(end):
                    break
                return
            body = self.data[place + _HEAD.size : end]
            try:
                found = self._records(opcode, body)
            except _DAMAGES:
                break
            if found is None:
                break
            for record in found:
                if (logged := self._take(record)) is not None:
                    yield logged
            place = end
        self.torn_at = place

    def _ends_well(self, summary_at: int) -> bool:
        """Whether all that follows the data is there, too."""
        footer_at = len(self.data) - len(MCAP0_MAGIC) - _FOOTER.size
        if footer_at < summary_at or not self.data.endswith(MCAP0_MAGIC):
            return False
        opcode, _, summary, _, crc = _FOOTER.unpack_from(self.data, footer_at)
        if opcode != Opcode.FOOTER or summary not in (0, summary_at):
            return False
        checked = self.data[summary_at : footer_at + _FOOTER.size - 4]
        return bool(summary == 0 or crc == zlib.crc32(checked))

    def _records(self, opcode: int, body: bytes) -> list[McapRecord] | None:
        """What a record of the data section holds; None for one that cannot be there."""
        stream = ReadDataStream(io.BytesIO(body))
        match opcode:
            case Opcode.CHUNK:
                return breakup_chunk(_unpacked(Chunk.read(stream)), validate_crc=True)
            case Opcode.METADATA:
                return [Metadata.read(stream)]
            case Opcode.SCHEMA:
                return [Schema.read(stream)]
            case Opcode.CHANNEL:
                return [Channel.read(stream)]
            case Opcode.MESSAGE:
                return [Message.read(stream, len(body))]
            case Opcode.HEADER | Opcode.MESSAGE_INDEX | Opcode.ATTACHMENT:
                return []
            case _:
                return [] if opcode >= 0x80 else None

    def _take(self, record: McapRecord) -> LoggedMessage | None:
        match record:
            case Schema():
                self._schemas[record.id] = record
            case Channel():
                self._channels[record.id] = record
            case Metadata():
                self.metadata[record.name] = record.metadata
            case Message():
                channel = self._channels.get(record.channel_id)
                schema = None if channel is None else self._schemas.get(channel.schema_id)
                if channel is not None and schema is not None:
                    return LoggedMessage(channel.topic, schema.name, record.data, record.log_time)
            case _:
                pass
        return None


def _unpacked(chunk: Chunk) -> Chunk:
    """``chunk`` as it is without compression; it takes no more memory than it says.

    Raises:
        ValueError: it says too much, or it is longer than it says.
    """
    if chunk.uncompressed_size > _LARGEST_CHUNK:
        raise ValueError(f"{chunk.uncompressed_size} bytes are too many for a chunk")
    if chunk.compression == "zstd":
        # By itself the library believes what the data say of their length.
        reader = zstandard.ZstdDecompressor().stream_reader(chunk.data)
        data = reader.read(chunk.uncompressed_size + 1)
    elif chunk.compression == "lz4":
        data = lz4.frame.LZ4FrameDecompressor().decompress(
            chunk.data, max_length=chunk.uncompressed_size + 1
        )
    else:
        data = chunk.data
    if len(data) != chunk.uncompressed_size:
        raise ValueError("a chunk is longer or shorter than it says")
    return replace(chunk, compression="", data=data)


@dataclass(frozen=True, slots=True)
class RecordedFact:
    """One fact."""

    now_s: float
    """When the recording core got it, by its clock [s]."""
    fact: CommonEvent
    """Ticks included, which alone tell when a silence was noticed."""


@dataclass(frozen=True, slots=True)
class RecordedPlan:
    """A plan that the mission state was given."""

    now_s: float
    plan: Plan


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """A mission as somebody on the bus heard it."""

    path: Path
    mission: str
    speedup: float
    """Seconds of the recording core's clock per wall second."""
    timing: Timing
    """Of the recording core [s of its clock]."""
    virtual: bool
    start_s: float
    """When the core began, by its clock [s]."""
    entries: Sequence[RecordedFact]
    """In the order in which the core got them."""
    plans: Sequence[RecordedPlan]
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
    entries: list[RecordedFact] = []
    plans: list[RecordedPlan] = []
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
            case RecordingStarted():
                start_s = now_s
            case Plan():
                plans.append(RecordedPlan(now_s, what))
            case _:
                entries.append(RecordedFact(now_s, what))
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
        if not {"scenario", "version"} <= told.keys():
            raise ValueError
        return {
            "mission": told["mission"],
            "speedup": speedup,
            "timing": timing,
            "virtual": told["clock"] == "virtual",
        }
    except (KeyError, ValueError, ValidationError, RecursionError):
        problem = "has metadata that no recording has"
        remedy = "give a file as swarm ... --record has written it"
        raise _fault(path, METADATA, problem, remedy) from None


def _fault(path: Path, place: str, problem: str, remedy: str) -> InputError:
    return InputError(Fault(str(path), place, problem, remedy))
