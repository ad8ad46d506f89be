"""At which base a vehicle is, where bases are near each other."""

from __future__ import annotations

import pytest

from sim.world.base_places import SAME_PLACE_M, base_at
from swarm.model import Base, BaseId

BASES = [
    Base(BaseId("west"), (0.0, 0.0, 5.0), swap_s=30.0),
    Base(BaseId("east"), (0.9, 0.0, 0.0), swap_s=30.0),
]


@pytest.mark.parametrize(
    ("place_enu_m", "base"),
    [
        ((0.0, 0.0, 5.0), "west"),
        ((0.9, 0.0, 5.0), "east"),
        ((0.5, 0.0, 80.0), "east"),
        ((-SAME_PLACE_M, 0.0, 0.0), "west"),
        ((-1.01 * SAME_PLACE_M, 0.0, 0.0), None),
    ],
)
def test_it_is_the_nearest_seen_from_above(
    place_enu_m: tuple[float, float, float], base: str | None
) -> None:
    found = base_at(BASES, place_enu_m)
    assert (None if found is None else found.id) == base


def test_without_bases_it_is_at_none() -> None:
    assert base_at([], (0.0, 0.0, 0.0)) is None
