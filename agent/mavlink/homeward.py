"""The first part of the way home: to a place in the UAV's own height layer, by a target.

Return modes fly at a height of the vehicle's own, in which the layers of a fleet vanish. So
a vehicle that has the time is first told to fly to where it started, and returns from there.
Whatever goes wrong ends that part at once, as home matters more. Leaves out: the return mode
(agent.mavlink.returning), and who has the time (agent.core).
"""

from __future__ import annotations

import math

from agent.mavlink.commands import CommandEnded, Commands, Ending
from agent.mavlink.config import BridgeConfig
from agent.mavlink.flavours import Flavour
from agent.mavlink.leg import TARGET_TAG, Approach, Nearness
from agent.mavlink.messages import Heartbeat, Outbound
from swarm.model.frames import wgs84_from_enu

__all__ = ["Homeward"]

_MODE_TAG = "homeward mode"
_SLOWEST_M_S = 1.0
"""Cruise speed that is reckoned with where none is known."""
_UNKNOWN_SPEED_M_S = -1.0
"""The vehicle is to fly as fast as it is set to."""
_START_S = 30.0
_PATIENCE = 3.0
"""It may take that many times as long as at cruise speed, and `_START_S` more."""

Point = tuple[float, float, float]


class Homeward:
    """Flies to one place on the way home.

    Args:
        via_enu_m: where to [m; mission origin].
        place_enu_m: where the vehicle is.
        speed_m_s: cruise speed; 0 if it is not known.
        config: radius, speed and patience.
        commands: carries what is told.
        flavour: the firmware.
        now_s: now.
    """

    def __init__(
        self,
        via_enu_m: Point,
        place_enu_m: Point,
        speed_m_s: float,
        config: BridgeConfig,
        commands: Commands,
        flavour: Flavour,
        now_s: float,
    ) -> None:
        self._config = config
        self._commands = commands
        self._flavour = flavour
        self._approach = Approach(via_enu_m, config)
        place = wgs84_from_enu(config.origin, via_enu_m)
        known = speed_m_s > 0.0
        self._target = flavour.reposition(*place, speed_m_s if known else _UNKNOWN_SPEED_M_S)
        flight_s = math.dist(place_enu_m, via_enu_m) / (speed_m_s if known else _SLOWEST_M_S)
        self._until_s = now_s + _START_S + _PATIENCE * flight_s
        self._mode_until_s: float | None = None
        self._mode_seen = self._told = self._accepted = False
        self.done = False
        """The vehicle is there, or will not be; stays once true."""

    def expects(self, custom_mode: int, *, from_mission: bool) -> bool:
        """Whether that mode fits; anything else is somebody else's doing."""
        if self._flavour.is_commanded(custom_mode):
            self._mode_seen = True
            return True
        return from_mission and not self._mode_seen and self._flavour.is_mission(custom_mode)

    def on_ended(self, ended: CommandEnded, now_s: float) -> None:
        """Take a command's outcome."""
        if ended.tag not in (_MODE_TAG, TARGET_TAG):
            return
        if ended.ending is not Ending.ACCEPTED:
            self.done = True
        elif ended.tag == TARGET_TAG:
            self._accepted = True
        else:
            self._mode_until_s = now_s + self._config.effect_timeout_s

    def on_position(self, place_enu_m: Point, velocity_enu_m_s: Point, now_s: float) -> None:
        """See whether it is there, or stands still elsewhere."""
        if self._accepted and not self.done:
            nearness = self._approach.judge(place_enu_m, velocity_enu_m_s, now_s)
            self.done = nearness is not Nearness.UNDERWAY

    def advance(self, heartbeat: Heartbeat, now_s: float) -> list[Outbound]:
        """Tell the vehicle what is still to be told: the mode until it is seen, then the place."""
        if now_s >= self._until_s:
            self.done = True
        if self.done or self._told:
            return []
        if self._flavour.is_commanded(heartbeat.custom_mode):
            self._told = True
            return [*self._commands.send(TARGET_TAG, self._target, now_s)]
        if self._mode_until_s is not None:
            self.done = now_s >= self._mode_until_s
            return []
        if self._commands.pending(_MODE_TAG):
            return []
        return [*self._commands.send(_MODE_TAG, self._flavour.set_commanded_mode(), now_s)]

    def end(self, now_s: float) -> list[Outbound]:
        """It returns from where it is; nothing more is told about the place."""
        self.done = True
        commands = self._commands
        return [*commands.cancel(_MODE_TAG, now_s), *commands.cancel(TARGET_TAG, now_s)]
