"""Who flies the vehicle: we, its pilot or a failsafe of its autopilot.

Told from heartbeats, the only thing that every change of command shows in. The words tell
a failsafe from a pilot's switch as well as can be known: autopilots do not say who changed
the mode, but say in words why a failsafe acts. Leaves out: what follows (agent.mavlink.bridge).
"""

from __future__ import annotations

from agent.mavlink.flavours import Flavour
from agent.mavlink.messages import Heartbeat
from agent.mavlink.state import VehicleState

__all__ = ["TERMINATED", "intervention", "was_terminated"]

TERMINATED = "the flight was terminated"
_STATE_CRITICAL, _STATE_EMERGENCY, _STATE_TERMINATION = 5, 6, 8
_FAILSAFE_WORDS = ("failsafe", "breach")


def was_terminated(heartbeat: Heartbeat) -> bool:
    """Whether the autopilot has cut the motors for good, or its kill switch has."""
    return heartbeat.system_status == _STATE_TERMINATION


def intervention(
    vehicle: VehicleState,
    heartbeat: Heartbeat,
    flavour: Flavour,
    now_s: float,
    *,
    expected: bool,
    may_disarm: bool,
) -> str | None:
    """Why the vehicle is no longer ours to command; None while it is.

    Args:
        vehicle: what else it said.
        heartbeat: the newest one.
        flavour: the firmware.
        now_s: now.
        expected: whether the mode is one that our orders lead to.
        may_disarm: whether our orders may lead to stopped motors.
    """
    warning = vehicle.recent_warning(now_s)
    said = f" ({warning})" if warning else ""
    if was_terminated(heartbeat):
        return TERMINATED + said
    if not (heartbeat.armed or may_disarm):
        return f"the vehicle disarmed by itself{said}"
    if expected:
        return None
    mode = heartbeat.custom_mode
    if heartbeat.system_status in (_STATE_CRITICAL, _STATE_EMERGENCY) or any(
        word in warning.lower() for word in _FAILSAFE_WORDS
    ):
        who = "a failsafe"
    elif flavour.is_returning(mode):
        who = "its pilot or a failsafe"
    else:
        who = "its pilot"
    return f"{who} switched it to {flavour.mode_name(mode)}{said}"
