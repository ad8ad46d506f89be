"""No way is commanded that leads into the ground, or nearer to it than the clearance."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from agent.vehicle.zone_guard import ZoneGuard
from swarm.allocation.legs.ground import ground_of
from tests.support.hills import above_m, hills


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=60, deadline=None)
def test_a_way_is_refused_exactly_where_it_comes_too_near(seed: int) -> None:
    rng = np.random.default_rng(seed)
    terrain = hills(seed % 50, clearance_m=15.0)
    ground = ground_of(terrain)
    flat_m = rng.uniform(-200.0, 200.0, (3, 2))
    way_m = np.column_stack([flat_m, ground.up_m(flat_m) + rng.uniform(16.0, 60.0, 3)])
    way = [tuple(place) for place in way_m.tolist()]

    objection = ZoneGuard((), 0.0, terrain).objection(way)

    least_m = above_m(terrain, way_m, 400).min()
    if least_m >= 15.0 + 0.1:
        assert objection is None
    elif least_m < 15.0 - 0.1:
        assert objection == "the ground lies in the way, or is nearer than clearance_m"
    assert ZoneGuard((), 0.0, terrain)


def test_who_is_too_near_already_may_fly_up_and_away_but_not_down() -> None:
    terrain = hills(3, clearance_m=15.0)
    up_m = ground_of(terrain).one_up_m(0.0, 0.0)
    guard = ZoneGuard((), 0.0, terrain)
    here = (0.0, 0.0, up_m + 3.0)
    assert guard.objection([here, (0.0, 0.0, up_m + 30.0)]) is None
    assert guard.objection([here, (0.0, 0.0, up_m + 10.0)]) is not None
