"""Cuts a byte stream into MAVLink frames and survives whatever else is in it.

The generated dialect can parse streams too, but drops the whole supposed frame
when a checksum fails, and with it the good frames behind a stray start byte. Here a
bad frame costs one byte: the search goes on right behind its start byte. Leaves
out: meaning (agent.mavlink.codec) and signing.

Frame layout: https://mavlink.io/en/guide/serialization.html
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

__all__ = ["Framer"]

_START_V1 = 0xFE
_START_V2 = 0xFD
_OVERHEAD_V1 = 8
"""Start byte, five header bytes and the checksum."""
_OVERHEAD_V2 = 12
_SIGNATURE_BYTES = 13
_SIGNED = 0x01


class Framer:
    """Bytes in, decoded dialect messages out; never raises on any input."""

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._parser = mavlink.MAVLink(None)
        self.bad_bytes = 0
        """Bytes that belonged to no valid frame."""
        self.unknown_frames = 0
        """Frames of messages that the dialect does not have."""

    def feed(self, data: bytes) -> Iterator[Any]:
        """Take in ``data`` and yield every message that is complete by now."""
        buffer = self._buffer
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
                        start += size
                        if message.get_msgId() < 0:
                            self.unknown_frames += 1
                        else:
                            yield message
        finally:
            del buffer[:start]

    def reset(self) -> None:
        """Forget a half-received frame, because the link is a new one."""
        self.bad_bytes += len(self._buffer)
        self._buffer.clear()

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
                if flags & ~_SIGNED:
                    return None
                signature = _SIGNATURE_BYTES if flags & _SIGNED else 0
                return buffer[start + 1] + _OVERHEAD_V2 + signature
            case _:
                return None

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
