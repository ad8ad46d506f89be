"""Questions to everyone: soon after there is a reason, and not too often."""

from __future__ import annotations

from swarm.protocol.sync import QuestionTimer

GAP_S = 0.2


def test_nothing_is_asked_without_a_reason() -> None:
    asking = QuestionTimer(GAP_S)

    assert asking.next_deadline_s() is None
    assert not asking.due(100.0)


def test_the_first_question_is_due_at_once_and_once() -> None:
    asking = QuestionTimer(GAP_S)
    asking.want(10.0)

    assert asking.next_deadline_s() == 10.0
    assert asking.due(10.0)
    assert not asking.due(10.0)
    assert asking.next_deadline_s() is None


def test_a_second_question_waits_for_the_gap() -> None:
    asking = QuestionTimer(GAP_S)
    asking.want(10.0)
    asking.due(10.0)
    asking.want(10.05)

    assert asking.next_deadline_s() == 10.0 + GAP_S
    assert not asking.due(10.1)
    assert asking.due(10.0 + GAP_S)


def test_many_reasons_before_a_question_are_one() -> None:
    asking = QuestionTimer(GAP_S)
    for now_s in (10.0, 10.1, 10.2):
        asking.want(now_s)

    assert asking.next_deadline_s() == 10.0
    assert asking.due(10.3)
    assert not asking.due(20.0)


def test_the_deadline_of_a_new_question_is_never_past() -> None:
    asking = QuestionTimer(GAP_S)
    asking.want(10.0)
    asking.due(10.0)
    asking.want(50.0)

    assert asking.next_deadline_s() == 50.0


def test_a_question_for_later_holds_none_up_that_is_due_before() -> None:
    asking = QuestionTimer(GAP_S)
    asking.want(50.0)
    asking.want(10.0)
    assert asking.next_deadline_s() == 10.0
    assert asking.due(10.0)


def test_no_more_are_open_than_may_be_and_the_next_waits_for_an_answer() -> None:
    """Answers that are read more slowly than questions come would pile up for ever."""
    asking = QuestionTimer(GAP_S, most_open=2)
    for at_s in (10.0, 11.0):
        asking.want(at_s)
        assert asking.due(at_s)
    asking.want(12.0)
    assert asking.is_full
    assert asking.next_deadline_s() is None
    assert not asking.due(20.0)

    asking.answered()
    assert asking.next_deadline_s() == 12.0
    assert asking.due(20.0)
