"""What a careful pilot keeps an eye on: battery, fence, position, the autopilot's alarms.

Each judgement is debounced, because readings err, and comes with a reason that a person
understands. On the ground any doubt keeps the vehicle from being armed; in the air a
judgement has to last. Each is told once a flight; the battery again whenever its charge has
halved, since the return may have been broken off. Leaves out: what is done about it
(agent.mavlink.bridge), and who flies the vehicle (agent.mavlink.authority).
"""

from __future__ import annotations

import math
from collections import deque

from agent.mavlink.authority import TERMINATED, was_terminated
from agent.mavlink.config import BridgeConfig
from agent.mavlink.flavours import Flavour
from agent.mavlink.messages import Battery, Heartbeat, Inbound, SystemStatus
from agent.mavlink.state import VehicleState

__all__ = ["Guards"]

_BATTERY_READINGS = 5
"""A battery is low in the air if that many readings in a row are."""
_FENCE_POSITIONS = 5
"""A vehicle is outside if that many positions in a row, for `_FENCE_S`, are."""
_FENCE_S = 1.0
_FENCE_MARGIN_M = 10.0
"""Overshoot and errors of the position that are nobody's fault."""
_HEARTBEATS_WITHOUT_POSITION = 3
"""That many heartbeats came since the last position: it is not the link."""


class Guards:
    """Everything that is watched of one vehicle.

    Args:
        config: reserve, fence and patience.
    """

    def __init__(self, config: BridgeConfig) -> None:
        self._config = config
        self._battery_told_frac: float | None = None
        self._outside_told = self._alarm_told = False
        self._readings: deque[float] = deque(maxlen=_BATTERY_READINGS)
        self._outside = ""
        self._outside_positions = 0
        self._outside_since_s = 0.0
        self._position_at_s: float | None = None
        self._heartbeats = 0
        self._position_fault: str | None = None

    # What is heard.

    def on_message(self, message: Inbound, now_s: float) -> None:
        """Take a reading of the battery, or a sign of life."""
        match message:
            case SystemStatus(battery_frac=float(frac)) | Battery(battery_frac=float(frac)):
                self._readings.append(frac)
            case Heartbeat():
                self._heartbeats += 1
                if self._position_at_s is None:
                    self._position_at_s = now_s  # from now on one is missing
            case _:
                pass

    def on_position(
        self, place_enu_m: tuple[float, float, float], fault: str | None, now_s: float
    ) -> None:
        """Take a fresh position.

        Args:
            place_enu_m: [m; mission origin].
            fault: why the autopilot itself does not trust it; None if it does.
            now_s: now.
        """
        self._position_fault = fault
        if fault is None:
            self._position_at_s, self._heartbeats = now_s, 0
        self._outside = self._beyond_fence(place_enu_m)
        if not self._outside:
            self._outside_positions = 0
            return
        if not self._outside_positions:
            self._outside_since_s = now_s
        self._outside_positions += 1

    def excuse_silence(self, now_s: float) -> None:
        """Nobody listened for a while."""
        if self._position_at_s is not None:
            self._position_at_s = now_s

    def begin(self) -> None:
        """A new flight: what was advised in an earlier one may be advised again."""
        self._battery_told_frac = None
        self._outside_told = self._alarm_told = False

    # What follows.

    def grounds(self, vehicle: VehicleState, now_s: float) -> str | None:
        """Why a vehicle that stands ready must not be armed or take off; None if it may."""
        if vehicle.heartbeat is not None and was_terminated(vehicle.heartbeat):
            return f"{TERMINATED}: restart the autopilot"
        low = self._low_readings()
        if low:
            return f"{self._battery_text(low[-1])}: charge or change it"
        return self._position_lost_for(now_s)

    def position_lost(self, now_s: float) -> str | None:
        """Why nobody knows where the vehicle is although it speaks; None if it is known."""
        if self._heartbeats < _HEARTBEATS_WITHOUT_POSITION:
            return None
        return self._position_lost_for(now_s)

    def advice(self, vehicle: VehicleState, flavour: Flavour, now_s: float) -> str | None:
        """Why a vehicle in the air should go home; each reason is told once a flight."""
        low = self._low_readings()
        limit_frac = math.inf if self._battery_told_frac is None else self._battery_told_frac / 2.0
        if len(low) == _BATTERY_READINGS and max(low) < limit_frac:
            self._battery_told_frac = low[-1]
            return self._battery_text(low[-1])
        lasting = now_s - self._outside_since_s >= _FENCE_S
        if self._outside_positions >= _FENCE_POSITIONS and lasting and not self._outside_told:
            self._outside_told = True
            return self._outside
        alarmed = vehicle.heartbeat is not None and flavour.alarmed(vehicle.heartbeat)
        if alarmed and not self._alarm_told:
            self._alarm_told = True
            text = vehicle.telling_warning(now_s)
            return f"the autopilot reports a failsafe{f' ({text})' if text else ''}"
        return None

    def _low_readings(self) -> list[float]:
        """Those of the last readings that are below the reserve."""
        reserve_frac = self._config.battery_reserve_frac
        return [] if reserve_frac is None else [r for r in self._readings if r < reserve_frac]

    def _battery_text(self, frac: float) -> str:
        reserve_frac = self._config.battery_reserve_frac or 0.0
        return f"battery at {frac:.0%}, below the reserve of {reserve_frac:.0%}"

    def _beyond_fence(self, place_enu_m: tuple[float, float, float]) -> str:
        east_m, north_m, up_m = place_enu_m
        radius_m, height_m = self._config.fence_radius_m, self._config.fence_height_m
        away_m = math.hypot(east_m, north_m)
        if away_m > radius_m + _FENCE_MARGIN_M:
            return f"{away_m:.0f} m from the origin, outside the fence of {radius_m:g} m"
        if abs(up_m) > height_m + _FENCE_MARGIN_M:
            side = "above" if up_m > 0.0 else "below"
            return f"{abs(up_m):.0f} m {side} the origin, outside the fence of {height_m:g} m"
        return ""

    def _position_lost_for(self, now_s: float) -> str | None:
        timeout_s = self._config.position_timeout_s
        if self._position_at_s is None or now_s - self._position_at_s < timeout_s:
            return None
        why = f" ({self._position_fault})" if self._position_fault else ""
        return f"no valid position for {timeout_s:g} s{why}"
