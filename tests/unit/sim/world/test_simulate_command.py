"""`swarm simulate`: what may be asked for, and what it tells."""

from __future__ import annotations

import inspect
import json
from pathlib import Path
from typing import Any

import pytest

from sim.study.design import NUMBERS, SWITCHES
from sim.world.cli import simulate
from swarm.cli import main

FIXED_KEYS = [
    *("scenario", "method", "objective", "sequence", "routes", "completion_s", "optimum", "gap"),
    *("evaluations", "elapsed_s", "seed", "executed_routes", "executed_completion_s"),
    *("executed_objective", "done", "failed", "open", "duplicate_visits", "makespan_s"),
    *("lost_uavs", "epochs"),
]


def told(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, dict[str, Any]]:
    status = main(["simulate", *arguments, "--json"])
    return status, json.loads(capsys.readouterr().out)


def test_keys_that_programs_rely_on_come_first_and_new_ones_last(
    capsys: pytest.CaptureFixture[str],
) -> None:
    status, found = told(capsys, "table-1")

    assert status == 0
    assert [key for key in found if key in FIXED_KEYS] == FIXED_KEYS
    assert list(found)[-2:] == ["lost_because", "value"]
    assert found["executed_routes"] == found["routes"]
    assert found["value"] == pytest.approx(found["executed_objective"])


def test_drawn_outcomes_fail_tasks_and_reattempts_do_them_after_all(
    capsys: pytest.CaptureFixture[str],
) -> None:
    status, found = told(capsys, "table-1", "--outcomes", "--seed", "1")
    assert status == 1
    assert found["failed"]
    assert sorted(found["failed"] + found["done"]) == [f"t{n}" for n in range(1, 9)]

    status, found = told(capsys, "table-1", "--outcomes", "--reattempt", "--seed", "1")
    assert status == 0
    assert found["failed"] == []
    assert found["value"] != pytest.approx(found["executed_objective"])


def test_losses_are_told_with_their_reason(capsys: pytest.CaptureFixture[str]) -> None:
    status, found = told(capsys, "table-1", "--loss", "0.5", "--seed", "3")

    assert status == 0
    assert 0 < len(found["lost_uavs"]) < 3
    assert list(found["lost_because"]) == found["lost_uavs"]
    assert all(why.startswith("lost at ") for why in found["lost_because"].values())


def test_without_a_coordinator_pop_ups_are_done_all_the_same(
    capsys: pytest.CaptureFixture[str],
) -> None:
    pops = ("table-1", "--popup", "0.5", "--seed", "1", "--coordinator-lost-s", "0")
    status, found = told(capsys, *pops)

    assert status == 0
    assert len(found["done"]) == 8
    assert sum("operator adds" in line["text"] for line in found["story"]) > 1
    assert any("coordinator lost" in line["text"] for line in found["story"])


@pytest.mark.parametrize("name", ["--delay-s", "--latency-s"])
def test_a_delay_may_be_called_latency(capsys: pytest.CaptureFixture[str], name: str) -> None:
    _, calm = told(capsys, "table-1")
    status, found = told(capsys, "table-1", name, "0.05")

    assert status == 0
    assert found["makespan_s"] != calm["makespan_s"]


def test_a_mission_of_which_nobody_hears_is_broken_off_and_said_so(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["simulate", "table-1", "--message-loss", "1"]) == 1
    assert "broken off" in capsys.readouterr().err


def test_numbers_out_of_range_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["simulate", "table-1", "--message-loss", "1.5"]) == 2
    assert "--message-loss" in capsys.readouterr().err


def test_a_line_that_no_message_has_room_for_is_refused_before_anybody_flies(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = [[0.1 + n, 0.2] for n in range(400)]
    scenario = tmp_path / "long.toml"
    scenario.write_text(
        'schema = 2\nname = "long"\n[mission]\nhorizon_s = 900\n'
        '[[uav]]\nid = "u0"\nposition_m = [0, 0]\nspeed_m_s = 10\n'
        f'[[task]]\nid = "t0"\nvalue = 1\npath_m = {path}\n'
    )

    assert main(["simulate", str(scenario)]) == 2

    (complaint,) = capsys.readouterr().err.splitlines()
    assert "the line of task t0 has 400 points" in complaint


def test_every_option_of_uncertainty_can_be_asked_for() -> None:
    asked = inspect.signature(simulate).parameters

    assert {*NUMBERS, *SWITCHES, "reattempt", "coordinator_lost_s"} <= asked.keys()
