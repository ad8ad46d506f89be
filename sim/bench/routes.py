"""How near `guided`'s search comes to the best values known of published instances."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import groupby
from statistics import fmean
from typing import Any

from rich.console import RenderableType

from sim.bench.instances import Instance
from sim.bench.machine import this_machine
from sim.bench.results import BenchResult, Progress, table_of, unheard
from swarm.allocation.rules import team_at_start
from swarm.kernels.routes import optimise_routes
from swarm.runtime.clock import SystemClock
from swarm.runtime.table import Column


@dataclass(frozen=True, slots=True)
class FoundRoutes:
    """One search of one instance."""

    file: str
    family: str
    best_known: float
    value: float
    """The published objective, reckoned anew from the routes."""
    gap: float
    """Over the best known; less than 0 if better."""
    seconds: float
    """Until the best was found."""
    seed: int
    routes: list[list[int]]
    """Nodes from 1 in the order of the file, without the depot, one list per UAV."""


@dataclass(frozen=True, slots=True)
class InstanceRow:
    """All searches of one instance, as a line of the table."""

    file: str
    tasks: int
    uavs: int
    best_known: float
    best: float
    mean_gap: float
    best_gap: float
    seconds: float


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
        """A table, and the mean gap of each family."""
        seeds = sorted({found.seed for found in self.found})
        yield (
            f"{self.time_limit_s:g} s each; seeds {', '.join(map(str, seeds))}; gaps in the "
            "published objective [%], below 0: better than the best known"
        )
        yield table_of(
            self.rows,
            Column("instance", key="file", words=True),
            Column("tasks", "d", key="tasks"),
            Column("UAVs", "d", key="uavs"),
            Column("best known", ".0f", key="best_known"),
            Column("found", ".0f", key="best"),
            Column("mean gap", ".3f", "%", 0.01, "mean_gap"),
            Column("least", ".3f", "%", 0.01, "best_gap"),
            Column("found after", ".1f", "s", key="seconds"),
        )
        for family in dict.fromkeys(found.family for found in self.found):
            gaps = [found.gap for found in self.found if found.family == family]
            yield f"{family}: mean gap {100.0 * fmean(gaps):.3f} % of {len(gaps)} searches"


def search_instance(instance: Instance, seed: int, limit_s: float) -> FoundRoutes:
    """Search as `swarm plan` does, with the instance's own distances, for ``limit_s`` seconds."""
    clock = SystemClock()
    began_s = clock.now_s()
    seconds, best = 0.0, float("-inf")

    def spent_frac(_: int) -> float:
        return (clock.now_s() - began_s) / limit_s

    def progress(_: int, value: float) -> None:
        nonlocal seconds, best
        if value > best:
            seconds, best = clock.now_s() - began_s, value

    lists, _ = optimise_routes(
        team_at_start(instance.problem()),
        seed=seed,
        spent_frac=spent_frac,
        progress=progress,
        given=instance.given_times(),
    )
    routes = [[task + 2 for task in tasks] for tasks in lists]
    value = instance.value(routes)
    return FoundRoutes(
        file=instance.file,
        family=str(instance.family),
        best_known=instance.best_known,
        value=value,
        gap=instance.gap(value),
        seconds=seconds,
        seed=seed,
        routes=routes,
    )


def measure_routes(
    instances: Sequence[Instance],
    seeds: Sequence[int],
    limit_s: float,
    *,
    tell: Progress = unheard,
) -> RoutesBench:
    """Search each instance with each seed, one after another."""
    found = []
    for number, instance in enumerate(instances, start=1):
        for seed in seeds:
            tell(f"{instance.file} ({number} of {len(instances)}), seed {seed}")
            found.append(search_instance(instance, seed, limit_s))
    return RoutesBench(this_machine(), limit_s, tuple(_rows(instances, found)), tuple(found))


def _rows(instances: Sequence[Instance], found: Sequence[FoundRoutes]) -> Iterable[InstanceRow]:
    for instance, (_, group) in zip(instances, groupby(found, lambda one: one.file), strict=True):
        runs = list(group)
        best = min(runs, key=lambda run: run.gap)
        yield InstanceRow(
            file=instance.file,
            tasks=instance.n_task,
            uavs=instance.n_uav,
            best_known=instance.best_known,
            best=best.value,
            mean_gap=fmean(run.gap for run in runs),
            best_gap=best.gap,
            seconds=fmean(run.seconds for run in runs),
        )
