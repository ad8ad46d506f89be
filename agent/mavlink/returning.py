"""The way home: set the return mode until it is seen, then wait for the landing.

Where the order says so, and all is well, the vehicle first flies to a place of its own layer
(agent.mavlink.homeward).

Leaves out: who may order it and what a landing is (agent.mavlink.bridge).
"""

from __future__ import annotations

import math

from agent.mavlink.commands import CommandEnded, Commands, Ending, result_text
from agent.mavlink.config import BridgeConfig
from agent.mavlink.flavours import Flavour
from agent.mavlink.homeward import Homeward
from agent.mavlink.messages import Heartbeat, Outbound
from agent.vehicle import Return

__all__ = ["Returning"]

_TAG = "return"

Point = tuple[float, float, float]
_DISARMED_LONG_S = 5.0
"""A vehicle disarmed for that long is down, even if it does not say that it landed."""


class Returning:
    """Carries out one `Return`.

    Args:
        order: the order.
        config: patience.
        commands: carries the mode.
        flavour: the firmware.
        from_mission: the vehicle may fly a mission of ours.
        homeward: flies it to a place first; None if it returns from where it is.
    """

    def __init__(
        self,
        order: Return,
        config: BridgeConfig,
        commands: Commands,
        flavour: Flavour,
        *,
        from_mission: bool = False,
        homeward: Homeward | None = None,
    ) -> None:
        self.order = order
        self._from_mission = from_mission
        self._homeward = homeward
        self._config = config
        self._commands = commands
        self._flavour = flavour
        self._tries = 0
        self._next_at_s = -math.inf
        self._disarmed_since_s: float | None = None
        self._seen = self._told_seen = False
        self._refusal = "never seen in the heartbeat"
        self.failure: str | None = None
        """Why the vehicle does not return; None while it may."""

    def on_ended(self, ended: CommandEnded, now_s: float) -> None:
        """Take the outcome of a command."""
        if self._homeward is not None:
            self._homeward.on_ended(ended, now_s)
        if ended.tag != _TAG:
            return
        if ended.ending is Ending.ACCEPTED:
            self._next_at_s = now_s + self._config.effect_timeout_s
        else:
            self._refusal = result_text(ended.result)
            self._next_at_s = now_s + self._config.retry_delay_s

    def expects(self, custom_mode: int) -> bool:
        """Whether that mode fits the return; anything else is somebody else's doing."""
        if self._flavour.is_returning(custom_mode):
            self._seen = True
            return True
        if self._homeward is not None:
            return self._homeward.expects(custom_mode, from_mission=self._from_mission)
        return self._obeys(custom_mode) and not self._seen

    def has_begun(self) -> bool:
        """Whether the return mode has been seen; true once."""
        news, self._told_seen = self._seen and not self._told_seen, self._seen
        return news

    @property
    def on_detour(self) -> bool:
        """Whether it flies to a place first."""
        return self._homeward is not None

    def go_straight(self, now_s: float) -> list[Outbound]:
        """Return from where the vehicle is."""
        homeward, self._homeward = self._homeward, None
        return [] if homeward is None else homeward.end(now_s)

    def on_position(self, place_enu_m: Point, velocity_enu_m_s: Point, now_s: float) -> None:
        """See whether it is where it flies to first."""
        if self._homeward is not None:
            self._homeward.on_position(place_enu_m, velocity_enu_m_s, now_s)

    def advance(self, heartbeat: Heartbeat, now_s: float) -> list[Outbound]:
        """Set the mode as long as it is not seen and the vehicle still takes our orders."""
        out: list[Outbound] = []
        if self._homeward is not None:
            if not self._seen:
                out = self._homeward.advance(heartbeat, now_s)
            if not (self._homeward.done or self._seen):
                return out
            out += self.go_straight(now_s)
        return out + self._set_mode(heartbeat, now_s)

    def _set_mode(self, heartbeat: Heartbeat, now_s: float) -> list[Outbound]:
        if heartbeat.armed:
            self._disarmed_since_s = None
        elif self._disarmed_since_s is None:
            self._disarmed_since_s = now_s
        if not heartbeat.armed or not self._obeys(heartbeat.custom_mode):
            return []
        if self._commands.pending(_TAG) or now_s < self._next_at_s:
            return []
        if self._tries >= self._config.mode_tries:
            self.failure = f"the return mode cannot be set ({self._refusal})"
            return []
        self._tries += 1
        return [*self._commands.send(_TAG, self._flavour.set_return_mode(), now_s)]

    def _obeys(self, custom_mode: int) -> bool:
        """Whether the vehicle takes our orders in that mode, be it still taking off on one."""
        flavour = self._flavour
        return (
            flavour.is_commanded(custom_mode)
            or flavour.is_taking_off(custom_mode)
            or (self._from_mission and flavour.is_mission(custom_mode))
        )

    def disarmed_long(self, now_s: float) -> bool:
        """Whether the motors have stood still for a while."""
        since_s = self._disarmed_since_s
        return since_s is not None and now_s - since_s >= _DISARMED_LONG_S
