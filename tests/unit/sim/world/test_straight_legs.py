"""Motion in closed form."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.world.motion import IdealMotion, Point

coordinates = st.floats(-1e4, 1e4)
points = st.tuples(coordinates, coordinates, coordinates)
instants = st.floats(0.0, 1e4)


def test_vehicle_stays_at_its_start_without_orders() -> None:
    motion = IdealMotion((1.0, 2.0, 3.0))

    assert motion.position_enu_m(100.0) == motion.target_enu_m == (1.0, 2.0, 3.0)
    assert motion.velocity_enu_m_s(100.0) == (0.0, 0.0, 0.0)
    assert motion.arrives_s is None


def test_leg_is_flown_at_its_speed_in_three_dimensions() -> None:
    motion = IdealMotion((0.0, 0.0, 0.0))
    motion.fly_to((2.0, 3.0, 6.0), 3.5, now_s=10.0)

    assert motion.arrives_s == 12.0
    assert motion.position_enu_m(11.0) == (1.0, 1.5, 3.0)
    assert math.hypot(*motion.velocity_enu_m_s(11.0)) == pytest.approx(3.5)


def test_vehicle_stops_at_the_target_exactly() -> None:
    motion = IdealMotion((0.1, 0.2, 0.3))
    motion.fly_to((0.7, 11.1, 13.3), 3.3, now_s=0.0)
    assert motion.arrives_s is not None

    assert motion.position_enu_m(motion.arrives_s) == (0.7, 11.1, 13.3)
    assert motion.velocity_enu_m_s(motion.arrives_s) == (0.0, 0.0, 0.0)


def test_new_target_is_flown_to_at_once_from_where_the_vehicle_is() -> None:
    motion = IdealMotion((0.0, 0.0, 0.0))
    motion.fly_to((10.0, 0.0, 0.0), 1.0, now_s=0.0)
    motion.fly_to((4.0, 3.0, 0.0), 1.0, now_s=4.0)

    assert motion.position_enu_m(4.0) == (4.0, 0.0, 0.0)
    assert motion.position_enu_m(5.0) == (4.0, 1.0, 0.0)
    assert motion.arrives_s == 7.0


def test_stop_keeps_the_place() -> None:
    motion = IdealMotion((0.0, 0.0, 0.0))
    motion.fly_to((10.0, 0.0, 0.0), 1.0, now_s=0.0)
    motion.stop(now_s=3.0)

    assert motion.position_enu_m(9.0) == motion.target_enu_m == (3.0, 0.0, 0.0)
    assert motion.arrives_s is None


def test_leg_to_the_same_place_takes_no_time() -> None:
    leg = IdealMotion((1.0, 1.0, 1.0))
    leg.fly_to((1.0, 1.0, 1.0), 5.0, now_s=2.0)

    assert leg.arrives_s == 2.0
    assert leg.position_enu_m(2.0) == (1.0, 1.0, 1.0)


@pytest.mark.parametrize("speed_m_s", [0.0, -1.0, math.inf, math.nan])
def test_speed_must_be_positive_and_finite(speed_m_s: float) -> None:
    with pytest.raises(ValueError, match="speed must be positive"):
        IdealMotion((0.0, 0.0, 0.0)).fly_to((1.0, 0.0, 0.0), speed_m_s, now_s=0.0)


@given(start=points, target=points, speed_m_s=st.floats(0.1, 100.0), now_s=instants)
def test_position_lies_on_the_line_as_far_as_was_flown(
    start: Point, target: Point, speed_m_s: float, now_s: float
) -> None:
    leg = IdealMotion(start)
    leg.fly_to(target, speed_m_s, now_s=5.0)
    position = leg.position_enu_m(now_s)
    length_m = math.dist(start, target)

    flown_m = min(length_m, max(0.0, now_s - 5.0) * speed_m_s)
    assert math.dist(start, position) == pytest.approx(flown_m, abs=1e-6, rel=1e-9)
    assert math.dist(start, position) + math.dist(position, target) == pytest.approx(
        length_m, abs=1e-6
    )


@given(instants_s=st.lists(instants, min_size=2, max_size=20))
def test_asking_changes_nothing(instants_s: list[float]) -> None:
    asked, unasked = IdealMotion((0.0, 0.0, 0.0)), IdealMotion((0.0, 0.0, 0.0))
    for motion in (asked, unasked):
        motion.fly_to((3000.0, 4000.0, 0.0), 7.0, now_s=0.0)
    first = [asked.position_enu_m(now_s) for now_s in instants_s]

    assert first == [asked.position_enu_m(now_s) for now_s in instants_s]
    assert asked.position_enu_m(500.0) == unasked.position_enu_m(500.0)
