"""Missions and watched worlds for tests of whole fleets in virtual time."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from agent.core.interface import Action as AgentAction
from coordinator.core.lifecycle import CoordinatorAction
from coordinator.planner.options import after_evaluations
from coordinator.planner.plan import make_plan
from sim.world.engine import Process
from sim.world.settings import QUIET, Planner, ScheduledLosses
from sim.world.virtual_world import World
from swarm.model import Mission, Plan, Task, TaskId, Uav, UavId
from swarm.protocol.events import Ask, CommonEvent, Publish
from swarm.protocol.timing import Timing
from swarm.protocol.uav_messages import Claim
from swarm.runtime.clock import SystemClock


def random_mission(
    rng: np.random.Generator,
    *,
    n_uav: int,
    n_task: int,
    popup_frac: float = 0.0,
    popup_until_s: float = 60.0,
    incapable_frac: float = 0.3,
) -> Mission:
    """Everything drawn at random; each task is within the abilities of one UAV at least."""
    kinds = ("look", "lift", "spray")
    able = rng.random((n_uav, n_task)) >= incapable_frac
    able[rng.integers(0, n_uav, n_task), np.arange(n_task)] = True
    tasks = []
    for number in range(n_task):
        pops_up = rng.random() < popup_frac
        tasks.append(
            Task(
                TaskId(f"t{number:02}"),
                _point(rng, 300.0),
                value=float(rng.uniform(0.5, 7.0)),
                service_s=float(rng.uniform(0.0, 8.0) * rng.integers(0, 2)),
                kind=str(rng.choice(kinds)),
                appears_s=float(rng.uniform(1.0, popup_until_s)) if pops_up else 0.0,
            )
        )
    uavs = []
    for number in range(n_uav):
        success = {kind: float(rng.uniform(0.3, 1.0)) for kind in kinds}
        success |= {tasks[i].id: 0.0 for i in range(n_task) if not able[number, i]}
        survival = {kind: float(rng.uniform(0.7, 1.0)) for kind in kinds}
        uavs.append(
            Uav(
                UavId(f"u{number}"),
                _point(rng, 50.0),
                float(rng.uniform(3.0, 15.0)),
                success,
                survival,
            )
        )
    horizon_s = float(rng.choice([60.0, 300.0, 2000.0]))
    return Mission("random", horizon_s, tuple(uavs), tuple(tasks))


def _point(rng: np.random.Generator, size_m: float) -> tuple[float, float, float]:
    east_m, north_m, up_m = rng.uniform(0.0, 1.0, 3) * (size_m, size_m, 20.0)
    return float(east_m), float(north_m), float(up_m)


def plan_for(mission: Mission, method: str, seed: int) -> Plan:
    """An offline plan of what is known of ``mission`` at the start; a good one is not needed."""
    stop = after_evaluations(200)
    return make_plan(mission.known_at_start(), method, clock=SystemClock(), seed=seed, stop=stop)


def able_uavs(mission: Mission, task: Task, uavs: Collection[str]) -> list[str]:
    """Those of ``uavs`` that are capable of ``task``."""
    return [u.id for u in mission.uavs if u.id in uavs and mission.success(u, task) > 0.0]


class Ear:
    """Somebody who takes down what is heard on the bus; to be admitted to a world."""

    def __init__(self) -> None:
        self.facts: list[CommonEvent] = []

    def start(self, now_s: float) -> list[Ask]:
        return [Ask()]

    def step(self, fact: CommonEvent, now_s: float) -> list[Ask]:
        self.facts.append(fact)
        return []

    def next_deadline_s(self) -> float | None:
        return None


class WatchedWorld(World):
    """A world that keeps an eye on every claim while it runs."""

    def __init__(
        self,
        mission: Mission,
        make_plan: Planner = plan_for,
        *,
        method: str = "greedy",
        seed: int = 0,
        faults: ScheduledLosses | None = None,
        timing: Timing = QUIET,
        latency_s: float = 0.0,
    ) -> None:
        super().__init__(
            mission,
            make_plan,
            method=method,
            seed=seed,
            faults=faults,
            timing=timing,
            latency_s=latency_s,
        )
        self.latency_s = latency_s
        self.claimed: list[tuple[float, str, Claim]] = []
        """Every claim as it was made: virtual time, UAV, claim."""
        self.shared_s: dict[tuple[str, str, str], float] = {}
        """Longest time for which two living UAVs claimed one task, by both and the task [s]."""
        self._shared_since_s: dict[tuple[str, str, str], float] = {}

    def execute(self, process: Process, action: AgentAction | CoordinatorAction) -> None:
        if isinstance(action, Publish) and isinstance(action.message.body, Claim):
            self.claimed.append((self.queue.now_s(), process.name, action.message.body))
        super().execute(process, action)

    def stepped(self, process: Process) -> None:
        super().stepped(process)
        now_s, by_task, shared = self.queue.now_s(), dict[str, list[str]](), set()
        for uav, agent in self.agents.items():
            claim = agent.claim
            if not self.processes[uav].over and claim is not None and claim.task is not None:
                for other in by_task.setdefault(claim.task, []):
                    shared.add((other, uav, claim.task))
                by_task[claim.task].append(uav)
        for key in shared:
            since_s = self._shared_since_s.setdefault(key, now_s)
            self.shared_s[key] = max(self.shared_s.get(key, 0.0), now_s - since_s)
        for key in self._shared_since_s.keys() - shared:
            del self._shared_since_s[key]
