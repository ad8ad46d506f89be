"""One flight to one place: by a reposition command, or by a mission that ends at home.

Arrival is judged by the vehicle's own position and speed against this target, and only after
the vehicle took it: a vehicle that still flies elsewhere has not arrived, wherever it happens
to be. One that never comes to rest at a mission's target, as in strong wind, has arrived too if
it says that it reached the item and is near.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from enum import Enum, auto
from typing import Protocol

from agent.core.interface import Arrived, GoTo, HandedOver, Refused
from agent.vehicle.activity import Activity, FlightPhase
from agent.vehicle.commands import CommandEnded, CommandOutcome, CommandQueue
from agent.vehicle.config import BridgeConfig
from agent.vehicle.firmware.profile import Firmware
from agent.vehicle.messages import CommandInt, Inbound, Outbound, Position, StatusText
from agent.vehicle.onboard_mission import OnboardMission
from agent.vehicle.session import VehicleSession
from swarm.model.frames import wgs84_from_enu

__all__ = [
    "TARGET_TAG",
    "ArrivalDetector",
    "ArrivalState",
    "Flying",
    "Leg",
    "MissionLeg",
    "RepositionLeg",
]


TARGET_TAG = "target"
"""Tag of the command that carries a target: a new one supersedes the last."""


Point = tuple[float, float, float]


class Leg(Protocol):
    """A target in force, or on its way to be."""

    @property
    def arrived(self) -> bool:
        """The vehicle was seen to stop at the target; stays once true."""
        ...

    @property
    def failure(self) -> str | None:
        """Why the target could not be put in force or reached; None while it may."""
        ...

    @property
    def stopped(self) -> str | None:
        """Why somebody else seems to have stopped the vehicle; None if nobody has."""
        ...

    def start(self, now_s: float) -> Sequence[Outbound]:
        """Tell the vehicle, in place of whatever it was told before."""
        ...

    def on_ended(self, ended: CommandEnded) -> None:
        """Take the outcome of a command."""
        ...

    def ignored(self, text: str) -> None:
        """The vehicle says that it does not fly to the target, whatever it acknowledged."""
        ...

    def on_position(
        self, position_enu_m: Point, velocity_enu_m_s: Point, now_s: float
    ) -> Sequence[Outbound]:
        """Judge arrival."""
        ...


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

    def __init__(self, target_enu_m: Point, config: BridgeConfig) -> None:
        self._target_enu_m = target_enu_m
        self._config = config
        self._still_since_s: float | None = None
        self._tellings = 0
        self.distance_m = math.inf
        """As last seen."""
        self.moved = False
        """Whether the vehicle was seen to move since it was told."""

    def judge(self, position_enu_m: Point, velocity_enu_m_s: Point, now_s: float) -> ArrivalState:
        """Take one position and speed."""
        self.distance_m = math.dist(position_enu_m, self._target_enu_m)
        if math.hypot(*velocity_enu_m_s) > self._config.arrival_speed_m_s:
            self._still_since_s = None
            self.moved = True
            return ArrivalState.UNDERWAY
        if self.distance_m <= self._config.acceptance_radius_m:
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


class RepositionLeg:
    """A target told by one command, and told again if the vehicle stands still elsewhere.

    Args:
        target_enu_m: where to stop [m; mission origin].
        message: the command that says so in the autopilot's terms.
        config: radius, speed and patience.
        commands: carries it.
        why: the words for the result of a refusal.
        insists: the target is told again if the vehicle stands still elsewhere. If not, one
            that stopped on its way is taken to be somebody else's.
    """

    def __init__(
        self,
        target_enu_m: Point,
        message: CommandInt,
        config: BridgeConfig,
        commands: CommandQueue,
        why: Callable[[int | None], str],
        *,
        insists: bool = True,
    ) -> None:
        self._insists = insists
        self._why = why
        self._message = message
        self._commands = commands
        self._arrival = ArrivalDetector(target_enu_m, config)
        self.accepted = False
        """The vehicle acknowledged the target."""
        self.arrived = False
        self.failure: str | None = None
        self.stopped: str | None = None

    def start(self, now_s: float) -> Sequence[Outbound]:
        """Tell the vehicle, in place of whatever it was told before."""
        return self._commands.send(TARGET_TAG, self._message, now_s)

    def on_ended(self, ended: CommandEnded) -> None:
        """Take the outcome of the command."""
        if ended.tag != TARGET_TAG:
            return
        if ended.ending is CommandOutcome.ACCEPTED:
            self.accepted = True
        else:
            self.failure = f"the autopilot did not take the target ({self._why(ended.result)})"

    def ignored(self, text: str) -> None:
        """The vehicle says that it does not fly to the target, whatever it acknowledged."""
        if not self.arrived:
            self.failure = f"the autopilot did not take the target: {text}"

    def on_position(
        self, position_enu_m: Point, velocity_enu_m_s: Point, now_s: float
    ) -> Sequence[Outbound]:
        """Judge arrival; the flag `arrived` stays once set."""
        if not self.accepted or self.arrived:
            return []
        match self._arrival.judge(position_enu_m, velocity_enu_m_s, now_s):
            case ArrivalState.ARRIVED:
                self.arrived = True
            case ArrivalState.STALLED if self._insists:
                return self._commands.send(TARGET_TAG, self._message, now_s)
            case ArrivalState.STALLED if self._arrival.moved:
                short_m = self._arrival.distance_m
                self.stopped = (
                    f"it stopped {short_m:.0f} m short of its target: paused by a ground station?"
                )
            case ArrivalState.STALLED:
                self.failure = self._arrival.complaint
            case ArrivalState.GIVEN_UP:
                self.failure = self._arrival.complaint
            case ArrivalState.UNDERWAY:
                pass
        return []


class MissionLeg:
    """A target that stands on the vehicle, or is on its way there.

    Args:
        target_enu_m: where to stop [m; mission origin].
        stay_s: how long the UAV is going to stay there [s].
        speed_m_s: cruise ground speed.
        config: radius, speed and patience.
        mission: the vehicle's.
    """

    def __init__(
        self,
        target_enu_m: Point,
        stay_s: float,
        speed_m_s: float,
        config: BridgeConfig,
        mission: OnboardMission,
    ) -> None:
        self._target_enu_m = target_enu_m
        self._stay_s = stay_s
        self._speed_m_s = speed_m_s
        self._mission = mission
        self._arrival = ArrivalDetector(target_enu_m, config)
        self._given_up: str | None = None
        self._arrived = False

    @property
    def arrived(self) -> bool:
        """The vehicle was seen to stop at the target, or says that it reached it."""
        return self._arrived or self._mission.reached

    @property
    def failure(self) -> str | None:
        """Why the target could not be put in force or reached; None while it may."""
        return self._given_up or self._mission.failure

    @property
    def stopped(self) -> str | None:
        """None: who stops a vehicle changes its mode."""
        return None

    def start(self, now_s: float) -> Sequence[Outbound]:
        """Put the target in force, in place of whatever stands on the vehicle."""
        return self._mission.fly_to(self._target_enu_m, self._stay_s, self._speed_m_s, now_s)

    def on_ended(self, ended: CommandEnded) -> None:
        """Nothing: the mission takes the outcomes of its commands itself."""

    def ignored(self, text: str) -> None:
        """Nothing: a mission is taken as a whole, or not."""

    def on_position(
        self, position_enu_m: Point, velocity_enu_m_s: Point, now_s: float
    ) -> Sequence[Outbound]:
        """Judge arrival."""
        if self.arrived or not self._mission.is_flown:
            return []
        match self._arrival.judge(position_enu_m, velocity_enu_m_s, now_s):
            case ArrivalState.ARRIVED:
                self._arrived = True
            case ArrivalState.STALLED:
                self._mission.restart(now_s)
            case ArrivalState.GIVEN_UP:
                self._given_up = self._arrival.complaint
            case ArrivalState.UNDERWAY:
                pass
        return []


class Flying(Activity):
    """Flies to a target: carries out one `GoTo`.

    Args:
        session: with the vehicle.
        firmware: what flies it.
        order: the order.
    """

    phase = FlightPhase.FLYING

    def __init__(self, session: VehicleSession, firmware: Firmware, order: GoTo) -> None:
        super().__init__(session)
        self._order = order
        self._firmware = firmware
        self._leg = _leg_to(order, session, firmware)

    def start(self) -> None:
        """Tell the vehicle, in place of whatever it was told before."""
        self._session.say(*self._leg.start(self._session.now_s))

    def on_ended(self, ended: CommandEnded) -> None:
        """Take the outcome of a command."""
        self._leg.on_ended(ended)

    def on_message(self, message: Inbound) -> None:
        """Take what the vehicle says of the target."""
        if isinstance(message, StatusText) and self._firmware.ignores_target(message.text):
            self._leg.ignored(message.text)

    def on_position(self, position: Position) -> None:
        """Judge speed and arrival."""
        session, velocity_enu_m_s = self._session, position.velocity_enu_m_s
        told_m_s = session.cruise_speed_m_s
        if remark := session.cruise_watch.judge(velocity_enu_m_s, told_m_s, session.now_s):
            session.tell_caution(remark)
        session.say(*self._leg.on_position(session.place_enu_m, velocity_enu_m_s, session.now_s))

    def outcome(self) -> Arrived | HandedOver | Refused | None:
        """How the leg ended; None while it is under way."""
        if self._leg.arrived:
            return Arrived(self._order.leg)
        if self._leg.stopped is not None:
            return HandedOver(self._leg.stopped)
        failure = self._leg.failure
        if failure is None:
            return None
        return Refused(self._order, self._session.in_its_words(failure))


def _leg_to(order: GoTo, session: VehicleSession, firmware: Firmware) -> Leg:
    target_enu_m, config = order.position_enu_m, session.config
    speed_m_s = session.cruise_speed_m_s
    if session.mission is not None:
        return MissionLeg(target_enu_m, order.stay_s, speed_m_s, config, session.mission)
    place = wgs84_from_enu(config.origin, target_enu_m)
    message = firmware.reposition(*place, speed_m_s)
    insists = not firmware.pilots_stop_it_there
    return RepositionLeg(
        target_enu_m,
        message,
        config,
        session.commands,
        lambda result: firmware.place_refusal(session.vehicle, result),
        insists=insists,
    )
