"""What the firmware does of its own when something fails: warn, return, land.

Sources: recordings of both firmwares; ArduCopter's events.cpp and ekf_check.cpp,
AP_BattMonitor; PX4's failsafe framework, which says the same line whatever the cause, and
holds for some seconds before it returns. Left out are failsafes that continue a mission, and
what a firmware says without acting.
"""

from __future__ import annotations

import math
from enum import Enum, auto
from typing import TYPE_CHECKING

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.autopilot.battery import ChargeLevel
from sim.autopilot.events import TextTemplate
from sim.autopilot.flight import FlightMode

if TYPE_CHECKING:
    from sim.autopilot.pilot import Pilot

_RADIO = (TextTemplate(mavlink.MAV_SEVERITY_WARNING, "Radio Failsafe"),)
_GROUND = (TextTemplate(mavlink.MAV_SEVERITY_WARNING, "GCS Failsafe"),)


class _Cause(Enum):
    """What failed."""

    BATTERY = auto()
    GROUND = auto()
    POSITION = auto()
    RADIO = auto()


class FailsafeMonitor:
    """The failsafes of one autopilot, from power-up on."""

    def __init__(self, pilot: Pilot) -> None:
        self._pilot = pilot
        self._battery = pilot.battery
        self._behaviour = pilot.flavour.failsafe_behaviour
        self._position_s: float | None = None
        self._ground_s: dict[int, float] = {}
        """When the heartbeat of each ground station was heard last, by system id."""
        self._deaf_s: float | None = None
        """When nobody is listening any more."""
        self._causes: set[_Cause] = set()
        """What the firmware has acted upon, and is not over."""
        self._latched = False
        """It goes on saying so until the motors stand, whatever the cause comes to."""
        self._held: tuple[float, FlightMode] | None = None
        """When it does more than hold its place, and what."""
        pilot.outbox.muted = False

    @property
    def acts(self) -> bool:
        """Whether a failsafe acts, so that the vehicle says that it is in a critical state."""
        return self._latched or bool(self._causes)

    @property
    def obstacles(self) -> tuple[str, ...]:
        """What of this keeps the vehicle from arming, in its words."""
        if _Cause.BATTERY in self._causes:
            return ("Battery 1 low voltage failsafe", "Battery failsafe")
        # PX4's health report goes by its failsafes; ArduCopter checks other things on the ground.
        return ("Failsafe",) if self._causes and self._behaviour.words else ()

    def battery_changed(self) -> None:
        """The vehicle, standing, has got another battery."""
        self._causes.discard(_Cause.BATTERY)

    def disarmed(self) -> None:
        """The motors stand."""
        self._held = None
        self._latched = False
        if not self._behaviour.critical_when_disarmed:
            self._causes.clear()
        self._causes.discard(_Cause.RADIO)

    def deadline_s(self) -> float | None:
        """When the firmware acts next [s]; None if not foreseen."""
        due_s = (
            self._battery.deadline_s(),
            self._position_s,
            self._ground_lost_s(),
            self._deaf_s,
            None if self._held is None else self._held[0],
        )
        return min((each_s for each_s in due_s if each_s is not None), default=None)

    def advance(self, at_s: float) -> None:
        """Act at the deadline ``at_s``."""
        ground_s = self._ground_lost_s()
        if self._held is not None and self._held[0] <= at_s:
            _, mode = self._held
            self._held = None
            self._take_over(mode, (), at_s)
        elif self._deaf_s is not None and self._deaf_s <= at_s:
            self._deaf_s = None
            self._pilot.outbox.muted = True
        elif self._position_s is not None and self._position_s <= at_s:
            self._position_s = None
            if self._pilot.mode.needs_position:
                self._act(_Cause.POSITION, FlightMode.LAND, self._behaviour.position_words, at_s)
        elif ground_s is not None and ground_s <= at_s:
            self._lose_ground(at_s)
        else:
            self._protect_battery(at_s)

    def hear_ground(self, system_id: int, now_s: float) -> None:
        """A ground station is there."""
        self._ground_s[system_id] = now_s
        self._pilot.outbox.muted = False
        deaf_s = now_s + self._behaviour.deaf_after_s
        self._deaf_s = deaf_s if deaf_s < math.inf else None
        if _Cause.GROUND in self._causes and self._ground_lost_s() is not None:
            self._causes.discard(_Cause.GROUND)
            if not self._causes:
                self._held = None
            regained = self._behaviour.ground_regained
            self._pilot.outbox.text(regained.severity, regained.template)

    def _ground_lost_s(self) -> float | None:
        if not self._ground_s:
            return None
        lost = self._pilot.flavour.ground_lost(self._pilot.parameters)
        if lost is None:
            return None
        heard_s = [at_s for system_id, at_s in self._ground_s.items() if system_id in lost.listens]
        return max(heard_s) + lost.after_s if heard_s else None

    def _lose_ground(self, at_s: float) -> None:
        """Act once, until a ground station is heard again."""
        lost = self._pilot.flavour.ground_lost(self._pilot.parameters)
        self._ground_s.clear()
        if lost is not None and self._pilot.mode not in lost.spared:
            self._act(_Cause.GROUND, lost.mode, _GROUND, at_s)

    def lose_gps(self, now_s: float) -> None:
        """Be without a position from now on."""
        pilot = self._pilot
        if not pilot.readiness.gps_lost:
            pilot.readiness.lose_gps(pilot.position_enu_m(now_s), now_s)
            patience_s = pilot.config.position_failsafe_s
            self._position_s = None if patience_s is None else now_s + patience_s

    def regain_gps(self, now_s: float) -> None:
        """Have a position again; a mode that was changed meanwhile stays."""
        self._pilot.readiness.regain_gps(now_s)
        self._position_s = None
        self._causes.discard(_Cause.POSITION)

    def lose_radio(self, now_s: float) -> None:
        """Return, as when the remote control is not heard any more."""
        self._act(_Cause.RADIO, FlightMode.RTL, _RADIO, now_s)

    def _protect_battery(self, at_s: float) -> None:
        level = self._battery.advance(at_s)
        used_mah = self._battery.consumed_mah(at_s) or 0.0
        fields = {
            "level": level.name.lower(),
            "volts": self._battery.voltage_v(at_s),
            "used_mah": used_mah,
        }
        words = tuple(
            TextTemplate(text.severity, text.template.format(**fields))
            for text in self._behaviour.battery_words
        )
        mode = FlightMode.RTL if level is ChargeLevel.LOW else FlightMode.LAND
        self._act(_Cause.BATTERY, mode, words, at_s)

    def _act(
        self, cause: _Cause, mode: FlightMode, words: tuple[TextTemplate, ...], now_s: float
    ) -> None:
        """Do what the parameters say, at once or after a hold; only what returns is put off."""
        pilot = self._pilot
        if not pilot.armed:
            return
        self._causes.add(cause)
        self._latched = not self._behaviour.critical_when_disarmed
        own = bool(self._behaviour.words)
        if own and cause is not _Cause.BATTERY:
            words = ()
        if mode is FlightMode.RTL and self._behaviour.hold_s > 0.0 and not pilot.flight.on_ground:
            self._held = (now_s + self._behaviour.hold_s, mode)
            self._say((*words, *self._behaviour.hold_words))
            pilot.set_mode(pilot.flavour.modes.for_reposition, now_s)
        else:
            self._held = None
            self._take_over(mode, words, now_s)

    def _take_over(self, mode: FlightMode, words: tuple[TextTemplate, ...], now_s: float) -> None:
        """Enter the mode; on the ground, stop the motors instead.

        ArduCopter tells the mode some milliseconds before the words, which wait in line; PX4
        says the words first, and tells the mode with its next heartbeat.
        """
        pilot = self._pilot
        words_first = bool(self._behaviour.words)
        if words_first:
            self._say((*words, *self._behaviour.words))
        on_ground = pilot.flight.on_ground
        if not on_ground and not pilot.set_mode(mode, now_s):
            pilot.set_mode(FlightMode.LAND, now_s)
        if not words_first:
            self._say(words)
        if on_ground:
            pilot.disarm(now_s, forced=False)

    def _say(self, words: tuple[TextTemplate, ...]) -> None:
        for text in words:
            self._pilot.outbox.text(text.severity, text.template)
