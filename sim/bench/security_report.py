"""How the results of `swarm bench secure` and `swarm bench flood` are shown."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from rich.console import Group, RenderableType
from rich.table import Table

from sim.bench.machine import MachineInfo
from sim.bench.security import CostFlight, SecureBench, SecurityMode
from sim.bench.turnaround import TARGET_MS, quantiles_ms
from sim.fleet.faults.flood import Flood
from sim.fleet.faults.forgery import REASONS

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
        parts += ["", _costs(done), "", _times(done), "", _flights(done)]
    if done.hops_s:
        parts += ["", _hops(done)]
    return Group(*parts, "", *_verdict(done))


Getter = Callable[[CostFlight, str], float]

_COSTS: tuple[tuple[str, Getter, str, int], ...] = (
    ("in flight", lambda flight, kind: flight.flight_cpu_s(kind), "s", 2),
    ("before", lambda flight, kind: flight.start.cpu_s.get(kind, 0.0), "s", 2),
    ("memory each", lambda flight, kind: flight.whole.memory_bytes.get(kind, 0.0) / 1e6, "MB", 1),
)
"""What is told of each kind of process: heading, value, unit and digits."""


def _costs(done: SecureBench) -> Table:
    """Processor time and memory, plain beside secure."""
    headings = [f"{name}, {way}" for name, *_ in _COSTS for way in _UNDISTURBED]
    table = _table("process", "number", *headings)
    for kind in _kinds(done):
        number = max(each.whole.processes.get(kind, 0) for each in done.flights)
        cells = [
            f"{_mean(getter(flight, kind) for flight in done.of(way)):.{digits}f} {unit}"
            for _, getter, unit, digits in _COSTS
            for way in _UNDISTURBED
        ]
        table.add_row(kind, str(number), *cells)
    totals = [f"{_total_s(done.of(way)):.2f} s" for way in _UNDISTURBED]
    table.add_row("all", "", *totals)
    return table


def _times(done: SecureBench) -> Table:
    """Turnarounds and the time to take off, plain beside secure."""
    table = _table("next target sent", "arrivals", "p50", "p90", "p99", "max", "take-off after")
    for way in SecurityMode:
        flights = done.of(way)
        if not flights:
            continue
        count = sum(len(each.target_ms) for each in flights)
        takeoff_s = _mean(each.takeoff_wall_s for each in flights)
        cells = [_ms(time_ms) for time_ms in _target_ms(done, way).values()]
        table.add_row(way, str(count), *cells, f"{takeoff_s:.1f} s")
    return table


def _hops(done: SecureBench) -> Table:
    table = _table("through a router", "claims", "p50", "p90", "p99", "max")
    for way in _UNDISTURBED:
        count = str(len(done.hops_s.get(way, ())))
        cells = [_ms(time_ms) for time_ms in _hop_ms(done, way).values()]
        table.add_row(way, count, *cells)
    return table


def _flights(done: SecureBench) -> Table:
    table = _table("flight", "", "tasks done", "lists", "in flight", "p99", "refused", "load")
    for number, each in enumerate(done.flights, 1):
        table.add_row(
            str(number),
            each.way,
            f"{each.done} of {each.tasks}",
            "as planned" if each.as_planned else "differ",
            f"{sum(each.flight_cpu_s(kind) for kind in _kinds(done)):.2f} s",
            _ms(quantiles_ms(each.target_ms)["p99"]),
            str(sum(each.refused.values())),
            f"{each.load:.1f}",
        )
    return table


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


def _ms(time_ms: float | None) -> str:
    return "-" if time_ms is None else f"{time_ms:.1f} ms"


def _table(*names: str) -> Table:
    table = Table(box=None, pad_edge=False, header_style="dim")
    for number, name in enumerate(names):
        table.add_column(name, justify="right" if number else "left", no_wrap=not number)
    return table


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
    sent = _flood_table("kind", "sent", "counted as")
    for kind, count in done.sent.items():
        sent.add_row(kind, str(count), REASONS[kind])
    counted = _flood_table("dropped as", "sent", *done.counted)
    for reason, expected in done.expected.items():
        counts = [str(count.get(reason, 0)) for count in done.counted.values()]
        counted.add_row(reason, str(expected), *counts)
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


def _flood_table(*names: str) -> Table:
    table = Table(box=None, pad_edge=False, header_style="dim")
    for name in names:
        table.add_column(name, justify="left" if name in (names[0], "counted as") else "right")
    return table
