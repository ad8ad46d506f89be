"""A vehicle is stopped where it is: in the air it hovers, on the ground it is disarmed.

Out of a mission, a return or a takeoff in a mode of its own, the guided mode stops the
vehicle. In the guided mode the firmware's own pause does, which needs no place; where there
is none, a target at the place where the vehicle can stop, if what it told before bears that
out, or the nearest within the fence. All are told again until the effect is seen.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from agent.core.interface import GoTo, Hold, Prepare
from agent.vehicle.activity import Activity, FlightPhase
from agent.vehicle.commands import (
    CommandEnded,
    RepeatedCommand,
    VehicleCommand,
    result_text,
)
from agent.vehicle.firmware.profile import Firmware
from agent.vehicle.leg import TARGET_TAG
from agent.vehicle.messages import Heartbeat, LandedState, Position
from agent.vehicle.returning import Returning
from agent.vehicle.session import VehicleSession
from agent.vehicle.yielding import Yielding
from swarm.model.frames import wgs84_from_enu


class Holding(Activity):
    """Stops the vehicle: carries out one `Hold`.

    Args:
        leaves: whether a mode is one that the vehicle flies on our orders, and may be
            taken out of.
        motors_asked: the vehicle may be about to arm.
        returning: what goes on if the vehicle cannot be stopped.
        prepare_next: ordered of a vehicle that has to be stopped first.
        go_next: alike.
        yielding: how it makes room for another UAV once it stands.
    """

    phase = FlightPhase.HOLDING
    polls = True

    def __init__(
        self,
        session: VehicleSession,
        firmware: Firmware,
        order: Hold,
        leaves: Callable[[int], bool],
        *,
        motors_asked: bool = False,
        returning: Returning | None = None,
        prepare_next: Prepare | None = None,
        go_next: GoTo | None = None,
        yielding: Yielding | None = None,
    ) -> None:
        super().__init__(session)
        self.order = order
        self.returning = returning
        self.prepare_next = prepare_next
        self.go_next = go_next
        self.yielding = yielding
        self._firmware = firmware
        self._leaves = leaves
        self._motors_asked = motors_asked
        tries = session.config.mode_tries
        self._mode = session.repeated("hold mode", tries)
        self._disarm = session.repeated("disarm", tries)
        self._stop = session.repeated(TARGET_TAG, tries)
        self._stop_message: VehicleCommand | None = None
        """What it was told last to stop in the guided mode."""
        self._lost_since_s: float | None = None
        self._told = False
        """The vehicle has taken the place to hover at, or was taken out of another mode."""
        self._guided_seen = False
        self.done = False
        self.aloft = False
        """The vehicle is in the air, as far as it said."""
        self.failure: str | None = None
        """Why it does not stop; None while it may."""

    @property
    def flies_home(self) -> bool:
        """Whether it was on the shortest way home."""
        return self.returning is not None and self.returning.flies_home

    @property
    def may_disarm(self) -> bool:
        """On the ground, or where a return may be about to land it."""
        return self.returning is not None or not self.aloft

    def expects(self, heartbeat: Heartbeat) -> bool:
        """Whether that mode fits; anything else is somebody else's doing."""
        return not heartbeat.armed or self.expects_mode(heartbeat.custom_mode)

    def expects_mode(self, custom_mode: int) -> bool:
        """Whether that mode of an armed vehicle fits."""
        if self._firmware.is_commanded(custom_mode):
            self._guided_seen = True
            return True
        return not self._guided_seen and self._leaves(custom_mode)

    def on_ended(self, ended: CommandEnded) -> None:
        """Take a command's outcome."""
        now_s = self._session.now_s
        self._mode.on_ended(ended, now_s)
        self._told |= self._stop.on_ended(ended, now_s)
        if self._disarm.on_ended(ended, now_s):
            self._motors_asked = False

    def on_position(self, position: Position) -> None:
        """See whether it has stopped."""
        arrival_speed_m_s = self._session.config.arrival_speed_m_s
        slow = math.hypot(*position.velocity_enu_m_s) <= arrival_speed_m_s
        slow |= not self._firmware.traits.stays  # where it was told to stay it circles
        if self._told and self._guided_seen and slow:
            self.done = True

    def advance(self) -> None:
        """Tell the vehicle what is still to be told."""
        vehicle, heartbeat = self._session.vehicle, self._session.vehicle.heartbeat
        if self.done or self.failure is not None or heartbeat is None:
            return
        self.aloft = heartbeat.armed and vehicle.landed is not LandedState.ON_GROUND
        if not heartbeat.armed and not self._motors_asked:
            self.done = True
        elif not self.aloft:
            self._tell(self._disarm, self._firmware.disarm())
        elif self._firmware.must_rise(heartbeat.custom_mode):
            self._session.say(*self._mode.cancel(self._session.now_s))
        elif not self._firmware.is_commanded(heartbeat.custom_mode):
            # The guided mode begins with a stop, which is given the time to be seen.
            self._told = True
            self._stop.wait(self._session.now_s)
            self._tell(self._mode, self._firmware.set_commanded_mode())
        else:
            self._guided_seen = True
            self._say(self._stop, self._stop.give_made(self._still, self._session.now_s))
            if self._stop_message is None and self._session.stops_at_m() is None:
                self._miss_place()

    def _still(self) -> VehicleCommand | None:
        """What stops it: a pause, or a target where it can stop, as it comes back to a nearer one.

        The one that it took, if it did. None as long as it is not known where it is.
        """
        session, config = self._session, self._session.config
        if self._stop.accepted:
            return self._stop_message
        if (pause := self._firmware.pause()) is not None:
            self._stop_message = pause
        elif (place_enu_m := session.stops_at_m()) is not None:
            place = wgs84_from_enu(config.origin, config.within_fence(place_enu_m))
            self._stop_message = self._firmware.reposition(*place, session.cruise_speed_m_s)
        return self._stop_message

    def _miss_place(self) -> None:
        """It is not known where it is: wait for that, but not for long."""
        session = self._session
        if self._lost_since_s is None:
            self._lost_since_s = session.now_s
        elif session.now_s - self._lost_since_s >= session.config.position_timeout_s:
            self.failure = "the places that it tells are too far apart to stop it at one"

    def _tell(self, command: RepeatedCommand, message: VehicleCommand) -> None:
        self._say(command, command.give(message, self._session.now_s))

    def _say(self, command: RepeatedCommand, out: list[VehicleCommand] | None) -> None:
        """What is to be sent of a command; None: it was given often enough."""
        if out is None:
            why = f": {result_text(command.result)}" if command.refused else ""
            self.failure = f"the vehicle was told to stop {command.given} times and goes on{why}"
        else:
            self._session.say(*out)


def modes_to_leave(
    firmware: Firmware, mode: int, *, took_off: bool, on_missions: bool, returning: bool
) -> Callable[[int], bool]:
    """Which modes the vehicle may be taken out of: its ``mode``, and those our orders led to."""

    def leaves(custom_mode: int) -> bool:
        return (
            custom_mode == mode
            or (took_off and firmware.is_taking_off(custom_mode))
            or (on_missions and firmware.is_mission(custom_mode))
            or (returning and firmware.is_returning(custom_mode))
        )

    return leaves
