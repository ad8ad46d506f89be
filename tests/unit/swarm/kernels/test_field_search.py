"""Arguments that the search for lists refuses, and what it tells meanwhile."""

from __future__ import annotations

import pytest

from swarm.allocation.field.problem import FieldProblem
from swarm.allocation.field.state import FieldState
from swarm.kernels.field_search import optimise_lists
from tests.support.field_missions import mission_of
from tests.support.field_oracle.made_up import made_up


@pytest.fixture(scope="module")
def problem() -> FieldProblem:
    return FieldProblem.from_mission(mission_of(made_up(4, "energy", 2, 5)).known_at_start())


def test_refuses_what_does_not_exist(problem: FieldProblem) -> None:
    state = FieldState.at_start(problem)

    with pytest.raises(ValueError, match="lists must hold 2 lists"):
        optimise_lists(problem.kernel, state, iterations=1, lists=[[0]])
    with pytest.raises(ValueError, match="task or base that does not exist"):
        optimise_lists(problem.kernel, state, iterations=1, lists=[[10], []])
    with pytest.raises(ValueError, match="task or base that does not exist"):
        optimise_lists(problem.kernel, state, iterations=1, lists=[[-9, 0], []])
    with pytest.raises(ValueError, match="iterations or spent_frac"):
        optimise_lists(problem.kernel, state)
    with pytest.raises(ValueError, match="seed must be within"):
        optimise_lists(problem.kernel, state, iterations=1, seed=-1)


def test_progress_never_falls(problem: FieldProblem) -> None:
    told: list[int] = []

    found = optimise_lists(
        problem.kernel,
        FieldState.at_start(problem),
        iterations=400,
        progress=lambda iterations, _: told.append(iterations),
    )

    assert told == sorted(told)
    assert found.iterations == told[-1] >= 400


def test_tasks_go_to_uavs_that_take_part_alone(problem: FieldProblem) -> None:
    state = FieldState.at_start(problem)
    state.active[0] = False
    state.open[:2] = False

    found = optimise_lists(problem.kernel, state, iterations=200)

    assert found.lists[0] == ()
    assert not {0, 1} & {item >> 1 for item in found.lists[1] if item >= 0}


def test_what_a_callable_raises_ends_the_search(problem: FieldProblem) -> None:
    def fail(_: int) -> float:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        optimise_lists(problem.kernel, FieldState.at_start(problem), spent_frac=fail)
