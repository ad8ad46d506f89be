"""The way home: set the return mode until it is seen, then wait for the landing.

Return modes fly at a height of the vehicle's own, in which the layers of a fleet vanish, and
straight through zones. So a vehicle that has the time is first told to fly to where it started, in
its own layer and round zones, and returns from there, or lands. Whatever goes wrong ends that part
at once, as home matters more. Where a zone lies between it and home it lands where it is, then.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

from agent.core.interface import Return
from agent.vehicle.activity import Activity, FlightPhase
from agent.vehicle.commands import CommandEnded, result_text
from agent.vehicle.firmware.profile import UNCHANGED, Firmware
from agent.vehicle.leg import TARGET_TAG, reposition_leg
from agent.vehicle.messages import Heartbeat, LandedState, Outbound, Position
from agent.vehicle.session import VehicleSession
from swarm.protocol.fields import Point

_HOME_M = 15.0
"""Who stands no farther from where it started is at home, if it drives."""
DISARMED_LONG_S = 5.0
"""A vehicle disarmed for that long is down, even if it does not say that it landed."""


class Returning(Activity):
    """Brings the vehicle home: carries out one `Return`.

    Args:
        return_via: flies it to a place first; None if it returns from where it is.
    """

    phase = FlightPhase.RETURNING
    polls = True
    may_disarm = True

    def __init__(
        self,
        session: VehicleSession,
        firmware: Firmware,
        order: Return,
        return_via: ReturnVia | None = None,
    ) -> None:
        super().__init__(session)
        self.order = order
        self._from_mission = session.mission is not None
        self._return_via = return_via
        self._firmware = firmware
        self._mode = session.repeated("return", session.config.mode_tries)
        self._disarm = session.repeated("disarm", session.config.mode_tries)
        self._still_since_s: float | None = None
        self._disarmed_since_s: float | None = None
        self._seen = self._told_seen = False
        self._lands: bool | None = False if return_via is None and not session.guard else None
        """Whether it lands where it is, rather than to return; None as long as it is not known."""
        self.failure: str | None = None
        """Why the vehicle does not return; None while it may."""

    @property
    def flies_home(self) -> bool:
        """Whether it does not fly to a place first."""
        return self._return_via is None

    def on_ended(self, ended: CommandEnded) -> None:
        """Take the outcome of a command."""
        if self._return_via is not None:
            self._return_via.on_ended(ended)
        self._mode.on_ended(ended, self._session.now_s)
        self._disarm.on_ended(ended, self._session.now_s)

    def expects(self, heartbeat: Heartbeat) -> bool:
        """Whether that mode fits the return; anything else is somebody else's doing."""
        if not heartbeat.armed:
            return True
        mode = heartbeat.custom_mode
        if self._firmware.is_returning(mode):
            self._seen = True
            return True
        if self._return_via is not None:
            return self._return_via.expects(mode, from_mission=self._from_mission)
        return self.obeys(mode) and not self._seen

    def obeys(self, custom_mode: int) -> bool:
        """Whether the vehicle takes our orders in that mode, be it still taking off on one."""
        firmware = self._firmware
        return (
            firmware.is_commanded(custom_mode)
            or firmware.is_taking_off(custom_mode)
            or (self._from_mission and firmware.is_mission(custom_mode))
        )

    @property
    def flies_by_place(self) -> bool:
        """Whether it still flies to a place first, by targets."""
        return self._return_via is not None and not self._seen

    def has_begun(self) -> bool:
        """Whether the return mode has been seen; true once."""
        news, self._told_seen = self._seen and not self._told_seen, self._seen
        return news

    def go_straight(self) -> None:
        """Return from where the vehicle is."""
        if self._return_via is not None:
            self._return_via.end()
            # One that cannot stay is not above the place, and its return mode lands it there.
            lands = self.order.land and self._firmware.traits.stays
            self._lands = (self._return_via.arrived and lands) or None
            self._return_via = None

    def go_by(self, order: Return, return_via: ReturnVia) -> None:
        """Fly home by another way, as long as it has not come to the end of the one before."""
        if self._return_via is not None:
            self._return_via.end()
            self.order, self._return_via = order, return_via

    def _is_barred(self) -> bool:
        """Whether zones lie between it and where its return mode leads."""
        session, order = self._session, self.order
        home_enu_m = session.launched_enu_m or order.via_enu_m
        if home_enu_m is None or not session.guard:
            return False
        place_enu_m = session.known_place_m()
        if place_enu_m is None:
            return False
        return session.way_objection(((*home_enu_m[:2], place_enu_m[2]),)) is not None

    def on_position(self, position: Position) -> None:
        """See whether it is where it flies to first, and whether it stands still."""
        if math.hypot(*position.velocity_enu_m_s) > self._session.config.arrival_speed_m_s:
            self._still_since_s = None
        elif self._still_since_s is None:
            self._still_since_s = self._session.now_s
        if self._return_via is not None:
            self._return_via.on_position(position)

    def advance(self) -> None:
        """Set the mode as long as it is not seen and the vehicle still takes our orders."""
        session, heartbeat = self._session, self._session.vehicle.heartbeat
        if heartbeat is None:
            return
        if self._return_via is not None:
            if not self._seen:
                self._return_via.advance(heartbeat)
            if not (self._return_via.done or self._seen):
                return
            self.go_straight()
        if heartbeat.armed:
            self._disarmed_since_s = None
        elif self._disarmed_since_s is None:
            self._disarmed_since_s = session.now_s
        if heartbeat.armed and self._seen and not self._firmware.disarms_itself:
            session.say(*self._disarm_at_rest())
        mode = heartbeat.custom_mode
        if not heartbeat.armed or not self.obeys(mode) or self._firmware.must_rise(mode):
            return
        if self._lands is None:
            self._lands = self._is_barred()
        firmware = self._firmware
        ends = firmware.set_land_mode() if self._lands else firmware.set_return_mode()
        out = self._mode.give(ends, session.now_s)
        if out is None:
            seen = "never seen in the heartbeat"
            why = result_text(self._mode.result) if self._mode.refused else seen
            what = "landing" if self._lands else "return"
            self.failure = f"the {what} mode cannot be set ({why})"
        else:
            session.say(*out)

    def _disarm_at_rest(self) -> Sequence[Outbound]:
        """What stops the motors of a vehicle that has come home and leaves them on."""
        session, still_since_s = self._session, self._still_since_s
        home_enu_m, place_enu_m = session.launched_enu_m, session.known_place_m()
        if still_since_s is None or place_enu_m is None:
            return ()
        at_home = (
            self._lands
            or home_enu_m is None
            or math.dist(home_enu_m[:2], place_enu_m[:2]) <= _HOME_M
        )
        if not at_home or session.now_s - still_since_s < session.config.stall_timeout_s:
            return ()
        return self._disarm.give(self._firmware.disarm(), session.now_s) or ()

    @property
    def is_down(self) -> bool:
        """Whether the vehicle has landed, and its motors stand still."""
        session, since_s = self._session, self._disarmed_since_s
        if session.vehicle.heartbeat is None or session.vehicle.armed:
            return False
        if session.vehicle.landed in (LandedState.ON_GROUND, LandedState.UNDEFINED):
            return True
        return since_s is not None and session.now_s - since_s >= DISARMED_LONG_S


_SLOWEST_M_S = 1.0
"""Cruise speed that is reckoned with where none is known."""

_START_S = 30.0

_PATIENCE = 3.0
"""It may take that many times as long as at cruise speed, and `_START_S` more."""


class ReturnVia:
    """Flies to one place on the way home, or before it lands.

    Args:
        way_enu_m: corners on the way there, then that place [m; mission origin].
        place_enu_m: where the vehicle is.
    """

    def __init__(
        self,
        session: VehicleSession,
        firmware: Firmware,
        way_enu_m: Sequence[Point],
        place_enu_m: Point,
    ) -> None:
        speed_m_s = session.cruise_speed_m_s
        known = speed_m_s > 0.0
        self._session = session
        self._firmware = firmware
        self._mode = session.repeated("homeward mode", 1)
        speed = speed_m_s if known else UNCHANGED
        self._leg = reposition_leg(session, firmware, way_enu_m, speed, insists=False)
        way_m = sum(math.dist(a, b) for a, b in pairwise((place_enu_m, *way_enu_m)))
        flight_s = way_m / (speed_m_s if known else _SLOWEST_M_S)
        self._until_s = session.now_s + _START_S + _PATIENCE * flight_s
        self._mode_seen = self._told = self._over = False

    @property
    def arrived(self) -> bool:
        """The vehicle is there."""
        return self._leg.arrived

    @property
    def done(self) -> bool:
        """The vehicle is there, or will not be."""
        leg = self._leg
        stands = leg.arrived or leg.stopped is not None or leg.failure is not None
        return self._over or self._mode.refused or stands

    def expects(self, custom_mode: int, *, from_mission: bool) -> bool:
        """Whether that mode fits; anything else is somebody else's doing."""
        if self._firmware.is_commanded(custom_mode):
            self._mode_seen = True
            return True
        return from_mission and not self._mode_seen and self._firmware.is_mission(custom_mode)

    def on_ended(self, ended: CommandEnded) -> None:
        """Take a command's outcome."""
        self._mode.on_ended(ended, self._session.now_s)
        self._leg.on_ended(ended)

    def on_position(self, position: Position) -> None:
        """See whether it is there, or stands still elsewhere."""
        self._leg.on_position(position)

    def advance(self, heartbeat: Heartbeat) -> None:
        """Tell the vehicle what is still to be told: the mode until it is seen, then the place."""
        session = self._session
        self._over |= session.now_s >= self._until_s
        if self.done or self._told:
            return
        if self._firmware.is_commanded(heartbeat.custom_mode):
            self._told = True
            self._leg.start()
            return
        out = self._mode.give(self._firmware.set_commanded_mode(), session.now_s)
        self._over = out is None
        session.say(*out or ())

    def end(self) -> None:
        """It returns from where it is; nothing more is told about the place."""
        self._session.say(*self._mode.cancel(self._session.now_s))
        self._session.cancel(TARGET_TAG)
