"""What is known of the vehicle, from what it said: state is trusted, not acknowledgements.

Leaves out: what follows from it (agent.mavlink.bridge).
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, auto

from agent.mavlink.messages import (
    Battery,
    EkfStatus,
    ExtendedState,
    Heartbeat,
    Inbound,
    Landed,
    Position,
    SystemStatus,
    Text,
)

__all__ = ["PositionNews", "VehicleState"]

_BOOT_REGRESSION_S = 2.0
"""A boot time that much behind the newest one is a late message or a reboot."""
_REBOOT_MESSAGES = 3
"""That many positions in a row, each later than the one before, prove a reboot."""
_BOOT_WRAP_S = 2**32 / 1e3
_HEARTLESS = 3.0
"""Without a heartbeat for that many silence timeouts it is silent, whatever else it says."""
_EKF_POS_HORIZ_ABS = 16
_WARNING = 4
"""MAV_SEVERITY_WARNING; smaller is worse."""


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
    ekf_flags: int | None = None
    landed: Landed = Landed.UNDEFINED
    battery_frac: float | None = None
    warning: str = ""
    """The autopilot's last warning."""
    warning_at_s: float | None = None
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
                self.battery_frac = message.battery_frac
            case Battery(battery_frac) if battery_frac is not None:
                self.battery_frac = battery_frac
            case EkfStatus(flags):
                self.ekf_flags = flags
            case ExtendedState(landed):
                self.landed = landed
            case Text(severity, text) if severity <= _WARNING and text:
                self.warning = text
                self.warning_at_s = now_s
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

    def recent_warning(self, now_s: float, window_s: float = 5.0) -> str:
        """The last warning if it is younger than ``window_s``, else an empty text."""
        if self.warning_at_s is None or now_s - self.warning_at_s > window_s:
            return ""
        return self.warning
