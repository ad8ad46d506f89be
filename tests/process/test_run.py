"""`swarm run`: whole missions with real processes, and what happens when one dies."""

from __future__ import annotations

import json
import os
import signal
from dataclasses import replace
from pathlib import Path

import pytest

from sim.fleet.faults.flood import long_mission
from sim.fleet.layout import BusKind
from swarm.scenario.write import format_scenario
from tests.process.chaos_play import by_day, survey
from tests.process.mission import SwarmRun, alive, wait_until
from tests.process.pace import pace

pytestmark = [pytest.mark.process]

N_TASK = 20


@pytest.fixture
def fleet(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """The arguments for a small fleet, whose flight is long enough to lose a process of."""
    scenario = tmp_path_factory.mktemp("fleet") / "scenario.toml"
    scenario.write_text(format_scenario(survey(3, N_TASK)))
    return [str(scenario), "--speedup", f"{pace(6.0):g}"]


def kill(pid: int) -> None:
    os.kill(pid, signal.SIGKILL)


TIMES, SPEEDUP = 16.0, 4.0
"""What a busy machine is late by counts a fourth when the paper's map is that much larger; flown
faster, since else most of the time goes to taking off and landing."""


@pytest.mark.parametrize("bus", by_day(BusKind.MESH))
def test_paper_mission_flies_the_offline_plan(tmp_path: Path, bus: BusKind) -> None:
    logs, scenario = tmp_path / "logs", tmp_path / "scenario.toml"
    scenario.write_text(format_scenario(replace(long_mission(TIMES), name="table-1")))
    arguments = [str(scenario), "--bus", bus, "--method", "greedy", "--logs", str(logs)]
    arguments += ["--speedup", f"{SPEEDUP:g}"]
    arguments += ["--position-rate-hz", "50"]  # an arrival is seen at the next report
    with SwarmRun(arguments, tmp_path) as run:
        status, told = run.result()

        assert status == 0, run.story()
        assert told["sequence"] == ["uav1", "uav3", "uav2"]
        assert told["executed_routes"] == told["routes"]
        assert sorted(told["done"]) == [f"t{number}" for number in range(1, 9)]
        assert told["failed"] == told["open"] == told["lost_uavs"] == []
        assert told["duplicate_visits"] == 0
        assert told["epochs"] == 1
        assert told["objective"] == pytest.approx(TIMES * 118.4939, abs=1e-3)
        assert told["executed_objective"] == pytest.approx(TIMES * 118.49, rel=0.02)
        assert told["optimum"] == pytest.approx(TIMES * 120.3335, abs=1e-3)
        assert_every_line_tells_whose_it_is(logs)
        scenario.unlink()
        run.assert_nothing_left(but="logs")


def assert_every_line_tells_whose_it_is(logs: Path) -> None:
    """Each is a JSON object with the ids of mission, UAV, process and plan."""
    lines = {
        path.stem: [json.loads(line) for line in path.read_text().splitlines()]
        for path in logs.iterdir()
    }
    uavs = [f"uav{number}" for number in (1, 2, 3)]
    assert lines.keys() == {"coordinator", *uavs, *(f"autopilot-of-{uav}" for uav in uavs)}
    for name, told in lines.items():
        assert told
        assert all(
            {"mission", "event", "level", "timestamp", "module"} <= set(each) for each in told
        )
        assert {each["mission"] for each in told} == {"table-1"}
        if name in uavs:
            assert {each["uav"] for each in told} == {name}
        if name in (*uavs, "coordinator"):
            assert len({each["incarnation"] for each in told}) == 1
    assert lines["coordinator"][-1]["epoch"] >= 1
    decided = [each for uav in uavs for each in lines[uav] if "decision" in each]
    assert len({(each["uav"], each["decision"]) for each in decided}) >= 8


def test_agents_that_share_a_process_fly_as_others_do(tmp_path: Path) -> None:
    logs, scenario = tmp_path / "logs", tmp_path / "scenario.toml"
    scenario.write_text(format_scenario(survey(5, 15, side_m=400.0)))
    arguments = [str(scenario), "--agents-per-process", "3", "--logs", str(logs)]
    with SwarmRun([*arguments, "--speedup", f"{pace(6.0):g}"], tmp_path) as run:
        status, told = run.result()

        assert status == 0, run.story()
        assert len(told["done"]) == 15
        assert told["lost_uavs"] == []
        lines = {
            path.stem: [json.loads(line) for line in path.read_text().splitlines()]
            for path in logs.glob("agents*")
        }
        assert {name: {each["uav"] for each in said} for name, said in lines.items()} == {
            "agents-of-uav05-and-2-more": {"uav01", "uav03", "uav05"},
            "agents-of-uav04-and-1-more": {"uav02", "uav04"},
        }
        scenario.unlink()
        run.assert_nothing_left(but="logs")


def test_killed_agents_tasks_are_done_by_the_others(tmp_path: Path) -> None:
    scenario = tmp_path / "scenario.toml"
    scenario.write_text(format_scenario(survey(5, 15, side_m=800.0)))
    with SwarmRun([str(scenario), "--speedup", f"{pace(6.0):g}"], tmp_path) as run:
        run.wait_for_line(" ended ")  # at 9 s; uav02 is on its way to t07 until 40 s
        kill(run.child("agent", "uav02"))
        status, told = run.result()

        assert status == 0, run.story()
        assert len(told["done"]) == 15
        assert told["lost_uavs"] == ["uav02"]
        assert any("uav02 lost; task t07 is open again" in line for line in run.lines)
        assert any("took over t07 from uav02" in line for line in run.lines)
        scenario.unlink()
        run.assert_nothing_left()


def test_fleet_finishes_without_its_coordinator(tmp_path: Path, fleet: list[str]) -> None:
    with SwarmRun(fleet, tmp_path) as run:
        run.wait_for_line("epoch 1")
        kill(run.child("coordinator"))
        status, told = run.result()

        assert status == 0, run.story()
        assert len(told["done"]) == N_TASK
        assert told["executed_routes"].keys() == told["routes"].keys()
        assert any("coordinator lost" in line for line in run.lines)
        run.assert_nothing_left()


def test_dead_autopilot_costs_its_uav_and_no_task(tmp_path: Path, fleet: list[str]) -> None:
    with SwarmRun(fleet, tmp_path) as run:
        run.wait_for_line(" ended ", count=3)
        kill(run.child("autopilot", "uav03"))
        status, told = run.result()

        assert status == 0, run.story()
        assert len(told["done"]) == N_TASK
        assert any("uav03 takes no further part" in line for line in run.lines)
        run.assert_nothing_left()


def test_dead_router_is_started_again_and_the_mission_goes_on(
    tmp_path: Path, fleet: list[str]
) -> None:
    with SwarmRun([*fleet, "--bus", "router"], tmp_path) as run:
        run.wait_for_line(" ended ", count=5)
        kill(run.child("router"))
        status, told = run.result()

        assert status == 0, run.story()
        assert len(told["done"]) == N_TASK
        assert told["lost_uavs"] == []
        assert told["processes"] == ["router 1: killed by SIGKILL"]
        assert any("router 1 killed by SIGKILL; started again" in line for line in run.lines)
        run.assert_nothing_left()


def test_ctrl_c_ends_every_process(tmp_path: Path, fleet: list[str]) -> None:
    with SwarmRun(fleet, tmp_path) as run:
        run.wait_for_line("epoch 1")

        assert run.end(signal.SIGINT) == 130
        run.assert_nothing_left()


def test_ctrl_c_before_the_start_ends_every_process(tmp_path: Path) -> None:
    with SwarmRun(["table-1"], tmp_path) as run:
        wait_until(lambda: len(run.children()) >= 2, 100, "first children")

        assert run.end(signal.SIGINT) == 130
        run.assert_nothing_left()


def test_killed_launcher_takes_every_process_along(tmp_path: Path) -> None:
    with SwarmRun(["table-1"], tmp_path) as run:
        wait_until(lambda: len(run.children()) == 7, 100, "all children")
        agent = run.child("agent", "uav2")

        assert run.end(signal.SIGKILL) == -signal.SIGKILL
        # Nobody is left who could remove what the processes kept to remember.
        run.assert_nothing_left(but="peckorder-*")
        assert not alive(agent)


def test_scenario_that_cannot_be_read_starts_nothing(tmp_path: Path) -> None:
    with SwarmRun(["no-such-scenario"], tmp_path) as run:
        assert run.process.wait(100) == 2
        for reader in run._readers:
            reader.join(10)
        assert len(run.lines) == 1
        assert run.children() == {}
