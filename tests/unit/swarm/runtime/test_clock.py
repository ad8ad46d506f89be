"""Clocks go forward, at the pace they were told."""

from __future__ import annotations

import math

import pytest

from swarm.runtime.clock import ScaledClock, SystemClock, elapsed_s, incarnation, unix_s


@pytest.mark.parametrize("clock", [SystemClock(), ScaledClock(50.0)], ids=["system", "scaled"])
def test_time_never_goes_back(clock: SystemClock | ScaledClock) -> None:
    instants_s = [clock.now_s() for _ in range(1000)]

    assert instants_s == sorted(instants_s)


def test_a_scaled_clock_begins_at_zero_and_gains_by_its_speedup() -> None:
    wall = SystemClock()
    before_s = wall.now_s()
    clock = ScaledClock(1000.0)
    after_s = wall.now_s()
    first_s = wall.now_s()
    scaled_s = clock.now_s()
    last_s = wall.now_s()

    assert (first_s - after_s) * 1000.0 <= scaled_s <= (last_s - before_s) * 1000.0


def test_waiting_takes_less_wall_time_on_a_faster_clock() -> None:
    assert SystemClock().wall_delay_s(6.0) == 6.0
    assert ScaledClock(3.0).wall_delay_s(6.0) == 2.0
    assert ScaledClock(0.5).wall_delay_s(6.0) == 12.0


def test_a_faster_clock_advances_farther_in_the_same_wall_time() -> None:
    assert elapsed_s(SystemClock(), 0.5) == 0.5
    assert elapsed_s(ScaledClock(4.0), 0.5) == 2.0


@pytest.mark.parametrize("speedup", [0.0, -1.0, math.inf, math.nan])
def test_a_pace_that_is_none_is_refused(speedup: float) -> None:
    with pytest.raises(ValueError, match="speedup"):
        ScaledClock(speedup)


def test_incarnations_do_not_decrease_and_fit_a_stamp() -> None:
    lives = [incarnation() for _ in range(100)]

    assert lives == sorted(lives)
    assert 0 < lives[-1] < 2**63


def test_wall_time_and_incarnations_are_read_off_one_clock() -> None:
    earlier = incarnation()
    wall_s = unix_s()

    assert earlier - 1 <= wall_s * 1000.0 <= incarnation() + 1
