"""An MCAP file that grows and is complete after every step.

Each step puts one chunk where the file's tail was, and a new tail behind it, in a single write.
Records are those of the `mcap` package; ours is only how the tail moves.

Format: https://mcap.dev/spec.
"""

from __future__ import annotations

import struct
import zlib
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Message,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.writer import MCAP0_MAGIC

PADDING: Final = 0x80
"""Opcode of a record that readers pass over: the first of those that applications may use."""
MAX_SUMMARY_BYTES: Final = 2 << 20
"""A summary grows by every chunk; one that is longer is written at the end only."""
_HEAD_BYTES: Final = 9
"""Of every record: opcode and length."""


@dataclass(frozen=True, slots=True)
class Patch:
    """Bytes to be written at a place of the file; they reach its new end."""

    offset: int
    data: bytes


class GrowingMcap:
    """Messages in, patches out: with each of them applied the file is complete.

    It begins with the ``metadata`` of that ``name``.
    """

    def __init__(
        self,
        library: str,
        metadata: Mapping[str, str],
        name: str,
        max_summary_bytes: int = MAX_SUMMARY_BYTES,
    ) -> None:
        self._max_summary_bytes = max_summary_bytes
        self._schemas: dict[str, Schema] = {}
        self._channels: dict[str, Channel] = {}
        self._counts: defaultdict[int, int] = defaultdict(int)
        self._span_ns: tuple[int, int] | None = None
        self._definitions: list[McapRecord] = []
        """Schemas and channels that no chunk holds yet."""
        self._pending: list[Message] = []
        head = RecordBuilder()
        head.write(MCAP0_MAGIC)
        Header("", library).write(head)
        start = head.count
        Metadata(name, dict(metadata)).write(head)
        self._metadata_index = MetadataIndex(start, head.count - start, name)
        self._begun: bytes | None = head.end()
        """What comes before the first chunk, until it is written."""
        self._data_end = len(self._begun)
        """Where the next chunk goes."""
        self._size = 0
        self._index = bytearray()
        """The chunk indexes so far."""
        self._chunks = 0

    @property
    def size_bytes(self) -> int:
        """Of the file with all patches applied."""
        return self._size

    @property
    def messages(self) -> int:
        """How many there are in all patches."""
        return sum(self._counts.values())

    def add(self, topic: str, schema: str, data: bytes, log_ns: int) -> None:
        """One message of UTF-8 JSON for the next patch; its topic's channel is made if need be."""
        channel = self._channels.get(topic)
        if channel is None:
            known = self._schemas[schema]
            number = len(self._channels) + 1
            channel = Channel(number, topic, "json", {}, known.id)
            self._channels[topic] = channel
            self._definitions.append(channel)
        self._pending.append(Message(channel.id, log_ns, data, log_ns, 0))

    def define(self, schema: str, data: bytes) -> None:
        """Publish a JSON schema under a name that is not taken."""
        if schema in self._schemas:
            raise ValueError(f"schema {schema} is defined already")
        record = Schema(len(self._schemas) + 1, data, "jsonschema", schema)
        self._schemas[schema] = record
        self._definitions.append(record)

    def grow(self, *, last: bool = False) -> Patch | None:
        """What to write so that the file holds everything so far; None when it does already.

        With ``last`` the summary is whole, however long it is.
        """
        if not (self._pending or self._begun is not None or last):
            return None
        offset = 0 if self._begun is not None else self._data_end
        out = RecordBuilder()
        if self._begun is not None:
            out.write(self._begun)
            self._begun = None
        if self._pending:
            self._write_chunk(out, offset)
        self._data_end = offset + out.count
        tail = self._tail(self._data_end, whole=last)
        if (short := self._size - (self._data_end + len(tail))) > 0:
            # Files never shrink: between a write and a cut there would be no valid end.
            _write_padding(out, max(0, short - _HEAD_BYTES))
            self._data_end = offset + out.count
            tail = self._tail(self._data_end, whole=last)
        out.write(tail)
        data = out.end()
        self._size = offset + len(data)
        return Patch(offset, data)

    def _write_chunk(self, out: RecordBuilder, offset: int) -> None:
        content = RecordBuilder()
        for definition in self._definitions:
            definition.write(content)
        indexes: dict[int, MessageIndex] = {}
        for message in self._pending:
            entry = indexes.setdefault(message.channel_id, MessageIndex(message.channel_id, []))
            entry.records.append((message.log_time, content.count))
            message.write(content)
            self._counts[message.channel_id] += 1
        times_ns = [message.log_time for message in self._pending]
        first_ns, last_ns = min(times_ns), max(times_ns)
        known = self._span_ns or (first_ns, last_ns)
        self._span_ns = min(known[0], first_ns), max(known[1], last_ns)
        self._definitions, self._pending = [], []
        plain = content.end()
        packed = zstandard.compress(plain)
        start = offset + out.count
        Chunk(
            compression="zstd",
            data=packed,
            message_start_time=first_ns,
            message_end_time=last_ns,
            uncompressed_crc=zlib.crc32(plain),
            uncompressed_size=len(plain),
        ).write(out)
        indexes_at = offset + out.count
        places = {}
        for channel, entry in indexes.items():
            places[channel] = offset + out.count
            entry.write(out)
        index = RecordBuilder()
        ChunkIndex(
            chunk_length=indexes_at - start,
            chunk_start_offset=start,
            compression="zstd",
            compressed_size=len(packed),
            message_end_time=last_ns,
            message_index_length=offset + out.count - indexes_at,
            message_index_offsets=places,
            message_start_time=first_ns,
            uncompressed_size=len(plain),
        ).write(index)
        self._index += index.end()
        self._chunks += 1

    def _tail(self, at: int, *, whole: bool) -> bytes:
        """Data end, summary and footer of a file whose data ends at ``at``."""
        out = RecordBuilder()
        DataEnd(0).write(out)
        summary_at = at + out.count
        groups = self._summary()
        length = sum(len(content) for _, content in groups)
        if length > self._max_summary_bytes and not whole:
            # Every reader can do without a summary, only slower.
            Footer(0, 0, 0).write(out)
            out.write(MCAP0_MAGIC)
            return bytes(out.end())
        summary = RecordBuilder()
        offsets = []
        for opcode, content in groups:
            if content:
                offsets.append(SummaryOffset(opcode, summary_at + summary.count, len(content)))
                summary.write(content)
        offsets_at = summary_at + summary.count
        for each in offsets:
            each.write(summary)
        text = summary.end()
        head = struct.pack("<BQQQ", Opcode.FOOTER, 8 + 8 + 4, summary_at, offsets_at)
        out.write(text)
        Footer(summary_at, offsets_at, zlib.crc32(head, zlib.crc32(text))).write(out)
        out.write(MCAP0_MAGIC)
        return bytes(out.end())

    def _summary(self) -> list[tuple[Opcode, bytes | bytearray]]:
        first_ns, last_ns = self._span_ns or (0, 0)
        statistics = Statistics(
            attachment_count=0,
            channel_count=len(self._channels),
            channel_message_counts=self._counts,
            chunk_count=self._chunks,
            message_count=self.messages,
            message_end_time=last_ns,
            message_start_time=first_ns,
            metadata_count=1,
            schema_count=len(self._schemas),
        )
        return [
            (Opcode.SCHEMA, _bytes_of(*self._schemas.values())),
            (Opcode.CHANNEL, _bytes_of(*self._channels.values())),
            (Opcode.STATISTICS, _bytes_of(statistics)),
            (Opcode.CHUNK_INDEX, self._index),
            (Opcode.METADATA_INDEX, _bytes_of(self._metadata_index)),
        ]


def _bytes_of(*records: McapRecord) -> bytes:
    out = RecordBuilder()
    for record in records:
        record.write(out)
    return bytes(out.end())


def _write_padding(out: RecordBuilder, length: int) -> None:
    out.write(struct.pack("<BQ", PADDING, length))
    out.write(bytes(length))
