"""What a firmware says unasked, as data: a line for people, a command for other components.

Leaves out: which firmware says what (sim.autopilot.flavours).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum, auto

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.autopilot.events import Outbox

__all__ = ["Narrator", "Occasion", "OwnCommand", "Text"]


class Occasion(Enum):
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
    RETURN_ORDERED = auto()
    """By a command, from the ground or in a mission."""
    RETURN_BEGUN = auto()
    """[altitude_m, above_home_m]"""
    RETURN_LANDING = auto()
    """Above home."""
    RETURN_LANDED = auto()


@dataclass(frozen=True, slots=True)
class Text:
    """A line for people."""

    severity: int
    """MAV_SEVERITY."""
    template: str
    """For `str.format`, with the fields of its occasion."""


@dataclass(frozen=True, slots=True)
class OwnCommand:
    """A command to gimbals and cameras, which every ground station hears too."""

    command: int
    """MAV_CMD."""
    params: tuple[float, float, float, float, float, float, float]


class Narrator:
    """Says what the firmware says on an occasion; mostly nothing."""

    def __init__(
        self,
        outbox: Outbox,
        texts: Mapping[Occasion, Text],
        own_commands: Mapping[Occasion, OwnCommand],
        system_id: int,
    ) -> None:
        self._outbox = outbox
        self._texts = texts
        self._own_commands = own_commands
        self._system_id = system_id

    def tell(self, occasion: Occasion, **fields: object) -> None:
        """Speak of an occasion, with the fields that its text may name."""
        text = self._texts.get(occasion)
        if text is not None:
            self._outbox.text(text.severity, text.template.format(**fields))
        own = self._own_commands.get(occasion)
        if own is not None:
            self._outbox.broadcast(
                mavlink.MAVLink_command_long_message(
                    self._system_id, 0, own.command, 0, *own.params
                )
            )
