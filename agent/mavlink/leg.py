"""One flight to one place: what a bridge asks of a leg, and the leg by reposition.

Arrival is judged by the vehicle's own position and speed against this target, and only
after the vehicle took it: a vehicle that still flies elsewhere has not arrived, wherever
it happens to be. Leaves out: what follows arrival, and the leg by mission
(agent.mavlink.mission_leg).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from enum import Enum, auto
from typing import Protocol

from agent.mavlink.commands import CommandEnded, Commands, Ending
from agent.mavlink.config import BridgeConfig
from agent.mavlink.messages import CommandInt, Outbound

__all__ = ["TARGET_TAG", "Approach", "Leg", "Nearness", "RepositionLeg"]

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


class Nearness(Enum):
    """What a position says of a target."""

    UNDERWAY = auto()
    ARRIVED = auto()
    """Slow, and within the acceptance radius."""
    STALLED = auto()
    """Slow elsewhere for so long that it should be told again."""
    GIVEN_UP = auto()
    """Stalled, and told again often enough."""


class Approach:
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

    def judge(self, position_enu_m: Point, velocity_enu_m_s: Point, now_s: float) -> Nearness:
        """Take one position and speed."""
        self.distance_m = math.dist(position_enu_m, self._target_enu_m)
        if math.hypot(*velocity_enu_m_s) > self._config.arrival_speed_m_s:
            self._still_since_s = None
            self.moved = True
            return Nearness.UNDERWAY
        if self.distance_m <= self._config.acceptance_radius_m:
            return Nearness.ARRIVED
        if self._still_since_s is None:
            self._still_since_s = now_s
        if now_s - self._still_since_s < self._config.stall_timeout_s:
            return Nearness.UNDERWAY
        self._still_since_s = now_s
        self._tellings += 1
        return Nearness.GIVEN_UP if self._tellings > self._config.stall_tries else Nearness.STALLED

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
        commands: Commands,
        why: Callable[[int | None], str],
        *,
        insists: bool = True,
    ) -> None:
        self._insists = insists
        self._why = why
        self._message = message
        self._commands = commands
        self._approach = Approach(target_enu_m, config)
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
        if ended.ending is Ending.ACCEPTED:
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
        match self._approach.judge(position_enu_m, velocity_enu_m_s, now_s):
            case Nearness.ARRIVED:
                self.arrived = True
            case Nearness.STALLED if self._insists:
                return self._commands.send(TARGET_TAG, self._message, now_s)
            case Nearness.STALLED if self._approach.moved:
                short_m = self._approach.distance_m
                self.stopped = (
                    f"it stopped {short_m:.0f} m short of its target: paused by a ground station?"
                )
            case Nearness.STALLED:
                self.failure = self._approach.complaint
            case Nearness.GIVEN_UP:
                self.failure = self._approach.complaint
            case Nearness.UNDERWAY:
                pass
        return []
