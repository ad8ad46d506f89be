"""What a replica tells of its registers, and how much it has room for."""

from __future__ import annotations

from dataclasses import replace
from random import Random

import pytest
from hypothesis import given

from swarm.model.ids import COORDINATOR, FLEET, OPERATOR
from swarm.protocol.messages import (
    Body,
    CommandKind,
    Message,
    MissionConfig,
    OperatorCommand,
    Stamp,
    TaskEdit,
)
from swarm.protocol.registers import (
    MOST_STRANGE,
    MOST_TASKS,
    MOST_UNBRIEFED,
    MOST_UNPOSTED,
    Replica,
)
from tests.support.builders import (
    IDLE,
    brief,
    choice,
    done,
    entry,
    epoch,
    held,
    message,
    order,
    status,
    uav,
)
from tests.support.crowds import crowds, joined


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


@pytest.mark.parametrize("seed", range(5))
def test_an_answer_that_was_kept_is_what_would_be_answered_anew(seed: int) -> None:
    random, said, replica = Random(seed), list[Message](), Replica()
    writers = ["u0", "u1", "u2"]
    bodies: list[Body] = [held("t0", 2.0), done("t0"), done("t1"), IDLE]
    for counter in range(1, 60):
        if random.random() < 0.4:
            word = message(
                random.choice(writers),
                random.choice(bodies),
                counter,
                incarnation=random.randint(1, 2),
            )
            said.append(word)
            replica.join(word)
        fresh = Replica()
        fresh.join_all(said)
        if random.random() < 0.2:
            revoked = {random.choice(writers)}
            replica.demote_revoked(revoked)
            said = list(replica.messages())
            fresh = joined(said)
        own, steady = random.choice(writers), set(random.sample(writers, 2))
        assert replica.answers(own, steady) == fresh.answers(own, steady)
        assert replica.answers(own, steady) == answered_plainly(replica, own, steady)


def answered_plainly(replica: Replica, own: str, steady: set[str]) -> tuple[Message, ...]:
    """By looking at every register."""
    lives = {writer: stamp.incarnation for writer, stamp in replica.heads.items()}
    return tuple(
        said
        for said in replica.messages()
        if said.writer == own
        or said.writer not in steady
        or said.stamp.incarnation < lives[said.writer]
    )
