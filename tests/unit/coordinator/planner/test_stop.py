from __future__ import annotations

import pytest

from coordinator.planner.options import (
    Limit,
    after_evaluations,
    after_time,
    beginning_of,
    first_of,
    never,
    part_of,
    whole_limit,
)


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
    with pytest.raises(ValueError, match="frac"):
        after_evaluations(2).part(0.0)


def test_a_limit_in_time_may_have_begun_earlier() -> None:
    clock = HandClock()

    assert after_time(clock, 2.0, begin_s=98.0)(0)
    assert after_time(clock, 4.0, begin_s=98.0).spent_frac(0) == 0.5


def test_the_beginning_of_a_limit_counts_from_where_it_is_asked_for() -> None:
    spent = 0.75
    limit = Limit(lambda _: spent)
    half = beginning_of(limit, 0.5)

    assert not half(0.0)
    spent = 0.87
    assert not half(0.0)
    spent = 0.875
    assert half(0.0)
    spent = 1.0
    assert beginning_of(limit, 0.5)(0.0)  # nothing is left
    assert beginning_of(never, 0.5) is never


def test_a_part_of_a_limit_ends_earlier() -> None:
    half = part_of(after_evaluations(10), 0.5)

    assert [half(n) for n in (4, 5)] == [False, True]
    assert part_of(never, 0.5) is never


def test_asked_about_nothing_only_time_and_wishes_end_it() -> None:
    clock = HandClock()
    stop = first_of(after_time(clock, 1.0), after_evaluations(1))

    assert not stop(0)
    clock.time_s += 1.0
    assert stop(0)


def test_nothing_of_a_limit_is_kept_from_a_proof_unless_it_is_asked_for() -> None:
    assert whole_limit(10.0, None, proves=False) == (10.0, 0.25)
    assert whole_limit(10.0, None, proves=True) == (10.0, 0.0)
    assert whole_limit(10.0, 30.0, proves=True) == (40.0, 0.75)
