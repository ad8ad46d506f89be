"""What keeping a distance costs in J, and how near UAVs come without and with it, over density.

Random missions over a square kilometre, greedy in the ideal world: the same starts, tasks and
sequence with a separation and without.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from rich.console import RenderableType

from sim.bench.fleets import BAND_M
from sim.bench.machine import this_machine
from sim.bench.results import BenchResult, Progress, table_of, unheard
from sim.faults.case import quick_plan
from sim.world.engine import stream
from sim.world.simulation import SimulatedMission, simulate_mission
from sim.world.uncertainty import Uncertainty
from swarm.model import Mission, Task, TaskId, Uav, UavId
from swarm.runtime.clock import Clock
from swarm.runtime.table import Column

SIDE_M = 1000.0
TASKS_PER_UAV = 5
_ERRORS = 6.0
"""Standard deviations of its position by which a pair may be nearer: three of either."""


@dataclass(frozen=True, slots=True)
class SeparationRow:
    """Missions of one density."""

    per_km2: int
    """UAVs."""
    missions: int
    lost_percent: float
    """Of J, on average."""
    most_percent: float
    """Of J, in the worst mission."""
    nearest_m: float
    """Of all missions with the separation."""
    without_m: float
    """The same of those without."""
    too_near: int
    """Missions in which a pair came nearer than asked, less `_ERRORS` errors of position."""
    undone: int
    """Tasks that were left undone with the separation, in all missions."""


@dataclass(frozen=True, slots=True)
class SeparationResult(BenchResult):
    """The cost over density."""

    separation_m: float
    position_error_m: float
    rows: tuple[SeparationRow, ...]
    elapsed_s: float

    def parts(self) -> Iterable[RenderableType]:
        """One table."""
        yield f"{self.separation_m:g} m apart, positions {self.position_error_m:g} m off (sd)"
        yield table_of(
            self.rows,
            Column("UAVs/km²", key="per_km2"),
            Column("missions", key="missions"),
            Column("J lost", ".2f", "%", key="lost_percent"),
            Column("at most", ".2f", "%", key="most_percent"),
            Column("nearest", ".1f", "m", key="nearest_m"),
            Column("without", ".1f", "m", key="without_m"),
            Column("too near", key="too_near"),
            Column("undone", key="undone"),
        )


def dense_mission(n_uav: int, seed: int, separation_m: float) -> Mission:
    """So many UAVs and `TASKS_PER_UAV` times as many tasks over a square kilometre."""
    rng = stream(seed, "density", str(n_uav))
    fleet = tuple(
        Uav(
            UavId(f"u{number}"),
            (*rng.uniform(0.0, SIDE_M, 2).tolist(), 0.0),
            float(rng.uniform(8.0, 12.0)),
            acceleration_m_s2=2.5,
        )
        for number in range(n_uav)
    )
    board = tuple(
        Task(
            TaskId(f"t{number}"),
            (*rng.uniform(0.0, SIDE_M, 2).tolist(), 0.0),
            value=float(rng.uniform(1.0, 5.0)),
            service_s=float(rng.uniform(0.0, 10.0)),
        )
        for number in range(TASKS_PER_UAV * n_uav)
    )
    return Mission(
        f"density-{n_uav}-{seed}", 1200.0, fleet, board, separation_m=separation_m, band_m=BAND_M
    )


def measure_separation(
    densities: Sequence[int],
    seeds: Sequence[int],
    separation_m: float,
    position_error_m: float,
    clock: Clock,
    *,
    tell: Progress = unheard,
) -> SeparationResult:
    """Fly missions of every density and seed twice."""
    began_s, rows = clock.now_s(), []
    for n_uav in densities:
        lost, kept_m, free_m, undone = list[float](), list[float](), list[float](), 0
        for seed in seeds:
            tell(f"{n_uav} UAVs, seed {seed}")
            apart = dense_mission(n_uav, seed, separation_m)
            kept = _fly(apart, seed, position_error_m)
            free = _fly(replace(apart, separation_m=None), seed, position_error_m)
            lost.append(100.0 * (1.0 - kept.value / free.value))
            kept_m.append(_nearest_m(kept))
            free_m.append(_nearest_m(free))
            undone += len(kept.result.open)
        least_m = separation_m - _ERRORS * position_error_m
        rows.append(
            SeparationRow(
                per_km2=n_uav,
                missions=len(seeds),
                lost_percent=sum(lost) / len(lost),
                most_percent=max(lost),
                nearest_m=min(kept_m),
                without_m=min(free_m),
                too_near=sum(near_m < least_m - 1e-3 for near_m in kept_m),
                undone=undone,
            )
        )
    machine, elapsed_s = this_machine(), clock.now_s() - began_s
    return SeparationResult(machine, separation_m, position_error_m, tuple(rows), elapsed_s)


def _fly(mission: Mission, seed: int, position_error_m: float) -> SimulatedMission:
    uncertainty = Uncertainty(position_error_m=position_error_m)
    return simulate_mission(
        mission, method="greedy", seed=seed, uncertainty=uncertainty, planner=quick_plan
    )


def _nearest_m(flown: SimulatedMission) -> float:
    found_m = flown.world.closest_approach_m()
    return math.inf if found_m is None else found_m
