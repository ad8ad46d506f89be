"""Where the vehicle is, as far as what it told before bears it out.

One position may be forged, or a glitch of the receiver, and a target made of it would send
the vehicle there. So a place counts if the vehicle can have come there from the place that
counted last; a place far from it has to be borne out by several in a row. Leaves out: what
a position is used for, and positions that err slowly, which nobody outside can tell.
"""

from __future__ import annotations

import math

__all__ = ["Whereabouts"]

Point = tuple[float, float, float]

_FASTEST_M_S = 40.0
"""No multicopter is carried away faster."""
_ERROR_M = 20.0
"""Receivers err by that much, and messages come late and bunched."""
_LONGEST_GAP_S = 5.0
"""After a longer one a vehicle may not be anywhere: a place has to be borne out anew."""
_WITNESSES = 5
"""Places in a row, each in reach of the one before, that outweigh what counted until then."""


class Whereabouts:
    """The places that one vehicle told."""

    def __init__(self) -> None:
        self._place_m: Point | None = None
        self._at_s = 0.0
        self._rival_m: Point | None = None
        self._rival_at_s = 0.0
        self._rivals = 0

    def on_position(self, place_m: Point, now_s: float) -> None:
        """Take a fresh position [m; mission origin]."""
        if not _in_reach(self._place_m, self._at_s, place_m, now_s):
            in_reach = _in_reach(self._rival_m, self._rival_at_s, place_m, now_s)
            self._rivals = self._rivals + 1 if in_reach else 1
            self._rival_m, self._rival_at_s = place_m, now_s
            if self._rivals < _WITNESSES:
                return
        self._place_m, self._at_s = place_m, now_s
        self._rival_m, self._rivals = None, 0

    def place_m(self, since_s: float) -> Point | None:
        """The newest place that counts; None if none was told since then."""
        return self._place_m if self._at_s >= since_s else None


def _in_reach(before_m: Point | None, before_s: float, place_m: Point, now_s: float) -> bool:
    """Whether a vehicle that was there can be here by now."""
    if before_m is None:
        return False
    gap_s = min(now_s - before_s, _LONGEST_GAP_S)
    return math.dist(before_m, place_m) <= _ERROR_M + _FASTEST_M_S * gap_s
