"""Tasks that a mission should have done: all of schema 1, of schema 2 those that can be done."""

from __future__ import annotations

from dataclasses import replace

import pytest

from coordinator.mission_view.missed import missed_tasks
from coordinator.mission_view.results import MissionResult
from swarm.model import Base, BaseId, Mission, Task, TaskId, Uav, UavId

NEAR = Task(TaskId("t0"), (50.0, 0.0, 0.0), 1.0)
UAV = Uav(UavId("u0"), (0.0, 0.0, 0.0), 10.0, endurance_s=40.0, reserve_frac=0.2)
PLAIN_UAV = Uav(UavId("u0"), (0.0, 0.0, 0.0), 10.0)


def result(
    open_tasks: tuple[str, ...], failed: tuple[str, ...] = (), added: tuple[str, ...] = ()
) -> MissionResult:
    names = [tuple(map(TaskId, each)) for each in (failed, open_tasks, added)]
    return MissionResult(
        executed_routes={},
        executed_completion_s={},
        executed_objective=0.0,
        done=(),
        failed=names[0],
        open=names[1],
        duplicate_visits=0,
        makespan_s=0.0,
        lost_uavs=(),
        epochs=1,
        added=names[2],
    )


def mission(*tasks: Task, uav: Uav = UAV, bases: tuple[Base, ...] = ()) -> Mission:
    return Mission("m", 1000.0, (uav,), tasks, bases=bases, schema=2)


def missed(task: Task, uav: Uav = UAV, *bases: Base) -> bool:
    return missed_tasks(mission(task, uav=uav, bases=bases), result((task.id,))) == (task.id,)


def test_of_schema_1_it_is_all_that_is_open_or_has_failed() -> None:
    plain = replace(mission(replace(NEAR, value=2.0), uav=PLAIN_UAV), schema=1)

    assert missed_tasks(plain, result(("t0",), failed=("t9",))) == ("t9", "t0")
    assert missed_tasks(plain, result(())) == ()


@pytest.mark.parametrize("uav", [PLAIN_UAV, UAV], ids=["plain", "field"])
def test_a_task_within_reach_is_missed_unless_it_has_a_due_time(uav: Uav) -> None:
    assert missed(NEAR, uav)
    assert not missed(replace(NEAR, due_s=500.0), uav)
    assert not missed(NEAR, replace(uav, success={"t0": 0.0}))


@pytest.mark.parametrize(
    "task",
    [
        pytest.param(replace(NEAR, position_enu_m=(200.0, 0.0, 0.0)), id="energy"),
        pytest.param(replace(NEAR, closes_s=4.0), id="closes"),
        pytest.param(replace(NEAR, closes_s=10.0, appears_s=20.0), id="appears"),
        pytest.param(replace(NEAR, opens_s=100.0), id="opens"),
    ],
)
def test_a_task_that_nobody_can_do_may_be_left_out(task: Task) -> None:
    assert not missed(task)


def test_a_base_brings_it_within_reach() -> None:
    far = replace(NEAR, position_enu_m=(200.0, 0.0, 0.0))
    on_the_way = Base(BaseId("b0"), (150.0, 0.0, 0.0), swap_s=10.0, slots=1)

    assert not missed(far)
    assert missed(far, UAV, on_the_way)
    assert missed(replace(NEAR, opens_s=100.0), UAV, on_the_way)


def test_they_are_told_in_the_missions_order_and_what_was_added_last() -> None:
    other = replace(NEAR, id=TaskId("t1"))
    tasks = mission(NEAR, other)

    undone = result(("x0", "t1"), failed=("t0",), added=("x0",))
    assert missed_tasks(tasks, undone) == ("t0", "t1", "x0")
