"""`swarm bench failover`: everything measured about fleets in trouble, and its tables."""

from __future__ import annotations

import asyncio
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any

from rich.console import RenderableType

from sim.bench.latency import DecisionLatencies, measure_latencies
from sim.bench.links import (
    BAD_LINKS,
    FalseLosses,
    PartitionResult,
    Traffic,
    measure_false_losses,
    measure_partition,
    measure_traffic,
)
from sim.bench.machine import this_machine
from sim.bench.results import BenchResult, Progress, table_of, unheard
from sim.bench.takeover import FailureMode, Takeovers, measure_takeovers
from sim.fleet.layout import BusKind
from swarm.protocol.timing import LinkKind, preset
from swarm.runtime.table import Column, ResultTable

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
class FailoverResults(BenchResult):
    """All that was measured."""

    settings: FailoverSettings
    takeovers: tuple[Takeovers, ...]
    losses: tuple[FalseLosses, ...]
    partitions: tuple[PartitionResult, ...]
    traffic: tuple[Traffic, ...]
    latencies: tuple[DecisionLatencies, ...]

    def as_json(self) -> dict[str, Any]:
        """Everything, ready for `json.dumps`."""
        takeovers = zip(_of_takeovers(self.takeovers).as_records(), self.takeovers, strict=True)
        return {
            "machine": asdict(self.machine),
            "seed": self.settings.seed,
            "takeovers": [{**record, "times_s": list(each.times_s)} for record, each in takeovers],
            "losses": _of_losses(self.losses).as_records(),
            "partitions": [asdict(each) for each in self.partitions],
            "traffic": [
                {**asdict(each), **{name: getattr(each, name) for name in _PER_UAV}}
                for each in self.traffic
            ],
            "latencies": _of_latencies(self.latencies).as_records(),
        }

    def parts(self) -> Iterable[RenderableType]:
        """See `BenchResult`."""
        yield f"seed {self.settings.seed}"
        tables = (
            _of_takeovers(self.takeovers),
            _of_losses(self.losses),
            table_of(
                self.partitions,
                Column("UAVs", key="uavs"),
                Column("parted", ".0f", "s", key="parted_s"),
                Column("tasks", key="tasks"),
                Column("done", key="done"),
                Column("duplicate visits", key="duplicates"),
                Column("agreed after", ".2f", "s", key="agreement_s"),
                Column("faults", lambda faults: str(len(faults)), key="faults"),
                title="A fleet in two halves",
            ),
            table_of(
                self.traffic,
                Column("UAVs", key="uavs"),
                Column("messages", ".1f", key="messages_per_uav_s"),
                Column("of them status", ".1f", key="status_per_uav_s"),
                Column("bytes", ".0f", key="bytes_per_uav_s"),
                Column("bytes heard by each agent", ".0f", key="received_bytes_per_uav_s"),
                title="What is said, per UAV and second; payload without headers",
            ),
            _of_latencies(self.latencies),
        )
        for table in tables:
            if table.rows:
                yield from ("", table)


_PER_UAV = ("messages_per_uav_s", "bytes_per_uav_s", "received_bytes_per_uav_s")
"""What programs are told of `Traffic` besides its fields."""


def measure_failover(
    what: Sequence[FailoverMeasure],
    settings: FailoverSettings,
    tell: Progress = unheard,
) -> FailoverResults:
    """Measure ``what``, one after the other.

    Raises:
        SwarmError: a process did not start.
        TimeoutError: a fleet did not do in time what it has to do.
    """
    machine, seed = this_machine(), settings.seed
    takeovers = [
        asyncio.run(
            measure_takeovers(
                blow, settings.trials, link=settings.link, bus=settings.bus, seed=seed, tell=tell
            )
        )
        for blow in FailureMode
        if FailoverMeasure(blow) in what
    ]
    losses = []
    for bad in BAD_LINKS if FailoverMeasure.LOSS in what else ():
        tell(f"loss: {bad.quality.loss_frac:.0%}, {1e3 * bad.quality.delay_s:.0f} ms")
        losses.append(measure_false_losses(bad, settings.watch_s, seed=seed, relay=settings.relay))
    partitions = []
    for number in range(settings.partitions if FailoverMeasure.PARTITION in what else 0):
        tell(f"partition: {number} of {settings.partitions}")
        parting = measure_partition(settings.parted_s, seed=seed + number, tell=tell)
        partitions.append(asyncio.run(parting))
    traffic = []
    for size in settings.sizes if FailoverMeasure.TRAFFIC in what else ():
        tell(f"traffic: {size} UAVs")
        traffic.append(asyncio.run(measure_traffic(size, settings.traffic_s, seed=seed)))
    latencies = [
        asyncio.run(measure_latencies(method, seed=seed, tell=tell))
        for method in (settings.methods if FailoverMeasure.LATENCY in what else ())
    ]
    return FailoverResults(
        machine,
        settings,
        tuple(takeovers),
        tuple(losses),
        tuple(partitions),
        tuple(traffic),
        tuple(latencies),
    )


def bound_s(blow: FailureMode, link: LinkKind) -> float:
    """Within which time another is to hold the task."""
    if blow is FailureMode.KILL:
        return KILL_TARGET_S
    chosen = preset(link)
    return chosen.lease_s + chosen.timing.silence_s


def _of_takeovers(rows: Sequence[Takeovers]) -> ResultTable:
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


def _of_losses(rows: Sequence[FalseLosses]) -> ResultTable:
    return ResultTable(
        (
            Column("loss", ".0%", key="loss_frac"),
            Column("delay", ".0f", "ms", 1e3, key="delay_s"),
            Column("link", key="link", words=True),
            Column("UAVs", key="uavs"),
            Column("watched", ".0f", "s", key="watched_s"),
            Column("path", _path, key="path", words=True),
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


def _of_latencies(rows: Sequence[DecisionLatencies]) -> ResultTable:
    return ResultTable(
        (
            Column("rule", key="method", words=True),
            *(Column(name, key=name.lower()) for name in ("UAVs", "tasks", "decisions")),
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


def _path(path: str) -> str:
    return "real" if path == "tun" else "imitated"


def _counted(packets: int) -> str:
    """None are counted where packets are imitated."""
    return str(packets or "")
