"""An area shared out before it is flown, as ground stations do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from sim.study.baselines.strips import Lists, mowing_order, relaunched, strips, taken_over
from swarm.allocation.field import FieldProblem, FieldState
from swarm.kernels.field import FlownLists, fly_lists
from swarm.model import Mission, Task
from tests.support.area_missions import SQUARE, paddock

EAST = "[[300, 0], [360, 0], [360, 90], [300, 90]]"


def shared_out(mission: Mission) -> tuple[FieldProblem, Lists]:
    problem = FieldProblem.from_mission(mission)
    by_id = {task.id: task for task in mission.tasks}
    return problem, strips(problem, [[by_id[i] for i in area.line_ids] for area in mission.areas])


def tasks_of(items: Sequence[int]) -> list[int]:
    return [item >> 1 for item in items if item >= 0]


def flown(problem: FieldProblem, lists: Lists) -> FlownLists:
    return fly_lists(problem.kernel, FieldState.at_start(problem), lists)


def ways(tasks: tuple[Task, ...], items: list[int]) -> list[tuple[float, ...]]:
    """Where each item is entered and left: north of each end, and the strip's east [m]."""
    ends = [
        [tasks[item >> 1].path_enu_m[end] for end in (item & 1, 1 - (item & 1))] for item in items
    ]
    return [(first[0], first[1], last[1]) for first, last in ends]


def test_strips_are_mown_to_and_fro_whichever_way_lines_are_told() -> None:
    mission = paddock()
    turned = [n % 3 == 1 for n in range(len(mission.tasks))]
    tasks = tuple(
        replace(task, path_enu_m=task.path_enu_m[::-1], position_enu_m=task.path_enu_m[-1])
        if turn
        else task
        for task, turn in zip(mission.tasks, turned, strict=True)
    )

    found = ways(tasks, mowing_order(tasks))

    # Its side is that of the first line's left or right: both are an order in which one mows.
    strips_east_m = [15.0, 45.0, 75.0, 105.0, 135.0, 165.0]
    if found[0][0] > 90.0:
        strips_east_m.reverse()
    north = [(0.0, 90.0), (90.0, 180.0)], [(180.0, 90.0), (90.0, 0.0)]
    expected = [
        (east_m, *way) for number, east_m in enumerate(strips_east_m) for way in north[number % 2]
    ]
    np.testing.assert_allclose(found, expected, atol=0.01)


def test_lines_of_a_strip_stay_together_where_rounding_moves_them() -> None:
    mission = paddock()
    moved = tuple(
        replace(
            task,
            position_enu_m=_east(task.path_enu_m[0], shift_m),
            path_enu_m=tuple(_east(point, shift_m) for point in task.path_enu_m),
        )
        for task, shift_m in zip(mission.tasks, [0.024, 0.026] * 6, strict=True)
    )

    assert mowing_order(moved) == mowing_order(mission.tasks)


def _east(point: tuple[float, float, float], by_m: float) -> tuple[float, float, float]:
    return point[0] + by_m, *point[1:]


@pytest.mark.parametrize("endurance_s", [None, 100.0])
def test_everybody_flies_as_much_and_swaps_batteries_where_it_must(
    endurance_s: float | None,
) -> None:
    mission = paddock(endurance_s=endurance_s)

    problem, lists = shared_out(mission)

    assert flown(problem, lists).feasible
    tasks = [tasks_of(own) for own in lists]
    assert sorted(tasks[0] + tasks[1]) == list(range(12))
    assert [len(own) for own in tasks] == [6, 6]
    east_m = [{round(mission.tasks[task].path_enu_m[0][0]) for task in own} for own in tasks]
    assert {frozenset(own) for own in east_m} == {
        frozenset({15, 45, 75}),
        frozenset({105, 135, 165}),
    }
    swaps = sum(item < 0 for own in lists for item in own)
    assert (swaps > 0) is (endurance_s is not None)


def test_several_areas_are_one_length_to_share() -> None:
    mission = paddock(areas=(SQUARE, EAST))

    problem, lists = shared_out(mission)

    assert problem.n_task == 14
    assert [len(own) for own in lists] == [7, 7]
    assert flown(problem, lists).feasible
    assert {12, 13} < {item >> 1 for item in lists[1]}


@pytest.mark.parametrize("lost", [0, 1])
@pytest.mark.parametrize("slots", [0, 1])
def test_who_is_through_first_flies_what_the_lost_one_has_not(lost: int, slots: int) -> None:
    problem, lists = shared_out(paddock(endurance_s=100.0, slots=slots))
    before = np.split(flown(problem, lists).times_s[:, 3], [len(lists[0])])[lost]
    lost_s = float(before[3]) + 1.0

    after, heir = taken_over(problem, lists, lost, lost_s)

    assert heir == 1 - lost
    assert tasks_of(after[lost]) == tasks_of(lists[lost][:4])
    assert tasks_of(after[heir]) == tasks_of(lists[heir]) + tasks_of(lists[lost][4:])
    times_s = flown(problem, after).times_s
    assert np.isfinite(times_s).all()
    ends_s = np.split(times_s[:, 3], [len(after[0])])
    assert ends_s[lost].max(initial=0.0) <= lost_s
    assert ends_s[heir].max() > before.max()


@pytest.mark.parametrize("slots", [0, 1])
@pytest.mark.parametrize("endurance_s", [None, 75.0, 100.0])
@pytest.mark.parametrize("lost", [0, 1])
def test_who_lands_first_sets_out_anew_from_the_base_with_a_full_battery(
    lost: int, endurance_s: float | None, slots: int
) -> None:
    problem, lists = shared_out(paddock(endurance_s=endurance_s, slots=slots))
    lost_s = 1.0
    straight_on, _ = taken_over(problem, lists, lost, lost_s)

    after, heir = relaunched(problem, lists, lost, lost_s)

    assert heir == 1 - lost
    own = len(lists[heir])
    assert list(after[heir][:own]) == list(lists[heir])
    assert after[heir][own] == -1
    assert tasks_of(after[heir][own:]) == tasks_of(lists[lost])
    landing, straight = flown(problem, after), flown(problem, straight_on)
    assert landing.feasible
    assert landing.times_s[:, 3].max() >= straight.times_s[:, 3].max() - 1e-6


def test_nobody_sets_out_anew_where_nothing_is_left_to_take_over() -> None:
    problem, lists = shared_out(paddock())
    after, heir = relaunched(problem, lists, 0, 1e4)
    assert after == [list(own) for own in lists]
    assert heir == 1
