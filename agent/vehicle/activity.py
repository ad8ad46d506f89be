"""What one vehicle is being made to do: one activity at a time.

The bridge has one slot for it. Every kind of activity knows which modes it leads to, and what
it has to say to the vehicle; which follows which stands in `agent.vehicle.transitions`.
"""

from __future__ import annotations

import math
from enum import Enum
from typing import ClassVar

from agent.vehicle.camera_control import Look
from agent.vehicle.commands import CommandEnded
from agent.vehicle.messages import Heartbeat, Inbound, Position
from agent.vehicle.session import POLL_S, VehicleSession


class FlightPhase(Enum):
    """The kinds of activity."""

    IDLE = "idle"
    PREPARING = "preparing"
    HOVERING = "hovering"
    FLYING = "flying"
    HOLDING = "being stopped"
    YIELDING = "giving way"
    RETURNING = "returning"
    LANDING = "landing"
    STANDING = "standing at its base"
    HANDED_OVER = "handed over"


class Activity:
    """What one vehicle is being made to do, and what holds as long as it is."""

    phase: ClassVar[FlightPhase]
    polls: ClassVar[bool] = False
    """It is advanced often even if nothing is heard."""

    def __init__(self, session: VehicleSession) -> None:
        self._session = session

    @property
    def in_our_hands(self) -> bool:
        """Whether the vehicle is, or may be, in the air on our orders."""
        return True

    @property
    def may_disarm(self) -> bool:
        """Whether our orders may lead to stopped motors."""
        return False

    @property
    def flies_home(self) -> bool:
        """Whether it returns on the shortest way."""
        return False

    @property
    def took_off(self) -> bool:
        """Whether it has asked for takeoff."""
        return False

    @property
    def trigger_m(self) -> float | None:
        """How far apart its camera takes pictures [m]; None: it takes none, if it has any."""
        return None

    @property
    def look(self) -> Look | None:
        """What its camera looks at; None: nothing in particular."""
        return None

    def expects(self, heartbeat: Heartbeat) -> bool:
        """Whether our orders lead to that mode; anything else is somebody else's doing."""
        return self.obeys(heartbeat.custom_mode)

    def obeys(self, custom_mode: int) -> bool:
        """Whether the vehicle takes our orders in that mode, be it still taking off on one."""
        firmware = self._session.firmware
        return firmware is not None and (
            self._session.flies_for_us(custom_mode)
            or (firmware.is_taking_off(custom_mode) and self.took_off)
        )

    def on_message(self, message: Inbound) -> None:
        """Take what the vehicle says; its state has been brought up to date."""

    def on_position(self, position: Position) -> None:
        """Take a fresh position that the vehicle trusts."""

    def on_ended(self, ended: CommandEnded) -> None:
        """Take the outcome of a command."""

    def advance(self) -> None:
        """Do what time and state ask for."""

    def next_deadline_s(self) -> float:
        """When `advance` may have something to do."""
        return self._session.now_s + POLL_S if self.polls else math.inf


class Idle(Activity):
    """Nothing: the vehicle stands, or is not ours."""

    phase = FlightPhase.IDLE
    in_our_hands = False


class Hovering(Activity):
    """The vehicle waits in the air for its next target."""

    phase = FlightPhase.HOVERING
