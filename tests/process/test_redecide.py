"""Decisions of real processes, made again from a recording of what was said on the bus."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from swarm.cli import main
from tests.process.mission import SwarmRun

pytestmark = [pytest.mark.process, pytest.mark.timeout(120)]


def test_every_decision_of_a_faultless_flight_comes_out_the_same(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "flight.mcap"
    with SwarmRun(["table-1", "--speedup", "10", "--record", str(file)], tmp_path) as run:
        assert run.result()[0] == 0, run.story()

    assert main(["simulate", "--from", str(file), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["differing"] == []
    assert told["agreeing"] > 0
