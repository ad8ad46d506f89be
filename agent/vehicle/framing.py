"""Puts together what comes in pieces: frames from a byte stream, texts from chunks.

Survives whatever else is in the stream. A text longer than one STATUSTEXT comes in chunks of one
id; a chunk that is lost leaves "..." in its place.

Message: https://mavlink.io/en/messages/common.html#STATUSTEXT
"""

from __future__ import annotations

from collections import Counter, OrderedDict
from collections.abc import Hashable, Iterator
from dataclasses import dataclass, field
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from agent.vehicle.later_messages import LaterMessage, later_message
from agent.vehicle.messages import StatusText
from agent.vehicle.signing import SIGNATURE_BYTES, SIGNED, SignatureVerdict, Signing

_START_V1 = 0xFE

_START_V2 = 0xFD

_OVERHEAD_V1 = 8
"""Start byte, five header bytes and the checksum."""

_OVERHEAD_V2 = 12

_MOST_SOURCES = 16
"""Half-received frames remembered, of one source each."""


@dataclass(frozen=True, slots=True)
class MavlinkFrame:
    """One frame as it came."""

    data: bytes
    system_id: int
    message: Any
    """Of the dialect; None if it does not have that message."""
    later: LaterMessage | None = None
    """What it says if it is one of the messages that are younger than the dialect."""

    @property
    def signed(self) -> bool:
        """Whether it carries a signature."""
        return self.data[0] == _START_V2 and bool(self.data[2] & SIGNED)


class Framer:
    """Bytes in, frames out; never raises on any input.

    Args:
        signing: if given, only frames that it believes come out.
    """

    def __init__(self, signing: Signing | None = None) -> None:
        self._signing = signing
        self._buffer = bytearray()
        self._halves: OrderedDict[Hashable, bytearray] = OrderedDict()
        """What came of frames that are not complete, by source; the last one heard last."""
        self.kept: Hashable | None = None
        """The source whose half frame is remembered, however many others send."""
        self._parser = mavlink.MAVLink(None)
        self.distrusted: Counter[str] = Counter()
        """Whole frames dropped because of their signature or its absence."""
        self.bad_bytes = 0
        """Bytes that belonged to no valid frame."""
        self.unknown_frames = 0
        """Frames of messages that nobody here knows."""
        self.unchecked_frames = 0
        """Signed frames taken without a key to check them with."""

    def feed(self, data: bytes, source: Hashable | None = None) -> Iterator[MavlinkFrame]:
        """Take in ``data`` and yield every frame that is complete by now.

        Args:
            data: what came.
            source: from whom; what several send at a time is put together apart.
        """
        buffer = self._buffer = self._halves.pop(source, bytearray())
        buffer += data
        start = 0
        try:
            while start < len(buffer):
                size = self._frame_size(start)
                if size is None:
                    start += 1
                    self.bad_bytes += 1
                elif size == 0 or start + size > len(buffer):
                    break
                else:
                    message = self._decode(start, size)
                    if message is None:
                        start += 1
                        self.bad_bytes += 1
                    else:
                        frame = bytes(buffer[start : start + size])
                        start += size
                        if self._believes(frame):
                            yield self._frame(frame, message)
        finally:
            del buffer[:start]
            if buffer:
                self._remember(source, buffer)

    def reset(self) -> None:
        """Forget half-received frames, because the link is a new one."""
        self.bad_bytes += sum(map(len, self._halves.values()))
        self._halves.clear()

    def _remember(self, source: Hashable | None, half: bytearray) -> None:
        if len(self._halves) >= _MOST_SOURCES:
            oldest = next(each for each in self._halves if each != self.kept)
            self.bad_bytes += len(self._halves.pop(oldest))
        self._halves[source] = half

    def _frame_size(self, start: int) -> int | None:
        """Bytes of the frame at ``start``; 0 if still unknown, None if there is none."""
        buffer = self._buffer
        match buffer[start]:
            case 0xFE:
                if len(buffer) - start < 2:
                    return 0
                return buffer[start + 1] + _OVERHEAD_V1
            case 0xFD:
                if len(buffer) - start < 3:
                    return 0
                flags = buffer[start + 2]
                if flags & ~SIGNED:
                    return None
                signature = SIGNATURE_BYTES if flags & SIGNED else 0
                return buffer[start + 1] + _OVERHEAD_V2 + signature
            case _:
                return None

    def _believes(self, frame: bytes) -> bool:
        if self._signing is None:
            self.unchecked_frames += frame[0] == _START_V2 and bool(frame[2] & SIGNED)
            return True
        verdict = self._signing.judge(frame)
        if verdict is SignatureVerdict.BELIEVED:
            return True
        self.distrusted[verdict.value] += 1
        return False

    def _frame(self, data: bytes, message: Any) -> MavlinkFrame:
        system_id = data[5] if data[0] == _START_V2 else data[3]
        if message.get_msgId() < 0:
            later = later_message(data)
            self.unknown_frames += later is None
            return MavlinkFrame(data, system_id, None, later)
        return MavlinkFrame(data, system_id, message)

    def _decode(self, start: int, size: int) -> Any | None:
        """The message in that frame; None if the frame is not valid."""
        frame = self._buffer[start : start + size]
        try:
            message = self._parser.decode(frame)
        except mavlink.MAVError:
            return None
        if message.get_msgId() < 0:
            # Without the message's definition its checksum proves nothing: believe the
            # frame only if another one, or nothing, begins right behind it.
            end = start + size
            if end < len(self._buffer) and self._buffer[end] not in (_START_V1, _START_V2):
                return None
        return message


_CHUNK_CHARS = 50

_MOST_CHUNKS = 8

_GAP = "..."


@dataclass(slots=True)
class _Unfinished:
    """A text whose end has not come."""

    id: int
    severity: int
    pieces: list[str] = field(default_factory=list)
    next_seq: int = 0


class TextJoiner:
    """The texts of one autopilot."""

    def __init__(self) -> None:
        self._unfinished: _Unfinished | None = None

    def add(self, severity: int, text: str, text_id: int, seq: int) -> list[StatusText]:
        """Take in one STATUSTEXT; gives the texts that are complete by it.

        Args:
            severity: MAV_SEVERITY.
            text: what the message holds, up to the end of the field.
            text_id: which text it is a chunk of; 0 is a text of its own.
            seq: which chunk.
        """
        said: list[StatusText] = []
        before = self._unfinished
        if before is not None and (text_id != before.id or seq < before.next_seq):
            said.append(self._end(before, _GAP))
            before = None
        if text_id == 0:
            return [*said, StatusText(severity, _clean(text))]
        chunk = before or _Unfinished(text_id, severity)
        self._unfinished = chunk
        if seq > chunk.next_seq:
            chunk.pieces.append(_GAP)
        chunk.pieces.append(text)
        chunk.next_seq = seq + 1
        if len(text) < _CHUNK_CHARS:
            said.append(self._end(chunk))
        elif len(chunk.pieces) >= _MOST_CHUNKS:
            said.append(self._end(chunk, _GAP))
        return said

    def forget(self) -> None:
        """Give up an unfinished text, because the link is a new one."""
        self._unfinished = None

    def _end(self, chunk: _Unfinished, tail: str = "") -> StatusText:
        self._unfinished = None
        return StatusText(chunk.severity, _clean("".join((*chunk.pieces, tail))))


def _clean(text: str) -> str:
    """The text without the tab that PX4 ends it with, and without what cannot be printed."""
    return "".join(c if c.isprintable() else "?" for c in text.strip())
