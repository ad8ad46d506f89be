"""Who is heard on a link: the configured vehicle, others, or nobody.

A link to which anybody can send belongs to the one who speaks for the vehicle: proof is a frame of
it, or with a signing key one that was believed for its signature. While that peer gives proof, what
others send is dropped. The link moves at once to whoever proves it by a signature, as only the
vehicle can; without a key only after the peer has given no proof for a while, since who is first to
forge the vehicle's frames is not told from it. The messages that the bridge lives on are asked for,
and again if one stops.

Command: https://mavlink.io/en/messages/common.html (MAV_CMD_SET_MESSAGE_INTERVAL)
"""

from __future__ import annotations

import math
from collections.abc import Hashable
from dataclasses import dataclass

from agent.vehicle.commands import CommandEnded, CommandOutcome, CommandQueue, VehicleCommand
from agent.vehicle.config import BridgeConfig
from agent.vehicle.firmware.profile import Firmware
from agent.vehicle.messages import CommandLong, DecodedMessage, Heartbeat, Inbound, Position
from agent.vehicle.mode_names import ModeNameRequests

_AUTOPILOT_COMPONENT = 1


class Contact:
    """The link as far as it leads to one vehicle.

    Args:
        system_id: the vehicle's; any other is ignored.
    """

    def __init__(self, system_id: int) -> None:
        self._system_id = system_id
        self.wrong_autopilot: int | None = None
        """System id of another vehicle that is heard."""
        self.link_up = False
        self.foreign: dict[int, int] = {}
        """Messages heard from other systems, by system id."""

    def is_from_vehicle(self, heard: DecodedMessage) -> bool:
        """Whether the autopilot of the configured vehicle said it; others are counted."""
        if heard.system_id == self._system_id:
            return heard.component_id == _AUTOPILOT_COMPONENT
        self.foreign[heard.system_id] = self.foreign.get(heard.system_id, 0) + 1
        if isinstance(heard.message, Heartbeat):
            self.wrong_autopilot = heard.system_id
        return False


class PeerLatch:
    """The peer of one link.

    Args:
        silence_s: after so long without proof of the peer, another's counts.
        signed: whether proof is a signature.
    """

    def __init__(self, silence_s: float, *, signed: bool) -> None:
        self._silence_s = silence_s
        self._signed = signed
        self._proved_s = -math.inf
        self.peer: Hashable | None = None
        """Whom to answer; None while nobody has given proof."""
        self.strangers = 0
        """Pieces dropped because somebody else than the peer sent them."""

    def admits(self, source: Hashable, now_s: float, *, proof: bool) -> bool:
        """Whether to listen to what ``source`` sent at ``now_s``; remembers it if it is proof."""
        deserted = self.peer is None or now_s - self._proved_s > self._silence_s
        mine = source == self.peer
        if proof and (mine or deserted or self._signed):
            self.peer, self._proved_s = source, now_s
            return True
        if mine or deserted:  # another vehicle is heard as such, and never commanded
            return True
        self.strangers += 1
        return False

    def excuse_silence(self, now_s: float) -> None:
        """Nobody was listened to: the peer's silence counts from now on."""
        if self.peer is not None:
            self._proved_s = max(self._proved_s, now_s)

    def forget(self) -> None:
        """The link is a new one."""
        self.peer = None


_STREAM_TAG = "stream:"

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


class StreamRequests:
    """Asks one vehicle for its streams, and once for the names of its modes."""

    def __init__(self, config: BridgeConfig, firmware: Firmware) -> None:
        self._config = config
        self._names = ModeNameRequests()
        self._streams: dict[type[Inbound], _Stream] = {
            Position: _Stream(_MSG_ID_POSITION, 1.0 / config.position_rate_hz)
        }
        for message_id, kind in firmware.streams:
            self._streams[kind] = _Stream(message_id, 1.0 / config.status_rate_hz)

    def on_message(self, message: Inbound, now_s: float) -> None:
        """Note that a stream flows."""
        self._names.on_message(message)
        stream = self._streams.get(type(message))
        if stream is not None:
            stream.ask_at_s = now_s + self._patience_s(stream)

    def on_ended(self, ended: CommandEnded, now_s: float) -> None:
        """Be patient with a stream that was refused: it may not exist."""
        self._names.on_ended(ended)
        if ended.ending is not CommandOutcome.REFUSED:
            return
        for stream in self._streams.values():
            if ended.tag == _tag(stream):
                pause_s = _REFUSED_PAUSE_TIMEOUTS * self._config.stream_timeout_s
                stream.ask_at_s = max(stream.ask_at_s, now_s + pause_s)

    def ask_anew(self) -> None:
        """Ask for everything again, because link or autopilot began anew."""
        self._names.ask_anew()
        for stream in self._streams.values():
            stream.ask_at_s = -math.inf

    def advance(self, commands: CommandQueue, now_s: float) -> list[VehicleCommand]:
        """Requests that are due."""
        out = self._names.advance(commands, now_s)
        for stream in self._streams.values():
            if now_s < stream.ask_at_s or commands.pending(_tag(stream)):
                continue
            stream.ask_at_s = now_s + self._patience_s(stream)
            interval_us = 1e6 * stream.interval_s
            params = (float(stream.message_id), interval_us, 0.0, 0.0, 0.0, 0.0, 0.0)
            request = CommandLong(_CMD_SET_MESSAGE_INTERVAL, params)
            out += commands.send(_tag(stream), request, now_s)
        return out

    def _patience_s(self, stream: _Stream) -> float:
        return max(self._config.stream_timeout_s, 3.0 * stream.interval_s)


def _tag(stream: _Stream) -> str:
    return f"{_STREAM_TAG}{stream.message_id}"
