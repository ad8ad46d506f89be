"""Coverage over time, and area missions flown by several methods."""

from __future__ import annotations

import json
from dataclasses import replace
from importlib.metadata import EntryPoint
from pathlib import Path

import numpy as np
import pytest
import shapely

from sim.bench.area_coverage import CoverageCurve, FlownLine, SurveyedGround
from sim.bench.area_methods import METHODS, AreaCase, Loss, SearchTimes
from sim.bench.areas import ONE_LOSS, UNDISTURBED, AreasBench, measure_areas
from swarm.cli import main
from swarm.model import Mission, TaskId
from swarm.runtime.clock import SystemClock
from swarm.runtime.errors import InputError
from swarm.scenario import format_scenario, load_scenario
from swarm.survey.coverage import reach_m
from tests.support.area_missions import SQUARE, paddock

COMMANDS = {"bench": EntryPoint("bench", "sim.bench.cli:bench", "peckorder.commands")}
TIMES = SearchTimes(guided_s=0.1, ortools_s=2.0)
EAST = "[[300, 0], [360, 0], [360, 90], [300, 90]]"


def one_after_another(mission: Mission) -> list[FlownLine]:
    """Each line takes 9 s, 4 s after the one before."""
    return [
        FlownLine(task.id, 13.0 * n + 4.0, 13.0 * (n + 1)) for n, task in enumerate(mission.tasks)
    ]


def test_the_curve_is_what_is_flown_over_and_exact_between_lines() -> None:
    mission = paddock()
    ground, lines = SurveyedGround(mission), one_after_another(mission)

    curve = CoverageCurve.of(ground, reversed(lines))

    times_s = np.linspace(0.0, 170.0, 341)
    square = shapely.box(0.0, 0.0, 180.0, 180.0)
    sampled = [_covered(mission, lines, time_s, square) for time_s in times_s.tolist()]
    # Round ends of lines, and what neighbours cover as well, do not grow with the way flown.
    np.testing.assert_allclose(curve.at(times_s), sampled, atol=0.02)
    between = [13.0 * n + 2.0 for n in range(13)]
    exact = [ground.share([line.task for line in lines[:n]]) for n in range(13)]
    np.testing.assert_allclose(curve.at(np.array(between)), exact, atol=1e-12)
    assert curve.covered == exact[-1] == pytest.approx(1.0)
    fine_s = np.linspace(0.0, 200.0, 200_001)
    assert curve.mean(200.0) == pytest.approx(float(curve.at(fine_s).mean()), abs=1e-5)


def _covered(
    mission: Mission, lines: list[FlownLine], time_s: float, square: shapely.Polygon
) -> float:
    paths = []
    for line, task in zip(lines, mission.tasks, strict=True):
        share = (time_s - line.begin_s) / (line.end_s - line.begin_s)
        if share > 0.0:
            path = shapely.LineString([point[:2] for point in task.path_enu_m])
            end = path.interpolate(min(1.0, share), normalized=True)
            paths.append(shapely.LineString([path.coords[0], end.coords[0]]))
    wide = shapely.union_all(
        shapely.buffer(np.array(paths), reach_m(mission.areas[0]), cap_style="flat")
    )
    return float(square.intersection(wide).area / square.area)


def test_the_time_is_that_of_the_line_with_which_enough_is_covered() -> None:
    mission = paddock()
    curve = CoverageCurve.of(SurveyedGround(mission), one_after_another(mission))

    assert curve.reached_s(0.995) == 13.0 * 12
    assert curve.reached_s(0.45) == 13.0 * 6  # five cover 5/12 and what is a metre beyond
    assert curve.reached_s(0.0) == 13.0
    partly = CoverageCurve.of(SurveyedGround(mission), one_after_another(mission)[:5])
    assert partly.reached_s(0.995) is None
    nothing = CoverageCurve.of(SurveyedGround(mission), [])
    assert (nothing.covered, nothing.makespan_s, nothing.mean(10.0)) == (0.0, 0.0, 0.0)
    with pytest.raises(ValueError, match="until_s must be >= 156"):
        curve.mean(100.0)


def test_areas_count_by_their_size() -> None:
    mission = paddock(areas=(SQUARE, EAST))
    ground = SurveyedGround(mission)

    east = [TaskId("field2-01"), TaskId("field2-02")]

    assert ground.share(east) == pytest.approx(60.0 * 90.0 / (180.0**2 + 60.0 * 90.0))
    assert ground.share([task.id for task in mission.tasks]) == pytest.approx(1.0)


@pytest.fixture(scope="module")
def bench() -> AreasBench:
    methods = ["guided", "strips", "strips-relaunched", "ortools", "ortools-makespan-warm"]
    mission = paddock(endurance_s=100.0, slots=1)
    return measure_areas(mission, [0, 3], methods, TIMES, SystemClock())


def test_all_cover_everything_and_are_compared_with_the_best(bench: AreasBench) -> None:
    cases = [(run.case, run.method, run.seed) for run in bench.runs]
    assert cases == [
        (UNDISTURBED, "guided", 0),
        (UNDISTURBED, "guided", 3),
        (UNDISTURBED, "strips", None),
        (UNDISTURBED, "ortools", None),
        (UNDISTURBED, "ortools-makespan-warm", None),
        *(
            (ONE_LOSS, method, seed)
            for seed in (0, 3)
            for method in ("guided", "strips", "strips-relaunched")
        ),
    ]
    for run in bench.runs:
        assert run.covered > 0.995, run
        assert run.lines == 12
        assert run.covered_s == run.makespan_s
        assert 0.0 < run.mean_covered < 1.0
    rows = list(bench.rows())
    for case in (UNDISTURBED, ONE_LOSS):
        of_case = [row for row in rows if row.case == case]
        assert min(row.covered_ratio or np.inf for row in of_case) >= 1.0
        assert max(row.mean_ratio for row in of_case) <= 1.0


def test_a_loss_is_drawn_by_the_seed_and_met_by_both(bench: AreasBench) -> None:
    strips_s = next(run.makespan_s for run in bench.runs if run.method == "strips")
    lost = [(run.lost, run.lost_s) for run in bench.runs if run.case == ONE_LOSS]
    assert lost[0] == lost[1] == lost[2] != lost[3] == lost[4] == lost[5]
    for _, lost_s in lost:
        assert lost_s is not None
        assert 0.2 * strips_s <= lost_s <= 0.6 * strips_s
    for run in bench.runs:
        if run.case == ONE_LOSS and run.method != "guided":
            assert run.makespan_s > strips_s


def test_whoever_sets_out_anew_needs_a_base() -> None:
    case = AreaCase(replace(paddock(), bases=()), TIMES, SystemClock())
    assert METHODS["strips-relaunched"].refusal(case) == "there is no base to set out from anew"
    assert METHODS["strips"].refusal(case) is None


def test_agents_fly_what_the_plan_says_or_better_if_nobody_is_lost_before_its_end() -> None:
    case = AreaCase(paddock(endurance_s=100.0), TIMES, SystemClock())
    guided = METHODS["guided"]
    assert guided.fly is not None
    assert guided.fly_under_loss is not None
    planned = guided.fly(case, 1)
    late_s = max(line.end_s for line in planned.lines) + 100.0

    flown = guided.fly_under_loss(case, 1, Loss(case.problem.uav_ids[0], late_s))

    took_s = {line.task: line.end_s - line.begin_s for line in planned.lines}
    assert len(flown.lines) == 12
    for line in flown.lines:
        assert line.end_s - line.begin_s == pytest.approx(took_s[line.task], abs=1e-6)
    assert flown.objective >= (1.0 - 1e-9) * planned.objective


def test_the_command_tells_people_and_programs(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scenario, plot, out = tmp_path / "paddock.toml", tmp_path / "a.png", tmp_path / "a.md"
    scenario.write_text(format_scenario(paddock()), "utf-8")
    options = ["--seeds", "2", "--time-limit-s", "0.1", "--methods", "guided,strips"]

    command = ["bench", "areas", str(scenario), *options]
    assert main([*command, "--plot", str(plot), "--out", str(out)], commands=COMMANDS) == 0
    said = capsys.readouterr().out
    assert "Undisturbed" in said
    assert "One loss" in said
    assert max(map(len, said.splitlines())) <= 80
    assert plot.stat().st_size > 1000
    assert "| method" in out.read_text("utf-8")
    assert main([*command, "--json"], commands=COMMANDS) == 0
    told = json.loads(capsys.readouterr().out)
    assert [row["method"] for row in told["methods"]] == ["guided", "strips"] * 2
    assert told["runs"][0]["curve"]["covered"][-1] == told["runs"][0]["covered"]


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        ("[[task]]", "has tasks that are no lines of areas, such as extra"),
        ("no area", "has no areas to cover"),
        ("one uav", "has nobody to share its areas with"),
        ("later", "does not know field1 from the start"),
    ],
)
def test_missions_that_are_none_of_areas_are_refused(change: str, problem: str) -> None:
    mission = paddock()
    if change == "[[task]]":
        extra = replace(mission.tasks[0], id=TaskId("extra"))
        mission = replace(mission, tasks=(*mission.tasks, extra))
    elif change == "no area":
        mission = replace(mission, areas=())
    elif change == "one uav":
        mission = replace(mission, uavs=mission.uavs[:1])
    else:
        mission = replace(mission, areas=(replace(mission.areas[0], appears_s=5.0),))
    with pytest.raises(InputError, match=problem):
        AreaCase(mission, TIMES, SystemClock())


def test_a_method_that_is_none_is_refused_before_anything_is_flown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scenario = tmp_path / "paddock.toml"
    scenario.write_text(format_scenario(paddock()), "utf-8")
    assert load_scenario(scenario).areas
    status = main(["bench", "areas", str(scenario), "--methods", "strip"], commands=COMMANDS)
    assert status == 2
    assert "--methods: strip: no such method; did you mean 'strips'?" in capsys.readouterr().err
