"""A recording of a mission that is flown in virtual time.

Leaves out: flying it (sim.simulate) and what is recorded (coordinator.recording.recorder).
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path

from coordinator.observer import Observer
from coordinator.recording.flight_recorder import recording_to, virtual_ns
from coordinator.recording.recorded_core import RecordedCore
from coordinator.recording.recorder import About
from sim.fated_world import OnlookerMaker
from swarm.config import Timing
from swarm.errors import SwarmError
from swarm.events import Wish

__all__ = ["recording_simulation"]


@contextlib.contextmanager
def recording_simulation(
    mission: str, scenario: str, path: Path | None
) -> Iterator[OnlookerMaker | None]:
    """What makes an onlooker whose facts go into a new file; None if there is no path.

    Raises:
        SwarmError: in the end, if not everything could be written.
    """
    if path is None:
        yield None
        return
    faults: list[str] = []
    with contextlib.ExitStack() as open_files:

        def look_on(observer: Observer, timing: Timing) -> RecordedCore[Wish]:
            about = About(mission, timing, scenario=scenario, virtual=True)
            recorder = open_files.enter_context(
                recording_to(path, about, virtual_ns, faults.append, patient=True)
            )
            return recorder.around(observer, observer)

        yield look_on
    if faults:
        raise SwarmError(faults[0])
