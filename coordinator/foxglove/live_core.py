"""A session that looks on, flight after flight, each told to viewers from its beginning."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from coordinator.dashboard.operator_session import OperatorSession
from coordinator.foxglove.channels import LiveChannels
from coordinator.recording.recorder import Recorder, RecordingInfo
from coordinator.recording.records import RecordingStarted
from swarm.protocol.events import CommonAction, CommonEvent, PeerSeen


class LiveCore:
    """Around ``session``: what it hears becomes the messages of a recording, for ``channels``.

    Args:
        about: mission, timers and speed-up of the session.
        time_ns: wall time, given the core's time [s -> ns].
    """

    def __init__(
        self,
        session: OperatorSession,
        about: RecordingInfo,
        channels: LiveChannels,
        time_ns: Callable[[float], int],
    ) -> None:
        self._session = session
        self._about = about
        self._channels = channels
        self._time_ns = time_ns
        self._flight = session.mission_state
        self._recorder: Recorder | None = None

    def start(self, now_s: float) -> Sequence[CommonAction]:
        """Begin with nothing known."""
        self._begin(now_s)
        return self._session.start(now_s)

    def step(self, event: CommonEvent, now_s: float) -> Sequence[CommonAction]:
        """Take note of one fact, and tell it."""
        wishes = self._session.step(event, now_s)
        if self._session.mission_state is not self._flight:
            self._flight = self._session.mission_state
            self._begin(now_s)
            for writer in sorted(self._flight.present):
                self._note(PeerSeen(writer), now_s)
        self._note(event, now_s)
        return wishes

    def next_deadline_s(self) -> float | None:
        """Of the session."""
        return self._session.next_deadline_s()

    def look(self, now_s: float) -> None:
        """Show how everything stands, if it is time to: also when nobody says anything."""
        if self._recorder is not None:
            self._recorder.look(now_s, self._time_ns(now_s))

    def _begin(self, now_s: float) -> None:
        time_ns = self._time_ns(now_s)
        self._channels.begin(f"{self._about.mission} {time_ns}")
        self._recorder = Recorder(self._about, self._channels)
        self._note(RecordingStarted(), now_s)

    def _note(self, what: CommonEvent | RecordingStarted, now_s: float) -> None:
        if self._recorder is not None:
            self._recorder.note(what, now_s, self._time_ns(now_s))
