"""What time it is in the mission, by words that were under way for unlike times."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarm.protocol.messages import MissionPhase
from swarm.protocol.mission_clock import NOISE_S, SKEW_S, WORDS_KEPT, MissionClock
from tests.support.builders import brief, epoch

ZERO_S = 100.0
"""The own clock at mission time 0."""


def told(clock: MissionClock, mission_s: float, delay_s: float) -> float:
    """Somebody says what time it is; that takes its time."""
    return clock.hear(mission_s, ZERO_S + mission_s + delay_s)


def off_s(clock: MissionClock, mission_s: float) -> float:
    """How far the clock is ahead of the truth."""
    shown_s = clock.mission_s(ZERO_S + mission_s)
    assert shown_s is not None
    return shown_s - mission_s


def test_nothing_is_known_before_the_first_word() -> None:
    clock = MissionClock()
    assert not clock.is_set
    assert clock.mission_s(5.0) is None


def test_a_first_word_that_was_late_is_made_good_by_the_next() -> None:
    clock = MissionClock()
    told(clock, 0.0, delay_s=3.0)
    assert off_s(clock, 3.0) == -3.0

    assert told(clock, 4.0, delay_s=0.1) == pytest.approx(2.9)
    assert off_s(clock, 5.0) == pytest.approx(-0.1)


def test_words_that_come_late_do_not_put_the_clock_back() -> None:
    clock = MissionClock()
    told(clock, 0.0, delay_s=0.0)
    for mission_s in range(1, 5 * WORDS_KEPT):
        told(clock, float(mission_s), delay_s=0.9 * SKEW_S)
        assert off_s(clock, float(mission_s)) == 0.0


def test_rounding_does_not_move_it() -> None:
    clock = MissionClock()
    told(clock, 0.0, delay_s=0.0)
    assert told(clock, 1.0, delay_s=-NOISE_S / 2.0) == 0.0
    assert off_s(clock, 1.0) == 0.0


def test_a_word_from_the_future_is_forgotten() -> None:
    clock = MissionClock()
    told(clock, 0.0, delay_s=0.0)
    assert clock.hear(1e15, ZERO_S + 0.5) > 0.0
    for mission_s in range(1, WORDS_KEPT):
        assert told(clock, float(mission_s), delay_s=0.1) == 0.0

    assert told(clock, 9.0, delay_s=0.1) < 0.0
    assert off_s(clock, 10.0) == pytest.approx(-0.1)


def test_a_clock_that_an_own_memory_set_wrongly_is_put_right() -> None:
    """The wall clock of a small computer may be wrong by hours after a start."""
    clock = MissionClock()
    clock.hear(7200.0, ZERO_S)
    for mission_s in range(WORDS_KEPT):
        told(clock, float(mission_s), delay_s=0.1)
    assert off_s(clock, 9.0) == pytest.approx(-0.1)


def test_of_another_flight_only_the_last_word_counts_if_that() -> None:
    clock = MissionClock()
    told(clock, 50.0, delay_s=0.0)
    clock.hear(0.0, ZERO_S + 60.0)
    before, news = brief(), replace(brief(), run=2)
    clock.heed(news, news, epoch())
    clock.heed(news, None, epoch())
    assert clock.mission_s(ZERO_S + 61.0) == 61.0
    clock.heed(news, before, epoch())
    assert clock.mission_s(ZERO_S + 61.0) == 1.0

    clock.heed(before, news, epoch(phase=MissionPhase.PREPARING))
    assert not clock.is_set
    clock.heed(news, before, epoch())
    assert not clock.is_set


@given(seed=st.integers(0, 2**32 - 1), rate=st.floats(-1e-4, 1e-4))
def test_it_is_never_ahead_and_never_more_behind_than_the_first_word_was(
    seed: int, rate: float
) -> None:
    """Of a speaker whose clock runs otherwise by up to 100 ppm, over two minutes."""
    rng = np.random.default_rng(seed)
    clock, least_s, drift_s = MissionClock(), math.inf, 120.0 * 1e-4
    for mission_s in np.sort(rng.uniform(0.0, 120.0, 60)):
        delay_s = float(rng.exponential(0.5))
        least_s = min(least_s, delay_s)
        clock.hear(float(mission_s), ZERO_S + float(mission_s) * (1.0 + rate) + delay_s)
        shown_s = clock.mission_s(ZERO_S + float(mission_s))
        assert shown_s is not None
        behind_s = float(mission_s) - shown_s
        assert -drift_s <= behind_s
        assert behind_s <= least_s + SKEW_S + NOISE_S + drift_s
