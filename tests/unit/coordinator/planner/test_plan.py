from __future__ import annotations

from dataclasses import replace

import pytest

from coordinator.planner.exact import ProblemTooLargeError
from coordinator.planner.options import Limit, after_evaluations, after_time
from coordinator.planner.plan import METHODS, make_plan
from sim.study.generator import mission_of, random_mission
from swarm.model import Mission, Task, TaskId, Uav, UavId
from tests.support.problems import table_1_mission


class TickingClock:
    """Each reading is a second later."""

    def __init__(self) -> None:
        self.time_s = 0.0

    def now_s(self) -> float:
        self.time_s += 1.0
        return self.time_s

    def wall_delay_s(self, delay_s: float) -> float:
        return delay_s


def wide_mission(n_uav: int, n_task: int) -> Mission:
    return Mission(
        name="wide",
        horizon_s=600.0,
        uavs=tuple(
            Uav(UavId(f"u{i}"), (100.0 * i, 30.0 * (i % 3), 0.0), 10.0 + i % 4)
            for i in range(n_uav)
        ),
        tasks=tuple(
            Task(TaskId(f"t{i}"), (137.0 * i % 1000, 211.0 * i % 900, 0.0), 1.0 + i % 5)
            for i in range(n_task)
        ),
    )


def test_greedy_plan_of_table_1() -> None:
    plan = make_plan(table_1_mission(), "greedy", clock=TickingClock(), seed=7)

    assert plan.scenario == "table-1"
    assert plan.method == "greedy"
    assert plan.sequence == ("uav1", "uav3", "uav2")
    assert plan.routes == {
        "uav1": ("t2", "t3"),
        "uav2": ("t8", "t7", "t1"),
        "uav3": ("t4", "t6", "t5"),
    }
    assert plan.objective == pytest.approx(118.4939, abs=5e-5)
    assert plan.optimum == pytest.approx(120.3335, abs=5e-5)
    assert plan.gap == pytest.approx(0.0153, abs=5e-5)
    assert plan.completion_s[TaskId("t2")] == pytest.approx(0.9014, abs=5e-5)
    assert (plan.evaluations, plan.elapsed_s, plan.seed) == (4, 1.0, 7)


def test_exact_plan_has_no_sequence_and_no_gap() -> None:
    plan = make_plan(table_1_mission(), "exact", clock=TickingClock())

    assert plan.sequence is None
    assert plan.objective == plan.optimum == pytest.approx(120.3335, abs=5e-5)
    assert plan.gap == 0.0


@pytest.mark.parametrize("method", METHODS)
def test_pop_ups_are_in_no_list(method: str) -> None:
    mission = table_1_mission()
    late = replace(mission.tasks[3], appears_s=0.5)
    mission = replace(mission, tasks=(*mission.tasks[:3], late, *mission.tasks[4:]))

    plan = make_plan(mission, method, clock=TickingClock())

    assert "t4" not in plan.completion_s
    assert sum(len(route) for route in plan.routes.values()) == 7


def test_a_search_with_a_limit_ends_once_it_has_what_is_proven_to_be_the_best() -> None:
    spent: list[float] = []

    plan = make_plan(
        table_1_mission(),
        "guided",
        clock=TickingClock(),
        seed=1,
        stop=after_evaluations(1_000_000),
        progress=lambda iterations, _: spent.append(iterations),
    )

    assert plan.gap == 0.0
    assert plan.evaluations == spent[-1] < 1_000_000


def test_optimum_of_a_large_mission_is_left_open() -> None:
    plan = make_plan(wide_mission(4, 20), "greedy", clock=TickingClock())

    assert plan.optimum is None
    assert plan.gap is None


def test_exact_refuses_a_large_mission() -> None:
    with pytest.raises(ProblemTooLargeError):
        make_plan(wide_mission(4, 20), "exact", clock=TickingClock())


def test_large_fleet_is_planned_alike_every_time_within_its_evaluations() -> None:
    mission = wide_mission(12, 30)

    plans = [
        make_plan(mission, "greedy", clock=TickingClock(), seed=3, stop=after_evaluations(40))
        for _ in range(2)
    ]

    assert plans[0] == plans[1]
    assert plans[0].evaluations <= 40
    assert len(plans[0].completion_s) == 30


def test_lookahead_plans_more_tasks_than_it_can_solve_exactly() -> None:
    plan = make_plan(wide_mission(3, 16), "lookahead", clock=TickingClock())

    assert len(plan.completion_s) == 16
    assert plan.sequence is not None


def test_mission_without_tasks_is_planned_as_nothing() -> None:
    for method in METHODS:
        plan = make_plan(wide_mission(2, 0), method, clock=TickingClock())
        assert plan.routes == {"u0": (), "u1": ()}
        assert plan.objective == plan.optimum == 0.0
        assert plan.gap is None


def test_unknown_method_is_refused() -> None:
    with pytest.raises(ValueError, match="guided"):
        make_plan(table_1_mission(), "guessed", clock=TickingClock())


def test_modest_planning_costs_little_of_the_value_and_saves_most_of_the_work() -> None:
    missions = [mission_of(random_mission(10, 50, seed), "random") for seed in range(5)]
    thorough = [make_plan(flown, "greedy", clock=TickingClock()) for flown in missions]
    modest = [make_plan(flown, "greedy", clock=TickingClock(), modest=True) for flown in missions]
    assert sum(plan.objective for plan in modest) > 0.99 * sum(p.objective for p in thorough)
    assert max(plan.evaluations for plan in modest) <= 200


class ExpiringClock:
    """Stands still for ``readings`` readings, then it is an hour later."""

    def __init__(self, readings: int) -> None:
        self.left = readings

    def now_s(self) -> float:
        self.left -= 1
        return 0.0 if self.left >= 0 else 3600.0

    def wall_delay_s(self, delay_s: float) -> float:
        return delay_s


@pytest.mark.parametrize("method", ["greedy", "lookahead", "guided"])
@pytest.mark.parametrize("readings", [2, 10])
def test_whatever_the_limit_strikes_all_tasks_are_on_lists_at_once(
    method: str, readings: int
) -> None:
    clock = ExpiringClock(readings)
    mission = wide_mission(6, 90)

    plan = make_plan(mission, method, clock=clock, stop=after_time(clock, 60.0), bound_s=3.0)

    assert len(plan.completion_s) == 90
    assert clock.left > -60  # readings after the end: one at each place that asks, none repeated


def test_a_proof_that_the_limit_stops_leaves_good_lists_and_no_optimum() -> None:
    clock = ExpiringClock(3)

    plan = make_plan(wide_mission(2, 16), "exact", clock=clock, stop=after_time(clock, 60.0))

    assert plan.optimum is None
    assert plan.sequence is None
    assert len(plan.completion_s) == 16
    assert plan.objective == pytest.approx(
        make_plan(wide_mission(2, 16), "exact", clock=TickingClock()).objective, rel=0.01
    )


def test_a_proof_leaves_the_bound_what_is_kept_for_it() -> None:
    asked = 0

    def spent_frac(evaluations: float) -> float:
        nonlocal asked
        asked += 1
        return asked / 100.0

    plan = make_plan(
        wide_mission(2, 16),
        "exact",
        clock=TickingClock(),
        stop=Limit(spent_frac),
        bound_s=1e6,
        bound_frac=0.97,
        threads=1,
    )

    assert plan.evaluations > 0  # the proof was stopped
    assert plan.optimum is not None  # the bound closed
    assert asked < 100
