"""Who flies the vehicle: we, its pilot or a failsafe of its autopilot.

Told from heartbeats, the only thing that every change of command shows in. The words tell
a failsafe from a pilot's switch as well as can be known: autopilots do not say who changed
the mode, but say in words why a failsafe acts. Leaves out: what follows (agent.mavlink.bridge).
"""

from __future__ import annotations

from collections.abc import Callable

from agent.mavlink.flavours import Flavour
from agent.mavlink.messages import Heartbeat
from agent.mavlink.state import VehicleState

__all__ = ["TERMINATED", "Explanation", "intervention", "was_terminated"]

TERMINATED = "the flight was terminated"
_WORDS_LATE_S = 0.5
"""So much later than the mode the words may come that say why a failsafe set it. ArduCopter
tells the mode first, some milliseconds before, on a link that loses nothing."""
_STATE_CRITICAL, _STATE_EMERGENCY, _STATE_TERMINATION = 5, 6, 8


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
    if alarmed or vehicle.failsafe_told(now_s):
        who = "a failsafe"
    elif flavour.is_returning(mode):
        who = "its pilot or a failsafe"
    else:
        who = "its pilot"
    return f"{who} switched it to {flavour.mode_name(mode)}{said}"


class Explanation:
    """Why a vehicle was handed over, told in full once the words for it have come.

    Args:
        told: the reason, as far as it was known at once.
        why: what it is, by all that was said until then and since.
        now_s: when it was handed over.
    """

    def __init__(self, told: str, why: Callable[[float], str | None], now_s: float) -> None:
        self._told = told
        self._why = why
        self._at_s = now_s
        self.due_s = now_s + _WORDS_LATE_S
        """By then all has been said."""

    def better(self) -> str | None:
        """The reason in full; None if it was known at once."""
        reason = self._why(self._at_s)
        return None if reason == self._told else reason
