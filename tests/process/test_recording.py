"""A recording of real processes: whole up to the last second, whatever kills its writer."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from mcap.reader import make_reader

from coordinator.recording.playback import Playback
from coordinator.recording.reader import read_recording
from coordinator.status.table import mission_status
from swarm.errors import InputError
from swarm.scenario.write import format_scenario
from swarm.state.board import TaskState
from tests.process.chaos_play import survey
from tests.process.mission import SwarmRun, wait_until
from tests.process.pace import pace
from tests.process.test_status import router_of

pytestmark = [pytest.mark.process]


def swarm(*words: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "swarm", *words],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def _holds_anything(file: Path) -> bool:
    """Whether there is anything in it yet; it may be looked at while it is written."""
    try:
        return bool(read_recording(file).entries)
    except InputError:
        return False


def test_killed_recorders_leave_whole_files_and_the_flight_goes_on(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    folder.mkdir()
    by_run, by_onlooker = folder / "run.mcap", tmp_path / "onlooker.mcap"
    speed = ["--speedup", f"{pace(4.0):g}"]
    flags = ["--bus", "router", "--method", "greedy", *speed, "--record", str(by_run)]
    with SwarmRun(["table-1", *flags], folder) as run:
        wait_until(lambda: any(words.startswith("agent") for words in run.children()), 60, "start")
        onlooker = swarm("record", str(by_onlooker), "--connect", router_of(run), *speed)
        try:
            run.wait_for_line("epoch 1")
            wait_until(lambda: _holds_anything(by_onlooker), 100, "something in the recording")
            time.sleep(1.3)
            onlooker.send_signal(signal.SIGKILL)
            killed_s = time.time()
            onlooker.communicate(timeout=60)
        finally:
            onlooker.kill()
        status, told = run.result()

        assert status == 0, run.story()

    with by_onlooker.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        last_ns = max(message.log_time for _, _, message in reader.iter_messages())
    assert killed_s - last_ns / 1e9 < 1.5  # a second, and what it takes to write
    assert read_recording(by_onlooker).torn is None

    recording = read_recording(by_run)
    assert recording.torn is None
    playback = Playback(recording)
    playback.seek(playback.duration_s)
    found = mission_status(playback.observer, playback.now_s)
    assert found.scene.count(TaskState.DONE) == 8
    assert found.scene.objective == pytest.approx(told["executed_objective"], abs=1e-9)
    flown = {uav: list(tasks) for uav, tasks in playback.observer.result().executed_routes.items()}
    assert flown == told["executed_routes"]
    assert [entry.plan.objective for entry in recording.plans] == [told["objective"]]
    with by_run.open("rb") as file:
        logs = [
            json.loads(message.data)["name"]
            for _, _, message in make_reader(file).iter_messages(topics=["/log"])
        ]
    assert {"story", "coordinator", "uav1"} <= set(logs)


def test_a_recorder_is_stopped_by_its_user_and_by_the_end_of_the_mission(tmp_path: Path) -> None:
    files = tmp_path / "ctrl-c.mcap", tmp_path / "to-the-end.mcap"
    folder = tmp_path / "run"
    folder.mkdir()
    scenario = tmp_path / "scenario.toml"  # long enough for recorders that start slowly
    scenario.write_text(format_scenario(survey(3, 16)))
    speed = ["--speedup", f"{pace(3.0):g}"]
    with SwarmRun([str(scenario), "--bus", "router", *speed], folder) as run:
        wait_until(lambda: any(words.startswith("agent") for words in run.children()), 60, "start")
        recorders = [
            swarm("record", str(file), "--connect", router_of(run), *speed) for file in files
        ]
        try:
            run.wait_for_line("epoch 1")
            wait_until(lambda: all(file.exists() for file in files), 100, "the recordings")
            recorders[0].send_signal(signal.SIGINT)
            _, said = recorders[0].communicate(timeout=60)
            assert recorders[0].returncode == 0, said
            assert str(files[0]) in said.splitlines()[-1]
            assert run.result()[0] == 0
            _, said = recorders[1].communicate(timeout=60)
            assert recorders[1].returncode == 0, said
        finally:
            for recorder in recorders:
                recorder.kill()
                recorder.wait()

    assert read_recording(files[0]).torn is None
    whole = Playback(read_recording(files[1]))
    whole.seek(whole.duration_s)
    assert whole.observer.phase == "ended"
    assert len(whole.observer.result().done) == 16
    assert files[1].stat().st_size > files[0].stat().st_size
