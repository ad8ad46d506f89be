"""`swarm simulate --from`: decides a recording's decisions again."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from coordinator.mission_view.mission_state import MissionState
from coordinator.recording.flight_recorder import FileSink, FlightRecorder, virtual_ns
from coordinator.recording.reader import read_recording
from coordinator.recording.recorder import RecordingInfo
from sim.world.settings import QUIET
from swarm.cli import main
from swarm.model import UavId
from swarm.protocol.events import MessageReceived
from swarm.protocol.messages import Message, Stamp
from tests.support.builders import choice, mission


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Of a flight of the shipped valley-popups."""
    file = tmp_path_factory.mktemp("recorded") / "flight.mcap"
    flight = ["valley-popups", "--method", "guided", "--record", str(file), "--json"]
    assert main(["simulate", *flight]) == 0
    return file


def recorded(file: Path, *said: Message) -> Path:
    """A recording in which nothing else is said."""
    recorder = FlightRecorder(
        RecordingInfo("test", QUIET, virtual=True), FileSink(file), virtual_ns
    )
    mission_state = MissionState(mission([], []), QUIET)
    core = recorder.around(mission_state, mission_state)
    core.start(0.0)
    for number, message in enumerate(said):
        core.step(MessageReceived(message), float(number))
    recorder.close()
    return file


def test_a_faultless_flight_comes_out_the_same(
    recording: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["simulate", "--from", str(recording), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told == {
        "mission": "valley-popups",
        "choices": 16,
        "agreeing": 16,
        "differing": [],
        "without_inputs": 0,
    }

    assert main(["simulate", "--from", str(recording)]) == 0
    assert "of 16 choices 16 come out the same" in capsys.readouterr().out


def test_choices_without_inputs_are_no_success(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    said = Message("test", "u0", Stamp(1, 9), choice("t0"))

    assert main(["simulate", "--from", str(recorded(tmp_path / "a.mcap", said))]) == 1
    assert "not decided again: 1" in capsys.readouterr().out


def test_a_recording_without_choices_is_no_success(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["simulate", "--from", str(recorded(tmp_path / "a.mcap"))]) == 1
    assert "no choice is in the recording" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["table-1"], "SCENARIO: "),
        (["--seed", "3"], "--seed: "),
        (["--method", "greedy"], "--method: "),
        (["--loss", "0.1"], "--loss: "),
        (["--report", "x.md"], "--report: "),
    ],
)
def test_what_flies_a_mission_is_refused(
    recording: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], said: str
) -> None:
    assert main(["simulate", *arguments, "--from", str(recording)]) == 2

    told = capsys.readouterr().err
    assert told.startswith(said)
    assert told.count("\n") == 1


def test_without_scenario_and_recording_it_says_what_is_missing(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["simulate"]) == 2
    assert "name a scenario, such as table-1, or a recording" in capsys.readouterr().err


def test_a_file_that_is_no_recording_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "notes.txt"
    file.write_text("no recording")

    assert main(["simulate", "--from", str(file)]) == 2
    assert str(file) in capsys.readouterr().err


def test_a_flight_of_uavs_that_take_their_time_to_change_speed_is_recorded_with_its_schedule(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """As every plan of schema 2 has one."""
    scenario, file = tmp_path / "slow.toml", tmp_path / "slow.mcap"
    scenario.write_text(
        'schema = 2\nname = "slow"\n[mission]\nhorizon_s = 300.0\n'
        '[[uav]]\nid = "u0"\nposition_m = [0.0, 0.0]\nspeed_m_s = 10.0\nacceleration_m_s2 = 2.5\n'
        '[[task]]\nid = "t0"\nposition_m = [100.0, 0.0]\nvalue = 5.0\n'
    )

    assert main(["simulate", str(scenario), "--record", str(file), "--json"]) == 0
    output = capsys.readouterr()
    assert output.err == ""
    told = json.loads(output.out)
    assert told["executed_completion_s"] == {"t0": 14.0}
    (plan,) = read_recording(file).plans
    assert plan.plan.schedule is not None
    assert [entry.go for entry in plan.plan.schedule[UavId("u0")]] == ["t0", "start"]
    assert main(["simulate", "--from", str(file)]) == 0
