"""Fleets that share the air over hills: random ground, and work all over it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from swarm.allocation.legs.ground import ground_of
from swarm.model import Mission, Task, TaskId, Uav, UavId
from tests.support.hills import hills

_HALF_M = 180.0


def hilly_mission(seed: int, *, layers: int = 3, n_uav: int = 6, n_task: int = 18) -> Mission:
    """UAVs at the western edge, tasks up to the eastern: one a line, half of them with heights."""
    rng = np.random.default_rng(seed)
    terrain = hills(seed)
    ground = ground_of(terrain)

    def standing(east_m: float, north_m: float) -> tuple[float, float, float]:
        return east_m, north_m, ground.one_up_m(east_m, north_m)

    separation_m = float(rng.uniform(6.0, 12.0))
    low_m = terrain.planned_m + float(rng.uniform(0.0, 10.0))
    fleet = tuple(
        Uav(UavId(f"u{k}"), standing(-_HALF_M, 40.0 * k - 60.0), 10.0, acceleration_m_s2=2.5)
        for k in range(n_uav)
    )
    board = []
    for k in range(n_task):
        east_m, there_m, north_m = (float(each) for each in rng.uniform(-_HALF_M, _HALF_M, 3))
        height_m = float(rng.uniform(terrain.planned_m, 60.0)) if k % 2 else None
        path = (standing(east_m, north_m), standing(there_m, north_m)) if k == 0 else ()
        place = standing(east_m, north_m)
        board.append(
            Task(TaskId(f"t{k}"), place, 1.0, service_s=3.0, path_enu_m=path, height_m=height_m)
        )
    return Mission(
        f"hills-{seed}",
        900.0,
        fleet,
        tuple(board),
        terrain=terrain,
        separation_m=separation_m,
        band_m=(low_m, low_m + (layers - 1) * (separation_m + 2.0) + 1.0),
    )


def levelled(mission: Mission) -> Mission:
    """The same on flat ground."""

    def flat(place: tuple[float, float, float]) -> tuple[float, float, float]:
        return place[0], place[1], 0.0

    return replace(
        mission,
        terrain=None,
        uavs=tuple(replace(uav, position_enu_m=flat(uav.position_enu_m)) for uav in mission.uavs),
        tasks=tuple(
            replace(
                task,
                position_enu_m=flat(task.position_enu_m),
                path_enu_m=tuple(map(flat, task.path_enu_m)),
            )
            for task in mission.tasks
        ),
    )
