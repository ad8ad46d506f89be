"""The earliest of several deadlines, some of which may not be set.

Leaves out: who wakes up then (the shells).
"""

from __future__ import annotations

__all__ = ["earliest"]


def earliest(*times_s: float | None) -> float | None:
    """The first of ``times_s``; None if there is none."""
    first_s: float | None = None
    for time_s in times_s:
        if time_s is not None and (first_s is None or time_s < first_s):
            first_s = time_s
    return first_s
