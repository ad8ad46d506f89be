"""What a simulated vehicle hears, what its firmware says unasked, and all it says, collected."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, auto
from typing import TYPE_CHECKING

from pymavlink.dialects.v20 import ardupilotmega as mavlink

if TYPE_CHECKING:
    from sim.autopilot.firmware.model import FirmwareModel

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
class MavlinkReceived:
    """A well-formed message arrived."""

    channel: int
    message: mavlink.MAVLink_message


@dataclass(frozen=True, slots=True)
class TimeAdvanced:
    """Time has passed."""


@dataclass(frozen=True, slots=True)
class Reboot:
    """The autopilot loses power for a moment; in the air, the vehicle falls."""


VehicleEvent = Connected | Disconnected | MavlinkReceived | TimeAdvanced | Reboot


@dataclass(frozen=True, slots=True)
class OutgoingMessage:
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
        self._sends: list[OutgoingMessage] = []
        self._numbers_texts = numbers_texts
        """Texts end in a tab, are numbered, and are sent in pieces if they are long."""
        self._text_number = 0
        self.muted = False
        """Nobody is there to whom texts would be said."""

    def broadcast(self, message: mavlink.MAVLink_message) -> None:
        """Say something to every ground station."""
        self._sends.append(OutgoingMessage(message))

    def reply(self, to: Sender, message: mavlink.MAVLink_message) -> None:
        """Say something on the channel of one ground station."""
        self._sends.append(OutgoingMessage(message, to.channel))

    def on_channel(self, channel: int, message: mavlink.MAVLink_message) -> None:
        """Say something on one channel."""
        self._sends.append(OutgoingMessage(message, channel))

    def text(self, severity: int, text: str, *, plain: bool = False) -> None:
        """Say a line to people (STATUSTEXT), cut at 50 characters unless texts are numbered."""
        if self.muted:
            return
        if not self._numbers_texts:
            self.broadcast(mavlink.MAVLink_statustext_message(severity, text.encode()[:_TEXT]))
            return
        encoded = text.encode() if plain else f"{text}\t".encode()
        for place, start in enumerate(range(0, len(encoded), _TEXT)):
            piece = encoded[start : start + _TEXT]
            self.broadcast(
                mavlink.MAVLink_statustext_message(severity, piece, self._text_number, place)
            )
        self._text_number = self._text_number % 0xFFFF + 1

    def put(self, sends: list[OutgoingMessage]) -> None:
        """Say what was taken before."""
        self._sends += sends

    def take(self) -> list[OutgoingMessage]:
        """All that was said since the last call."""
        sends, self._sends = self._sends, []
        return sends


class FirmwareEvent(Enum):
    """Something a firmware may speak of; in brackets the fields its text may name."""

    ARMED = auto()
    ARMING_REFUSED = auto()
    """[obstacle]"""
    NOT_READY = auto()
    """Now and then, while arming would be refused [obstacle]."""
    DISARMED = auto()
    """By a command."""
    DISARMED_UNUSED = auto()
    """By itself, long after arming, on the ground."""
    DISARMED_LANDED = auto()
    """By itself, after landing."""
    DISARMING_REFUSED = auto()
    LIFTED_OFF = auto()
    LANDED = auto()
    TAKE_OFF_RAISED = auto()
    """The height asked for was too low [height_m]."""
    NO_SUCH_MODE = auto()
    """[number]"""
    MODE_REFUSED = auto()
    """[mode, reason]"""
    TARGET_OUTSIDE_FENCE = auto()
    FENCE_RECEIVED = auto()
    FENCE_REFUSED = auto()
    """[reason]"""
    FENCE_KEPT = auto()
    """The old one, since it was refused."""
    FENCE_WITHOUT_HOME = auto()
    """It was taken, and keeps the vehicle out of its own home."""
    FENCE_BREACHED = auto()
    FENCE_ACTED = auto()
    """The mode was changed for that."""
    FENCE_CLEARED = auto()
    """The vehicle is where it may be again."""
    MISSION_RECEIVED = auto()
    MISSION_REPLACED = auto()
    """While it is flown, and the vehicle takes up the new one."""
    MISSION_REPLACED_IN_VAIN = auto()
    """While it is flown, and there is nothing left to fly."""
    MISSION_BEGUN = auto()
    MISSION_CLIMB = auto()
    """Straight up, before the first item [height_m]."""
    MISSION_UNAVAILABLE = auto()
    """The mission mode was acknowledged and isn't entered; in the air."""
    MISSION_UNAVAILABLE_ON_GROUND = auto()
    MISSION_WITHOUT_TAKE_OFF = auto()
    ITEM_BEGUN = auto()
    """[seq, name]"""
    WAYPOINT_REACHED = auto()
    """[seq]"""
    MISSION_OVER = auto()
    """In the air."""
    MISSION_OVER_ON_GROUND = auto()
    LANDING_ORDERED = auto()
    """By the command for it."""
    RETURN_ORDERED = auto()
    """By a command, from the ground or in a mission."""
    RETURN_BEGUN = auto()
    """[altitude_m, above_home_m]"""
    RETURN_LANDING = auto()
    """Above home."""
    RETURN_LANDED = auto()


@dataclass(frozen=True, slots=True)
class TextTemplate:
    """A line for people."""

    severity: int
    """MAV_SEVERITY."""
    template: str
    """For `str.format`, with the fields of its occasion."""
    plain: bool = False
    """It ends without a tab where others end in one."""


@dataclass(frozen=True, slots=True)
class OwnCommand:
    """A command to gimbals and cameras, which every ground station hears too."""

    command: int
    """MAV_CMD."""
    params: tuple[float, float, float, float, float, float, float]


class Narrator:
    """Says what the firmware says on an occasion; mostly nothing."""

    def __init__(self, outbox: Outbox, flavour: FirmwareModel, system_id: int) -> None:
        self._outbox = outbox
        self._flavour = flavour
        self._system_id = system_id

    def tell(self, occasion: FirmwareEvent, **fields: object) -> None:
        """Speak of an occasion, with the fields that its text may name."""
        text = self._flavour.texts.get(occasion)
        if text is not None:
            words = text.template.format(**fields)
            self._outbox.text(text.severity, words, plain=text.plain)
        own = self._flavour.own_commands.get(occasion)
        if own is not None:
            self._outbox.broadcast(
                mavlink.MAVLink_command_long_message(
                    self._system_id, 0, own.command, 0, *own.params
                )
            )
