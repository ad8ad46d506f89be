"""How one UAV's vehicle is stopped on its way, from where its next way is asked for.

A vehicle may refuse to stop, as one that is in a zone by then or takes no targets at the moment: it
goes on with what it did, and is told again to stop, where it has come to. Leaves out: ways
(agent.core.airway).
"""

from __future__ import annotations

from agent.core.fleet_air import STOP_LEG
from agent.core.interface import GoTo
from swarm.protocol.fields import Point

MOST_DOUBLED = 4
"""It is told again after twice as long each time, so many times."""


class StopOnWay:
    """The stop that is under way, if any.

    Args:
        retry_s: how long after the first refusal it is told again [s].
    """

    def __init__(self, retry_s: float) -> None:
        self._retry_s = retry_s
        self._at_enu_m: Point | None = None
        self._refusals = 0
        """In a row."""
        self.again_s: float | None = None
        """When it is to be told again [s; own clock]."""

    @property
    def under_way(self) -> bool:
        """Whether it has been told to stop, and does not stand yet."""
        return self._at_enu_m is not None

    def begin(self, place_enu_m: Point) -> GoTo:
        """The order to stop where the vehicle was last [m]."""
        self._at_enu_m, self.again_s = place_enu_m, None
        return GoTo(STOP_LEG, place_enu_m)

    def refused(self, now_s: float) -> None:
        """It has refused that, or to fly where it is sent."""
        self._at_enu_m, self.again_s = None, now_s + self._retry_s * 2.0**self._refusals
        self._refusals = min(self._refusals + 1, MOST_DOUBLED)

    def is_due(self, now_s: float) -> bool:
        """Whether it is to be told again now, as it has refused; answered so once."""
        is_due = self.again_s is not None and self.again_s <= now_s
        if is_due:
            self.again_s = None
        return is_due

    def end(self) -> Point | None:
        """No more of it; where it was to stop [m], if it was."""
        place_enu_m, self._at_enu_m, self.again_s = self._at_enu_m, None, None
        self._refusals = 0
        return place_enu_m
