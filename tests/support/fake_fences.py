"""Fences of the scripted vehicles: their transfer, as the recordings have it.

An upload takes the place of what stood there with its last item only, on both firmwares. Leaves
out: heeding it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

if TYPE_CHECKING:
    from tests.support.fake_copter import FakeCopter

FENCE = 1
INCLUSION, EXCLUSION = 5001, 5002
OK, ERROR, UNSUPPORTED, INVALID_SEQUENCE, CANCELLED = 0, 1, 3, 13, 15
_GROUND = (255, 191)

Corner = tuple[int, float, int, int]
"""Command, first parameter, latitude and longitude [1e-7 deg]."""


class FakeFence:
    """One vehicle's.

    Args:
        copter: whose it is.
        as_int: whether it asks for items by the newer message.
    """

    def __init__(self, copter: FakeCopter, *, as_int: bool) -> None:
        self.copter = copter
        self.items: list[Corner] = []
        self.supported = True
        self.mute = False
        """It says nothing to anything about fences."""
        self.garbles = False
        """It tells another place than it was told."""
        self.takes = 1_000
        """So many items come through to it; then none."""
        self.is_on = False
        """Switched on by command."""
        self.replaced: list[int] = []
        """How many corners it has had, one after the other."""
        self._ask_for = (
            mavlink.MAVLink_mission_request_int_message
            if as_int
            else mavlink.MAVLink_mission_request_message
        )
        self._ask_again_s, self._patience_s = (0.25, 5.0) if as_int else (1.0, 8.0)
        self._silently = as_int
        """Whether an upload that is cut off ends without a word of the protocol."""
        self._staged: list[Corner] | None = None
        self._count = 0
        self._asked_s = self._heard_s = 0.0

    @property
    def busy(self) -> bool:
        """Whether an upload is under way."""
        return self._staged is not None

    def on(self, m: Any) -> None:
        """One message of the mission protocol that concerns fences."""
        if self.mute:
            return
        if not self.supported:
            self._ack(UNSUPPORTED)
            return
        match m.get_type():
            case "MISSION_COUNT":
                self._staged, self._count = [], m.count
                self._heard_s = self.copter.now_s
                self._ask()
            case "MISSION_ITEM_INT":
                self._take(m)
            case "MISSION_CLEAR_ALL":
                self._staged = None
                self._replace([])
            case "MISSION_REQUEST_LIST":
                count = len(self.items)
                self.copter.say(mavlink.MAVLink_mission_count_message(*_GROUND, count, FENCE))
            case "MISSION_REQUEST_INT" if m.seq < len(self.items):
                self.copter.say(self._told(m.seq))
            case "MISSION_ACK" if m.type == CANCELLED:
                self._staged = None
            case _:
                pass

    def advance(self) -> None:
        """Ask again, or give up."""
        now_s = self.copter.now_s
        if self._staged is not None and now_s - self._heard_s > self._patience_s:
            self._staged = None
            if not self._silently:
                self._ack(CANCELLED)
        elif self._staged is not None and now_s - self._asked_s > self._ask_again_s:
            self._ask()

    def switch(self, m: Any) -> bool:
        """DO_FENCE_ENABLE, of polygons alone; whether it is obeyed."""
        assert m.param2 == 4.0, "neither heights nor circle"
        if m.param1 and not self.items:
            return False
        self.is_on = bool(m.param1)
        return True

    def areas(self) -> list[tuple[int, int]]:
        """Command and number of corners of each polygon."""
        found, place = [], 0
        while place < len(self.items):
            command, number, _, _ = self.items[place]
            found.append((command, int(number)))
            place += int(number)
        return found

    def _take(self, m: Any) -> None:
        if self.takes <= 0:
            return
        self.takes -= 1
        if self._staged is None or m.seq != len(self._staged):
            self._ack(ERROR if self._staged is None else INVALID_SEQUENCE)
            return
        assert m.frame in (0, 5), "a place on the globe"
        self._heard_s = self.copter.now_s
        self._staged.append((m.command, m.param1, m.x, m.y))
        if len(self._staged) < self._count:
            self._ask()
        else:
            staged, self._staged = self._staged, None
            self._replace(staged)

    def _replace(self, items: list[Corner]) -> None:
        self.items = items
        self.replaced.append(len(items))
        self._ack(OK)

    def _ask(self) -> None:
        seq, self._asked_s = len(self._staged or ()), self.copter.now_s
        self.copter.say(self._ask_for(*_GROUND, seq, FENCE))

    def _told(self, seq: int) -> Any:
        command, number, x, y = self.items[seq]
        fields = (seq, 0, command, 0, 0, number, 0.0, 0.0, 0.0, x + 500 * self.garbles, y, 0.0)
        return mavlink.MAVLink_mission_item_int_message(*_GROUND, *fields, FENCE)

    def _ack(self, result: int) -> None:
        self.copter.say(mavlink.MAVLink_mission_ack_message(*_GROUND, result, FENCE))
