"""How long a vehicle waits for its next target: from what ends a stay to the next command.

A stay ends when the time at the target is over; where none is to be spent, with the bytes
that prove the arrival. What follows until the first frame of the next target is handed to
the link is this process's own doing: deciding, claiming, encoding, and whatever held it up.
A mission counts until its first frame (MISSION_COUNT), and again until the vehicle has been
heard to hold it, which is when our own MISSION_ACK ends the read-back. Not measured, but
counted, are UAVs that found nothing to do at first and waited for a task or a peer. A UAV
sent elsewhere before its stay is over waits for nothing.

Pure: bytes, orders and instants in, durations out. Leaves out: the vehicle's and the
radio's delays, and the time bytes wait in the socket while the process is busy.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from agent.core.interface import Arrived, GoTo, VehicleOrder, VehicleReport, VehicleWord

_COMMAND_INT: Final[int] = mavlink.MAVLINK_MSG_ID_COMMAND_INT
_MISSION_ACK: Final[int] = mavlink.MAVLINK_MSG_ID_MISSION_ACK
_MISSION_COUNT: Final[int] = mavlink.MAVLINK_MSG_ID_MISSION_COUNT
_REPOSITION: Final[int] = mavlink.MAV_CMD_DO_REPOSITION
_HEADER_BYTES = 10
_CHECKSUM_BYTES = 2
_SIGNATURE_BYTES = 13
_SIGNED = 0x01
_COMMAND_AT = 28
"""Offset of COMMAND_INT.command in its payload."""
_RESULT_AT = 2
"""Offset of MISSION_ACK.type in its payload."""


@dataclass(frozen=True, slots=True)
class Turnaround:
    """One change from a target to the next, in seconds of the vehicle's clock."""

    target_s: float
    """Until the next target's first frame was handed to the link."""
    in_force_s: float | None = None
    """Until the mission with it was verified; None where targets are no missions."""


class TurnaroundMeter:
    """Watches one vehicle's link, orders and reports.

    Call in the order in which things happen; instants are of one clock.
    """

    def __init__(self) -> None:
        self.turnarounds: list[Turnaround] = []
        """Those that are complete."""
        self.idled = 0
        """How often the UAV had found nothing to fly to at first."""
        self._received_s = 0.0
        self._stay_s = 0.0
        self._leg: int | None = None
        self._free_s: float | None = None
        self._awaits_target = False
        self._uploading: float | None = None

    def received(self, at_s: float) -> None:
        """Bytes have come."""
        self._received_s = at_s

    def reported(self, report: VehicleReport) -> None:
        """The bridge reports what the last bytes meant."""
        if isinstance(report, Arrived) and report.leg == self._leg:
            self._free_s = self._received_s + self._stay_s

    def ordered(self, order: VehicleOrder) -> None:
        """The bridge is given an order."""
        if isinstance(order, VehicleWord):
            return
        self._uploading = None
        if isinstance(order, GoTo) and order.idled and self._free_s is not None:
            self.idled += 1
            self._free_s = None
        self._awaits_target = isinstance(order, GoTo) and self._free_s is not None
        if isinstance(order, GoTo):
            self._leg, self._stay_s = order.leg, order.stay_s
        else:
            self._leg = self._free_s = None

    def sent(self, data: bytes, at_s: float) -> None:
        """Bytes have been handed to the link."""
        if not self._awaits_target and self._uploading is None:
            return
        for message_id, payload in _frames(data):
            self._on_frame(message_id, payload, at_s)

    def _on_frame(self, message_id: int, payload: bytes, at_s: float) -> None:
        announces = message_id == _MISSION_COUNT
        if self._awaits_target and self._free_s is not None:
            if not (announces or _is_reposition(message_id, payload)):
                return
            free_s, self._free_s = self._free_s, None
            self._awaits_target = False
            if at_s >= free_s:
                self.turnarounds.append(Turnaround(at_s - free_s))
                self._uploading = free_s if announces else None
        elif self._uploading is not None and _ends_reading(message_id, payload):
            last = self.turnarounds.pop()
            self.turnarounds.append(Turnaround(last.target_s, at_s - self._uploading))
            self._uploading = None


def _is_reposition(message_id: int, payload: bytes) -> bool:
    number = int.from_bytes(payload[_COMMAND_AT : _COMMAND_AT + 2], "little")
    return message_id == _COMMAND_INT and number == _REPOSITION


def _ends_reading(message_id: int, payload: bytes) -> bool:
    """Whether we acknowledge what was read; zeros at a payload's end are not sent."""
    return message_id == _MISSION_ACK and not any(payload[_RESULT_AT:])


def _frames(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Message id and payload of each frame of ours, all of which are MAVLink 2.

    See https://mavlink.io/en/guide/serialization.html.
    """
    at = 0
    while at + _HEADER_BYTES <= len(data):
        length, signed = data[at + 1], data[at + 2] & _SIGNED
        payload_at = at + _HEADER_BYTES
        message_id = int.from_bytes(data[at + 7 : payload_at], "little")
        yield message_id, data[payload_at : payload_at + length]
        at = payload_at + length + _CHECKSUM_BYTES + (_SIGNATURE_BYTES if signed else 0)
