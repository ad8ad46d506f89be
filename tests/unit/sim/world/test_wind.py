"""Steady wind and gusts."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.world.motion import IdealMotion, SmoothMotion
from sim.world.wind import Gusts, Wind, WindyMotion, gusts_of

ORIGIN = (0.0, 0.0, 0.0)


def windy(east_m_s: float = 0.0, north_m_s: float = 0.0, gusts: Gusts | None = None) -> WindyMotion:
    return WindyMotion(IdealMotion(ORIGIN), Wind((east_m_s, north_m_s), gusts), 10.0, 0.0)


@pytest.mark.parametrize(
    ("wind_m_s", "ground_m_s"),
    [((-6.0, 0.0), 4.0), ((6.0, 0.0), 8.0), ((0.0, 8.0), 6.0), ((-1.0, 0.0), 8.0)],
)
def test_wind_lowers_the_speed_over_ground_where_the_vehicle_cannot_make_up_for_it(
    wind_m_s: tuple[float, float], ground_m_s: float
) -> None:
    motion = windy(*wind_m_s)
    motion.fly_to((80.0, 0.0, 0.0), 8.0, now_s=0.0)

    assert motion.arrives_s == pytest.approx(80.0 / ground_m_s)


def test_ordered_speed_is_flown_in_still_air_whatever_the_airspeed() -> None:
    motion = windy()
    motion.fly_to((80.0, 0.0, 0.0), 20.0, now_s=0.0)

    assert motion.arrives_s == 4.0


@pytest.mark.parametrize(("exact", "against_m_s"), [(False, 8.0), (True, 6.0)])
def test_an_exact_airspeed_is_kept_where_a_greater_speed_is_ordered(
    exact: bool, against_m_s: float
) -> None:
    motion = WindyMotion(IdealMotion((0.0, 0.0, 10.0)), Wind((2.0, 0.0)), 8.0, 0.0, exact=exact)
    motion.fly_to((-100.0, 0.0, 10.0), 10.0, 0.0)
    assert motion.arrives_s == pytest.approx(100.0 / against_m_s)
    motion.stop(0.0)
    motion.fly_to((100.0, 0.0, 10.0), 10.0, 0.0)
    assert motion.arrives_s == pytest.approx(10.0)


def test_wind_that_cannot_be_flown_against_is_refused() -> None:
    with pytest.raises(ValueError, match="airspeed must exceed"):
        windy(6.0, 8.0)


@given(
    wind=st.tuples(st.floats(-6.9, 6.9), st.floats(-6.9, 6.9)),
    way=st.floats(0.0, math.tau),
    speed_m_s=st.floats(0.1, 10.0),
)
def test_speed_through_the_air_keeps_its_limit_and_the_vehicle_gets_on(
    wind: tuple[float, float], way: float, speed_m_s: float
) -> None:
    air = Wind(wind)
    direction = (math.sin(way), math.cos(way), 0.0)
    ground_m_s = air.ground_speed_m_s(direction, speed_m_s, 10.0)

    assert 0.0 < ground_m_s <= speed_m_s
    through_air = [ground_m_s * direction[axis] - wind[axis] for axis in (0, 1)]
    assert math.hypot(*through_air) <= 10.0 + 1e-9


def test_gusts_are_those_of_the_seed() -> None:
    assert gusts_of(5.0, np.random.default_rng(3)) == gusts_of(5.0, np.random.default_rng(3))
    assert gusts_of(5.0, np.random.default_rng(3)) != gusts_of(5.0, np.random.default_rng(4))


@given(seed=st.integers(0, 1000), now_s=st.floats(0.0, 1e4), gust_m_s=st.floats(0.0, 20.0))
def test_gusts_move_a_hovering_vehicle_little_and_smoothly(
    seed: int, now_s: float, gust_m_s: float
) -> None:
    motion = windy(gusts=gusts_of(gust_m_s, np.random.default_rng(seed)))
    motion.fly_to((0.0, 0.0, 10.0), 1e6, now_s=0.0)
    now_s += 1.0

    assert math.hypot(*motion.velocity_enu_m_s(now_s)) <= 0.1 * gust_m_s + 1e-9
    assert math.dist(motion.position_enu_m(now_s), (0.0, 0.0, 10.0)) <= 0.33 * gust_m_s + 1e-9


@given(seed=st.integers(0, 1000), now_s=st.floats(0.1, 30.0))
def test_velocity_is_the_slope_of_the_position(seed: int, now_s: float) -> None:
    gusts = gusts_of(8.0, np.random.default_rng(seed))
    motion = WindyMotion(SmoothMotion(ORIGIN, 2.0), Wind((3.0, -2.0), gusts), 12.0, 0.0)
    motion.fly_to((40.0, 30.0, 20.0), 8.0, now_s=0.0)
    h_s = 1e-4
    ahead, behind = motion.position_enu_m(now_s + h_s), motion.position_enu_m(now_s - h_s)
    slope = [(a - b) / (2 * h_s) for a, b in zip(ahead, behind, strict=True)]

    assert math.dist(slope, motion.velocity_enu_m_s(now_s)) < 1e-2


def test_gusts_do_not_move_a_vehicle_on_the_ground() -> None:
    motion = windy(gusts=gusts_of(9.0, np.random.default_rng(1)))

    assert motion.position_enu_m(5.0) == ORIGIN
    assert motion.velocity_enu_m_s(5.0) == ORIGIN
