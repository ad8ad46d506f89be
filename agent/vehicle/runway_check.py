"""Puts its landing on a plane that needs a runway, before its motors start.

First it is read how the plane lands, and whether its return mode leads there; then the landing is
put on it as a mission, in place of whatever stood there, and read back; where the plane takes off
by that mission, too, it is set to begin there. It stays there: what
brings the plane home is the plane's own return, whoever orders it, and with nobody there at all.
"""

from __future__ import annotations

from agent.core.interface import Runway
from agent.vehicle.firmware.profile import Firmware
from agent.vehicle.messages import Inbound, MissionCurrent, MissionSetCurrent, ParameterRead
from agent.vehicle.mission_transfer import MissionFailed, MissionPolicy, MissionTransfer
from agent.vehicle.parameter_reading import PAUSE_TIMEOUTS, TRIES, ParameterReading
from agent.vehicle.session import VehicleSession


class RunwayCheck:
    """The landing of one plane, on its way there.

    Args:
        firmware: of the plane, or of what needs no runway and is fine without.
        runway: where it is to land; None: it is not said.
        up_m: height at which its take-off ends [m; mission origin].
    """

    def __init__(
        self, firmware: Firmware, session: VehicleSession, runway: Runway | None, up_m: float
    ) -> None:
        config = session.config
        self._firmware, self._session, self._runway = firmware, session, runway
        self._up_m = up_m
        self._begins_at: int | None = None
        """The item that the plane says it would begin with."""
        self._needed = firmware.traits.needs_runway
        self._reading = ParameterReading(firmware, firmware.landing_names)
        policy = MissionPolicy(
            config.mission_reply_timeout_s, config.mission_tries, firmware.mission_vehicle_items
        )
        self._transfer = MissionTransfer(policy)
        self._asked = 0
        self._uploads = 0
        self._next_s = 0.0
        self._fault: str | None = None
        """Why the last upload failed."""
        self.failure: str | None = None
        """Why its landing cannot be put on it; None while it may."""

    def on_message(self, message: Inbound) -> None:
        """Take a parameter's value, or what belongs to the transfer."""
        if self._needed:
            self._reading.on_message(message)
            session = self._session
            session.say(*self._transfer.on_message(message, session.now_s))
        if isinstance(message, MissionCurrent):
            self._begins_at = message.seq

    def advance(self) -> str | None:
        """Carry on, on the ground; why its motors are not started yet, in words."""
        now_s = self._session.now_s
        if not self._needed:
            return None
        if self._transfer.in_force is not None:
            return self._rewind()
        if self._transfer.busy:
            self._session.say(*self._transfer.on_time(now_s))
        elif self._runway is None:
            return "the mission does not say in which direction it lands"
        elif (unread := self._unread) and self._asked < TRIES:
            return self._ask(unread)
        else:
            return self._put(self._runway)
        return self._putting

    def _rewind(self) -> str | None:
        """Let its mission begin where it takes off, whatever an earlier flight has left."""
        session, first = self._session, self._firmware.first_item
        if first is None or self._begins_at == first:
            return None
        if session.now_s >= self._next_s:
            self._next_s = session.now_s + session.config.commands.ack_timeout_s
            session.say(MissionSetCurrent(first))
        return "setting the first item of its mission"

    @property
    def _putting(self) -> str:
        again = f" failed ({self._fault}), trying again" if self._fault else ""
        return f"putting its landing on it{again}"

    @property
    def _unread(self) -> tuple[str, ...]:
        return self._reading.unread((name,) for name in self._reading.names)

    def _ask(self, names: tuple[str, ...]) -> str:
        session = self._session
        if session.now_s >= self._next_s:
            self._asked += 1
            pause_s = PAUSE_TIMEOUTS * session.config.commands.ack_timeout_s
            self._next_s = session.now_s + pause_s
            session.say(*map(ParameterRead, names))
        return "reading how it lands"

    def _put(self, runway: Runway) -> str:
        """Put the landing on it, if it is time; what is waited for, in words."""
        session, config = self._session, self._session.config
        if isinstance(result := self._transfer.result, MissionFailed):
            self._fault, self._transfer.result = result.reason, None
            self._next_s = session.now_s + config.retry_delay_s
        landing = self._firmware.runway_landing(self._reading.values)
        if isinstance(landing, str):
            self._reread()
            return landing
        if objection := config.out_of_bounds(landing.circle_enu_m(runway)):
            return f"its approach: {objection}"
        if session.now_s < self._next_s:
            return self._putting
        if self._uploads >= config.mode_tries:
            self.failure = f"its landing cannot be put on it: {self._fault}"
            return self.failure
        self._uploads += 1
        self._begins_at = None  # what was told before is of an earlier mission
        items = self._firmware.runway_mission(landing, runway, self._up_m, config.origin)
        session.say(*self._transfer.upload(items, session.now_s))
        return self._putting

    def _reread(self) -> None:
        """What keeps the plane on the ground may be set meanwhile."""
        session = self._session
        if session.now_s >= self._next_s:
            self._next_s = session.now_s + session.config.retry_delay_s
            session.say(*map(ParameterRead, self._reading.names))
