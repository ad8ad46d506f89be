"""The way home: set the return mode until it is seen, then wait for the landing.

Return modes fly at a height of the vehicle's own, in which the layers of a fleet vanish. So a
vehicle that has the time is first told to fly to where it started, in its own layer, and
returns from there. Whatever goes wrong ends that part at once, as home matters more. Leaves
out: who may order it and what a landing is (agent.vehicle.bridge).
"""

from __future__ import annotations

import math

from agent.core.interface import Return
from agent.vehicle.commands import CommandEnded, CommandOutcome, CommandQueue, result_text
from agent.vehicle.config import BridgeConfig
from agent.vehicle.firmware.profile import Firmware
from agent.vehicle.leg import TARGET_TAG, ArrivalDetector, ArrivalState
from agent.vehicle.messages import Heartbeat, Outbound
from swarm.model.frames import wgs84_from_enu

__all__ = ["ReturnVia", "Returning"]


_RETURN_TAG = "return"


Point = tuple[float, float, float]

_DISARMED_LONG_S = 5.0
"""A vehicle disarmed for that long is down, even if it does not say that it landed."""


class Returning:
    """Carries out one `Return`.

    Args:
        order: the order.
        config: patience.
        commands: carries the mode.
        firmware: what flies it.
        from_mission: the vehicle may fly a mission of ours.
        return_via: flies it to a place first; None if it returns from where it is.
    """

    def __init__(
        self,
        order: Return,
        config: BridgeConfig,
        commands: CommandQueue,
        firmware: Firmware,
        *,
        from_mission: bool = False,
        return_via: ReturnVia | None = None,
    ) -> None:
        self.order = order
        self._from_mission = from_mission
        self._return_via = return_via
        self._config = config
        self._commands = commands
        self._firmware = firmware
        self._tries = 0
        self._next_at_s = -math.inf
        self._disarmed_since_s: float | None = None
        self._seen = self._told_seen = False
        self._refusal = "never seen in the heartbeat"
        self.failure: str | None = None
        """Why the vehicle does not return; None while it may."""

    def on_ended(self, ended: CommandEnded, now_s: float) -> None:
        """Take the outcome of a command."""
        if self._return_via is not None:
            self._return_via.on_ended(ended, now_s)
        if ended.tag != _RETURN_TAG:
            return
        if ended.ending is CommandOutcome.ACCEPTED:
            self._next_at_s = now_s + self._config.effect_timeout_s
        else:
            self._refusal = result_text(ended.result)
            self._next_at_s = now_s + self._config.retry_delay_s

    def expects(self, custom_mode: int) -> bool:
        """Whether that mode fits the return; anything else is somebody else's doing."""
        if self._firmware.is_returning(custom_mode):
            self._seen = True
            return True
        if self._return_via is not None:
            return self._return_via.expects(custom_mode, from_mission=self._from_mission)
        return self._obeys(custom_mode) and not self._seen

    def has_begun(self) -> bool:
        """Whether the return mode has been seen; true once."""
        news, self._told_seen = self._seen and not self._told_seen, self._seen
        return news

    @property
    def on_detour(self) -> bool:
        """Whether it flies to a place first."""
        return self._return_via is not None

    def go_straight(self, now_s: float) -> list[Outbound]:
        """Return from where the vehicle is."""
        return_via, self._return_via = self._return_via, None
        return [] if return_via is None else return_via.end(now_s)

    def on_position(self, place_enu_m: Point, velocity_enu_m_s: Point, now_s: float) -> None:
        """See whether it is where it flies to first."""
        if self._return_via is not None:
            self._return_via.on_position(place_enu_m, velocity_enu_m_s, now_s)

    def advance(self, heartbeat: Heartbeat, now_s: float) -> list[Outbound]:
        """Set the mode as long as it is not seen and the vehicle still takes our orders."""
        out: list[Outbound] = []
        if self._return_via is not None:
            if not self._seen:
                out = self._return_via.advance(heartbeat, now_s)
            if not (self._return_via.done or self._seen):
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
        if self._commands.pending(_RETURN_TAG) or now_s < self._next_at_s:
            return []
        if self._tries >= self._config.mode_tries:
            self.failure = f"the return mode cannot be set ({self._refusal})"
            return []
        self._tries += 1
        return [*self._commands.send(_RETURN_TAG, self._firmware.set_return_mode(), now_s)]

    def _obeys(self, custom_mode: int) -> bool:
        """Whether the vehicle takes our orders in that mode, be it still taking off on one."""
        firmware = self._firmware
        return (
            firmware.is_commanded(custom_mode)
            or firmware.is_taking_off(custom_mode)
            or (self._from_mission and firmware.is_mission(custom_mode))
        )

    def disarmed_long(self, now_s: float) -> bool:
        """Whether the motors have stood still for a while."""
        since_s = self._disarmed_since_s
        return since_s is not None and now_s - since_s >= _DISARMED_LONG_S


_MODE_TAG = "homeward mode"

_SLOWEST_M_S = 1.0
"""Cruise speed that is reckoned with where none is known."""

_UNKNOWN_SPEED_M_S = -1.0
"""The vehicle is to fly as fast as it is set to."""

_START_S = 30.0

_PATIENCE = 3.0
"""It may take that many times as long as at cruise speed, and `_START_S` more."""


class ReturnVia:
    """Flies to one place on the way home.

    Args:
        via_enu_m: where to [m; mission origin].
        place_enu_m: where the vehicle is.
        speed_m_s: cruise speed; 0 if it is not known.
        config: radius, speed and patience.
        commands: carries what is told.
        firmware: what flies it.
        now_s: now.
    """

    def __init__(
        self,
        via_enu_m: Point,
        place_enu_m: Point,
        speed_m_s: float,
        config: BridgeConfig,
        commands: CommandQueue,
        firmware: Firmware,
        now_s: float,
    ) -> None:
        self._config = config
        self._commands = commands
        self._firmware = firmware
        self._arrival = ArrivalDetector(via_enu_m, config)
        place = wgs84_from_enu(config.origin, via_enu_m)
        known = speed_m_s > 0.0
        self._target = firmware.reposition(*place, speed_m_s if known else _UNKNOWN_SPEED_M_S)
        flight_s = math.dist(place_enu_m, via_enu_m) / (speed_m_s if known else _SLOWEST_M_S)
        self._until_s = now_s + _START_S + _PATIENCE * flight_s
        self._mode_until_s: float | None = None
        self._mode_seen = self._told = self._accepted = False
        self.done = False
        """The vehicle is there, or will not be; stays once true."""

    def expects(self, custom_mode: int, *, from_mission: bool) -> bool:
        """Whether that mode fits; anything else is somebody else's doing."""
        if self._firmware.is_commanded(custom_mode):
            self._mode_seen = True
            return True
        return from_mission and not self._mode_seen and self._firmware.is_mission(custom_mode)

    def on_ended(self, ended: CommandEnded, now_s: float) -> None:
        """Take a command's outcome."""
        if ended.tag not in (_MODE_TAG, TARGET_TAG):
            return
        if ended.ending is not CommandOutcome.ACCEPTED:
            self.done = True
        elif ended.tag == TARGET_TAG:
            self._accepted = True
        else:
            self._mode_until_s = now_s + self._config.effect_timeout_s

    def on_position(self, place_enu_m: Point, velocity_enu_m_s: Point, now_s: float) -> None:
        """See whether it is there, or stands still elsewhere."""
        if self._accepted and not self.done:
            arrival = self._arrival.judge(place_enu_m, velocity_enu_m_s, now_s)
            self.done = arrival is not ArrivalState.UNDERWAY

    def advance(self, heartbeat: Heartbeat, now_s: float) -> list[Outbound]:
        """Tell the vehicle what is still to be told: the mode until it is seen, then the place."""
        if now_s >= self._until_s:
            self.done = True
        if self.done or self._told:
            return []
        if self._firmware.is_commanded(heartbeat.custom_mode):
            self._told = True
            return [*self._commands.send(TARGET_TAG, self._target, now_s)]
        if self._mode_until_s is not None:
            self.done = now_s >= self._mode_until_s
            return []
        if self._commands.pending(_MODE_TAG):
            return []
        return [*self._commands.send(_MODE_TAG, self._firmware.set_commanded_mode(), now_s)]

    def end(self, now_s: float) -> list[Outbound]:
        """It returns from where it is; nothing more is told about the place."""
        self.done = True
        commands = self._commands
        return [*commands.cancel(_MODE_TAG, now_s), *commands.cancel(TARGET_TAG, now_s)]
