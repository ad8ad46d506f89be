"""How the result of `swarm bench flood` is shown.

Leaves out: flying (sim.chaos.flood).
"""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from rich.console import Group, RenderableType
from rich.table import Table

from sim.bench.machine import Machine
from sim.chaos.flood import Flood
from sim.chaos.hostile import REASONS

__all__ = ["flood_as_json", "flood_as_rich"]


def flood_as_json(machine: Machine, seed: int, done: Flood) -> dict[str, Any]:
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


def flood_as_rich(machine: Machine, seed: int, done: Flood) -> RenderableType:
    """Everything, for people."""
    sent = _table("kind", "sent", "counted as")
    for kind, count in done.sent.items():
        sent.add_row(kind, str(count), REASONS[kind])
    counted = _table("dropped as", "sent", *done.counted)
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


def _table(*names: str) -> Table:
    table = Table(box=None, pad_edge=False, header_style="dim")
    for name in names:
        table.add_column(name, justify="left" if name in (names[0], "counted as") else "right")
    return table
