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
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from rich.console import Group, RenderableType

from agent.links.mavlink_vehicle import TURNAROUNDS
from sim.bench.machine import MachineInfo
from sim.fleet.layout import LaunchOptions
from sim.fleet.run import fly
from swarm.model import Mission
from swarm.runtime.table import Column, ResultTable

__all__ = [
    "SHARES",
    "TARGET_MS",
    "TARGET_RATIO",
    "TurnaroundFlight",
    "Turnarounds",
    "measure_turnarounds",
    "told_turnarounds",
    "turnarounds_as_json",
    "turnarounds_as_rich",
]


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
class Turnarounds:
    """Several flights of one scenario."""

    scenario: str
    uavs: int
    speedup: float
    position_rate_hz: float
    rounds: tuple[TurnaroundFlight, ...]

    @property
    def ok(self) -> bool:
        """Whether every task of every flight was done."""
        return all(each.done == each.tasks for each in self.rounds)


def measure_turnarounds(
    mission: Mission,
    options: LaunchOptions,
    rounds: int,
    on_progress: Callable[[str], None] | None = None,
) -> Turnarounds:
    """Fly ``mission`` several times, one after the other.

    Args:
        mission: the scenario of ``options``.
        options: how to fly it; their log format is JSON.
        rounds: how often.
        on_progress: told what is being done.

    Raises:
        ChildFailedError: a process did not start.
    """
    tell = on_progress or (lambda _: None)
    flown = []
    for number in range(1, rounds + 1):
        tell(f"{mission.name}: flight {number} of {rounds}")
        flown.append(asyncio.run(_fly(mission, options)))
    return Turnarounds(
        mission.name, len(mission.uavs), options.speedup, options.position_rate_hz, tuple(flown)
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
    if not times:
        return dict.fromkeys(SHARES)
    return {
        name: float(np.quantile(times, share, method="inverted_cdf"))
        for name, share in SHARES.items()
    }


def turnarounds_as_json(machine: MachineInfo, seed: int, done: Turnarounds) -> dict[str, Any]:
    """Everything, ready for `json.dumps`."""
    return {
        "machine": asdict(machine),
        "seed": seed,
        "scenario": done.scenario,
        "uavs": done.uavs,
        "speedup": done.speedup,
        "position_rate_hz": done.position_rate_hz,
        "target_ms": TARGET_MS,
        "target_ratio": TARGET_RATIO,
        **{name: _summary(getter, done.rounds) for name, getter in _KINDS.items()},
        "idled": sum(each.idled for each in done.rounds),
        "rounds": [
            {**flight, **{name: _summary(getter, [each]) for name, getter in _KINDS.items()}}
            for flight, each in zip(_flights(done).as_records(), done.rounds, strict=True)
        ],
    }


_KINDS: dict[str, Callable[[TurnaroundFlight], tuple[float, ...]]] = {
    "sent_ms": lambda each: each.target_ms,
    "in_force_ms": lambda each: each.in_force_ms,
}


def _summary(
    getter: Callable[[TurnaroundFlight], tuple[float, ...]], rounds: Iterable[TurnaroundFlight]
) -> dict[str, float | None]:
    times_ms = [time_ms for each in rounds for time_ms in getter(each)]
    return {"count": len(times_ms), **quantiles_ms(times_ms)}


def turnarounds_as_rich(machine: MachineInfo, seed: int, done: Turnarounds) -> RenderableType:
    """Everything, for people."""
    summaries = {
        "next target sent": _summary(_KINDS["sent_ms"], done.rounds),
        "its mission in force": _summary(_KINDS["in_force_ms"], done.rounds),
    }
    times = ResultTable(
        (
            Column("arrival or end of service until", words=True),
            Column("count"),
            *(Column(share, ".1f", "ms") for share in SHARES),
        ),
        [(until, *found.values()) for until, found in summaries.items() if found["count"]],
    )
    return Group(
        str(machine),
        f"{done.scenario}, {done.uavs} UAVs at {done.speedup:g} times wall speed, "
        f"{done.position_rate_hz:g} position reports a second each; seed {seed}",
        "",
        times,
        f"besides {sum(each.idled for each in done.rounds)} after finding nothing to do at first",
        "",
        _flights(done),
        "",
        f"wanted: p99 of next target sent below {TARGET_MS:g} ms, ratio at most {TARGET_RATIO:g}",
    )


def _flights(done: Turnarounds) -> ResultTable:
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
            for n, each in enumerate(done.rounds, 1)
        ],
    )
