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
from swarm.runtime.table import Column, ResultTable

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
            {**record, "times_s": list(each.times_s)}
            for record, each in zip(
                _takeovers(done.takeovers).as_records(), done.takeovers, strict=True
            )
        ],
        "losses": _losses(done.losses).as_records(),
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
        "latencies": _latencies(done.latencies).as_records(),
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


def _takeovers(rows: Sequence[Takeovers]) -> ResultTable:
    return ResultTable(
        (
            *(Column(name, words=True, key=name) for name in ("blow", "link", "bus")),
            *(Column(name, key=name) for name in ("trials", "missed")),
            *_quantile_columns(1.0),
            Column("bound", ".2f", key="bound_s"),
        ),
        [
            (
                each.blow,
                each.link,
                each.bus,
                len(each.times_s) + each.missed,
                each.missed,
                *map(each.quantile_s, _SHARES.values()),
                bound_s(each.blow, each.link),
            )
            for each in rows
        ],
        "From a blow to another's held claim [s]",
    )


def _losses(rows: Sequence[FalseLosses]) -> ResultTable:
    ways = {"tun": "real"}
    return ResultTable(
        (
            Column("loss", ".0%", key="loss_frac"),
            Column("delay", ".0f", "ms", 1e3, key="delay_s"),
            Column("link", key="link", words=True),
            Column("UAVs", key="uavs"),
            Column("watched", ".0f", "s", key="watched_s"),
            Column("path", lambda path: ways.get(path, "imitated"), key="path", words=True),
            Column("false losses", key="false_losses"),
            Column("packets", _counted, key="packets"),
            Column("of them lost", _counted, key="packets_lost"),
        ),
        [
            (
                each.bad.quality.loss_frac,
                each.bad.quality.delay_s,
                each.bad.link,
                each.uavs,
                each.watched_s,
                each.path,
                each.losses,
                each.packets,
                each.dropped,
            )
            for each in rows
        ],
        "Living processes taken for lost",
    )


def _partitions(rows: Sequence[PartitionResult]) -> ResultTable:
    return ResultTable(
        (
            Column("UAVs"),
            Column("parted", ".0f", "s"),
            Column("tasks"),
            Column("done"),
            Column("duplicate visits"),
            Column("agreed after", ".2f", "s"),
            Column("faults"),
        ),
        [
            (
                each.uavs,
                each.parted_s,
                each.tasks,
                each.done,
                each.duplicates,
                each.agreement_s,
                len(each.faults),
            )
            for each in rows
        ],
        "A fleet in two halves",
    )


def _traffic(rows: Sequence[Traffic]) -> ResultTable:
    return ResultTable(
        (
            Column("UAVs"),
            Column("messages", ".1f"),
            Column("of them status", ".1f"),
            Column("bytes", ".0f"),
            Column("bytes heard by each agent", ".0f"),
        ),
        [
            (
                each.uavs,
                each.messages_per_uav_s,
                each.messages.get("Status", 0) / each.uavs / each.watched_s,
                each.bytes_per_uav_s,
                each.received_bytes_per_uav_s,
            )
            for each in rows
        ],
        "What is said, per UAV and second; payload without headers",
    )


def _latencies(rows: Sequence[DecisionLatencies]) -> ResultTable:
    return ResultTable(
        (
            Column("rule", key="method", words=True),
            Column("UAVs", key="uavs"),
            Column("tasks", key="tasks"),
            Column("decisions", key="decisions"),
            *_quantile_columns(1e3),
        ),
        [
            (
                each.method,
                each.uavs,
                each.tasks,
                len(each.times_s),
                *map(each.quantile_s, _SHARES.values()),
            )
            for each in rows
        ],
        "From the report of an arrival to the next command [ms]",
    )


_SHARES = {"p50": 0.5, "p99": 0.99, "max": 1.0}


def _quantile_columns(scale: float) -> list[Column]:
    return [Column(name, ".2f", scale=scale, key=f"{name}_s", none="never") for name in _SHARES]


def _counted(packets: int) -> str:
    """None are counted where packets are imitated."""
    return str(packets or "")
