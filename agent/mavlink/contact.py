"""Whether the configured vehicle is heard, and who else is.

Leaves out: what the vehicle says (agent.mavlink.state).
"""

from __future__ import annotations

from collections.abc import Iterable

from agent.mavlink.flavours import Flavour
from agent.mavlink.messages import Heard, Heartbeat

__all__ = ["Contact"]

_AUTOPILOT_COMPONENT = 1


class Contact:
    """The link as far as it leads to one vehicle.

    Args:
        system_id: the vehicle's; any other is ignored.
    """

    def __init__(self, system_id: int) -> None:
        self._system_id = system_id
        self._wrong_autopilot: int | None = None
        self.link_up = False
        self.foreign: dict[int, int] = {}
        """Messages heard from other systems, by system id."""

    def is_from_vehicle(self, heard: Heard) -> bool:
        """Whether the autopilot of the configured vehicle said it; others are counted."""
        if heard.system_id == self._system_id:
            return heard.component_id == _AUTOPILOT_COMPONENT
        self.foreign[heard.system_id] = self.foreign.get(heard.system_id, 0) + 1
        if isinstance(heard.message, Heartbeat):
            self._wrong_autopilot = heard.system_id
        return False

    def missing(
        self,
        heartbeat: Heartbeat | None,
        flavour: Flavour | None,
        *,
        silent: bool,
        distrusted: Iterable[str] = (),
    ) -> str | None:
        """Why there is no vehicle to command yet, in words; None if there is one.

        Args:
            heartbeat: its last one.
            flavour: what flies it.
            silent: whether the last heartbeat is too old.
            distrusted: why frames were not believed.
        """
        if heartbeat is None or silent:
            if not self.link_up:
                return "no link to the autopilot"
            if self._wrong_autopilot is not None and heartbeat is None:
                return (
                    f"heard the vehicle with system id {self._wrong_autopilot}, "
                    f"not {self._system_id}"
                )
            if heartbeat is None and (reasons := " and ".join(distrusted)):
                return f"heard only frames that are not to be believed: {reasons}"
            return f"waiting for a heartbeat of system id {self._system_id}"
        if flavour is None:
            return (
                f"autopilot {heartbeat.autopilot} on vehicle type {heartbeat.vehicle_type} "
                "(MAV_AUTOPILOT, MAV_TYPE) is not supported"
            )
        return None
