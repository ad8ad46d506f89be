"""AVAILABLE_MODES: a vehicle's modes by its own names, one a message.

The message is younger than pymavlink's dialect of ArduPilot, so its layout stands here.
Source: https://mavlink.io/en/messages/common.html#AVAILABLE_MODES.
"""

from __future__ import annotations

import math
import struct

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.autopilot.firmware.model import FirmwareModel

AVAILABLE_MODES_ID = 435

_LAYOUT = struct.Struct("<IIBBB35s")
_CHECKSUM_EXTRA = 134
_NON_STANDARD = 0


class AvailableModesMessage(mavlink.MAVLink_message):  # type: ignore[misc]
    """One of them, ready for the wire."""

    def __init__(self, index: int, modes: int, custom_mode: int, standard: int, name: str) -> None:
        super().__init__(AVAILABLE_MODES_ID, "AVAILABLE_MODES")
        self._fields = (custom_mode, 0, modes, index, standard, name.encode())

    def pack(self, mav: mavlink.MAVLink, force_mavlink1: bool = False) -> bytes:
        """The frame, numbered and signed as that end of the conversation does it."""
        payload = _LAYOUT.pack(*self._fields)
        frame: bytes = self._pack(mav, _CHECKSUM_EXTRA, payload, force_mavlink1)
        return frame


def available_modes(model: FirmwareModel, asked: float) -> list[AvailableModesMessage]:
    """What the firmware says when it is asked for the mode of that number; 0 asks for all.

    A standard mode of MAVLink has a number there and no name, where the firmware has one for it.
    """
    named = list(model.told_modes.items())
    if not math.isfinite(asked) or not 0 <= round(asked) <= len(named):
        return []
    number = round(asked)
    if number:
        wanted = [number]
    else:
        wanted = list(range(1, len(named) + 1)) if model.tells_all_modes else [1]
    messages = []
    for index in wanted:
        mode, told = named[index - 1]
        standard, name = (told, "") if isinstance(told, int) else (_NON_STANDARD, told)
        custom_mode = model.custom_mode(mode)
        messages.append(AvailableModesMessage(index, len(named), custom_mode, standard, name))
    return messages
