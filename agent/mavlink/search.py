"""What a vehicle does of which nothing is known yet: asked before an order is carried out.

An earlier life of ours may have left it in the air, or its pilot may fly it. Leaves out:
what is done about it (agent.mavlink.duty).
"""

from __future__ import annotations

from agent.mavlink.messages import Landed
from agent.mavlink.seat import Seat
from agent.vehicle import Hold, Return

__all__ = ["Search"]

_UNHEARD_TIMEOUTS = 3.0
"""A vehicle that may be in the air has that many silence timeouts to be heard at all."""


class Search:
    """Finds out what there is to know before an order can be carried out.

    Args:
        order: to be carried out then.
        seat: the vehicle.
    """

    def __init__(self, order: Return | Hold, seat: Seat) -> None:
        self.order = order
        self._seat = seat
        self._until_s = seat.now_s + _UNHEARD_TIMEOUTS * seat.config.silence_timeout_s

    @property
    def in_vain(self) -> bool:
        """Whether the vehicle has had its time."""
        return self._seat.now_s >= self._until_s

    def advance(self) -> str | None:
        """What is still to be learned, in words; None if it is enough."""
        return self._seat.missing() or self._unclear()

    def _unclear(self) -> str | None:
        seat = self._seat
        if not seat.vehicle.armed:
            return None
        if isinstance(self.order, Hold) and seat.vehicle.landed is Landed.UNDEFINED:
            return "waiting to hear whether it flies (EXTENDED_SYS_STATE)"
        if seat.mission is not None and seat.flies_unknown_mission():
            seat.say(*seat.mission.look(seat.now_s))
            return "reading the mission that the vehicle flies"
        return None
