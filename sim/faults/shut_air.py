"""Which UAVs of a whole fleet found no way because somebody was missing.

Whoever is lost or not heard keeps the air that it was granted, and its seats, until its battery
must be empty (swarm/separation). A task that is left open for that is nobody's fault; but who had
the time to look again once everybody was heard could have done it.
"""

from __future__ import annotations

from agent.core.agent_core import AgentCore
from sim.faults.injector import FaultInjector
from sim.world.engine import Process
from sim.world.rough_network import RoughNetwork
from sim.world.virtual_world import World
from swarm.protocol.events import LogLine
from swarm.separation.taken_ways import is_home

_LOOKS_AGAIN_S = 5.0
"""After a task that was refused is considered again, it takes at most so long to be flown to."""


class ShutAir:
    """What one fleet could not fly to, as seen by who knows all.

    Args:
        world: in which it flies.
        network: tells who can talk to whom.
        injector: tells who hangs for good.
    """

    def __init__(self, world: World, network: RoughNetwork, injector: FaultInjector) -> None:
        self.landed: set[str] = set()
        """UAVs that landed where they were, for want of a way home while somebody was missing."""
        self._world, self._network, self._injector = world, network, injector
        self._missing_s: dict[tuple[str, str], float] = {}
        """UAV and task to which it found no way while somebody was missing; when anybody was so
        last [s]."""

    def keeps_from(self, uav: str, task: str) -> bool:
        """Whether ``uav`` found no way to ``task`` before it had taken no further part."""
        return (uav, task) in self._missing_s

    def noted(self, process: Process, note: LogLine) -> None:
        """``process`` has written a line into its log."""
        if note.text not in ("no way", "lands where it is") or not self.lacks_somebody(process):
            return
        if note.text == "lands where it is":
            self.landed.add(process.name)
        elif "task" in note.fields:
            self._missing_s[process.name, str(note.fields["task"])] = self._world.queue.now_s()

    def look(self, process: Process) -> None:
        """Find out whether anybody is missing still, often."""
        kept = [key for key in self._missing_s if key[0] == process.name]
        if kept and self.lacks_somebody(process):
            self._missing_s.update(dict.fromkeys(kept, self._world.queue.now_s()))

    def left(self, process: Process) -> None:
        """``process`` takes no further part: what it had the time for was not kept from it."""
        self.look(process)
        since_s = self._world.queue.now_s() - self._world.timing.reconsider_s - _LOOKS_AGAIN_S
        for uav, task in [key for key, at_s in self._missing_s.items() if at_s < since_s]:
            if uav == process.name:
                del self._missing_s[uav, task]

    def is_lost(self, uav: str) -> bool:
        """Whether nobody speaks for ``uav`` any more, and it did not end by itself."""
        process = self._world.processes[uav]
        silent = process.over or process in self._injector.held_for_good
        return silent and uav not in self._world.finished

    def lacks_somebody(self, process: Process) -> bool:
        """Whether any other of the fleet is gone or not heard, and not known to be home."""
        world, core = self._world, process.core
        if not isinstance(core, AgentCore):
            return False
        claims = core.replica.claims
        others = (world.processes[uav] for uav in world.agents if uav != process.name)
        return any(
            not is_home(claims.get(other.name))
            and (self.is_lost(other.name) or not self._network.joined(process, other))
            for other in others
        )
