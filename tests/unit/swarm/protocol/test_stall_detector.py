"""A process notices that it was held up by the deadline it missed."""

from __future__ import annotations

from swarm.protocol.timing import StallDetector

LIMIT_S = 1.0


def test_nobody_is_late_who_promised_nothing() -> None:
    pulse = StallDetector(LIMIT_S)
    assert not pulse.late(1e6)
    pulse.expect_by(10.0)
    pulse.expect_by(None)

    assert not pulse.late(1e6)


def test_who_comes_early_or_a_little_late_was_not_held_up() -> None:
    pulse = StallDetector(LIMIT_S)
    pulse.expect_by(10.0)

    assert not pulse.late(3.0)
    assert not pulse.late(10.0)
    assert not pulse.late(10.0 + LIMIT_S)


def test_who_comes_long_after_its_deadline_was_held_up() -> None:
    pulse = StallDetector(LIMIT_S)
    pulse.expect_by(10.0)

    assert pulse.late(10.0 + 1.01 * LIMIT_S)


def test_a_new_promise_forgives_the_broken_one() -> None:
    pulse = StallDetector(LIMIT_S)
    pulse.expect_by(10.0)
    pulse.expect_by(101.0)

    assert not pulse.late(100.0)


def test_who_has_only_waited_for_others_of_its_process_was_not_held_up() -> None:
    pulse = StallDetector(LIMIT_S)
    pulse.runs_since_s = 9.0
    pulse.expect_by(10.0)
    assert not pulse.late(10.0 + 100.0 * LIMIT_S)

    pulse.runs_since_s = 10.0 + 0.99 * LIMIT_S  # it stood still meanwhile, but not for long
    assert not pulse.late(10.0 + 100.0 * LIMIT_S)
    pulse.runs_since_s = 10.0 + 1.01 * LIMIT_S
    assert pulse.late(10.0 + 1.02 * LIMIT_S)
