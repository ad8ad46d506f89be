"""Asks the autopilot for the messages the bridge lives on, and asks again if one stops.

Leaves out: what the messages say. Command: https://mavlink.io/en/messages/common.html
(MAV_CMD_SET_MESSAGE_INTERVAL).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from agent.mavlink.commands import Command, CommandEnded, Commands, Ending
from agent.mavlink.config import BridgeConfig
from agent.mavlink.flavours import Flavour
from agent.mavlink.messages import CommandLong, Inbound, Position

__all__ = ["Streams"]

_TAG = "stream:"
_CMD_SET_MESSAGE_INTERVAL = 511
_MSG_ID_POSITION = 33
_REFUSED_PAUSE_TIMEOUTS = 10.0
"""A refused stream is asked for again after that many stream timeouts."""


@dataclass(slots=True)
class _Stream:
    """One message that should come regularly."""

    message_id: int
    interval_s: float
    ask_at_s: float = -math.inf
    """When to ask (again); every message that comes moves it on."""


class Streams:
    """Every stream of one vehicle."""

    def __init__(self, config: BridgeConfig, flavour: Flavour) -> None:
        self._config = config
        self._streams: dict[type[Inbound], _Stream] = {
            Position: _Stream(_MSG_ID_POSITION, 1.0 / config.position_rate_hz)
        }
        for message_id, kind in flavour.streams:
            self._streams[kind] = _Stream(message_id, 1.0 / config.status_rate_hz)

    def on_message(self, message: Inbound, now_s: float) -> None:
        """Note that a stream flows."""
        stream = self._streams.get(type(message))
        if stream is not None:
            stream.ask_at_s = now_s + self._patience_s(stream)

    def on_ended(self, ended: CommandEnded, now_s: float) -> None:
        """Be patient with a stream that was refused: it may not exist."""
        if ended.ending is not Ending.REFUSED:
            return
        for stream in self._streams.values():
            if ended.tag == _tag(stream):
                pause_s = _REFUSED_PAUSE_TIMEOUTS * self._config.stream_timeout_s
                stream.ask_at_s = max(stream.ask_at_s, now_s + pause_s)

    def ask_anew(self) -> None:
        """Ask for everything again, because link or autopilot began anew."""
        for stream in self._streams.values():
            stream.ask_at_s = -math.inf

    def advance(self, commands: Commands, now_s: float) -> list[Command]:
        """Requests that are due."""
        out: list[Command] = []
        for stream in self._streams.values():
            if now_s < stream.ask_at_s or commands.pending(_tag(stream)):
                continue
            stream.ask_at_s = now_s + self._patience_s(stream)
            interval_us = 1e6 * stream.interval_s
            params = (float(stream.message_id), interval_us, 0.0, 0.0, 0.0, 0.0, 0.0)
            request = CommandLong(_CMD_SET_MESSAGE_INTERVAL, params)
            out += commands.send(_tag(stream), request, now_s)
        return out

    def next_deadline_s(self) -> float:
        """When the next request may be due."""
        return min(stream.ask_at_s for stream in self._streams.values())

    def _patience_s(self, stream: _Stream) -> float:
        return max(self._config.stream_timeout_s, 3.0 * stream.interval_s)


def _tag(stream: _Stream) -> str:
    return f"{_TAG}{stream.message_id}"
