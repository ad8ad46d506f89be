"""Who is there: hysteresis, and no suspicion without a link of one's own."""

from __future__ import annotations

import pytest

from swarm.state.membership import Membership
from tests.builders import TIMING

DELAY_S, GRACE_S = TIMING.loss_delay_s, TIMING.relink_grace_s


@pytest.fixture
def members() -> Membership:
    members = Membership(TIMING)
    members.seen("u1")
    return members


def test_a_token_seen_makes_its_writer_present_and_is_news_once() -> None:
    members = Membership(TIMING)

    assert members.seen("u1")
    assert not members.seen("u1")
    assert members.present == {"u1"}
    assert members.next_deadline_s() is None


def test_a_gone_token_is_a_loss_only_after_the_delay(members: Membership) -> None:
    members.gone("u1", 10.0)

    assert members.next_deadline_s() == 10.0 + DELAY_S
    assert members.lost(10.0 + 0.9 * DELAY_S) == []
    assert members.present == {"u1"}
    assert members.lost(10.0 + DELAY_S) == ["u1"]
    assert members.present == set()
    assert members.next_deadline_s() is None


def test_a_loss_is_told_once_and_losses_in_id_order(members: Membership) -> None:
    for writer in ("u3", "u2"):
        members.seen(writer)
        members.gone(writer, 0.0)

    assert members.lost(1.0) == ["u2", "u3"]
    assert members.lost(2.0) == []


def test_a_token_that_blinks_within_the_delay_is_no_loss(members: Membership) -> None:
    members.gone("u1", 10.0)

    assert not members.seen("u1")
    assert members.lost(100.0) == []
    assert members.present == {"u1"}


def test_a_token_nobody_saw_cannot_go(members: Membership) -> None:
    members.gone("u9", 0.0)

    assert members.next_deadline_s() is None
    assert members.lost(10.0) == []


def test_nobody_is_lost_while_the_own_link_is_down(members: Membership) -> None:
    members.link(False, 0.0)
    members.gone("u1", 0.0)

    assert members.next_deadline_s() is None
    assert members.lost(1000.0) == []
    assert members.present == {"u1"}


def test_a_token_that_went_just_before_the_own_link_proves_nothing_either(
    members: Membership,
) -> None:
    members.gone("u1", 0.0)
    members.link(False, 0.5 * DELAY_S)

    assert members.lost(1000.0) == []


def test_after_the_own_link_is_back_others_have_a_grace_to_show_themselves(
    members: Membership,
) -> None:
    members.seen("u2")
    members.link(False, 0.0)
    members.gone("u1", 0.0)
    members.gone("u2", 0.0)
    members.link(True, 100.0)

    members.seen("u2")

    assert members.lost(100.0 + 0.9 * GRACE_S) == []
    assert members.next_deadline_s() == 100.0 + GRACE_S
    assert members.lost(100.0 + GRACE_S) == ["u1"]
    assert members.present == {"u2"}


def test_the_first_link_gives_no_grace_to_anyone(members: Membership) -> None:
    members.gone("u1", 0.0)
    members.link(True, 0.0)

    assert members.lost(DELAY_S) == ["u1"]


def test_who_was_lost_and_is_back_is_news_but_not_credible_before_it_speaks(
    members: Membership,
) -> None:
    members.gone("u1", 0.0)
    members.lost(DELAY_S)

    assert members.seen("u1")
    assert members.present == {"u1"}
    assert members.credible == set()
    members.spoke("u1")
    assert members.credible == {"u1"}


def test_who_only_blinked_stays_credible(members: Membership) -> None:
    members.gone("u1", 0.0)

    assert members.credible == {"u1"}
    members.seen("u1")
    assert members.credible == {"u1"}


def test_who_blinked_answers_for_itself_only_after_it_has_spoken(members: Membership) -> None:
    """The token may be a new process's, which remembers nothing."""
    assert members.steady == {"u1"}
    members.gone("u1", 0.0)
    members.seen("u1")
    assert members.steady == set()
    members.spoke("u1")
    assert members.steady == {"u1"}


def test_words_of_someone_whose_token_is_gone_do_not_make_it_steady(members: Membership) -> None:
    members.gone("u1", 0.0)
    members.spoke("u1")

    assert members.steady == set()


def test_a_cut_of_the_own_link_makes_nobody_forget(members: Membership) -> None:
    """Else the whole fleet would answer for the whole fleet whenever a router restarts."""
    members.link(False, 0.0)
    members.gone("u1", 0.0)
    members.link(True, 1.0)
    members.seen("u1")

    assert members.steady == {"u1"}
