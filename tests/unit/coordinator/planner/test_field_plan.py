"""Plans in the field, held against the oracle that was written from the text alone."""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import pairwise
from typing import Any

import pytest

from coordinator.planner.field_plan import FIELD_METHODS
from coordinator.planner.options import Limit, after_evaluations
from coordinator.planner.plan import make_plan
from coordinator.planner.plan_report import plan_as_json, plan_from_json
from swarm.allocation.field import FieldProblem, FieldState
from swarm.kernels.field import FIELD_GREEDY, run_rule
from swarm.model import Mission, TaskId
from swarm.model.plan import LeftOut, at_base
from swarm.protocol.calibration import FlightRates
from swarm.runtime.clock import SystemClock
from swarm.runtime.errors import InputError
from swarm.scenario import load_scenario, resolve_scenario
from tests.support import field_missions
from tests.support.field_oracle import brute, checker, scenario
from tests.support.field_oracle.flight import FlightTimes
from tests.support.field_oracle.made_up import KINDS, made_up
from tests.support.seeds import sweeps

FEW = after_evaluations(150)


def mission_of(draft: dict[str, Any]) -> Mission:
    return replace(field_missions.mission_of(draft), schema=draft["schema"])


def told(mission: Mission, method: str, **options: Any) -> dict[str, Any]:
    """The JSON of a plan, as a program reads it."""
    stop = FEW if method == "guided" else None
    plan = make_plan(mission, method, clock=SystemClock(), stop=stop, **options)
    said: dict[str, Any] = json.loads(json.dumps(plan_as_json(plan), allow_nan=False))
    assert plan_as_json(plan_from_json(said)) == said
    return said


@pytest.mark.parametrize("sweep", sweeps(3, 20))
@pytest.mark.parametrize("kind", KINDS)
def test_every_plan_is_right_by_the_oracle(kind: str, sweep: range) -> None:
    for seed in sweep:
        draft = made_up(seed, kind, n_uavs=2 + seed % 2, n_tasks=4 + seed % 3)
        mission, meant = mission_of(draft), scenario.read(draft)
        times = FlightTimes(meant)
        plans = {method: told(mission, method) for method in FIELD_METHODS}
        for method, plan in plans.items():
            assert not checker.check_plan(meant, plan, times), (draft["name"], method)
            assert plan["optimum"] is not None, "so few tasks are proven at once"
        best = plans["exact"]
        assert best["basis"] == "proven optimal" or best["optimum"] == 0.0
        for plan in plans.values():
            ahead = best["required_left_out"] - plan["required_left_out"]
            assert ahead < 0 or (ahead == 0 and plan["objective"] <= best["objective"] + 1e-6)


@pytest.mark.parametrize("sweep", sweeps(1, 10))
@pytest.mark.parametrize("kind", KINDS)
def test_exact_plans_are_the_best_that_brute_force_finds(kind: str, sweep: range) -> None:
    for seed in sweep:
        draft = made_up(seed + 50, kind, n_uavs=2, n_tasks=3)
        meant = scenario.read(draft)
        times = FlightTimes(meant)
        best = brute.best_plan(meant, times)
        for method in FIELD_METHODS:
            plan = told(mission_of(draft), method)
            complaints = checker.check_against_best(meant, plan, best, exact=method == "exact")
            assert not complaints, (draft["name"], method)


def test_tasks_of_constrained_missions_are_required_or_not() -> None:
    """What is left out and why, where the reason is plain to see."""
    draft = made_up(0, "plain", n_uavs=1, n_tasks=4)
    draft["uav"][0] |= {"position_m": [0.0, 0.0], "speed_m_s": 10.0, "success": {}}
    draft["uav"][0] |= {"endurance_s": 100.0, "reserve_frac": 0.2}
    places = {"t1": [200.0, 0.0], "t2": [2000.0, 0.0], "t3": [0.0, 300.0], "t4": [-300.0, 0.0]}
    for task in draft["task"]:
        task |= {"position_m": places[task["id"]], "service_s": 0.0, "value": 5.0}
    draft["task"][2]["due_s"] = 35.0
    draft["task"][3]["closes_s"] = 35.0
    draft["task"].append({"id": "t5", "position_m": [0.0, -310.0], "value": 5.0})

    plan = make_plan(mission_of(draft), "exact", clock=SystemClock())

    assert plan.left_out[TaskId("t2")] is LeftOut.NOBODY_CAN
    left = {task: reason for task, reason in plan.left_out.items() if task != "t2"}
    wanted = {"t3": LeftOut.DUE, "t4": LeftOut.WINDOW, "t5": LeftOut.ENERGY, "t1": LeftOut.ENERGY}
    assert left == {task: wanted[task] for task in left}
    assert len(plan.routes[mission_of(draft).uavs[0].id]) + len(left) == 4
    assert plan.required_left_out == plan.fewest_left_out


def test_gap_is_null_where_more_is_left_out_than_need_be() -> None:
    mission = mission_of(made_up(3, "energy"))
    plan = make_plan(mission, "exact", clock=SystemClock())
    worse = replace(plan, required_left_out=(plan.fewest_left_out or 0) + 1)

    assert plan.gap == 0.0
    assert worse.gap is None
    assert worse.basis == "leaves out more tasks than the proven optimum"
    assert replace(worse, optimum=None, bound=1.0).basis == "leaves out more tasks than the bound"


def test_a_proof_keeps_to_its_part_of_a_limit_and_leaves_the_bound_the_rest() -> None:
    asked = 0
    worths: list[float] = []
    told: list[tuple[int, float]] = []

    def spent_frac(evaluations: float) -> float:
        nonlocal asked
        asked += 1
        return asked / 200.0

    plan = make_plan(
        mission_of(made_up(0, "energy", n_uavs=2, n_tasks=16)),
        "exact",
        clock=SystemClock(),
        stop=Limit(spent_frac),
        progress=lambda _, worth: worths.append(worth),
        bound_s=1e6,
        bound_frac=0.97,
        threads=1,
        bound_progress=lambda bound: told.append((asked, bound)),
    )

    assert plan.optimum is None  # the proof was stopped
    assert worths  # which a gap is told from
    bounds = [bound for _, bound in told]
    assert len(bounds) > 1
    assert bounds == sorted(set(bounds), reverse=True)
    assert plan.bound == bounds[-1]
    assert told[0][0] < 20
    assert asked < 210


def test_the_same_seed_gives_the_same_plan() -> None:
    mission = mission_of(made_up(5, "all", n_uavs=3, n_tasks=6))
    for method in FIELD_METHODS:
        one, other = (told(mission, method, seed=4) for _ in range(2))
        assert {**one, "elapsed_s": 0} == {**other, "elapsed_s": 0}


@pytest.mark.parametrize("method", ["greedy", "lookahead", "guided"])
def test_a_plan_that_is_stopped_at_once_is_no_worse_than_greedy_decisions(method: str) -> None:
    mission = load_scenario(resolve_scenario("reservoir-inspection"))
    clock = SystemClock()
    stopped = make_plan(mission, method, clock=clock, stop=lambda _: True)

    problem = FieldProblem.from_mission(mission)
    decided = run_rule(problem.kernel, FieldState.at_start(problem), FIELD_GREEDY)
    greedy = [len([item for item in items if item >= 0]) for items in decided.lists(3)]
    assert sum(greedy) >= 8
    assert [len(route) for route in stopped.routes.values()] == greedy
    assert stopped.evaluations == 0


def test_a_plan_made_for_how_uavs_fly_has_landing_and_climbing_in_its_times() -> None:
    mission = load_scenario(resolve_scenario("reservoir-inspection"))
    rates = {str(uav.id): FlightRates(land_s=20.0, climb_s=10.0) for uav in mission.uavs}
    stop = after_evaluations(2_000)
    made = make_plan(mission, "guided", clock=SystemClock(), stop=stop, rates=rates)

    assert made.schedule is not None
    problem = FieldProblem.from_mission(mission)
    nodes = {at_base(base): node for node, base in enumerate(problem.base_ids, problem.n_uav)}
    swaps = 0
    for uav, entries in enumerate(made.schedule.values()):
        for entry, after in pairwise(entries):
            if entry.go in nodes and after.go in problem.task_ids:
                task = problem.task_ids.index(TaskId(after.go))
                enter = problem.enter[task, int(after.is_reversed)]
                leg_s = problem.leg_s[problem.kind[uav], nodes[entry.go], enter]
                assert after.arrive_s - after.depart_s == pytest.approx(leg_s + 10.0)
                swaps += 1
        last, home = entries[-2:]
        if last.base is None:
            task = problem.task_ids.index(TaskId(last.go))
            leave = problem.enter[task, 1 - int(last.is_reversed)]
            leg_s = problem.leg_s[problem.kind[uav], leave, nodes.get(home.go, uav)]
            assert home.arrive_s - home.depart_s == pytest.approx(leg_s + 20.0)
    assert swaps > 0


@pytest.mark.parametrize("kind", ["energy", "plain"])
def test_a_plan_made_for_the_acceleration_of_vehicles_is_that_of_a_mission_that_says_it(
    kind: str,
) -> None:
    mission = mission_of(made_up(1, kind))
    mission = replace(
        mission, uavs=tuple(replace(uav, acceleration_m_s2=None) for uav in mission.uavs)
    )
    says = replace(mission, uavs=tuple(replace(uav, acceleration_m_s2=0.5) for uav in mission.uavs))
    rates = {str(uav.id): FlightRates(acceleration_m_s2=0.5) for uav in mission.uavs}
    told, briefed, plain = (
        make_plan(each, "greedy", clock=SystemClock(), rates=known)
        for each, known in ((mission, rates), (says, None), (mission, None))
    )
    assert told.completion_s == briefed.completion_s
    assert told.completion_s != plain.completion_s


def test_methods_that_heed_nothing_of_the_field_say_so() -> None:
    mission = mission_of(made_up(1, "energy"))
    for method in ("nearest", "value-per-time"):
        with pytest.raises(InputError, match=f"--method: {method}: does not heed endurance_s, "):
            make_plan(mission, method, clock=SystemClock())


def test_schedules_of_plain_missions_come_with_schema_2_alone() -> None:
    draft = made_up(2, "plain", n_tasks=5)
    field, plain = mission_of(draft), mission_of({**draft, "schema": 1, "base": [], "zone": []})

    one, other = told(field, "guided"), told(plain, "guided")

    assert set(one) - set(other) == {
        "schedule",
        "left_out",
        "required_left_out",
        "fewest_left_out",
    }
    assert one["objective"] == other["objective"]
    assert one["routes"] == other["routes"]
    for uav, entries in one["schedule"].items():
        assert [entry["go"] for entry in entries[:-1]] == one["routes"][uav]
        assert all(a["end_s"] == b["depart_s"] for a, b in pairwise(entries))


def test_a_mission_whose_legs_would_not_fit_is_refused_in_one_line(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    mission = field_missions.mission_of(made_up(0, "energy"))
    monkeypatch.setattr("swarm.allocation.field.network.MOST_LEGS", 50)

    with pytest.raises(InputError) as refused:
        make_plan(mission, "greedy", clock=SystemClock())

    assert str(refused.value).startswith(f"mission {mission.name}: ")
    assert "legs, more than the 50 that fit; fly fewer tasks" in str(refused.value)
    assert "\n" not in str(refused.value)
