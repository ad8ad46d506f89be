"""Who is there: hysteresis, silence, and no suspicion while this process itself cannot tell."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarm.model.ids import COORDINATOR
from swarm.protocol.membership import Membership
from swarm.protocol.timing import Timing
from tests.support.builders import TIMING

DELAY_S, GRACE_S, SILENCE_S = TIMING.loss_delay_s, TIMING.relink_grace_s, TIMING.silence_s


@pytest.fixture
def members() -> Membership:
    members = Membership(TIMING)
    members.seen("u1", 0.0)
    return members


def test_a_token_seen_makes_its_writer_present_and_is_news_once() -> None:
    members = Membership(TIMING)

    assert members.seen("u1", 0.0)
    assert not members.seen("u1", 0.0)
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
        members.seen(writer, 0.0)
        members.gone(writer, 0.0)

    assert members.lost(1.0) == ["u2", "u3"]
    assert members.lost(2.0) == []


def test_a_token_that_blinks_within_the_delay_is_no_loss(members: Membership) -> None:
    members.gone("u1", 10.0)

    assert not members.seen("u1", 10.0)
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
    members.seen("u2", 0.0)
    members.link(False, 0.0)
    members.gone("u1", 0.0)
    members.gone("u2", 0.0)
    members.link(True, 100.0)

    members.seen("u2", 100.0)

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

    assert members.seen("u1", 0.0)
    assert members.present == {"u1"}
    assert members.credible == set()
    members.spoke("u1")
    assert members.credible == {"u1"}


def test_who_was_lost_is_missed_until_it_has_said_what_it_claims(members: Membership) -> None:
    assert not members.missed("u1")
    members.gone("u1", 0.0)
    members.lost(DELAY_S)
    assert members.missed("u1")
    members.seen("u1", 5.0)
    assert members.missed("u1")
    members.spoke("u1")
    assert not members.missed("u1")
    assert not members.missed("u9")


def test_who_only_blinked_stays_credible(members: Membership) -> None:
    members.gone("u1", 0.0)

    assert members.credible == {"u1"}
    members.seen("u1", 0.0)
    assert members.credible == {"u1"}


def test_who_blinked_answers_for_itself_only_after_it_has_spoken(members: Membership) -> None:
    """The token may be a new process's, which remembers nothing."""
    assert members.steady == {"u1"}
    members.gone("u1", 0.0)
    members.seen("u1", 0.0)
    assert members.steady == set()
    members.spoke("u1")
    assert members.steady == {"u1"}


def test_words_of_someone_whose_token_is_gone_do_not_make_it_steady(members: Membership) -> None:
    members.gone("u1", 0.0)
    members.spoke("u1")

    assert members.steady == set()


def test_after_a_cut_of_the_own_link_anyone_may_be_new_until_it_has_spoken(
    members: Membership,
) -> None:
    """It may have begun anew meanwhile, and would be told by nobody what it had claimed."""
    members.link(False, 0.0)
    members.gone("u1", 0.0)
    members.link(True, 1.0)
    members.seen("u1", 1.0)

    assert members.present == members.credible == {"u1"}
    assert members.steady == set()
    members.spoke("u1")
    assert members.steady == {"u1"}


# -- silence ------------------------------------------------------------------------------


def test_who_has_been_heard_and_falls_silent_is_lost_although_its_token_lives(
    members: Membership,
) -> None:
    assert not members.heard("u1", 10.0)

    assert members.next_deadline_s() == 10.0 + SILENCE_S
    assert members.lost(10.0 + 0.99 * SILENCE_S) == []
    assert members.lost(10.0 + SILENCE_S) == ["u1"]
    assert members.present == set()
    assert members.credible == set()
    assert members.steady == set()
    assert members.next_deadline_s() is None
    assert members.lost(1000.0) == []


def test_a_coordinator_is_lost_by_silence_though_it_was_never_heard(members: Membership) -> None:
    """A new agent may find a token whose program hangs already."""
    members.seen(COORDINATOR, 1.0)

    assert members.lost(1.0 + 0.99 * SILENCE_S) == []
    assert members.lost(1.0 + SILENCE_S) == [COORDINATOR]


def test_a_loss_by_silence_can_be_told_from_one_by_the_token(members: Membership) -> None:
    members.seen("u2", 0.0)
    members.heard("u1", 0.0)
    members.gone("u2", 0.0)
    assert members.lost(SILENCE_S) == ["u1", "u2"]

    assert (members.mute("u1"), members.mute("u2")) == (True, False)
    members.heard("u1", 60.0)
    assert not members.mute("u1")


def test_everything_said_puts_silence_off(members: Membership) -> None:
    members.heard("u1", 10.0)
    members.heard("u1", 12.0)

    assert members.lost(10.0 + SILENCE_S) == []
    assert members.next_deadline_s() == 12.0 + SILENCE_S


def test_silence_of_one_never_heard_means_nothing(members: Membership) -> None:
    assert members.next_deadline_s() is None
    assert members.lost(1e6) == []


def test_who_was_heard_before_its_token_was_seen_is_judged_from_then_on() -> None:
    members = Membership(TIMING)
    members.heard("u1", 0.0)
    assert members.next_deadline_s() is None
    members.seen("u1", 3.0)

    assert members.next_deadline_s() == 3.0 + SILENCE_S


def test_who_was_lost_by_silence_is_back_when_it_speaks(members: Membership) -> None:
    members.heard("u1", 0.0)
    members.lost(SILENCE_S)

    assert members.heard("u1", 60.0)
    assert members.present == {"u1"}
    assert members.credible == set()
    members.spoke("u1")
    assert members.credible == {"u1"}
    assert members.steady == {"u1"}
    assert not members.heard("u1", 61.0)
    assert members.next_deadline_s() == 61.0 + SILENCE_S


def test_a_token_told_again_does_not_bring_back_who_is_silent(members: Membership) -> None:
    """As after the own link was cut: the bus tells all tokens anew, hung processes' too."""
    members.heard("u1", 0.0)
    members.lost(SILENCE_S)
    members.link(False, 20.0)
    members.gone("u1", 20.0)
    members.link(True, 21.0)

    assert not members.seen("u1", 21.0)
    assert members.present == set()
    assert members.heard("u1", 22.0)


def test_a_hung_process_that_is_started_anew_is_back_with_its_new_token(
    members: Membership,
) -> None:
    members.heard("u1", 0.0)
    members.lost(SILENCE_S)
    members.gone("u1", 20.0)

    assert members.seen("u1", 22.0)
    assert members.present == {"u1"}
    assert members.credible == set()
    assert members.lost(22.0 + SILENCE_S) == ["u1"]


def test_late_words_of_one_whose_token_is_gone_bring_nobody_back(members: Membership) -> None:
    members.heard("u1", 0.0)
    members.gone("u1", 1.0)
    assert not members.heard("u1", 1.1)
    assert members.lost(1.0 + DELAY_S) == ["u1"]

    assert not members.heard("u1", 2.0)
    assert members.present == set()
    assert members.next_deadline_s() is None


def test_who_is_both_silent_and_gone_is_lost_once(members: Membership) -> None:
    members.heard("u1", 0.0)
    members.gone("u1", SILENCE_S - DELAY_S)

    assert members.lost(SILENCE_S) == ["u1"]
    assert members.lost(1000.0) == []
    assert members.seen("u1", 1000.0)


def test_silence_during_a_cut_of_the_own_link_is_nobodys_fault(members: Membership) -> None:
    members.heard("u1", 0.0)
    members.link(False, 1.0)
    assert members.next_deadline_s() is None
    assert members.lost(100.0) == []
    members.link(True, 100.0)

    assert members.lost(100.0 + 0.99 * SILENCE_S) == []
    assert members.lost(100.0 + SILENCE_S) == ["u1"]


def test_who_held_its_own_process_up_condemns_nobody(members: Membership) -> None:
    members.heard("u1", 0.0)
    members.seen("u2", 0.0)
    members.gone("u2", 0.1)
    members.held_up(60.0)

    assert members.lost(60.0 + 0.9 * GRACE_S) == []
    assert members.lost(60.0 + GRACE_S) == ["u2"]
    assert members.lost(60.0 + SILENCE_S) == ["u1"]


# -- any history --------------------------------------------------------------------------

WRITERS = ("u1", "u2")
HAPPENINGS = st.sampled_from(
    [
        *((what, writer) for what in ("seen", "gone", "heard", "spoke") for writer in WRITERS),
        ("up", ""),
        ("down", ""),
        ("held up", ""),
        ("look", ""),
    ]
)


@given(st.lists(st.tuples(HAPPENINGS, st.floats(0.0, 2.0 * SILENCE_S)), max_size=40))
def test_deadlines_lie_ahead_and_each_loss_is_told_once(
    history: list[tuple[tuple[str, str], float]],
) -> None:
    members, linked, now_s = Membership(TIMING), True, 0.0
    for (what, writer), pause_s in history:
        now_s += pause_s
        before = set(members.present)
        back = set()
        excused = what == "held up" or (what == "up" and not linked)
        match what:
            case "seen":
                back |= {writer} if members.seen(writer, now_s) else set()
            case "gone":
                members.gone(writer, now_s)
            case "heard":
                back |= {writer} if members.heard(writer, now_s) else set()
            case "spoke":
                members.spoke(writer)
            case "up" | "down":
                linked = what == "up"
                members.link(linked, now_s)
            case "held up":
                members.held_up(now_s)
        assert members.present == before | back
        lost = members.lost(now_s)
        deadline_s = members.next_deadline_s()

        assert not lost or (linked and not excused)
        assert set(lost) <= before
        assert members.present == (before | back) - set(lost)
        assert members.credible <= members.present
        assert members.steady <= members.present
        assert deadline_s is None or deadline_s > now_s


def test_a_writer_whose_token_has_gone_is_missing_until_it_is_seen_or_lost() -> None:
    membership = Membership(TIMING)
    membership.seen("u1", 0.0)
    assert not membership.missing("u1")
    membership.gone("u1", 1.0)
    assert membership.missing("u1")
    membership.seen("u1", 1.1)
    assert not membership.missing("u1")
    membership.gone("u1", 2.0)
    assert membership.lost(2.0 + TIMING.loss_delay_s) == ["u1"]
    assert not membership.missing("u1")


def test_who_is_known_to_have_claimed_must_speak_though_it_was_never_heard_here() -> None:
    membership = Membership(TIMING)
    membership.seen("u1", 0.0)
    membership.expect(["u1", "u2"], 1.0)
    membership.seen("u2", 2.0)
    membership.expect(["u1", "u2"], 3.0)  # again: no new grace

    assert membership.next_deadline_s() == 1.0 + TIMING.silence_s
    assert membership.lost(1.0 + TIMING.silence_s) == ["u1"]
    assert membership.lost(2.0 + TIMING.silence_s) == ["u2"]
    assert membership.mute("u1")


def test_a_token_that_somebody_else_shows_keeps_nobodys_claim_longer_than_silence_would() -> None:
    """Tokens cannot be signed: whoever forges one, or lets it flicker, gains no more than that."""
    timing = Timing()
    membership, now_s = Membership(timing), timing.silence_s
    membership.seen("u1", 0.0)
    membership.heard("u1", 0.0)
    membership.spoke("u1")
    assert membership.is_credible("u1")

    assert membership.lost(now_s) == ["u1"]
    for _ in range(20):
        now_s += 1.0
        membership.gone("u1", now_s)
        membership.seen("u1", now_s)
        assert not membership.is_credible("u1")
        membership.lost(now_s)
