"""How near `guided`'s search, and others, come to the best values known of published instances."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from itertools import groupby
from statistics import fmean
from typing import Any

from rich.console import RenderableType

from sim.bench.instances import Instance
from sim.bench.machine import this_machine
from sim.bench.results import BenchResult, Progress, table_of, unheard
from sim.bench.route_solvers import METHODS
from swarm.runtime.table import Column, ResultTable

_MOST_INSTANCES = 40
"""That have a line each."""


@dataclass(frozen=True, slots=True)
class FoundRoutes:
    """One search of one instance."""

    file: str
    family: str
    method: str
    best_known: float
    value: float
    """The published objective, reckoned anew from the routes."""
    gap: float
    """Over the best known; less than 0 if better."""
    seconds: float
    """Until the best was found."""
    seed: int | None
    """None where the method has none."""
    routes: list[list[int]]
    """Nodes from 1 in the order of the file, without the depot, one list per UAV."""


@dataclass(frozen=True, slots=True)
class InstanceRow:
    """All searches of one instance by one method, as a line of the table."""

    file: str
    method: str
    tasks: int
    uavs: int
    best_known: float
    best: float
    mean_gap: float
    best_gap: float
    seconds: float


@dataclass(frozen=True, slots=True)
class SizeRow:
    """All searches of the instances of one family and size by one method."""

    family: str
    method: str
    tasks: int
    uavs: int
    instances: int
    searches: int
    mean_gap: float
    worst_gap: float
    """Of one search."""
    reached: float
    """Share of the searches that found the best known, or better."""
    better: int
    """Instances of which a better value than the best known was found."""
    seconds: float
    """Mean until a search's best was found."""


@dataclass(frozen=True, slots=True)
class RoutesBench(BenchResult):
    """All searches of all instances."""

    time_limit_s: float
    rows: tuple[InstanceRow, ...]
    found: tuple[FoundRoutes, ...]

    def as_json(self) -> dict[str, Any]:
        """Everything, ready for `json.dumps`."""
        parts = BenchResult.as_json(self)
        return {
            "machine": parts["machine"],
            "time_limit_s": self.time_limit_s,
            "instances": parts["found"],
        }

    def parts(self) -> Iterable[RenderableType]:
        """A table, the mean gap of each family, and what the methods are."""
        yield self._about()
        yield self.grid()
        yield from self._notes()

    def as_markdown(self) -> str:
        """Everything for a document."""
        about = f"Measured on {self.machine}. {self._about()}"
        return "\n\n".join([about, self.grid().as_markdown(), *self._notes()]) + "\n"

    def grid(self) -> ResultTable:
        """A line per instance and method; where there are many instances, one per size."""
        if len({row.file for row in self.rows}) > _MOST_INSTANCES:
            return self._by_size()
        several = len({row.method for row in self.rows}) > 1
        return table_of(
            self.rows,
            Column("instance", key="file", words=True),
            *([Column("method", key="method", words=True)] if several else []),
            Column("tasks", "d", key="tasks"),
            Column("UAVs", "d", key="uavs"),
            *([] if several else [Column("best known", ".0f", key="best_known")]),
            Column("found", ".0f", key="best"),
            Column("mean gap", ".3f", "%", 100.0, "mean_gap"),
            Column("least", ".3f", "%", 100.0, "best_gap"),
            Column("after", ".1f", "s", key="seconds"),
        )

    def new_best(self) -> list[dict[str, Any]]:
        """The best routes of each instance whose best known value they surpass."""
        best: dict[str, FoundRoutes] = {}
        for found in self.found:
            if found.gap < min(0.0, best[found.file].gap if found.file in best else 0.0):
                best[found.file] = found
        return [asdict(found) for found in best.values()]

    def _by_size(self) -> ResultTable:
        several = len({row.method for row in self.rows}) > 1
        return table_of(
            self.sizes(),
            Column("instances of", key="family", words=True),
            *([Column("method", key="method", words=True)] if several else []),
            Column("tasks", "d", key="tasks"),
            Column("UAVs", "d", key="uavs"),
            Column("instances", "d", key="instances"),
            Column("mean gap", ".3f", "%", 100.0, "mean_gap"),
            Column("worst", ".3f", "%", 100.0, "worst_gap"),
            Column("reached", ".0f", "%", 100.0, "reached"),
            Column("better", "d", key="better"),
            Column("after", ".1f", "s", key="seconds"),
        )

    def sizes(self) -> Iterable[SizeRow]:
        """A row per family, size and method."""
        size = {row.file: (row.tasks, row.uavs) for row in self.rows}

        def kind(found: FoundRoutes) -> tuple[str, str, int, int]:
            return (found.family, found.method, *size[found.file])

        for (family, method, tasks, uavs), group in groupby(sorted(self.found, key=kind), kind):
            runs = list(group)
            yield SizeRow(
                family=family,
                method=method,
                tasks=tasks,
                uavs=uavs,
                instances=len({run.file for run in runs}),
                searches=len(runs),
                mean_gap=fmean(run.gap for run in runs),
                worst_gap=max(run.gap for run in runs),
                reached=fmean(run.gap <= 0.0 for run in runs),
                better=len({run.file for run in runs if run.gap < 0.0}),
                seconds=fmean(run.seconds for run in runs),
            )

    def _about(self) -> str:
        seeds = dict.fromkeys(found.seed for found in self.found if found.seed is not None)
        seeded = f" seeds {', '.join(map(str, seeds))};" if seeds else ""
        return (
            f"{self.time_limit_s:g} s each, less where a published bound proves what is found;"
            f"{seeded} gaps in the published objective, below 0: better than the best known."
        )

    def _notes(self) -> Iterable[str]:
        for family, method in dict.fromkeys((found.family, found.method) for found in self.found):
            gaps = [
                found.gap
                for found in self.found
                if (found.family, found.method) == (family, method)
            ]
            mean = f"mean gap {100.0 * fmean(gaps):.3f} % of {len(gaps)} searches"
            yield f"{family}, {method}: {mean}"
        if better := self.new_best():
            yield "better than the best known: " + ", ".join(
                f"{found['file']} {found['value']:.0f} (known: {found['best_known']:.0f})"
                for found in better
            )
        methods = dict.fromkeys(found.method for found in self.found)
        yield "; ".join(f"{name}: {METHODS[name].what}" for name in methods) + "."


def search_instance(
    instance: Instance, seed: int | None, limit_s: float, method: str = "guided"
) -> FoundRoutes:
    """Search with one method of `METHODS` for ``limit_s`` seconds."""
    found = METHODS[method].solve(instance, seed or 0, limit_s)
    value = instance.value(found.routes)
    return FoundRoutes(
        file=instance.file,
        family=str(instance.family),
        method=method,
        best_known=instance.best_known,
        value=value,
        gap=instance.gap(value),
        seconds=found.seconds,
        seed=seed,
        routes=found.routes,
    )


def measure_routes(
    instances: Sequence[Instance],
    seeds: Sequence[int],
    limit_s: float,
    methods: Sequence[str] = ("guided",),
    *,
    tell: Progress = unheard,
) -> RoutesBench:
    """Search each instance with each method and seed, one after another.

    Methods without seeds search once; those that cannot state an instance's objective are left
    out of it.
    """
    found = []
    for number, instance in enumerate(instances, start=1):
        for name in methods:
            method = METHODS[name]
            if instance.family not in method.families:
                continue
            for seed in seeds if method.seeded else (None,):
                tell(f"{instance.file} ({number} of {len(instances)}), {name}, seed {seed}")
                found.append(search_instance(instance, seed, limit_s, name))
    return RoutesBench(this_machine(), limit_s, tuple(_rows(instances, found)), tuple(found))


def _rows(instances: Sequence[Instance], found: Sequence[FoundRoutes]) -> Iterable[InstanceRow]:
    by_file = {instance.file: instance for instance in instances}
    for (file, method), group in groupby(found, lambda one: (one.file, one.method)):
        runs = list(group)
        instance = by_file[file]
        best = min(runs, key=lambda run: run.gap)
        yield InstanceRow(
            file=file,
            method=method,
            tasks=instance.n_task,
            uavs=instance.n_uav,
            best_known=instance.best_known,
            best=best.value,
            mean_gap=fmean(run.gap for run in runs),
            best_gap=best.gap,
            seconds=fmean(run.seconds for run in runs),
        )
