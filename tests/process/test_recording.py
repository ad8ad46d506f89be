"""A recording of real processes: whole up to the last second, whatever kills its writer."""

from __future__ import annotations

import json
import signal
import subprocess
import time
from pathlib import Path

import pytest
from mcap.reader import make_reader

from coordinator.mission_view.scene import scene_of
from coordinator.recording.playback import Playback
from coordinator.recording.reader import read_recording
from swarm.runtime.errors import InputError
from swarm.scenario.write import format_scenario
from tests.process.chaos_play import survey
from tests.process.kept_open import kept_open, let_end
from tests.process.mission import SwarmRun, wait_until
from tests.process.pace import pace
from tests.process.programs import Swarm
from tests.process.test_status import router_of

pytestmark = [pytest.mark.process]

SPEED = ["--speedup", "6"]
LOOK_S = 0.05


def swarm(*words: str) -> subprocess.Popen[str]:
    pipe = subprocess.PIPE
    return Swarm(words, stdin=subprocess.DEVNULL, stdout=pipe, stderr=pipe)


def _entries(file: Path) -> int:
    """How much is in it so far; it may be looked at while it is written."""
    try:
        return len(read_recording(file).entries)
    except InputError:
        return 0


def _grows(file: Path) -> float:
    """Wait until it has grown twice; by how much this machine was late meanwhile [s]."""
    late_s = 0.0
    for _ in range(2):
        before, deadline_s = _entries(file), time.monotonic() + 100.0
        while _entries(file) <= before:
            began_s = time.monotonic()
            assert began_s < deadline_s, "nothing more is written"
            time.sleep(LOOK_S)
            late_s += time.monotonic() - began_s - LOOK_S
    return late_s


def _flown(folder: Path, n_uav: int, n_task: int) -> list[str]:
    """Arguments of a run that lasts until the test lets it end."""
    scenario = folder / "scenario.toml"
    scenario.write_text(format_scenario(kept_open(survey(n_uav, n_task))))
    return [str(scenario), "--bus", "router", "--method", "greedy", *SPEED]


def test_killed_recorders_leave_whole_files_and_the_flight_goes_on(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    folder.mkdir()
    by_run, by_onlooker = folder / "run.mcap", tmp_path / "onlooker.mcap"
    with SwarmRun([*_flown(tmp_path, 3, 8), "--record", str(by_run)], folder) as run:
        wait_until(lambda: any(words.startswith("agent") for words in run.children()), 60, "start")
        observer = swarm("record", str(by_onlooker), "--connect", router_of(run), *SPEED)
        try:
            run.wait_for_line("epoch 1")
            late_s = _grows(by_onlooker)
            observer.send_signal(signal.SIGKILL)
            killed_s = time.time()
            observer.communicate(timeout=60)
        finally:
            observer.kill()
        let_end()
        status, told = run.result()

        assert status == 0, run.story()

    with by_onlooker.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        last_ns = max(message.log_time for _, _, message in reader.iter_messages())
    # A second, what it takes to write, and what this machine was late by.
    assert killed_s - last_ns / 1e9 < 1.5 / pace(1.0) + late_s
    assert read_recording(by_onlooker).torn is None

    recording = read_recording(by_run)
    assert recording.torn is None
    playback = Playback(recording)
    playback.seek(playback.duration_s)
    found = scene_of(playback.mission_state, playback.now_s)
    assert found.counts["done"] == 8
    assert found.objective == pytest.approx(told["executed_objective"], abs=1e-9)
    flown = {
        uav: list(tasks) for uav, tasks in playback.mission_state.result().executed_routes.items()
    }
    assert flown == told["executed_routes"]
    assert [entry.plan.objective for entry in recording.plans] == [told["objective"]]
    with by_run.open("rb") as file:
        logs = [
            json.loads(message.data)["name"]
            for _, _, message in make_reader(file).iter_messages(topics=["/log"])
        ]
    assert {"story", "coordinator", "uav01"} <= set(logs)


def test_a_recorder_is_stopped_by_its_user_and_by_the_end_of_the_mission(tmp_path: Path) -> None:
    files = tmp_path / "ctrl-c.mcap", tmp_path / "to-the-end.mcap"
    folder = tmp_path / "run"
    folder.mkdir()
    with SwarmRun(_flown(tmp_path, 3, 16), folder) as run:
        wait_until(lambda: any(words.startswith("agent") for words in run.children()), 60, "start")
        recorders = [
            swarm("record", str(file), "--connect", router_of(run), *SPEED) for file in files
        ]
        try:
            run.wait_for_line("epoch 1")
            wait_until(lambda: all(map(_entries, files)), 100, "the recordings")
            recorders[0].send_signal(signal.SIGINT)
            _, said = recorders[0].communicate(timeout=60)
            assert recorders[0].returncode == 0, said
            assert str(files[0]) in said.splitlines()[-1]
            let_end()
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
    assert whole.mission_state.phase == "ended"
    assert len(whole.mission_state.result().done) == 16
    assert files[1].stat().st_size > files[0].stat().st_size
