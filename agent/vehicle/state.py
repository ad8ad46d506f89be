"""What is known of the vehicle, from what it said: state is trusted, not acknowledgements.

One position may be forged, or a glitch of the receiver, and a target made of it would send the
vehicle there. So a place counts if the vehicle can have come there from the place that counted
last; a place far from it has to be borne out by several in a row.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field
from enum import Enum, auto

from agent.vehicle.charge import ChargeMeter
from agent.vehicle.messages import (
    AvailableMode,
    BatteryStatus,
    CurrentMode,
    EkfStatus,
    ExtendedState,
    Heartbeat,
    Inbound,
    LandedState,
    Position,
    StatusText,
    SystemStatus,
)
from swarm.protocol.fields import Point

_BOOT_REGRESSION_S = 2.0
"""A boot time that much behind the newest one is a late message or a reboot."""

_REBOOT_MESSAGES = 3
"""That many positions in a row, each later than the one before, prove a reboot."""

_BOOT_WRAP_S = 2**32 / 1e3

_HEARTLESS = 3.0
"""Without a heartbeat for that many silence timeouts it is silent, whatever else it says."""

_EKF_POS_HORIZ_ABS = 16

_WARNING, _NOTICE = 4, 5
"""MAV_SEVERITY; smaller is worse. ArduPilot tells of a breached fence in a notice."""

_WARNINGS = 8

_RECENT_S = 5.0

_MOST_MODES = 64
"""Of which a vehicle may tell names; both firmwares have about thirty."""

_FAILSAFE_WORDS = ("failsafe", "breach")

_TELLING_WORDS = (*_FAILSAFE_WORDS, "fence")

_NO_REASONS = ("auto mission changed",)
"""ArduCopter says CRITICAL that a mission was replaced in flight, which is our doing."""


class PositionNews(Enum):
    """What a position message turned out to be."""

    FRESH = auto()
    STALE = auto()
    """Late or doubled."""
    UNKNOWN = auto()
    """The autopilot has no position."""
    REBOOTED = auto()
    """Boot time went back for good."""


@dataclass(slots=True)
class VehicleState:
    """The newest of everything; None where the vehicle has not said yet."""

    heartbeat: Heartbeat | None = None
    heartbeat_at_s: float | None = None
    """Vehicle time at which the last heartbeat came."""
    heard_at_s: float | None = None
    """Vehicle time at which anything came last."""
    position: Position | None = None
    """The newest known position."""
    prearm_ok: bool | None = None
    prearm_healthy: bool = False
    prearm_heard: bool = False
    """Whether SYS_STATUS has come at all: an autopilot may leave pre-arm checks out."""
    fence_enabled: bool = False
    """Whether it minds a fence of its own."""
    ekf_flags: int | None = None
    landed: LandedState = LandedState.UNDEFINED
    charge: ChargeMeter = field(default_factory=ChargeMeter)
    told_modes: dict[int, str] = field(default_factory=dict)
    """Its own names of its modes, as far as it has any."""
    current_mode: CurrentMode | None = None
    _warnings: deque[tuple[float, str]] = field(default_factory=lambda: deque(maxlen=_WARNINGS))
    """The autopilot's last warnings, and when each came."""
    _newest_boot_s: float | None = None
    _suspect_boot_s: float = 0.0
    _suspect_messages: int = 0

    def excuse_silence(self, now_s: float) -> None:
        """Nobody listened for a while: what it said meanwhile is still unread."""
        if self.heartbeat_at_s is not None:
            self.heartbeat_at_s = self.heard_at_s = now_s

    def silent_at_s(self, timeout_s: float) -> float | None:
        """When it falls silent unless something comes before; None if it never spoke.

        A lost heartbeat is no silence while other messages come, but nobody knows its mode
        then: that is borne for a few timeouts only.
        """
        if self.heartbeat_at_s is None or self.heard_at_s is None:
            return None
        return min(self.heard_at_s + timeout_s, self.heartbeat_at_s + _HEARTLESS * timeout_s)

    def silence(self, now_s: float) -> str:
        """What has not been heard, and for how long, in words."""
        heard_s, heartbeat_s = self.heard_at_s or now_s, self.heartbeat_at_s or now_s
        if now_s - heartbeat_s >= _HEARTLESS * (now_s - heard_s):
            return f"no heartbeat for {now_s - heartbeat_s:.0f} s, though other messages come"
        return f"nothing heard for {now_s - heard_s:.0f} s"

    @property
    def estimate_lost(self) -> bool:
        """Whether its estimator knows no absolute position; False while it says nothing.

        EKF_CONST_POS_MODE tells nothing: PX4 sets it wherever it stands still, and no firmware
        has an absolute position in the mode that it is named after.
        """
        return self.ekf_flags is not None and not self.ekf_flags & _EKF_POS_HORIZ_ABS

    @property
    def armed(self) -> bool:
        """Whether the motors run, as far as heard."""
        return self.heartbeat is not None and self.heartbeat.armed

    def on_message(self, message: Inbound, now_s: float) -> None:
        """Take note of anything but positions."""
        match message:
            case Heartbeat():
                self.heartbeat = message
                self.heartbeat_at_s = now_s
            case SystemStatus():
                self.prearm_ok = message.prearm_ok
                self.prearm_healthy = message.prearm_healthy
                self.prearm_heard = True
                self.charge.on_system(message.battery_frac, now_s, armed=self.armed)
                self.fence_enabled = message.fence_enabled
            case BatteryStatus(battery_frac, number, lifts=True):
                self.charge.on_battery(number, battery_frac, now_s, armed=self.armed)
            case EkfStatus(flags):
                self.ekf_flags = flags
            case ExtendedState(landed) if landed is not LandedState.UNDEFINED:
                self.landed = landed
            case AvailableMode(mode, name) if name and (
                mode in self.told_modes or len(self.told_modes) < _MOST_MODES
            ):
                self.told_modes[mode] = name
            case CurrentMode():
                self.current_mode = message
            case StatusText(severity, text) if _is_reason(severity, text):
                self._warnings.append((now_s, text))
            case _:
                pass

    def on_position(self, position: Position) -> PositionNews:
        """Take note of a position, unless it is older than one heard before."""
        newest_s = self._newest_boot_s
        if newest_s is not None:
            behind_s = newest_s - position.boot_s
            if behind_s > _BOOT_WRAP_S / 2.0:
                behind_s -= _BOOT_WRAP_S  # the millisecond counter began anew after 49.7 days
            if behind_s > _BOOT_REGRESSION_S:
                if not self._suspect_messages or position.boot_s > self._suspect_boot_s:
                    self._suspect_boot_s = position.boot_s
                    self._suspect_messages += 1
                if self._suspect_messages >= _REBOOT_MESSAGES:
                    return PositionNews.REBOOTED
                return PositionNews.STALE
            if behind_s >= 0.0:
                return PositionNews.STALE
        self._suspect_messages = 0
        self._newest_boot_s = position.boot_s
        if not position.known:
            return PositionNews.UNKNOWN
        self.position = position
        return PositionNews.FRESH

    def recent_warning(self, now_s: float, window_s: float = _RECENT_S) -> str:
        """The last warning if it is younger than ``window_s``, else an empty text."""
        return next(iter(self._recent(now_s, window_s)), "")

    def telling_warning(self, now_s: float) -> str:
        """The last recent warning of a failsafe or fence, else the last one; empty without."""
        recent = self._recent(now_s, _RECENT_S)
        telling = (text for text in recent if _has_word(text, _TELLING_WORDS))
        return next(telling, next(iter(recent), ""))

    def failsafe_told(self, now_s: float) -> bool:
        """Whether it has said lately that a failsafe acts."""
        return any(_is_failsafe(text) for text in self._recent(now_s, _RECENT_S))

    def failsafe_chose(self, custom_mode: int) -> bool:
        """Whether by its own word it is in that mode although another one was asked for."""
        told = self.current_mode
        return told is not None and told.custom_mode == custom_mode != told.intended_mode != 0

    def _recent(self, now_s: float, window_s: float) -> list[str]:
        """What it warned of lately, newest first."""
        return [text for at_s, text in reversed(self._warnings) if now_s - at_s <= window_s]


def _is_reason(severity: int, text: str) -> bool:
    """Whether a text may be the reason of something."""
    bad = severity <= _WARNING or (severity <= _NOTICE and _is_failsafe(text))
    return bad and bool(text) and not _has_word(text, _NO_REASONS)


def _is_failsafe(text: str) -> bool:
    """Whether a text says that a failsafe acts, and not that it is over."""
    return _has_word(text, _FAILSAFE_WORDS) and not _has_word(text, ("cleared",))


def _has_word(text: str, words: tuple[str, ...]) -> bool:
    return any(word in text.lower() for word in words)


_FASTEST_M_S = 40.0
"""No multicopter is carried away faster."""

_ERROR_M = 20.0
"""Receivers err by that much, and messages come late and bunched."""

_LONGEST_GAP_S = 5.0
"""After a longer one a vehicle may not be anywhere: a place has to be borne out anew."""

_WITNESSES = 5
"""Places in a row, each in reach of the one before, that outweigh what counted until then."""


class PositionFilter:
    """Tells the places that count among those that one vehicle told."""

    def __init__(self) -> None:
        self._place_m: Point | None = None
        self._at_s = 0.0
        self._rival_m: Point | None = None
        self._rival_at_s = 0.0
        self._rivals = 0

    def on_position(self, place_m: Point, now_s: float) -> None:
        """Take a fresh position [m; mission origin]."""
        if not _in_reach(self._place_m, self._at_s, place_m, now_s):
            in_reach = _in_reach(self._rival_m, self._rival_at_s, place_m, now_s)
            self._rivals = self._rivals + 1 if in_reach else 1
            self._rival_m, self._rival_at_s = place_m, now_s
            if self._rivals < _WITNESSES:
                return
        self._place_m, self._at_s = place_m, now_s
        self._rival_m, self._rivals = None, 0

    def place_m(self, since_s: float) -> Point | None:
        """The newest place that counts; None if none was told since then."""
        return self._place_m if self._at_s >= since_s else None


def _in_reach(before_m: Point | None, before_s: float, place_m: Point, now_s: float) -> bool:
    """Whether a vehicle that was there can be here by now."""
    if before_m is None:
        return False
    gap_s = min(now_s - before_s, _LONGEST_GAP_S)
    return math.dist(before_m, place_m) <= _ERROR_M + _FASTEST_M_S * gap_s
