"""A recorded flight as a picture: where UAVs were, and what they did."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from coordinator.plot import draw_flight, flight_figure
from coordinator.recording.cli import replay
from coordinator.recording.flown_tracks import flight_of
from coordinator.recording.reader import read_recording
from sim.world.simulation import recording_simulation, simulate_mission
from sim.world.uncertainty import Uncertainty
from swarm.model import UavId
from swarm.runtime.errors import InputError
from tests.support.observed_mission import shipped
from tests.support.recorded_approach import closest_approach


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """`meadow`, with one UAV that is lost on the way."""
    path, mission = tmp_path_factory.mktemp("flown") / "meadow.mcap", shipped("meadow")
    with recording_simulation(mission.name, "meadow", path) as looks_on:
        simulate_mission(
            mission,
            method="greedy",
            seed=3,
            uncertainty=Uncertainty(loss=0.4),
            make_observer=looks_on,
        )
    return path


def test_tracks_lead_to_what_was_done_and_end_where_one_was_lost(flown: Path) -> None:
    flight = flight_of(read_recording(flown))

    assert flight.done_by
    assert flight.lost
    tasks = {task.id: task for task in flight.mission.tasks}
    for task, uav in flight.done_by.items():
        place = tasks[task].position_enu_m[:2]
        passed = [math.dist(place, here) for track in flight.tracks[uav] for here in track]
        assert min(passed) < 6.0  # of statuses twice a second at 8 m/s
    figure = flight_figure(flight)
    (axes,) = figure.axes
    drawn = sum(len(tracks) for tracks in flight.tracks.values())
    assert len([line for line in axes.lines if np.size(line.get_xdata()) > 2]) >= drawn
    crosses = [line for line in axes.lines if line.get_marker() == "X"]
    assert len(crosses) >= len(flight.lost)


def test_the_same_recording_gives_the_same_file(flown: Path, tmp_path: Path) -> None:
    files = [tmp_path / "one.svg", tmp_path / "other.svg"]
    for file in files:
        draw_flight(flight_of(read_recording(flown)), file)
    texts = [file.read_text().split("<defs>")[0] for file in files]
    assert texts[0] == texts[1]
    assert files[0].stat().st_size > 10_000


def test_a_picture_of_no_known_kind_is_refused(flown: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such kind of picture"):
        replay(flown, plot=tmp_path / "flight.gif")


def test_a_reader_of_a_simulated_recording_finds_what_the_observer_did(flown: Path) -> None:
    nearest, read = flight_of(read_recording(flown)).nearest, closest_approach(flown)

    assert nearest is not None
    assert read is not None
    assert read[0] == pytest.approx(nearest.distance_m, abs=1e-9)
    assert tuple(map(UavId, read[1])) == nearest.uavs
