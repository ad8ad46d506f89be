from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coordinator.planner.exact import optimum
from swarm.allocation import Problem, TeamState, evaluate
from swarm.allocation.rules import team_arrays
from swarm.kernels.routes import TeamArrays, improve_routes, optimise_routes
from tests.support.plain_search import plain_search
from tests.support.problems import any_problem, paper_problem, random_problem, table_1
from tests.support.reference import best_of_neighbourhood, team_worth

SEEDS = st.integers(0, 2**32 - 1)


def team_of(problem: Problem, state: TeamState | None = None) -> TeamArrays:
    state = TeamState.at_start(problem) if state is None else state
    return team_arrays(problem, state, state.active, 0.0)


def any_state(problem: Problem, rng: np.random.Generator) -> TeamState:
    state = TeamState.at_start(problem)
    state.free_s[:] = rng.uniform(0.0, 2.0, problem.n_uav)
    state.place_enu_m[:] = rng.uniform(0.0, 10.0, (problem.n_uav, 3))
    state.survived[:] = rng.uniform(0.2, 1.0, problem.n_uav)
    state.open[:] = rng.uniform(size=problem.n_task) < 0.8
    state.active[:] = rng.uniform(size=problem.n_uav) < 0.8
    return state


def random_lists(problem: Problem, state: TeamState, rng: np.random.Generator) -> list[list[int]]:
    lists: list[list[int]] = [[] for _ in range(problem.n_uav)]
    for task in rng.permutation(np.flatnonzero(state.open)):
        able = np.flatnonzero(problem.capable[:, task] & state.active)
        if len(able):
            lists[rng.choice(able)].append(int(task))
    return lists


def test_table_1_reaches_the_optimum() -> None:
    lists, worth = optimise_routes(team_of(table_1()), iterations=2000)

    assert worth == pytest.approx(120.3335, abs=5e-5)
    assert evaluate(table_1(), lists)[0] == pytest.approx(worth, rel=1e-12)


def test_the_papers_kind_of_problem_is_solved_to_its_optimum() -> None:
    rng = np.random.default_rng(5)
    shares = []
    for _ in range(10):
        problem = paper_problem(rng)
        _, worth = optimise_routes(team_of(problem), iterations=2000)
        shares.append(worth / optimum(problem).objective)

    assert min(shares) >= 0.999
    assert max(shares) <= 1.0 + 1e-12


@settings(deadline=None, max_examples=60)
@given(seed=SEEDS, n_uav=st.integers(0, 4), n_task=st.integers(0, 12))
def test_lists_hold_every_task_once_and_are_worth_what_is_said(
    seed: int, n_uav: int, n_task: int
) -> None:
    problem = any_problem(seed, n_uav, n_task)
    state = any_state(problem, np.random.default_rng(seed))

    lists, worth = optimise_routes(team_of(problem, state), seed=seed, iterations=200)

    able = (problem.capable & state.active[:, None]).any(axis=0) & state.open
    assert sorted(task for route in lists for task in route) == np.flatnonzero(able).tolist()
    for uav, route in enumerate(lists):
        assert state.active[uav] or not route
        assert problem.capable[uav, route].all()
    scale = 1.0 + abs(worth)
    assert abs(team_worth(problem, state, lists) - worth) <= 1e-9 * scale


@settings(deadline=None, max_examples=60)
@given(seed=SEEDS, n_uav=st.integers(1, 4), n_task=st.integers(1, 11))
def test_local_search_ends_where_no_move_gains(seed: int, n_uav: int, n_task: int) -> None:
    problem = any_problem(seed, n_uav, n_task)
    rng = np.random.default_rng(seed)
    state = any_state(problem, rng)
    begin = random_lists(problem, state, rng)

    lists = improve_routes(team_of(problem, state), begin)

    worth = team_worth(problem, state, lists)
    assert sorted(t for r in lists for t in r) == sorted(t for r in begin for t in r)
    assert worth >= team_worth(problem, state, begin) - 1e-9
    idle = [list(lists[u]) for u in range(n_uav)]
    active = np.flatnonzero(state.active)
    accelerations_m_s2 = problem.acceleration_m_s2
    part = Problem(
        uav_ids=tuple(problem.uav_ids[u] for u in active),
        task_ids=problem.task_ids,
        start_enu_m=problem.start_enu_m[active],
        task_enu_m=problem.task_enu_m,
        speed_m_s=problem.speed_m_s[active],
        value=problem.value,
        service_s=problem.service_s,
        success=problem.success[active],
        survival=problem.survival[active],
        horizon_s=problem.horizon_s,
        acceleration_m_s2=None if accelerations_m_s2 is None else accelerations_m_s2[active],
    )
    team = TeamState(
        state.free_s[active],
        state.place_enu_m[active],
        state.survived[active],
        state.open,
        state.active[active],
    )
    best = best_of_neighbourhood(part, team, [idle[u] for u in active])
    assert best <= worth + 1e-8 * (1.0 + abs(worth))


@pytest.mark.parametrize("survival", [0.8, 1.0])
@pytest.mark.parametrize("seed", [1, 3])
def test_the_search_is_that_which_values_every_place_anew(seed: int, survival: float) -> None:
    rng = np.random.default_rng(seed)
    problem = random_problem(rng, 4, 22, lowest_survival=survival, incapable_frac=0.2)
    state = any_state(problem, rng)
    state.active[:2] = True

    lists, _ = optimise_routes(team_of(problem, state), seed=seed, iterations=200)

    assert lists == plain_search(problem, state, seed, 200)


def test_the_number_of_threads_does_not_change_the_result() -> None:
    problem = random_problem(np.random.default_rng(1), 14, 90, horizon_s=60.0)
    runs = [optimise_routes(team_of(problem), iterations=6000, threads=n) for n in (1, 2, 5)]

    assert runs[0] == runs[1] == runs[2]


def test_another_seed_gives_another_search() -> None:
    problem = random_problem(np.random.default_rng(1), 14, 90, horizon_s=60.0)

    a, b = (optimise_routes(team_of(problem), iterations=3000, seed=s)[0] for s in (0, 1))

    assert a != b


def test_begun_with_lists_it_never_returns_worse() -> None:
    problem = random_problem(np.random.default_rng(2), 12, 80, horizon_s=60.0)
    lists, worth = optimise_routes(team_of(problem), iterations=8000)

    again, value = optimise_routes(team_of(problem), lists=lists, iterations=0)

    assert value >= worth - 1e-9 * abs(worth)
    assert again == lists


def test_it_stops_when_all_is_spent_and_reports_progress() -> None:
    problem = random_problem(np.random.default_rng(3), 4, 40, horizon_s=60.0)
    told: list[tuple[int, float]] = []

    _, worth = optimise_routes(
        team_of(problem),
        spent_frac=lambda done: done / 9000,
        progress=lambda done, best: told.append((done, best)),
    )

    assert told[-1][0] >= 9000
    assert told[-2][0] < 9000
    bests = [best for _, best in told]
    assert bests == sorted(bests)
    assert worth >= bests[-1] - 1e-9 * worth


def small() -> Problem:
    return random_problem(np.random.default_rng(0), 2, 3)


@pytest.mark.parametrize(
    ("name", "wrong"),
    [
        ("free_s", [0.0, np.inf]),
        ("place_enu_m", np.zeros((3, 3))),
        ("survived", [1.0, 1.1]),
        ("active", [1, 1]),
        ("open", [True, True]),
    ],
)
def test_a_wrong_state_is_refused_by_name(name: str, wrong: object) -> None:
    right: dict[str, Any] = {
        "free_s": np.zeros(2),
        "place_enu_m": np.zeros((2, 3)),
        "survived": np.ones(2),
        "active": np.ones(2, dtype=np.bool_),
        "open": np.ones(3, dtype=np.bool_),
    }
    with pytest.raises(ValueError, match=name):
        TeamArrays(small().kernel, **(right | {name: wrong}))


@pytest.mark.parametrize("lists", [[[0]], [[0], [3]], [[0], [-1]], [[0, 0], []], [[1], [1]]])
def test_wrong_lists_are_refused(lists: list[list[int]]) -> None:
    with pytest.raises(ValueError, match="lists"):
        optimise_routes(team_of(small()), iterations=10, lists=lists)


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("iterations", {}),
        ("iterations", {"iterations": 1, "spent_frac": lambda _: 1.0}),
        ("iterations", {"iterations": -1}),
        ("seed", {"iterations": 1, "seed": -1}),
        ("threads", {"iterations": 1, "threads": 0}),
    ],
)
def test_wrong_options_are_refused(name: str, options: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=name):
        optimise_routes(team_of(small()), **options)


@settings(deadline=None, max_examples=4)
@given(seed=SEEDS, survival=st.sampled_from([0.5, 1.0]))
def test_many_tasks_are_all_on_the_lists_too(seed: int, survival: float) -> None:
    rng = np.random.default_rng(seed)
    problem = random_problem(
        rng, 25, 220, lowest_survival=survival, incapable_frac=0.4, horizon_s=60.0
    )
    state = any_state(problem, rng)

    lists, worth = optimise_routes(team_of(problem, state), seed=seed, iterations=1500)

    able = (problem.capable & state.active[:, None]).any(axis=0) & state.open
    assert sorted(task for route in lists for task in route) == np.flatnonzero(able).tolist()
    assert all(problem.capable[uav, route].all() for uav, route in enumerate(lists))
    assert abs(team_worth(problem, state, lists) - worth) <= 1e-9 * (1.0 + abs(worth))


class Told:
    """Says that all time is spent from the ``after``-th question about time on."""

    def __init__(self, after: int) -> None:
        self.after = after
        self.asked = 0

    def __call__(self, iterations: int) -> float:
        if iterations:
            return 0.0
        self.asked += 1
        return float(self.asked > self.after)


def test_local_search_leaves_off_when_the_time_is_spent() -> None:
    problem = random_problem(np.random.default_rng(4), 1, 300, horizon_s=900.0)
    _, whole = optimise_routes(team_of(problem), iterations=0)
    told = Told(3)

    lists, worth = optimise_routes(team_of(problem), spent_frac=told)

    assert sorted(lists[0]) == list(range(300))
    assert worth < whole
    assert told.asked <= 8


def test_the_search_goes_on_from_where_local_search_ended() -> None:
    problem = random_problem(np.random.default_rng(5), 20, 400, horizon_s=100.0)
    _, polished = optimise_routes(team_of(problem), iterations=0)

    # so few iterations that from anywhere else it never gets there
    best: list[float] = []
    for seed in range(4):
        optimise_routes(
            team_of(problem),
            iterations=1000,
            seed=seed,
            progress=lambda _, worth: best.append(worth),
        )

    assert max(best) > polished


class Stopwatch:
    """Lets some questions about time pass, then says that all is spent, from whatever thread."""

    def __init__(self, after: int) -> None:
        self.after = after
        self.asked = 0

    def __call__(self, iterations: int) -> float:
        self.asked += not iterations
        return 1.0 if self.asked > self.after else 0.0


def test_rounds_of_many_lists_leave_off_when_the_time_is_spent() -> None:
    problem = random_problem(np.random.default_rng(6), 40, 2100, horizon_s=900.0)
    team = team_of(problem)
    told: list[int] = []
    watch = Stopwatch(4)

    lists, worth = optimise_routes(
        team,
        spent_frac=watch,
        progress=lambda done, _: told.append(done),
        threads=2,
    )

    assert sorted(task for route in lists for task in route) == list(range(2100))
    assert abs(team_worth(problem, TeamState.at_start(problem), lists) - worth) <= 1e-9 * worth
    assert watch.asked <= 4 + 6
    assert len(told) <= 4


@pytest.mark.parametrize("survival", [0.9, 1.0])
def test_thousands_of_tasks_are_searched_alike_by_any_number_of_threads(survival: float) -> None:
    rng = np.random.default_rng(8)
    problem = random_problem(rng, 60, 2100, lowest_survival=survival, horizon_s=400.0)
    team = team_of(problem)

    runs = [optimise_routes(team, iterations=2000, threads=n) for n in (1, 3)]

    lists, worth = runs[0]
    assert runs[1] == runs[0]
    assert sorted(task for route in lists for task in route) == list(range(2100))
    assert evaluate(problem, lists)[0] == pytest.approx(worth, rel=1e-12)
