"""Joining replicas: any order, any grouping, any repetition, one result."""

from __future__ import annotations

from dataclasses import replace
from random import Random

from hypothesis import given
from hypothesis import strategies as st

from swarm.model.ids import COORDINATOR, FLEET, OPERATOR
from swarm.protocol.board import TaskBoard, holders
from swarm.protocol.encoding import encode
from swarm.protocol.fields import MAX_COUNT
from swarm.protocol.messages import Body, CommandKind, Message, OperatorCommand, Stamp, as_heard
from swarm.protocol.operator_commands import newest_command
from swarm.protocol.register_writer import RegisterWriter
from swarm.protocol.registers import Replica
from swarm.protocol.uav_messages import Claim
from tests.support.builders import (
    IDLE,
    MISSION,
    OUT,
    brief,
    done,
    entry,
    held,
    message,
    proposed,
    uav,
)
from tests.support.crowds import claims_and_outcomes, crowds, joined
from tests.support.keyring import Keyring


def contents(replica: Replica) -> tuple[object, ...]:
    """Everything that anyone reads off a replica."""
    return (
        list(replica.messages()),
        replica.brief,
        replica.epoch,
        replica.board,
        replica.posted,
        replica.task_orders,
        replica.claims,
        replica.outcomes,
        replica.commands,
        replica.starts,
        replica.digest(),
    )


@given(crowds, st.randoms(use_true_random=False))
def test_any_order_gives_the_same_registers(said: list[Message], random: Random) -> None:
    shuffled = list(said)
    random.shuffle(shuffled)

    assert contents(joined(said)) == contents(joined(shuffled))


@given(crowds, crowds, crowds)
def test_any_grouping_gives_the_same_registers(
    one: list[Message], two: list[Message], three: list[Message]
) -> None:
    left = joined([*joined([*one, *two]).messages(), *three])
    right = joined([*one, *joined([*two, *three]).messages()])

    assert contents(left) == contents(right)


@given(crowds)
def test_hearing_everything_again_is_no_news(said: list[Message]) -> None:
    replica = joined(said)
    before, versions = contents(replica), (replica.board_version, replica.task_version)

    assert not replica.join_all(said)
    assert not replica.join_all(list(replica.messages()))
    assert contents(replica) == before
    assert (replica.board_version, replica.task_version) == versions


@given(crowds)
def test_no_register_ever_goes_back(said: list[Message]) -> None:
    replica, newest = Replica(), dict[str, Stamp]()
    for statement in said:
        was_news = replica.join(statement)
        known = replica.known(statement)
        if known is None:
            continue  # status, which is no register
        key = statement.key
        assert known.stamp >= max(newest.get(key, known.stamp), statement.stamp)
        assert not was_news or known == statement
        newest[key] = known.stamp


@given(crowds, st.randoms(use_true_random=False))
def test_equal_registers_name_one_winner_whatever_order_they_came_in(
    said: list[Message], random: Random
) -> None:
    shuffled = said * 2
    random.shuffle(shuffled)
    one, other = joined(said), joined(shuffled)

    assert holders(one.claims) == holders(other.claims)
    assert TaskBoard(one, MISSION).states == TaskBoard(other, MISSION).states


@given(crowds, crowds, st.randoms(use_true_random=False))
def test_two_halves_of_a_fleet_agree_once_each_has_the_others_registers(
    one: list[Message], two: list[Message], random: Random
) -> None:
    """As after a partition; answers come whole, in any order and more than once."""
    left, right = joined(one), joined(two)
    to_left, to_right = list(right.messages()) * 2, list(left.messages()) * 2
    random.shuffle(to_left)
    random.shuffle(to_right)
    left.join_all(to_left)
    right.join_all(to_right)

    assert contents(left) == contents(right)


# -- several lives of one writer ----------------------------------------------------------

lives = st.lists(st.lists(claims_and_outcomes, min_size=1, max_size=4), min_size=1, max_size=4)


@given(lives, st.randoms(use_true_random=False))
def test_the_last_word_of_the_last_life_stands_whatever_else_arrives(
    lives: list[list[Body]], random: Random
) -> None:
    """Each life outdoes what it is told of the one before, whatever its own clock says."""
    said: list[Message] = []
    for life in lives:
        register_writer = RegisterWriter(MISSION, "u0", random.randrange(5))
        if said:
            register_writer.observe(max(message.stamp for message in said))
        said += [register_writer.say(body) for body in life]
    last_words = {message.key: message for message in said}
    heard = [message for message in said if random.random() < 0.7] + list(last_words.values())
    random.shuffle(heard)
    replica = joined(heard)

    assert {m.key: m for m in replica.messages()} == last_words


@given(st.permutations([1, 2, 3, 4]))
def test_a_claim_of_nothing_is_the_tombstone_of_those_before(order: list[int]) -> None:
    said = [proposed("t0", 0.0), held("t0", 0.0), held("t1", 1.0), IDLE]
    replica = joined([message("u0", said[counter - 1], counter) for counter in order])

    assert replica.claims == {"u0": IDLE}
    assert holders(replica.claims) == {}


@given(st.permutations([held("t0", 0.0), held("t1", 0.0), IDLE, OUT]))
def test_of_equal_stamps_the_same_statement_stands_everywhere(order: list[Claim]) -> None:
    """It takes two processes under one name; then at least the others agree."""
    said = [message("u0", claim) for claim in order]

    assert joined(said).claims["u0"] == joined(sorted(said, key=encode)).claims["u0"]
    assert encode(next(joined(said).messages())) == max(encode(each) for each in said)


@given(
    st.lists(
        st.one_of(
            st.tuples(st.sampled_from(["u0", "u1", "u2"]), st.sampled_from(["t0", "t1", None])),
            st.lists(st.sampled_from(["u0", "u1", "u2"]), unique=True),
        ),
        max_size=20,
    )
)
def test_claimants_are_the_claims_by_task_and_a_version_tells_when_claims_have_changed(
    events: list[tuple[str, str | None] | list[str]],
) -> None:
    replica = Replica()
    for counter, event in enumerate(events, 1):
        before, version = dict(replica.claims), replica.claim_version
        if isinstance(event, list):
            replica.join(message(COORDINATOR, brief(*map(uav, event)), counter))
        else:
            claim = IDLE if event[1] is None else held(event[1], 0.0)
            replica.join(message(event[0], claim, counter))
            assert (replica.claim_version != version) == (replica.claims != before)
        assert replica.claim_version != version or replica.claims == before

        by_task: dict[str, dict[str, Claim]] = {}
        for name, each in replica.claims.items():
            if each.task is not None:
                by_task.setdefault(each.task, {})[name] = each
        assert replica.claimants == by_task


def test_a_new_life_of_a_writer_beats_any_count_of_the_old_one() -> None:
    old, new = message("u0", held("t0", 0.0), counter=999), message("u0", IDLE, 1, incarnation=2)

    assert joined([new, old]).claims == joined([old, new]).claims == {"u0": IDLE}


def test_stale_statements_are_counted_and_repeated_ones_are_not() -> None:
    old, new = message("u0", IDLE, counter=1), message("u0", held("t0", 0.0), counter=2)
    replica = joined([new, new, old, old])

    assert replica.stale == 2


LARGEST = Stamp(MAX_COUNT, MAX_COUNT)


@given(crowds, crowds, st.sampled_from(["u0", "u1", COORDINATOR, OPERATOR]))
def test_after_a_change_of_keys_any_word_outdoes_those_before(
    before: list[Message], after: list[Message], signer: str
) -> None:
    """Who had the keys may have taken the largest stamps; nobody else is touched by that."""
    before = [replace(m, stamp=LARGEST) if m.writer == signer else m for m in before]
    # Whoever has the new keys says all it has to say, under honest stamps.
    after = [replace(m, stamp=Stamp(m.stamp.incarnation + 1, 1)) for m in after]
    changed = joined(before)
    digest = changed.digest()

    changed.demote_revoked({signer})

    assert changed.digest().keys() == digest.keys()
    assert {w: n for w, n in changed.digest().items() if w != signer} == {
        w: n for w, n in digest.items() if w != signer
    }
    untouched = joined(before)
    assert changed.outcomes == untouched.outcomes, "done stays done"
    assert (changed.brief, changed.board) == (untouched.brief, untouched.board)
    changed.join_all(after)
    renewed = joined([m for m in before if m.writer != signer] + after)
    for register in renewed.messages({signer}):
        assert changed.known(register) == register
    assert list(changed.messages(renewed.writers() - {signer})) == list(
        renewed.messages(renewed.writers() - {signer})
    )
    assert changed.heads.items() >= renewed.heads.items()


def test_a_command_of_who_had_the_keys_gives_way_to_the_next_one() -> None:
    hold = OperatorCommand("u0", CommandKind.HOLD, 1, "")
    forged = Message(MISSION, OPERATOR, LARGEST, hold)
    replica = joined([message(COORDINATOR, brief(uav("u0"))), forged])
    replica.demote_revoked({OPERATOR})
    assert newest_command(replica, "u0") == (Stamp(0, MAX_COUNT), hold)

    resume = OperatorCommand("u0", CommandKind.RESUME, 1, "")
    replica.join(Message(MISSION, OPERATOR, Stamp(5, 1), resume))

    assert newest_command(replica, "u0") == (Stamp(5, 1), resume)


def test_of_what_nobody_stands_for_the_later_word_still_comes_after_the_earlier() -> None:
    hold = OperatorCommand("u0", CommandKind.HOLD, 1, "")
    abort = OperatorCommand(FLEET, CommandKind.ABORT, 1, "")
    now_ms = 1_790_000_000_000
    for (first, *first_said), (second, *second_said) in (
        ((hold, now_ms, 1), (abort, now_ms, 2)),
        ((abort, now_ms, 2), (hold, now_ms + 1, 1)),
    ):
        replica = joined(
            [
                message(COORDINATOR, brief(uav("u0"))),
                Message(MISSION, OPERATOR, Stamp(*first_said), first),
                Message(MISSION, OPERATOR, Stamp(*second_said), second),
            ]
        )
        before = newest_command(replica, "u0")
        replica.demote_revoked({OPERATOR})
        once = newest_command(replica, "u0")
        replica.demote_revoked({OPERATOR})

        assert before is not None
        assert once is not None
        assert once[1] is before[1] is second
        assert once[0].incarnation == 0
        assert newest_command(replica, "u0") == once


def test_a_signature_is_worth_more_than_none_under_what_is_otherwise_the_same() -> None:
    """It can be repeated then, by who could not before."""
    ring, bare = Keyring("u0"), message("u0", done("t0"))
    signed = message("u0", done("t0"))
    as_heard(signed, encode(signed), ring.seal("u0").wrap(encode(signed)))
    replica = joined([bare])
    digest = replica.digest()

    assert not replica.join(signed)
    known = replica.known(bare)
    assert known is not None
    assert known.envelope is not None
    assert replica.digest() == digest
    assert not replica.join(bare)
    assert replica.known(bare) is known


def test_what_another_seat_has_signed_of_the_same_writer_stays() -> None:
    ring = Keyring("u0")
    said = {
        name: as_heard(each, encode(each), ring.seal(name).wrap(encode(each)))
        for name, each in (
            (COORDINATOR, message(COORDINATOR, entry("t0"), 7, 7)),
            ("coordinator-2", message(COORDINATOR, entry("t1"), 7, 7)),
        )
    }
    replica = joined(list(said.values()))

    replica.demote_revoked({"coordinator-2"})

    assert [m.stamp.incarnation for m in replica.messages()] == [7, 0]
    assert replica.heads == {COORDINATOR: Stamp(7, 7)}
