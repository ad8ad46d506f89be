"""How the results of `swarm bench secure` and `swarm bench flood` are shown."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from rich.console import Group, RenderableType

from sim.bench.machine import MachineInfo
from sim.bench.security import CostFlight, SecureBench, SecurityMode
from sim.bench.turnaround import SHARES, TARGET_MS, quantiles_ms
from sim.fleet.faults.flood import Flood
from sim.fleet.faults.forgery import REASONS
from swarm.runtime.table import Column, ResultTable

__all__ = ["flood_as_json", "flood_as_rich", "secure_as_json", "secure_as_rich"]


FLOOD_MS = 100.0
"""What 99 of 100 turnarounds of the others shall not exceed while somebody floods."""

_UNDISTURBED = (SecurityMode.PLAIN, SecurityMode.SECURE)


def secure_as_json(machine: MachineInfo, done: SecureBench) -> dict[str, Any]:
    """Everything, ready for `json.dumps`."""
    return {
        "machine": asdict(machine),
        "seed": done.seed,
        "scenario": done.scenario,
        "uavs": done.uavs,
        "tasks": done.tasks,
        "speedup": done.speedup,
        "bus": done.bus,
        "ok": done.ok,
        "target_ms": TARGET_MS,
        "flood_ms": FLOOD_MS,
        **{way: _way_as_json(done, way) for way in SecurityMode},
        "flights": [_flight_as_json(done, each) for each in done.flights],
    }


def _way_as_json(done: SecureBench, way: SecurityMode) -> dict[str, Any]:
    flights = done.of(way)
    return {
        "flight_cpu_s": {
            kind: _mean(f.flight_cpu_s(kind) for f in flights) for kind in _kinds(done)
        },
        "start_cpu_s": {
            kind: _mean(f.start.cpu_s.get(kind, 0.0) for f in flights) for kind in _kinds(done)
        },
        "memory_bytes": {
            kind: _mean(f.whole.memory_bytes.get(kind, 0.0) for f in flights)
            for kind in _kinds(done)
        },
        "takeoff_wall_s": _mean(f.takeoff_wall_s for f in flights),
        "turnaround_ms": {
            "count": sum(len(f.target_ms) for f in flights),
            **_target_ms(done, way),
        },
        "hop_ms": {"count": len(done.hops_s.get(way, ())), **_hop_ms(done, way)},
        "poured_hz": _mean(f.poured_hz for f in flights),
    }


def _flight_as_json(done: SecureBench, flight: CostFlight) -> dict[str, Any]:
    return {
        "way": flight.way,
        "done": flight.done,
        "tasks": flight.tasks,
        "as_planned": flight.as_planned,
        "refused": dict(flight.refused),
        "load": flight.load,
        "takeoff_wall_s": flight.takeoff_wall_s,
        "flight_wall_s": flight.flight_wall_s,
        "flight_cpu_s": {kind: flight.flight_cpu_s(kind) for kind in _kinds(done)},
        "turnaround_ms": quantiles_ms(flight.target_ms),
    }


def secure_as_rich(machine: MachineInfo, done: SecureBench) -> RenderableType:
    """Everything, for people."""
    n_flight = len(done.of(SecurityMode.SECURE))
    head = (
        f"{done.scenario}, {done.uavs} UAVs × {done.tasks} tasks at {done.speedup:g} times wall "
        f"speed, bus {done.bus}; {n_flight} flight{'s' if n_flight > 1 else ''} each way, in turn; "
        f"seed {done.seed}"
    )
    parts: list[RenderableType] = [str(machine), head]
    if done.flights:
        parts += ["", _costs(done), "", _turnarounds(done), "", _flights(done)]
    if done.hops_s:
        parts += ["", _hops(done)]
    return Group(*parts, "", *_verdict(done))


Getter = Callable[[CostFlight, str], float]

_COSTS: tuple[tuple[str, Getter, str, str, float], ...] = (
    ("in flight", lambda flight, kind: flight.flight_cpu_s(kind), ".2f", "s", 1.0),
    ("before", lambda flight, kind: flight.start.cpu_s.get(kind, 0.0), ".2f", "s", 1.0),
    (
        "memory each",
        lambda flight, kind: flight.whole.memory_bytes.get(kind, 0.0),
        *(".1f", "MB", 1e-6),
    ),
)
"""What is told of each kind of process: name, value, and how it is shown."""


def _costs(done: SecureBench) -> ResultTable:
    """Processor time and memory, plain beside secure."""
    costs = [
        Column(f"{name}, {way}", form, unit, scale, none="")
        for name, _, form, unit, scale in _COSTS
        for way in _UNDISTURBED
    ]
    rows: list[list[object]] = [
        [
            kind,
            max(each.whole.processes.get(kind, 0) for each in done.flights),
            *(
                _mean(getter(flight, kind) for flight in done.of(way))
                for _, getter, *_ in _COSTS
                for way in _UNDISTURBED
            ),
        ]
        for kind in _kinds(done)
    ]
    totals = [_total_s(done.of(way)) for way in _UNDISTURBED]
    rows.append(["all", None, *totals, *[None] * (len(costs) - len(totals))])
    return ResultTable((Column("process", words=True), Column("number", none=""), *costs), rows)


def _turnarounds(done: SecureBench) -> ResultTable:
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
                sum(len(each.target_ms) for each in flights),
                *_target_ms(done, way).values(),
                _mean(each.takeoff_wall_s for each in flights),
            )
            for way in SecurityMode
            if (flights := done.of(way))
        ],
    )


def _hops(done: SecureBench) -> ResultTable:
    return ResultTable(
        (Column("through a router", words=True), Column("claims"), *_quantile_columns()),
        [
            (way, len(done.hops_s.get(way, ())), *_hop_ms(done, way).values())
            for way in _UNDISTURBED
        ],
    )


def _quantile_columns() -> list[Column]:
    return [Column(share, ".1f", "ms") for share in SHARES]


def _flights(done: SecureBench) -> ResultTable:
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
                sum(each.flight_cpu_s(kind) for kind in _kinds(done)),
                quantiles_ms(each.target_ms)["p99"],
                sum(each.refused.values()),
                each.load,
            )
            for number, each in enumerate(done.flights, 1)
        ],
    )


def _verdict(done: SecureBench) -> list[str]:
    """What it comes to, beside what is wanted."""
    lines = []
    plain_s, secure_s = (_total_s(done.of(way)) for way in _UNDISTURBED)
    if plain_s > 0.0:
        lines.append(f"processor time in flight: {secure_s / plain_s:.3f} times that of plain")
    for way, limit_ms in ((SecurityMode.SECURE, TARGET_MS), (SecurityMode.FLOODED, FLOOD_MS)):
        p99_ms = _target_ms(done, way)["p99"]
        if p99_ms is not None:
            held = "held" if p99_ms < limit_ms else "NOT held"
            lines.append(f"wanted: p99 of next target sent below {limit_ms:g} ms, {way}: {held}")
    if flooded := done.of(SecurityMode.FLOODED):
        rate_hz = _mean(each.poured_hz for each in flooded)
        refused = sum(sum(each.refused.values()) for each in flooded)
        lines.append(
            f"flooded with {rate_hz:.0f} messages a second; {refused} refused behind the router"
        )
    if done.flights:
        lines.append("every task was done, and nothing honest was refused" if done.ok else "FAILED")
    return lines


def _kinds(done: SecureBench) -> list[str]:
    """Kinds of processes, those that cost most in flight first."""
    names = {kind for each in done.flights for kind in each.whole.cpu_s}
    return sorted(names, key=lambda kind: -sum(f.flight_cpu_s(kind) for f in done.flights))


def _target_ms(done: SecureBench, way: SecurityMode) -> dict[str, float | None]:
    """Turnarounds of all flights of one way."""
    return quantiles_ms(time for each in done.of(way) for time in each.target_ms)


def _hop_ms(done: SecureBench, way: SecurityMode) -> dict[str, float | None]:
    """Times of claims through the router."""
    return quantiles_ms(1e3 * time_s for time_s in done.hops_s.get(way, ()))


def _total_s(flights: Sequence[CostFlight]) -> float:
    """Processor time in flight of all processes, on average over flights."""
    return _mean(sum(each.flight_cpu_s(kind) for kind in each.whole.cpu_s) for each in flights)


def _mean(values: Iterable[float]) -> float:
    listed = list(values)
    return float(np.mean(listed)) if listed else 0.0


def flood_as_json(machine: MachineInfo, seed: int, done: Flood) -> dict[str, Any]:
    """Everything, ready for `json.dumps`."""
    return {
        "machine": asdict(machine),
        "seed": seed,
        "ok": done.ok,
        "flood_s": done.flood_s,
        "sent": dict(done.sent),
        "expected": dict(done.expected),
        "answers": done.answers,
        "counted": {uav: dict(counts) for uav, counts in done.counted.items()},
        "planned_routes": {uav: list(route) for uav, route in done.planned.items()},
        "executed_routes": {uav: list(r) for uav, r in done.result.executed_routes.items()},
        "decisions_kept": done.decisions_kept,
        "done": list(done.result.done),
        "processes": list(done.fates),
    }


def flood_as_rich(machine: MachineInfo, seed: int, done: Flood) -> RenderableType:
    """Everything, for people."""
    sent = ResultTable(
        (Column("kind", words=True), Column("sent"), Column("counted as", words=True)),
        [(kind, count, REASONS[kind]) for kind, count in done.sent.items()],
    )
    counted = ResultTable(
        (Column("dropped as", words=True), Column("sent"), *map(Column, done.counted)),
        [
            (reason, expected, *(counts.get(reason, 0) for counts in done.counted.values()))
            for reason, expected in done.expected.items()
        ],
    )
    lists = "every list flown as planned" if done.decisions_kept else "lists flown DIFFER"
    fates = "; ".join(done.fates) or "every process lived"
    return Group(
        str(machine),
        f"seed {seed}; flooded for {done.flood_s:.1f} s; {done.answers} malformed answers",
        f"{lists}; {len(done.result.done)} tasks done; {fates}",
        "",
        sent,
        "",
        counted,
        "",
        "nothing has changed and everything was counted" if done.ok else "FAILED",
    )
