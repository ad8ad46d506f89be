"""Corners: waypoints that are passed, and targets that change in flight, as recorded ones fly."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from sim.autopilot.firmware.px4 import Px4Model
from sim.autopilot.turning_motion import TurningMotion
from sim.world.motion import Point, SmoothMotion
from tests.support.ground_station import ACCEPTED, AUTO, GroundStation, ground_station, only

CORNERS = [(40.0, 0.0), (40.0, 40.0), (80.0, 40.0)]
TURNS: dict[str, Any] = {"acceleration_m_s2": 2.5, "rounds_corners": True}
Step = tuple[tuple[float, float, float], float, float]
PLACES = st.tuples(*[st.floats(-200.0, 200.0)] * 3)
STEPS = st.lists(st.tuples(PLACES, st.floats(0.5, 20.0), st.floats(0.01, 30.0)), max_size=6)


def flown(ground: GroundStation, duration_s: float) -> list[tuple[Point, float]]:
    """Place and speed ten times a second."""
    found = []
    for _ in range(round(duration_s * 10.0)):
        ground.wait(0.1)
        velocity = ground.vehicle.pilot.flight.motion.velocity_enu_m_s(ground.now_s)
        found.append((ground.position_enu_m, math.hypot(*velocity)))
    return found


def closest(track: list[tuple[Point, float]], corner_m: tuple[float, float]) -> tuple[float, float]:
    """Distance from a corner, and speed there."""
    return min((math.dist(place[:2], corner_m), speed_m_s) for place, speed_m_s in track)


def round_the_corners(ground: GroundStation, pause_s: float = 0.0) -> None:
    ground.take_off(10.0)
    params = pause_s, 0.0, 0.0, 0.0
    items = [ground.item(seq, *place, 10.0, params=params) for seq, place in enumerate(CORNERS, 1)]
    assert ground.upload(ground.item(0), *items) == ACCEPTED
    ground.set_mode(AUTO)


def test_a_mission_passes_its_corners_within_the_radius_without_a_stop() -> None:
    ground = ground_station(**TURNS)
    round_the_corners(ground)
    track = flown(ground, 45.0)

    for corner_m in CORNERS[:2]:
        distance_m, speed_m_s = closest(track, corner_m)
        assert 0.3 < distance_m < 2.0  # 1.5 m recorded, and 2.9 m/s
        assert speed_m_s == pytest.approx(2.9, abs=0.8)
    assert closest(track, CORNERS[2])[0] == pytest.approx(0.0, abs=0.02)
    assert [each.seq for each in only(ground.heard, "MISSION_ITEM_REACHED")] == [1, 2, 3]


def test_a_waypoint_with_a_pause_is_flown_to_exactly() -> None:
    ground = ground_station(**TURNS)
    round_the_corners(ground, pause_s=2.0)
    track = flown(ground, 50.0)

    assert closest(track, CORNERS[0])[0] == pytest.approx(0.0, abs=0.02)


def test_px4_heeds_the_radius_of_a_waypoint() -> None:
    ground = ground_station(Px4Model(), **TURNS)
    ground.wait(5.0)
    ground.set_mode(4, 3)
    ground.arm()
    ground.command(22, 0, 0, 0, 0, 0, 0, 498.0)
    ground.wait(12.0)
    params = 0.0, 6.0, 0.0, 0.0
    items = [ground.item(seq, *place, 10.0, params=params) for seq, place in enumerate(CORNERS)]
    assert ground.upload(*items) == ACCEPTED
    ground.wait(3.0)
    ground.set_mode(4, 4)
    track = flown(ground, 40.0)

    assert 2.0 < closest(track, CORNERS[0])[0] < 6.0


def test_a_target_that_changes_before_a_corner_is_turned_to_as_recorded() -> None:
    """An ArduCopter at 6.3 m/s, told 8 m before the corner, came no farther than 1.2 m beyond."""
    ground = ground_station(cruise_m_s=6.3, **TURNS)
    ground.take_off(10.0)
    ground.reposition(40.0, 0.0, 10.0)
    while math.dist(ground.position_enu_m[:2], (40.0, 0.0)) > 8.0:
        ground.wait(0.05)
    ground.reposition(40.0, 40.0, 10.0)
    track = flown(ground, 15.0)

    assert max(place[0] for place, _ in track) < 42.0
    assert closest(track, (40.0, 0.0))[0] < 3.0
    assert track[-1][0] == pytest.approx((40.0, 40.0, 10.0), abs=0.02)


@given(steps=STEPS)
@example(steps=[((0.0, 0.0, 0.0), 2.0, 6.0), ((0.0, 0.0, 1e-309), 1.0, 1.0)])
def test_turning_motion_is_continuous_ends_at_its_target_and_keeps_its_limits(
    steps: list[Step],
) -> None:
    motion, now_s, fastest_m_s = TurningMotion((0.0, 0.0, 10.0), 2.5), 0.0, 0.0
    for target, speed_m_s, wait_s in steps:
        place, velocity = motion.position_enu_m(now_s), motion.velocity_enu_m_s(now_s)
        motion.fly_to(target, speed_m_s, now_s)
        fastest_m_s = max(fastest_m_s, speed_m_s)
        assert math.dist(motion.position_enu_m(now_s), place) < 1e-6
        assert math.dist(motion.velocity_enu_m_s(now_s), velocity) < 1e-6
        assert motion.arrives_s is not None
        assert math.dist(motion.position_enu_m(motion.arrives_s - 1e-6), target) < 1e-3
        for number in range(11):
            at_s = now_s + wait_s * number / 10.0
            change = math.dist(motion.velocity_enu_m_s(at_s + 1e-3), motion.velocity_enu_m_s(at_s))
            assert change <= 2.5 * math.sqrt(2.0) * 1e-3 + 1e-9
            assert math.hypot(*motion.velocity_enu_m_s(at_s)) <= fastest_m_s * 1.5 + 1e-6
        now_s += wait_s
    motion.stop(now_s)
    assert motion.arrives_s is None
    assert motion.position_enu_m(now_s + 1e3) == motion.target_enu_m


def test_from_rest_it_flies_as_plans_have_it() -> None:
    turning, smooth = TurningMotion((0.0, 0.0, 0.0), 2.0), SmoothMotion((0.0, 0.0, 0.0), 2.0)
    for motion in (turning, smooth):
        motion.fly_to((30.0, 40.0, 5.0), 8.0, 1.0)

    assert turning.arrives_s == pytest.approx(smooth.arrives_s)
    for at_s in (1.5, 4.0, 6.0, 9.0):
        assert turning.position_enu_m(at_s) == pytest.approx(smooth.position_enu_m(at_s))
