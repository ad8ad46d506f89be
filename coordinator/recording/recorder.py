"""What goes into a recording, and in which order: facts as they come, pictures in between.

A recorder follows the mission by an onlooker of its own, fed with the very facts it writes
down, so that what it draws is what a replay will show. Pure: bytes go to a `GrowingMcap`,
times are passed in. Leaves out: threads and disks (coordinator.recording.recording_file) and
where the facts come from (coordinator.recording.recorded_core).
"""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass
from typing import Final

from coordinator.recording.foxglove import FOXGLOVE_SCHEMAS
from coordinator.recording.growing_mcap import GrowingMcap
from coordinator.recording.pictures import PROGRESS, PROGRESS_SCHEMA, Pictures, level_of, log_line
from coordinator.recording.records import (
    FORMAT,
    SCHEMAS,
    Begun,
    Line,
    Recorded,
    encode,
    schema_of,
)
from coordinator.status.onlooker import Onlooker
from swarm import __version__
from swarm.config import Timing
from swarm.model import Plan
from swarm.wire.messages import SCHEMA_VERSION

__all__ = ["METADATA", "About", "Recorder"]

METADATA: Final = "peckorder"
"""Name of the file's metadata."""
PICTURE_S: Final = 0.5
"""Wall time between two pictures."""


@dataclass(frozen=True, slots=True)
class About:
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


class Recorder:
    """Turns facts into lines of a file.

    Args:
        about: what is recorded.
    """

    def __init__(self, about: About) -> None:
        self.mcap = GrowingMcap(f"peckorder {__version__}", about.metadata(), METADATA)
        for name in SCHEMAS:
            self.mcap.define(name, schema_of(name))
        for name, schema in FOXGLOVE_SCHEMAS.items():
            self.mcap.define(name, schema)
        self.mcap.define(PROGRESS, PROGRESS_SCHEMA)
        self._mission = about.mission
        self._onlooker = Onlooker(about.mission, about.timing, None)
        self._pictures = Pictures()
        self._period_s = PICTURE_S * about.speedup
        self._picture_at_s = -math.inf
        self._last: tuple[float, int] | None = None
        """Time of the newest fact, by both clocks."""

    def note(self, what: Recorded, now_s: float, time_ns: int) -> None:
        """Write down a fact.

        Args:
            what: the fact, or a plan that was made.
            now_s: when, by the clock of the core that got it [s].
            time_ns: when, by the wall's or the virtual clock [ns].
        """
        match what:
            case Begun():
                self._onlooker.start(now_s)
            case Plan():
                self._onlooker.observer.plan = what
            case _:
                self._onlooker.step(what, now_s)
        observer = self._onlooker.observer
        line = encode(what, self._mission, now_s, observer.mission_s(now_s))
        if line is not None:
            self._add(line, time_ns)
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
            for line in self._pictures.draw(self._onlooker.observer, now_s, time_ns):
                self._add(line, time_ns)

    def _add(self, line: Line, time_ns: int) -> None:
        self.mcap.add(line.topic, line.schema, line.data, time_ns)
