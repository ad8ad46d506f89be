"""Teams in the field: compiled schedules and rules, held against plain loops and the oracle."""

from __future__ import annotations

import itertools
import random
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from swarm.allocation.field import FieldProblem, FieldState
from swarm.kernels import field
from swarm.kernels.field import FIELD_GREEDY, FIELD_LOOKAHEAD, FieldRefusal
from tests.support.field_dilemmas import dilemma
from tests.support.field_missions import mission_of
from tests.support.field_oracle.flight import FlightTimes
from tests.support.field_oracle.made_up import KINDS, made_up
from tests.support.field_oracle.scenario import read
from tests.support.field_oracle.schedule import Swap, Work
from tests.support.field_oracle.slots import fly_all
from tests.support.field_reference import Flown, PlainField, greedy_base, greedy_step
from tests.support.field_states import random_state, with_landings
from tests.support.seeds import seeds, sweeps

LISTS = 6
ARCS_IN_WIND = 1e-3
"""The oracle flies arcs in straight pieces of half a degree."""


def problem_of(draft: dict[str, Any]) -> FieldProblem:
    return FieldProblem.from_mission(mission_of(draft).known_at_start())


def random_lists(rng: random.Random, problem: FieldProblem) -> list[list[int]]:
    """Some tasks on some lists, with bases in between."""
    tasks = rng.sample(range(problem.n_task), rng.randint(1, problem.n_task))
    lists: list[list[int]] = [[] for _ in range(problem.n_uav)]
    for task in tasks:
        items = lists[rng.randrange(problem.n_uav)]
        if problem.n_base and rng.random() < 0.5:
            base = -1 - rng.randrange(problem.n_base)
            if not items or items[-1] != base:
                items.append(base)
        items.append(2 * task + (rng.randrange(2) if problem.is_line[task] else 0))
    return lists


def assert_same(flown: field.FlownLists, plain: list[Flown], lists: list[list[int]]) -> None:
    """To the last bit."""
    first = 0
    for uav, one in enumerate(plain):
        done = len(one.times)
        times = [tuple(row) for row in flown.times_s[first : first + done].tolist()]
        assert times == one.times
        assert np.isnan(flown.times_s[first + done : first + len(lists[uav])]).all()
        assert flown.done[uav] == done
        assert flown.refusal[uav] == one.refusal
        assert flown.value[uav] == one.stand.value
        if done:
            assert flown.home[uav] == one.home
            assert tuple(flown.home_s[uav]) == one.home_s
        else:
            assert np.isnan(flown.home_s[uav]).all()
        first += len(lists[uav])


@pytest.mark.parametrize("sweep", sweeps(4, 30))
@pytest.mark.parametrize("kind", KINDS)
def test_schedules_are_those_of_plain_loops_and_of_the_oracle(kind: str, sweep: range) -> None:
    for seed in sweep:
        rng = random.Random(seed)
        n_uav = rng.choice([2, 3, 4])
        draft = made_up(seed, kind, n_uavs=n_uav, n_tasks=6)
        problem, scenario = problem_of(draft), read(draft)
        times = FlightTimes(scenario)
        for _ in range(LISTS):
            sequence = rng.sample(range(n_uav), n_uav)
            state = FieldState.at_start(problem, sequence)
            lists = random_lists(rng, problem)
            plain = PlainField(problem, state).fly(lists)

            assert_same(field.fly_lists(problem.kernel, state, lists), plain, lists)

            named = {
                scenario.uavs[uav].id: [
                    Swap(problem.base_ids[-1 - item])
                    if item < 0
                    else Work(problem.task_ids[item // 2], bool(item % 2))
                    for item in items
                ]
                for uav, items in enumerate(lists)
            }
            ids = [scenario.uavs[uav].id for uav in sequence]
            flights = fly_all(scenario, times, named, ids)
            close = ARCS_IN_WIND if kind == "all" else 1e-8
            for uav, one in enumerate(plain):
                flight = flights[scenario.uavs[uav].id]
                assert (flight.refused is None) == (one.refusal is FieldRefusal.NONE)
                assert flight.value == pytest.approx(one.stand.value, rel=close, abs=close)
                for entry, four in zip(flight.entries, one.times, strict=False):
                    theirs = entry.depart_s, entry.arrive_s, entry.begin_s, entry.end_s
                    assert theirs == pytest.approx(four, abs=close)
                if lists[uav] and flight.refused is None:
                    home = f"base:{problem.base_ids[one.home]}" if one.home >= 0 else "start"
                    assert flight.entries[-1].go == home
                    assert flight.entries[-1].arrive_s == pytest.approx(one.home_s[1], abs=close)


@pytest.mark.parametrize("lands", [False, True])
@pytest.mark.parametrize("kind", ["slots", "energy", "windows", "all"])
def test_schedules_from_mid_mission_are_those_of_plain_loops(kind: str, lands: bool) -> None:
    waits = 0
    for seed in range(20):
        rng = random.Random(f"mid-{seed}")
        problem = problem_of(made_up(seed, kind, n_uavs=4, n_tasks=6))
        problem = with_landings(rng, problem) if lands else problem
        for _ in range(LISTS):
            state, lists = random_state(rng, problem), random_lists(rng, problem)
            flown = field.fly_lists(problem.kernel, state, lists)

            assert_same(flown, PlainField(problem, state).fly(lists), lists)
            waits += int((flown.times_s[:, 2] > flown.times_s[:, 1]).sum())
    assert waits > 5 or kind != "slots"


def test_of_two_arrivals_at_one_instant_the_sequence_decides() -> None:
    for first in (0, 1):
        problem, state = twins([first, 1 - first])

        flown = field.fly_lists(problem.kernel, state, [[-1, 0], [-1, 2]])

        assert flown.feasible
        begins_s = flown.times_s[[0, 2], 2]
        assert begins_s[first] == 10.0
        assert begins_s[1 - first] == 10.0 + 30.0


def test_who_waits_for_a_slot_lands_after_it_has_waited() -> None:
    problem, _ = twins([0, 1])
    problem = problem.calibrated([1.0, 1.0], [1.0, 1.0], [4.0, 7.0], [3.0, 3.0])

    flown = field.fly_lists(problem.kernel, FieldState.at_start(problem), [[-1, 0], [-1, 2]])

    assert flown.feasible
    assert flown.times_s[0].tolist() == [0.0, 14.0, 14.0, 44.0]
    # The slot is free when the other one takes off to climb; its own landing comes after that.
    assert flown.times_s[2].tolist() == [0.0, 17.0, 44.0 + 7.0, 44.0 + 7.0 + 30.0]


def test_who_comes_while_a_slot_becomes_free_lands_no_later_than_it_must() -> None:
    """It is above the base just before the slot is free, and on the ground long after that."""
    problem, state = twins([0, 1])
    problem = problem.calibrated([1.0, 1.0], [1.0, 1.0], [4.0, 7.0])
    state = FieldState.at_start(problem)
    state.landed_at[0] = 0
    state.free_s[0] = 12.0
    state.first_s[0] = problem.leg_s[problem.kind[0], problem.n_uav]

    flown = field.fly_lists(problem.kernel, state, [[0], [-1, 2]])

    assert flown.times_s[1].tolist() == [0.0, 17.0, 12.0 + 7.0, 12.0 + 7.0 + 30.0]


def test_who_waits_on_the_ground_keeps_the_slot() -> None:
    problem, state = twins([0, 1], opens_s=100.0)

    flown = field.fly_lists(problem.kernel, state, [[-1, 0], [-1, 2]])

    assert flown.times_s[1, 0] == 90.0  # departs to arrive when the task opens
    assert flown.times_s[2, 2] == 90.0  # and only then the other one touches down


def twins(sequence: list[int], **first: float) -> tuple[FieldProblem, FieldState]:
    """Two UAVs 100 m from a base with one slot, and a task each 100 m beyond it."""
    draft: dict[str, Any] = {
        "name": "twins",
        "mission": {"horizon_s": 600.0},
        "uav": [
            {"id": "u1", "position_m": [-100.0, 0.0], "speed_m_s": 10.0, "endurance_s": 200.0},
            {"id": "u2", "position_m": [0.0, -100.0], "speed_m_s": 10.0, "endurance_s": 200.0},
        ],
        "base": [{"id": "b", "position_m": [0.0, 0.0], "swap_s": 30.0, "slots": 1}],
        "task": [
            {"id": "t1", "position_m": [100.0, 0.0], "value": 1.0, **first},
            {"id": "t2", "position_m": [0.0, 100.0], "value": 1.0},
        ],
    }
    problem = problem_of(draft)
    return problem, FieldState.at_start(problem, sequence)


@pytest.mark.parametrize("sweep", sweeps(4, 30))
@pytest.mark.parametrize("kind", KINDS)
def test_greedy_takes_what_plain_loops_take(kind: str, sweep: range) -> None:
    for seed in sweep:
        rng = random.Random(f"greedy-{seed}")
        problem = problem_of(made_up(seed, kind, n_uavs=3, n_tasks=6))

        check_greedy(problem, FieldState.at_start(problem, rng.sample(range(3), 3)))


@pytest.mark.parametrize("seed", seeds(10, 300))
def test_greedy_reckons_with_waits_for_slots_as_plain_loops_do(seed: int) -> None:
    """Who is known to be ahead at a base stays there for its swap, or until it is to depart."""
    rng = random.Random(f"landings-{seed}")
    for draft in (crowd(seed), dilemma(seed, 4, 8, slots=True)):
        for problem in (problem_of(draft), with_landings(rng, problem_of(draft))):
            check_greedy(problem, FieldState.at_start(problem))
            check_greedy(problem, random_state(random.Random(seed), problem))


def test_waits_for_slots_that_greedy_reckons_with_are_many() -> None:
    waits = 0
    for seed in range(10):
        problem = problem_of(crowd(seed))
        runs = field.run_rule(problem.kernel, FieldState.at_start(problem), FIELD_GREEDY)
        waits += int((runs.times_s[runs.items < 0, 2] > runs.times_s[runs.items < 0, 1]).sum())

    assert waits >= 10


def crowd(seed: int) -> dict[str, Any]:
    """Five UAVs west of a base with one slot that all need it for the tasks east of it."""
    rng = random.Random(f"crowd-{seed}")
    battery = {"endurance_s": 300.0, "reserve_frac": 0.0, "charge_frac": 0.09}
    starts_m = [[rng.uniform(-120.0, -90.0), rng.uniform(-50.0, 50.0)] for _ in range(5)]
    places_m = [[rng.uniform(100.0, 180.0), rng.uniform(-150.0, 150.0)] for _ in range(8)]
    base = {"id": "b", "position_m": [0.0, 0.0], "swap_s": rng.uniform(2.0, 6.0), "slots": 1}
    return {
        "name": "crowd",
        "mission": {"horizon_s": 600.0},
        "uav": [
            {"id": f"u{i}", "position_m": place_m, "speed_m_s": 10.0} | battery
            for i, place_m in enumerate(starts_m)
        ],
        "base": [base],
        "task": [
            {"id": f"t{i}", "position_m": place_m, "value": 1.0}
            for i, place_m in enumerate(places_m)
        ],
    }


def check_greedy(problem: FieldProblem, state: FieldState) -> None:
    """Decision after decision, with the lists as they were then flown by plain loops."""
    runs = field.run_rule(problem.kernel, state, FIELD_GREEDY)

    assert field.fly_lists(problem.kernel, state, runs.lists(problem.n_uav)).feasible
    assert all(items[-1] >= 0 for items in runs.lists(problem.n_uav) if items)
    plain = PlainField(problem, state)
    lists: list[list[int]] = [[] for _ in range(problem.n_uav)]
    open_tasks = set(range(problem.n_task))
    key = (-1.0, -1)
    decisions = zip(runs.uavs, runs.items, runs.decided_s, runs.times_s.tolist(), strict=True)
    for uav, item, decided_s, times_s in decisions:
        stand = plain.fly(lists)[uav].stand
        assert decided_s == stand.time_s
        assert (decided_s, int(state.rank[uav])) >= key
        key = decided_s, int(state.rank[uav])
        best = greedy_step(plain, uav, stand, sorted(open_tasks))
        if item < 0:
            assert best is None
            here = int(state.landed_at[uav])
            if lists[uav]:
                here = -1 - lists[uav][-1] if stand.landed else -1
            base = greedy_base(plain, uav, lists, here, sorted(open_tasks))
            assert base == -1 - item
        else:
            assert best == item
            open_tasks.remove(item // 2)
        lists[uav].append(int(item))
        assert tuple(times_s) == plain.fly(lists)[uav].times[-1]
    for uav, flown in enumerate(plain.fly(lists)):
        if state.active[uav]:
            assert greedy_step(plain, uav, flown.stand, sorted(open_tasks)) is None


@pytest.mark.parametrize("kind", ["slots", "energy", "all"])
def test_lists_of_greedy_fly_as_it_has_flown_them(kind: str) -> None:
    for seed in range(20):
        rng = random.Random(f"slots-{seed}")
        problem = problem_of(made_up(seed, kind, n_uavs=4, n_tasks=6))
        state = random_state(rng, problem)
        runs = field.run_rule(problem.kernel, state, FIELD_GREEDY)
        lists = runs.lists(problem.n_uav)
        flown = field.fly_lists(problem.kernel, state, lists)

        assert flown.feasible
        nth = np.cumsum([0, *(len(items) for items in lists)])
        for uav, item, times_s in zip(runs.uavs, runs.items, runs.times_s, strict=True):
            if item >= 0:  # what is known of bases at the decision may change
                assert times_s.tolist() == flown.times_s[nth[uav]].tolist()
            nth[uav] += 1


def test_greedy_swaps_twice_in_a_row_where_one_swap_does_not_do() -> None:
    draft: dict[str, Any] = {
        "name": "far",
        "mission": {"horizon_s": 900.0},
        "uav": [
            {
                "id": "u1",
                "position_m": [0.0, 0.0],
                "speed_m_s": 10.0,
                "endurance_s": 50.0,
                "reserve_frac": 0.0,
            }
        ],
        "base": [
            {"id": "b1", "position_m": [400.0, 0.0]},
            {"id": "b2", "position_m": [800.0, 0.0]},
        ],
        "task": [{"id": "t", "position_m": [1000.0, 0.0], "value": 1.0}],
    }
    problem = problem_of(draft)
    state = FieldState.at_start(problem)

    step = field.decide(problem.kernel, state, 0, FIELD_GREEDY)
    runs = field.run_rule(problem.kernel, state, FIELD_GREEDY)

    assert step is not None
    assert step.item == -1
    assert step.score is None
    assert runs.lists(1) == [[-1, -2, 0]]
    state.open[0] = False
    assert field.decide(problem.kernel, state, 0, FIELD_GREEDY) is None


def test_a_run_that_is_told_to_stop_leaves_the_rest() -> None:
    """It asks after so many decisions; what was decided until then is what is always decided."""
    problem = problem_of(made_up(0, "acceleration", n_uavs=3, n_tasks=12))
    state = FieldState.at_start(problem)
    whole = field.run_rule(problem.kernel, state, FIELD_LOOKAHEAD)
    assert len(whole.items) == 12

    taken = [len(stopped_run(problem, state, after).items) for after in range(3)]

    assert taken == sorted(set(taken))
    assert 0 < taken[0] < taken[-1] < 12
    for after, count in enumerate(taken):
        assert stopped_run(problem, state, after).items.tolist() == whole.items[:count].tolist()


@pytest.mark.parametrize("seed", seeds(4, 100))
def test_lists_of_a_stopped_run_can_be_flown_and_end_with_tasks(seed: int) -> None:
    problem = problem_of(dilemma(seed, 4, 7, slots=True))
    state = FieldState.at_start(problem)
    for after in range(6):
        lists = stopped_run(problem, state, after).lists(problem.n_uav)

        assert field.fly_lists(problem.kernel, state, lists).feasible
        assert all(items[-1] >= 0 for items in lists if items)


def stopped_run(problem: FieldProblem, state: FieldState, after: int) -> field.FieldRuns:
    """What lookahead has decided when it is told to stop, having asked ``after`` times before."""
    asked = itertools.count()
    return field.run_rule(problem.kernel, state, FIELD_LOOKAHEAD, lambda: next(asked) >= after)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("kind", np.array([0, 9])),
        ("leg_s", np.full((2, 7, 7), np.nan)),
        ("enter", np.full((4, 2), 99)),
        ("opens_s", np.full(4, np.inf)),
        ("due_s", np.full(4, np.nan)),
        ("survival", np.full((2, 4), 1.5)),
        ("full_s", np.full(2, -1.0)),
        ("swap_s", np.zeros(3)),
        ("first_s", np.full(2, np.nan)),
        ("horizon_s", 0.0),
    ],
)
def test_wrong_numbers_are_refused_by_name(name: str, value: Any) -> None:
    problem = problem_of(made_up(1, "slots"))

    with pytest.raises(ValueError, match=name):
        replace(problem, **{name: value})


@pytest.mark.parametrize(
    ("lists", "words"),
    [
        ([[0], [0]], "no task twice"),
        ([[99], []], "items of the problem"),
        ([[-9], []], "items of the problem"),
        ([[0]], "offsets must have shape"),
    ],
)
def test_wrong_lists_are_refused(lists: list[list[int]], words: str) -> None:
    problem = problem_of(made_up(1, "slots"))
    state = FieldState.at_start(problem)

    with pytest.raises(ValueError, match=words):
        field.fly_lists(problem.kernel, state, lists)


def test_a_state_of_another_team_is_refused() -> None:
    problem, other = (problem_of(made_up(1, "slots", n_uavs=n)) for n in (2, 3))

    with pytest.raises(ValueError, match="free_s must have shape"):
        field.run_rule(problem.kernel, FieldState.at_start(other), FIELD_GREEDY)
