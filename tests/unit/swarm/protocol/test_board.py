"""What became of each task, and the mission that the registers describe."""

from __future__ import annotations

from dataclasses import replace
from random import Random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarm.model.ids import COORDINATOR, OPERATOR
from swarm.protocol.board import TaskBoard, TaskState, anything_doable
from swarm.protocol.messages import Body, Message, TaskEntry
from swarm.protocol.registers import Replica
from tests.support.builders import (
    IDLE,
    MISSION,
    OUT,
    brief,
    done,
    entry,
    epoch,
    failed,
    held,
    message,
    order,
    uav,
)
from tests.support.message_strategies import messages

FLEET = (uav("u0"), uav("u1", east_m=5.0, t0=0.5))


class Registers:
    """A replica to which statements are made in order."""

    def __init__(self, *said: tuple[str, Body]) -> None:
        self.replica = Replica()
        self.board = TaskBoard(self.replica, MISSION)
        self._counter = 0
        self.say(COORDINATOR, brief(*FLEET))
        for writer, body in said:
            self.say(writer, body)

    def say(self, writer: str, body: Body) -> None:
        self._counter += 1
        self.replica.join(message(writer, body, self._counter))

    def post(self, *entries: TaskEntry) -> None:
        for posted in entries:
            self.say(COORDINATOR, posted)

    def state(self) -> TaskState:
        return self.board.states["t0"]


def test_a_posted_task_is_open_also_while_it_is_claimed() -> None:
    registers = Registers((COORDINATOR, entry("t0")), ("u0", held("t0", 0.0)))

    assert registers.state() is TaskState.OPEN


def test_a_visit_that_succeeded_makes_a_task_done_for_good() -> None:
    registers = Registers((COORDINATOR, entry("t0")), ("u0", done("t0")))
    assert registers.state() is TaskState.DONE

    registers.say("u1", failed("t0"))
    registers.post(entry("t0", withdrawn=True))
    assert registers.state() is TaskState.DONE


def test_a_failed_attempt_ends_a_task_unless_it_may_be_tried_again() -> None:
    registers = Registers((COORDINATOR, entry("t0")), ("u0", failed("t0")))
    assert registers.state() is TaskState.FAILED

    registers.say(COORDINATOR, brief(*FLEET, reattempt_failed=True))
    assert registers.state() is TaskState.OPEN

    registers.say("u0", done("t0", attempt=2))
    assert registers.state() is TaskState.DONE


def test_a_withdrawn_task_may_come_back() -> None:
    registers = Registers((COORDINATOR, entry("t0", withdrawn=True)))
    assert registers.state() is TaskState.WITHDRAWN

    registers.post(entry("t0"))
    assert registers.state() is TaskState.OPEN


def test_the_operator_adds_withdraws_and_brings_back_tasks() -> None:
    registers = Registers((COORDINATOR, entry("t0", number=1)))
    registers.say(OPERATOR, order("op1", east_m=7.0, number=0))
    problem = registers.board.problem
    assert problem is not None
    assert problem.task_ids == ("op1", "t0")
    np.testing.assert_array_equal(problem.task_enu_m[0], [7.0, 0.0, 0.0])
    assert registers.board.states == {"op1": TaskState.OPEN, "t0": TaskState.OPEN}

    registers.say(OPERATOR, order("t0", withdrawn=True))
    assert registers.state() is TaskState.WITHDRAWN
    registers.post(entry("t0", number=1))
    assert registers.state() is TaskState.WITHDRAWN

    registers.say(OPERATOR, order("t0"))
    assert registers.state() is TaskState.OPEN


def test_in_another_flight_what_the_operator_added_is_gone() -> None:
    registers = Registers((COORDINATOR, entry("t0")), (OPERATOR, order("op1")))
    assert registers.board.problem is not None

    registers.say(OPERATOR, order("op1", run=2))
    problem = registers.board.problem
    assert problem is not None
    assert (problem.task_ids, list(registers.board.states)) == (("t0",), ["t0"])


def test_outcomes_of_tasks_that_are_not_posted_make_no_task() -> None:
    registers = Registers(("u0", done("t9")))

    assert registers.board.states == {}


def test_tasks_stand_in_the_order_of_their_numbers_then_ids() -> None:
    registers = Registers()
    registers.post(entry("t2", number=1), entry("t0", number=1), entry("t1", number=0))
    problem = registers.board.problem

    assert problem is not None
    assert problem.task_ids == ("t1", "t0", "t2")


def test_the_problem_holds_the_brief_and_every_posted_task() -> None:
    registers = Registers()
    registers.post(entry("t0", east_m=3.0, value=2.0, service_s=1.5))
    problem = registers.board.problem

    assert problem is not None
    assert problem.uav_ids == ("u0", "u1")
    np.testing.assert_array_equal(problem.success, [[1.0], [0.5]])
    np.testing.assert_array_equal(problem.task_enu_m, [[3.0, 0.0, 0.0]])
    np.testing.assert_array_equal((problem.value, problem.service_s), [[2.0], [1.5]])


def test_there_is_no_problem_before_the_brief() -> None:
    board = TaskBoard(Replica(), MISSION)
    board.replica.join(message(COORDINATOR, entry("t0")))

    assert board.problem is None
    assert board.states == {"t0": TaskState.OPEN}


def test_what_was_worked_out_is_kept_until_something_changes() -> None:
    registers = Registers((COORDINATOR, entry("t0")))
    problem, states = registers.board.problem, registers.board.states

    registers.say("u0", held("t0", 0.0))
    registers.say(COORDINATOR, epoch("u0", "u1"))
    assert registers.board.problem is problem
    assert registers.board.states is states

    registers.say("u0", done("t0"))
    assert registers.board.problem is problem
    assert registers.board.states == {"t0": TaskState.DONE}

    registers.post(entry("t1"))
    later = registers.board.problem
    assert later is not None
    assert later.task_ids == ("t0", "t1")

    registers.say(COORDINATOR, brief(FLEET[0]))
    later = registers.board.problem
    assert later is not None
    assert later.uav_ids == ("u0",)


@given(st.lists(messages(), max_size=10))
def test_what_is_kept_equals_what_a_fresh_look_finds(said: list[Message]) -> None:
    replica = Replica()
    board = TaskBoard(replica, MISSION)
    for statement in said:
        replica.join(statement)
        fresh = TaskBoard(replica, MISSION)
        assert board.states == fresh.states
        assert (board.problem is None) == (fresh.problem is None)
        if board.problem is not None and fresh.problem is not None:
            assert board.problem.task_ids == fresh.problem.task_ids


@given(
    st.lists(
        st.builds(
            lambda writer, task, outcome: (writer, outcome(task)),
            st.sampled_from(["u0", "u1"]),
            st.sampled_from(["t0", "t1", "t2"]),
            st.sampled_from([done, failed]),
        )
        | st.builds(
            lambda task, withdrawn: (COORDINATOR, entry(task, withdrawn=withdrawn)),
            st.sampled_from(["t0", "t1", "t2"]),
            st.booleans(),
        ),
        max_size=12,
    ),
    st.data(),
)
def test_however_often_one_looks_tasks_end_as_the_last_look_alone_finds(
    said: list[tuple[str, Body]], data: st.DataObject
) -> None:
    registers = Registers((COORDINATOR, entry("t0")), (COORDINATOR, entry("t1")))

    for writer, body in said:
        registers.say(writer, body)
        if data.draw(st.booleans()):
            _ = registers.board.states

    fresh = TaskBoard(registers.replica, MISSION)
    assert list(registers.board.states.items()) == list(fresh.states.items())
    assert registers.board.unfinished == fresh.unfinished


def test_a_brief_that_adds_a_uav_whose_outcome_is_known_counts_all_of_its_outcomes() -> None:
    registers = Registers((COORDINATOR, brief(FLEET[0])), (COORDINATOR, entry("t0")))
    registers.post(entry("t1"))
    registers.say("u1", done("t0"))
    registers.say("u0", done("t1"))
    assert registers.board.states == {"t0": TaskState.OPEN, "t1": TaskState.DONE}

    registers.say(COORDINATOR, brief(*FLEET))
    assert registers.board.states == {"t0": TaskState.DONE, "t1": TaskState.DONE}


def any_statements(random: Random) -> list[Message]:
    """Statements of all kinds that bear on what became of tasks, several of some registers."""

    def body() -> tuple[str, Body]:
        name = random.choice(["t0", "t1", "op"])
        match random.choice(["brief", "entry", "order", "outcome", "outcome", "outcome"]):
            case "brief":
                fleet = random.sample([uav("u0"), uav("u1"), uav("u2")], random.randint(0, 3))
                told = brief(*fleet, reattempt_failed=random.random() < 0.3)
                return COORDINATOR, replace(told, run=random.choice([1, 1, 2]))
            case "entry":
                withdrawn, number = random.random() < 0.2, random.randint(0, 3)
                return COORDINATOR, entry(name, 0.0, number, withdrawn=withdrawn)
            case "order":
                withdrawn, run = random.random() < 0.3, random.randint(1, 2)
                return OPERATOR, order(name, run=run, withdrawn=withdrawn)
            case _:
                outcome = random.choice([done, failed])(name, attempt=random.randint(1, 2))
                return random.choice(["u0", "u1", "u2", "stranger"]), outcome

    said = [body() for _ in range(random.randint(1, 16))]
    return [message(writer, body, counter) for counter, (writer, body) in enumerate(said, 1)]


@pytest.mark.parametrize("seed", range(20))
def test_equal_registers_give_equal_boards_whatever_order_they_came_in(seed: int) -> None:
    random = Random(seed)
    for _ in range(60):
        said = any_statements(random)
        first = TaskBoard(Replica(), MISSION)
        first.replica.join_all(said)

        shuffled = said + random.sample(said, len(said) // 2)
        random.shuffle(shuffled)
        other = TaskBoard(Replica(), MISSION)
        for statement in shuffled:
            other.replica.join(statement)
            if random.random() < 0.5:  # what was seen on the way must not matter
                assert other.unfinished == (TaskState.OPEN in other.states.values())
                _ = other.problem

        assert list(other.replica.messages()) == list(first.replica.messages())
        assert other.states == first.states
        assert (other.open, other.attempts.of_uav) == (first.open, first.attempts.of_uav)
        assert other.unfinished == first.unfinished
        assert (other.problem is None) == (first.problem is None)
        if other.problem is not None and first.problem is not None:
            assert other.problem.uav_ids == first.problem.uav_ids
            assert other.problem.task_ids == first.problem.task_ids
            np.testing.assert_array_equal(other.problem.success, first.problem.success)


def test_doable_is_what_someone_who_takes_part_or_may_yet_is_capable_of() -> None:
    fleet = uav("u0", t1=0.0), uav("u1", t0=0.0), uav("u2")
    registers = Registers((COORDINATOR, brief(*fleet)))
    registers.post(entry("t0"), entry("t1", number=1), entry("t2", number=2))
    for name in ("u0", "u1"):
        registers.say(name, IDLE)

    def found(*present: str) -> bool:
        return anything_doable(registers.board, present)

    assert found("u0", "u1", "u2")
    assert found("u0")
    assert found("u2")  # it has said nothing yet
    assert not found()
    registers.say("u2", OUT)
    assert not found("u2")
    registers.say("u1", done("t2"))
    registers.say("u1", done("t0"))
    assert found("u0", "u1")
    assert not found("u0")
    registers.say("u1", done("t1"))
    assert not found("u0", "u1")


def test_nothing_is_doable_before_the_brief() -> None:
    assert not anything_doable(TaskBoard(Replica(), MISSION), ["u0"])
