"""Recordings for tests: of missions flown in virtual time, in memory or on the disk."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from coordinator.mission_view.mission_state import MissionState
from coordinator.planner.plan import make_plan
from coordinator.recording.flight_recorder import virtual_ns
from coordinator.recording.growing_mcap import Patch
from coordinator.recording.recorder import RecordedCore, Recorder, RecordingInfo, new_mcap
from coordinator.recording.records import RecordableFact
from sim.world.network import IdealNetwork
from sim.world.settings import ScheduledLosses, WorldSettings
from sim.world.virtual_world import World
from swarm.model import Mission, Plan, UavId
from swarm.protocol.events import CommonAction
from swarm.protocol.timing import Timing
from swarm.runtime.clock import SystemClock


@dataclass(slots=True)
class Disk:
    """A file in memory; remembers how it stood after every write."""

    data: bytearray = field(default_factory=bytearray)
    patches: list[Patch] = field(default_factory=list)
    states: list[bytes] = field(default_factory=list)
    closed: bool = False

    def apply(self, patch: Patch) -> None:
        self.data[patch.offset :] = patch.data
        self.patches.append(patch)
        self.states.append(bytes(self.data))

    def close(self) -> None:
        self.closed = True


class Steps:
    """A fact sink that writes to a disk of its own after every so many facts."""

    def __init__(self, about: RecordingInfo, every: int) -> None:
        self.disk = Disk()
        self.noted: list[tuple[float, RecordableFact]] = []
        self.written: list[int] = []
        """How many facts each state of the disk holds."""
        self._every = every
        self._mcap = new_mcap(about)
        self._recorder = Recorder(about, self._mcap)
        self._grow(last=False)

    def note(self, what: RecordableFact, now_s: float) -> None:
        self.noted.append((now_s, what))
        self._recorder.note(what, now_s, virtual_ns(now_s))
        if len(self.noted) % self._every == 0:
            self._grow(last=False)

    def finish(self) -> bytes:
        self._recorder.draw()
        self._grow(last=True)
        return bytes(self.disk.data)

    def _grow(self, *, last: bool) -> None:
        patch = self._mcap.grow(last=last)
        if patch is not None:
            self.disk.apply(patch)
            self.written.append(len(self.noted))


@dataclass(frozen=True, slots=True)
class Flown:
    """A mission that is over, and its recording."""

    mission_state: MissionState
    steps: Steps
    data: bytes

    def write(self, path: Path) -> Path:
        path.write_bytes(self.data)
        return path


def fly_recorded(
    mission: Mission,
    *,
    method: str = "greedy",
    lost_at_s: Mapping[UavId, float] | None = None,
    every: int = 50,
) -> Flown:
    """Fly ``mission`` in virtual time, and write it down after every so many facts."""
    timing = Timing(status_s=0.5)
    steps = Steps(RecordingInfo(mission.name, timing, virtual=True), every)

    def plan(what: Mission, how: str, seed: int) -> Plan:
        return make_plan(what, how, clock=SystemClock(), seed=seed, modest=True)

    def look_on(mission_state: MissionState) -> RecordedCore[CommonAction]:
        return RecordedCore(mission_state, steps, mission_state)

    world = World(
        mission,
        plan,
        method=method,
        seed=0,
        faults=ScheduledLosses(lost_at_s=lost_at_s or {}),
        timing=timing,
        setting=WorldSettings(lambda queue: IdealNetwork(queue, 0.0), observer=look_on),
    )
    assert world.run(limit_s=100_000.0)
    return Flown(world.mission_state, steps, steps.finish())
