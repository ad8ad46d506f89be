"""A landing for another battery: above the place if it is not there, down, until it is disarmed.

A vehicle that an earlier life of the agent left on its way down, or on the ground, is taken as it
is found. One that somebody else flies is not landed.
"""

from __future__ import annotations

import math

from agent.core.interface import Swap
from agent.vehicle.activity import Activity, FlightPhase
from agent.vehicle.commands import CommandEnded, result_text
from agent.vehicle.firmware.profile import Firmware
from agent.vehicle.messages import Heartbeat, LandedState, Position
from agent.vehicle.returning import DISARMED_LONG_S, ReturnVia
from agent.vehicle.session import VehicleSession

_ABOVE_M = 3.0
"""Who hovers nearer than that to a place, seen from above, lands on it."""


class Landing(Activity):
    """Lands the vehicle: carries out one `Swap`.

    Args:
        ours: the vehicle flies, or may fly, on our orders. If not, it is looked at first.
    """

    phase = FlightPhase.LANDING
    polls = True
    may_disarm = True

    def __init__(self, session: VehicleSession, order: Swap, *, ours: bool) -> None:
        super().__init__(session)
        self.order = order
        self._ours = ours
        self._from_mission = session.mission is not None
        tries = session.config.mode_tries
        self._mode = session.repeated("land", tries)
        self._disarm = session.repeated("disarm", tries)
        self._approach: ReturnVia | None = None
        self._begun = self._seen = False
        self._on_ground_since_s: float | None = None
        self._disarmed_since_s: float | None = None
        self.failure: str | None = None
        """Why it is not landed; None while it may be."""
        self.taken: str | None = None
        """Why it is not ours to land; None while it may be."""
        session.tell_anew()

    @property
    def in_our_hands(self) -> bool:
        """Whether it flies, or may fly, on our orders."""
        return self._ours

    @property
    def flies_home(self) -> bool:
        """Whether it comes down, on the shortest way."""
        return self._begun and self._approach is None

    @property
    def is_down(self) -> bool:
        """Whether it has landed, and its motors stand still."""
        session, since_s = self._session, self._disarmed_since_s
        if session.vehicle.heartbeat is None or session.vehicle.armed or session.silent:
            return False
        if session.vehicle.landed is LandedState.ON_GROUND:
            return True
        return since_s is not None and session.now_s - since_s >= DISARMED_LONG_S

    def expects(self, heartbeat: Heartbeat) -> bool:
        """Whether that mode fits the landing; anything else is somebody else's doing."""
        firmware, mode = self._session.firmware, heartbeat.custom_mode
        if not heartbeat.armed or firmware is None:
            return True
        if self._approach is None and firmware.is_landing(mode):
            self._seen = True
            return True
        if self._approach is not None:
            return self._approach.expects(mode, from_mission=self._from_mission)
        return self.obeys(mode) and not self._seen

    def obeys(self, custom_mode: int) -> bool:
        """Whether the vehicle takes our orders in that mode, be it still taking off on one."""
        firmware = self._session.firmware
        return firmware is not None and (
            firmware.is_commanded(custom_mode)
            or firmware.is_taking_off(custom_mode)
            or (self._from_mission and firmware.is_mission(custom_mode))
        )

    def on_ended(self, ended: CommandEnded) -> None:
        """Take the outcome of a command."""
        now_s = self._session.now_s
        if self._approach is not None:
            self._approach.on_ended(ended)
        self._mode.on_ended(ended, now_s)
        self._disarm.on_ended(ended, now_s)

    def on_position(self, position: Position) -> None:
        """See whether it is above the place."""
        if self._approach is not None:
            self._approach.on_position(position)

    def advance(self) -> None:
        """Do what time and state ask for."""
        session, heartbeat, firmware = (
            self._session,
            self._session.vehicle.heartbeat,
            self._session.firmware,
        )
        if session.missing() is None and heartbeat is not None and not heartbeat.armed:
            if self._disarmed_since_s is None:
                self._disarmed_since_s = session.now_s
            return
        self._disarmed_since_s = None
        if not self._ours and not self._look():
            return
        if heartbeat is None or firmware is None or session.silent:
            return
        if not self._begun:
            self._begin(firmware)
        if not self._begun:
            session.tell_not_ready("waiting for a position")
            return
        if self._approach is not None and self._approaches(self._approach, heartbeat):
            return
        if self.failure is None:
            self._come_down(heartbeat, firmware)

    def _look(self) -> bool:
        """Find out whether a vehicle that an earlier life left is ours to land."""
        session, heartbeat, firmware = (
            self._session,
            self._session.vehicle.heartbeat,
            self._session.firmware,
        )
        reason = session.missing()
        if reason is None and session.vehicle.landed is LandedState.UNDEFINED:
            reason = "waiting to hear whether it flies (EXTENDED_SYS_STATE)"
        if reason is None and session.mission is not None and session.flies_unknown_mission():
            session.mission.look()
            reason = "reading the mission that the vehicle flies"
        if reason is not None or heartbeat is None or firmware is None:
            session.tell_not_ready(reason or "waiting for the autopilot")
            return False
        mode = heartbeat.custom_mode
        if firmware.is_landing(mode):
            self._begun = self._seen = True
        elif not (session.flies_for_us(mode) or self.obeys(mode)):
            self.taken = (
                f"its pilot flies it in {firmware.mode_name(mode, session.vehicle.told_modes)}"
            )
            return False
        self._ours = True
        return True

    def _begin(self, firmware: Firmware) -> None:
        """Fly above the place, unless it is there."""
        session = self._session
        if session.vehicle.landed is LandedState.ON_GROUND:
            self._begun = True
            return
        place_enu_m = session.known_place_m()
        if place_enu_m is None:
            return  # told in a moment, or it is handed over for that
        self._begun = True
        above_enu_m = session.config.within_fence((*self.order.position_enu_m[:2], place_enu_m[2]))
        if math.dist(place_enu_m, above_enu_m) <= _ABOVE_M:
            return
        self.failure = session.way_objection((above_enu_m,))
        if self.failure is None:
            self._approach = ReturnVia(session, firmware, (above_enu_m,), place_enu_m)

    def _approaches(self, approach: ReturnVia, heartbeat: Heartbeat) -> bool:
        """Whether it is still on its way above the place."""
        approach.advance(heartbeat)
        if not approach.done:
            return True
        approach.end()
        self._approach = None
        if not approach.arrived:
            self.failure = "it did not come above the place where it was to land"
            return True
        return False

    def _come_down(self, heartbeat: Heartbeat, firmware: Firmware) -> None:
        """Have it land, and disarm it if it does not disarm by itself."""
        session = self._session
        stands = self._seen and not firmware.disarms_itself
        if session.vehicle.landed is not LandedState.ON_GROUND and not stands:
            self._on_ground_since_s = None
        elif self._on_ground_since_s is None:
            self._on_ground_since_s = session.now_s
        elif session.now_s - self._on_ground_since_s >= session.config.disarm_after_s:
            out = self._disarm.give(firmware.disarm(), session.now_s)
            if out is None:
                session.tell_not_ready("it stands on the ground and does not disarm")
            session.say(*out or ())
            return
        if not self.obeys(heartbeat.custom_mode):
            return
        out = self._mode.give(firmware.set_land_mode(), session.now_s)
        if out is None:
            seen = "never seen in the heartbeat"
            why = result_text(self._mode.result) if self._mode.refused else seen
            self.failure = f"the landing mode cannot be set ({why})"
        session.say(*out or ())
