"""The trigger of a camera: how often it was told what, and at what distance it takes pictures.

Pictures themselves are left out.
"""

from __future__ import annotations

import math


class CameraTrigger:
    """A trigger by distance flown, as DO_SET_CAM_TRIGG_DIST sets it."""

    def __init__(self) -> None:
        self.distance_m = 0.0
        """A picture every so many metres; 0: none."""
        self.orders: list[float] = []
        """The distances that were set [m], oldest first."""

    def obey(self, distance_m: float) -> bool:
        """Take a picture every so many metres from now on; False if that is no distance."""
        if not 0.0 <= distance_m < math.inf:
            return False
        self.distance_m = distance_m
        self.orders.append(distance_m)
        return True
