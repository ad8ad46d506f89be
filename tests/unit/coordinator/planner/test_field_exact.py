"""The proof for missions with the field's constraints: its limits and what it says of them."""

from __future__ import annotations

import pytest

from coordinator.planner.exact import ProblemTooLargeError
from coordinator.planner.field_exact import (
    MAX_FIELD_TASKS,
    TooManyListsError,
    estimated_field_s,
    field_optimum_before,
)
from swarm.allocation.field import FieldProblem
from tests.support.field_missions import mission_of
from tests.support.field_oracle.made_up import made_up


def problem_of(
    n_uavs: int, n_tasks: int, kind: str = "energy", endurance_s: float | None = None
) -> FieldProblem:
    draft = made_up(1, kind, n_uavs=n_uavs, n_tasks=n_tasks)
    for uav in draft["uav"]:
        uav["success"] = {}
        if endurance_s is not None:
            uav["endurance_s"] = endurance_s
    return FieldProblem.from_mission(mission_of(draft))


def test_small_missions_are_proven() -> None:
    problem = problem_of(2, 6)

    found = field_optimum_before(problem, None)

    assert found is not None
    assert found.proven
    assert estimated_field_s(problem) < 0.1


def test_too_many_tasks_are_refused_before_any_work() -> None:
    problem = problem_of(2, MAX_FIELD_TASKS + 1)

    assert estimated_field_s(problem) == float("inf")
    with pytest.raises(ProblemTooLargeError, match=f"the limit is {MAX_FIELD_TASKS} tasks"):
        field_optimum_before(problem, None)


def test_refuses_what_would_take_longer_than_the_limit() -> None:
    with pytest.raises(ProblemTooLargeError, match="the limit is 0 s"):
        field_optimum_before(problem_of(2, 4), None, limit_s=0.0)


def test_stopped_proof_gives_the_best_known() -> None:
    problem = problem_of(2, 12, "due")

    assert field_optimum_before(problem, lambda: True) is None
    known = field_optimum_before(problem, lambda: True, known=[[], []])

    assert known is not None
    assert not known.proven
    assert known.lists == ((), ())


@pytest.mark.slow
def test_memory_is_bounded() -> None:
    """With long batteries, two bases and no windows nearly every set can be done."""
    problem = problem_of(1, 16, "energy", endurance_s=300.0)

    with pytest.raises(TooManyListsError, match="more memory than there may be"):
        field_optimum_before(problem, None)


def test_estimate_grows_with_tasks_bases_and_few_slots() -> None:
    tasks = [estimated_field_s(problem_of(2, n)) for n in (6, 8, 10)]
    assert tasks == sorted(tasks)
    assert estimated_field_s(problem_of(2, 8, "due")) < estimated_field_s(problem_of(2, 8, "slots"))
