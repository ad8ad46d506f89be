"""Messages of MAVLink's common set that are younger than pymavlink's dialect of ArduPilot.

AVAILABLE_MODES tells one mode of the vehicle under its own name, AVAILABLE_MODES_MONITOR that they
have become others, CURRENT_MODE which mode it is in and which was asked for. pymavlink has them in
a dialect of 5 MB that is read for nothing else, so they are read here, by their published layouts
and checksums.

Messages: https://mavlink.io/en/messages/common.html#AVAILABLE_MODES
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass
from types import MappingProxyType

from pymavlink.generator.mavcrc import x25crc

from agent.vehicle.messages import AvailableMode, AvailableModesChange, CurrentMode

AVAILABLE_MODES_ID, CURRENT_MODE_ID, AVAILABLE_MODES_MONITOR_ID = 435, 436, 437

LaterMessage = AvailableMode | AvailableModesChange | CurrentMode

_START_V2 = 0xFD
"""These ids are beyond what MAVLink 1 can say."""
_HEADER_BYTES = 10
_CHECKSUM = struct.Struct("<H")
_MODE = struct.Struct("<IIBBB35s")
_CURRENT = struct.Struct("<IIB")
_MONITOR = struct.Struct("<B")


def _available_mode(payload: bytes) -> LaterMessage:
    custom_mode, _, modes, index, _, name = _MODE.unpack(payload)
    text = name.split(b"\0", 1)[0].decode("ascii", "replace").strip()
    text = "".join(each if each.isprintable() else "?" for each in text)
    return AvailableMode(custom_mode, text, index, modes)


def _current_mode(payload: bytes) -> LaterMessage:
    custom_mode, intended_mode, _ = _CURRENT.unpack(payload)
    return CurrentMode(custom_mode, intended_mode)


def _monitor(payload: bytes) -> LaterMessage:
    return AvailableModesChange(*_MONITOR.unpack(payload))


@dataclass(frozen=True, slots=True)
class _Layout:
    """What one message looks like."""

    size: int
    """Bytes of its payload, before zeros at the end are left out."""
    checksum_extra: int
    read: Callable[[bytes], LaterMessage]


_LAYOUTS = MappingProxyType(
    {
        AVAILABLE_MODES_ID: _Layout(_MODE.size, 134, _available_mode),
        CURRENT_MODE_ID: _Layout(_CURRENT.size, 193, _current_mode),
        AVAILABLE_MODES_MONITOR_ID: _Layout(_MONITOR.size, 30, _monitor),
    }
)


def later_message(frame: bytes) -> LaterMessage | None:
    """What that whole frame says; None if it is no such message, or broken."""
    if frame[0] != _START_V2:
        return None
    layout = _LAYOUTS.get(int.from_bytes(frame[7:10], "little"))
    end = _HEADER_BYTES + frame[1]
    if layout is None or frame[1] > layout.size:
        return None
    checksum = x25crc(frame[1:end])
    checksum.accumulate(bytes((layout.checksum_extra,)))
    if checksum.crc != _CHECKSUM.unpack_from(frame, end)[0]:
        return None
    return layout.read(frame[_HEADER_BYTES:end].ljust(layout.size, b"\0"))
