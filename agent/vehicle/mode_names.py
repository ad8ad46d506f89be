"""Asks a vehicle what it calls its modes.

Its owner's own modes, and those younger than our tables, have a name only there. PX4 1.17 tells
all when it is asked for all; ArduCopter 4.8 tells the first alone, so the others are asked for by
their number, each once. One that takes the first question while it boots may forget the answer, so
that is asked three times; whoever refuses or stays silent is asked no more.

Command: https://mavlink.io/en/messages/common.html (MAV_CMD_REQUEST_MESSAGE)
"""

from __future__ import annotations

from agent.vehicle.commands import CommandEnded, CommandOutcome, CommandQueue, VehicleCommand
from agent.vehicle.later_messages import AVAILABLE_MODES_ID
from agent.vehicle.messages import (
    AvailableMode,
    AvailableModesChange,
    CommandLong,
    Inbound,
)

_CMD_REQUEST_MESSAGE = 512
_TAG = "names of modes"
_ALL = 0
_PATIENCE_S = 1.0
"""For the mode that was asked for, after its acknowledgement."""
_FIRST_PATIENCE_S = 5.0
"""For the first of all."""
_FIRST_TRIES = 3


class ModeNameRequests:
    """Of one vehicle."""

    def __init__(self) -> None:
        self._sequence: int | None = None
        self.ask_anew()

    def ask_anew(self) -> None:
        """Ask for all of them again."""
        self._over = False
        self._tries = 0
        self._asked: set[int] = set()
        self._heard: set[int] = set()
        self._modes = 0
        self._next_at_s = 0.0

    def on_message(self, message: Inbound) -> None:
        """Note which have come, and that there are others now."""
        match message:
            case AvailableMode(index=index, modes=modes):
                self._heard.add(index)
                self._modes = modes
                self._next_at_s = 0.0
            case AvailableModesChange(sequence):
                if self._sequence not in (None, sequence):
                    self.ask_anew()
                self._sequence = sequence
            case _:
                pass

    def on_ended(self, ended: CommandEnded) -> None:
        """Leave those alone who do not tell."""
        if ended.tag == _TAG and ended.ending is not CommandOutcome.ACCEPTED:
            self._over = True

    def advance(self, commands: CommandQueue, now_s: float) -> list[VehicleCommand]:
        """The next request, if it is due."""
        if self._over or commands.pending(_TAG) or now_s < self._next_at_s:
            return []
        if not self._heard:
            index = _ALL if self._tries < _FIRST_TRIES else None
            self._tries += 1
        else:
            missing = set(range(1, self._modes + 1)) - self._heard - self._asked
            index = min(missing, default=None)
        if index is None:
            self._over = True
            return []
        self._asked.add(index)
        self._next_at_s = now_s + (_PATIENCE_S if self._heard else _FIRST_PATIENCE_S)
        params = (float(AVAILABLE_MODES_ID), float(index), 0.0, 0.0, 0.0, 0.0, 0.0)
        return commands.send(_TAG, CommandLong(_CMD_REQUEST_MESSAGE, params), now_s)
