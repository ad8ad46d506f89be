"""Plans of the method `guided` under the field's constraints, held against the oracle."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import pytest

from coordinator.planner.field_guided import FieldGuidedPlan, field_guided_plan
from coordinator.planner.options import after_evaluations
from swarm.allocation.field.problem import FieldProblem
from tests.support.field_missions import mission_of
from tests.support.field_oracle import brute, made_up, scenario
from tests.support.field_oracle.flight import FlightTimes
from tests.support.field_oracle.scenario import FieldScenario
from tests.support.field_oracle.schedule import Item, Swap, Work
from tests.support.field_oracle.slots import fly_all, objective

KINDS = ("plain", "energy", "slots", "windows", "due", "lines", "wind", "zones", "survival", "all")


def problem_of(draft: made_up.Draft) -> FieldProblem:
    return FieldProblem.from_mission(mission_of(draft).known_at_start())


def flown(world: FieldScenario, lists: Sequence[Sequence[int]]) -> float | None:
    """J of lists of items, flown by the oracle; None if they can't be."""

    def item_of(item: int) -> Item:
        if item < 0:
            return Swap(world.bases[-1 - item].id)
        return Work(world.known[item >> 1].id, backwards=bool(item & 1))

    named = {
        uav.id: tuple(map(item_of, items)) for uav, items in zip(world.uavs, lists, strict=True)
    }
    return objective(fly_all(world, FlightTimes(world), named))


def check(world: FieldScenario, plan: FieldGuidedPlan) -> None:
    """It can be flown, is worth what it says, and has each task once."""
    tasks = list(itertools.chain.from_iterable(plan.routes))
    assert len(tasks) == len(set(tasks))
    assert flown(world, plan.lists) == pytest.approx(plan.objective, rel=1e-9, abs=1e-9)


def left_out(world: FieldScenario, plan: FieldGuidedPlan) -> int:
    done = set(itertools.chain.from_iterable(plan.routes))
    return sum(index not in done for index, task in enumerate(world.known) if task.due_s is None)


@pytest.mark.parametrize("kind", KINDS)
def test_tiny_plans_are_nearly_the_best(kind: str) -> None:
    shares = []
    for seed in range(2):
        draft = made_up.made_up(seed, kind, 2, 4)
        world = scenario.read(draft)
        plan = field_guided_plan(problem_of(draft), seed=seed, stop=after_evaluations(2000))
        check(world, plan)
        best = brute.best_plan(world)
        assert left_out(world, plan) == best.n_left_out
        spare = 1e-9 * max(1.0, abs(best.objective))
        assert plan.objective <= best.objective + spare
        shares.append(1.0 - (best.objective - plan.objective) / max(1e-9, abs(best.objective)))

    assert sum(shares) / len(shares) >= 0.99


@pytest.mark.parametrize("seed", range(6))
def test_plans_of_more_tasks_can_be_flown_as_they_say(seed: int) -> None:
    draft = made_up.made_up(seed, "all" if seed % 2 else "slots", 3, 8)

    check(
        scenario.read(draft),
        field_guided_plan(problem_of(draft), seed=seed, stop=after_evaluations(600)),
    )


def test_same_seed_and_work_give_the_same_plan_on_any_number_of_threads() -> None:
    problem = problem_of(made_up.made_up(3, "all", 3, 8))

    plans = [
        field_guided_plan(problem, seed=5, stop=after_evaluations(800), threads=threads)
        for threads in (1, 2, 2, 3)
    ]

    assert all(plan == plans[0] for plan in plans)


@pytest.mark.parametrize("kind", ["slots", "all"])
def test_plan_is_never_worse_than_the_lists_it_begins_with(kind: str) -> None:
    draft = made_up.made_up(7, kind, 3, 8)
    problem = problem_of(draft)
    good = field_guided_plan(problem, seed=1, stop=after_evaluations(2000))

    again = field_guided_plan(problem, seed=2, stop=after_evaluations(2), lists=good.lists)

    assert (-again.n_left_out, again.objective) >= (-good.n_left_out, good.objective)


def test_search_that_is_to_stop_at_once_keeps_the_lists_it_began_with() -> None:
    draft = made_up.made_up(1, "all", 3, 8)
    problem = problem_of(draft)
    good = field_guided_plan(problem, stop=after_evaluations(1000))

    stopped = field_guided_plan(problem, stop=lambda _: True, lists=good.lists)

    assert stopped.iterations == 0
    assert stopped.lists == good.lists
    assert stopped.objective == good.objective


def test_search_that_is_to_stop_at_once_has_empty_lists_if_it_began_with_none() -> None:
    stopped = field_guided_plan(problem_of(made_up.made_up(1)), stop=lambda _: True)

    assert not any(stopped.lists)


def test_lists_that_cannot_be_flown_are_mended() -> None:
    draft = made_up.made_up(2, "slots", 3, 8)
    problem = problem_of(draft)
    everything = [range(0, 2 * problem.n_task, 2), (), ()]

    plan = field_guided_plan(problem, stop=after_evaluations(2), lists=everything)

    check(scenario.read(draft), plan)
