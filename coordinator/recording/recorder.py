"""What goes into a recording, and in which order: facts as they come, pictures in between.

A recorder follows the mission by an observer of its own, fed with the very facts it writes down, so
that what it draws is what a replay will show. Pure: lines go to a `LineSink`, a file in the making
or who looks on live, and times are passed in.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Final, Generic, Protocol, TypeVar

from coordinator.mission_view.mission_state import MissionState
from coordinator.mission_view.observation import MissionObserver
from coordinator.recording.curves import CURVE_SCHEMAS
from coordinator.recording.foxglove_schemas import FOXGLOVE_SCHEMAS
from coordinator.recording.foxglove_topics import FoxgloveTopics, level_of, log_line
from coordinator.recording.growing_mcap import GrowingMcap
from coordinator.recording.records import (
    FORMAT,
    SCHEMAS,
    FileMessage,
    RecordableFact,
    RecordingStarted,
    encode,
    schema_of,
)
from swarm import __version__
from swarm.model import Plan
from swarm.protocol.events import CommonAction, CommonEvent, Finish, MessageReceived, Publish
from swarm.protocol.messages import SCHEMA_VERSION, MissionPhase
from swarm.protocol.timing import Timing, earliest
from swarm.runtime.shell import Core

A = TypeVar("A")


class FactSink(Protocol):
    """Takes down facts."""

    def note(self, what: RecordableFact, now_s: float) -> None:
        """At ``now_s`` of the core's clock; returns at once."""
        ...


class RecordedCore(Generic[A]):
    """A core that hears the bus, and a recorder beside it.

    Args:
        fact_sink: told every fact before the core is.
        mission_state: may be given a plan by somebody else, which is written down, too.
    """

    def __init__(
        self, core: Core[CommonEvent, A], fact_sink: FactSink, mission_state: MissionState
    ) -> None:
        self._core = core
        self._fact_sink = fact_sink
        self._mission_state = mission_state
        self._plan: Plan | None = None

    def start(self, now_s: float) -> Sequence[A]:
        """Start the core."""
        self._fact_sink.note(RecordingStarted(), now_s)
        return self._told(self._core.start(now_s), now_s)

    def step(self, event: CommonEvent, now_s: float) -> Sequence[A]:
        """Step the core."""
        if self._mission_state.plan is not self._plan and self._mission_state.plan is not None:
            self._plan = self._mission_state.plan
            self._fact_sink.note(self._plan, now_s)
        self._fact_sink.note(event, now_s)
        return self._told(self._core.step(event, now_s), now_s)

    def next_deadline_s(self) -> float | None:
        """Of the core."""
        return self._core.next_deadline_s()

    def _told(self, wishes: Sequence[A], now_s: float) -> Sequence[A]:
        # A process does not hear itself.
        for wish in wishes:
            if isinstance(wish, Publish):
                self._fact_sink.note(MessageReceived(wish.message), now_s)
        return wishes


METADATA: Final = "peckorder"
"""Name of the file's metadata."""
PICTURE_S: Final = 0.5
"""Wall time between two pictures."""


@dataclass(frozen=True, slots=True)
class RecordingInfo:
    """What holds for a whole recording."""

    mission: str
    timing: Timing
    """Of the core whose facts are recorded [s of its clock]."""
    speedup: float = 1.0
    """Seconds of that clock per wall second; 1 in virtual time."""
    scenario: str = ""
    """What was flown, as far as the one who records knows: a name or a path."""
    virtual: bool = False
    """Whether all times are virtual."""

    def metadata(self) -> dict[str, str]:
        """As the file has it."""
        return {
            "format": FORMAT,
            "wire": str(SCHEMA_VERSION),
            "version": __version__,
            "mission": self.mission,
            "scenario": self.scenario,
            "speedup": repr(self.speedup),
            "clock": "virtual" if self.virtual else "wall",
            "timing": json.dumps(asdict(self.timing)),
        }


class LineSink(Protocol):
    """Takes lines, each with its topic and schema."""

    def define(self, schema: str, data: bytes) -> None:
        """Publish a JSON schema under a name that is not taken."""
        ...

    def add(self, topic: str, schema: str, data: bytes, log_ns: int) -> None:
        """One message of UTF-8 JSON, of a schema that is defined, as of that time [ns]."""
        ...


def new_mcap(about: RecordingInfo) -> GrowingMcap:
    """A file in the making, with nothing in it but what it is ``about``."""
    return GrowingMcap(f"peckorder {__version__}", about.metadata(), METADATA)


class Recorder:
    """Turns facts into lines."""

    def __init__(self, about: RecordingInfo, sink: LineSink) -> None:
        self._sink = sink
        for name in SCHEMAS:
            sink.define(name, schema_of(name))
        for name, schema in (*FOXGLOVE_SCHEMAS.items(), *CURVE_SCHEMAS.items()):
            sink.define(name, schema)
        self._mission = about.mission
        self._observer = MissionObserver(about.mission, about.timing, None)
        self._pictures = FoxgloveTopics()
        self._period_s = PICTURE_S * about.speedup
        self._picture_at_s = -math.inf
        self._last: tuple[float, int] | None = None
        """Time of the newest fact or look, by both clocks."""

    def note(self, what: RecordableFact, now_s: float, time_ns: int) -> None:
        """Write down a fact or a plan; ``time_ns`` is by the wall's or the virtual clock [ns]."""
        match what:
            case RecordingStarted():
                self._observer.start(now_s)
            case Plan():
                self._observer.mission_state.plan = what
            case _:
                self._observer.step(what, now_s)
        mission_state = self._observer.mission_state
        line = encode(what, self._mission, now_s, mission_state.mission_s(now_s))
        if line is not None:
            self._add(line, time_ns)
        self.look(now_s, time_ns)

    def look(self, now_s: float, time_ns: int) -> None:
        """Show how everything stands at that time, if it is time for another picture."""
        self._last = now_s, time_ns
        if now_s >= self._picture_at_s:
            self._picture_at_s = now_s + self._period_s
            self.draw()

    def log(self, name: str, line: str, time_ns: int) -> None:
        """Write down what a process has logged."""
        self._add(log_line(name, line, level_of(line), time_ns), time_ns)

    def draw(self) -> None:
        """Show how everything stands as of the newest fact."""
        if self._last is not None:
            now_s, time_ns = self._last
            for line in self._pictures.draw(self._observer.mission_state, now_s, time_ns):
                self._add(line, time_ns)

    def _add(self, line: FileMessage, time_ns: int) -> None:
        self._sink.add(line.topic, line.schema, line.data, time_ns)


class RecordingObserver:
    """A core that looks on until everybody who took part has left.

    Args:
        linger_s: how long to wait for somebody to come back [s of ``now_s``].
        until_s: when to stop at the latest, from the start [s of ``now_s``]; None: never.
    """

    def __init__(
        self, mission: str, timing: Timing, *, linger_s: float, until_s: float | None
    ) -> None:
        self.observer = MissionObserver(mission, timing, None)
        self._linger_s = linger_s
        self._until_s = until_s
        self._stop_at_s: float | None = None
        self._empty_at_s: float | None = None
        """Since when nobody has been there, after somebody had."""
        self._met = False

    def start(self, now_s: float) -> list[CommonAction]:
        """Ask what has happened so far."""
        if self._until_s is not None:
            self._stop_at_s = now_s + self._until_s
        return self.observer.start(now_s)

    def step(self, fact: CommonEvent, now_s: float) -> list[CommonAction]:
        """Take note of one fact."""
        wishes = self.observer.step(fact, now_s)
        mission_state = self.observer.mission_state
        brief = mission_state.replica.brief
        fleet = mission_state.present if brief is None else {uav.id for uav in brief.uavs}
        there = not fleet.isdisjoint(mission_state.present)
        self._met |= there
        if mission_state.cut_since_s is not None:
            # Who is there cannot be seen; after the end nobody need be waited for.
            there = brief is not None and mission_state.phase is not MissionPhase.ENDED
        if there or not self._met:
            self._empty_at_s = None
        elif self._empty_at_s is None:
            self._empty_at_s = now_s
        deadline_s = earliest(self._stop_at_s, self._over_at_s)
        if deadline_s is not None and deadline_s <= now_s:
            wishes.append(Finish(0))
        return wishes

    def next_deadline_s(self) -> float | None:
        """When `step` wants a tick."""
        return earliest(self.observer.next_deadline_s(), self._stop_at_s, self._over_at_s)

    @property
    def _over_at_s(self) -> float | None:
        return None if self._empty_at_s is None else self._empty_at_s + self._linger_s
