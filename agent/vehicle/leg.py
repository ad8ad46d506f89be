"""One flight to one place: by reposition commands, or by a mission that ends at home.

Arrival is judged by the vehicle's own position and speed against this target, and only after
the vehicle took it: a vehicle that still flies elsewhere has not arrived, wherever it happens
to be. One that never comes to rest at a mission's target, as in strong wind, has arrived too if
it says that it reached the item and is near.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from enum import Enum, auto

from agent.core.interface import Arrived, GoTo, HandedOver, Refused
from agent.vehicle.activity import Activity, FlightPhase
from agent.vehicle.camera_control import Look
from agent.vehicle.commands import CommandEnded, CommandOutcome
from agent.vehicle.config import BridgeConfig
from agent.vehicle.firmware.profile import Firmware
from agent.vehicle.flight_path import FlightPath
from agent.vehicle.messages import Inbound, Position, StatusText
from agent.vehicle.onboard_mission import OnboardMission
from agent.vehicle.session import PASSES_M, ArrivalRule, VehicleSession
from swarm.model.frames import wgs84_from_enu
from swarm.protocol.fields import Point

TARGET_TAG = "target"
"""Tag of the command that carries a target: a new one supersedes the last."""


_TURN_RAD = math.radians(10.0)
"""So far the nose may be beside what it is to point at, where targets turn it."""
_TURNS_LATE_S = 1.0
"""PX4 turns as smoothly as it flies: a heading told so early is flown in time [s]."""


class ArrivalState(Enum):
    """What a position says of a target."""

    UNDERWAY = auto()
    ARRIVED = auto()
    """Slow, and within the acceptance radius."""
    STALLED = auto()
    """Slow elsewhere for so long that it should be told again."""
    GIVEN_UP = auto()
    """Stalled, and told again often enough."""


class ArrivalDetector:
    """Watches a vehicle come to a stop, at its target or elsewhere."""

    def __init__(self, target_enu_m: Point, config: BridgeConfig, rule: ArrivalRule) -> None:
        self._target_enu_m = target_enu_m
        self._rule = rule
        self._config = config
        self._still_since_s: float | None = None
        self._tellings = 0
        self.distance_m = math.inf
        """As last seen."""
        self.moved = False
        """Whether the vehicle was seen to move since it was told."""

    def judge(self, position_enu_m: Point, velocity_enu_m_s: Point, now_s: float) -> ArrivalState:
        """Take one position and speed."""
        rule = self._rule
        counted = 2 if rule.is_flat or rule.passes else 3
        self.distance_m = math.dist(position_enu_m[:counted], self._target_enu_m[:counted])
        beside_m = abs(position_enu_m[2] - self._target_enu_m[2])
        if rule.passes and self.distance_m <= rule.radius_m and beside_m <= PASSES_M:
            return ArrivalState.ARRIVED
        if math.hypot(*velocity_enu_m_s) > self._config.arrival_speed_m_s:
            self._still_since_s = None
            self.moved = True
            return ArrivalState.UNDERWAY
        if self.distance_m <= self._rule.radius_m:
            return ArrivalState.ARRIVED
        if self._still_since_s is None:
            self._still_since_s = now_s
        if now_s - self._still_since_s < self._config.stall_timeout_s:
            return ArrivalState.UNDERWAY
        self._still_since_s = now_s
        self._tellings += 1
        return (
            ArrivalState.GIVEN_UP
            if self._tellings > self._config.stall_tries
            else ArrivalState.STALLED
        )

    @property
    def complaint(self) -> str:
        """Why it was given up."""
        return f"the vehicle stands still {self.distance_m:.1f} m from the target"


class _Leg(ABC):
    """A target in force, or on its way to be.

    Args:
        target_enu_m: where to stop [m; mission origin].
    """

    def __init__(self, session: VehicleSession, target_enu_m: Point) -> None:
        self._session = session
        self._target_enu_m = target_enu_m
        self._arrival = ArrivalDetector(target_enu_m, session.config, session.arrival)
        self._arrived = False
        self._failure: str | None = None
        self.stopped: str | None = None
        """Why somebody else seems to have stopped the vehicle; None if nobody has."""

    @property
    def arrived(self) -> bool:
        """The vehicle was seen to stop at the target; stays once true."""
        return self._arrived

    @property
    def failure(self) -> str | None:
        """Why the target could not be put in force or reached; None while it may."""
        return self._failure

    @property
    @abstractmethod
    def takings(self) -> int:
        """How often the vehicle has taken what it was told; 0: it does not fly there yet."""

    @property
    @abstractmethod
    def accepted(self) -> bool:
        """Whether the target is in force."""

    @abstractmethod
    def start(self) -> None:
        """Tell the vehicle, in place of whatever it was told before."""

    @abstractmethod
    def _on_stalled(self) -> None:
        """The vehicle stands still elsewhere."""

    def on_position(self, position: Position) -> None:
        """Judge arrival."""
        session = self._session
        if self.arrived or not self.accepted:
            return
        match self._arrival.judge(session.place_enu_m, position.velocity_enu_m_s, session.now_s):
            case ArrivalState.ARRIVED:
                self._arrived = True
            case ArrivalState.STALLED:
                self._on_stalled()
            case ArrivalState.GIVEN_UP:
                self._failure = self._arrival.complaint
            case ArrivalState.UNDERWAY:
                pass

    def _judge_stop(self, velocity_enu_m_s: Point) -> None:
        """It may stand still elsewhere than at its corner, which it would not stay at."""
        session = self._session
        match self._arrival.judge(session.place_enu_m, velocity_enu_m_s, session.now_s):
            case ArrivalState.STALLED:
                self._on_stalled()
            case ArrivalState.GIVEN_UP:
                self._failure = self._arrival.complaint
            case ArrivalState.ARRIVED | ArrivalState.UNDERWAY:
                pass


class RepositionLeg(_Leg):
    """A target told by one command, and told again if the vehicle stands still elsewhere.

    Args:
        target_enu_m: where to stop [m; mission origin].
        speed_m_s: cruise ground speed.
        insists: the target is told again if the vehicle stands still elsewhere. If not, one
            that stopped on its way is taken to be somebody else's.
        look_at_m: where the nose points if targets turn it [m; east, north; mission origin]; None:
            ahead.
    """

    def __init__(
        self,
        session: VehicleSession,
        firmware: Firmware,
        target_enu_m: Point,
        speed_m_s: float,
        *,
        insists: bool = True,
        look_at_m: tuple[float, float] | None = None,
    ) -> None:
        super().__init__(session, target_enu_m)
        self._insists = insists
        self._firmware = firmware
        self._speed_m_s = speed_m_s
        self._look_at_m = look_at_m if firmware.targets_turn_nose else None
        self._heading_rad: float | None = None
        """Of the nose, as it was told."""
        self._turns = False
        """Whether it was last told for its heading alone, which is no matter if it fails."""
        self._takings = 0
        self._accepted = False

    @property
    def takings(self) -> int:
        """How often the vehicle acknowledged a target on this leg; 0: not this one yet."""
        return self._takings if self._accepted else 0

    @property
    def accepted(self) -> bool:
        """The vehicle acknowledged the target."""
        return self._accepted

    def start(self) -> None:
        """Tell the vehicle, in place of whatever it was told before."""
        self._turns, self._heading_rad = False, self._bearing_rad()
        self._send()

    def _send(self) -> None:
        place = wgs84_from_enu(self._session.config.origin, self._target_enu_m)
        message = self._firmware.reposition(*place, self._speed_m_s, self._heading_rad)
        self._session.send(TARGET_TAG, message)

    def _bearing_rad(self) -> float | None:
        """To what is looked at, clockwise from north, from where the vehicle soon is.

        None where the nose is not turned there.
        """
        position, place_enu_m = self._session.vehicle.position, self._session.place_enu_m
        if self._look_at_m is None or position is None or not math.isfinite(place_enu_m[0]):
            return None
        east_m, north_m = (
            there - here - _TURNS_LATE_S * speed_m_s
            for there, here, speed_m_s in zip(
                self._look_at_m, place_enu_m[:2], position.velocity_enu_m_s[:2], strict=True
            )
        )
        return math.atan2(east_m, north_m)

    def on_position(self, position: Position) -> None:
        """Judge arrival, and keep the nose on what is looked at."""
        super().on_position(position)
        self._turn_nose()

    def _turn_nose(self) -> None:
        bearing_rad, told_rad = self._bearing_rad(), self._heading_rad
        if bearing_rad is None or self.arrived or not self.accepted:
            return
        beside_rad = (
            math.inf if told_rad is None else math.remainder(bearing_rad - told_rad, math.tau)
        )
        if abs(beside_rad) > _TURN_RAD and not self._session.commands.pending(TARGET_TAG):
            self._turns, self._heading_rad = True, bearing_rad
            self._send()

    def on_ended(self, ended: CommandEnded) -> None:
        """Take the outcome of the command."""
        if ended.tag != TARGET_TAG or self._turns:
            return
        if ended.ending is CommandOutcome.ACCEPTED:
            self._accepted = True
            self._takings += 1
        else:
            why = self._firmware.place_refusal(self._session.vehicle, ended.result)
            self._failure = f"the autopilot did not take the target ({why})"

    def on_message(self, message: Inbound) -> None:
        """The vehicle may say that it does not fly to the target, whatever it acknowledged."""
        ignored = isinstance(message, StatusText) and self._firmware.ignores_target(message.text)
        if isinstance(message, StatusText) and ignored and not self.arrived:
            self._failure = f"the autopilot did not take the target: {message.text}"

    def _on_stalled(self) -> None:
        if self._insists:
            self.start()
        elif self._arrival.moved:
            short_m = self._arrival.distance_m
            self.stopped = (
                f"it stopped {short_m:.0f} m short of its target: paused by a ground station?"
            )
        else:
            self._failure = self._arrival.complaint


class PathLeg(RepositionLeg):
    """A path whose corners are told one by one, each before the vehicle stops at the one before.

    Args:
        path_enu_m: corners, then where to stop [m; mission origin].
        speed_m_s: cruise ground speed.
        insists: as for `RepositionLeg`.
        look_at_m: as for that.
    """

    def __init__(
        self,
        session: VehicleSession,
        firmware: Firmware,
        path_enu_m: Sequence[Point],
        speed_m_s: float,
        *,
        insists: bool = True,
        look_at_m: tuple[float, float] | None = None,
    ) -> None:
        acceleration_m_s2 = session.acceleration_m_s2
        self._path = FlightPath(path_enu_m, session.corner_m, acceleration_m_s2, session.guard)
        aim_enu_m = self._path.aim_enu_m
        super().__init__(
            session, firmware, aim_enu_m, speed_m_s, insists=insists, look_at_m=look_at_m
        )

    def start(self) -> None:
        """Tell the vehicle where it is to fly now."""
        self._session.sent_to_enu_m.append(self._target_enu_m)
        super().start()

    def on_position(self, position: Position) -> None:
        """Turn to the next corner in time; at the last of them, judge arrival."""
        session = self._session
        place_enu_m, velocity_enu_m_s = session.place_enu_m, position.velocity_enu_m_s
        reached_m = session.arrival.radius_m
        if self.accepted and self._path.advance(place_enu_m, velocity_enu_m_s, reached_m):
            self._aim_at(self._path.aim_enu_m)
        elif self._path.is_last:
            super().on_position(position)
        elif self.accepted:
            self._judge_stop(velocity_enu_m_s)
            self._turn_nose()

    def _aim_at(self, target_enu_m: Point) -> None:
        moved, session = self._arrival.moved, self._session
        self._target_enu_m = target_enu_m
        self._arrival = ArrivalDetector(target_enu_m, session.config, session.arrival)
        self._arrival.moved = moved
        self._accepted = False
        self.start()


class _MissionLeg(_Leg):
    """A target that stands on the vehicle, or is on its way there; see `OnboardMission`.

    Who stops a vehicle that flies it changes its mode.
    """

    def __init__(self, session: VehicleSession, order: GoTo, mission: OnboardMission) -> None:
        super().__init__(session, order.position_enu_m)
        self._stay_s = order.stay_s
        self._via_enu_m = order.via_enu_m
        self._mission = mission

    @property
    def arrived(self) -> bool:
        """The vehicle was seen to stop at the target, or says that it reached it."""
        return self._arrived or self._mission.reached

    @property
    def failure(self) -> str | None:
        """Why the target could not be put in force or reached; None while it may."""
        return self._failure or self._mission.failure

    @property
    def takings(self) -> int:
        """How often the vehicle has taken up missions; 0: not this one yet."""
        return self._mission.takings if self.accepted else 0

    @property
    def accepted(self) -> bool:
        """Whether the vehicle flies to it."""
        return self._mission.is_flown

    def on_position(self, position: Position) -> None:
        """Judge arrival, once the vehicle is past all corners: a line may end where it begins."""
        if self._mission.is_past_corners:
            super().on_position(position)
        elif self.accepted:
            self._judge_stop(position.velocity_enu_m_s)

    def start(self) -> None:
        """Put the target in force, in place of whatever stands on the vehicle."""
        speed_m_s = self._session.cruise_speed_m_s
        self._mission.fly_to(self._target_enu_m, self._stay_s, speed_m_s, self._via_enu_m)

    def _on_stalled(self) -> None:
        self._mission.restart()


def reposition_leg(
    session: VehicleSession,
    firmware: Firmware,
    way_enu_m: Sequence[Point],
    speed_m_s: float,
    *,
    insists: bool,
    look_at_m: tuple[float, float] | None = None,
) -> RepositionLeg:
    """To the end of that way, by one target or by one for each corner; see `RepositionLeg`."""
    if len(way_enu_m) > 1:
        return PathLeg(
            session, firmware, way_enu_m, speed_m_s, insists=insists, look_at_m=look_at_m
        )
    target_enu_m = way_enu_m[0]
    return RepositionLeg(
        session, firmware, target_enu_m, speed_m_s, insists=insists, look_at_m=look_at_m
    )


class Flying(Activity):
    """Flies to a target: carries out one `GoTo`."""

    phase = FlightPhase.FLYING

    def __init__(self, session: VehicleSession, firmware: Firmware, order: GoTo) -> None:
        super().__init__(session)
        self.order = order
        self._leg: RepositionLeg | _MissionLeg
        if session.mission is not None:
            self._leg = _MissionLeg(session, order, session.mission)
        else:
            insists = not firmware.pilots_stop_it_there
            way = (*order.via_enu_m, order.position_enu_m)
            speed_m_s, look_at_m = session.cruise_speed_m_s, order.look_at_m
            self._leg = reposition_leg(
                session, firmware, way, speed_m_s, insists=insists, look_at_m=look_at_m
            )

    @property
    def look(self) -> Look | None:
        """As the order has it, level with its end."""
        look_at_m, up_m = self.order.look_at_m, self.order.position_enu_m[2]
        return None if look_at_m is None else Look((*look_at_m, up_m), self._leg.takings)

    @property
    def trigger_m(self) -> float | None:
        """As the order has it."""
        return self.order.trigger_m

    def start(self) -> None:
        """Tell the vehicle, in place of whatever it was told before."""
        self._leg.start()

    def on_ended(self, ended: CommandEnded) -> None:
        """Take the outcome of a command; the mission takes those of its own itself."""
        if isinstance(self._leg, RepositionLeg):
            self._leg.on_ended(ended)

    def on_message(self, message: Inbound) -> None:
        """Take what the vehicle says of the target; a mission is taken as a whole, or not."""
        if isinstance(self._leg, RepositionLeg):
            self._leg.on_message(message)

    def on_position(self, position: Position) -> None:
        """Judge speed and arrival."""
        session, firmware = self._session, self._session.firmware
        told_m_s = session.pace_m_s or session.cruise_speed_m_s
        velocity_enu_m_s = position.velocity_enu_m_s
        if firmware is not None and firmware.traits.stays:  # planes fly at a speed through the air
            session.cruise_watch.judge(velocity_enu_m_s, told_m_s, session.now_s)
            session.tell_caution("speed", session.cruise_watch.remark)
        self._leg.on_position(position)

    def outcome(self) -> Arrived | HandedOver | Refused | None:
        """How the leg ended; None while it is under way."""
        if self._leg.arrived:
            return Arrived(self.order.leg)
        if self._leg.stopped is not None:
            return HandedOver(self._leg.stopped)
        failure = self._leg.failure
        if failure is None:
            return None
        return Refused(self.order, self._session.in_its_words(failure))
