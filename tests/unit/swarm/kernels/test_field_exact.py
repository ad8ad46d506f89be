"""The exact optimum of the field's problem against the oracle's brute force."""

from __future__ import annotations

import random
from itertools import product

import numpy as np
import pytest

from swarm.allocation.field import FieldProblem, FieldState
from swarm.kernels import field_exact
from swarm.kernels.field import fly_lists
from swarm.kernels.field_exact import FieldLists, ProofOutcome
from tests.support.field_dilemmas import dilemma
from tests.support.field_missions import mission_of
from tests.support.field_oracle.brute import best_plan
from tests.support.field_oracle.flight import FlightTimes
from tests.support.field_oracle.made_up import KINDS, Draft, made_up
from tests.support.field_oracle.scenario import read
from tests.support.field_reference import PlainField, best_lists
from tests.support.field_states import random_state
from tests.support.seeds import seeds

N_SEED = dict.fromkeys(KINDS, 20) | dict.fromkeys(("zones", "margin", "all", "all-but-margin"), 6)
"""How many of each kind by day; the oracle is slow where there are zones."""
ARCS_IN_WIND = 5e-6
"""The oracle flies round corners in straight pieces of half a degree [value·s]."""
N_TASK = {"energy": 3, "zones": 3, "margin": 3}
"""Of each scenario; 4 where nothing is said."""


def problem_of(draft: Draft) -> FieldProblem:
    return FieldProblem.from_mission(mission_of(draft).known_at_start())


def best_of(problem: FieldProblem, threads: int = 1) -> FieldLists:
    return field_exact.optimum(problem.kernel, FieldState.at_start(problem), threads=threads)


def check(draft: Draft, in_a_row: int = 2) -> None:
    """What is proven is the best of all, and its lists are worth that."""
    scenario, problem = read(draft), problem_of(draft)
    expected = best_plan(scenario, FlightTimes(scenario), in_a_row=in_a_row)

    found = best_of(problem)

    assert found.outcome is ProofOutcome.PROVEN
    assert found.n_left_out == expected.n_left_out
    arcs_in_wind = scenario.margin_m > 0.0 and scenario.wind_m_s != (0.0, 0.0)
    close = ARCS_IN_WIND if arcs_in_wind else 1e-9
    assert found.objective == pytest.approx(expected.objective, rel=1e-9, abs=close)
    check_lists(problem, found)


def check_lists(problem: FieldProblem, found: FieldLists) -> None:
    flown = fly_lists(problem.kernel, FieldState.at_start(problem), found.lists)
    assert flown.feasible
    assert float(flown.value.sum()) == pytest.approx(found.objective, rel=1e-12)
    done = [item >> 1 for items in found.lists for item in items if item >= 0]
    assert len(done) == len(set(done))
    assert found.n_left_out == int(problem.required.sum() - problem.required[done].sum())


@pytest.mark.parametrize("kind", KINDS)
def test_equals_brute_force(kind: str) -> None:
    for seed in range(N_SEED[kind]):
        check(made_up(seed, kind, n_tasks=N_TASK.get(kind, 4)))


def test_legs_round_corners_are_exact_where_wind_begins_to_slow_them() -> None:
    """The value was off in the eighth digit when quadrature went across that kink."""
    check(made_up(1047, "all", n_uavs=1, n_tasks=3))
    check(made_up(1042, "all", n_tasks=3))


@pytest.mark.parametrize(
    ("n_uavs", "n_tasks", "slots", "extras"),
    [
        (2, 3, False, ()),
        (2, 3, True, ()),
        (3, 3, True, ()),
        (2, 3, True, ("lines", "survival")),
    ],
)
def test_delays_that_help_are_found(
    n_uavs: int, n_tasks: int, slots: bool, extras: tuple[str, ...]
) -> None:
    for seed in range(10):
        check(dilemma(seed, n_uavs, n_tasks, slots=slots, extras=extras))


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "n_uavs"), list(product(KINDS, (1, 2, 3))))
def test_equals_brute_force_for_long(kind: str, n_uavs: int) -> None:
    n_seed = 60 if kind in ("zones", "margin", "all", "all-but-margin") else 200
    for seed in range(1000, 1000 + n_seed):
        check(made_up(seed, kind, n_uavs=n_uavs, n_tasks=3))
        if n_uavs == 2 and kind not in N_TASK:
            check(made_up(seed, kind))


@pytest.mark.slow
@pytest.mark.timeout(1200)
@pytest.mark.parametrize("slots", [False, True])
@pytest.mark.parametrize("extras", [(), ("lines", "survival"), ("wind", "acceleration")])
def test_delays_that_help_are_found_for_long(slots: bool, extras: tuple[str, ...]) -> None:
    for seed in range(1000, 1300):
        check(dilemma(seed, 3, 3, slots=slots, extras=extras))


@pytest.mark.parametrize("seed", seeds(12, 300))
def test_from_mid_mission_it_equals_all_lists_flown_by_plain_loops(seed: int) -> None:
    """Some stand at bases, where they hold slots, and some are out of it."""
    rng = random.Random(f"mid-{seed}")
    extras = rng.choice([(), ("lines", "survival")])
    problem = problem_of(dilemma(seed, 3, rng.choice([2, 3]), slots=True, extras=extras))
    state = random_state(rng, problem)
    state.landed_at[0] = 0
    state.first_s[0] = problem.leg_s[problem.kind[0], problem.n_uav]

    found = field_exact.optimum(problem.kernel, state, threads=1)

    n_left_out, value = best_lists(PlainField(problem, state))
    assert (found.outcome, found.n_left_out) == (ProofOutcome.PROVEN, n_left_out)
    assert found.objective == pytest.approx(value, rel=1e-9, abs=1e-9)
    assert fly_lists(problem.kernel, state, found.lists).feasible


def test_best_list_of_one_uav_is_that_of_a_team_of_one() -> None:
    for kind, seed in product(("energy", "windows", "due", "lines", "survival"), range(6)):
        problem = problem_of(made_up(seed, kind, n_uavs=1, n_tasks=5))
        state = FieldState.at_start(problem)

        own = field_exact.best_list(problem.kernel, state, 0)

        team = best_of(problem)
        nobody_can = int((problem.required & ~problem.capable[0]).sum())
        assert own.outcome is ProofOutcome.PROVEN
        assert (own.n_left_out + nobody_can, own.items) == (team.n_left_out, team.lists[0])
        assert own.objective == pytest.approx(team.objective, rel=1e-12)


def test_threads_change_nothing() -> None:
    for seed in range(5):
        problem = problem_of(dilemma(seed, 3, 5, slots=True))

        assert best_of(problem, threads=3) == best_of(problem)


def test_who_stops_at_once_has_found_nothing() -> None:
    problem = problem_of(made_up(0, "energy", n_uavs=3, n_tasks=12))

    found = field_exact.optimum(
        problem.kernel, FieldState.at_start(problem), should_stop=lambda: True
    )

    assert found.outcome is ProofOutcome.STOPPED
    assert not found.found


def test_known_lists_are_what_comes_back_where_nothing_better_is_found() -> None:
    problem = problem_of(made_up(0, "acceleration", n_uavs=3, n_tasks=14))
    known = [[0], [2], [4]]

    found = field_exact.optimum(
        problem.kernel, FieldState.at_start(problem), known=known, should_stop=lambda: True
    )

    assert found.outcome is ProofOutcome.STOPPED
    assert found.found
    assert found.lists == ((0,), (2,), (4,))
    check_lists(problem, found)


def test_failure_of_who_is_asked_to_stop_is_raised() -> None:
    problem = problem_of(made_up(0, "acceleration", n_uavs=3, n_tasks=14))

    def fails() -> bool:
        raise RuntimeError("asked in vain")

    with pytest.raises(RuntimeError, match="asked in vain"):
        field_exact.optimum(problem.kernel, FieldState.at_start(problem), should_stop=fails)


def test_too_many_tasks_are_not_even_begun() -> None:
    draft = made_up(0, "due", n_uavs=2, n_tasks=field_exact.MOST_TASKS + 1)
    for uav in draft["uav"]:
        uav["success"] = {}

    found = best_of(problem_of(draft))

    assert (found.outcome, found.found) == (ProofOutcome.TOO_LARGE, False)


@pytest.mark.parametrize(
    ("known", "message"),
    [
        ([[0]], "a list per UAV"),
        ([[0], [1]], "each at most once"),
        ([[8], []], "each at most once"),
        ([[-1], []], "visits a base that there isn't"),
    ],
)
def test_wrong_known_lists_are_refused(known: list[list[int]], message: str) -> None:
    problem = problem_of(made_up(0, "acceleration"))

    with pytest.raises(ValueError, match=message):
        field_exact.optimum(problem.kernel, FieldState.at_start(problem), known=known)


def test_nobody_is_no_reason_to_fail() -> None:
    problem = problem_of(made_up(0, "energy"))
    start = FieldState.at_start(problem)
    nobody = FieldState(
        free_s=start.free_s,
        sortie_end_s=start.sortie_end_s,
        first_s=start.first_s,
        survived=start.survived,
        active=np.zeros(2, dtype=np.bool_),
        open=start.open,
        landed_at=start.landed_at,
        rank=start.rank,
    )

    found = field_exact.optimum(problem.kernel, nobody)

    assert (found.outcome, found.objective) == (ProofOutcome.PROVEN, 0.0)
    assert found.lists == ((), ())
    assert found.n_left_out == 4
