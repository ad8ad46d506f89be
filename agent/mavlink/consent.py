"""Whether a vehicle that is found armed may be commanded, or is somebody else's.

A vehicle that was armed on the ground and not by us has a person beside it. In the air the
mode that takes our targets is consent only if somebody chose it: where it is also what the
firmware falls back into, as PX4's Hold, it must be seen to be entered. Leaves out: vehicles
of an earlier life, which are ours (agent.mavlink.preparation), and what is ours already
(agent.mavlink.authority).
"""

from __future__ import annotations

from agent.mavlink.flavours import Flavour
from agent.mavlink.messages import Heartbeat

__all__ = ["Consent"]


class Consent:
    """What a pilot lets us do.

    Args:
        flavour: the firmware.
        ours: the vehicle flies, or may fly, on our orders already.
    """

    def __init__(self, flavour: Flavour, *, ours: bool) -> None:
        self._flavour = flavour
        self._ours = ours
        self._given = False
        self._mode_before: int | None = None
        """In which it was armed when last seen; None if it was not armed."""

    @property
    def needed(self) -> bool:
        """Whether the vehicle, if it is armed, is somebody else's."""
        return not self._ours

    def arm(self) -> None:
        """We are about to start its motors."""
        self._ours = True

    def on_heartbeat(self, heartbeat: Heartbeat) -> None:
        """See whether somebody gives the vehicle to us."""
        flavour, mode, before = self._flavour, heartbeat.custom_mode, self._mode_before
        self._mode_before = mode if heartbeat.armed else None
        if not (heartbeat.armed and flavour.is_commanded(mode)):
            self._given = False
        elif flavour.commanded_by_choice:
            self._given = True
        elif before is not None and before != mode:
            # Takeoffs and missions end in that mode by themselves, and so do failsafes.
            by_itself = flavour.is_taking_off(before) or flavour.is_mission(before)
            self._given = not by_itself and not flavour.alarmed(heartbeat)

    def objection(self, *, airborne: bool) -> str | None:
        """Why the armed vehicle is to be left alone, in words; None if it may be commanded."""
        if self._ours or (airborne and self._given):
            return None
        if not airborne:
            return "armed by somebody else: disarm it"
        mode = self._flavour.commanded_mode_name
        return f"flown by its pilot: land it, or switch it to {mode} from another mode"
