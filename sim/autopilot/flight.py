"""The vehicle in the air: its flight mode, what it is doing, and what comes after by itself."""

from __future__ import annotations

import math
from enum import Enum

from agent.vehicle.firmware.kinematics import JerkCost
from sim.autopilot.circling_motion import CirclingMotion, RunwayMotion
from sim.autopilot.config import VehicleConfig
from sim.autopilot.parameters import ENDLESS, ParameterRole, ParameterTable
from sim.world.motion import Motion, Point
from swarm.model.vehicles import TRAITS


class FlightMode(Enum):
    """What the vehicle flies by; the value is the name people see on ArduPilot."""

    MANUAL = "MANUAL"
    HOLD = "HOLD"
    STABILIZE = "STABILIZE"
    ALT_HOLD = "ALT_HOLD"
    LOITER = "LOITER"
    POSHOLD = "POSHOLD"
    BRAKE = "BRAKE"
    GUIDED = "GUIDED"
    TAKEOFF = "TAKEOFF"
    AUTO = "AUTO"
    RTL = "RTL"
    LAND = "LAND"

    @property
    def needs_position(self) -> bool:
        """Whether it can be armed, or entered in flight, only with a position estimate."""
        return self.controls_position and self is not FlightMode.LAND

    @property
    def controls_position(self) -> bool:
        """Whether the autopilot itself holds the horizontal position."""
        return self not in (FlightMode.MANUAL, FlightMode.STABILIZE, FlightMode.ALT_HOLD)


_FALL_M_S = 10.0
"""Speed of a vehicle whose motors were stopped in the air [m/s]."""

_LEAST_SPEED_M_S = 0.01

_HALVINGS = 40
"""Of the time to a target, to find when it is near enough: exact to a microsecond in 12 days."""

_NEAR_GROUND_M = 10.0
"""From here down a landing is slow [m]: ArduCopter's LAND_ALT_LOW, PX4's MPC_LAND_ALT1."""


RunwayPlaces = tuple[Point, Point]
"""The middle of the circle that a plane leaves for a runway, and where it touches down [m]."""


class MotionPhase(Enum):
    """What the vehicle is doing."""

    GROUNDED = "on the ground"
    SPOOLING_UP = "spooling up"
    TAKING_OFF = "taking off"
    HOLDING = "holding"
    NAVIGATING = "navigating"
    CLIMBING = "climbing to return"
    RETURNING = "returning"
    WAITING = "waiting above home"
    LANDING = "landing"
    TOUCHED_DOWN = "touched down"
    FALLING = "falling"


class Milestone(Enum):
    """What an activity ended in."""

    TAKEN_OFF = "taken off"
    REACHED = "target reached"
    LANDED = "landed"
    UNDERWAY = "one activity followed another"


class FlightStateMachine:
    """One activity at a time, each with the instant at which it ends by itself."""

    def __init__(
        self,
        config: VehicleConfig,
        parameters: ParameterTable,
        motion: Motion,
        jerk_cost_s: JerkCost,
    ) -> None:
        self.activity = MotionPhase.GROUNDED
        self.home_enu_m: Point = config.start_enu_m
        """Where the vehicle returns to and heights are counted from [m]."""
        self.motion = motion
        self._grounds_enu_m = config.grounds_enu_m or (config.start_enu_m,)
        self._terrain = config.terrain
        self._descent_m_s = config.descent_m_s
        self._spool_up_s = config.spool_up_s
        self._takes_time = config.acceleration_m_s2 is not None
        self._jerk_cost_s = jerk_cost_s
        self._on_wings = motion if isinstance(motion, CirclingMotion) else None
        self._on_runway = motion if isinstance(motion, RunwayMotion) else None
        self._landing_enu_m: RunwayPlaces | None = None
        self.drives = TRAITS[config.vehicle].drives
        """It stays on the ground."""
        self._touchdown_s = config.touchdown_s
        self._take_off_up_m = 0.0
        self._parameters = parameters
        self._cruise_override_m_s: float | None = None
        self._timer_s: float | None = None
        self._order: tuple[Point, float] = (config.start_enu_m, _LEAST_SPEED_M_S)
        """Place [m] and speed [m/s] of the last leg."""
        self._hindered: frozenset[MotionPhase] = frozenset()
        self._near_m = 0.0
        self._near_s: float | None = None
        """When the target is near enough [s]; None: when it is there."""
        self._is_high = False
        """It lands, and is as yet far from the ground."""

    def ground_up_m(self, east_m: float, north_m: float) -> float:
        """Height of the ground at a place [m]: by the terrain, or of the nearest place known."""
        if self._terrain is not None:
            from swarm.allocation.legs.ground import ground_of  # plain missions start sooner

            return ground_of(self._terrain).one_up_m(east_m, north_m)
        here = east_m, north_m
        return min(self._grounds_enu_m, key=lambda ground: math.dist(ground[:2], here))[2]

    @property
    def on_ground(self) -> bool:
        """Whether the vehicle knows that it stands on the ground."""
        return self.activity in (MotionPhase.GROUNDED, MotionPhase.SPOOLING_UP)

    @property
    def cruise_m_s(self) -> float:
        """Speed of the next leg [m/s]."""
        if self._cruise_override_m_s is not None:
            return self._cruise_override_m_s
        return max(_LEAST_SPEED_M_S, self._parameters.value_si(ParameterRole.CRUISE_M_S))

    def override_cruise(self, speed_m_s: float | None, now_s: float) -> None:
        """Fly on at another speed [m/s], until None gives the parameter its say again."""
        self._cruise_override_m_s = speed_m_s
        if speed_m_s is not None and self.activity in (
            MotionPhase.NAVIGATING,
            MotionPhase.RETURNING,
        ):
            self._fly(self._order[0], speed_m_s, now_s)
            self._near_s = self._is_near_s(now_s) if self._near_s is not None else None

    def hinder(self, activities: frozenset[MotionPhase], now_s: float) -> None:
        """Keep the vehicle where it is during these activities, until told otherwise."""
        was_hindered = self.activity in self._hindered
        self._hindered = activities
        if self._timer_s is not None or was_hindered is (self.activity in activities):
            return
        if was_hindered:
            self._fly(*self._order, now_s)
        else:
            self.motion.stop(now_s)

    def rouse(self) -> bool:
        """The motors run; whether it is under way by that, as it drives."""
        if self.drives:
            self.activity = MotionPhase.HOLDING
        return self.drives

    def take_off(self, up_m: float, now_s: float) -> None:
        """Rise straight to a height in the local frame [m], once the motors are up to it."""
        self._take_off_up_m = up_m
        if self.activity is MotionPhase.GROUNDED:
            self.activity = MotionPhase.SPOOLING_UP
            self._timer_s = now_s + self._spool_up_s
        elif self.activity is not MotionPhase.SPOOLING_UP:
            self._lift(now_s)

    def navigate(
        self,
        target_enu_m: Point,
        now_s: float,
        speed_m_s: float | None = None,
        near_m: float = 0.0,
    ) -> None:
        """Fly straight to a place, in place of whatever was being done.

        With ``near_m`` it is reached as soon as it is so near, and the vehicle does not stop by
        itself before it is there.
        """
        speed_m_s = self.cruise_m_s if speed_m_s is None else speed_m_s
        if self.drives:
            east_m, north_m, _ = target_enu_m
            target_enu_m = east_m, north_m, self.ground_up_m(east_m, north_m)
        self._leave(MotionPhase.NAVIGATING, target_enu_m, speed_m_s, now_s)
        self._near_m = near_m
        self._near_s = self._is_near_s(now_s)

    def _is_near_s(self, now_s: float) -> float | None:
        """When the vehicle comes near enough to its target [s]; None: where it stops there."""
        arrives_s = self.motion.arrives_s
        if self._near_m <= 0.0 or arrives_s is None or self.activity in self._hindered:
            return None
        far_s, near_s = now_s, arrives_s
        for _ in range(_HALVINGS):
            middle_s = 0.5 * (far_s + near_s)
            place_enu_m = self.motion.position_enu_m(middle_s)
            if math.dist(place_enu_m, self.motion.target_enu_m) <= self._near_m:
                near_s = middle_s
            else:
                far_s = middle_s
        return near_s

    def hold(self, now_s: float) -> None:
        """Stay in the air where the vehicle is; on the ground, stay there."""
        self.motion.stop(now_s)
        self._timer_s = self._near_s = None
        if self.on_ground or self.activity is MotionPhase.TOUCHED_DOWN:
            self.activity = MotionPhase.GROUNDED
        else:
            self.activity = MotionPhase.HOLDING

    def land(self, now_s: float) -> None:
        """Descend where the vehicle is; nothing to do on the ground."""
        if self.on_ground:
            self.hold(now_s)
        elif self.activity is not MotionPhase.TOUCHED_DOWN:
            self._land(now_s)

    def fall(self, now_s: float) -> None:
        """Drop, because the motors stand still."""
        if self.on_ground or self.activity is MotionPhase.TOUCHED_DOWN:
            self.hold(now_s)
        elif self.drives:
            self.hold(now_s)
            self.activity = MotionPhase.GROUNDED
        else:
            self._descend(MotionPhase.FALLING, _FALL_M_S, now_s)

    def return_home(self, now_s: float, landing_enu_m: RunwayPlaces | None = None) -> None:
        """Rise to the return height if below it, fly home, wait, land; or drive there, and stay.

        One that needs a runway lands at that, or circles over home where there is none.
        """
        self._landing_enu_m = landing_enu_m
        if self.on_ground:
            self.hold(now_s)
        if self.activity in (MotionPhase.GROUNDED, MotionPhase.TOUCHED_DOWN):
            return
        if self.drives:
            self._leave(MotionPhase.RETURNING, self.home_enu_m, self.cruise_m_s, now_s)
            return
        east_m, north_m, up_m = self.stopped_enu_m(now_s)
        return_up_m = self.home_enu_m[2] + self._parameters.value_si(ParameterRole.RETURN_HEIGHT_M)
        target_enu_m = (east_m, north_m, max(up_m, return_up_m))
        self._leave(MotionPhase.CLIMBING, target_enu_m, self._speed(ParameterRole.CLIMB_M_S), now_s)

    def land_on_runway(self, landing_enu_m: RunwayPlaces, now_s: float) -> None:
        """Come down from where it is, on a circle and along a line; of no copter."""
        self._landing_enu_m = landing_enu_m
        if self._on_runway is not None and not self.on_ground:
            self.activity = MotionPhase.RETURNING
            self._timer_s = self._near_s = None
            self._on_runway.climb_to(landing_enu_m[0], now_s)

    def deadline_s(self) -> float | None:
        """When the activity ends by itself [s]; None if it lasts."""
        if self.activity in (MotionPhase.GROUNDED, MotionPhase.HOLDING):
            return None
        if self._timer_s is not None:
            return self._timer_s
        return self.motion.arrives_s if self._near_s is None else self._near_s

    def advance(self, at_s: float) -> Milestone:
        """End the current activity at its deadline ``at_s`` and begin what follows."""
        match self.activity:
            case MotionPhase.SPOOLING_UP:
                self._lift(at_s)
            case MotionPhase.TAKING_OFF:
                self.hold(at_s)
                return Milestone.TAKEN_OFF
            case MotionPhase.NAVIGATING if self._near_s is not None:
                self._near_s = None
                return Milestone.REACHED
            case MotionPhase.NAVIGATING:
                if self._on_wings is None:
                    self.hold(at_s)
                self.activity = MotionPhase.HOLDING
                return Milestone.REACHED
            case MotionPhase.CLIMBING | MotionPhase.RETURNING if self._on_runway is not None:
                self._come_down(self._on_runway, at_s)
            case MotionPhase.CLIMBING:
                _, _, up_m = self.motion.target_enu_m
                above_home_enu_m = (*self.home_enu_m[:2], up_m)
                self._leave(MotionPhase.RETURNING, above_home_enu_m, self.cruise_m_s, at_s)
            case MotionPhase.RETURNING if self.drives:
                self.hold(at_s)
            case MotionPhase.RETURNING:
                self.hold(at_s)
                self.activity = MotionPhase.WAITING
                self._timer_s = at_s + max(
                    0.0, self._parameters.value_si(ParameterRole.RETURN_WAIT_S)
                )
            case MotionPhase.WAITING:
                self.land(at_s)
            case MotionPhase.LANDING if self._is_high:
                self._land(at_s)
            case MotionPhase.LANDING:
                self.motion.stop(at_s)
                self.activity = MotionPhase.TOUCHED_DOWN
                self._timer_s = at_s + self._touchdown_s
            case MotionPhase.TOUCHED_DOWN | MotionPhase.FALLING:
                self.activity = MotionPhase.TOUCHED_DOWN
                self.hold(at_s)
                return Milestone.LANDED
            case MotionPhase.GROUNDED | MotionPhase.HOLDING:
                pass
        return Milestone.UNDERWAY

    def _come_down(self, motion: RunwayMotion, now_s: float) -> None:
        """From the circle on which it climbed to that before the runway, and from there down."""
        landing_enu_m = self._landing_enu_m
        self._timer_s = self._near_s = None
        if self.activity is MotionPhase.CLIMBING:
            self.activity = MotionPhase.RETURNING
            above_home_enu_m = (*self.home_enu_m[:2], motion.target_enu_m[2])
            motion.climb_to(landing_enu_m[0] if landing_enu_m else above_home_enu_m, now_s)
        elif landing_enu_m is None:
            self.activity = MotionPhase.HOLDING
        else:
            self.activity, self._is_high = MotionPhase.LANDING, False
            motion.glide(landing_enu_m[1], now_s)

    def stopped_enu_m(self, now_s: float) -> Point:
        """Brake; where the vehicle comes to a stop [m]."""
        self.motion.stop(now_s)
        return self.motion.target_enu_m

    def _lift(self, now_s: float) -> None:
        east_m, north_m, _ = self.stopped_enu_m(now_s)
        target_enu_m = (east_m, north_m, self._take_off_up_m)
        self._leave(
            MotionPhase.TAKING_OFF, target_enu_m, self._speed(ParameterRole.TAKE_OFF_M_S), now_s
        )

    def _speed(self, setting: ParameterRole) -> float:
        return max(_LEAST_SPEED_M_S, self._parameters.value_si(setting))

    def _land(self, now_s: float) -> None:
        """Descend, far from the ground perhaps faster than near it."""
        east_m, north_m, up_m = self.stopped_enu_m(now_s)
        low_up_m = self.ground_up_m(east_m, north_m) + _NEAR_GROUND_M
        self._is_high = self._descent_m_s is not None and up_m > low_up_m
        if self._descent_m_s is not None and self._is_high:
            target_enu_m = east_m, north_m, low_up_m
            self._leave(MotionPhase.LANDING, target_enu_m, self._descent_m_s, now_s)
        else:
            self._descend(MotionPhase.LANDING, self._speed(ParameterRole.LAND_M_S), now_s)

    def _descend(self, activity: MotionPhase, speed_m_s: float, now_s: float) -> None:
        east_m, north_m, _ = self.stopped_enu_m(now_s)
        target_enu_m = east_m, north_m, self.ground_up_m(east_m, north_m)
        self._leave(activity, target_enu_m, speed_m_s, now_s)

    def _leave(
        self, activity: MotionPhase, target_enu_m: Point, speed_m_s: float, now_s: float
    ) -> None:
        self.activity = activity
        self._timer_s = self._near_s = None
        self._near_m = 0.0
        self._fly(target_enu_m, speed_m_s, now_s)

    def _fly(self, target_enu_m: Point, speed_m_s: float, now_s: float) -> None:
        if self.activity in (MotionPhase.NAVIGATING, MotionPhase.RETURNING):
            top_m_s = self._parameters.value_si(ParameterRole.TOP_SPEED_M_S)
            speed_m_s = max(_LEAST_SPEED_M_S, min(speed_m_s, top_m_s))
        self._order = target_enu_m, speed_m_s
        if self._takes_time:
            self.motion.limit(self._acceleration_m_s2(speed_m_s))
        if self.activity in self._hindered:
            self.motion.stop(now_s)
        elif self._on_wings is not None and self.activity is MotionPhase.NAVIGATING:
            self._on_wings.circle(target_enu_m, speed_m_s, now_s)
        else:
            self.motion.fly_to(target_enu_m, speed_m_s, now_s)

    def _acceleration_m_s2(self, speed_m_s: float) -> float:
        """With which a leg takes as long as with acceleration and jerk of the parameters."""
        set_m_s2 = self._parameters.value_si(ParameterRole.ACCELERATION_M_S2)
        jerk_m_s3 = self._parameters.value_si(ParameterRole.JERK_M_S3)
        if jerk_m_s3 >= ENDLESS:
            return set_m_s2
        ramps_s = speed_m_s / set_m_s2 + self._jerk_cost_s(speed_m_s, set_m_s2, jerk_m_s3)
        return speed_m_s / ramps_s
