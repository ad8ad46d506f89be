"""What the bridge asks of a firmware, and what multicopters of every firmware are told alike.

Leaves out: when to do what, which is the same for every firmware (agent.vehicle.bridge).

Commands: https://mavlink.io/en/messages/common.html
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

from agent.vehicle.firmware.failsafes import Failsafes
from agent.vehicle.messages import CommandInt, CommandLong, Heartbeat, Inbound, ParameterValue
from agent.vehicle.parameter_override import OverrideSpec
from agent.vehicle.state import VehicleState

__all__ = ["COPTER_TYPES", "UNCHANGED", "Copter", "Firmware", "SpeedParameter", "set_mode"]


@dataclass(frozen=True, slots=True)
class SpeedParameter:
    """A parameter that sets the cruise speed, under one of its names."""

    name: str
    units_per_m_s: float
    """Value of the parameter at 1 m/s."""


class Firmware(Protocol):
    """Modes, readiness, commands and parameter names of one firmware."""

    @property
    def speed_parameters(self) -> tuple[SpeedParameter, ...]:
        """Every name that the cruise speed has had."""
        ...

    @property
    def override_spec(self) -> OverrideSpec | None:
        """The parameter without which legs take longer than they need to; None without one."""
        ...

    @property
    def failsafe_names(self) -> tuple[tuple[str, ...], ...]:
        """Parameters that say what it does without us, each by all its names."""
        ...

    def failsafes(self, values: Mapping[str, float], own_system_id: int) -> Failsafes:
        """What the vehicle does without us, as far as these parameters say."""
        ...

    def value_of(self, parameter: ParameterValue) -> float:
        """What the firmware means by a parameter's value on the wire."""
        ...

    @property
    def streams(self) -> tuple[tuple[int, type[Inbound]], ...]:
        """Message ids to ask for beside the position, and what each becomes."""
        ...

    @property
    def mission_vehicle_items(self) -> int:
        """Leading items of a mission that belong to the vehicle and cannot be chosen."""
        ...

    @property
    def missions_give_way(self) -> bool:
        """Whether a mission may let targets be told for a time, and whether that is faster."""
        ...

    @property
    def acknowledged_twice(self) -> frozenset[int]:
        """Numbers of the commands that the firmware acknowledges twice."""
        ...

    @property
    def pilots_stop_it_there(self) -> bool:
        """Whether a pilot stops the vehicle in the mode that takes our targets."""
        ...

    @property
    def commanded_mode_name(self) -> str:
        """The mode in which the vehicle takes our targets, for people."""
        ...

    @property
    def commanded_by_choice(self) -> bool:
        """Whether the vehicle is never in that mode unless somebody put it there."""
        ...

    def flies(self, heartbeat: Heartbeat) -> bool:
        """Whether this firmware is the one of that vehicle."""
        ...

    def mode_name(self, custom_mode: int) -> str:
        """The mode's name, for people."""
        ...

    def is_commanded(self, custom_mode: int) -> bool:
        """Whether the vehicle takes our targets in that mode."""
        ...

    def is_taking_off(self, custom_mode: int) -> bool:
        """Whether the mode is one that the vehicle enters by itself to take off on our order."""
        ...

    def is_mission(self, custom_mode: int) -> bool:
        """Whether the vehicle flies the mission that stands on it in that mode."""
        ...

    def is_returning(self, custom_mode: int) -> bool:
        """Whether the vehicle returns or lands by itself in that mode."""
        ...

    def has_booted(self, heartbeat: Heartbeat) -> bool:
        """Whether the autopilot is past booting and calibrating."""
        ...

    def has_rebooted(self, before: Heartbeat, heartbeat: Heartbeat) -> bool:
        """Whether the autopilot began anew between two heartbeats, as far as they tell."""
        ...

    def airborne(self, vehicle: VehicleState) -> bool | None:
        """Whether the vehicle is off the ground; None if it has not told yet."""
        ...

    def position_fault(self, vehicle: VehicleState) -> str | None:
        """Why the autopilot does not trust the position that it tells; None if it does."""
        ...

    def alarmed(self, heartbeat: Heartbeat) -> bool:
        """Whether a failsafe acts, or is about to, that the mode does not show."""
        ...

    def place_refusal(self, vehicle: VehicleState, result: int | None) -> str:
        """Why a target or a takeoff was refused, in words, from its MAV_RESULT."""
        ...

    def ignores_target(self, text: str) -> bool:
        """Whether the text says that a target was acknowledged and is not flown to."""
        ...

    def unready(self, vehicle: VehicleState) -> str | None:
        """What keeps the vehicle from being armed, in words; None if nothing does."""
        ...

    def set_commanded_mode(self) -> CommandLong:
        """Switch to the mode that takes our targets."""
        ...

    def set_mission_mode(self) -> CommandLong:
        """Fly the mission that stands on the vehicle."""
        ...

    def set_return_mode(self) -> CommandLong:
        """Return to launch and land."""
        ...

    def arm(self) -> CommandLong:
        """Start the motors, with all checks."""
        ...

    def disarm(self) -> CommandLong:
        """Stop the motors; refused in the air."""
        ...

    def takeoff(self, alt_m: float, home_alt_m: float) -> CommandLong:
        """Climb straight up to ``alt_m``; both heights are above mean sea level [m]."""
        ...

    def reposition(
        self, lat_deg: float, lon_deg: float, alt_m: float, speed_m_s: float
    ) -> CommandInt:
        """Fly to a place at once.

        Args:
            lat_deg: WGS84 latitude.
            lon_deg: WGS84 longitude.
            alt_m: height above mean sea level.
            speed_m_s: cruise ground speed, for firmwares that take it with every target.
        """
        ...

    def pause(self) -> CommandLong | None:
        """Stop in the mode that takes our targets, wherever that is.

        None if the firmware cannot be told so without a place.
        """
        ...

    def waypoint_params(self, hold_s: float) -> tuple[float, float, float, float]:
        """Parameters of a mission's waypoint at which to wait so long, heading as it comes."""
        ...

    def change_speed(self, speed_m_s: float) -> CommandLong:
        """Set the ground speed from now on."""
        ...


COPTER_TYPES = frozenset({2, 3, 4, 13, 14, 15, 29, 35})
"""MAV_TYPE of quad-, coaxial, heli-, hexa-, octo-, tri-, dodeca- and decacopter."""

UNCHANGED = -1.0
"""What leaves a speed or throttle as it is."""


_CMD_DO_SET_MODE = 176

_CMD_DO_CHANGE_SPEED = 178

_CMD_COMPONENT_ARM_DISARM = 400

_CUSTOM_MODE_ENABLED = 1.0

_GROUND_SPEED = 1.0


class Copter:
    """The part that firmwares of multicopters share."""

    def arm(self) -> CommandLong:
        """Start the motors, with all checks."""
        return CommandLong(_CMD_COMPONENT_ARM_DISARM, (1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))

    def disarm(self) -> CommandLong:
        """Stop the motors; refused in the air."""
        return CommandLong(_CMD_COMPONENT_ARM_DISARM, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))

    def value_of(self, parameter: ParameterValue) -> float:
        """Whole numbers are told as such, in the float."""
        return parameter.value

    def change_speed(self, speed_m_s: float) -> CommandLong:
        """Ground speed from now on.

        ArduPilot forgets it when GUIDED is entered or takeoff ends, so it is set after; for
        PX4 it counts for what is flown now, and targets bring their own.
        """
        params = (_GROUND_SPEED, speed_m_s, UNCHANGED, 0.0, 0.0, 0.0, 0.0)
        return CommandLong(_CMD_DO_CHANGE_SPEED, params)


def set_mode(main: int, sub: int = 0) -> CommandLong:
    """Switch to a mode by the numbers of the firmware."""
    params = (_CUSTOM_MODE_ENABLED, float(main), float(sub), 0.0, 0.0, 0.0, 0.0)
    return CommandLong(_CMD_DO_SET_MODE, params)
