"""A flight of real processes and its recording: what others read in it, how it ends when it is
replayed, and its decisions, made again from what was said on the bus."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from mcap.reader import make_reader

from coordinator.recording.playback import Playback
from coordinator.recording.reader import read_recording
from swarm.cli import main
from tests.process.mission import SwarmRun
from tests.process.pace import pace

pytestmark = [pytest.mark.process]


def test_the_recording_of_a_faultless_flight_is_read_by_others_and_agrees_with_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "flight.mcap"
    with SwarmRun(
        ["table-1", "--speedup", f"{pace(10.0):g}", "--record", str(file)], tmp_path
    ) as run:
        status, told = run.result()
        assert status == 0, run.story()

    def said(*words: str) -> dict[str, Any]:
        assert main([*words, "--json"]) == 0
        found: dict[str, Any] = json.loads(capsys.readouterr().out)
        return found

    topics = checked_topics(file)
    assert {"/log", "/progress", "/scene/uavs", "/uav/uav1/fix", "/swarm/table-1/plan"} <= topics

    final = said("replay", str(file), "--final")
    assert final["phase"] == "ended"
    assert final["objective"] == pytest.approx(told["executed_objective"], abs=1e-9)
    assert final["planned_objective"] == pytest.approx(told["objective"], abs=1e-9)
    assert final["tasks"]["done"] == len(told["done"]) == 8
    assert final["tasks"]["failed"] == len(told["failed"])
    assert final["tasks"]["open"] == len(told["open"])
    assert [uav["id"] for uav in final["uavs"] if uav["does"] == "lost"] == told["lost_uavs"]
    playback = Playback(read_recording(file))
    playback.seek(playback.duration_s)
    result = playback.mission_state.result()
    assert list(result.done) == told["done"]
    assert list(result.lost_uavs) == told["lost_uavs"]
    assert dict(result.executed_completion_s) == told["executed_completion_s"]
    lists = {uav: list(tasks) for uav, tasks in result.executed_routes.items()}
    assert lists == told["executed_routes"]

    of_uav = [event["text"] for event in said("explain", str(file), "--uav", "uav1")["events"]]
    assert sum(text.startswith("Mission ends:") for text in of_uav) == 1

    again = said("simulate", "--from", str(file))
    assert again["differing"] == []
    assert again["agreeing"] > 0


def checked_topics(file: Path) -> set[str]:
    """Every topic that has a message; the mcap library reads them all, and each fits its schema."""
    checks: dict[int, jsonschema.Draft202012Validator] = {}
    topics = set()
    with file.open("rb") as opened:
        for schema, channel, message in make_reader(opened, validate_crcs=True).iter_messages():
            assert schema is not None
            if schema.id not in checks:
                shape = json.loads(schema.data)
                jsonschema.Draft202012Validator.check_schema(shape)
                checks[schema.id] = jsonschema.Draft202012Validator(shape)
            checks[schema.id].validate(json.loads(message.data))
            topics.add(channel.topic)
    return topics
