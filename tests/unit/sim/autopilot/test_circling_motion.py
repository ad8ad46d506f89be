"""Simulated planes fly round bends to a circle round their target, and wait on it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.autopilot.circling_motion import CirclingMotion
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
