"""What a UAV wishes to fly, as long as it waits for its way."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from agent.core.interface import GoTo, Prepare, Return
from swarm.protocol.fields import Point
from swarm.separation.shifted import length_m

_LONGER_M = 0.5
"""A way is as it was reckoned, to so much [m]."""
_ELSEWHERE_M = 1.0
"""Who stops no farther from where its way begins is there [m]."""


@dataclass(slots=True)
class Wish:
    """An order that waits for its way."""

    order: GoTo | Return | Prepare
    since_s: float
    corners_enu_m: tuple[Point, ...]
    """In the own layer, from where the UAV is to where the order ends [m]."""
    own_height: bool = False
    """The height of its end is the task's."""
    fixed: bool = False
    """All of it is flown at the heights that it has."""
    out_of_layer: bool = False
    """It begins at the height of a task."""
    takes_s: float | None = None
    """How long its way takes, as reckoned [s]; None: nobody has said."""
    retry_at_s: float = -math.inf
    asked: bool = False
    """Whether the own claim asks for it."""
    yielded: set[tuple[str, int]] = field(default_factory=set)
    """Requests of others to which it has given way."""

    @property
    def task(self) -> str | None:
        """To which task it leads."""
        return self.order.task if isinstance(self.order, GoTo) else None

    @property
    def climbs(self) -> bool:
        """Whether it leads from the layer, or to it."""
        return (self.out_of_layer or self.own_height) and not self.fixed

    @property
    def end_enu_m(self) -> Point | None:
        """Where it ends if that keeps its height [m]."""
        return self.corners_enu_m[-1] if self.own_height else None

    def along(self, path_enu_m: tuple[Point, ...]) -> GoTo | Return | Prepare:
        """The order, to be flown along that path, from where the vehicle is [m]."""
        via, end = path_enu_m[1:-1], path_enu_m[-1]
        if isinstance(self.order, GoTo):
            return replace(self.order, position_enu_m=end, via_enu_m=via)
        if isinstance(self.order, Return):
            return replace(self.order, path_enu_m=via, via_enu_m=end)
        return self.order

    def goes_on(self, now_s: float) -> None:
        """It has come to the end of what it flies first, from where it asks for the rest."""
        if self.takes_s is not None:
            self.takes_s = max(0.0, self.takes_s - (now_s - self.since_s))
        self.since_s = now_s

    def is_from_elsewhere(self, place_enu_m: Point) -> bool:
        """Whether its way begins anywhere but there [m]."""
        return math.dist(self.corners_enu_m[0], place_enu_m) > _ELSEWHERE_M

    def is_shorter_than(self, path_enu_m: Sequence[Point]) -> bool:
        """Whether that path leads a longer way than was reckoned with."""
        return length_m(path_enu_m) > length_m(self.corners_enu_m) + _LONGER_M
