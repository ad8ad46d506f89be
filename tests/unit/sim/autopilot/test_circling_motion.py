"""Simulated planes fly round bends to a circle round their target, and wait on it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.autopilot.circling_motion import CirclingMotion, RunwayMotion
from sim.world.motion import flown_s
from swarm.model.vehicles import turn_radius_m, turning_acceleration_m_s2

RADIUS_M, SPEED_M_S = 60.0, 20.0
PLACE = st.floats(-800.0, 800.0)


def flying(place: tuple[float, float] = (0.0, 0.0)) -> CirclingMotion:
    """On its circle round (300, 0), 40 m up."""
    motion = CirclingMotion((*place, 40.0), RADIUS_M)
    motion.circle((300.0, 0.0, 40.0), SPEED_M_S, 0.0)
    return motion


def away_m(motion: CirclingMotion, now_s: float, target: tuple[float, float]) -> float:
    return math.dist(motion.position_enu_m(now_s)[:2], target)


def test_it_waits_on_a_circle_to_the_right() -> None:
    motion = flying()
    arrives_s = motion.arrives_s
    assert arrives_s is not None
    for later_s in (0.0, 1.0, 7.0, 500.0):
        assert away_m(motion, arrives_s + later_s, (300.0, 0.0)) == pytest.approx(RADIUS_M)
    east_m, north_m, _ = motion.position_enu_m(arrives_s + 3.0)
    east_m_s, north_m_s, _ = motion.velocity_enu_m_s(arrives_s + 3.0)
    assert (east_m - 300.0) * north_m_s - north_m * east_m_s < 0.0


@given(start=st.tuples(PLACE, PLACE), target=st.tuples(PLACE, PLACE), turns_s=st.floats(0.0, 60.0))
def test_it_turns_without_a_jump_and_comes_onto_the_circle(
    start: tuple[float, float], target: tuple[float, float], turns_s: float
) -> None:
    motion = flying(start)
    before_m, before_m_s = motion.position_enu_m(turns_s), motion.velocity_enu_m_s(turns_s)
    motion.circle((*target, 40.0), SPEED_M_S, turns_s)
    assert motion.position_enu_m(turns_s) == pytest.approx(before_m, abs=1e-6)
    assert motion.velocity_enu_m_s(turns_s) == pytest.approx(before_m_s, abs=1e-6)
    arrives_s = motion.arrives_s
    assert arrives_s is not None
    assert away_m(motion, arrives_s, target) == pytest.approx(RADIUS_M, abs=1e-4)
    step_s = (arrives_s + 5.0 - turns_s) / 200.0
    for number in range(200):
        at_s = turns_s + number * step_s
        moved_m = math.dist(motion.position_enu_m(at_s), motion.position_enu_m(at_s + step_s))
        assert moved_m <= SPEED_M_S * step_s + 1e-6
        assert math.hypot(*motion.velocity_enu_m_s(at_s)) == pytest.approx(SPEED_M_S)


def test_its_height_changes_on_the_way() -> None:
    motion = flying()
    motion.circle((900.0, 0.0, 70.0), SPEED_M_S, 20.0)
    assert motion.position_enu_m(24.0)[2] == pytest.approx(40.0 + 4.0 * 3.0)
    assert motion.velocity_enu_m_s(24.0)[2] == pytest.approx(3.0)
    assert motion.position_enu_m(60.0)[2] == 70.0
    assert motion.velocity_enu_m_s(60.0)[2] == 0.0


def test_it_stops_to_hover_and_flies_straight_on_rotors() -> None:
    motion = flying()
    here_m = motion.position_enu_m(5.0)
    motion.stop(5.0)
    assert motion.position_enu_m(9.0) == here_m
    assert motion.velocity_enu_m_s(9.0) == (0.0, 0.0, 0.0)
    motion.fly_to((*here_m[:2], 0.0), 2.0, 9.0)
    assert motion.arrives_s == pytest.approx(9.0 + 20.0)
    assert motion.position_enu_m(40.0) == (*here_m[:2], 0.0)


@pytest.mark.parametrize("radii", [5.0, 10.0, 20.0])
def test_turns_take_on_the_average_what_plans_reckon_with(radii: float) -> None:
    rng = np.random.default_rng(7)
    motion, now_s, place, extra_s = flying(), 60.0, (300.0, 0.0), []
    for angle_rad, waits_s in rng.uniform(0.0, (math.tau, 40.0), (600, 2)):
        way_m = radii * RADIUS_M
        target = (
            place[0] + way_m * math.cos(angle_rad),
            place[1] + way_m * math.sin(angle_rad),
        )
        motion.circle((*target, 40.0), SPEED_M_S, now_s)
        arrives_s = motion.arrives_s
        assert arrives_s is not None
        extra_s.append(arrives_s - now_s - way_m / SPEED_M_S)
        now_s, place = arrives_s + waits_s, target
    planned_m_s2 = turning_acceleration_m_s2(SPEED_M_S, RADIUS_M)
    planned_s = flown_s(radii * RADIUS_M, SPEED_M_S, planned_m_s2) - radii * RADIUS_M / SPEED_M_S
    assert float(np.mean(extra_s)) == pytest.approx(planned_s, rel=0.1)


def test_radius_and_acceleration_are_the_same_told_twice() -> None:
    assert turning_acceleration_m_s2(20.0, 80.0) == pytest.approx(5.0)
    assert turn_radius_m(20.0, turning_acceleration_m_s2(20.0, 73.0)) == pytest.approx(73.0)


# -- from and to a runway ---------------------------------------------------------------

HEADING_RAD = 0.7


def climbed() -> tuple[RunwayMotion, float]:
    """Just up, 50 m high, and when that is."""
    motion = RunwayMotion((10.0, 20.0, 0.0), RADIUS_M, HEADING_RAD, SPEED_M_S)
    motion.fly_to((10.0, 20.0, 50.0), 2.5, 0.0)
    return motion, 20.0


def test_it_climbs_away_straight_ahead() -> None:
    motion, up_s = climbed()
    assert motion.arrives_s == up_s
    way_m = SPEED_M_S * up_s
    there_m = (10.0 + way_m * math.sin(HEADING_RAD), 20.0 + way_m * math.cos(HEADING_RAD), 50.0)
    assert motion.position_enu_m(up_s) == pytest.approx(there_m)
    assert motion.velocity_enu_m_s(up_s / 2.0)[2] == 2.5


def test_stopped_in_the_air_it_circles_and_loses_no_height() -> None:
    motion, up_s = climbed()
    here_m = motion.position_enu_m(up_s)
    motion.stop(up_s)
    for later_s in (0.0, 3.0, 40.0, 400.0):
        assert away_m(motion, up_s + later_s, here_m[:2]) <= RADIUS_M + 1e-6
        assert motion.position_enu_m(up_s + later_s)[2] == 50.0
        assert math.hypot(*motion.velocity_enu_m_s(up_s + later_s)) == pytest.approx(SPEED_M_S)


@given(east_m=PLACE, north_m=PLACE, turned_rad=st.floats(0.0, math.tau))
def test_it_leaves_the_circle_on_a_tangent_and_touches_down_at_the_place(
    east_m: float, north_m: float, turned_rad: float
) -> None:
    motion, up_s = climbed()
    down_m = (
        east_m + 400.0 * math.sin(turned_rad) - RADIUS_M * math.cos(turned_rad),
        north_m + 400.0 * math.cos(turned_rad) + RADIUS_M * math.sin(turned_rad),
        0.0,
    )
    motion.climb_to((east_m, north_m, 25.0), up_s)
    round_s = motion.arrives_s
    assert round_s is not None
    before_m, before_m_s = motion.position_enu_m(round_s), motion.velocity_enu_m_s(round_s)
    motion.glide(down_m, round_s)
    assert motion.position_enu_m(round_s) == pytest.approx(before_m, abs=1e-6)
    assert motion.velocity_enu_m_s(round_s)[:2] == pytest.approx(before_m_s[:2], abs=1e-5)
    down_s = motion.arrives_s
    assert down_s is not None
    assert motion.position_enu_m(down_s) == pytest.approx(down_m, abs=1e-4)
    east_m_s, north_m_s, up_m_s = motion.velocity_enu_m_s(down_s - 1.0)
    ahead_m_s = (SPEED_M_S * math.sin(turned_rad), SPEED_M_S * math.cos(turned_rad))
    assert (east_m_s, north_m_s) == pytest.approx(ahead_m_s, abs=1e-4)
    assert up_m_s == pytest.approx(-25.0 * SPEED_M_S / 400.0, rel=1e-4)
    motion.stop(down_s)
    assert motion.position_enu_m(down_s + 60.0) == pytest.approx(down_m, abs=1e-4)
    assert motion.velocity_enu_m_s(down_s + 60.0) == (0.0, 0.0, 0.0)
