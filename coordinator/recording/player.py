"""A recording as a source of the dashboard: it plays by itself, and obeys the page."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from types import MappingProxyType

from coordinator.dashboard.source import CommandRow, PlaybackState, RequestSink
from coordinator.mission_view.mission_state import MissionState
from coordinator.recording.playback import MAX_SPEED, Playback
from swarm.runtime.clock import Clock

FRAME_S = 0.1
"""Wall time between two steps of a recording that plays."""


class RecordingPlayer:
    """A source that plays a recording, and the recording's controls."""

    dropped: Mapping[str, int] = MappingProxyType({})
    """None: nothing is heard."""
    commands: tuple[CommandRow, ...] = ()
    """None: what was ordered is in the story."""
    orders: RequestSink | None = None
    """Nobody flies here."""

    def __init__(self, playback: Playback, clock: Clock) -> None:
        self.speedup = playback.recording.speedup
        self.duration_s = playback.duration_s
        self._playback = playback
        self._clock = clock
        self._advanced_s = clock.now_s()

    async def run(self) -> None:
        """Play until cancelled."""
        while True:
            self._catch_up()
            await asyncio.sleep(FRAME_S)

    # -- what a page is fed from --------------------------------------------------------

    @property
    def mission_state(self) -> MissionState:
        """What was known at the moment that is shown."""
        return self._playback.mission_state

    @property
    def link(self) -> bool:
        """Whether the recorder's link was up."""
        return self.mission_state.cut_since_s is None

    def now_s(self) -> float:
        """The moment that is shown."""
        return self._playback.now_s

    @property
    def player(self) -> RecordingPlayer:
        """The controls."""
        return self

    # -- the controls -------------------------------------------------------------------

    @property
    def state(self) -> PlaybackState:
        """How far it is."""
        playback = self._playback
        return PlaybackState(playback.t_s, playback.playing, playback.speed)

    def control(self, *, playing: bool | None, speed: float | None, t_s: float | None) -> None:
        """Play or stop, at that speed, from there; None leaves a thing as it is.

        Who plays on from the very end begins anew.
        """
        self._catch_up()
        playback = self._playback
        if speed is not None:
            playback.speed = min(max(speed, 1e-3), MAX_SPEED)
        if t_s is not None:
            playback.seek(t_s)
        if playing is not None:
            if playing and t_s is None and playback.t_s >= playback.duration_s:
                playback.seek(0.0)
            playback.playing = playing

    def _catch_up(self) -> None:
        now_s = self._clock.now_s()
        self._playback.advance(now_s - self._advanced_s)
        self._advanced_s = now_s
