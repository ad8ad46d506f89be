"""Watch over one vehicle: who flies it, whether it may be flown, what is wrong with it.

Who flies it is told from heartbeats, the only thing that every change of command shows in. A
vehicle that is found armed may be commanded only with its pilot's consent. Battery, fence,
position and the autopilot's alarms: each judgement is debounced, because readings err, and
comes with a reason that a person understands; each is told once a flight, the battery again
whenever its charge has halved, since the return may have been broken off.
"""

from __future__ import annotations

import math
from collections import deque

from agent.vehicle.config import BridgeConfig
from agent.vehicle.firmware.profile import Firmware
from agent.vehicle.messages import Heartbeat, Inbound
from agent.vehicle.state import VehicleState

TERMINATED = "the flight was terminated"

_STATE_CRITICAL, _STATE_EMERGENCY, _STATE_TERMINATION = 5, 6, 8


def was_terminated(heartbeat: Heartbeat) -> bool:
    """Whether the autopilot has cut the motors for good, or its kill switch has."""
    return heartbeat.system_status == _STATE_TERMINATION


def intervention(
    vehicle: VehicleState,
    heartbeat: Heartbeat,
    firmware: Firmware,
    now_s: float,
    *,
    expected: bool,
    may_disarm: bool,
) -> str | None:
    """Why the vehicle is no longer ours to command; None while it is.

    Our orders lead to an ``expected`` mode, and perhaps to stopped motors (``may_disarm``).
    """
    warning = vehicle.telling_warning(now_s)
    said = f" ({warning})" if warning else ""
    if was_terminated(heartbeat):
        return TERMINATED + said
    if not (heartbeat.armed or may_disarm):
        return f"the vehicle disarmed by itself{said}"
    if expected:
        return None
    mode = heartbeat.custom_mode
    alarmed = heartbeat.system_status in (_STATE_CRITICAL, _STATE_EMERGENCY)
    if alarmed or vehicle.failsafe_told(now_s) or vehicle.failsafe_chose(mode):
        who = "a failsafe"
    elif firmware.is_returning(mode):
        who = "its pilot or a failsafe"
    else:
        who = "its pilot"
    return f"{who} switched it to {firmware.mode_name(mode, vehicle.told_modes)}{said}"


class PilotConsent:
    """What a pilot lets us do.

    Args:
        ours: the vehicle flies, or may fly, on our orders already.
        begun: an earlier life has started its motors; no more once they stand, or it is flown
            in a mode that is none of ours.
    """

    def __init__(self, firmware: Firmware, *, ours: bool, begun: bool = False) -> None:
        self._firmware = firmware
        self._ours, self._begun = ours, begun
        self._given = False
        self._mode_before: int | None = None
        """In which it was armed when last seen; None if it was not armed."""

    @property
    def needed(self) -> bool:
        """Whether the vehicle, if it is armed, is somebody else's."""
        return not (self._ours or self._begun)

    def covers(self, heartbeat: Heartbeat) -> bool:
        """Whether its motors run for us."""
        return heartbeat.armed and not self.needed

    def arm(self) -> None:
        """We are about to start its motors."""
        self._ours = True

    def on_heartbeat(self, heartbeat: Heartbeat) -> None:
        """See whether somebody gives the vehicle to us."""
        firmware, mode, before = self._firmware, heartbeat.custom_mode, self._mode_before
        self._mode_before = mode if heartbeat.armed else None
        self._begun &= heartbeat.armed and (
            firmware.is_commanded(mode) or _by_itself(firmware, mode)
        )
        if not (heartbeat.armed and firmware.is_commanded(mode)):
            self._given = False
        elif firmware.commanded_by_choice:
            self._given = True
        elif before is not None and before != mode:
            # Takeoffs and missions end in that mode by themselves, and so do failsafes.
            by_itself = _by_itself(firmware, before)
            self._given = not by_itself and not firmware.alarmed(heartbeat)

    def objection(self, *, airborne: bool) -> str | None:
        """Why the armed vehicle is to be left alone, in words; None if it may be commanded."""
        # Whoever armed one that drives may stand beside it.
        stands = self._firmware.traits.drives or not airborne
        if not self.needed or (self._given and not stands):
            return None
        if stands:
            return "armed by somebody else: disarm it"
        mode = self._firmware.commanded_mode_name
        return f"flown by its pilot: land it, or switch it to {mode} from another mode"


def _by_itself(firmware: Firmware, mode: int) -> bool:
    """Whether that mode ends in the one that takes our targets without anybody's doing."""
    return firmware.is_taking_off(mode) or firmware.is_mission(mode)


_BATTERY_READINGS = 5
"""A battery is low in the air if that many readings in a row are."""

_FENCE_POSITIONS = 5
"""A vehicle is outside if that many positions in a row, for `_FENCE_S`, are."""

_FENCE_S = 1.0

_FENCE_MARGIN_M = 10.0
"""Overshoot and errors of the position that are nobody's fault."""

_HEARTBEATS_WITHOUT_POSITION = 3
"""That many heartbeats came since the last position: it is not the link."""


class SafetyMonitor:
    """Monitors one vehicle in flight and before it."""

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
        """Take a sign of life."""
        if isinstance(message, Heartbeat):
            self._heartbeats += 1
            if self._position_at_s is None:
                self._position_at_s = now_s  # from now on one is missing

    def on_charge(self, frac: float) -> None:
        """Take a reading of the battery."""
        self._readings.append(frac)

    def on_position(
        self, place_enu_m: tuple[float, float, float], fault: str | None, now_s: float
    ) -> None:
        """Take a fresh position; ``fault`` is why the autopilot itself does not trust it."""
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

    def arming_objection(self, vehicle: VehicleState, now_s: float) -> str | None:
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

    def advice(self, vehicle: VehicleState, firmware: Firmware, now_s: float) -> str | None:
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
        alarmed = vehicle.heartbeat is not None and firmware.alarmed(vehicle.heartbeat)
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


_STEADY_S = 3.0
"""A speed kept for that long is the one that is flown."""

_STEADY_FRAC = 0.03
"""How much a steady speed may change meanwhile."""

_SHORT_FRAC = 0.9
"""Of the speed told, below which it is not reached."""

_LEAST_FRAC = 0.3
"""Of the speed told, below which the vehicle is doing something else than cruising."""

_STEEPEST = 0.3
"""Climb per way flown, beyond which the climb sets the speed."""


class CruiseWatch:
    """Compares steady ground speeds with the one told; they fall short until they do not."""

    def __init__(self) -> None:
        self.remark: str | None = None
        """That they fall short, for people; None as long as they are not known to."""
        self._since_s = math.inf
        self._first_m_s = 0.0
        self._told = False

    def judge(
        self, velocity_enu_m_s: tuple[float, float, float], told_m_s: float, now_s: float
    ) -> None:
        """Take a velocity on the way to a target; where it is reached now and then, remark once."""
        east_m_s, north_m_s, up_m_s = velocity_enu_m_s
        speed_m_s = math.hypot(east_m_s, north_m_s)
        cruising = speed_m_s >= _LEAST_FRAC * told_m_s and abs(up_m_s) <= _STEEPEST * speed_m_s
        steady = abs(speed_m_s - self._first_m_s) <= _STEADY_FRAC * self._first_m_s
        short = speed_m_s < _SHORT_FRAC * told_m_s
        otherwise = short and not self._told if self.remark is None else not short
        if not (cruising and steady and otherwise):
            self._since_s, self._first_m_s = now_s, speed_m_s
        elif now_s - self._since_s >= _STEADY_S:
            self._told = True
            shown = f"{speed_m_s:.1f} m/s, asked for {told_m_s:g}"
            self.remark = f"it flies at {shown}: its own limits forbid more" if short else None
