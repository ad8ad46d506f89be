from __future__ import annotations

import pytest

from coordinator.planner.stop import after_evaluations, after_time, first_of, never


class HandClock:
    """A clock set by the test."""

    def __init__(self) -> None:
        self.time_s = 100.0

    def now_s(self) -> float:
        return self.time_s

    def wall_delay_s(self, delay_s: float) -> float:
        return delay_s


def test_evaluations_end_at_the_limit() -> None:
    stop = after_evaluations(3)

    assert [stop(n) for n in (0, 2, 3, 4)] == [False, False, True, True]


def test_time_ends_at_the_limit() -> None:
    clock = HandClock()
    stop = after_time(clock, 2.0)

    assert not stop(10**9)
    clock.time_s = 101.9
    assert not stop(0)
    clock.time_s = 102.0
    assert stop(0)


def test_whichever_comes_first_ends_the_search() -> None:
    stop = first_of(never, after_evaluations(2), after_evaluations(5))

    assert not stop(1)
    assert stop(2)


def test_impossible_limits_are_refused() -> None:
    with pytest.raises(ValueError, match="limit"):
        after_evaluations(0)
    with pytest.raises(ValueError, match="limit_s"):
        after_time(HandClock(), -1.0)
