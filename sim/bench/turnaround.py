"""How long UAVs wait for their next target, and how well real processes keep to the plan.

Flies a scenario with real processes and lets every agent tell how long each of its
turnarounds took (agent.vehicle.turnaround). The makespan is set beside the plan's: vehicles
are ideal, so what it is longer by is arrivals seen late, decisions and the way to the
vehicle. Leaves out: the time bytes wait in sockets, which `sim.bench.latency` includes.
"""

from __future__ import annotations

import asyncio
import json
import os
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from rich.console import RenderableType

from agent.links.mavlink_vehicle import TURNAROUNDS
from sim.bench.machine import this_machine
from sim.bench.results import BenchResult, Progress, quantile, unheard
from sim.fleet.layout import LaunchOptions
from sim.fleet.run import fly
from swarm.model import Mission
from swarm.runtime.table import Column, ResultTable

TARGET_MS = 20.0
"""What 99 of 100 turnarounds shall not exceed."""
TARGET_RATIO = 1.02
"""What the makespan shall not exceed, in makespans of the plan."""
SHARES = {"p50": 0.5, "p90": 0.9, "p99": 0.99, "max": 1.0}


@dataclass(frozen=True, slots=True)
class TurnaroundFlight:
    """One flight."""

    target_ms: tuple[float, ...]
    """Wall times until the next target was sent, of all UAVs."""
    in_force_ms: tuple[float, ...]
    """Until the mission with it was verified; empty where targets are no missions."""
    idled: int
    """Next targets of UAVs that had found nothing to do before; in no time above."""
    makespan_s: float
    planned_s: float | None
    """None when there was no plan."""
    tasks: int
    done: int
    load: float
    """Processes that wanted to run during the last minute of the flight."""

    @property
    def ratio(self) -> float | None:
        """Makespan in makespans of the plan."""
        return self.makespan_s / self.planned_s if self.planned_s else None


@dataclass(frozen=True, slots=True)
class Turnarounds(BenchResult):
    """Several flights of one scenario."""

    seed: int
    scenario: str
    uavs: int
    speedup: float
    position_rate_hz: float
    rounds: tuple[TurnaroundFlight, ...]

    @property
    def ok(self) -> bool:
        """Whether every task of every flight was done."""
        return all(each.done == each.tasks for each in self.rounds)

    def as_json(self) -> dict[str, Any]:
        """Everything, ready for `json.dumps`."""
        return {
            "machine": asdict(self.machine),
            "seed": self.seed,
            "scenario": self.scenario,
            "uavs": self.uavs,
            "speedup": self.speedup,
            "position_rate_hz": self.position_rate_hz,
            "target_ms": TARGET_MS,
            "target_ratio": TARGET_RATIO,
            **_summaries(self.rounds),
            "idled": sum(each.idled for each in self.rounds),
            "rounds": [
                {**flight, **_summaries([each])}
                for flight, each in zip(self._flights().as_records(), self.rounds, strict=True)
            ],
        }

    def parts(self) -> Iterable[RenderableType]:
        """See `BenchResult`."""
        yield (
            f"{self.scenario}, {self.uavs} UAVs at {self.speedup:g} times wall speed, "
            f"{self.position_rate_hz:g} position reports a second each; seed {self.seed}"
        )
        yield ""
        until = ("next target sent", "its mission in force")
        found = zip(until, _summaries(self.rounds).values(), strict=True)
        yield ResultTable(
            (
                Column("arrival or end of service until", words=True),
                Column("count"),
                *(Column(share, ".1f", "ms") for share in SHARES),
            ),
            [(name, *summary.values()) for name, summary in found if summary["count"]],
        )
        idled = sum(each.idled for each in self.rounds)
        yield f"besides {idled} after finding nothing to do at first"
        yield ""
        yield self._flights()
        yield ""
        yield (
            f"wanted: p99 of next target sent below {TARGET_MS:g} ms, "
            f"ratio at most {TARGET_RATIO:g}"
        )

    def _flights(self) -> ResultTable:
        return ResultTable(
            (
                Column("flight"),
                Column("makespan", ".2f", "s", key="makespan_s"),
                Column("planned", ".2f", "s", key="planned_s"),
                Column("ratio", ".4f", key="ratio"),
                Column("tasks done", key="done"),
                Column("of", key="tasks"),
                Column("load", ".1f", key="load"),
            ),
            [
                (n, each.makespan_s, each.planned_s, each.ratio, each.done, each.tasks, each.load)
                for n, each in enumerate(self.rounds, 1)
            ],
        )


def measure_turnarounds(
    mission: Mission, options: LaunchOptions, rounds: int, tell: Progress = unheard
) -> Turnarounds:
    """Fly ``mission`` several times, one after the other; the log format of ``options`` is JSON.

    Raises:
        ChildFailedError: a process did not start.
    """
    machine, flown = this_machine(), []
    for number in range(1, rounds + 1):
        tell(f"{mission.name}: flight {number} of {rounds}")
        flown.append(asyncio.run(_fly(mission, options)))
    return Turnarounds(
        machine,
        options.seed,
        mission.name,
        len(mission.uavs),
        options.speedup,
        options.position_rate_hz,
        tuple(flown),
    )


async def _fly(mission: Mission, options: LaunchOptions) -> TurnaroundFlight:
    told: list[dict[str, Any]] = []

    def on_log(_name: str, line: str) -> None:
        told.extend(told_turnarounds(line))

    flight = await fly(mission, options, on_frame=lambda *_: None, on_log=on_log)
    plan, result = flight.plan, flight.result
    return TurnaroundFlight(
        target_ms=tuple(time_ms for each in told for time_ms in each["target_ms"]),
        in_force_ms=tuple(time_ms for each in told for time_ms in each["in_force_ms"]),
        idled=sum(each["idled"] for each in told),
        makespan_s=result.makespan_s,
        planned_s=None if plan is None else max(plan.completion_s.values(), default=None),
        tasks=len(mission.tasks),
        done=len(result.done),
        load=os.getloadavg()[0],
    )


def told_turnarounds(line: str) -> Iterable[dict[str, Any]]:
    """What a line of an agent's log, in JSON, tells of its turnarounds: one thing or nothing."""
    if TURNAROUNDS not in line:
        return
    try:
        said = json.loads(line)
    except ValueError:
        return
    if isinstance(said, dict) and said.get("event") == TURNAROUNDS:
        yield said


def quantiles_ms(times_ms: Iterable[float]) -> dict[str, float | None]:
    """Measured times that so many do not exceed, by the names of `SHARES`; None without any."""
    times = list(times_ms)
    return {name: quantile(times, share) for name, share in SHARES.items()}


def _summaries(rounds: Sequence[TurnaroundFlight]) -> dict[str, dict[str, float | None]]:
    """Count and quantiles of both kinds of times, of all ``rounds`` together."""
    times_ms = {
        "sent_ms": [time_ms for each in rounds for time_ms in each.target_ms],
        "in_force_ms": [time_ms for each in rounds for time_ms in each.in_force_ms],
    }
    return {name: {"count": len(them), **quantiles_ms(them)} for name, them in times_ms.items()}
