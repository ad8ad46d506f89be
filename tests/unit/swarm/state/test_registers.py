"""Joining replicas: any order, any grouping, any repetition, one result."""

from __future__ import annotations

from dataclasses import replace
from random import Random

from hypothesis import given, settings
from hypothesis import strategies as st

from swarm.model.ids import COORDINATOR
from swarm.state.registers import Replica
from swarm.wire.codec import key_of
from swarm.wire.messages import Message, Stamp
from tests.builders import IDLE, brief, done, entry, epoch, held, message, status, uav
from tests.message_strategies import messages

# Few stamps, so that many statements meet of the same age, with other contents too.
few_stamps = st.builds(Stamp, st.integers(0, 1), st.integers(0, 2))
crowds = st.lists(messages(few_stamps), max_size=12)


def joined(said: list[Message]) -> Replica:
    replica = Replica()
    for statement in said:
        replica.join(statement)
    return replica


def contents(replica: Replica) -> tuple[object, ...]:
    """Everything that anyone reads off a replica."""
    return (
        list(replica.messages()),
        replica.brief,
        replica.epoch,
        replica.board,
        replica.claims,
        replica.outcomes,
    )


@given(crowds, st.randoms(use_true_random=False))
def test_any_order_gives_the_same_registers(said: list[Message], random: Random) -> None:
    shuffled = list(said)
    random.shuffle(shuffled)

    assert contents(joined(said)) == contents(joined(shuffled))


@settings(max_examples=50)
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
        key = key_of(statement)
        assert known.stamp >= max(newest.get(key, known.stamp), statement.stamp)
        assert not was_news or known == statement
        newest[key] = known.stamp


def test_a_new_life_of_a_writer_beats_any_count_of_the_old_one() -> None:
    old, new = message("u0", held("t0", 0.0), counter=999), message("u0", IDLE, 1, incarnation=2)

    assert joined([new, old]).claims == joined([old, new]).claims == {"u0": IDLE}


def test_stale_statements_are_counted_and_repeated_ones_are_not() -> None:
    old, new = message("u0", IDLE, counter=1), message("u0", held("t0", 0.0), counter=2)
    replica = joined([new, new, old, old])

    assert replica.stale == 2


def test_status_is_no_register() -> None:
    replica = Replica()

    assert not replica.join(message("u0", status()))
    assert list(replica.messages()) == []
    assert replica.writers() == set()


def test_outcomes_of_one_uav_at_several_tasks_stand_side_by_side() -> None:
    replica = joined([message("u0", done("t0"), 1), message("u0", done("t1"), 2)])

    assert set(replica.outcomes) == {("u0", "t0"), ("u0", "t1")}


def test_registers_are_given_by_writer() -> None:
    said = [
        message(COORDINATOR, brief(uav("u0"))),
        message(COORDINATOR, epoch("u0"), 2),
        message(COORDINATOR, entry("t0"), 3),
        message("u0", IDLE),
        message("u1", IDLE),
    ]
    replica = joined(said)

    assert replica.writers() == {COORDINATOR, "u0", "u1"}
    assert list(replica.messages({"u1"})) == [said[4]]
    assert {m.writer for m in replica.messages({COORDINATOR, "u0"})} == {COORDINATOR, "u0"}
    assert len(list(replica.messages())) == 5


def test_versions_grow_only_with_what_they_are_about() -> None:
    replica = Replica()

    def growth(statement: Message) -> tuple[int, int]:
        before = (replica.board_version, replica.task_version)
        replica.join(statement)
        return replica.board_version - before[0], replica.task_version - before[1]

    posted = message(COORDINATOR, entry("t0"))
    assert growth(message(COORDINATOR, brief(uav("u0")))) == (1, 1)
    assert growth(posted) == (1, 1)
    assert growth(posted) == (0, 0)
    assert growth(replace(posted, stamp=Stamp(2, 1))) == (1, 1)
    assert growth(message(COORDINATOR, epoch("u0"))) == (0, 0)
    assert growth(message("u0", IDLE)) == (0, 0)
    assert growth(message("u0", done("t0"))) == (0, 1)
