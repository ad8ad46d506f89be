"""One large mission flown in virtual time, and what its agents and its coordinator need for it.

A random mission is flown by the real cores on an ideal bus; UAVs are lost and tasks appear. Timed
in processor time are the steps of agents in which they decide, all their other steps on what they
hear, steps of the coordinator, and re-plans. These are searched by one thread for as many
iterations as some seconds allow, so that the same seed flies the same mission everywhere; in
virtual time they take none. Agents of one process share the arrays of their boards, so a step in
which a lone agent would make new ones, some tenth of a second at 200 x 5000, is the quicker for it
where another one has made them. Leaves out: links, and vehicles other than ideal ones.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from time import process_time
from typing import Any

from rich.console import RenderableType

from agent.core.agent_core import AgentCore
from agent.core.interface import Action, Event
from coordinator.core.lifecycle import Replan
from coordinator.planner.online import ReplanResult
from coordinator.planner.plan import make_plan
from sim.bench.machine import peak_memory_bytes, this_machine
from sim.bench.results import BenchResult, Progress, quantile, table_of, unheard
from sim.study.design import RandomMissions, fate_seed, span_s
from sim.world.outcome import FlightOutcome, score
from sim.world.settings import planned_anew
from sim.world.simulation import plan_once
from sim.world.stochastic_world import StochasticWorld
from sim.world.uncertainty import Uncertainty
from swarm.model import Mission, Plan
from swarm.model.ids import COORDINATOR
from swarm.protocol.events import LogLine, MessageReceived
from swarm.runtime.clock import Clock
from swarm.runtime.shell import Core
from swarm.runtime.table import Column

METHOD = "guided"


@dataclass(frozen=True, slots=True)
class WorkTimes:
    """How long one kind of work took, each time; None where it was never done."""

    what: str
    count: int
    total_s: float
    """Processor time of all together [s], as the others."""
    median_s: float | None
    p99_s: float | None
    largest_s: float | None

    @classmethod
    def of(cls, what: str, times_s: Sequence[float]) -> WorkTimes:
        """Those of single pieces of work."""
        quantiles = (quantile(times_s, share) for share in (0.5, 0.99, 1.0))
        return cls(what, len(times_s), sum(times_s), *quantiles)


@dataclass(frozen=True, slots=True)
class FlightBench(BenchResult):
    """Everything measured in one run."""

    n_uav: int
    n_task: int
    seed: int
    loss: float
    popup: float
    replan_interval_s: float | None
    """Shortest time between two re-plans [s mission time]; None: the coordinator is dead."""
    value: float
    """Of what was flown [value·s]."""
    undisturbed: float
    """J of the plan in which nobody is lost and all tasks are known from the start [value·s]."""
    done: int
    missed: int
    duplicate_visits: int
    lost_uavs: int
    makespan_s: float
    """Latest end of a visit [s mission time]."""
    epochs: int
    messages: int
    work: tuple[WorkTimes, ...]
    cpu_s: float
    """Processor time of the flight, both plans before it left out [s]."""
    wall_s: float
    peak_bytes: int
    """Of this process, in resident memory."""

    @property
    def of_undisturbed(self) -> float:
        """What is left of the value without losses and pop-ups."""
        return self.value / self.undisturbed if self.undisturbed else 1.0

    def parts(self) -> Iterable[RenderableType]:
        """See `BenchResult`."""
        how = "its coordinator is dead"
        if self.replan_interval_s is not None:
            how = f"its coordinator plans anew every {self.replan_interval_s:g} s at the most"
        yield (
            f"Flown in virtual time: {self.n_uav} UAVs × {self.n_task} tasks, seed {self.seed}, "
            f"loss {self.loss:g}, pop-ups {self.popup:g}; {how}."
        )
        yield (
            f"Value {self.value:.6g}, {self.of_undisturbed:.4f} of the plan's in which nobody is "
            f"lost and all is known ({self.undisturbed:.6g}); {self.done} done, {self.missed} "
            f"missed, {self.duplicate_visits} visited twice; {self.lost_uavs} UAVs lost; "
            f"{self.epochs} epochs, {self.messages} messages, {self.makespan_s:.0f} s."
        )
        yield table_of(
            self.work,
            Column("work", words=True, key="what"),
            Column("times", key="count"),
            Column("all", ".1f", "s", key="total_s"),
            *(
                Column(name, ".2f", "ms", 1e3, key=f"{name}_s")
                for name in ("median", "p99", "largest")
            ),
        )
        yield (
            f"In all {self.cpu_s:.0f} s of processor time, {self.wall_s:.0f} s of wall time; "
            f"memory at its peak {self.peak_bytes / 2**20:.0f} MiB."
        )


class _MeasuredAgent(AgentCore):
    """An agent that notes what its steps take, apart from the others."""

    def __init__(
        self, *args: Any, decided_s: list[float], heard_s: list[float], **settings: Any
    ) -> None:
        super().__init__(*args, **settings)
        self._decided_s = decided_s
        self._heard_s = heard_s

    def step(self, event: Event, now_s: float) -> list[Action]:
        """React to one event."""
        began_s = process_time()
        actions = super().step(event, now_s)
        took_s = process_time() - began_s
        if any(isinstance(action, LogLine) and action.text == "decided" for action in actions):
            self._decided_s.append(took_s)
        elif isinstance(event, MessageReceived):
            self._heard_s.append(took_s)
        return actions


class _TimedCore:
    """The core of a process that notes what its steps take."""

    def __init__(self, core: Core[Any, Any], taken_s: list[float]) -> None:
        self._core = core
        self._taken_s = taken_s

    def start(self, now_s: float) -> Sequence[Any]:
        """See `Core`."""
        return self._core.start(now_s)

    def step(self, event: Any, now_s: float) -> Sequence[Any]:
        """See `Core`."""
        began_s = process_time()
        actions = self._core.step(event, now_s)
        self._taken_s.append(process_time() - began_s)
        return actions

    def next_deadline_s(self) -> float | None:
        """See `Core`."""
        return self._core.next_deadline_s()


def measure_flight(
    n_uav: int,
    n_task: int,
    seed: int,
    uncertainty: Uncertainty,
    clock: Clock,
    *,
    replan_interval_s: float | None,
    progress: Progress = unheard,
) -> FlightBench:
    """Fly the first trial of a study of that seed, timed.

    Args:
        n_uav: UAVs of the random mission.
        n_task: its tasks, those that appear among them.
        seed: of mission, planner and realization.
        uncertainty: what may happen.
        clock: the machine's.
        replan_interval_s: shortest time between two re-plans [s mission time]; None: the
            coordinator dies as the mission begins.
        progress: told what is being done.
    """
    mission = RandomMissions(n_uav, n_task).of_trial(seed, 0)
    fate = uncertainty.draw(mission, span_s(mission), fate_seed(seed, 0))

    def planned(mission: Mission, method: str, seed: int) -> Plan:
        return make_plan(mission, method, clock=clock, seed=seed, threads=1)

    progress("plan without losses and pop-ups")
    undisturbed = planned(mission, METHOD, seed).objective
    progress("plan of what is known at the start")
    planner = plan_once(planned)
    planner(fate.mission, METHOD, fate.seed)
    decided_s, heard_s, led_s, replanned_s = (list[float]() for _ in range(4))
    flown = StochasticWorld(
        fate,
        planner,
        method=METHOD,
        seed=fate.seed,
        coordinator_lost_s=0.0 if replan_interval_s is None else None,
        make_agent=partial(_MeasuredAgent, decided_s=decided_s, heard_s=heard_s),
        replan=_timed(planned_anew, replanned_s, progress),
        replan_interval_s=replan_interval_s,
    )
    leader = flown.world.processes[COORDINATOR]
    leader.core = _TimedCore(leader.core, led_s)
    progress("flight")
    began_cpu_s, began_s = process_time(), clock.now_s()
    flown.run()
    cpu_s, wall_s = process_time() - began_cpu_s, clock.now_s() - began_s
    scored = score(fate, FlightOutcome(tuple(flown.tally.visits), tuple(flown.lost)))
    return FlightBench(
        machine=this_machine(),
        n_uav=n_uav,
        n_task=n_task,
        seed=seed,
        loss=uncertainty.loss,
        popup=uncertainty.popup,
        replan_interval_s=replan_interval_s,
        value=scored.value,
        undisturbed=undisturbed,
        done=scored.done,
        missed=scored.missed,
        duplicate_visits=scored.duplicate_visits,
        lost_uavs=scored.lost_uavs,
        makespan_s=scored.makespan_s,
        epochs=flown.tally.epochs,
        messages=flown.tally.messages,
        work=(
            WorkTimes.of("an agent decides", decided_s),
            WorkTimes.of("an agent hears", heard_s),
            WorkTimes.of("the coordinator's step", led_s),
            WorkTimes.of("a re-plan", replanned_s),
        ),
        cpu_s=cpu_s,
        wall_s=wall_s,
        peak_bytes=peak_memory_bytes(),
    )


def _timed(
    replan: Callable[[Replan], ReplanResult], taken_s: list[float], progress: Progress
) -> Callable[[Replan], ReplanResult]:
    def timed(wanted: Replan) -> ReplanResult:
        progress(f"flight, {wanted.situation.now_s:.0f} s, re-plan {len(taken_s) + 1}")
        began_s = process_time()
        found = replan(wanted)
        taken_s.append(process_time() - began_s)
        return found

    return timed
