"""`swarm run` with keys: it flies as it does without, and hears only who may speak."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import pytest

from sim.fleet.faults.flood import long_mission
from swarm.cli import main
from swarm.identity.founding import found_authority
from swarm.model import Mission
from swarm.runtime.clock import unix_s
from swarm.scenario.write import format_scenario
from tests.process.feed_reader import post
from tests.process.mission import SwarmRun
from tests.process.programs import run_swarm
from tests.process.test_status import router_of

pytestmark = [pytest.mark.process]

FAST = ["--speedup", "20"]
"""Of missions that are the paper's, drawn out, so that a busy machine does not change them."""


def test_a_mesh_with_new_keys_flies_as_a_plain_one_and_leaves_none_of_them(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, folder = tmp_path / "flight.mcap", tmp_path / "run"
    folder.mkdir()
    words = [written(long_mission(20.0), tmp_path), "--secure", "--method", "greedy"]
    words += ["--record", str(file), "--bus", "mesh", *FAST]
    with SwarmRun(words, folder) as run:
        status, told = run.result()

        assert status == 0, run.story()
        run.assert_nothing_left()
    assert told["sequence"] == ["uav1", "uav3", "uav2"]
    assert told["executed_routes"] == told["routes"]
    assert told["objective"] == pytest.approx(20.0 * 118.4939, abs=1e-3)
    assert told["executed_objective"] == pytest.approx(told["objective"], rel=0.1)
    assert (told["lost_uavs"], told["duplicate_visits"], told["epochs"]) == ([], 0, 1)
    assert told["security"]["lacking"] == []
    assert "signed MAVLink" in told["security"]["measures"]
    assert told["security"]["refused"] == {}

    assert main(["replay", str(file), "--final", "--json"]) == 0
    final = json.loads(capsys.readouterr().out)
    assert final["objective"] == pytest.approx(told["executed_objective"], abs=1e-9)
    assert main(["simulate", "--from", str(file), "--json"]) == 0
    again = json.loads(capsys.readouterr().out)
    assert again["differing"] == []
    assert again["agreeing"] > 0


def test_keys_made_before_serve_a_run_and_only_operators_command_it(tmp_path: Path) -> None:
    mission, keys, folder = long_mission(500.0), tmp_path / "keys", tmp_path / "run"
    uavs = [uav.id for uav in mission.uavs]
    found_authority(keys, mission.name, uavs, now_s=unix_s(), routers=2, days=1)
    folder.mkdir()
    words = [
        written(mission, tmp_path),
        "--keys",
        str(keys),
        "--bus",
        "router",
        "--routers",
        "2",
        *FAST,
    ]
    words += ["--dashboard", "0"]
    with SwarmRun(words, folder) as run:
        viewer = swarm("abort", "--yes", *FAST, "--keys", str(keys / "dashboard"))
        run.wait_for_line("epoch 1")
        seat = ["--connect", router_of(run), "--keys", str(keys / "operator")]
        operator = swarm("return", uavs[0], *FAST, *seat)
        url = run.lines[0].removeprefix("dashboard: ")
        assert post(url, "api/command", {"command": "abort", "reason": "storm"})[0] == 200
        status, told = run.result()

    assert viewer.returncode == 2
    assert len(viewer.stderr.splitlines()) == 1
    assert "whose role is viewer" in viewer.stderr
    assert (operator.returncode, operator.stderr) == (0, "")
    assert status == 1
    story = " ".join(line["text"] for line in told["story"])
    assert f"operator sends {uavs[0]} home" in story
    assert "operator aborts the mission: storm" in story
    assert told["security"]["refused"] == {}


def written(mission: Mission, folder: Path) -> str:
    """The scenario of ``mission`` as a file there."""
    scenario = folder / "scenario.toml"
    scenario.write_text(format_scenario(mission), encoding="utf-8")
    return str(scenario)


def swarm(*words: str) -> subprocess.CompletedProcess[str]:
    return run_swarm(*words)
