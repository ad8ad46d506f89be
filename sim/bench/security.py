"""What identities, encryption and signatures cost a fleet, and what malformed messages do to it.

The same mission is flown plain, secure, and secure while a hostile agent with valid keys floods
the bus, in turn, so that all meet the same moods of the machine.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from rich.console import RenderableType

from sim.bench.latency import measure_hops
from sim.bench.machine import this_machine
from sim.bench.results import BenchResult, Progress, unheard
from sim.bench.security_flights import CostFlight, SecurityMode, fly_metered, prepared
from sim.bench.turnaround import SHARES, TARGET_MS, quantiles_ms
from sim.fleet.faults.flood import Flood
from sim.fleet.faults.forgery import REASONS
from sim.fleet.layout import BusKind, LaunchOptions
from swarm.model import Mission
from swarm.runtime.table import Column, ResultTable

FLOOD_MS = 100.0
"""What 99 of 100 turnarounds of the others shall not exceed while somebody floods."""
_HOP_ROUNDS = 4
"""Routers each way over which claims are sent, in turn."""
_UNDISTURBED = (SecurityMode.PLAIN, SecurityMode.SECURE)
_COSTS = (
    ("in flight", ".2f", "s", 1.0),
    ("before", ".2f", "s", 1.0),
    ("memory each", ".1f", "MB", 1e-6),
)
"""What is told of each kind of process: name, form, unit and scale."""


@dataclass(frozen=True, slots=True)
class SecureSettings:
    """How much is measured."""

    rounds: int
    """Flights each way."""
    claims: int
    """Claims through a router each way."""
    flood_hz: float
    """Messages a second of the hostile agent; 0: there are no flooded flights."""


@dataclass(frozen=True, slots=True)
class _WayCosts:
    """What the flights of one way cost on average, by kind of process."""

    flight_cpu_s: dict[str, float]
    start_cpu_s: dict[str, float]
    memory_bytes: dict[str, float]


@dataclass(frozen=True, slots=True)
class SecureBench(BenchResult):
    """Everything measured in one run of the benchmark."""

    scenario: str
    uavs: int
    tasks: int
    speedup: float
    bus: str
    seed: int
    flights: tuple[CostFlight, ...]
    """In the order in which they were flown."""
    hops_s: Mapping[SecurityMode, tuple[float, ...]]
    """Times of single claims through a router, plain and secure."""

    @property
    def ok(self) -> bool:
        """Whether every task of every flight was done and nothing honest was refused."""
        return all(
            each.ok and (each.way is SecurityMode.FLOODED or not each.refused)
            for each in self.flights
        )

    @property
    def kinds(self) -> list[str]:
        """Kinds of processes, those that cost most in flight first."""
        names = {kind for each in self.flights for kind in each.whole.cpu_s}
        return sorted(names, key=lambda kind: -sum(f.flight_cpu_s(kind) for f in self.flights))

    def of(self, way: SecurityMode) -> list[CostFlight]:
        """The flights of one way."""
        return [each for each in self.flights if each.way is way]

    def as_json(self) -> dict[str, Any]:
        """Everything, ready for `json.dumps`."""
        return {
            "machine": asdict(self.machine),
            "seed": self.seed,
            "scenario": self.scenario,
            "uavs": self.uavs,
            "tasks": self.tasks,
            "speedup": self.speedup,
            "bus": self.bus,
            "ok": self.ok,
            "target_ms": TARGET_MS,
            "flood_ms": FLOOD_MS,
            **{way: self._way_as_json(way) for way in SecurityMode},
            "flights": [self._flight_as_json(each) for each in self.flights],
        }

    def parts(self) -> Iterable[RenderableType]:
        """See `BenchResult`."""
        n_flight = len(self.of(SecurityMode.SECURE))
        yield (
            f"{self.scenario}, {self.uavs} UAVs × {self.tasks} tasks at {self.speedup:g} times "
            f"wall speed, bus {self.bus}; {n_flight} flight{'s' if n_flight > 1 else ''} each way, "
            f"in turn; seed {self.seed}"
        )
        if self.flights:
            yield from ("", self._costs(), "", self._turnarounds(), "", self._flown())
        if self.hops_s:
            yield from ("", self._hops())
        yield ""
        yield from self._verdict()

    def _way_as_json(self, way: SecurityMode) -> dict[str, Any]:
        flights = self.of(way)
        times_ms, hops_ms = self._target_ms(way), self._hops_ms(way)
        return {
            **asdict(self._costs_of(way)),
            "takeoff_wall_s": _mean(f.takeoff_wall_s for f in flights),
            "turnaround_ms": {"count": len(times_ms), **quantiles_ms(times_ms)},
            "hop_ms": {"count": len(hops_ms), **quantiles_ms(hops_ms)},
            "poured_hz": _mean(f.poured_hz for f in flights),
        }

    def _flight_as_json(self, flight: CostFlight) -> dict[str, Any]:
        return {
            "way": flight.way,
            "done": flight.done,
            "tasks": flight.tasks,
            "as_planned": flight.as_planned,
            "refused": dict(flight.refused),
            "load": flight.load,
            "takeoff_wall_s": flight.takeoff_wall_s,
            "flight_wall_s": flight.flight_wall_s,
            "flight_cpu_s": {kind: flight.flight_cpu_s(kind) for kind in self.kinds},
            "turnaround_ms": quantiles_ms(flight.target_ms),
        }

    def _costs_of(self, way: SecurityMode) -> _WayCosts:
        flights, kinds = self.of(way), self.kinds
        return _WayCosts(
            {k: _mean(f.flight_cpu_s(k) for f in flights) for k in kinds},
            {k: _mean(f.start.cpu_s.get(k, 0.0) for f in flights) for k in kinds},
            {k: _mean(f.whole.memory_bytes.get(k, 0.0) for f in flights) for k in kinds},
        )

    def _costs(self) -> ResultTable:
        """Processor time and memory, plain beside secure."""
        columns = [
            Column(f"{name}, {way}", form, unit, scale, none="")
            for name, form, unit, scale in _COSTS
            for way in _UNDISTURBED
        ]
        by_way = [self._costs_of(way) for way in _UNDISTURBED]
        rows: list[list[object]] = [
            [
                kind,
                max(each.whole.processes.get(kind, 0) for each in self.flights),
                *(costs.flight_cpu_s[kind] for costs in by_way),
                *(costs.start_cpu_s[kind] for costs in by_way),
                *(costs.memory_bytes[kind] for costs in by_way),
            ]
            for kind in self.kinds
        ]
        totals = [_total_s(self.of(way)) for way in _UNDISTURBED]
        rows.append(["all", None, *totals, *[None] * (len(columns) - len(totals))])
        return ResultTable(
            (Column("process", words=True), Column("number", none=""), *columns), rows
        )

    def _turnarounds(self) -> ResultTable:
        """Turnarounds and the time to take off, plain beside secure."""
        return ResultTable(
            (
                Column("next target sent", words=True),
                Column("arrivals"),
                *_quantile_columns(),
                Column("take-off after", ".1f", "s"),
            ),
            [
                (
                    way,
                    len(times_ms := self._target_ms(way)),
                    *quantiles_ms(times_ms).values(),
                    _mean(each.takeoff_wall_s for each in flights),
                )
                for way in SecurityMode
                if (flights := self.of(way))
            ],
        )

    def _hops(self) -> ResultTable:
        return ResultTable(
            (Column("through a router", words=True), Column("claims"), *_quantile_columns()),
            [
                (way, len(hops_ms := self._hops_ms(way)), *quantiles_ms(hops_ms).values())
                for way in _UNDISTURBED
            ],
        )

    def _flown(self) -> ResultTable:
        return ResultTable(
            (
                Column("flight"),
                Column("", words=True),
                Column("tasks done"),
                Column("lists", words=True),
                Column("in flight", ".2f", "s"),
                Column("p99", ".1f", "ms"),
                Column("refused"),
                Column("load", ".1f"),
            ),
            [
                (
                    number,
                    each.way,
                    f"{each.done} of {each.tasks}",
                    "as planned" if each.as_planned else "differ",
                    _total_s([each]),
                    quantiles_ms(each.target_ms)["p99"],
                    sum(each.refused.values()),
                    each.load,
                )
                for number, each in enumerate(self.flights, 1)
            ],
        )

    def _verdict(self) -> Iterable[str]:
        """What it comes to, beside what is wanted."""
        plain_s, secure_s = (_total_s(self.of(way)) for way in _UNDISTURBED)
        if plain_s > 0.0:
            yield f"processor time in flight: {secure_s / plain_s:.3f} times that of plain"
        for way, limit_ms in ((SecurityMode.SECURE, TARGET_MS), (SecurityMode.FLOODED, FLOOD_MS)):
            p99_ms = quantiles_ms(self._target_ms(way))["p99"]
            if p99_ms is not None:
                held = "held" if p99_ms < limit_ms else "NOT held"
                yield f"wanted: p99 of next target sent below {limit_ms:g} ms, {way}: {held}"
        if flooded := self.of(SecurityMode.FLOODED):
            rate_hz = _mean(each.poured_hz for each in flooded)
            refused = sum(sum(each.refused.values()) for each in flooded)
            yield (
                f"flooded with {rate_hz:.0f} messages a second; {refused} refused behind the router"
            )
        if self.flights:
            yield "every task was done, and nothing honest was refused" if self.ok else "FAILED"

    def _target_ms(self, way: SecurityMode) -> list[float]:
        """Turnarounds of all flights of one way."""
        return [time for each in self.of(way) for time in each.target_ms]

    def _hops_ms(self, way: SecurityMode) -> list[float]:
        """Times of claims through the router."""
        return [1e3 * time_s for time_s in self.hops_s.get(way, ())]


def in_turn(ways: Sequence[SecurityMode], rounds: int) -> list[SecurityMode]:
    """Every way so many times; the order is reversed in every other round."""
    return [way for number in range(rounds) for way in ways[:: -1 if number % 2 else 1]]


def measure_secure(
    mission: Mission, options: LaunchOptions, settings: SecureSettings, tell: Progress = unheard
) -> SecureBench:
    """Fly ``mission`` and send claims, plain and secure in turn.

    ``options`` are without keys, and their log format is JSON.

    Raises:
        ChildFailedError: a process did not start.
        InputError: keys cannot be made for the scenario.
    """
    machine, flights = this_machine(), list[CostFlight]()
    order = in_turn(list(SecurityMode) if settings.flood_hz else _UNDISTURBED, settings.rounds)
    for number, way in enumerate(order, 1):
        tell(f"{mission.name}: flight {number} of {len(order)}, {way}")
        flood_hz = settings.flood_hz if way is SecurityMode.FLOODED else 0.0
        with prepared(mission, options, way) as chosen:
            flights.append(asyncio.run(fly_metered(mission, chosen, way, flood_hz)))
    hops_s: dict[SecurityMode, tuple[float, ...]] = {}
    routed = replace(options, bus=BusKind.ROUTER, routers=1)
    for way in in_turn(_UNDISTURBED, _HOP_ROUNDS) if settings.claims else ():
        tell(f"claims through a router, {way}")
        count = math.ceil(settings.claims / _HOP_ROUNDS)
        with prepared(mission, routed, way) as chosen:
            timed_s = asyncio.run(measure_hops(mission, chosen, count))
            hops_s[way] = (*hops_s.get(way, ()), *timed_s)
    return SecureBench(
        machine=machine,
        scenario=mission.name,
        uavs=len(mission.uavs),
        tasks=len(mission.tasks),
        speedup=options.speedup,
        bus=options.bus,
        seed=options.seed,
        flights=tuple(flights),
        hops_s=hops_s,
    )


def _quantile_columns() -> list[Column]:
    return [Column(share, ".1f", "ms") for share in SHARES]


def _total_s(flights: Sequence[CostFlight]) -> float:
    """Processor time in flight of all processes, on average over flights."""
    return _mean(sum(each.flight_cpu_s(kind) for kind in each.whole.cpu_s) for each in flights)


def _mean(values: Iterable[float]) -> float:
    listed = list(values)
    return float(np.mean(listed)) if listed else 0.0


@dataclass(frozen=True, slots=True)
class FloodBench(BenchResult):
    """A flight beside a hostile peer that says malformed things."""

    seed: int
    flood: Flood

    def as_json(self) -> dict[str, Any]:
        """Everything, ready for `json.dumps`."""
        done = self.flood
        return {
            "machine": asdict(self.machine),
            "seed": self.seed,
            "ok": done.ok,
            "flood_s": done.flood_s,
            "sent": dict(done.sent),
            "expected": dict(done.expected),
            "answers": done.answers,
            "counted": {uav: dict(counts) for uav, counts in done.counted.items()},
            "planned_routes": dict(done.planned),
            "executed_routes": dict(done.result.executed_routes),
            "decisions_kept": done.decisions_kept,
            "done": done.result.done,
            "processes": done.fates,
        }

    def parts(self) -> Iterable[RenderableType]:
        """See `BenchResult`."""
        done = self.flood
        yield (
            f"seed {self.seed}; flooded for {done.flood_s:.1f} s; {done.answers} malformed answers"
        )
        lists = "every list flown as planned" if done.decisions_kept else "lists flown DIFFER"
        fates = "; ".join(done.fates) or "every process lived"
        yield f"{lists}; {len(done.result.done)} tasks done; {fates}"
        yield ""
        yield ResultTable(
            (Column("kind", words=True), Column("sent"), Column("counted as", words=True)),
            [(kind, count, REASONS[kind]) for kind, count in done.sent.items()],
        )
        yield ""
        yield ResultTable(
            (Column("dropped as", words=True), Column("sent"), *map(Column, done.counted)),
            [
                (reason, expected, *(counts.get(reason, 0) for counts in done.counted.values()))
                for reason, expected in done.expected.items()
            ],
        )
        yield ""
        yield "nothing has changed and everything was counted" if done.ok else "FAILED"
