"""Replicas that hold the same statements share arrays, and arrays made from others are the same."""

from __future__ import annotations

import gc
from dataclasses import replace
from random import Random
from weakref import ref

import numpy as np
import pytest

from swarm.allocation.problem import Problem
from swarm.model.ids import COORDINATOR
from swarm.protocol.board import TaskBoard, after_outcomes, mission_of
from swarm.protocol.board_arrays import BoardArraysCache
from swarm.protocol.messages import Message, TaskEntry
from swarm.protocol.registers import Replica
from tests.support.builders import MISSION, brief, done, entry, message, uav

FLEET = (uav("u0", t1=0.5), uav("u1", east_m=5.0, speed_m_s=2.0), uav("u2"))


def board_of(*said: Message) -> TaskBoard:
    board = TaskBoard(Replica(), MISSION)
    board.replica.join_all(said)
    return board


def assert_same(found: Problem, wanted: Problem) -> None:
    assert (found.uav_ids, found.task_ids) == (wanted.uav_ids, wanted.task_ids)
    assert found.column_of == {task: column for column, task in enumerate(wanted.task_ids)}
    for name in ("task_enu_m", "value", "service_s", "success", "survival", "speed_m_s", "weight"):
        np.testing.assert_array_equal(getattr(found, name), getattr(wanted, name))


def test_boards_of_the_same_statements_share_one_problem_and_others_have_an_equal_one() -> None:
    said = [
        message(COORDINATOR, brief(*FLEET), 1),
        message(COORDINATOR, entry("t0", 1.0), 2),
        message(COORDINATOR, entry("t1", 2.0, number=1), 3),
    ]
    first, second = board_of(*said), board_of(*said)
    told_apart = [message(each.writer, each.body, each.stamp.counter) for each in said]
    again = [
        message(COORDINATOR, brief(*FLEET), 1),
        message(COORDINATOR, entry("t0", 1.0), 2),
        message(COORDINATOR, entry("t1", 2.0, number=1), 3),
    ]
    other = board_of(*again)

    assert first.problem is not None
    assert second.problem is first.problem
    assert board_of(*told_apart).problem is first.problem  # the contents are the same objects
    assert other.problem is not None
    assert other.problem is not first.problem
    assert_same(other.problem, first.problem)


@pytest.mark.parametrize("seed", range(10))
def test_arrays_made_from_earlier_ones_are_those_made_anew(seed: int) -> None:
    random = Random(seed)
    board = board_of(message(COORDINATOR, brief(*FLEET), 1))
    for counter in range(2, 20):
        task, number = f"t{random.randint(0, 9)}", random.randint(0, 5)
        posted = entry(task, random.random(), number, withdrawn=random.random() < 0.2)
        board.replica.join(message(COORDINATOR, posted, counter))
        told = board.replica.brief
        if random.random() < 0.5 and told is not None:
            found = board.problem
            assert found is not None
            assert_same(found, Problem.from_mission(mission_of(board.replica, MISSION, told)))


def test_a_board_lets_go_of_arrays_that_are_old() -> None:
    board = board_of(message(COORDINATOR, brief(*FLEET), 1), message(COORDINATOR, entry("t0"), 2))
    first = board.problem
    assert first is not None
    old = ref(first)
    del first
    other = board_of(*board.replica.messages(), message(COORDINATOR, entry("t1", number=1), 3))
    assert other.problem is not None  # the newest of this process

    board.replica.join(message(COORDINATOR, entry("t2", number=2), 3))
    assert board.unfinished
    gc.collect()
    assert old() is None


def test_arrays_that_nobody_uses_are_given_back() -> None:
    cache, told = BoardArraysCache(), brief(*FLEET)
    entries: list[TaskEntry] = []
    kept = []
    for number in range(5):
        entries.append(entry(f"t{number}", number=number))
        kept.append(cache.of(MISSION, told, entries, {}))
        assert cache.of(MISSION, told, entries, {}) is kept[-1]
    assert cache.n_known == 5

    del kept
    gc.collect()
    assert cache.n_known == 1


@pytest.mark.parametrize("seed", range(10))
def test_the_team_stands_where_its_attempts_taken_one_by_one_leave_it(seed: int) -> None:
    random = Random(seed)
    fleet = [uav(f"u{row}", east_m=random.random()) for row in range(3)]
    posted = [entry(f"t{k}", random.random(), random.randint(0, 3)) for k in range(6)]
    board = board_of(message(COORDINATOR, replace(brief(*fleet), survival_default=0.9), 1))
    withdrawn = replace(posted[0], withdrawn=True)
    told = [*((2 * row, each) for row, each in enumerate(posted)), (8, withdrawn)]
    for counter in range(12):
        for said, (when, each) in enumerate(told):
            if when == counter:
                board.replica.join(message(COORDINATOR, each, 2 + said))
        ended = done(f"t{random.randint(0, 6)}", completed_s=float(random.randint(0, 4)))
        board.replica.join(message(f"u{random.randint(0, 2)}", ended, counter + 1))
        problem = board.problem
        assert problem is not None
        rows, columns = problem.row_of, problem.column_of
        place_m, free_s = problem.start_enu_m.copy(), np.zeros(problem.n_uav)
        survived = np.ones(problem.n_uav)
        for ended_s, column, row in sorted(
            (outcome.completed_s, columns[task], rows[name])
            for (name, task), outcome in board.replica.outcomes.items()
            if task in columns
        ):
            free_s[row], place_m[row] = ended_s, problem.task_enu_m[column]
            survived[row] *= problem.survival[row, column]

        state = after_outcomes(problem, board)

        np.testing.assert_array_equal(state.free_s, free_s)
        np.testing.assert_array_equal(state.place_enu_m, place_m)
        np.testing.assert_array_equal(state.survived, survived)
