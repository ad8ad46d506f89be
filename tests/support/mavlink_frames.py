"""Frames for tests: of messages, of recordings, and with any contents."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20 import development as later_dialect

LATER_IDS = (435, 436, 437)
"""Of the messages that only that dialect of pymavlink has, and the bridge reads."""
MESSAGES: dict[int, Any] = {
    **mavlink.mavlink_map,
    **{each: later_dialect.mavlink_map[each] for each in LATER_IDS},
}
"""By id, what the bridge may be sent."""


def frame(message: Any, system: int = 1, component: int = 1) -> bytes:
    """That message as a vehicle sends it."""
    return bytes(message.pack(mavlink.MAVLink(None, srcSystem=system, srcComponent=component)))


def recorded(path: Path, sender: str) -> list[dict[str, Any]]:
    """What that side said in a recording, "ground" or "vehicle"."""
    rows = [json.loads(line) for line in path.read_text().splitlines()]
    return [row for row in rows if row["from"] == sender]


def rebuilt(row: dict[str, Any]) -> Any:
    """A recorded message, to be sent again."""
    kind = getattr(mavlink, f"MAVLink_{row['msg'].lower()}_message")
    fields = dict(row)
    for name in kind.fieldnames:
        value = fields.get(name)
        if isinstance(value, str):
            fields[name] = math.nan if value == "nan" else value.encode()
        elif isinstance(value, list):
            fields[name] = [math.nan if v == "nan" else v for v in value]
    present = {name: fields[name] for name in kind.fieldnames if name in fields}
    return kind(**present)


def crafted(message_id: int, payload: bytes, system: int = 1, component: int = 1) -> bytes:
    """A frame of that message with any payload and a valid checksum."""
    kind = MESSAGES[message_id]
    header = bytes([len(payload), 0, 0, 0, system, component]) + message_id.to_bytes(3, "little")
    crc: int = mavlink.x25crc(header + payload + bytes([kind.crc_extra])).crc
    return b"\xfd" + header + payload + crc.to_bytes(2, "little")
