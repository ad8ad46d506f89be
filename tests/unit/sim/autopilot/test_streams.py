"""Periodic messages."""

from __future__ import annotations

import pytest

from sim.autopilot.message_rates import MessageRates


def test_vehicle_called_too_late_skips_what_was_missed_and_keeps_the_grid() -> None:
    streams = MessageRates()
    streams.open(0, {33: 0.5}, now_s=1.0, grid_s=1.0)
    assert list(streams.take_due(1.0)) == [(0, 33)]

    assert list(streams.take_due(2.75)) == [(0, 33)]
    assert streams.deadline_s() == 3.0


@pytest.mark.parametrize("interval_s", [0.1, 1.0 / 3.0, 0.001])
def test_nothing_is_sent_twice_at_one_instant(interval_s: float) -> None:
    streams = MessageRates()
    streams.open(0, {33: interval_s}, now_s=0.1, grid_s=0.1)
    for count in range(1, 400):
        now_s = 0.1 + 3 * count * interval_s
        assert list(streams.take_due(now_s)) == [(0, 33)]
        assert streams.deadline_s() > now_s


def test_messages_asked_for_one_after_the_other_go_out_together() -> None:
    streams = MessageRates()
    streams.open(0, {}, now_s=1.0, grid_s=0.75)
    streams.set_interval(0, 33, 0.25, now_s=1.1)
    assert list(streams.take_due(1.1)) == [(0, 33)]
    streams.set_interval(0, 1, 0.5, now_s=1.15)
    assert list(streams.take_due(1.15)) == [(0, 1)]

    assert streams.deadline_s() == 1.25
    assert list(streams.take_due(1.25)) == [(0, 33), (0, 1)]
    assert list(streams.take_due(1.5)) == [(0, 33)]
    assert list(streams.take_due(1.75)) == [(0, 33), (0, 1)]
