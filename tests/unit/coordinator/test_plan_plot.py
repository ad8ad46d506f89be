from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from coordinator.planner.options import after_evaluations
from coordinator.planner.plan import make_plan
from coordinator.plot import draw_plan, plan_figure
from coordinator.plot.field import flown_m
from coordinator.plot.labels import Label, place_labels
from coordinator.plot.looks import LATE, path_styles
from swarm.model import Mission, Plan, Task, TaskId, Uav, UavId, Zone, ZoneId
from swarm.model.plan import LeftOut, ScheduleEntry
from swarm.runtime.clock import SystemClock
from swarm.scenario import load_scenario
from swarm.scenario.files import resolve_scenario
from tests.support.problems import table_1_mission


def plan_of(mission: Mission) -> Plan:
    return make_plan(mission, "greedy", clock=SystemClock(), stop=after_evaluations(20))


def texts(figure: Figure) -> list[str]:
    (legend,) = figure.legends
    return [
        *(text.get_text() for text in figure.axes[0].texts),
        legend.get_title().get_text(),
        *(text.get_text() for text in legend.get_texts()),
    ]


def wide_mission(n_uav: int, n_task: int) -> Mission:
    rng = np.random.default_rng(4)
    return Mission(
        name="wide",
        horizon_s=600.0,
        uavs=tuple(Uav(UavId(f"uav{i}"), (0.0, 5.0 * i, 0.0), 12.0) for i in range(n_uav)),
        tasks=tuple(
            Task(TaskId(f"task-{i:02d}"), (*rng.uniform(-900.0, 900.0, 2), 0.0), 1.0 + i % 4)
            for i in range(n_task)
        ),
    )


def test_figure_names_all_places_and_the_worth() -> None:
    mission = table_1_mission()
    figure = plan_figure(mission, plan_of(mission))

    found = texts(figure)
    for name in ("t1", "t8", "uav1, uav2, uav3", "uav1: t2 t3", "sequence: uav1 uav3 uav2"):
        assert name in found
    assert "J = 118.4939\noptimum 120.3335, gap 1.53 %" in found
    axes = figure.axes[0]
    assert axes.get_aspect() == 1.0
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("east [m]", "north [m]")


def test_uavs_differ_by_colour_or_by_line() -> None:
    assert len(set(path_styles(28))) == 28
    assert len({look.dashes for look in path_styles(4)}) == 4


def test_legend_counts_the_tasks_of_long_lists() -> None:
    mission = wide_mission(12, 30)

    found = texts(plan_figure(mission, plan_of(mission)))

    counts = [text for text in found if text.startswith("uav") and "task" in text]
    assert len(counts) == 12
    assert sum(int(text.split()[1]) for text in counts) == 30


def test_pop_ups_and_late_tasks_have_their_own_look() -> None:
    mission = replace(table_1_mission(), horizon_s=2.0)
    late = replace(mission.tasks[0], appears_s=9.0)
    mission = replace(mission, tasks=(late, *mission.tasks[1:]))

    found = texts(plan_figure(mission, plan_of(mission)))

    assert "completed after the horizon" in found
    assert "in no list (appears later)" in found


@pytest.mark.parametrize("n_task", [15, 60])
def test_names_do_not_cover_each_other(n_task: int) -> None:
    mission = wide_mission(4, n_task)
    figure = Figure(figsize=(10.0, 10.0))
    axes = figure.add_subplot()
    axes.set_xlim(-1000.0, 1000.0)
    axes.set_ylim(-1000.0, 1000.0)
    labels = [Label(task.id, task.position_enu_m[:2], 5.0, bold=False) for task in mission.tasks]

    boxes = place_labels(axes, labels, 7.0)

    assert len(boxes) == n_task
    covering = sum(
        bool((a[:2] < b[2:]).all() and (b[:2] < a[2:]).all()) for a, b in combinations(boxes, 2)
    )
    assert covering == 0


def test_same_plan_gives_the_same_picture(tmp_path: Path) -> None:
    mission = table_1_mission()
    plan = plan_of(mission)

    for name in ("a.png", "b.png"):
        draw_plan(mission, plan, tmp_path / name)

    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def test_unknown_kind_of_picture_is_refused(tmp_path: Path) -> None:
    mission = table_1_mission()

    with pytest.raises(ValueError, match=r"\.svg"):
        draw_plan(mission, plan_of(mission), tmp_path / "a.gif")


def test_single_place_and_empty_mission_can_be_drawn() -> None:
    for mission in (wide_mission(1, 0), wide_mission(0, 0), wide_mission(1, 1)):
        plan_figure(mission, plan_of(mission))


def test_map_of_the_field_shows_zones_bases_lines_ways_home_and_what_is_left_out() -> None:
    mission = load_scenario(resolve_scenario("reservoir-inspection"))
    plan = plan_of(mission)
    left = next(iter(plan.completion_s))
    without = {task: time_s for task, time_s in plan.completion_s.items() if task != left}
    routes = {uav: tuple(t for t in tasks if t != left) for uav, tasks in plan.routes.items()}
    left_out = {**plan.left_out, left: LeftOut.ENERGY}
    plan = replace(plan, routes=routes, left_out=left_out, completion_s=without)

    figure = plan_figure(mission, plan)

    found = texts(figure)
    for name in ("village", "bird-island", "dam-yard", "boathouse", "ferry-pier\n285-375 s"):
        assert name in found
    for meaning in ("way home", "line to fly along", "base: batteries are swapped"):
        assert meaning in found
    assert "no flying, paths 20 m away" in found
    assert any(text.startswith("left out: ") for text in found)
    assert "wind 4.1 m/s" in found
    assert len(figure.axes[0].patches) == 2 * len(mission.zones)  # and their margins
    assert "in no list (appears later)" not in found


def test_way_over_a_line_goes_on_along_it() -> None:
    line = Task(
        TaskId("road"), (0.0, 0.0, 0.0), 1.0, path_enu_m=((0.0, 0, 0), (9, 0, 0), (9, 9, 0))
    )
    entry = ScheduleEntry("road", (5.0, 20.0), ((9.0, 9.0),), 0.0, 1.0, 1.0, 2.0, is_reversed=True)

    places_m = flown_m({line.id: line}, entry)

    assert places_m.tolist() == [[5.0, 20.0], [9.0, 9.0], [9.0, 0.0], [0.0, 0.0]]


def test_inclusive_zones_are_shaded_outside() -> None:
    zone = Zone(
        ZoneId("field"), ((-1.0, -1.0), (11.0, -1.0), (11.0, 11.0), (-1.0, 11.0)), inclusive=True
    )
    mission = replace(table_1_mission(), zones=(zone,))

    figure = plan_figure(mission, plan_of(mission))

    (patch,) = figure.axes[0].patches
    assert len(patch.get_path().to_polygons()) == 2  # around the map, and the hole where to fly


def test_an_area_is_shown_whole_and_what_no_list_covers_stands_out() -> None:
    mission = load_scenario(resolve_scenario("hayfield"))
    plan = plan_of(mission)
    some = {task: time_s for task, time_s in plan.completion_s.items() if task > "hay-060"}

    whole, part = (
        plan_figure(mission, replace(plan, completion_s=c)) for c in (plan.completion_s, some)
    )

    found = texts(whole)
    assert {"hay", "farm", "paddock", "barn", "area; light: covered"} <= set(found)
    assert not any(text.startswith("hay-") for text in found[: len(whole.axes[0].texts)])
    light, dark = ("#DCEDC8", LATE)
    assert shaded_m2(whole, dark) < 0.005 * shaded_m2(whole, light)
    assert shaded_m2(part, dark) > 0.3 * shaded_m2(whole, light)


def shaded_m2(figure: Figure, colour: str) -> float:
    """Of patches of that colour, holes counted as well."""
    patches = (
        each for each in figure.axes[0].patches if to_hex(each.get_facecolor()) == to_hex(colour)
    )
    rings = (ring for patch in patches for ring in patch.get_path().to_polygons())
    return abs(sum(signed_m2(np.array(ring)) for ring in rings))


def signed_m2(ring: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> float:
    east_m, north_m = ring.T
    return 0.5 * float(np.dot(east_m, np.roll(north_m, -1)) - np.dot(north_m, np.roll(east_m, -1)))
