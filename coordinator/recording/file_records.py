"""The messages of an MCAP file that may be cut off or torn anywhere.

The file is read from its beginning, chunk by chunk, each checked by its checksum, so that
whatever is whole is found. Leaves out: what the messages say (coordinator.recording.reader).

Format: https://mcap.dev/spec.
"""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Final

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import breakup_chunk
from mcap.writer import MCAP0_MAGIC

__all__ = ["FileRecords", "is_mcap"]

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
class Logged:
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

    def messages(self) -> Iterator[Logged]:
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

    def _take(self, record: McapRecord) -> Logged | None:
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
                    return Logged(channel.topic, schema.name, record.data, record.log_time)
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
