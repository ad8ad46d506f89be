"""The activity of getting a vehicle ready, once there is one of the right kind to command.

Its steps stand in agent.vehicle.preparation.
"""

from __future__ import annotations

from agent.core.interface import Prepare
from agent.vehicle.activity import Activity, FlightPhase
from agent.vehicle.commands import CommandEnded
from agent.vehicle.messages import Inbound, Position
from agent.vehicle.preflight import wrong_kind
from agent.vehicle.preparation import NO_PLACE, Preparation
from agent.vehicle.session import VehicleSession


class Preparing(Activity):
    """Prepares the vehicle for flight, once there is one to command.

    Args:
        ours: the vehicle flew, or was about to fly, on our orders.
    """

    phase = FlightPhase.PREPARING
    polls = True
    may_disarm = True
    """Autopilots disarm by themselves if nothing follows."""

    def __init__(self, session: VehicleSession, order: Prepare, *, ours: bool) -> None:
        super().__init__(session)
        self.order = order
        self._ours = ours
        self._preparation: Preparation | None = None

    @property
    def in_our_hands(self) -> bool:
        """Whether the motors run, or may run, because of us."""
        return self._preparation is not None and self._preparation.engaged

    @property
    def took_off(self) -> bool:
        """Whether it has asked for takeoff."""
        return self._preparation is not None and self._preparation.took_off

    @property
    def done(self) -> bool:
        """Whether the vehicle is where it should be, with its cruise speed set."""
        return self._preparation is not None and self._preparation.done and self._session.is_placed

    @property
    def failure(self) -> str | None:
        """Why it will not get there; None while it may."""
        return None if self._preparation is None else self._preparation.failure

    @property
    def disturbed(self) -> bool:
        """Whether somebody else was seen to have armed or flown it."""
        return self._preparation is not None and self._preparation.disturbed

    def begin_anew(self) -> None:
        """It is another vehicle, as far as what was begun goes."""
        self._preparation = None

    def on_reboot(self) -> None:
        """The autopilot began anew."""
        self._preparation, self._ours = None, False

    def on_message(self, message: Inbound) -> None:
        """Take what matters of a message beside the vehicle's state."""
        if self._preparation is not None:
            self._preparation.on_message(message)

    def on_position(self, position: Position) -> None:
        """Take a fresh position."""
        if self._preparation is not None:
            self._preparation.on_position(position)

    def on_ended(self, ended: CommandEnded) -> None:
        """Take the outcome of a command."""
        if self._preparation is not None:
            self._preparation.on_ended(ended)

    def advance(self) -> None:
        """Do what the state seen asks for next, and say what is waited for."""
        session, heartbeat = self._session, self._session.vehicle.heartbeat
        if reason := session.missing() or wrong_kind(self.order, session.firmware):
            session.tell_not_ready(reason)
            return
        if heartbeat is None or session.firmware is None:
            return
        if self._preparation is None:
            self._preparation = Preparation(session, session.firmware, self.order, ours=self._ours)
        preparation = self._preparation
        preparation.advance(heartbeat)
        preparation.tell_cautions()
        if not self.done and preparation.failure is None:
            session.tell_not_ready(NO_PLACE if preparation.done else preparation.waiting_for)
