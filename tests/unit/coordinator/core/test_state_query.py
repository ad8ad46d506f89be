"""Asking before deciding: sure again once everyone was asked since the last doubt."""

from __future__ import annotations

from coordinator.core.leadership import StateQuery

GAP_S = 0.2


def test_it_is_unsure_until_its_first_question_is_answered() -> None:
    inquiry = StateQuery(GAP_S)
    inquiry.want(0.0)
    assert inquiry.due(0.0)
    assert (inquiry.unsure, inquiry.ever) == (True, False)

    inquiry.answered()
    assert (inquiry.unsure, inquiry.ever) == (False, True)


def test_a_question_from_before_the_doubt_answers_it_not() -> None:
    inquiry = StateQuery(GAP_S)
    inquiry.want(0.0)
    assert inquiry.due(0.0)
    inquiry.want(0.1, before_deciding=True)
    inquiry.answered()
    assert inquiry.unsure

    assert inquiry.next_deadline_s() == GAP_S
    assert inquiry.due(GAP_S)
    inquiry.answered()
    assert not inquiry.unsure


def test_questions_without_doubt_hold_nothing_up() -> None:
    """Else a stream of them, each slow to be answered, would never let it decide."""
    inquiry = StateQuery(GAP_S)
    inquiry.want(0.0, before_deciding=True)
    for at_s in (0.0, 0.5):
        inquiry.want(at_s)
        assert inquiry.due(at_s)
    inquiry.answered()

    assert not inquiry.unsure


def test_it_asks_no_third_time_before_the_first_answer_however_long_that_takes() -> None:
    inquiry = StateQuery(GAP_S, every_s=1.0)
    for at_s in (0.0, 1.0):
        inquiry.want(at_s, before_deciding=True)
        assert inquiry.due(at_s)
    inquiry.want(2.0, before_deciding=True)
    assert inquiry.next_deadline_s() is None
    assert not inquiry.due(9.0)

    inquiry.answered()
    assert inquiry.due(9.0)
    assert inquiry.unsure
    inquiry.answered()
    inquiry.answered()
    assert not inquiry.unsure
