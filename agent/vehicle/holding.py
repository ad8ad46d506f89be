"""A vehicle is stopped where it is: in the air it hovers, on the ground it is disarmed.

Out of a mission, a return or a takeoff in a mode of its own, the guided mode stops the
vehicle. In the guided mode the firmware's own pause does, which needs no place; where there
is none, a target at the place where the vehicle is, if what it told before bears that out,
or the nearest within the fence. All are told again until the effect is seen. Leaves out:
what was under way before, and who may order it (agent.vehicle.activity_runner).
"""

from __future__ import annotations

import math
from collections.abc import Callable

from agent.core.interface import Hold
from agent.vehicle.commands import (
    CommandEnded,
    CommandOutcome,
    CommandQueue,
    VehicleCommand,
    result_text,
)
from agent.vehicle.config import BridgeConfig
from agent.vehicle.firmware.profile import Firmware
from agent.vehicle.leg import TARGET_TAG
from agent.vehicle.messages import Heartbeat, Landed, Outbound, Position
from agent.vehicle.state import PositionFilter, VehicleState
from swarm.model.frames import wgs84_from_enu

__all__ = ["Holding", "modes_to_leave"]


Point = tuple[float, float, float]

_MODE_TAG = "hold mode"
_DISARM_TAG = "disarm"


class Holding:
    """Carries out one `Hold`.

    Args:
        order: the order.
        config: patience.
        commands: carries what is told.
        firmware: what flies it.
        speed_m_s: cruise speed, for firmwares that take it with every target.
        leaves: whether a mode is one that the vehicle flies on our orders, and may be
            taken out of.
        motors_asked: the vehicle may be about to arm.
    """

    def __init__(
        self,
        order: Hold,
        config: BridgeConfig,
        commands: CommandQueue,
        firmware: Firmware,
        speed_m_s: float,
        leaves: Callable[[int], bool],
        *,
        motors_asked: bool = False,
    ) -> None:
        self.order = order
        self._config = config
        self._commands = commands
        self._firmware = firmware
        self._speed_m_s = speed_m_s
        self._leaves = leaves
        self._motors_asked = motors_asked
        self._tries: dict[str, int] = {}
        self._next_s: dict[str, float] = {}
        self._refusal = ""
        self._stop: VehicleCommand | None = None
        """What stops it in the guided mode, once known."""
        self._lost_since_s: float | None = None
        self._told = False
        """The vehicle has taken the place to hover at, or was taken out of another mode."""
        self._guided_seen = False
        self.done = False
        self.aloft = False
        """The vehicle is in the air, as far as it said."""
        self.failure: str | None = None
        """Why it does not stop; None while it may."""

    def expects(self, custom_mode: int) -> bool:
        """Whether that mode fits; anything else is somebody else's doing."""
        if self._firmware.is_commanded(custom_mode):
            self._guided_seen = True
            return True
        return not self._guided_seen and self._leaves(custom_mode)

    def on_ended(self, ended: CommandEnded, now_s: float) -> None:
        """Take a command's outcome."""
        if ended.tag not in self._tries:
            return
        accepted = ended.ending is CommandOutcome.ACCEPTED
        self._refusal = "" if accepted else result_text(ended.result)
        wait_s = self._config.effect_timeout_s if accepted else self._config.retry_delay_s
        self._next_s[ended.tag] = now_s + wait_s
        if accepted and ended.tag == TARGET_TAG:
            self._told = True
        elif accepted and ended.tag == _DISARM_TAG:
            self._motors_asked = False

    def on_position(self, position: Position) -> None:
        """See whether it has stopped."""
        slow = math.hypot(*position.velocity_enu_m_s) <= self._config.arrival_speed_m_s
        if self._told and self._guided_seen and slow:
            self.done = True

    def advance(
        self, vehicle: VehicleState, heartbeat: Heartbeat, where: PositionFilter, now_s: float
    ) -> list[Outbound]:
        """Tell the vehicle what is still to be told."""
        if self.done or self.failure is not None:
            return []
        self.aloft = heartbeat.armed and vehicle.landed is not Landed.ON_GROUND
        if not heartbeat.armed and not self._motors_asked:
            self.done = True
            return []
        if not self.aloft:
            return self._ask(_DISARM_TAG, self._firmware.disarm(), now_s)
        if not self._firmware.is_commanded(heartbeat.custom_mode):
            # The guided mode begins with a stop, which is given the time to be seen.
            self._told = True
            self._next_s[TARGET_TAG] = now_s + self._config.effect_timeout_s
            return self._ask(_MODE_TAG, self._firmware.set_commanded_mode(), now_s)
        self._guided_seen = True
        if self._stop is None:
            self._stop = self._firmware.pause() or self._stay_at(where, now_s)
        return [] if self._stop is None else self._ask(TARGET_TAG, self._stop, now_s)

    def _stay_at(self, where: PositionFilter, now_s: float) -> VehicleCommand | None:
        """A target where the vehicle is; None while that is not known."""
        place_m = where.place_m(now_s - self._config.stream_timeout_s)
        if place_m is not None:
            place = wgs84_from_enu(self._config.origin, self._config.within_fence(place_m))
            return self._firmware.reposition(*place, self._speed_m_s)
        if self._lost_since_s is None:
            self._lost_since_s = now_s
        elif now_s - self._lost_since_s >= self._config.position_timeout_s:
            self.failure = "the places that it tells are too far apart to stop it at one"
        return None

    def _ask(self, tag: str, command: VehicleCommand, now_s: float) -> list[Outbound]:
        if self._commands.pending(tag) or now_s < self._next_s.get(tag, -math.inf):
            return []
        tries = self._tries.get(tag, 0)
        if tries >= self._config.mode_tries:
            why = f": {self._refusal}" if self._refusal else ""
            self.failure = f"the vehicle was told to stop {tries} times and goes on{why}"
            return []
        self._tries[tag] = tries + 1
        return [*self._commands.send(tag, command, now_s)]


def modes_to_leave(
    firmware: Firmware, mode: int, *, took_off: bool, on_missions: bool, returning: bool
) -> Callable[[int], bool]:
    """Which modes the vehicle may be taken out of: those that our orders led to.

    Args:
        firmware: what flies it.
        mode: the one it is in.
        took_off: it was told to take off.
        on_missions: it may fly a mission of ours.
        returning: it was told to return.
    """

    def leaves(custom_mode: int) -> bool:
        return (
            custom_mode == mode
            or (took_off and firmware.is_taking_off(custom_mode))
            or (on_missions and firmware.is_mission(custom_mode))
            or (returning and firmware.is_returning(custom_mode))
        )

    return leaves
