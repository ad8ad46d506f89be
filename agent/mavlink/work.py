"""What is under way with one vehicle: one thing at a time, each by a machine of its own.

Leaves out: what begins it (agent.mavlink.orders), and how it goes on (agent.mavlink.duty).
"""

from __future__ import annotations

from collections import deque
from enum import Enum

from agent.mavlink.authority import Explanation
from agent.mavlink.holding import Holding
from agent.mavlink.link_loss import LinkLoss
from agent.mavlink.messages import Heartbeat
from agent.mavlink.preparation import Preparation
from agent.mavlink.returning import Returning
from agent.mavlink.search import Search
from agent.mavlink.seat import Seat
from agent.mavlink.target import Target
from agent.vehicle import Caution, HandedOver, NotReady, Prepare

__all__ = ["Phase", "Work"]

Point = tuple[float, float, float]

_PLACES = 2


class Phase(Enum):
    """What is being done."""

    IDLE = "idle"
    PREPARING = "preparing"
    HOVERING = "hovering"
    FLYING = "flying"
    HOLDING = "being stopped"
    RETURNING = "returning"
    HANDED_OVER = "handed over"


class Work:
    """What one vehicle is being made to do.

    Args:
        seat: the vehicle.
    """

    def __init__(self, seat: Seat) -> None:
        self.phase = Phase.IDLE
        self._seat = seat
        self.prepare: Prepare | None = None
        self.prepares_ours = False
        """The vehicle to be prepared flew, or was about to fly, on our orders."""
        self.preparation: Preparation | None = None
        self.target: Target | None = None
        self.holding: Holding | None = None
        self.returning: Returning | None = None
        self.search: Search | None = None
        """For what the vehicle does, which may be in the air; then the order is carried out."""
        self.prepare_next: Prepare | None = None
        """Ordered of a vehicle that has to be stopped first."""
        self.speed_m_s = 0.0
        """Cruise speed of the last preparation [m/s]."""
        self.sent_to_enu_m: deque[Point] = deque(maxlen=_PLACES)
        """Where the vehicle was last told to fly: of the newest it may not have heard."""
        self.explanation: Explanation | None = None
        """Of a hand-over whose reason may not have been said in full."""
        self.loss: LinkLoss | None = None
        """Of a vehicle that was handed over for its silence, as long as it may be ours."""
        self._told_not_ready: str | None = None
        self._told_caution: str | None = None

    def in_our_hands(self) -> bool:
        """Whether the vehicle is, or may be, in the air on our orders."""
        if self.phase is Phase.PREPARING:
            return self.preparation is not None and self.preparation.engaged
        return self.phase in (Phase.HOVERING, Phase.FLYING, Phase.HOLDING, Phase.RETURNING)

    def expects(self, heartbeat: Heartbeat) -> bool:
        """Whether our orders lead to that mode."""
        mode = heartbeat.custom_mode
        if self.holding is not None:
            return not heartbeat.armed or self.holding.expects(mode)
        if self.returning is not None:
            return not heartbeat.armed or self.returning.expects(mode)
        return self.obeys(mode)

    @property
    def may_disarm(self) -> bool:
        """Whether our orders may lead to stopped motors."""
        if self.holding is not None:
            return self.returning is not None or not self.holding.aloft
        return self.phase in (Phase.PREPARING, Phase.RETURNING)

    def obeys(self, custom_mode: int) -> bool:
        """Whether the vehicle takes our orders in that mode, be it still taking off on one."""
        flavour = self._seat.flavour
        return flavour is not None and (
            self._seat.flies_for_us(custom_mode)
            or (flavour.is_taking_off(custom_mode) and self.took_off())
        )

    def took_off(self) -> bool:
        """Whether the preparation under way has asked for takeoff."""
        return self.preparation is not None and self.preparation.took_off

    def drop(self) -> None:
        """Give up whatever is under way; nothing is sent about it any more."""
        self.target = self.search = self.loss = self.explanation = None
        self.prepare = self.preparation = self.prepare_next = None
        self.returning = self.holding = None
        self._seat.commands.cancel_all()

    def forget_preparation(self) -> None:
        """It is another kind of vehicle: what was begun in the terms of the last one ends."""
        self.preparation = None
        self._seat.commands.cancel_all()

    def lose(self) -> None:
        """Command nothing any more to a vehicle that is not heard, and look for it."""
        loss = LinkLoss(self._seat, tuple(self.sent_to_enu_m))
        self.hand_over(self._seat.vehicle.silence(self._seat.now_s), silent=True)
        self.loss = loss

    def take_back(self) -> None:
        """The vehicle obeys as it did before it was lost."""
        self.loss = None
        self.phase = Phase.HOVERING

    def hand_over(self, reason: str, *, silent: bool = False) -> None:
        """Command nothing any more."""
        self.drop()
        if self._seat.mission is not None:
            self._seat.mission.abort(reason)
        self.phase = Phase.HANDED_OVER
        self._seat.report(HandedOver(reason, silent))

    def tell_not_ready(self, reason: str) -> None:
        """What the vehicle is waited for, once."""
        if reason != self._told_not_ready:
            self._told_not_ready = reason
            self._seat.report(NotReady(reason))

    def tell_caution(self, reason: str) -> None:
        """What people should know of the vehicle, once."""
        if reason != self._told_caution:
            self._told_caution = reason
            self._seat.report(Caution(reason))

    def tell_anew(self) -> None:
        """Another wait begins."""
        self._told_not_ready = self._told_caution = None
