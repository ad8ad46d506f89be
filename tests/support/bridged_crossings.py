"""Fleets of real bridges and simulated autopilots whose ways meet, as if nobody had planned them.

Ten times a second it is looked how near to each other those in flight are. Leaves out: what keeps
ways apart beforehand (agent.core.airway), which is switched off.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from itertools import combinations

import numpy as np
import pytest

from agent.core import fleet_air
from agent.core.agent_core import AgentCore
from agent.core.interface import GiveWay
from agent.core.verticals import Verticals
from agent.vehicle.config import CommandStyle
from sim.autopilot.firmware import FirmwareModelName
from sim.world.engine import EventQueue
from sim.world.network import Network
from swarm.model import Mission, Task, TaskId, Uav, UavId
from tests.support.bridged_fleet import BridgedFleet

LOOK_S = 0.1
SEPARATION_M = 10.0


def mission_of(
    *ways: tuple[tuple[float, float], tuple[float, float]],
    band_m: tuple[float, float] = (20.0, 25.0),
    service_s: float = 0.0,
) -> Mission:
    """One UAV and one task of its own for each way, all at one height."""
    ids = [TaskId(f"t{number}") for number in range(len(ways))]
    uavs = [
        Uav(
            UavId(f"u{number}"),
            (*begin, 0.0),
            8.0,
            success={task: float(task == ids[number]) for task in ids},
        )
        for number, (begin, _) in enumerate(ways)
    ]
    tasks = [
        Task(task, (*end, 0.0), 1.0, service_s=service_s)
        for task, (_, end) in zip(ids, ways, strict=True)
    ]
    return Mission(
        "crossing", 900.0, tuple(uavs), tuple(tasks), separation_m=SEPARATION_M, band_m=band_m
    )


def random_mission(seed: int) -> Mission:
    """2 to 4 UAVs whose ways lead across one field of 100 to 160 m."""
    rng = np.random.default_rng([seed, 71])
    half_m = float(rng.uniform(50.0, 80.0))

    def places(count: int) -> list[tuple[float, float]]:
        found: list[tuple[float, float]] = []
        while len(found) < count:
            east, north = rng.uniform(-half_m, half_m, 2).tolist()
            if all(math.dist((east, north), other) >= 2.0 * SEPARATION_M for other in found):
                found.append((east, north))
        return found

    count = int(rng.integers(2, 5))
    band_m = (20.0, 25.0) if rng.random() < 0.5 else (20.0, 60.0)
    return mission_of(*zip(places(count), places(count), strict=True), band_m=band_m)


class CrossingFleet(BridgedFleet):
    """UAVs whose ways meet, about to fly."""

    def __init__(
        self,
        monkeypatch: pytest.MonkeyPatch,
        flavour: FirmwareModelName,
        style: CommandStyle,
        mission: Mission,
        *,
        seed: int = 0,
        network: Callable[[EventQueue], Network] | None = None,
        gives_way: bool = True,
    ) -> None:
        monkeypatch.setattr(fleet_air, "air_of_brief", lambda _brief: None)
        super().__init__(
            flavour,
            style,
            mission=mission,
            seed=seed,
            network=network,
            agent=partial(AgentCore, verticals=Verticals() if gives_way else None),
        )
        self.nearest_m = math.inf
        self.nearest: tuple[object, ...] = ()
        self.at(LOOK_S, self._look)

    def made_room(self, uav: str) -> list[GiveWay]:
        """How that UAV's vehicle was told to make room, and to go on."""
        return [order for _, order in self.books[uav].ordered if isinstance(order, GiveWay)]

    def _look(self) -> None:
        now_s = self.world.queue.now_s()
        aloft = {
            uav: vehicle.pilot().position_enu_m(now_s)
            for uav, vehicle in self.vehicles.items()
            if not vehicle.pilot().flight.on_ground
        }
        for one, other in combinations(aloft, 2):
            if (apart_m := math.dist(aloft[one], aloft[other])) < self.nearest_m:
                self.nearest_m = apart_m
                self.nearest = (round(now_s, 1), one, aloft[one], other, aloft[other])
        if self.world.alive:
            self.at(now_s + LOOK_S, self._look)
