"""What pays best from where a UAV is, kept up to date as tasks come and go."""

from __future__ import annotations

import math
from random import Random

import pytest

from swarm.model.ids import COORDINATOR
from swarm.protocol.board import TaskBoard, TaskState
from swarm.protocol.open_tasks import OpenTasks
from swarm.protocol.registers import Replica
from tests.support.builders import MISSION, brief, done, entry, failed, message, uav


@pytest.mark.parametrize("seed", range(10))
def test_as_many_pay_better_as_are_found_one_by_one(seed: int) -> None:
    random = Random(seed)
    board = TaskBoard(Replica(), MISSION)
    board.replica.join(message(COORDINATOR, brief(uav("u0"), uav("u1")), 1))
    open_tasks = OpenTasks(board)
    names = [f"t{number}" for number in range(100)]
    for counter in range(2, 200):
        name = random.choice(names)
        if random.random() < 0.7:
            posted = entry(
                name,
                random.uniform(-9.0, 9.0),
                random.randint(0, 99),
                value=random.random(),
                service_s=float(random.randint(0, 2)),
                withdrawn=random.random() < 0.1,
            )
            board.replica.join(message(COORDINATOR, posted, counter))
        else:
            ended = random.choice([done, failed])(name)
            board.replica.join(message(random.choice(["u0", "u1"]), ended, counter))
        if random.random() < 0.3 and board.states:
            task = random.choice(list(board.states))
            from_m = random.uniform(-9.0, 9.0), 1.0, 0.0
            found = open_tasks.n_better(task, from_m, 2.0)
            assert found == better_one_by_one(board, task, from_m, 2.0)


def better_one_by_one(
    board: TaskBoard, task: str, from_m: tuple[float, float, float], speed_m_s: float
) -> int:
    def per_s(name: str) -> float:
        told = board.replica.board[name]
        away_m = math.dist(told.position_enu_m, from_m)
        return told.value / (away_m / speed_m_s + told.service_s)

    is_open = [name for name, state in board.states.items() if state is TaskState.OPEN]
    return sum(per_s(name) > per_s(task) for name in is_open)


def test_of_two_alike_none_pays_better_and_what_is_done_no_more() -> None:
    board = TaskBoard(Replica(), MISSION)
    board.replica.join(message(COORDINATOR, brief(uav("u0")), 1))
    for counter, posted in enumerate([entry("t0", 4.0), entry("t1", -4.0), entry("t2", 1.0)], 2):
        board.replica.join(message(COORDINATOR, posted, counter))
    open_tasks = OpenTasks(board)
    assert open_tasks.n_better("t0", (0.0, 0.0, 0.0), 1.0) == 1

    board.replica.join(message("u0", done("t2"), 1))
    assert open_tasks.n_better("t0", (0.0, 0.0, 0.0), 1.0) == 0
    assert open_tasks.n_better("t2", (0.0, 0.0, 0.0), 1.0) == 0
