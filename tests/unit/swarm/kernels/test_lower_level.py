from __future__ import annotations

import threading
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swarm.allocation import (
    Problem,
    TeamState,
    decisions,
    evaluate,
    rank_of,
    rule_by_name,
    run,
)
from swarm.kernels.lower_level import (
    EXACT_TASKS,
    GREEDY,
    LOOKAHEAD,
    UNDONE,
    RuleCode,
    decide,
    evaluate_sequences,
    first_rounds,
    run_sequences,
    valued,
)
from swarm.kernels.lower_level import run as run_compiled
from tests.support import reference
from tests.support.problems import any_problem, line_of_tasks, random_problem, table_1

SEEDS = st.integers(0, 2**32 - 1)
NAMES: dict[RuleCode, str] = {GREEDY: "greedy", LOOKAHEAD: "lookahead"}
RULES = st.sampled_from([GREEDY, LOOKAHEAD])


def any_state(problem: Problem, seed: int) -> TeamState:
    """A team on its way: some busy, some gone, some tasks taken."""
    rng = np.random.default_rng(seed)
    state = TeamState.at_start(problem)
    state.free_s[:] = rng.choice([0.0, 0.5, 1.0, np.inf], problem.n_uav, p=[0.4, 0.3, 0.2, 0.1])
    state.place_enu_m[:] = rng.uniform(0.0, 10.0, (problem.n_uav, 3))
    state.survived[:] = rng.choice([0.0, 0.3, 1.0], problem.n_uav, p=[0.1, 0.3, 0.6])
    state.open[:] = rng.uniform(size=problem.n_task) < 0.8
    state.active[:] = rng.uniform(size=problem.n_uav) < 0.8
    return state


def shuffled(seed: int, n_uav: int, count: int) -> list[list[int]]:
    rng = np.random.default_rng(seed)
    return [rng.permutation(n_uav).tolist() for _ in range(count)]


@settings(deadline=None, max_examples=150)
@given(seed=SEEDS, n_uav=st.integers(1, 4), n_task=st.integers(1, 6), code=RULES)
def test_single_decisions_equal_the_definition(
    seed: int, n_uav: int, n_task: int, code: RuleCode
) -> None:
    problem = any_problem(seed, n_uav, n_task)
    state = any_state(problem, seed)

    for uav in range(n_uav):
        found = decide(problem.kernel, state, uav, code)

        if not np.isfinite(state.free_s[uav]) or not (state.open & problem.capable[uav]).any():
            assert found is None
            continue
        assert found is not None
        task, score, second = reference.choice(problem, state, uav, NAMES[code])
        if state.survived[uav] > 0.0:  # else every task is worth nothing, and any will do
            assert found[1] == task
        assert found[:1] + found[2:3] == (uav, state.free_s[uav])
        assert found[4] == pytest.approx(score, abs=1e-9)
        assert found[5] == pytest.approx(second, abs=1e-9)
        assert found[6] == reference.certificate(problem, state, uav)
        assert found[7]


@settings(deadline=None, max_examples=60)
@given(seed=SEEDS, n_task=st.integers(0, 16), code=RULES, most=st.integers(1, 20))
def test_values_begin_with_what_is_taken_and_the_second_best(
    seed: int, n_task: int, code: RuleCode, most: int
) -> None:
    problem = any_problem(seed, 2, n_task)
    state = any_state(problem, seed)
    found = decide(problem.kernel, state, 0, code)

    values = valued(problem.kernel, state, 0, code, most)

    if found is None:
        assert values == []
        return
    able = np.flatnonzero(state.open & problem.capable[0])
    one_by_one = code == GREEDY or len(able) <= EXACT_TASKS
    assert values[0] == (found[1], found[4])
    assert len(values) == (min(most, len(able)) if one_by_one else 1)
    if len(values) > 1:
        assert values[1][1] == found[5]
        assert values[1:] == sorted(values[1:], key=lambda value: (-value[1], value[0]))
    if code == GREEDY:
        travel_s = problem.travel_s(0, state.place_enu_m[0])
        completion_s = (state.free_s[0] + travel_s) + problem.service_s
        plain = (problem.horizon_s - completion_s) * (state.survived[0] * problem.weight[0])
        assert [score for _, score in values] == [plain[task] for task, _ in values]


@settings(deadline=None, max_examples=100)
@given(seed=SEEDS, n_uav=st.integers(1, 4), n_task=st.integers(0, 9))
def test_greedy_lists_and_their_worth_equal_the_definition(
    seed: int, n_uav: int, n_task: int
) -> None:
    problem = any_problem(seed, n_uav, n_task)
    state = any_state(problem, seed)
    sequences = shuffled(seed, n_uav, 3)
    ranks = [rank_of(sequence) for sequence in sequences]

    objectives, _ = evaluate_sequences(problem.kernel, state, ranks, GREEDY)
    rounds = first_rounds(problem.kernel, state, ranks, GREEDY)

    for i, sequence in enumerate(sequences):
        routes, objective = reference.lists_from(problem, state, sequence, "greedy")
        assert run(problem, state, ranks[i], rule_by_name("greedy"))[0] == routes
        assert objectives[i] == pytest.approx(objective, abs=1e-9)
        expected = reference.first_round(problem, state, sequence, "greedy")
        assert rounds[i].tolist() == expected


@settings(deadline=None, max_examples=25)
@given(seed=SEEDS, n_uav=st.integers(1, 3), n_task=st.integers(0, 5))
def test_lookahead_lists_and_their_worth_equal_the_definition(
    seed: int, n_uav: int, n_task: int
) -> None:
    problem = any_problem(seed, n_uav, n_task)
    state = any_state(problem, seed)
    state.survived[:] = np.maximum(state.survived, 0.1)
    sequence = shuffled(seed, n_uav, 1)[0]
    rank = rank_of(sequence)

    objectives, _ = evaluate_sequences(problem.kernel, state, [rank], LOOKAHEAD)

    routes, objective = reference.lists_from(problem, state, sequence, "lookahead")
    assert run(problem, state, rank, rule_by_name("lookahead"))[0] == routes
    assert objectives[0] == pytest.approx(objective, abs=1e-9)


@settings(deadline=None, max_examples=30)
@given(seed=SEEDS, n_task=st.integers(0, 16), code=RULES)
def test_compiled_runs_equal_deciding_one_by_one(seed: int, n_task: int, code: RuleCode) -> None:
    problem = any_problem(seed, 3, n_task)
    state = any_state(problem, seed)
    rank = rank_of(shuffled(seed, 3, 1)[0])

    uavs, tasks, completion_s, scores = run_compiled(problem.kernel, state, rank, code)

    one_by_one = list(decisions(problem, state, rank, rule_by_name(NAMES[code])))
    assert [d.uav for d in one_by_one] == uavs.tolist()
    assert [d.task for d in one_by_one] == tasks.tolist()
    assert [d.completion_s for d in one_by_one] == completion_s.tolist()
    assert [d.score for d in one_by_one] == scores.tolist()


@pytest.mark.parametrize("code", [GREEDY, LOOKAHEAD])
@pytest.mark.parametrize("lowest", [0.8, 1.0])
def test_threads_change_nothing(code: RuleCode, lowest: float) -> None:
    problem = random_problem(np.random.default_rng(4), 6, 20, lowest_survival=lowest)
    state = TeamState.at_start(problem)
    ranks = [rank_of(sequence) for sequence in shuffled(1, 6, 9)]

    results = [evaluate_sequences(problem.kernel, state, ranks, code, n) for n in (1, 2, 7)]
    rounds = [first_rounds(problem.kernel, state, ranks, code, n) for n in (1, 2, 7)]

    for objectives, tied in results[1:]:
        assert objectives.tolist() == results[0][0].tolist()
        assert tied.tolist() == results[0][1].tolist()
    for tasks in rounds[1:]:
        assert tasks.tolist() == rounds[0].tolist()


def test_python_threads_may_decide_at_the_same_time() -> None:
    problem = random_problem(np.random.default_rng(4), 4, EXACT_TASKS, lowest_survival=0.9)
    state = TeamState.at_start(problem)
    expected = [decide(problem.kernel, state, uav, LOOKAHEAD) for uav in range(4)]
    found: dict[int, object] = {}

    def work(uav: int) -> None:
        fresh = Problem(**{name: getattr(problem, name) for name in ARGUMENTS})
        for _ in range(3):
            found[uav] = decide(problem.kernel, state, uav, LOOKAHEAD)
            assert found[uav] == decide(fresh.kernel, state, uav, LOOKAHEAD)

    threads = [threading.Thread(target=work, args=(uav,)) for uav in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60.0)

    assert [found.get(uav) for uav in range(4)] == expected


ARGUMENTS = (
    "uav_ids",
    "task_ids",
    "start_enu_m",
    "task_enu_m",
    "speed_m_s",
    "value",
    "service_s",
    "success",
    "survival",
    "horizon_s",
)


def test_ties_after_the_first_round_are_noticed() -> None:
    tied = random_problem(np.random.default_rng(0), 2, 6)
    tied = Problem(
        **{
            **{name: getattr(tied, name) for name in ARGUMENTS},
            "start_enu_m": np.zeros((2, 3)),
            "task_enu_m": np.ones((6, 3)),
            "speed_m_s": np.ones(2),
            "service_s": np.zeros(6),
        }
    )
    apart = table_1()

    for problem, expected in ((tied, True), (apart, False)):
        ranks = [rank_of(range(problem.n_uav))]
        state = TeamState.at_start(problem)
        assert evaluate_sequences(problem.kernel, state, ranks, GREEDY)[1].tolist() == [expected]


def test_uav_that_is_never_free_decides_nothing() -> None:
    problem = table_1()
    state = TeamState.at_start(problem)
    state.free_s[1] = np.inf
    rank = rank_of([1, 0, 2])

    routes, _ = run(problem, state, rank, rule_by_name("greedy"))

    assert decide(problem.kernel, state, 1, GREEDY) is None
    assert routes[1] == []
    assert sum(len(route) for route in routes) == 8


def test_overflowing_numbers_harm_nobody() -> None:
    problem = line_of_tasks([1e300] * 15, horizon_s=1e300)
    far = replace_places(problem, 1e200)
    state = TeamState.at_start(far)

    for code in (GREEDY, LOOKAHEAD):
        found = decide(far.kernel, state, 0, code)
        assert found is not None
        assert 0 <= found[1] < 15
        evaluate_sequences(far.kernel, state, [[0]], code)


def replace_places(problem: Problem, scale: float) -> Problem:
    given_ = {name: getattr(problem, name) for name in ARGUMENTS}
    return Problem(**{**given_, "task_enu_m": problem.task_enu_m * scale})


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("free_s", np.zeros(2)),
        ("free_s", np.zeros((3, 1))),
        ("free_s", np.array([np.nan, 0.0, 0.0])),
        ("free_s", np.array([-np.inf, 0.0, 0.0])),
        ("free_s", ["now", "now", "now"]),
        ("place_enu_m", np.zeros((3, 2))),
        ("place_enu_m", np.zeros(9)),
        ("place_enu_m", np.full((3, 3), np.nan)),
        ("survived", np.array([2.0, 1.0, 1.0])),
        ("survived", np.array([np.nan, 1.0, 1.0])),
        ("survived", np.ones(4)),
        ("open", np.ones(7, dtype=np.bool_)),
        ("open", np.ones(8)),
    ],
)
def test_wrong_state_is_refused_by_name(name: str, value: object) -> None:
    problem = table_1()
    state = TeamState.at_start(problem)
    object.__setattr__(state, name, value)

    with pytest.raises(ValueError, match=name):
        decide(problem.kernel, state, 0, GREEDY)
    for code in (GREEDY, LOOKAHEAD):
        with pytest.raises(ValueError, match=name):
            run_compiled(problem.kernel, state, rank_of([0, 1, 2]), code)
        with pytest.raises(ValueError, match=name):
            evaluate_sequences(problem.kernel, state, [rank_of([0, 1, 2])], code)
        with pytest.raises(ValueError, match=name):
            first_rounds(problem.kernel, state, [rank_of([0, 1, 2])], code)


@pytest.mark.parametrize(
    "rank", [[0, 1], [[0, 1, 2]], [0.0, 1.5, 2.0], ["a", "b", "c"], np.zeros(4, dtype=np.int64)]
)
def test_wrong_ranks_are_refused(rank: object) -> None:
    problem = table_1()
    state = TeamState.at_start(problem)

    with pytest.raises(ValueError, match="rank"):
        run_compiled(problem.kernel, state, rank, GREEDY)  # type: ignore[arg-type] # on purpose


def test_wrong_batches_are_refused() -> None:
    problem = table_1()
    state = TeamState.at_start(problem)
    ranks = [rank_of([0, 1, 2])]

    for threads in (0, -1, 10_000):
        with pytest.raises(ValueError, match="threads"):
            evaluate_sequences(problem.kernel, state, ranks, GREEDY, threads)
    with pytest.raises(ValueError, match="rank"):
        evaluate_sequences(problem.kernel, state, [[0, 1]], GREEDY)
    with pytest.raises(ValueError, match="rank"):
        first_rounds(problem.kernel, state, [0, 1, 2], GREEDY)
    for uav in (-1, 3):
        with pytest.raises(ValueError, match="uav"):
            decide(problem.kernel, state, uav, GREEDY)
    with pytest.raises(ValueError, match="rule"):
        decide(problem.kernel, state, 0, 2)  # type: ignore[arg-type] # wrong on purpose


def test_no_sequences_give_no_results() -> None:
    problem = table_1()
    none = np.zeros((0, 3), dtype=np.int64)

    objectives, tied = evaluate_sequences(problem.kernel, TeamState.at_start(problem), none, GREEDY)

    assert objectives.shape == tied.shape == (0,)


def test_arrays_of_other_layouts_are_converted() -> None:
    problem = table_1()
    state = TeamState.at_start(problem)
    plain = decide(problem.kernel, state, 1, GREEDY)
    other = replace(
        state,
        free_s=np.zeros(3, dtype=np.float32),
        place_enu_m=np.asfortranarray(state.place_enu_m),
        open=np.repeat(state.open, 2)[::2],
    )

    assert decide(problem.kernel, other, 1, GREEDY) == plain


def test_odd_bytes_among_truth_values_are_truths() -> None:
    problem = table_1()
    state = TeamState.at_start(problem)
    plain = decide(problem.kernel, state, 1, GREEDY)
    state.open = np.frombuffer(bytes([255, 2, 1, 128, 7, 1, 3, 4]), dtype=np.bool_)

    assert decide(problem.kernel, state, 1, GREEDY) == plain


class Told:
    """Says stop from the ``after``-th question on."""

    def __init__(self, after: int) -> None:
        self.after = after
        self.asked = 0

    def __call__(self) -> bool:
        self.asked += 1
        return self.asked > self.after


def test_told_to_stop_a_run_ends_with_greedy_decisions() -> None:
    problem = random_problem(np.random.default_rng(2), 3, 30)
    state, rank = TeamState.at_start(problem), rank_of([0, 1, 2])
    whole = run_compiled(problem.kernel, state, rank, LOOKAHEAD)[1].tolist()
    greedy = run_compiled(problem.kernel, state, rank, GREEDY)[1].tolist()

    _, at_once, _, _ = run_compiled(problem.kernel, state, rank, LOOKAHEAD, Told(0))
    _, later, _, _ = run_compiled(problem.kernel, state, rank, LOOKAHEAD, Told(4))

    assert at_once.tolist() == greedy
    assert later[:4].tolist() == whole[:4]
    assert sorted(later.tolist()) == list(range(30))


def test_told_to_stop_only_the_first_of_many_sequences_is_run() -> None:
    problem = random_problem(np.random.default_rng(2), 3, 30)
    state, ranks = TeamState.at_start(problem), [[0, 1, 2], [1, 0, 2], [2, 1, 0]]

    whole = run_sequences(problem.kernel, state, ranks, LOOKAHEAD, 1)
    stopped = run_sequences(problem.kernel, state, ranks, LOOKAHEAD, 1, Told(2))

    assert whole.by_rule.all()
    assert whole.objective.tolist() == pytest.approx(
        [evaluate(problem, whole.lists(k, 3))[0] for k in range(3)]
    )
    assert not stopped.by_rule.any()
    assert np.isnan(stopped.objective).tolist() == [False, True, True]
    assert sorted(task for route in stopped.lists(0, 3) for task in route) == list(range(30))
    assert stopped.lists(1, 3) == [[], [], []]


def test_told_to_stop_first_rounds_are_left_undone() -> None:
    problem = random_problem(np.random.default_rng(2), 3, 30)
    state, ranks = TeamState.at_start(problem), [[0, 1, 2], [1, 0, 2]]

    rounds = first_rounds(problem.kernel, state, ranks, LOOKAHEAD, 1, Told(4))

    assert rounds.tolist() == [
        first_rounds(problem.kernel, state, ranks, LOOKAHEAD)[0].tolist(),
        [UNDONE] * 3,
    ]


@pytest.mark.parametrize("threads", [1, 2])
def test_what_the_question_raises_ends_the_kernel(threads: int) -> None:
    problem = random_problem(np.random.default_rng(2), 3, 30)

    def interrupted() -> bool:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_sequences(
            problem.kernel,
            TeamState.at_start(problem),
            [[0, 1, 2], [1, 0, 2]],
            LOOKAHEAD,
            threads,
            interrupted,
        )
