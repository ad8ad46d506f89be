"""A process notices that it was held up by the deadline it missed."""

from __future__ import annotations

from swarm.pulse import Pulse

LIMIT_S = 1.0


def test_nobody_is_late_who_promised_nothing() -> None:
    pulse = Pulse(LIMIT_S)
    assert not pulse.late(1e6)
    pulse.promise(10.0)
    pulse.promise(None)

    assert not pulse.late(1e6)


def test_who_comes_early_or_a_little_late_was_not_held_up() -> None:
    pulse = Pulse(LIMIT_S)
    pulse.promise(10.0)

    assert not pulse.late(3.0)
    assert not pulse.late(10.0)
    assert not pulse.late(10.0 + LIMIT_S)


def test_who_comes_long_after_its_deadline_was_held_up() -> None:
    pulse = Pulse(LIMIT_S)
    pulse.promise(10.0)

    assert pulse.late(10.0 + 1.01 * LIMIT_S)


def test_a_new_promise_forgives_the_broken_one() -> None:
    pulse = Pulse(LIMIT_S)
    pulse.promise(10.0)
    pulse.promise(101.0)

    assert not pulse.late(100.0)
