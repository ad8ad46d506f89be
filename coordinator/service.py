"""The coordinator's process from its first seat to its last, with what it keeps of its lives.

One that stands by takes a seat as an onlooker; when it takes over it keeps that seat. When
it has to stand down, it leaves it and watches from a new one: a token cannot be taken
back. Leaves out: every decision (coordinator.core, coordinator.standby).
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from dataclasses import dataclass

from coordinator.core import CoordinatorCore
from coordinator.daemon import run_coordinator
from coordinator.planner.stop import ShouldStop
from coordinator.standby import MakeCoordinator, StandbyCore
from swarm.bus.zenoh_bus import ZenohBus
from swarm.clock import Clock
from swarm.config import Timing
from swarm.model import Mission, Plan
from swarm.store import Store
from swarm.watchdog import SERVICE
from swarm.wire.messages import Snapshot
from swarm.wire.seal import Seal

__all__ = ["Service"]


@dataclass(frozen=True, slots=True)
class Service:
    """What one coordinator's process needs."""

    mission: Mission
    make_core: MakeCoordinator
    make_plan: Callable[[Mission, str, int, ShouldStop], Plan]
    open_bus: Callable[[], Awaitable[ZenohBus]]
    clock: Clock
    timing: Timing
    """In the seconds of ``clock``."""
    answer_s: float
    """How long a question waits for the slowest answer [wall s]."""
    store: Store | None
    """Where it keeps what its next life needs."""
    seal: Seal | None
    """Tells whose word of what it kept still counts; None without keys."""

    async def coordinate(self) -> tuple[int, str | None]:
        """Coordinate the mission; exit status, and why it stood down if it did."""
        memory = self._recall()
        core = self.make_core(*memory)
        return await self._serve(core), core.stood_down

    async def stand_by(self) -> int:
        """Watch the coordinator, and take its place whenever it is lost; exit status."""
        memory, age_s = self._recall()
        while True:
            core = StandbyCore(self.mission, self.make_core, self.timing, memory, age_s)
            status = await self._serve(core)
            if core.stood_down is None:
                return status
            memory, age_s = core.memory(self.clock.now_s()), 0.0

    def _recall(self) -> tuple[Snapshot | None, float]:
        found = None if self.store is None else self.store.load(self.seal)
        return (None, 0.0) if found is None else (found.snapshot, found.age_s)

    async def _serve(self, core: CoordinatorCore | StandbyCore) -> int:
        seat = await self.open_bus()
        stands_by = isinstance(core, StandbyCore)
        SERVICE.ready(f"{'stands by for' if stands_by else 'coordinates'} {self.mission.name}")
        try:
            return await run_coordinator(
                core,
                self.mission,
                seat,
                self.clock,
                self.make_plan,
                save=None if self.store is None else self.store.save,
                answer_s=self.answer_s,
            )
        finally:
            seat.close()
