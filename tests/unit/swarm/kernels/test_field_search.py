"""Arguments that the search for lists refuses, and what it tells meanwhile."""

from __future__ import annotations

import random

import numpy as np
import pytest

from swarm.allocation.field.problem import FieldProblem
from swarm.allocation.field.state import FieldState
from swarm.kernels.field import fly_lists
from swarm.kernels.field_search import Effort, optimise_lists
from tests.support.field_dilemmas import dilemma
from tests.support.field_missions import mission_of
from tests.support.field_oracle.made_up import made_up
from tests.support.field_states import with_landings


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


@pytest.mark.parametrize("threads", [1, 2])
def test_effort_ends_it_earlier_and_alike_everywhere(problem: FieldProblem, threads: int) -> None:
    state = FieldState.at_start(problem)
    whole = optimise_lists(problem.kernel, state, iterations=4000, threads=threads)
    cut = optimise_lists(
        problem.kernel, state, iterations=4000, effort=Effort(100_000), threads=threads
    )
    assert cut.iterations < whole.iterations / 4
    assert cut == optimise_lists(
        problem.kernel, state, iterations=4000, effort=Effort(100_000), threads=1
    )


def test_effort_that_is_not_used_up_changes_nothing(problem: FieldProblem) -> None:
    state = FieldState.at_start(problem)
    effort = Effort(10**12)
    assert optimise_lists(problem.kernel, state, iterations=300, effort=effort) == optimise_lists(
        problem.kernel, state, iterations=300
    )


def test_what_is_on_no_list_yet_is_placed_whatever_the_effort(problem: FieldProblem) -> None:
    state = FieldState.at_start(problem)
    found = optimise_lists(problem.kernel, state, iterations=250, effort=Effort(1, 10))
    assert found.iterations == 20  # ten of each lane at a time
    assert found.n_left_out == 0


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


def some_landed(problem: FieldProblem, rng: random.Random) -> FieldState:
    """Mission time 0, but that some UAVs stand at bases; of these some take no part."""
    state = FieldState.at_start(problem)
    for uav in range(problem.n_uav):
        if rng.random() < 0.5:
            base = rng.randrange(problem.n_base)
            state.landed_at[uav] = base
            state.free_s[uav] = rng.uniform(0.0, 80.0)
            state.first_s[uav] = problem.leg_s[problem.kind[uav], problem.n_uav + base]
            state.active[uav] = rng.random() < 0.6
    return state


@pytest.mark.parametrize("lands", [False, True])
@pytest.mark.parametrize("seed", range(25))
def test_lists_heed_who_stands_at_bases_and_has_none(seed: int, lands: bool) -> None:
    draft = dilemma(seed, n_uavs=3, n_tasks=8, slots=True)
    problem = FieldProblem.from_mission(mission_of(draft).known_at_start())
    problem = with_landings(random.Random(seed), problem) if lands else problem
    state = some_landed(problem, random.Random(seed))

    found = optimise_lists(problem.kernel, state, seed=seed, iterations=400, threads=1)

    flown = fly_lists(problem.kernel, state, found.lists)
    assert flown.feasible
    assert float(flown.value.sum()) == pytest.approx(found.objective)


def test_lists_are_worth_what_they_say_when_slots_become_free_behind_them() -> None:
    problem = FieldProblem.from_mission(mission_of(dilemma(2626, 3, 5, slots=True)))
    state = FieldState.at_start(problem)
    state.active[1] = False
    state.landed_at[:] = 1, 0, 0
    state.free_s[:] = 71.7, 61.5, 28.2
    for uav, base in enumerate(state.landed_at):
        state.first_s[uav] = problem.leg_s[problem.kind[uav], problem.n_uav + base]

    found = optimise_lists(problem.kernel, state, seed=2626, iterations=500, threads=1)

    flown = fly_lists(problem.kernel, state, found.lists)
    assert flown.feasible
    assert float(flown.value.sum()) == pytest.approx(found.objective)


def test_a_base_that_alone_helps_is_found_behind_many_that_are_nearer() -> None:
    near = [{"id": f"near-{n}", "position_m": [10.0 * n, 0.0]} for n in range(1, 6)]
    draft = {
        "name": "far",
        "mission": {"horizon_s": 600.0},
        "uav": [
            {
                "id": "u",
                "position_m": [0.0, 0.0],
                "speed_m_s": 10.0,
                "endurance_s": 100.0,
                "reserve_frac": 0.0,
            }
        ],
        "base": [*near, {"id": "far", "position_m": [800.0, 0.0], "swap_s": 60.0}],
        "task": [{"id": "t", "position_m": [900.0, 0.0], "value": 1.0, "service_s": 20.0}],
    }
    problem = FieldProblem.from_mission(mission_of(draft))

    found = optimise_lists(problem.kernel, FieldState.at_start(problem), iterations=50)

    assert found.lists == ((-6, 0),)


@pytest.mark.parametrize("active", [True, False])
@pytest.mark.parametrize("seed", range(3))
def test_who_stands_at_a_base_keeps_its_slot_from_others(seed: int, active: bool) -> None:
    problem = FieldProblem.from_mission(mission_of(made_up(seed, "slots", 3, 8)).known_at_start())
    state = FieldState.at_start(problem)
    state.landed_at[0] = 0
    state.first_s[0] = problem.leg_s[problem.kind[0], problem.n_uav]
    state.sortie_end_s[0] = np.inf
    state.active[0] = active

    found = optimise_lists(problem.kernel, state, iterations=300)

    flown = fly_lists(problem.kernel, state, found.lists)
    assert flown.feasible
    assert flown.value.sum() == pytest.approx(found.objective, rel=1e-12)
