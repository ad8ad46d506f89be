"""What identities, encryption and signatures cost a fleet: flights with and without, in turn.

The same mission is flown with real processes, plain, secure, and secure under a flood, one after
the other, so that all meet the same moods of the machine. Of each flight: processor time and
memory by kind of process, the turnarounds of the agents, and how long it took to take off. Leaves
out: single messages (sim.bench.hop), the hostile agent (sim.bench.flooding), and how it is shown
(sim.bench.secure_report).
"""

from __future__ import annotations

import asyncio
import math
import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any

from coordinator.observer import Observer
from coordinator.view.security import refusals
from sim.bench.flooding import HOSTILE, Poured, flooded
from sim.bench.hop import SPEAKER, measure_hops
from sim.bench.process_costs import Costs, ProcessCosts
from sim.bench.turnaround import listen
from sim.launch.fleet import BusKind, LaunchOptions
from sim.launch.protection import protected
from sim.launch.run import Run, open_run
from swarm.model import Mission
from swarm.wire.messages import EpochPhase

__all__ = ["CostFlight", "SecureBench", "Settings", "Way", "in_turn", "measure_secure"]

_HOP_ROUNDS = 4
"""Routers each way over which claims are sent, in turn."""


class Way(StrEnum):
    """How a mission is flown."""

    PLAIN = "plain"
    SECURE = "secure"
    FLOODED = "flooded"
    """Secure, while a hostile agent with valid keys floods the bus."""


@dataclass(frozen=True, slots=True)
class CostFlight:
    """One flight."""

    way: Way
    start: Costs
    """Until the mission began: interpreters, imports, keys, preparation, take-off."""
    whole: Costs
    """Until it ended."""
    takeoff_wall_s: float
    """From the first process to mission time 0."""
    flight_wall_s: float
    """From there to the end."""
    target_ms: tuple[float, ...]
    """Wall times of agents from an arrival or the end of a service to the next target sent."""
    done: int
    tasks: int
    as_planned: bool
    """Whether every list flown was the one planned."""
    refused: Mapping[str, int]
    poured_hz: float
    """Messages a second of the hostile agent; 0 without one."""
    load: float
    """Processes that wanted to run during the last minute of the flight."""

    @property
    def ok(self) -> bool:
        """Whether every task was done."""
        return self.done == self.tasks

    def flight_cpu_s(self, kind: str) -> float:
        """Processor time of all processes of a kind from the mission's beginning to its end."""
        return self.whole.cpu_s.get(kind, 0.0) - self.start.cpu_s.get(kind, 0.0)


@dataclass(frozen=True, slots=True)
class Settings:
    """How much is measured."""

    rounds: int
    """Flights each way."""
    claims: int
    """Claims through a router each way."""
    flood_hz: float
    """Messages a second of the hostile agent; 0: there are no flooded flights."""


@dataclass(frozen=True, slots=True)
class SecureBench:
    """Everything measured in one run of the benchmark."""

    scenario: str
    uavs: int
    tasks: int
    speedup: float
    bus: str
    seed: int
    flights: tuple[CostFlight, ...]
    """In the order in which they were flown."""
    hops_s: Mapping[Way, tuple[float, ...]]
    """Times of single claims through a router, plain and secure."""

    @property
    def ok(self) -> bool:
        """Whether every task of every flight was done and nothing honest was refused."""
        return all(
            each.ok and (each.way is Way.FLOODED or not each.refused) for each in self.flights
        )

    def of(self, way: Way) -> list[CostFlight]:
        """The flights of one way."""
        return [each for each in self.flights if each.way is way]


_UNDISTURBED = (Way.PLAIN, Way.SECURE)


def in_turn(ways: Sequence[Way], rounds: int) -> list[Way]:
    """Every way so many times; the order is reversed in every other round."""
    return [way for number in range(rounds) for way in ways[:: -1 if number % 2 else 1]]


def measure_secure(
    mission: Mission,
    options: LaunchOptions,
    settings: Settings,
    on_progress: Callable[[str], None] | None = None,
) -> SecureBench:
    """Fly ``mission`` and send claims, plain and secure in turn.

    Args:
        mission: the scenario of ``options``.
        options: how to fly it, without keys; their log format is JSON.
        settings: how often.
        on_progress: told what is being done.

    Raises:
        ChildFailedError: a process did not start.
        InputError: keys cannot be made for the scenario.
    """
    tell = on_progress or (lambda _: None)
    flights: list[CostFlight] = []
    order = in_turn(list(Way) if settings.flood_hz else _UNDISTURBED, settings.rounds)
    for number, way in enumerate(order, 1):
        tell(f"{mission.name}: flight {number} of {len(order)}, {way}")
        flood_hz = settings.flood_hz if way is Way.FLOODED else 0.0
        with _prepared(mission, options, way) as chosen:
            flights.append(asyncio.run(_fly(mission, chosen, way, flood_hz)))
    hops_s: dict[Way, list[float]] = {}
    routed = replace(options, bus=BusKind.ROUTER, routers=1)
    for way in in_turn(_UNDISTURBED, _HOP_ROUNDS) if settings.claims else ():
        tell(f"claims through a router, {way}")
        count = math.ceil(settings.claims / _HOP_ROUNDS)
        with _prepared(mission, routed, way) as chosen:
            hops_s.setdefault(way, []).extend(asyncio.run(measure_hops(mission, chosen, count)))
    return SecureBench(
        scenario=mission.name,
        uavs=len(mission.uavs),
        tasks=len(mission.tasks),
        speedup=options.speedup,
        bus=options.bus,
        seed=options.seed,
        flights=tuple(flights),
        hops_s={way: tuple(times_s) for way, times_s in hops_s.items()},
    )


def _prepared(
    mission: Mission, options: LaunchOptions, way: Way
) -> AbstractContextManager[LaunchOptions]:
    """``options`` with keys where there are to be any."""
    strangers = (SPEAKER, HOSTILE)
    secure = way is not Way.PLAIN
    return protected(mission, options, secure=secure, keys=None, strangers=strangers)


async def _fly(mission: Mission, options: LaunchOptions, way: Way, flood_hz: float) -> CostFlight:
    """Fly ``mission`` once and count what it costs."""
    told: list[dict[str, Any]] = []
    meter = _Meter()
    async with open_run(
        mission,
        options,
        on_frame=meter.look,
        on_log=lambda _name, line: told.extend(listen(line)),
    ) as run:
        meter.run = run
        async with flooded(run, flood_hz) if flood_hz else nullcontext(Poured()) as poured:
            await run.finish()
    flight = run.flight()
    planned = {} if flight.plan is None else flight.plan.routes
    takeoff_s = 0.0 if flight.takeoff_s is None else flight.takeoff_s
    start = meter.costs.costs() if meter.start is None else meter.start
    return CostFlight(
        way=way,
        start=start,
        whole=start if meter.end is None else meter.end,
        takeoff_wall_s=takeoff_s / options.speedup,
        flight_wall_s=flight.result.makespan_s / options.speedup,
        target_ms=tuple(time_ms for each in told for time_ms in each["target_ms"]),
        done=len(flight.result.done),
        tasks=len(mission.tasks),
        as_planned=all(
            tuple(planned.get(uav, ())) == route
            for uav, route in flight.result.executed_routes.items()
        ),
        refused=refusals(flight.dropped),
        poured_hz=poured.rate_hz,
        load=os.getloadavg()[0],
    )


class _Meter:
    """Looks at the processes with every frame of a run."""

    def __init__(self) -> None:
        self.run: Run | None = None
        self.costs = ProcessCosts(os.getpid())
        self.start: Costs | None = None
        self.end: Costs | None = None

    def look(self, observer: Observer, now_s: float) -> None:
        if self.run is None or self.end is not None:
            return
        self.costs.look(self.run.launch)
        if self.start is None and observer.mission_s(now_s) is not None:
            self.start = self.costs.costs()
        if observer.phase is EpochPhase.ENDED:
            self.end = self.costs.costs()
