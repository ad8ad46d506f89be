"""Missions for benchmarks, and real processes that fly them."""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import AsyncIterator, Iterator
from pathlib import Path

import numpy as np

from sim.fleet.child_process import ChildProcess
from sim.fleet.faults.flight import ChaosFlight, open_chaos_flight
from sim.fleet.layout import BusKind, LaunchOptions, default_position_rate_hz
from swarm.model import Mission, Origin, Task, TaskId, Uav, UavId
from swarm.protocol.timing import LinkKind
from swarm.scenario.write import format_scenario

_FAR_M = 10_000.0
_SLOW_M_S = 1.0
_ORIGIN = Origin(46.8, 9.7, 1100.0)


BAND_M = 30.0, 110.0
"""Heights between which fleets that keep a separation fly in benchmarks [m]."""
SPACING_M = 40.0
"""Side of a square on which there is one task of a survey, on average [m]."""


def survey_mission(
    n_uav: int,
    n_task: int,
    seed: int,
    service_s: float = 2.0,
    separation_m: float | None = None,
    spacing_m: float = SPACING_M,
) -> Mission:
    """UAVs in a row beside a square of tasks, as dense for every size of fleet.

    There is one task on each square of ``spacing_m`` [m] by ``spacing_m``, on average.

    With ``separation_m`` [m] they share the layers of `BAND_M`, without it each has its own.
    """
    rng = np.random.default_rng(seed)
    places_m = rng.uniform(0.0, spacing_m * n_task**0.5, (n_task, 2)).tolist()
    return Mission(
        name="survey",
        horizon_s=3600.0,
        uavs=tuple(
            Uav(UavId(f"uav{number:03}"), (12.0 * number, -10.0, 0.0), 10.0)
            for number in range(1, n_uav + 1)
        ),
        tasks=tuple(
            Task(TaskId(f"t{number:03}"), (east_m, north_m, 0.0), 1.0, service_s=service_s)
            for number, (east_m, north_m) in enumerate(places_m, 1)
        ),
        origin=_ORIGIN,
        separation_m=separation_m,
        band_m=None if separation_m is None else BAND_M,
    )


def far_mission(n_uav: int, n_task: int) -> Mission:
    """Tasks that nobody reaches within hours."""
    return Mission(
        name="failover",
        horizon_s=1e6,
        uavs=tuple(
            Uav(UavId(f"uav{number}"), (20.0 * number, 0.0, 0.0), _SLOW_M_S)
            for number in range(1, n_uav + 1)
        ),
        tasks=tuple(
            Task(TaskId(f"t{number}"), (20.0 * number, _FAR_M, 0.0), 1.0)
            for number in range(1, n_task + 1)
        ),
        origin=_ORIGIN,
    )


@contextlib.contextmanager
def scenario_file(mission: Mission) -> Iterator[Path]:
    """A file with ``mission`` that is gone afterwards."""
    with tempfile.TemporaryDirectory(prefix="swarm-bench-") as folder:
        path = Path(folder) / "scenario.toml"
        path.write_text(format_scenario(mission), encoding="utf-8")
        yield path


@contextlib.contextmanager
def options_for(
    mission: Mission,
    *,
    link: LinkKind,
    bus: BusKind,
    method: str = "greedy",
    address: str = "127.0.0.1",
) -> Iterator[LaunchOptions]:
    """Options to fly ``mission`` with, as long as the context lasts."""
    with scenario_file(mission) as scenario:
        yield LaunchOptions(
            scenario=scenario,
            method=method,
            seed=0,
            speedup=1.0,
            bus=bus,
            position_rate_hz=min(20.0, default_position_rate_hz(len(mission.uavs))),
            acceptance_radius_m=0.5,
            start_timeout_s=120.0,
            link=link,
            address=address,
        )


@contextlib.asynccontextmanager
async def flying(
    mission: Mission,
    *,
    link: LinkKind,
    bus: BusKind,
    relayed: bool = False,
    method: str = "greedy",
    seed: int = 0,
) -> AsyncIterator[ChaosFlight]:
    """Start to fly ``mission``; all processes are gone when the context ends."""
    with options_for(mission, link=link, bus=bus, method=method) as options:
        async with open_chaos_flight(mission, options, relayed=relayed, seed=seed) as flight:
            yield flight


async def started(
    stack: contextlib.AsyncExitStack, name: str, arguments: list[str]
) -> ChildProcess:
    """A process that ends with ``stack``.

    Raises:
        ChildFailedError: it did not start.
    """
    child = ChildProcess(name, arguments)
    stack.push_async_callback(child.stop)
    await child.start()
    return child
