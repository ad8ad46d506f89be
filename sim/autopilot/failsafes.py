"""What the firmware does of its own when something fails: warn, return, land.

Sources: ArduCopter's events.cpp and ekf_check.cpp, AP_BattMonitor; PX4's failsafe framework,
which says the same line whatever the cause. Leaves out: failsafes that continue a mission,
and what a firmware says without acting.
"""

from __future__ import annotations

from typing import Protocol

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.autopilot.battery import Battery, ChargeLevel
from sim.autopilot.config import VehicleConfig
from sim.autopilot.events import Outbox
from sim.autopilot.flavours.base import Flavour
from sim.autopilot.flight import Flight
from sim.autopilot.modes import Mode
from sim.autopilot.params import ParameterTable
from sim.autopilot.readiness import Readiness
from sim.kinematics import Point

__all__ = ["FailSafePilot", "FailSafes"]

_Texts = list[tuple[int, str]]
"""MAV_SEVERITY and text of each line."""

_PX4: _Texts = [(mavlink.MAV_SEVERITY_CRITICAL, "Failsafe activated")]
_RADIO: _Texts = [(mavlink.MAV_SEVERITY_WARNING, "Radio Failsafe")]
_GROUND: _Texts = [(mavlink.MAV_SEVERITY_WARNING, "GCS Failsafe")]
_POSITION: _Texts = [(mavlink.MAV_SEVERITY_CRITICAL, "EKF Failsafe: changed to Land Mode")]


class FailSafePilot(Protocol):
    """What failsafes ask of the autopilot."""

    config: VehicleConfig
    flavour: Flavour
    outbox: Outbox
    readiness: Readiness
    flight: Flight
    parameters: ParameterTable
    mode: Mode
    armed: bool

    def position_enu_m(self, now_s: float) -> Point:
        """Where the vehicle is [m]."""
        ...

    def set_mode(self, mode: Mode, now_s: float) -> bool:
        """Change the mode; False where that is refused."""
        ...

    def disarm(self, now_s: float, *, forced: bool) -> bool:
        """Stop the motors; False where that is refused."""
        ...


class FailSafes:
    """The failsafes of one autopilot, from power-up on.

    Args:
        pilot: the autopilot.
        battery: what it flies on; outlasts a reboot.
    """

    def __init__(self, pilot: FailSafePilot, battery: Battery) -> None:
        self._pilot = pilot
        self._battery = battery
        self._position_s: float | None = None
        self._ground_s: dict[int, float] = {}
        """When the heartbeat of each ground station was heard last, by system id."""

    def deadline_s(self) -> float | None:
        """When the firmware acts next [s]; None if not foreseen."""
        due_s = (self._battery.deadline_s(), self._position_s, self._ground_lost_s())
        return min((each_s for each_s in due_s if each_s is not None), default=None)

    def advance(self, at_s: float) -> None:
        """Act at the deadline ``at_s``."""
        ground_s = self._ground_lost_s()
        if self._position_s is not None and self._position_s <= at_s:
            self._position_s = None
            if self._pilot.mode.needs_position:
                self._act(Mode.LAND, _POSITION, at_s)
        elif ground_s is not None and ground_s <= at_s:
            self._lose_ground(at_s)
        else:
            self._protect_battery(at_s)

    def hear_ground(self, system_id: int, now_s: float) -> None:
        """A ground station is there."""
        self._ground_s[system_id] = now_s

    def _ground_lost_s(self) -> float | None:
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
            self._act(lost.mode, _GROUND, at_s)

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

    def lose_radio(self, now_s: float) -> None:
        """Return, as when the remote control is not heard any more."""
        self._act(Mode.RTL, _RADIO, now_s)

    def _protect_battery(self, at_s: float) -> None:
        level = self._battery.advance(at_s)
        volts = f"{self._battery.voltage_v(at_s):.2f}V"
        used = f"used {self._battery.consumed_mah(at_s) or 0.0:.0f} mAh"
        texts = [
            (mavlink.MAV_SEVERITY_WARNING, f"Battery 1 is {level.name.lower()} {volts} {used}"),
            (mavlink.MAV_SEVERITY_WARNING, "Battery Failsafe"),
        ]
        self._act(Mode.RTL if level is ChargeLevel.LOW else Mode.LAND, texts, at_s)

    def _act(self, mode: Mode, texts: _Texts, now_s: float) -> None:
        pilot = self._pilot
        if not pilot.armed:
            return
        if pilot.flavour.autopilot == mavlink.MAV_AUTOPILOT_PX4:
            texts = _PX4
        # ArduCopter tells the mode some milliseconds before the words, which wait in line; PX4
        # tells it with its next heartbeat, whatever comes first here.
        on_ground = pilot.flight.on_ground
        if not on_ground and not pilot.set_mode(mode, now_s):
            pilot.set_mode(Mode.LAND, now_s)
        for severity, text in texts:
            pilot.outbox.text(severity, text)
        if on_ground:
            pilot.disarm(now_s, forced=False)
