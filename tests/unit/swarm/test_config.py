"""Timers: positive, finite, and silence well above the interval at which the living speak."""

from __future__ import annotations

import dataclasses
import math

import pytest

from swarm.config import Timing


@pytest.mark.parametrize("value", [0.0, -1.0, math.inf, math.nan])
def test_a_duration_is_positive_and_finite(value: float) -> None:
    with pytest.raises(ValueError, match="status_s must be > 0 s"):
        Timing(status_s=value)


def test_one_lost_announcement_must_not_pass_for_a_loss() -> None:
    with pytest.raises(ValueError, match=r"silence_s must be >= 2 announce_s = 6\.0, not 5\.9"):
        Timing(announce_s=3.0, silence_s=5.9)
    assert Timing(announce_s=3.0, silence_s=6.0).silence_s == 6.0


def test_scaling_keeps_the_wall_durations() -> None:
    scaled = dataclasses.astuple(Timing().scaled(8.0))

    assert scaled == tuple(8.0 * value for value in dataclasses.astuple(Timing()))
