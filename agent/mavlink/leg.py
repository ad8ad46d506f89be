"""One flight to one place: tell the vehicle, see it arrive, tell it again if it stands still.

Arrival is judged by the vehicle's own position and speed against this target, and only
after the vehicle acknowledged it: a vehicle that still flies elsewhere has not arrived,
wherever it happens to be. Leaves out: what follows arrival.
"""

from __future__ import annotations

import math

from agent.mavlink.commands import Command, CommandEnded, Commands, Ending, result_text
from agent.mavlink.config import BridgeConfig
from agent.mavlink.messages import CommandInt

__all__ = ["TARGET_TAG", "Leg"]

TARGET_TAG = "target"
"""Tag of the command that carries a target: a new one supersedes the last."""


class Leg:
    """A target in force, or on its way to be.

    Args:
        target_enu_m: where to stop [m; mission origin].
        message: the command that says so in the autopilot's terms.
        config: radius, speed and patience.
    """

    def __init__(
        self,
        target_enu_m: tuple[float, float, float],
        message: CommandInt,
        config: BridgeConfig,
    ) -> None:
        self._target_enu_m = target_enu_m
        self._message = message
        self._config = config
        self._still_since_s: float | None = None
        self._tellings = 0
        self.accepted = False
        """The vehicle acknowledged the target."""
        self.arrived = False
        """The vehicle was seen to stop at the target."""
        self.failure: str | None = None
        """Why the target could not be put in force or reached; None while it may."""

    def start(self, commands: Commands, now_s: float) -> list[Command]:
        """Tell the vehicle, in place of whatever it was told before."""
        return commands.send(TARGET_TAG, self._message, now_s)

    def on_ended(self, ended: CommandEnded) -> None:
        """Take the outcome of the command."""
        if ended.tag != TARGET_TAG:
            return
        if ended.ending is Ending.ACCEPTED:
            self.accepted = True
        else:
            self.failure = f"the autopilot did not take the target ({result_text(ended.result)})"

    def on_position(
        self,
        position_enu_m: tuple[float, float, float],
        velocity_enu_m_s: tuple[float, float, float],
        commands: Commands,
        now_s: float,
    ) -> list[Command]:
        """Judge arrival; the flag `arrived` stays once set."""
        if not self.accepted or self.arrived:
            return []
        slow = math.hypot(*velocity_enu_m_s) <= self._config.arrival_speed_m_s
        if not slow:
            self._still_since_s = None
            return []
        distance_m = math.dist(position_enu_m, self._target_enu_m)
        if distance_m <= self._config.acceptance_radius_m:
            self.arrived = True
            return []
        if self._still_since_s is None:
            self._still_since_s = now_s
        if now_s - self._still_since_s < self._config.stall_timeout_s:
            return []
        self._still_since_s = now_s
        self._tellings += 1
        if self._tellings > self._config.stall_tries:
            self.failure = f"the vehicle stands still {distance_m:.1f} m from the target"
            return []
        return commands.send(TARGET_TAG, self._message, now_s)
