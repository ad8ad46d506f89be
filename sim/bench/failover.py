"""`swarm bench failover`: everything measured about fleets in trouble, and its tables.

Leaves out: how each is measured (sim.bench.takeover, sim.bench.links, sim.bench.latency).
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any

from rich.console import Group, RenderableType
from rich.table import Table

from sim.bench.latency import DecisionLatencies, measure_latencies
from sim.bench.links import (
    BAD_LINKS,
    BadLink,
    FalseLosses,
    PartitionResult,
    Traffic,
    measure_false_losses,
    measure_partition,
    measure_traffic,
)
from sim.bench.machine import MachineInfo, this_machine
from sim.bench.takeover import FailureMode, Takeovers, measure_takeovers
from sim.fleet.layout import BusKind
from swarm.protocol.timing import LinkKind, preset

__all__ = [
    "FailoverMeasure",
    "FailoverResults",
    "FailoverSettings",
    "failover_as_json",
    "failover_as_rich",
    "measure_failover",
]


KILL_TARGET_S = 1.0


class FailoverMeasure(StrEnum):
    """What can be measured."""

    KILL = "kill"
    HANG = "hang"
    CUT = "cut"
    DEADLOCK = "deadlock"
    LOSS = "loss"
    PARTITION = "partition"
    TRAFFIC = "traffic"
    LATENCY = "latency"


@dataclass(frozen=True, slots=True)
class FailoverSettings:
    """How much is measured, and on what."""

    trials: int = 100
    """Blows of each kind."""
    link: LinkKind = LinkKind.NORMAL
    """Preset of the fleets that are struck."""
    bus: BusKind = BusKind.ROUTER
    """How the processes of those reach each other."""
    watch_s: float = 120.0
    """How long bad links are watched."""
    relay: bool = False
    """Imitate losses, even where packets can be lost."""
    parted_s: float = 30.0
    partitions: int = 3
    sizes: tuple[int, ...] = (3, 10, 30, 100)
    """Fleets whose traffic is counted."""
    traffic_s: float = 20.0
    methods: tuple[str, ...] = ("greedy", "guided")
    """Decision rules that are timed."""
    seed: int = 0


@dataclass(frozen=True, slots=True)
class FailoverResults:
    """All that was measured."""

    machine: MachineInfo
    settings: FailoverSettings
    takeovers: tuple[Takeovers, ...]
    losses: tuple[FalseLosses, ...]
    partitions: tuple[PartitionResult, ...]
    traffic: tuple[Traffic, ...]
    latencies: tuple[DecisionLatencies, ...]


def measure_failover(
    what: Sequence[FailoverMeasure],
    settings: FailoverSettings,
    on_progress: Callable[[str], None] | None = None,
) -> FailoverResults:
    """Measure ``what``, one after the other.

    Raises:
        SwarmError: a process did not start.
        TimeoutError: a fleet did not do in time what it has to do.
    """
    tell = on_progress or (lambda _: None)
    machine = this_machine()
    return FailoverResults(
        machine,
        settings,
        tuple(
            _struck(blow, settings, tell) for blow in FailureMode if FailoverMeasure(blow) in what
        ),
        tuple(_on_bad_link(b, settings, tell) for b in BAD_LINKS if FailoverMeasure.LOSS in what),
        tuple(_parted(settings, tell)) if FailoverMeasure.PARTITION in what else (),
        tuple(_said(settings, tell)) if FailoverMeasure.TRAFFIC in what else (),
        tuple(_decided(settings, tell)) if FailoverMeasure.LATENCY in what else (),
    )


def _struck(
    blow: FailureMode, settings: FailoverSettings, tell: Callable[[str], None]
) -> Takeovers:
    return asyncio.run(
        measure_takeovers(
            blow,
            settings.trials,
            link=settings.link,
            bus=settings.bus,
            seed=settings.seed,
            on_progress=tell,
        )
    )


def _on_bad_link(
    bad: BadLink, settings: FailoverSettings, tell: Callable[[str], None]
) -> FalseLosses:
    tell(f"loss: {bad.quality.loss_frac:.0%}, {1e3 * bad.quality.delay_s:.0f} ms")
    return measure_false_losses(bad, settings.watch_s, seed=settings.seed, relay=settings.relay)


def _parted(settings: FailoverSettings, tell: Callable[[str], None]) -> Iterator[PartitionResult]:
    for number in range(settings.partitions):
        tell(f"partition: {number} of {settings.partitions}")
        seed = settings.seed + number
        yield asyncio.run(measure_partition(settings.parted_s, seed=seed, on_progress=tell))


def _said(settings: FailoverSettings, tell: Callable[[str], None]) -> Iterator[Traffic]:
    for size in settings.sizes:
        tell(f"traffic: {size} UAVs")
        yield asyncio.run(measure_traffic(size, settings.traffic_s, seed=settings.seed))


def _decided(
    settings: FailoverSettings, tell: Callable[[str], None]
) -> Iterator[DecisionLatencies]:
    for method in settings.methods:
        yield asyncio.run(measure_latencies(method, seed=settings.seed, on_progress=tell))


def bound_s(blow: FailureMode, link: LinkKind) -> float:
    """Within which time another is to hold the task."""
    if blow is FailureMode.KILL:
        return KILL_TARGET_S
    chosen = preset(link)
    return chosen.lease_s + chosen.timing.silence_s


# -- for programs -------------------------------------------------------------------------


def failover_as_json(done: FailoverResults) -> dict[str, Any]:
    """Everything, ready for `json.dumps`."""
    return {
        "machine": asdict(done.machine),
        "seed": done.settings.seed,
        "takeovers": [
            {
                "blow": each.blow,
                "link": each.link,
                "bus": each.bus,
                "trials": len(each.times_s) + each.missed,
                "missed": each.missed,
                "p50_s": each.quantile_s(0.5),
                "p99_s": each.quantile_s(0.99),
                "max_s": each.quantile_s(1.0),
                "bound_s": bound_s(each.blow, each.link),
                "times_s": list(each.times_s),
            }
            for each in done.takeovers
        ],
        "losses": [
            {
                "loss_frac": each.bad.quality.loss_frac,
                "delay_s": each.bad.quality.delay_s,
                "link": each.bad.link,
                "uavs": each.uavs,
                "watched_s": each.watched_s,
                "path": each.path,
                "false_losses": each.losses,
                "packets": each.packets,
                "packets_lost": each.dropped,
            }
            for each in done.losses
        ],
        "partitions": [{**asdict(each), "faults": list(each.faults)} for each in done.partitions],
        "traffic": [
            {
                **asdict(each),
                "messages_per_uav_s": each.messages_per_uav_s,
                "bytes_per_uav_s": each.bytes_per_uav_s,
                "received_bytes_per_uav_s": each.received_bytes_per_uav_s,
            }
            for each in done.traffic
        ],
        "latencies": [
            {
                "method": each.method,
                "uavs": each.uavs,
                "tasks": each.tasks,
                "decisions": len(each.times_s),
                "p50_s": each.quantile_s(0.5),
                "p99_s": each.quantile_s(0.99),
                "max_s": each.quantile_s(1.0),
            }
            for each in done.latencies
        ],
    }


# -- for people ---------------------------------------------------------------------------


def failover_as_rich(done: FailoverResults) -> RenderableType:
    """Everything, in the width of a terminal of 80 columns."""
    parts: list[RenderableType] = [str(done.machine), f"seed {done.settings.seed}"]
    if done.takeovers:
        parts += ["", _takeovers(done.takeovers)]
    if done.losses:
        parts += ["", _losses(done.losses)]
    if done.partitions:
        parts += ["", _partitions(done.partitions)]
    if done.traffic:
        parts += ["", _traffic(done.traffic)]
    if done.latencies:
        parts += ["", _latencies(done.latencies)]
    return Group(*parts)


def _takeovers(rows: Sequence[Takeovers]) -> Table:
    table = _table(
        "From a blow to another's held claim [s]",
        ["blow", "link", "bus"],
        ["trials", "missed", "p50", "p99", "max", "bound"],
    )
    for each in rows:
        table.add_row(
            each.blow,
            each.link,
            each.bus,
            str(len(each.times_s) + each.missed),
            str(each.missed),
            *(_shown(each.quantile_s(share), 1.0) for share in (0.5, 0.99, 1.0)),
            f"{bound_s(each.blow, each.link):.2f}",
        )
    return table


def _losses(rows: Sequence[FalseLosses]) -> Table:
    table = _table(
        "Living processes taken for lost",
        ["loss, delay", "link", "path"],
        ["UAVs", "watched [s]", "packets", "lost", "false losses"],
    )
    for each in rows:
        quality = each.bad.quality
        table.add_row(
            f"{quality.loss_frac:.0%}, {1e3 * quality.delay_s:.0f} ms",
            each.bad.link,
            "real packets" if each.path == "tun" else "imitated",
            str(each.uavs),
            f"{each.watched_s:.0f}",
            str(each.packets) if each.packets else "",
            str(each.dropped) if each.packets else "",
            str(each.losses),
        )
    return table


def _partitions(rows: Sequence[PartitionResult]) -> Table:
    table = _table(
        "A fleet in two halves",
        [],
        ["UAVs", "parted [s]", "tasks", "done", "duplicate visits", "agreed after [s]", "faults"],
    )
    for each in rows:
        table.add_row(
            str(each.uavs),
            f"{each.parted_s:.0f}",
            str(each.tasks),
            str(each.done),
            str(each.duplicates),
            f"{each.agreement_s:.2f}",
            str(len(each.faults)),
        )
    return table


def _traffic(rows: Sequence[Traffic]) -> Table:
    table = _table(
        "What is said, per UAV and second; payload without headers",
        [],
        ["UAVs", "messages", "of them status", "bytes", "bytes heard by each agent"],
    )
    for each in rows:
        status = each.messages.get("Status", 0) / each.uavs / each.watched_s
        table.add_row(
            str(each.uavs),
            f"{each.messages_per_uav_s:.1f}",
            f"{status:.1f}",
            f"{each.bytes_per_uav_s:.0f}",
            f"{each.received_bytes_per_uav_s:.0f}",
        )
    return table


def _latencies(rows: Sequence[DecisionLatencies]) -> Table:
    table = _table(
        "From the report of an arrival to the next command [ms]",
        ["rule"],
        ["UAVs", "tasks", "decisions", "p50", "p99", "max"],
    )
    for each in rows:
        table.add_row(
            each.method,
            str(each.uavs),
            str(each.tasks),
            str(len(each.times_s)),
            *(_shown(each.quantile_s(share), 1e3) for share in (0.5, 0.99, 1.0)),
        )
    return table


def _table(title: str, words: Sequence[str], numbers: Sequence[str]) -> Table:
    table = Table(
        title=title,
        title_justify="left",
        title_style="bold",
        box=None,
        pad_edge=False,
        header_style="dim",
    )
    for name in words:
        table.add_column(name)
    for name in numbers:
        table.add_column(name, justify="right")
    return table


def _shown(time_s: float | None, scale: float) -> str:
    return "never" if time_s is None else f"{scale * time_s:.2f}"
