"""What the bridge must know of a vehicle's firmware; one subclass for each.

Commands: https://mavlink.io/en/messages/common.html
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import ClassVar

from agent.core.interface import Runway
from agent.vehicle.commands import result_text
from agent.vehicle.firmware.failsafes import Failsafes
from agent.vehicle.firmware.fences import POLYGONS, FenceSetup
from agent.vehicle.firmware.kinematics import Kinematics, LimitParameter
from agent.vehicle.landing_pattern import RunwayLanding
from agent.vehicle.messages import (
    AltitudeFrame,
    CommandInt,
    CommandLong,
    Heartbeat,
    Inbound,
    MissionCurrent,
    MissionItem,
    ParameterValue,
)
from agent.vehicle.parameter_override import OverrideSpec
from agent.vehicle.state import VehicleState
from swarm.model.frames import Origin
from swarm.model.vehicles import TRAITS, VehicleKind, VehicleTraits

Mode = tuple[int, ...]
"""A mode by the numbers that the firmware has for it."""

UNCHANGED = -1.0
"""What leaves a speed or throttle as it is."""

COPTER_TYPES = frozenset({2, 3, 4, 13, 14, 15, 29, 35})
"""MAV_TYPE of quad-, coaxial, heli-, hexa-, octo-, tri-, dodeca- and decacopter."""
_STATE_STANDBY = 3
_CMD_DO_SET_MODE = 176
_CMD_DO_CHANGE_SPEED = 178
_CMD_DO_SET_ROI_LOCATION = 195
_CMD_DO_SET_ROI_NONE = 197
_CMD_DO_SET_CAM_TRIGG_DIST = 206
_CMD_DO_REPOSITION = 192
_CMD_DO_FENCE_ENABLE = 207
_CMD_COMPONENT_ARM_DISARM = 400
_CUSTOM_MODE_ENABLED = 1.0
_GROUND_SPEED = 1.0


_NONE_TOLD: Mapping[int, str] = MappingProxyType({})


@dataclass(frozen=True, slots=True)
class SpeedParameter:
    """A parameter that sets the cruise speed, under one of its names."""

    name: str
    units_per_m_s: float
    """Value of the parameter at 1 m/s."""


class Firmware(ABC):
    """Modes, readiness, commands and parameter names of one firmware."""

    autopilot: ClassVar[int]
    """MAV_AUTOPILOT."""
    kind: ClassVar[VehicleKind] = VehicleKind.COPTER
    vehicle_types: ClassVar[frozenset[int]] = COPTER_TYPES
    """MAV_TYPE of what it flies or drives."""
    name: ClassVar[str]
    """For people."""
    takes_missions: ClassVar[bool] = True
    """Whether it is known how to command it by missions."""
    landing_names: ClassVar[tuple[str, ...]] = ()
    """Parameters that say how it lands along a runway."""
    motors_begin_takeoff: ClassVar[bool] = False
    """It is put into the mode in which it takes off first, and does so as soon as they run."""
    first_item: ClassVar[int | None] = None
    """Item of the mission of what needs a runway with which it takes off; None: by none."""
    stops_within_m: ClassVar[float] = 0.0
    """How far from a target it may stop for good; 0: at it."""
    disarms_itself: ClassVar[bool] = True
    """Its motors stop by themselves where it has come home or landed."""
    mode_names: ClassVar[Mapping[Mode, str]]
    """For people."""
    commanded_mode: ClassVar[Mode]
    """In which the vehicle takes our targets."""
    commanded_mode_name: ClassVar[str]
    """That mode, for people."""
    commanded_by_choice: ClassVar[bool]
    """The vehicle is never in that mode unless somebody put it there."""
    pilots_stop_it_there: ClassVar[bool]
    """A pilot stops the vehicle in that mode."""
    takeoff_mode: ClassVar[Mode | None] = None
    """Which the vehicle enters by itself to take off on our order; None without one."""
    mission_mode: ClassVar[Mode]
    """In which the vehicle flies the mission that stands on it."""
    return_mode: ClassVar[Mode]
    """In which it climbs, returns, lands and disarms."""
    land_mode: ClassVar[Mode]
    """In which it lands where it is, and disarms."""
    returning_modes: ClassVar[frozenset[Mode]]
    """In which it returns or lands by itself."""
    speed_parameters: ClassVar[tuple[SpeedParameter, ...]]
    """Every name that the cruise speed has had."""
    override_spec: ClassVar[OverrideSpec | None] = None
    """The parameter without which legs take longer than they need to; None without one."""
    failsafe_names: ClassVar[tuple[tuple[str, ...], ...]]
    """Parameters that say what it does without us, each by all its names."""
    limit_parameters: ClassVar[tuple[LimitParameter, ...]]
    """Parameters that say how it flies its legs, under every name that they have had."""
    fence_names: ClassVar[tuple[str, ...]]
    """Parameters that say what it does about its own fence."""
    streams: ClassVar[tuple[tuple[int, type[Inbound]], ...]]
    """Message ids to ask for beside the position, and what each becomes."""
    mission_vehicle_items: ClassVar[int]
    """Leading items of a mission that belong to the vehicle and cannot be chosen."""
    missions_give_way: ClassVar[bool]
    """A mission may let targets be told for a time, and that is faster."""
    missions_begin_anew: ClassVar[bool]
    """One that takes the place of the mission that is flown is taken up as a whole, and flown from
    where it is marked to begin; else the vehicle goes on with the item of the same number."""
    targets_turn_nose: ClassVar[bool]
    """On the way to a target the nose points where that says, whatever is to be looked at."""
    acknowledged_twice: ClassVar[frozenset[int]] = frozenset()
    """Numbers of the commands that the firmware acknowledges twice."""

    # What it says.

    def flies(self, heartbeat: Heartbeat) -> bool:
        """Whether this firmware is the one of that vehicle."""
        known = heartbeat.vehicle_type in self.vehicle_types
        return heartbeat.autopilot == self.autopilot and known

    @property
    def traits(self) -> VehicleTraits:
        """Of the kind of vehicle."""
        return TRAITS[self.kind]

    def mode(self, custom_mode: int) -> Mode:
        """The mode that a heartbeat tells."""
        return (custom_mode,)

    def mode_name(self, custom_mode: int, told: Mapping[int, str] = _NONE_TOLD) -> str:
        """The mode's name, for people.

        Args:
            custom_mode: what the heartbeat says.
            told: the vehicle's own names, for modes that we have none for.
        """
        mode = self.mode(custom_mode)
        number = f"mode {'.'.join(map(str, mode))}"
        return self.mode_names.get(mode) or told.get(custom_mode, number)

    def is_commanded(self, custom_mode: int) -> bool:
        """Whether the vehicle takes our targets in that mode."""
        return self.mode(custom_mode) == self.commanded_mode

    def is_taking_off(self, custom_mode: int) -> bool:
        """Whether the mode is one that the vehicle enters by itself to take off on our order."""
        return self.mode(custom_mode) == self.takeoff_mode

    def has_taken_off(self, custom_mode: int) -> bool:
        """Whether the take-off is over, and it waits in that mode to be told another one."""
        del custom_mode
        return False

    def must_rise(self, custom_mode: int) -> bool:
        """Whether it takes off in that mode, and is better left alone until that is over."""
        del custom_mode
        return False

    def flies_items(self, custom_mode: int) -> bool:
        """Whether that mode, as a heartbeat tells it, says little without the item flown."""
        del custom_mode
        return False

    def told_mode(self, custom_mode: int, item: MissionCurrent | None) -> int:
        """The mode as a heartbeat tells it, and the item that is flown then, in one number."""
        del item
        return custom_mode

    def is_mission(self, custom_mode: int) -> bool:
        """Whether the vehicle flies the mission that stands on it in that mode."""
        return self.mode(custom_mode) == self.mission_mode

    def is_returning(self, custom_mode: int) -> bool:
        """Whether the vehicle returns or lands by itself in that mode."""
        return self.mode(custom_mode) in self.returning_modes

    def is_landing(self, custom_mode: int) -> bool:
        """Whether the vehicle lands where it is in that mode."""
        return self.mode(custom_mode) == self.land_mode

    def has_booted(self, heartbeat: Heartbeat) -> bool:
        """Whether the autopilot is past booting and calibrating."""
        return heartbeat.system_status >= _STATE_STANDBY

    @abstractmethod
    def has_rebooted(self, before: Heartbeat, heartbeat: Heartbeat) -> bool:
        """Whether the autopilot began anew between two heartbeats, as far as they tell."""

    @abstractmethod
    def airborne(self, vehicle: VehicleState) -> bool | None:
        """Whether the vehicle is off the ground; None if it has not told yet."""

    def position_fault(self, vehicle: VehicleState) -> str | None:
        """Why the autopilot does not trust the position that it tells; None if it does.

        By the estimator's flags: ArduPilot tells a lost position on, from dead reckoning;
        versions of PX4 differ in that.
        """
        return "the position estimate is lost" if vehicle.estimate_lost else None

    @abstractmethod
    def alarmed(self, heartbeat: Heartbeat) -> bool:
        """Whether a failsafe acts, or is about to, that the mode does not show."""

    @abstractmethod
    def unready(self, vehicle: VehicleState) -> str | None:
        """What keeps the vehicle from being armed, in words; None if nothing does."""

    def place_refusal(self, vehicle: VehicleState, result: int | None) -> str:
        """Why a target or a takeoff was refused, in words, from its MAV_RESULT."""
        del vehicle
        return result_text(result)

    def ignores_target(self, text: str) -> bool:
        """Whether the text says that a target was acknowledged and is not flown to."""
        del text
        return False

    def value_of(self, parameter: ParameterValue) -> float:
        """What the firmware means by a parameter's value on the wire."""
        return parameter.value

    @abstractmethod
    def failsafes(self, values: Mapping[str, float], own_system_id: int) -> Failsafes:
        """What the vehicle does without us, as far as these parameters say."""

    @abstractmethod
    def kinematics(self, values: Mapping[str, float]) -> Kinematics:
        """How it flies its legs, as far as these parameters say."""

    @abstractmethod
    def fence_setup(self, values: Mapping[str, float]) -> FenceSetup:
        """What the vehicle does about a fence, as far as these parameters say."""

    def disowns_fence(self, text: str) -> bool:
        """Whether the text says that a fence that stands on the vehicle is not heeded."""
        del text
        return False

    def runway_landing(self, values: Mapping[str, float]) -> RunwayLanding | str:
        """How it lands along a runway, as these parameters say; or why it would not, in words.

        Of what needs a runway alone.
        """
        del values
        return f"a {self.kind} lands upright"

    def runway_mission(
        self, landing: RunwayLanding, runway: Runway, up_m: float, origin: Origin
    ) -> tuple[MissionItem, ...]:
        """What is to stand on it before it takes off.

        Args:
            landing: how it comes down.
            runway: where.
            up_m: height at which its take-off ends [m; mission origin].
            origin: zero of the mission's local frame.
        """
        del up_m
        return landing.items(runway, origin)

    # What it is told.

    def switch_polygons(self, *, on: bool) -> CommandLong:
        """Heed the polygons of its fence, or do not, until it is switched off."""
        return CommandLong(
            _CMD_DO_FENCE_ENABLE, (float(on), float(POLYGONS), 0.0, 0.0, 0.0, 0.0, 0.0)
        )

    def set_commanded_mode(self) -> CommandLong:
        """Switch to the mode that takes our targets."""
        return _set_mode(*self.commanded_mode)

    def set_mission_mode(self) -> CommandLong:
        """Fly the mission that stands on the vehicle."""
        return _set_mode(*self.mission_mode)

    def set_return_mode(self) -> CommandLong:
        """Return to launch and land."""
        return _set_mode(*self.return_mode)

    def set_land_mode(self) -> CommandLong:
        """Land where it is."""
        return _set_mode(*self.land_mode)

    def arm(self) -> CommandLong:
        """Start the motors, with all checks."""
        return CommandLong(_CMD_COMPONENT_ARM_DISARM, (1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))

    def disarm(self) -> CommandLong:
        """Stop the motors; refused in the air."""
        return CommandLong(_CMD_COMPONENT_ARM_DISARM, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))

    def trigger_camera(self, distance_m: float) -> CommandLong:
        """Take a picture now and every so many metres from here; 0: take none any more."""
        now = float(distance_m > 0.0)
        params = (distance_m, 0.0, now, 0.0, 0.0, 0.0, 0.0)
        return CommandLong(_CMD_DO_SET_CAM_TRIGG_DIST, params)

    def look_at(self, lat_deg: float, lon_deg: float, alt_m: float) -> CommandInt:
        """Keep the camera on a place, ``alt_m`` above mean sea level."""
        params, place = (0.0, 0.0, 0.0, 0.0), (lat_deg, lon_deg, alt_m)
        frame = AltitudeFrame.MEAN_SEA_LEVEL
        return CommandInt(_CMD_DO_SET_ROI_LOCATION, frame, params, *place)

    def look_ahead(self) -> CommandLong:
        """Keep it on nothing any more."""
        return CommandLong(_CMD_DO_SET_ROI_NONE, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))

    @abstractmethod
    def takeoff(self, alt_m: float, home_alt_m: float) -> CommandLong:
        """Climb straight up to ``alt_m``; both heights are above mean sea level [m]."""

    def reposition(
        self,
        lat_deg: float,
        lon_deg: float,
        alt_m: float,
        speed_m_s: float,
        heading_rad: float | None = None,
    ) -> CommandInt:
        """Fly to a place at once.

        Args:
            lat_deg: WGS84 latitude.
            lon_deg: WGS84 longitude.
            alt_m: height above mean sea level, as the mission's own, so that home's height
                does not matter.
            speed_m_s: cruise ground speed, for firmwares that take it with every target.
            heading_rad: of the nose, clockwise from north, where targets say that; None: as the
                vehicle is set.
        """
        speed, flags = self.reposition_params(speed_m_s)
        yaw_rad = math.nan if heading_rad is None else heading_rad
        params, place = (speed, flags, 0.0, yaw_rad), (lat_deg, lon_deg, alt_m)
        return CommandInt(_CMD_DO_REPOSITION, AltitudeFrame.MEAN_SEA_LEVEL, params, *place)

    @abstractmethod
    def reposition_params(self, speed_m_s: float) -> tuple[float, float]:
        """Speed and MAV_DO_REPOSITION_FLAGS of such a command."""

    def pause(self) -> CommandLong | None:
        """Stop in the mode that takes our targets, wherever that is.

        None if the firmware cannot be told so without a place.
        """
        return None

    @abstractmethod
    def waypoint_params(self, hold_s: float) -> tuple[float, float, float, float]:
        """Parameters of a mission's waypoint at which to wait so long, heading as it comes."""

    def change_speed(self, speed_m_s: float) -> CommandLong:
        """Ground speed from now on.

        ArduPilot forgets it when GUIDED is entered or takeoff ends, so it is set after; for
        PX4 it counts for what is flown now, and targets bring their own.
        """
        params = (_GROUND_SPEED, speed_m_s, UNCHANGED, 0.0, 0.0, 0.0, 0.0)
        return CommandLong(_CMD_DO_CHANGE_SPEED, params)


def _set_mode(main: int, sub: int = 0) -> CommandLong:
    params = (_CUSTOM_MODE_ENABLED, float(main), float(sub), 0.0, 0.0, 0.0, 0.0)
    return CommandLong(_CMD_DO_SET_MODE, params)
