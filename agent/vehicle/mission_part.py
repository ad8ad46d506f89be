"""Which part of its mission a vehicle flies, where its mode alone does not say who has ordered it.

Mode and item are told by different messages. So a mode in which items are flown counts only
together with an item that was told since; until then the vehicle is taken to be in the mode before.
"""

from __future__ import annotations

from dataclasses import replace

from agent.vehicle.firmware.profile import Firmware
from agent.vehicle.messages import Heartbeat, Inbound, MissionCurrent

_HEARTBEATS = 5
"""So many may come before the item is told; then nobody knows what it flies."""


class MissionPart:
    """The item that one vehicle flies, as far as it was told."""

    def __init__(self) -> None:
        self._item: MissionCurrent | None = None
        """Told since it is in the mode in which it flies items."""
        self._in_items = False
        self._untold = 0
        """Heartbeats since then without it."""
        self._before: int | None = None
        """The mode that counted last."""

    def on_message(self, message: Inbound) -> None:
        """Take note of the item."""
        if isinstance(message, MissionCurrent) and self._in_items:
            self._item = message

    def read(self, heartbeat: Heartbeat, firmware: Firmware | None) -> Heartbeat:
        """The heartbeat with the mode that counts."""
        if firmware is None:
            return heartbeat
        told = heartbeat.custom_mode
        if not firmware.flies_items(told):
            self._item, self._in_items, self._untold = None, False, 0
            self._before = firmware.told_mode(told, None)
            return replace(heartbeat, custom_mode=self._before)
        self._in_items = True
        if self._item is not None:
            self._before = firmware.told_mode(told, self._item)
            return replace(heartbeat, custom_mode=self._before)
        self._untold += 1
        if self._untold > _HEARTBEATS:
            nobodys = firmware.told_mode(told, MissionCurrent(0, 0))
            return replace(heartbeat, custom_mode=nobodys)
        before = firmware.told_mode(told, None) if self._before is None else self._before
        return replace(heartbeat, custom_mode=before)
