"""What a simulated vehicle is made of, and the vehicles for the UAVs of a scenario.

It has an identity, a place, a motion, a battery and delays.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sim.autopilot.circling_motion import CirclingMotion, RunwayMotion
from sim.autopilot.turning_motion import TurningMotion
from sim.world.motion import IdealMotion, Motion, Point, SmoothMotion
from sim.world.wind import Wind, WindyMotion, gusts_of
from swarm.model import Mission, Uav, UavId
from swarm.model.frames import DEFAULT_ORIGIN, Origin
from swarm.model.terrain import Terrain
from swarm.model.vehicles import TRAITS, VehicleKind

_AIRSPEED_PER_CRUISE = 1.5
_MAX_SYSTEM_ID = 254
_LAND_M_S = 0.5
_DESCENT_M_S = 1.5
"""How real ones land, ArduCopter by its defaults. Where nobody lands before the end of the mission,
landings are quick."""


@dataclass(frozen=True, slots=True)
class Delays:
    """What the vehicle waits for after power-up, each in seconds since boot.

    Raises:
        ValueError: the stages are not in order.
    """

    boot_s: float = 1.0
    """The autopilot is initialised: its state goes from BOOT to STANDBY."""
    sensors_s: float = 1.0
    """Accelerometers agree; before that no mode can be armed."""
    origin_s: float = 2.0
    """GPS has a fix: origin and home are set, and positions are told."""
    position_s: float = 3.0
    """The estimator uses GPS: modes that navigate can be armed."""

    def __post_init__(self) -> None:
        stages_s = (0.0, self.boot_s, self.sensors_s, self.origin_s, self.position_s)
        if list(stages_s) != sorted(stages_s) or not math.isfinite(self.position_s):
            raise ValueError(f"delays must be >= 0 and in order, not {stages_s[1:]}")


@dataclass(frozen=True, slots=True)
class BatteryFailsafe:
    """Charges at which the firmware acts on its own.

    Raises:
        ValueError: the charges are not in order within 0..1.
    """

    low_frac: float = 0.2
    """It warns and returns."""
    critical_frac: float = 0.1
    """It lands where it is."""

    def __post_init__(self) -> None:
        if not 0.0 <= self.critical_frac <= self.low_frac <= 1.0:
            raise ValueError(
                f"charges must be 0 <= critical <= low <= 1, not {self.critical_frac} and "
                f"{self.low_frac}"
            )


@dataclass(frozen=True, slots=True)
class ServedBase:
    """A place where somebody gives a vehicle that landed there another battery.

    Raises:
        ValueError: the duration is out of range.
    """

    position_enu_m: Point
    """On the ground [m]."""
    swap_s: float = 0.0
    """From touch-down until the vehicle may be armed again [s]."""

    def __post_init__(self) -> None:
        if not 0.0 <= self.swap_s < math.inf:
            raise ValueError(f"swap_s must be >= 0, not {self.swap_s}")


@dataclass(frozen=True, slots=True)
class VehicleConfig:
    """One simulated vehicle.

    Raises:
        ValueError: a number is out of range.
    """

    system_id: int
    """MAVLink system id, 1..254 (255 is customary for ground stations)."""
    start_enu_m: Point = (0.0, 0.0, 0.0)
    """Where it stands at power-up [m]; its third number is the height of the ground there."""
    origin: Origin = DEFAULT_ORIGIN
    """Place of the local frame's zero."""
    cruise_m_s: float = 10.0
    """Speed while navigating [m/s], until a ground station changes it."""
    climb_m_s: float = 2.5
    """Take-off speed [m/s]."""
    land_m_s: float = 1.5
    """Landing speed [m/s]."""
    descent_m_s: float | None = None
    """Speed at which a landing comes down to 10 m above the ground [m/s]; None: the same."""
    grounds_enu_m: tuple[Point, ...] = ()
    """Places where the height of the ground is known [m], which it has around them; none: that of
    the start everywhere."""
    terrain: Terrain | None = None
    """The ground all over, into which one can fly; None: it is where a place of known height is."""
    delays: Delays = Delays()
    spool_up_s: float = 1.0
    """From an accepted take-off to leaving the ground [s]; 3 to 4 on ArduCopter."""
    touchdown_s: float = 1.0
    """Rest on the ground that makes a landing [s]."""
    endurance_s: float | None = None
    """Armed time that empties a full battery [s]; None: it stays full."""
    charge_frac: float = 1.0
    """Charge of the battery at power-up, 0..1."""
    drains_in_flight: bool = False
    """Only the time off the ground counts, as in plans, rather than all of the armed time."""
    bases: tuple[ServedBase, ...] = ()
    """Where the battery is changed."""
    swap_reboots: bool = True
    """The change cuts the autopilot's power; it is silent, and boots again."""
    swap_silence_s: float = 5.0
    """For how long it is without power then [s]."""
    battery_failsafe: BatteryFailsafe | None = None
    """None: the firmware lets the battery run empty, and the vehicle flies on."""
    position_failsafe_s: float | None = None
    """Time without GPS after which the firmware lands the vehicle [s]; None: it hovers."""
    acceleration_m_s2: float | None = None
    """Greatest acceleration [m/s²]; None: speeds change in no time."""
    jerk_m_s3: float | None = None
    """Greatest jerk [m/s³]; None: accelerations change in no time."""
    rounds_corners: bool = False
    """Passes waypoints without a stop and turns as recorded ones do; only with an acceleration."""
    airspeed_limit_m_s: float | None = None
    """Greatest speed through the air [m/s]; None: half as much again as the cruise speed, and more
    where more is ordered."""
    takes_fences: bool = True
    """Polygons to stay in or out of can be uploaded."""
    wind: Wind | None = None
    """The air it flies in; None: still."""
    vehicle: VehicleKind = VehicleKind.COPTER
    circle_m: float | None = None
    """Radius on which a plane turns, and waits [m]; of others None."""
    heading_rad: float = 0.0
    """In which it stands, clockwise from north; of no matter but to a plane on a runway."""

    def __post_init__(self) -> None:
        if not 1 <= self.system_id <= 254:
            raise ValueError(f"system id must be within 1..254, not {self.system_id}")
        for name in (
            "cruise_m_s",
            "climb_m_s",
            "land_m_s",
            "descent_m_s",
            "endurance_s",
            "position_failsafe_s",
            "acceleration_m_s2",
            "jerk_m_s3",
            "airspeed_limit_m_s",
            "circle_m",
        ):
            value = getattr(self, name)
            if value is not None and not 0.0 < value < math.inf:
                raise ValueError(f"{name} must be positive and finite, not {value}")
        if (self.circle_m is None) is not TRAITS[self.vehicle].stays:
            raise ValueError(f"a {self.vehicle} has a circle only where it cannot stay")
        if self.wind is not None and self.circle_m is not None:
            raise ValueError(f"a {self.vehicle} is simulated in still air only")
        if not 0.0 <= self.charge_frac <= 1.0:
            raise ValueError(f"charge_frac must be within 0..1, not {self.charge_frac}")
        for name in ("spool_up_s", "touchdown_s", "swap_silence_s"):
            if not 0.0 <= getattr(self, name) < math.inf:
                raise ValueError(f"{name} must be >= 0, not {getattr(self, name)}")
        if self.wind is not None and self.wind.speed_m_s >= self.airspeed_m_s:
            raise ValueError(
                f"wind of {self.wind.speed_m_s:g} m/s is too much for a vehicle that makes "
                f"{self.airspeed_m_s:g} m/s through the air"
            )

    @property
    def airspeed_m_s(self) -> float:
        """Greatest speed through the air [m/s]."""
        limit_m_s = self.airspeed_limit_m_s
        return _AIRSPEED_PER_CRUISE * self.cruise_m_s if limit_m_s is None else limit_m_s

    def motion(self) -> Motion:
        """How it moves from its start on."""
        if self.circle_m is not None and TRAITS[self.vehicle].needs_runway:
            place_enu_m, speed_m_s = self.start_enu_m, self.cruise_m_s
            return RunwayMotion(place_enu_m, self.circle_m, self.heading_rad, speed_m_s)
        if self.circle_m is not None:
            return CirclingMotion(self.start_enu_m, self.circle_m)
        motion: Motion = IdealMotion(self.start_enu_m)
        if self.acceleration_m_s2 is not None:
            kind = TurningMotion if self.rounds_corners else SmoothMotion
            motion = kind(self.start_enu_m, self.acceleration_m_s2)
        if self.wind is not None:
            exact = self.airspeed_limit_m_s is not None
            ground_up_m = self.start_enu_m[2]
            motion = WindyMotion(motion, self.wind, self.airspeed_m_s, ground_up_m, exact=exact)
        return motion


@dataclass(frozen=True, slots=True)
class FleetMember:
    """A UAV of the scenario and the vehicle it is."""

    uav: UavId
    config: VehicleConfig


@dataclass(frozen=True, slots=True)
class Physics:
    """What is more real about a fleet than ideal motion with a full battery in still air.

    Each number is checked where it is used.
    """

    acceleration_m_s2: float | None = None
    """Of all; None: of each what the scenario says."""
    wind_enu_m_s: tuple[float, float] | None = None
    """East and north, where the wind blows to [m/s]; None: what the scenario says, which only
    vehicles feel whose airspeed it gives."""
    gust_m_s: float = 0.0
    seed: int = 0
    """Of the gusts; each UAV of a scenario has its own, wherever it is simulated."""
    endurance_s: float | None = None
    """Armed time of all; None: of each the airborne time that the scenario says."""
    battery_failsafe: BatteryFailsafe | None = None
    position_failsafe_s: float | None = None
    swap_reboots: bool = True
    """Whether the change of a battery cuts the autopilot's power."""

    def wind(self, mission: Mission, place: int) -> Wind | None:
        """The air around the UAV at that place of the scenario; None if it is still."""
        gusts = None
        if self.gust_m_s > 0.0:
            gusts = gusts_of(self.gust_m_s, np.random.default_rng([self.seed, place]))
        velocity_enu_m_s = self.wind_enu_m_s
        if velocity_enu_m_s is None:
            felt = mission.uavs[place].airspeed_m_s is not None
            velocity_enu_m_s = mission.wind_enu_m_s if felt else (0.0, 0.0)
        air = Wind(velocity_enu_m_s, gusts)
        return air if gusts is not None or air.speed_m_s > 0.0 else None


def _acceleration_m_s2(uav: Uav, given_m_s2: float | None) -> float | None:
    """Of its speed; that of a plane is one of its turns."""
    if uav.turn_radius_m is not None:
        return None
    return uav.acceleration_m_s2 if given_m_s2 is None else given_m_s2


def fleet_of(
    mission: Mission,
    uavs: Sequence[UavId] | None = None,
    first_system_id: int | None = None,
    physics: Physics | None = None,
) -> tuple[FleetMember, ...]:
    """Vehicles standing at the starts of their UAVs, cruising as fast as those do.

    Args:
        mission: the scenario.
        uavs: which of its UAVs, in that order; all if None.
        first_system_id: system id of the first vehicle, the next ones counting on;
            if None, each UAV has its place in the scenario, from 1 on. Beyond 254
            ids begin at 1 again: every vehicle has a link of its own.
        physics: how real they are; ideal if None.

    Raises:
        ValueError: the mission has no UAV of that id, or the physics are out of range.
    """
    physics = physics or Physics()
    given_m_s2, given_s = physics.acceleration_m_s2, physics.endurance_s
    bases = tuple(ServedBase(base.position_enu_m, base.swap_s) for base in mission.bases)
    places = {uav.id: place for place, uav in enumerate(mission.uavs)}
    members = []
    for number, wanted in enumerate(places if uavs is None else uavs):
        if wanted not in places:
            raise ValueError(f"no UAV {wanted!r}")
        place = places[wanted]
        number_from_0 = place if first_system_id is None else first_system_id - 1 + number
        uav = mission.uavs[place]
        config = VehicleConfig(
            system_id=number_from_0 % _MAX_SYSTEM_ID + 1,
            start_enu_m=uav.position_enu_m,
            origin=mission.origin or DEFAULT_ORIGIN,
            cruise_m_s=uav.speed_m_s,
            endurance_s=uav.endurance_s if given_s is None else given_s,
            charge_frac=uav.charge_frac if given_s is None else 1.0,
            drains_in_flight=given_s is None and uav.endurance_s is not None,
            grounds_enu_m=(uav.position_enu_m, *(base.position_enu_m for base in bases)),
            terrain=mission.terrain,
            bases=bases,
            swap_reboots=physics.swap_reboots,
            battery_failsafe=physics.battery_failsafe,
            position_failsafe_s=physics.position_failsafe_s,
            acceleration_m_s2=_acceleration_m_s2(uav, given_m_s2),
            rounds_corners=not mission.is_plain,
            airspeed_limit_m_s=uav.airspeed_m_s,
            wind=physics.wind(mission, place),
            vehicle=uav.vehicle,
            circle_m=uav.turn_radius_m,
            heading_rad=uav.landing_heading_rad or 0.0,
        )
        if mission.bases:
            config = replace(config, land_m_s=_LAND_M_S, descent_m_s=_DESCENT_M_S)
        members.append(FleetMember(uav.id, config))
    return tuple(members)
