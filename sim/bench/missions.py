"""How long whole missions take in virtual time, flown by the agents' real cores.

Every mission is another random one, planned anew with modest effort and flown by the greedy rule on
an ideal bus with its coordinator dead, as the policy `greedy` of studies. What happens by chance
spreads over the mission's horizon.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from multiprocessing import get_context
from time import process_time

from rich.console import RenderableType

from coordinator.planner.plan import make_plan
from sim.bench.machine import this_machine
from sim.bench.results import BenchResult, table_of
from sim.study.generator import mission_of, random_mission
from sim.study.policies.agents import GREEDY
from sim.study.policies.roster import Planner
from sim.world.outcome import score
from sim.world.uncertainty import Uncertainty
from swarm.model import Plan
from swarm.runtime.clock import Clock, SystemClock
from swarm.runtime.table import Column

_BLOCK = 10
"""Missions a process flies between two reports."""


@dataclass(frozen=True, slots=True)
class MissionBatch:
    """Which missions to fly."""

    n_uav: int
    n_task: int
    seeds: range
    """Of the missions, and of what happens in them."""
    uncertainty: Uncertainty


@dataclass(frozen=True, slots=True)
class BatchResult:
    """What some missions took, and came to."""

    plan_cpu_s: float
    """CPU time of this process spent on planning [s]."""
    fly_cpu_s: float
    """The same on flying."""
    done: int
    """Tasks done."""
    lost: int
    """UAVs lost."""


@dataclass(frozen=True, slots=True)
class MissionsBench(BenchResult):
    """Everything measured in one run."""

    n_uav: int
    n_task: int
    missions: int
    seed: int
    """Of the first mission; each of the others has the next."""
    jobs: int
    """Processes that flew them."""
    loss: float
    popup: float
    wall_s: float
    missions_per_min: float
    plan_cpu_s: float
    """Per mission [s]."""
    fly_cpu_s: float
    """Per mission [s]."""
    done: int
    """Tasks done in all missions."""
    lost: int
    """UAVs lost in all missions."""

    @property
    def cpu_s(self) -> float:
        """Per mission, planning and flying [s]."""
        return self.plan_cpu_s + self.fly_cpu_s

    def parts(self) -> Iterable[RenderableType]:
        """See `BenchResult`."""
        yield (
            f"{self.missions} random missions of {self.n_uav} × {self.n_task}, seeds "
            f"{self.seed}..{self.seed + self.missions - 1}, by the greedy rule, {self.jobs} "
            f"process{'es' if self.jobs > 1 else ''}:"
        )
        yield table_of(
            [self],
            Column("wall time", ".1f", "s", key="wall_s"),
            Column("missions/min", ".0f", key="missions_per_min"),
            Column("CPU per mission", ".0f", "ms", 1e3, key="cpu_s"),
            Column("planning", ".0f", "ms", 1e3, key="plan_cpu_s"),
            Column("flying", ".0f", "ms", 1e3, key="fly_cpu_s"),
        )
        yield (
            f"{self.loss:.0%} of the UAVs are lost ({self.lost} were), {self.popup:.0%} of the "
            f"tasks pop up; {self.done} tasks were done."
        )


def measure_missions(
    which: MissionBatch, jobs: int, clock: Clock, progress: Callable[[int], None] = lambda _: None
) -> MissionsBench:
    """Fly missions, at least one, in several processes; with one job in this one.

    The wall time includes that of starting processes. ``progress`` is told the number of missions
    flown since it was last told.
    """
    machine, begin_s = this_machine(), clock.now_s()
    flown: list[BatchResult] = []
    for block, done in _flown(which, jobs):
        flown.append(done)
        progress(len(block))
    wall_s, count = clock.now_s() - begin_s, len(which.seeds)
    return MissionsBench(
        machine=machine,
        n_uav=which.n_uav,
        n_task=which.n_task,
        missions=count,
        seed=which.seeds[0],
        jobs=jobs,
        loss=which.uncertainty.loss,
        popup=which.uncertainty.popup,
        wall_s=wall_s,
        missions_per_min=60.0 * count / wall_s,
        plan_cpu_s=sum(done.plan_cpu_s for done in flown) / count,
        fly_cpu_s=sum(done.fly_cpu_s for done in flown) / count,
        done=sum(done.done for done in flown),
        lost=sum(done.lost for done in flown),
    )


def fly_block(which: MissionBatch) -> BatchResult:
    """Plan and fly missions one after the other in this process."""
    clock = SystemClock()
    plan_cpu_s = fly_cpu_s = 0.0
    done = lost = 0
    for seed in which.seeds:
        name = f"random-{seed}"
        mission = mission_of(random_mission(which.n_uav, which.n_task, seed), name)
        fate = which.uncertainty.draw(mission, mission.horizon_s, seed)
        begin_s = process_time()
        plan = make_plan(fate.mission, GREEDY.method, clock=clock, seed=seed, modest=True)
        planned_s = process_time()
        flight = GREEDY.fly(fate, _planner_of(plan), clock)
        fly_cpu_s += process_time() - planned_s
        plan_cpu_s += planned_s - begin_s
        scored = score(fate, flight)
        done += scored.done
        lost += scored.lost_uavs
    return BatchResult(plan_cpu_s, fly_cpu_s, done, lost)


def _flown(which: MissionBatch, jobs: int) -> Iterator[tuple[range, BatchResult]]:
    blocks = [which.seeds[at : at + _BLOCK] for at in range(0, len(which.seeds), _BLOCK)]
    parts = [replace(which, seeds=block) for block in blocks]
    if jobs == 1:
        yield from zip(blocks, map(fly_block, parts), strict=True)
        return
    with ProcessPoolExecutor(jobs, get_context("spawn")) as workers:
        yield from zip(blocks, workers.map(fly_block, parts), strict=True)


def _planner_of(plan: Plan) -> Planner:
    return lambda _mission, _method: plan
