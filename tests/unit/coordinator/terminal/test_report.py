"""The report: right in every form, and refused early where it cannot be written."""

from __future__ import annotations

import io
import json
import math
from dataclasses import replace
from pathlib import Path

import pytest
from rich.cells import cell_len
from rich.console import Console

from coordinator.mission_view.mission_state import MissionState
from coordinator.planner.plan import make_plan
from coordinator.planner.plan_report import plan_as_json
from coordinator.terminal.report import MissionReport, check_report_path, write_report
from swarm.model import Plan, UavId
from swarm.protocol.uav_messages import AttemptResult
from swarm.runtime.clock import SystemClock
from swarm.runtime.errors import InputError
from tests.support.observed_mission import Teller, random_mission, shipped, watch

ADDED_KEYS = (
    "executed_routes",
    "executed_objective",
    "done",
    "failed",
    "open",
    "duplicate_visits",
    "makespan_s",
    "lost_uavs",
    "epochs",
)


def report_of(mission_state: MissionState) -> MissionReport:
    return MissionReport(
        mission_state.mission,
        mission_state.plan,
        mission_state.result(),
        tuple(mission_state.story),
    )


def rendered(report: MissionReport, width: int = 80, *, encoding: str = "utf-8") -> str:
    raw = io.BytesIO()
    file = io.TextIOWrapper(raw, encoding=encoding)
    report.render(Console(file=file, width=width, color_system=None))
    file.flush()
    text = raw.getvalue().decode(encoding)
    assert max(cell_len(line) for line in text.splitlines()) <= width
    return text


def test_faultless_mission_is_reported_as_planned() -> None:
    report = report_of(watch(shipped("table-1")))

    text = rendered(report)

    verdict = "table-1: All 8 tasks done in 3.06 s of mission time, every list as planned"
    assert text.splitlines()[0] == verdict
    assert text.count("as planned  ") == 3
    assert "t2@0.90 t3@2.18" in text
    worth = " ".join(next(line for line in text.splitlines() if "objective J" in line).split())
    assert worth == "objective J [value·s] 118.49 118.49 100.00 % 120.33 98.47 %"
    assert "--report" in text.splitlines()[-1]
    assert report.result.is_complete


def test_json_holds_the_plan_and_what_was_flown() -> None:
    mission_state = watch(shipped("table-1"))
    report = replace(report_of(mission_state), takeoff_s=9.5, wall_s=4.0, speedup=4.0)

    found = json.loads(json.dumps(report.as_json(), allow_nan=False))

    assert mission_state.plan is not None
    planned = plan_as_json(mission_state.plan)
    assert {key: found[key] for key in planned} == json.loads(json.dumps(planned))
    assert all(key in found for key in ADDED_KEYS)
    assert found["executed_routes"] == found["routes"]
    assert found["executed_objective"] == pytest.approx(118.4939, abs=1e-4)
    assert found["done"] == [f"t{number}" for number in range(1, 9)]
    assert (found["failed"], found["open"], found["lost_uavs"]) == ([], [], [])
    assert found["makespan_s"] == pytest.approx(max(found["executed_completion_s"].values()))
    assert (found["takeoff_s"], found["speedup"], found["epochs"]) == (9.5, 4.0, 1)
    assert found["story"][0]["text"].startswith("epoch 1")


def test_lost_uav_and_take_over_are_told_with_both_lists() -> None:
    report = report_of(watch(shipped("table-1"), lost_at_s={UavId("uav2"): 1.3}))

    text = rendered(report)

    assert "All 8 tasks done" in text.splitlines()[0]
    assert "as planned" not in text.splitlines()[0]
    assert "uav2 lost  planned  t8@1.02 (t7@1.84) (t1@2.67)" in text
    assert "+t1@3.08" in text
    assert "lost  1 UAV: uav2" in text
    assert "task t7 is open again" in text
    assert "took over t7 from uav2" in text
    assert "ended t3: done" not in text, "routine is left to the document"
    assert "ended t3: done" in report.as_markdown()


def test_what_is_missing_comes_with_ids_and_is_no_success() -> None:
    teller = Teller(shipped("table-1"))
    teller.begin()
    teller.end("uav1", "t2", 0.9)
    teller.end("uav1", "t3", 6.2)
    teller.end("uav2", "t2", 1.4)
    teller.end("uav3", "t4", 1.0, AttemptResult.FAILED)
    report = report_of(teller.mission_state)

    text = rendered(report)

    assert not report.result.is_complete
    assert "2 of 8 tasks done in 6.20 s of mission time; 1 failed, 5 still open" in text
    assert "1 task: t4" in text
    assert "5 tasks: t1, t5, t6, t7, t8" in text
    assert "1 task after D = 5 s, counting against J: t3 at 6.20 s" in text
    assert "1 to tasks that were already done: t2" in text
    assert "t3@6.20!" in text


def test_withdrawn_tasks_do_not_count_as_missing() -> None:
    mission = shipped("table-1")
    teller = Teller(mission)
    teller.begin()
    for number, task in enumerate(mission.tasks):
        if number == 0:
            teller.post(task, number, withdrawn=True, now_s=1.0)
        else:
            teller.end("uav1", task.id, 1.0 + number / 10.0)
    report = report_of(teller.mission_state)

    assert report.result.is_complete
    assert "All 7 tasks done" in report.verdict
    assert "withdrawn" in rendered(report)


def test_mission_that_never_started_has_a_report_too() -> None:
    report = replace(
        report_of(Teller(shipped("table-1")).mission_state),
        fates=("autopilot of uav1: ended with exit status 2 [Errno 98]",),
    )

    text = rendered(report)

    assert "The mission never started: 0 of 8 tasks done" in text
    assert "[Errno 98]" in text
    found = report.as_json()
    assert found["scenario"] == "table-1"
    assert found["objective"] is None
    assert "never started" in report.as_markdown()
    assert not report.result.is_complete


@pytest.mark.parametrize("scenario", ["table-1", "reservoir-inspection"])
def test_without_a_plan_json_has_the_keys_of_one(scenario: str) -> None:
    mission = shipped(scenario)
    report = report_of(Teller(mission).mission_state)
    assert report.plan is None

    found = report.as_json()

    plan = make_plan(mission, "greedy", clock=SystemClock(), seed=0)
    assert plan_as_json(plan).keys() <= found.keys()
    assert ("schedule" in found) == (mission.schema == 2)


def test_numbers_that_are_not_finite_become_null() -> None:
    report = report_of(watch(shipped("table-1")))
    broken = replace(report, result=replace(report.result, executed_objective=math.nan))

    assert broken.as_json()["executed_objective"] is None
    json.dumps(replace(report, wall_s=math.inf).as_json(), allow_nan=False)


@pytest.mark.parametrize("width", [80, 100, 140])
def test_large_fleet_is_summed_up_within_the_width(width: int) -> None:
    mission = random_mission(100, 1000, seed=4)
    routes = {
        uav.id: tuple(task.id for task in mission.tasks[number::100])
        for number, uav in enumerate(mission.uavs)
    }
    teller = Teller(mission)
    teller.begin()
    for uav, route in routes.items():
        swapped = int(uav.removeprefix("uav")) < 20
        for number, task in enumerate(reversed(route) if swapped else route):
            teller.end(uav, task, 10.0 * number)
    teller.mission_state.plan = Plan(
        scenario=mission.name,
        method="greedy",
        routes=routes,
        objective=5e5,
        completion_s={task: 10.0 * n for route in routes.values() for n, task in enumerate(route)},
        sequence=tuple(routes),
        optimum=None,
        evaluations=1,
        elapsed_s=0.0,
        seed=0,
    )

    text = rendered(report_of(teller.mission_state), width)

    assert "and 80 more as planned, 4 more that differ" in text
    assert len(text.splitlines()) < 120


def test_report_without_utf8_is_pure_ascii() -> None:
    report = report_of(watch(shipped("valley-popups"), lost_at_s={UavId("uav2"): 40.0}))

    assert rendered(report, encoding="ascii").isascii()


def test_markdown_is_escaped_and_complete() -> None:
    report = replace(report_of(watch(shipped("table-1"))), fates=("x: *bad* | <b>",))

    text = report.as_markdown()

    assert text.startswith("# table-1: mission report\n\n**All 8 tasks done")
    assert r"\*bad\* \| \<b\>" in text
    assert text.count("| `uav") == 3
    assert all(f"ended t{number}: done" in text for number in range(1, 9))
    assert "\n\n\n" not in text


def test_report_is_written_as_its_suffix_says(tmp_path: Path) -> None:
    report = report_of(watch(shipped("table-1")))

    write_report(report, tmp_path / "flight.json")
    write_report(report, tmp_path / "flight.MD")

    written = json.loads((tmp_path / "flight.json").read_text(encoding="utf-8"))
    assert written == json.loads(json.dumps(report.as_json()))
    assert (tmp_path / "flight.MD").read_text(encoding="utf-8") == report.as_markdown()


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("flight.txt", "no report is called '.txt'; end it in .json or .md"),
        ("flight", "it has no suffix; end it in .json or .md"),
        ("missing/flight.md", "there is no directory"),
        ("folder.md", "it is a directory"),
    ],
)
def test_report_that_cannot_be_written_is_refused_in_one_line(
    tmp_path: Path, name: str, said: str
) -> None:
    (tmp_path / "folder.md").mkdir()

    with pytest.raises(InputError) as error:
        check_report_path(tmp_path / name)

    assert said in str(error.value)
    assert str(error.value).startswith("--report: ")
    assert "\n" not in str(error.value)
