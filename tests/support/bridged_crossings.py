"""Fleets of real bridges and simulated autopilots whose ways meet.

Ten times a second it is looked how near to each other those in flight are. What keeps ways apart
beforehand (agent.core.airway) is switched off unless a fleet is to have it, so that all depends on
giving way in the air. `Roughness` draws what is less than ideal about a fleet.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
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
from sim.faults.generator import random_schedule
from sim.faults.schedule import Disturbance, DisturbanceKind
from sim.world.bridged_vehicle import Equipment
from sim.world.engine import EventQueue
from sim.world.network import Network
from sim.world.settings import RestartMemory, WorldListener
from sim.world.wind import Wind, gusts_of
from swarm.model import Mission, Task, TaskId, Uav, UavId
from swarm.model.frames import DEFAULT_ORIGIN, Origin, wgs84_from_enu
from swarm.protocol.fields import Point
from tests.support.bridged_fleet import BridgedFleet, Change

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
        planned: bool = False,
        rough: Roughness | None = None,
        watch: WorldListener | None = None,
    ) -> None:
        if not planned:
            monkeypatch.setattr(fleet_air, "air_of_brief", lambda _brief: None)
        super().__init__(
            flavour,
            style,
            mission=mission,
            seed=seed,
            network=network,
            change=None if rough is None else rough.change,
            watch=watch,
            agent=partial(AgentCore, verticals=Verticals() if gives_way else None),
        )
        self._off_m = {} if rough is None else rough.off_m
        self._for_good = frozenset[str]() if rough is None else rough.for_good
        self.nearest_m = math.inf
        """Least distance of two in flight, and how far both were from where they believed to be."""
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
            apart_m = math.dist(aloft[one], aloft[other])
            apart_m += self._off_m.get(one, 0.0) + self._off_m.get(other, 0.0)
            if apart_m < self.nearest_m:
                self.nearest_m = apart_m
                self.nearest = (round(now_s, 1), one, aloft[one], other, aloft[other])
        if self._for_good.issuperset(self.world.alive):
            self.world.queue.stop()
        else:
            self.at(now_s + LOOK_S, self._look)


# -- what is less than ideal ---------------------------------------------------------------

_LEAVING = (DisturbanceKind.CRASH, DisturbanceKind.HANG, DisturbanceKind.DEADLOCK)
_BEGIN_S, _SPAN_S = 18.0, 45.0
"""By then all are in the air; faults begin within so long after it, in which they fly and land."""
_KINDS = (
    *_LEAVING,
    DisturbanceKind.CUT,
    DisturbanceKind.UNPLUG,
    DisturbanceKind.MUTE,
    DisturbanceKind.ROUTERS,
    DisturbanceKind.BLINK,
    DisturbanceKind.WEATHER,
)


@dataclass(frozen=True, slots=True)
class Roughness:
    """What is less than ideal about one flight of a fleet."""

    mission: Mission
    """With the accelerations of its UAVs."""
    change: Mapping[str, Change]
    """Of the equipment, by UAV."""
    off_m: Mapping[str, float]
    """By UAV, how far from where it is it takes itself to be."""
    loss_frac: float
    schedule: tuple[Disturbance, ...]
    for_good: frozenset[str]
    """Processes that never come back."""


def roughness(mission: Mission, seed: int, *, planned: bool) -> Roughness:
    """Accelerations, wind with gusts, places up to 1 m off, losses up to 20 %, and faults.

    Without a plan all rests on words that are heard. Then one agent dies or hangs for a while, and
    somebody is parted from the others for no longer than words may stay away.
    """
    rng = np.random.default_rng([seed, 72])
    wind_m_s = tuple(float(each) for each in rng.uniform(-3.0, 3.0, 2))
    gust_m_s = float(rng.uniform(0.0, 4.0))
    uavs, change, off_m = list[Uav](), dict[str, Change](), dict[str, float]()
    for uav in mission.uavs:
        acceleration_m_s2 = float(rng.uniform(1.6, 4.0))
        way, off_m[uav.id] = rng.normal(size=3), float(rng.uniform(0.0, 1.0))
        east, north, up = (off_m[uav.id] * way / np.linalg.norm(way)).tolist()
        air = Wind((wind_m_s[0], wind_m_s[1]), gusts_of(gust_m_s, rng) if gust_m_s > 0.5 else None)
        uavs.append(replace(uav, acceleration_m_s2=acceleration_m_s2))
        change[uav.id] = roughly(acceleration_m_s2, (east, north, up), air)
    draw = _faults_with_a_plan if planned else _faults_without_a_plan
    schedule = draw(mission, seed)
    for_good = frozenset(name for each in schedule if each.lasts_s is None for name in each.names)
    loss_frac = 0.05 * (seed % 5)
    rough = replace(mission, uavs=tuple(uavs))
    return Roughness(rough, change, off_m, loss_frac, schedule, for_good)


def roughly(
    acceleration_m_s2: float, error_m: Point = (0.0, 0.0, 0.0), wind: Wind | None = None
) -> Change:
    """Equipment so agile, in that air, whose receiver is off by the same all the time [m].

    As if its origin lay there.
    """
    origin = Origin(*wgs84_from_enu(DEFAULT_ORIGIN, error_m))

    def change(equipment: Equipment) -> Equipment:
        vehicle = replace(
            equipment.vehicle,
            acceleration_m_s2=acceleration_m_s2,
            origin=origin,
            wind=wind or Wind(),
        )
        return replace(equipment, vehicle=vehicle)

    return change


def _faults_with_a_plan(mission: Mission, seed: int) -> tuple[Disturbance, ...]:
    drawn = random_schedule(seed, _KINDS, mission, _SPAN_S)
    return tuple(replace(each, at_s=_BEGIN_S + each.at_s) for each in drawn)


def _faults_without_a_plan(mission: Mission, seed: int) -> tuple[Disturbance, ...]:
    rng = np.random.default_rng([seed, 73])
    uavs = [str(uav.id) for uav in mission.uavs]
    fails, parted = rng.choice(uavs, 2)
    at_s, parts_s = (_BEGIN_S + rng.uniform(0.0, _SPAN_S, 2)).round(2).tolist()
    kind = DisturbanceKind(str(rng.choice([DisturbanceKind.CRASH, DisturbanceKind.HANG])))
    memory = RestartMemory.DISK if kind is DisturbanceKind.CRASH else None
    fault = Disturbance(
        at_s, kind, (str(fails),), lasts_s=float(rng.uniform(1.0, 30.0)), memory=memory
    )
    cut = Disturbance(
        parts_s, DisturbanceKind.CUT, (str(parted),), lasts_s=float(rng.uniform(0.5, 2.5))
    )
    return tuple(sorted((fault, cut), key=lambda each: each.at_s))
