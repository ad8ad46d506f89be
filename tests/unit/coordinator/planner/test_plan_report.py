from __future__ import annotations

import io
from dataclasses import replace

from rich.console import Console

from coordinator.planner.plan import make_plan
from coordinator.planner.plan_report import late_tasks, plan_as_json, plan_table
from swarm.model import Mission, Plan
from swarm.runtime.clock import SystemClock
from tests.support.problems import table_1_mission


def shown(mission: Mission, plan: Plan, width: int = 80) -> str:
    console = Console(width=width, file=io.StringIO(), highlight=False)
    console.print(plan_table(mission, plan))
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue()


def plan_of(mission: Mission, method: str = "greedy") -> Plan:
    return make_plan(mission, method, clock=SystemClock())


def test_json_holds_plain_lists_and_numbers() -> None:
    plan = plan_of(table_1_mission())

    found = plan_as_json(plan)

    assert found["sequence"] == ["uav1", "uav3", "uav2"]
    assert found["routes"] == {uav: list(tasks) for uav, tasks in plan.routes.items()}
    assert found["objective"] == plan.objective
    assert plan_as_json(replace(plan, optimum=None))["gap"] is None


def test_every_task_stands_beside_its_completion() -> None:
    text = shown(table_1_mission(), plan_of(table_1_mission()))

    assert "t2@0.90 t3@2.18" in text
    assert "118.4939" in text
    assert "gap 1.53 %" in text
    assert "late" not in text


def test_tasks_after_the_horizon_are_named_latest_first() -> None:
    mission = replace(table_1_mission(), horizon_s=2.0)
    plan = plan_of(mission)

    late = late_tasks(mission, plan)

    assert late
    assert late == sorted(late, key=lambda task: -plan.completion_s[task])
    assert all((plan.completion_s[task] > 2.0) == (task in late) for task in plan.completion_s)
    assert f"{late[0]}@{plan.completion_s[late[0]]:.2f}!" in shown(mission, plan)


def test_pop_ups_and_idle_uavs_are_mentioned() -> None:
    mission = table_1_mission()
    tasks = tuple(replace(task, appears_s=1.0) for task in mission.tasks[1:])
    mission = replace(mission, tasks=(mission.tasks[0], *tasks))

    text = shown(mission, plan_of(mission))

    assert "7 tasks appear later" in text
    assert "–" in text


def test_unproven_optimum_is_not_claimed() -> None:
    plan = replace(plan_of(table_1_mission()), optimum=None)

    assert "not proven" in shown(table_1_mission(), plan)


def test_long_names_wrap_between_tasks() -> None:
    mission = table_1_mission()
    renamed = tuple(
        replace(task, id=type(task.id)(f"a-rather-long-name-of-task-{task.id}"))
        for task in mission.tasks
    )
    mission = replace(mission, tasks=renamed)
    plan = plan_of(mission)

    text = shown(mission, plan)

    for task, time_s in plan.completion_s.items():
        assert f"{task}@{time_s:.2f}" in text
    assert max(len(line) for line in text.splitlines()) <= 80
