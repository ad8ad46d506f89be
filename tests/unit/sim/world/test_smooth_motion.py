"""Motion with limited acceleration."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.world.motion import IdealMotion, Point, SmoothMotion

coordinates = st.floats(-500.0, 500.0)
points = st.tuples(coordinates, coordinates, coordinates)
speeds = st.floats(0.5, 30.0)
accelerations = st.floats(0.2, 20.0)
orders = st.lists(
    st.tuples(st.floats(0.01, 40.0), st.one_of(st.none(), points), speeds), min_size=1, max_size=6
)
"""Pause before it [s], target or None to stop, speed [m/s]."""

ORIGIN = (0.0, 0.0, 0.0)
STEP_S = 0.01


def flown(
    acceleration_m_s2: float, given_orders: list[tuple[float, Point | None, float]]
) -> tuple[SmoothMotion, float]:
    """A vehicle that was given some orders, and when it got the last of them."""
    motion, now_s = SmoothMotion(ORIGIN, acceleration_m_s2), 0.0
    for pause_s, target, speed_m_s in given_orders:
        now_s += pause_s
        if target is None:
            motion.stop(now_s)
        else:
            motion.fly_to(target, speed_m_s, now_s)
    return motion, now_s


def test_leg_from_rest_is_a_trapezoid() -> None:
    motion = SmoothMotion(ORIGIN, 2.0)
    motion.fly_to((0.0, 100.0, 0.0), 10.0, now_s=1.0)

    assert motion.arrives_s == 1.0 + 5.0 + 5.0 + 5.0
    assert motion.position_enu_m(6.0) == (0.0, 25.0, 0.0)
    assert motion.velocity_enu_m_s(3.5) == (0.0, 5.0, 0.0)
    assert motion.velocity_enu_m_s(8.0) == (0.0, 10.0, 0.0)
    assert motion.position_enu_m(16.0) == (0.0, 100.0, 0.0)
    assert motion.velocity_enu_m_s(16.0) == ORIGIN


def test_short_leg_never_comes_to_its_speed() -> None:
    motion = SmoothMotion(ORIGIN, 2.0)
    motion.fly_to((8.0, 0.0, 0.0), 10.0, now_s=0.0)

    assert motion.arrives_s == pytest.approx(4.0)
    assert motion.velocity_enu_m_s(2.0)[0] == pytest.approx(4.0)


def test_stop_takes_its_braking_distance() -> None:
    motion = SmoothMotion(ORIGIN, 2.0)
    motion.fly_to((100.0, 0.0, 0.0), 10.0, now_s=0.0)
    motion.stop(now_s=7.5)

    assert motion.arrives_s is None
    assert motion.target_enu_m == (75.0, 0.0, 0.0)
    assert motion.velocity_enu_m_s(10.0) == (5.0, 0.0, 0.0)
    assert motion.position_enu_m(12.5) == motion.position_enu_m(99.0) == (75.0, 0.0, 0.0)


@pytest.mark.parametrize("again_s", [2.0, 7.0, 12.0, 16.0])
def test_same_order_again_changes_nothing(again_s: float) -> None:
    once, twice = SmoothMotion(ORIGIN, 2.0), SmoothMotion(ORIGIN, 2.0)
    for motion in (once, twice):
        motion.fly_to((30.0, 40.0, 120.0), 10.0, now_s=0.0)
    twice.fly_to((30.0, 40.0, 120.0), 10.0, now_s=again_s)

    assert twice.arrives_s == pytest.approx(once.arrives_s)
    for now_s in (16.0, 17.0, 18.0, 20.0):
        assert twice.position_enu_m(now_s) == pytest.approx(once.position_enu_m(now_s), abs=1e-9)


def test_speed_ordered_on_the_way_is_taken_up_at_the_limit() -> None:
    motion = SmoothMotion(ORIGIN, 2.0)
    motion.fly_to((1000.0, 0.0, 0.0), 10.0, now_s=0.0)
    motion.fly_to((1000.0, 0.0, 0.0), 4.0, now_s=10.0)

    assert motion.velocity_enu_m_s(12.0)[0] == pytest.approx(6.0)
    assert motion.velocity_enu_m_s(14.0)[0] == pytest.approx(4.0)


@pytest.mark.parametrize("acceleration_m_s2", [0.0, -1.0, math.inf, math.nan])
def test_acceleration_must_be_positive_and_finite(acceleration_m_s2: float) -> None:
    with pytest.raises(ValueError, match="acceleration must be positive"):
        SmoothMotion(ORIGIN, acceleration_m_s2)


@pytest.mark.parametrize("speed_m_s", [0.0, -1.0, math.inf, math.nan])
def test_speed_must_be_positive_and_finite(speed_m_s: float) -> None:
    with pytest.raises(ValueError, match="speed must be positive"):
        SmoothMotion(ORIGIN, 1.0).fly_to((1.0, 0.0, 0.0), speed_m_s, now_s=0.0)


@given(acceleration_m_s2=accelerations, given_orders=orders)
def test_vehicle_arrives_at_rest_at_its_last_target(
    acceleration_m_s2: float, given_orders: list[tuple[float, Point | None, float]]
) -> None:
    motion, last_s = flown(acceleration_m_s2, given_orders)
    _, target, _ = given_orders[-1]
    if target is None:
        assert motion.arrives_s is None
        return
    assert motion.arrives_s is not None
    assert motion.arrives_s >= last_s
    assert motion.position_enu_m(motion.arrives_s) == motion.target_enu_m == target
    assert motion.velocity_enu_m_s(motion.arrives_s) == ORIGIN
    before_s = motion.arrives_s - 1e-6
    assert math.dist(motion.position_enu_m(before_s), target) < 1e-3
    assert math.hypot(*motion.velocity_enu_m_s(before_s)) < 1e-3


@given(acceleration_m_s2=accelerations, given_orders=orders)
def test_limits_hold_and_nothing_jumps(
    acceleration_m_s2: float, given_orders: list[tuple[float, Point | None, float]]
) -> None:
    motion, now_s = SmoothMotion(ORIGIN, acceleration_m_s2), 0.0
    limit_m_s = 0.0
    for pause_s, target, speed_m_s in [*given_orders, (30.0, None, 1.0)]:
        until_s, sampled_s = now_s + pause_s, now_s
        while sampled_s < until_s:
            later_s = min(sampled_s + max(STEP_S, pause_s / 50.0), until_s)
            place, velocity = motion.position_enu_m(sampled_s), motion.velocity_enu_m_s(sampled_s)
            later_velocity = motion.velocity_enu_m_s(later_s)
            passed_s = later_s - sampled_s
            assert math.hypot(*velocity) <= limit_m_s + 1e-6
            assert math.dist(velocity, later_velocity) <= acceleration_m_s2 * passed_s + 1e-6
            moved_m = math.dist(place, motion.position_enu_m(later_s))
            assert moved_m <= limit_m_s * passed_s + 1e-6
            sampled_s = later_s
        now_s = until_s
        before = motion.position_enu_m(now_s), motion.velocity_enu_m_s(now_s)
        had_m_s = math.hypot(*before[1])
        if target is None:
            motion.stop(now_s)
            limit_m_s = had_m_s
        else:
            motion.fly_to(target, speed_m_s, now_s)
            limit_m_s = max(had_m_s, speed_m_s)
        assert math.dist(before[0], motion.position_enu_m(now_s)) < 1e-6
        assert math.dist(before[1], motion.velocity_enu_m_s(now_s)) < 1e-4


@given(acceleration_m_s2=accelerations, target=points, turn=points, now_s=st.floats(0.1, 60.0))
def test_velocity_is_the_slope_of_the_position(
    acceleration_m_s2: float, target: Point, turn: Point, now_s: float
) -> None:
    motion = SmoothMotion(ORIGIN, acceleration_m_s2)
    motion.fly_to(target, 10.0, 0.0)
    motion.fly_to(turn, 7.0, 3.0)
    h_s = 1e-4
    ahead, behind = motion.position_enu_m(now_s + h_s), motion.position_enu_m(now_s - h_s)
    slope = [(a - b) / (2 * h_s) for a, b in zip(ahead, behind, strict=True)]
    if now_s - h_s > 3.0:
        assert math.dist(slope, motion.velocity_enu_m_s(now_s)) < 20.0 * 2.0 * h_s + 1e-6


@given(given_orders=orders, now_s=st.floats(0.0, 300.0))
def test_great_acceleration_makes_it_ideal(
    given_orders: list[tuple[float, Point | None, float]], now_s: float
) -> None:
    smooth, ideal = SmoothMotion(ORIGIN, 1e9), IdealMotion(ORIGIN)
    at_s = 0.0
    for pause_s, target, speed_m_s in given_orders:
        at_s += pause_s
        for motion in (smooth, ideal):
            if target is None:
                motion.stop(at_s)
            else:
                motion.fly_to(target, speed_m_s, at_s)

    asked_s = at_s + now_s
    assert math.dist(smooth.position_enu_m(asked_s), ideal.position_enu_m(asked_s)) < 1e-3
    if ideal.arrives_s is None:
        assert smooth.arrives_s is None
    else:
        assert smooth.arrives_s == pytest.approx(ideal.arrives_s, abs=1e-3)


@given(instants_s=st.lists(st.floats(0.0, 100.0), min_size=2, max_size=20))
def test_asking_changes_nothing(instants_s: list[float]) -> None:
    asked, unasked = SmoothMotion(ORIGIN, 1.5), SmoothMotion(ORIGIN, 1.5)
    for motion in (asked, unasked):
        motion.fly_to((300.0, 400.0, 0.0), 7.0, now_s=0.0)
    first = [asked.position_enu_m(now_s) for now_s in instants_s]

    assert first == [asked.position_enu_m(now_s) for now_s in instants_s]
    assert asked.position_enu_m(50.0) == unasked.position_enu_m(50.0)


def test_what_is_left_of_a_speed_does_not_keep_it_from_speeding_up() -> None:
    rested, all_but_rested = SmoothMotion(ORIGIN, 2.5), SmoothMotion(ORIGIN, 2.5)
    all_but_rested.fly_to((0.0, 100.0, 0.0), 10.0, now_s=0.0)
    all_but_rested.stop(0.1)  # at 0.25 m/s northwards
    rested.fly_to((100.0, 0.0, 0.0), 10.0, now_s=0.1)
    all_but_rested.fly_to((100.0, 0.0, 0.0), 10.0, now_s=0.1)

    assert rested.arrives_s == pytest.approx(0.1 + 14.0)
    assert all_but_rested.arrives_s == pytest.approx(0.1 + 14.0, abs=0.1)
