"""A recording that is played: the same facts at the same times into a fresh observer.

Pure: time passes by `advance`. Going back starts from the nearest of a few pictures that were kept
on the way.
"""

from __future__ import annotations

import pickle
import zlib
from bisect import bisect_right
from dataclasses import dataclass

from coordinator.mission_view.mission_state import MissionState
from coordinator.mission_view.observation import MissionObserver
from coordinator.recording.reader import Recording

MAX_SPEED = 1000.0
_MOST_KEPT = 24
"""Pictures on the way to which one can go back."""
_LEAST_APART = 2000
"""Facts between two of them; so many are heard in a blink."""


@dataclass(slots=True)
class _Played:
    """How far a recording has been played."""

    observer: MissionObserver
    heard: int = 0
    """Entries that have been heard."""
    planned: int = 0
    """Plans that have been seen."""


class Playback:
    """Plays one recording, at ``speed`` recorded seconds per wall second."""

    def __init__(self, recording: Recording, speed: float = 1.0) -> None:
        self.recording = recording
        self.playing = True
        """Whether `advance` does anything; the end stops it."""
        self._speed = speed
        self._times_s = [entry.now_s for entry in recording.entries]
        self._apart = max(_LEAST_APART, len(recording.entries) // _MOST_KEPT)
        self._kept: list[tuple[int, bytes]] = []
        """After how many entries, and how everything stood then; in that order."""
        self._now_s = recording.start_s
        self._played = self._fresh()

    @property
    def mission_state(self) -> MissionState:
        """What was known at `now_s`; another one after going back."""
        return self._played.observer.mission_state

    @property
    def now_s(self) -> float:
        """The moment that is shown, by the recording core's clock [s]."""
        return self._now_s

    @property
    def t_s(self) -> float:
        """The same from the beginning of the recording [s]."""
        return self._now_s - self.recording.start_s

    @property
    def duration_s(self) -> float:
        """Of the recording, by its core's clock [s]."""
        return max(0.0, self.recording.end_s - self.recording.start_s)

    @property
    def speed(self) -> float:
        """Recorded seconds per wall second; within 0 and `MAX_SPEED`."""
        return self._speed

    @speed.setter
    def speed(self, speed: float) -> None:
        if not 0.0 < speed <= MAX_SPEED:
            raise ValueError(f"speed must be within 0..{MAX_SPEED:g} and not 0, not {speed}")
        self._speed = speed

    def advance(self, wall_s: float) -> None:
        """Let ``wall_s`` pass."""
        if not self.playing:
            return
        t_s = self.t_s + wall_s * self._speed
        if t_s >= self.duration_s:
            self.playing = False
        self.seek(t_s)

    def seek(self, t_s: float) -> None:
        """Go to a moment, in seconds from the beginning; to the nearest there is."""
        end_s = self.recording.start_s + self.duration_s
        # The end is the last fact's very own time, which a sum might miss.
        now_s = min(self.recording.start_s + max(0.0, t_s), end_s)
        if t_s >= self.duration_s:
            now_s = max(now_s, self.recording.end_s)
        heard = bisect_right(self._times_s, now_s)
        goes_back = heard < self._played.heard or now_s < self._now_s
        kept = self._kept_before(heard)
        if kept is not None and (goes_back or kept[0] > self._played.heard):
            self._restore(*kept)
        elif goes_back:
            self._played = self._fresh()
        self._hear(heard)
        self._now_s = now_s

    def _hear(self, until: int) -> None:
        """Tell the observer the entries up to, and without, that one."""
        played, recording = self._played, self.recording
        for place in range(played.heard, until):
            entry = recording.entries[place]
            self._plan(entry.now_s)
            played.observer.step(entry.fact, entry.now_s)
            played.heard = place + 1
            if played.heard % self._apart == 0:
                self._keep()
        if until == len(recording.entries):
            self._plan(float("inf"))

    def _plan(self, now_s: float) -> None:
        """Show the observer's mission state what had been planned by then."""
        played, plans = self._played, self.recording.plans
        while played.planned < len(plans) and plans[played.planned].now_s <= now_s:
            played.observer.mission_state.plan = plans[played.planned].plan
            played.planned += 1

    def _keep(self) -> None:
        if not self._kept or self._kept[-1][0] < self._played.heard:
            packed = zlib.compress(pickle.dumps(self._played, pickle.HIGHEST_PROTOCOL), 1)
            self._kept.append((self._played.heard, packed))

    def _kept_before(self, heard: int) -> tuple[int, bytes] | None:
        """The last picture after no more than that many entries."""
        place = bisect_right(self._kept, heard, key=lambda kept: kept[0])
        return self._kept[place - 1] if place else None

    def _restore(self, heard: int, packed: bytes) -> None:
        self._played = pickle.loads(zlib.decompress(packed))  # noqa: S301 - made by `_keep`
        self._played.heard = heard

    def _fresh(self) -> _Played:
        recording = self.recording
        observer = MissionObserver(recording.mission, recording.timing, None)
        observer.start(recording.start_s)
        return _Played(observer)
