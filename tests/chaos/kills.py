"""One process of a flying fleet killed at a random moment and started anew, again and again.

Every trial flies the mission once. The moment of the blow is uniform over the planned
duration of the mission, and so is, over a second or two, how long the process is gone;
which agent or router it hits is drawn as well. Everything drawn follows from one seed;
what real processes make of it does not. Leaves out: command line and tables
(tests.chaos.cli), single flights (sim.fleet.faults.flight).
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from sim.fleet.faults.flight import ChaosFlight, open_chaos_flight
from sim.fleet.layout import LaunchOptions
from swarm.model import Mission
from swarm.model.ids import COORDINATOR
from swarm.protocol.messages import MissionPhase
from swarm.runtime.clock import SystemClock
from swarm.runtime.errors import SwarmError

LONGEST_GONE_S = 2.0
"""A process stays dead for up to this long [wall s]."""
START_LIMIT_S = 120.0
END_LIMIT_S = 180.0
LAST_WORDS_S = 1.0
"""Wall time after the end of a mission in which its last news reach everyone."""


class KillTarget(StrEnum):
    """What is hit."""

    AGENT = "agent"
    COORDINATOR = "coordinator"
    ROUTER = "router"


@dataclass(frozen=True, slots=True)
class PlannedKill:
    """What will happen in one trial."""

    name: str
    """Of the process."""
    moment_frac: float
    """When, as a share of the planned duration of the mission."""
    gone_s: float
    """How long it is gone before it is started anew [wall s]."""


@dataclass(frozen=True, slots=True)
class KillTrial:
    """What came of one blow."""

    blow: PlannedKill
    at_s: float
    """When it fell [s mission time]."""
    done: int
    n_task: int
    duplicates: int
    agreement_s: float
    """From the restart to agreement on all claims [wall s]."""
    wall_s: float
    faults: tuple[str, ...]
    """What was wrong, in words."""

    @property
    def passed(self) -> bool:
        """Whether all tasks were done and every invariant held."""
        return self.done == self.n_task and not self.faults


def draw_kills(
    what: KillTarget, uavs: tuple[str, ...], routers: int, trials: int, seed: int
) -> list[PlannedKill]:
    """So many blows, at random moments."""
    rng = np.random.default_rng(seed)
    names = {
        KillTarget.AGENT: uavs,
        KillTarget.COORDINATOR: (COORDINATOR,),
        KillTarget.ROUTER: tuple(f"router {number}" for number in range(1, routers + 1)),
    }[what]
    return [
        PlannedKill(
            name=names[int(rng.integers(len(names)))],
            moment_frac=float(rng.random()),
            gone_s=float(rng.uniform(0.0, LONGEST_GONE_S)),
        )
        for _ in range(trials)
    ]


async def fly_kill_trials(
    mission: Mission,
    options: LaunchOptions,
    blows: list[PlannedKill],
    *,
    jobs: int,
    on_trial: Callable[[int, KillTrial], None],
) -> list[KillTrial]:
    """One flight for each blow, ``jobs`` at a time.

    Args:
        mission: the scenario of ``options``.
        options: how to fly it.
        blows: what to do to it.
        jobs: flights at the same time.
        on_trial: called with the number of each trial and the trial, as they end.
    """
    free = asyncio.Semaphore(jobs)

    async def one(number: int, blow: PlannedKill) -> KillTrial:
        async with free:
            trial = await fly_kill_trial(mission, options, blow)
        on_trial(number, trial)
        return trial

    async with asyncio.TaskGroup() as group:
        tasks = [group.create_task(one(number, blow)) for number, blow in enumerate(blows)]
    return [task.result() for task in tasks]


async def fly_kill_trial(mission: Mission, options: LaunchOptions, blow: PlannedKill) -> KillTrial:
    """Fly ``mission`` once and let ``blow`` fall on it."""
    clock = SystemClock()
    begun_s = clock.now_s()
    at_s = 0.0
    trouble: tuple[str, ...] = ()
    async with open_chaos_flight(mission, options) as flight:
        try:
            at_s = await _let_fall(flight, blow)
            await _end(flight)
        except (TimeoutError, SwarmError) as fault:
            trouble = (str(fault), *(f"{name}: {line}" for name, line in flight.lines[-5:]))
    verdict = flight.verdict()
    return KillTrial(
        blow=blow,
        at_s=at_s,
        done=len(verdict.flight.result.done),
        n_task=len(mission.tasks),
        duplicates=verdict.duplicates,
        agreement_s=verdict.agreement_s,
        wall_s=clock.now_s() - begun_s,
        faults=(*trouble, *verdict.faults, *verdict.flight.fates),
    )


async def _let_fall(flight: ChaosFlight, blow: PlannedKill) -> float:
    """Kill at the moment and start anew; the mission time of the blow [s]."""
    run = flight.run
    mission_state = run.mission_state

    def mission_s() -> float:
        return mission_state.mission_s(run.clock.now_s()) or 0.0

    await flight.until(
        lambda: mission_state.phase is MissionPhase.RUNNING and mission_state.plan is not None,
        "the mission starts",
        START_LIMIT_S,
    )
    planned_s = (
        max(mission_state.plan.completion_s.values(), default=0.0) if mission_state.plan else 0.0
    )
    moment_s = blow.moment_frac * planned_s
    await flight.until(lambda: mission_s() >= moment_s, "the moment comes", END_LIMIT_S)
    at_s = mission_s()
    await flight.kill(blow.name)
    await asyncio.sleep(blow.gone_s)
    await flight.restart(blow.name)
    return at_s


async def _end(flight: ChaosFlight) -> None:
    """Wait for the end of the mission; nobody need come home."""
    run = flight.run

    def over() -> bool:
        agents = [uav.id for uav in run.launch.mission.uavs]
        ended = run.mission_state.phase is MissionPhase.ENDED
        return ended or not any(run.launch.runs(agent) for agent in agents)

    await flight.until(over, "the mission ends", END_LIMIT_S)
    await asyncio.sleep(LAST_WORDS_S)
