"""Fleets in which repetitions are stretched and only some are asked, under random faults."""

from __future__ import annotations

import pytest

from sim.faults.case import Case, play
from sim.faults.generator import random_case, random_schedule
from sim.faults.schedule import PLAIN_KINDS
from swarm.model import Mission, Task, TaskId, Uav, UavId
from swarm.protocol.sync import EVERYONE_UP_TO
from swarm.protocol.timing import stretch_of
from tests.support.seeds import seeds

UAVS, TASKS = 40, 60


def crowd() -> Mission:
    """UAVs in a row, and tasks in a square beside it."""
    return Mission(
        name="crowd",
        horizon_s=3600.0,
        uavs=tuple(Uav(UavId(f"u{n}"), (8.0 * n, -10.0, 0.0), 10.0) for n in range(UAVS)),
        tasks=tuple(
            Task(TaskId(f"t{n}"), (40.0 * (n % 8), 40.0 * (n // 8), 0.0), 1.0, service_s=2.0)
            for n in range(TASKS)
        ),
    )


def test_such_a_fleet_is_a_large_one() -> None:
    assert stretch_of(UAVS) > 1.0
    assert UAVS > EVERYONE_UP_TO


@pytest.mark.parametrize("seed", seeds(2, 40))
def test_no_invariant_breaks_in_a_large_fleet(seed: int) -> None:
    mission = crowd()
    case = Case(
        seed=seed,
        uavs=UAVS,
        tasks=TASKS,
        topology=random_case(seed).topology,
        schedule=random_schedule(seed, PLAIN_KINDS, mission, 40.0),
        mission=mission,
    )

    assert play(case).broken is None
