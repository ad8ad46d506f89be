"""Missions that are short, and plays of faults on them, for tests with real processes."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from pathlib import Path

import numpy as np
import pytest

from sim.fleet.faults.flight import DONE_LINE, ChaosFlight, ChaosVerdict, open_chaos_flight
from sim.fleet.layout import BusKind, LaunchOptions
from swarm.model import Mission, Origin, Task, TaskId, Uav, UavId
from swarm.protocol.timing import LinkKind
from swarm.scenario.write import format_scenario
from tests.process.mission import POSITION_RATE_HZ
from tests.process.pace import pace

LIMIT_S = 150.0


def survey(n_uav: int, n_task: int, *, side_m: float = 300.0, service_s: float = 2.0) -> Mission:
    """UAVs in a row amid a square of tasks; flown in some 40 s of mission time."""
    rng = np.random.default_rng(5)
    home_m = side_m / 2.0
    return Mission(
        "chaos",
        600.0,
        tuple(
            Uav(
                UavId(f"uav{number:02}"),
                (home_m + 12.0 * (number - n_uav / 2.0), home_m, 0.0),
                10.0,
            )
            for number in range(1, n_uav + 1)
        ),
        tuple(
            Task(
                TaskId(f"t{number:02}"),
                (float(east_m), float(north_m), 0.0),
                1.0,
                service_s=service_s,
            )
            for number, (east_m, north_m) in enumerate(rng.uniform(0.0, side_m, (n_task, 2)), 1)
        ),
        origin=Origin(46.8, 9.7, 1100.0),
    )


def by_day(bus: BusKind) -> list[object]:
    """Both kinds of bus, of which only that one is flown by day."""
    (other,) = {BusKind.ROUTER, BusKind.MESH} - {bus}
    return [bus, pytest.param(other, marks=pytest.mark.slow)]


def play(
    mission: Mission,
    folder: Path,
    script: Callable[[ChaosFlight], Awaitable[None]],
    *,
    bus: BusKind,
    speedup: float,
    routers: int = 1,
    relayed: bool = False,
    link: LinkKind = LinkKind.NORMAL,
) -> ChaosVerdict:
    """Fly ``mission``, do to it what ``script`` says, and judge what came of it.

    On a slow machine it is flown slower than ``speedup``.
    """
    scenario = folder / "scenario.toml"
    scenario.write_text(format_scenario(mission))
    options = LaunchOptions(
        scenario=scenario,
        method="guided",
        seed=0,
        speedup=pace(speedup),
        bus=bus,
        position_rate_hz=POSITION_RATE_HZ,
        acceptance_radius_m=1.0,
        start_timeout_s=60.0,
        routers=routers,
        link=link,
    )

    # Not as the result of the task: asyncio.run puts that into words, megabytes of them.
    verdicts: list[ChaosVerdict] = []

    async def fly() -> None:
        async with asyncio.timeout(LIMIT_S):
            async with open_chaos_flight(mission, options, relayed=relayed) as flight:
                try:
                    await script(flight)
                    await flight.run.finish()
                except BaseException as fault:
                    logged = [f"{name}: {line}" for name, line in flight.lines[-40:]]
                    fault.add_note("\n".join([*told(flight), *logged]))
                    raise
            verdicts.append(flight.verdict())

    asyncio.run(fly())
    return verdicts[0]


def story(verdict: ChaosVerdict) -> list[str]:
    """What the observer told, line by line."""
    return [happening.text for happening in verdict.flight.mission_state.story]


def told(flight: ChaosFlight) -> list[str]:
    """What the observer has told so far, line by line."""
    return [happening.text for happening in flight.run.mission_state.story]


def logged_done(flight: ChaosFlight) -> list[str]:
    """Tasks that UAVs have done so far by their logs, which need no bus; once for every visit."""
    return [m[1] for _, line in flight.lines if (m := DONE_LINE.search(line))]


def all_done(verdict: ChaosVerdict, n_task: int) -> None:
    """Assert that nothing was lost, no invariant broken and every duplicate counted."""
    told = "\n".join([*story(verdict), *verdict.faults])
    assert verdict.faults == (), told
    assert len(verdict.flight.result.done) == n_task, told
    assert verdict.flight.result.duplicate_visits == verdict.duplicates
    assert verdict.flight.fates == ()
