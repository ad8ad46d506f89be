"""Playing: forth, back, faster, and always the same picture at the same moment."""

from __future__ import annotations

import json

import pytest

from coordinator.mission_view.scene import scene_of
from coordinator.recording.playback import Playback
from coordinator.recording.player import RecordingPlayer
from coordinator.recording.reader import Recording, read_recording
from coordinator.terminal.status_table import status_as_json
from tests.support.observed_mission import shipped
from tests.support.recordings import fly_recorded


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    mission = shipped("table-1")
    flown = fly_recorded(mission, lost_at_s={mission.uavs[0].id: 1.2})
    return read_recording(flown.write(tmp_path_factory.mktemp("flight") / "flight.mcap"))


def picture(playback: Playback) -> str:
    return json.dumps(status_as_json(scene_of(playback.mission_state, playback.now_s)))


def straight(recording: Recording, t_s: float) -> str:
    playback = Playback(recording)
    playback.seek(t_s)
    return picture(playback)


def test_any_way_to_a_moment_shows_the_same_picture(
    recording: Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("coordinator.recording.playback._LEAST_APART", 10)
    playback = Playback(recording)
    moments = [recording.end_s * share for share in (0.9, 0.2, 0.21, 0.7, 0.0, 1.0, 0.5, 0.5, 0.97)]

    for t_s in moments:
        playback.seek(t_s)

        assert picture(playback) == straight(recording, t_s)


def test_time_passes_at_the_speed_asked_for_and_stops_at_the_end(recording: Recording) -> None:
    playback = Playback(recording, speed=2.0)

    playback.advance(0.5)
    assert playback.t_s == pytest.approx(1.0)
    playback.playing = False
    playback.advance(0.5)
    assert playback.t_s == pytest.approx(1.0)
    playback.playing = True
    playback.advance(1e6)

    assert playback.t_s == playback.duration_s
    assert not playback.playing
    assert playback.now_s == recording.end_s
    assert picture(playback) == straight(recording, 1e9)


def test_moments_outside_are_the_nearest_inside(recording: Recording) -> None:
    playback = Playback(recording)

    playback.seek(-5.0)
    assert playback.t_s == 0.0
    playback.seek(1e12)
    assert playback.t_s == playback.duration_s


@pytest.mark.parametrize("speed", [0.0, -1.0, float("nan"), 1001.0])
def test_a_speed_that_makes_no_sense_is_refused(recording: Recording, speed: float) -> None:
    with pytest.raises(ValueError, match="speed must be"):
        Playback(recording).speed = speed


class Wall:
    """A clock that is set by hand."""

    def __init__(self) -> None:
        self.time_s = 0.0

    def now_s(self) -> float:
        return self.time_s

    def wall_delay_s(self, delay_s: float) -> float:
        return delay_s


def test_the_page_stops_winds_and_plays_on(recording: Recording) -> None:
    wall = Wall()
    player = RecordingPlayer(Playback(recording), wall)

    player.control(playing=False, speed=4.0, t_s=1.0)
    wall.time_s = 10.0
    player.control(playing=True, speed=None, t_s=None)
    assert player.state.t_s == pytest.approx(1.0)
    wall.time_s = 10.25
    player.control(playing=None, speed=None, t_s=None)
    assert player.state.t_s == pytest.approx(2.0)
    assert player.state.playing
    assert player.state.speed == 4.0
    assert player.duration_s == recording.end_s - recording.start_s
    assert player.orders is None


def test_who_plays_on_from_the_end_begins_anew(recording: Recording) -> None:
    wall = Wall()
    player = RecordingPlayer(Playback(recording), wall)
    player.control(playing=None, speed=None, t_s=1e9)
    before = player.mission_state

    player.control(playing=True, speed=None, t_s=None)

    assert player.state.t_s == 0.0
    assert player.state.playing
    assert player.mission_state is not before
