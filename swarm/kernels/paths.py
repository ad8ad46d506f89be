"""Whether two paths stay apart in the slabs of air that both touch; see `paths.cpp`."""

from __future__ import annotations

from collections.abc import Collection

from swarm.kernels import _kernels
from swarm.kernels.motions import FloatArray


def paths_apart(
    cuts_m: FloatArray,
    near_m: float,
    asked_m: float,
    one_m: FloatArray,
    other_m: FloatArray,
    within: Collection[int] | None = None,
) -> bool:
    """Whether they are nowhere nearer than asked, seen from above, in any slab that both touch.

    Args:
        cuts_m: (n,) heights between slabs, lowest first; the lowest and the highest have no end.
        near_m: who is no farther from a slab touches it.
        asked_m: least distance.
        one_m: (k, 3) corners; one: it hovers; none: it is nowhere.
        other_m: (l, 3) alike.
        within: slabs that matter; None: all.

    Raises:
        ValueError: other shapes, or not finite.
    """
    slabs = None if within is None else list(within)
    return _kernels.paths_apart(cuts_m, near_m, asked_m, one_m, other_m, slabs)
