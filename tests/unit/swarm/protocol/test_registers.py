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
from swarm.protocol.messages import (
    Body,
    CommandKind,
    Message,
    MissionConfig,
    OperatorCommand,
    Stamp,
    TaskEdit,
    as_heard,
)
from swarm.protocol.operator_commands import newest_command
from swarm.protocol.register_writer import RegisterWriter
from swarm.protocol.registers import (
    MOST_STRANGE,
    MOST_TASKS,
    MOST_UNBRIEFED,
    MOST_UNPOSTED,
    Replica,
)
from swarm.protocol.uav_messages import Claim
from tests.support.builders import (
    IDLE,
    MISSION,
    OUT,
    brief,
    choice,
    done,
    entry,
    epoch,
    held,
    message,
    order,
    proposed,
    status,
    uav,
)
from tests.support.keyring import Keyring

# Few stamps and contents, so that many statements meet of the same age, or with other contents.
few_stamps = st.builds(Stamp, st.integers(0, 2), st.integers(0, 2))
claims_and_outcomes = st.sampled_from(
    [IDLE, OUT, proposed("t0", 1.0), held("t0", 1.0), held("t1", 2.0), done("t0"), done("t1")]
)
briefs_and_tasks = st.sampled_from(
    [
        brief(uav("u0")),
        brief(uav("u0"), uav("u1", t0=0.5)),
        replace(brief(uav("u0")), run=2),
        epoch("u0", "u1"),
        epoch("u1", "u0"),
        entry("t0"),
        entry("t0", value=7.0),
        entry("t1"),
    ]
)
orders_and_commands = st.sampled_from(
    [
        order("t0"),
        order("t0", withdrawn=True),
        order("t0", run=2, value=3.0),
        order("t2"),
        order("t2", run=2),
        OperatorCommand("u0", CommandKind.HOLD, 1, ""),
    ]
)
statements = st.one_of(
    st.builds(Message, st.just(MISSION), st.just(OPERATOR), few_stamps, orders_and_commands),
    st.builds(Message, st.just(MISSION), st.just(COORDINATOR), few_stamps, briefs_and_tasks),
    st.builds(
        Message,
        st.just(MISSION),
        st.sampled_from(["u0", "u1", "u2"]),
        few_stamps,
        claims_and_outcomes | st.just(status()),
    ),
)
crowds = st.lists(statements, max_size=12)


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
    assert growth(replace(posted, stamp=Stamp(2, 1))) == (0, 0)  # said again, and no other
    assert growth(message(COORDINATOR, entry("t0", value=2.0), 2, incarnation=2)) == (1, 1)
    assert growth(message(COORDINATOR, epoch("u0"))) == (0, 0)
    assert growth(message("u0", IDLE)) == (0, 0)
    assert growth(message("u0", done("t0"))) == (0, 1)


def test_one_answers_for_itself_and_for_those_who_may_not_remember() -> None:
    replica = Replica()
    own, absent = message("u0", IDLE), message("u1", IDLE)
    replica.join_all([own, absent, message("u2", IDLE)])

    assert list(replica.answers("u0", {"u0", "u2"})) == [own, absent]


def test_one_answers_for_what_an_earlier_life_of_somebody_said() -> None:
    """The new life may not have been told; its token may never have been missed."""
    replica = Replica()
    said_before = message("u1", done("t0"), counter=9, incarnation=1)
    replica.join_all([said_before, message("u1", IDLE, incarnation=2)])

    assert list(replica.answers("u0", {"u1"})) == [said_before]


@given(crowds)
def test_heads_are_the_newest_stamps_of_all_writers_whose_registers_are_known(
    said: list[Message],
) -> None:
    replica = joined(said)
    stamps: dict[str, list[Stamp]] = {}
    for known in replica.messages():
        stamps.setdefault(known.writer, []).append(known.stamp)

    assert replica.heads == {writer: max(of_one) for writer, of_one in stamps.items()}


def test_what_is_no_register_changes_nothing() -> None:
    replica = joined([message("u0", held("t0", 1.0))])
    before = replica.digest(), dict(replica.heads)

    assert not replica.join(message("u0", choice("t0"), 9))
    assert not replica.join(message("u0", status(), 10))
    assert (replica.digest(), replica.heads) == before


# -- the operator's word about tasks ------------------------------------------------------


@given(crowds)
def test_the_board_is_the_operators_word_about_this_run_else_the_coordinators(
    said: list[Message],
) -> None:
    """And its versions grow when it changes, and with the brief."""
    replica = Replica()
    for statement in said:
        before, versions = dict(replica.board), (replica.board_version, replica.task_version)
        briefed = replica.join(statement) and isinstance(statement.body, MissionConfig)
        bodies = [message.body for message in replica.messages()]
        run = None if replica.brief is None else replica.brief.run
        orders = {b.task: b for b in bodies if isinstance(b, TaskEdit) and b.run == run}
        assert replica.board.keys() == replica.posted.keys() | orders.keys()
        for task, found in replica.board.items():
            word = orders.get(task, replica.posted.get(task))
            assert word is not None
            assert (found.value, found.withdrawn) == (word.value, word.withdrawn)
        grown = replica.board_version > versions[0]
        assert grown == (before != replica.board or briefed)
        assert not grown or replica.task_version > versions[1]


def test_orders_count_in_the_flight_they_were_given_for_and_in_no_other() -> None:
    said = [message(OPERATOR, order("t0", value=3.0)), message(OPERATOR, order("t1"), 2)]
    replica = joined([message(COORDINATOR, entry("t0")), *said])
    assert replica.board == {"t0": entry("t0")}, "nobody knows which flight this is"

    replica.join(message(COORDINATOR, brief(uav("u0")), 2))
    assert {task: found.value for task, found in replica.board.items()} == {"t0": 3.0, "t1": 1.0}

    replica.join(message(COORDINATOR, replace(brief(uav("u0")), run=2), 3))
    assert replica.board == {"t0": entry("t0")}
    assert list(replica.messages({OPERATOR})) == said


def test_everyone_answers_for_the_operator_whose_seat_is_gone() -> None:
    replica = joined([message("u0", IDLE), message(OPERATOR, order("t0"))])

    assert message(OPERATOR, order("t0")) in list(replica.answers("u0", {"u0", "u1"}))
    assert OPERATOR in replica.digest()


def test_what_the_coordinator_says_of_an_ordered_task_changes_nothing() -> None:
    replica = joined([message(COORDINATOR, brief(uav("u0")))])
    replica.join(message(OPERATOR, order("t0", withdrawn=True)))
    version = replica.board_version

    replica.join(message(COORDINATOR, entry("t0"), 2))

    assert (replica.board["t0"].withdrawn, replica.board_version) == (True, version)
    assert not replica.posted["t0"].withdrawn


def test_who_is_not_briefed_claims_nothing_and_has_done_nothing() -> None:
    """Whoever has keys may speak, but only the fleet takes part; its words are kept for later."""
    stranger, member = message("u9", held("t0", 1.0)), message("u0", held("t1", 1.0))
    said = [stranger, message("u9", done("t0")), member, message("u0", done("t1"))]
    replica = joined(said)
    assert replica.claims.keys() == {"u0", "u9"}, "as long as nobody knows whose mission it is"

    version = replica.task_version
    replica.join(message(COORDINATOR, brief(uav("u0"))))

    assert replica.claims.keys() == {"u0"}
    assert replica.outcomes.keys() == {("u0", "t1")}
    assert replica.task_version > version
    assert replica.register(stranger.key) == stranger
    assert not replica.join(stranger)
    assert replica.join(message("u9", held("t1", 2.0), counter=7))
    assert replica.claims.keys() == {"u0"}

    replica.join(message(COORDINATOR, brief(uav("u0"), uav("u9")), counter=2))

    assert replica.claims["u9"] == held("t1", 2.0)
    assert replica.outcomes.keys() == {("u0", "t1"), ("u9", "t0")}


def test_a_writer_may_tell_of_many_tasks_that_nobody_knows_but_not_of_any_number() -> None:
    replica = Replica()
    tasks = [f"t{n}" for n in range(MOST_UNPOSTED + 50)]
    told = [message("u0", done(task), counter=n + 1) for n, task in enumerate(tasks)]

    taken = sum(replica.join(said) for said in told)

    assert taken == MOST_UNPOSTED
    assert replica.overfull == len(told) - taken
    assert replica.join(message("u1", done("t9"))), "others have room of their own"
    replica.join(message(COORDINATOR, entry(tasks[-1])))
    assert replica.join(told[-1]), "what is on the board always has"


# -- made-up names -----------------------------------------------------------------------


def made_up(count: int, first: int = 0) -> list[Message]:
    """Claims, outcomes and commands under names of which nobody knows."""
    kinds = [
        lambda name: message(name, held("t0", 1.0)),
        lambda name: message(name, done("t0")),
        lambda name: message(OPERATOR, OperatorCommand(name, CommandKind.HOLD, 1, "")),
    ]
    return [kinds[n % 3](f"ghost{n}") for n in range(first, first + count)]


def size(replica: Replica) -> int:
    return sum(1 for _ in replica.messages())


def test_made_up_names_take_a_bounded_room_and_what_has_none_is_counted() -> None:
    replica = joined([message(COORDINATOR, brief(uav("u0"), uav("u1"))), *made_up(48_000)])

    assert size(replica) == 1 + MOST_STRANGE
    assert replica.overfull == 48_000 - MOST_STRANGE
    assert len(replica.heads) <= 2 + MOST_STRANGE
    assert len(replica.digest()) <= 2 + MOST_STRANGE
    assert len(replica.commands) <= MOST_STRANGE


def test_a_flood_of_made_up_names_shuts_out_nobody_of_the_fleet() -> None:
    replica = joined(
        [
            message(COORDINATOR, brief(uav("u0"))),
            message(COORDINATOR, entry("t0"), 2),
            *made_up(3 * MOST_STRANGE),
        ]
    )
    hold = OperatorCommand("u0", CommandKind.HOLD, 1, "")
    abort = OperatorCommand(FLEET, CommandKind.ABORT, 1, "")
    honest = [message("u0", held("t0", 1.0)), message("u0", done("t0"), 2)]
    honest += [message(OPERATOR, hold), message(OPERATOR, abort, 2)]
    honest += [message(COORDINATOR, entry("t1"), 3), message(OPERATOR, order("op"), 3)]

    assert all(replica.join(said) for said in honest)
    assert replica.claims.keys() == {"u0"}


def test_words_of_strangers_already_known_are_kept_up_to_date() -> None:
    replica = joined([message(COORDINATOR, brief(uav("u0"))), *made_up(2 * MOST_STRANGE)])

    assert replica.join(message("ghost0", held("t0", 2.0), counter=2))
    assert not replica.join(message("ghost0", done("t9"))), "but there is no room for further ones"


def test_before_the_brief_there_is_room_for_any_fleet_and_with_it_the_strangers_go() -> None:
    fleet = [uav(f"ghost{n}") for n in range(0, 2 * MOST_STRANGE, 2)]
    replica = joined(made_up(MOST_UNBRIEFED + 10))
    assert size(replica) == MOST_UNBRIEFED
    assert replica.overfull == 10
    replica.digest()

    replica.join(message(COORDINATOR, brief(*fleet)))

    names = {each.id for each in fleet}
    assert {uav for uav, _ in replica.outcomes} | replica.claims.keys() <= names
    assert set(replica.commands) >= {name for name in names if int(name[5:]) % 3 == 2}
    strange = [said for said in made_up(MOST_UNBRIEFED) if replica.known(said) is not None]
    briefed = len(fleet)
    assert len(strange) == briefed + MOST_STRANGE
    assert size(replica) == 1 + briefed + MOST_STRANGE
    fresh = joined(list(replica.messages()))
    assert (fresh.digest(), fresh.heads) == (replica.digest(), replica.heads)
    assert (fresh.claims, fresh.outcomes, fresh.commands) == (
        replica.claims,
        replica.outcomes,
        replica.commands,
    )


def test_briefs_that_name_ever_other_uavs_leave_no_more_behind() -> None:
    replica = Replica()
    for flight in range(6):
        names = [f"f{flight}-{n}" for n in range(MOST_STRANGE)]
        replica.join(message(COORDINATOR, brief(*map(uav, names)), counter=flight + 1))
        assert all(replica.join(message(name, IDLE)) for name in names)
    assert size(replica) == 1 + 2 * MOST_STRANGE


def test_made_up_tasks_take_a_bounded_room() -> None:
    replica = joined([message(COORDINATOR, entry(f"t{n}"), 1 + n) for n in range(MOST_TASKS + 7)])

    assert (len(replica.board), replica.overfull) == (MOST_TASKS, 7)
    assert not replica.join(message(OPERATOR, order("op")))
    assert replica.join(message(COORDINATOR, entry("t0", withdrawn=True), MOST_TASKS + 9))
