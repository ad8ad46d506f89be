"""What a simulated vehicle hears, and how it collects what it says.

A *channel* is one link to a ground station (a TCP connection, a UDP peer); the
shell numbers them. Leaves out: bytes (sim.autopilot.codec) and sockets.
"""

from __future__ import annotations

from dataclasses import dataclass

from pymavlink.dialects.v20 import ardupilotmega as mavlink

__all__ = [
    "Connected",
    "Disconnected",
    "Event",
    "Outbox",
    "Reboot",
    "Received",
    "Send",
    "Sender",
    "Tick",
]


_TEXT = 50
"""Characters in a STATUSTEXT."""


@dataclass(frozen=True, slots=True)
class Connected:
    """A ground station can be spoken to on that channel from now on."""

    channel: int


@dataclass(frozen=True, slots=True)
class Disconnected:
    """The channel is gone, with all that was asked on it."""

    channel: int


@dataclass(frozen=True, slots=True)
class Received:
    """A well-formed message arrived."""

    channel: int
    message: mavlink.MAVLink_message


@dataclass(frozen=True, slots=True)
class Tick:
    """Time has passed."""


@dataclass(frozen=True, slots=True)
class Reboot:
    """The autopilot loses power for a moment; in the air, the vehicle falls."""


Event = Connected | Disconnected | Received | Tick | Reboot


@dataclass(frozen=True, slots=True)
class Send:
    """A message to put on one channel, or on all of them."""

    message: mavlink.MAVLink_message
    channel: int | None = None
    """None: every channel there is."""
    system_id: int | None = None
    """Whom it is said to come from; None: the vehicle's own id."""


@dataclass(frozen=True, slots=True)
class Sender:
    """Whom an answer goes to."""

    channel: int
    system: int
    component: int


class Outbox:
    """Messages in the order in which they are to be sent."""

    def __init__(self, *, numbers_texts: bool = False) -> None:
        self._sends: list[Send] = []
        self._numbers_texts = numbers_texts
        """Texts end in a tab, are numbered, and are sent in pieces if they are long."""
        self._text_number = 0
        self.muted = False
        """Nobody is there to whom texts would be said."""

    def broadcast(self, message: mavlink.MAVLink_message) -> None:
        """Say something to every ground station."""
        self._sends.append(Send(message))

    def reply(self, to: Sender, message: mavlink.MAVLink_message) -> None:
        """Say something on the channel of one ground station."""
        self._sends.append(Send(message, to.channel))

    def on_channel(self, channel: int, message: mavlink.MAVLink_message) -> None:
        """Say something on one channel."""
        self._sends.append(Send(message, channel))

    def text(self, severity: int, text: str) -> None:
        """Say a line to people (STATUSTEXT), cut at 50 characters unless texts are numbered."""
        if self.muted:
            return
        if not self._numbers_texts:
            self.broadcast(mavlink.MAVLink_statustext_message(severity, text.encode()[:_TEXT]))
            return
        encoded = f"{text}\t".encode()
        for place, start in enumerate(range(0, len(encoded), _TEXT)):
            piece = encoded[start : start + _TEXT]
            self.broadcast(
                mavlink.MAVLink_statustext_message(severity, piece, self._text_number, place)
            )
        self._text_number = self._text_number % 0xFFFF + 1

    def put(self, sends: list[Send]) -> None:
        """Say what was taken before."""
        self._sends += sends

    def take(self) -> list[Send]:
        """All that was said since the last call."""
        sends, self._sends = self._sends, []
        return sends
