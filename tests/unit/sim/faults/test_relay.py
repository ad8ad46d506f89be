"""What a bad link does to a stream, in numbers."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from sim.fleet.faults.relay import RelayQuality, stall_s


def test_a_link_that_loses_nothing_holds_nothing_up() -> None:
    assert stall_s(RelayQuality(delay_s=0.5), 100, np.random.default_rng(0)) == 0.0


def test_a_segment_is_held_up_as_often_as_it_is_lost() -> None:
    quality, rng = RelayQuality(delay_s=0.05, loss_frac=0.2), np.random.default_rng(0)
    drawn = [stall_s(quality, 1, rng) for _ in range(20_000)]

    # Timeouts of 0.2 s and a round trip, doubled each time: 0.3, 0.3 + 0.6, 0.3 + 0.6 + 1.2 ...
    rounded = [round(value, 6) for value in drawn]
    for lost, held_up_s in enumerate((0.0, 0.3, 0.9, 2.1)):
        share = rounded.count(held_up_s) / len(rounded)
        assert share == pytest.approx(0.8 * 0.2**lost, rel=0.2)


def test_of_many_segments_the_unluckiest_holds_up_the_rest() -> None:
    quality = RelayQuality(loss_frac=0.1)
    alone = np.mean([stall_s(quality, 1, np.random.default_rng(seed)) for seed in range(2000)])
    many = np.mean([stall_s(quality, 20, np.random.default_rng(seed)) for seed in range(2000)])

    assert many > 5.0 * alone


def test_a_timeout_never_exceeds_a_minute() -> None:
    quality = RelayQuality(loss_frac=0.99)
    drawn = [stall_s(quality, 1, np.random.default_rng(seed)) for seed in range(50)]

    assert max(drawn) > 1000.0
    # 0.2 s doubled 8 times is 51.2 s, so the first 9 losses cost 102.2 s, all others 60 s each.
    for value in drawn:
        if value > 102.3:
            assert (value - 102.2) / 60.0 == pytest.approx(round((value - 102.2) / 60.0))


@pytest.mark.parametrize(
    "wrong",
    [
        {"delay_s": -0.1},
        {"delay_s": math.inf},
        {"jitter_s": math.nan},
        {"loss_frac": 1.0},
        {"loss_frac": -0.1},
        {"most_lost": -1},
        {"rate_bytes_s": 0.0},
    ],
)
def test_a_quality_that_makes_no_sense_is_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=next(iter(wrong))):
        RelayQuality(**wrong)


def test_a_segment_is_lost_no_more_often_running_than_allowed() -> None:
    quality, rng = RelayQuality(delay_s=0.05, loss_frac=0.5, most_lost=2), np.random.default_rng(0)

    drawn = {stall_s(quality, 1, rng) for _ in range(1000)}

    assert sorted(drawn) == pytest.approx([0.0, 0.3, 0.3 + 0.6])
