"""The rules of a fleet's tactical separation, and the grid of cells by which its UAVs hear others.

Both follow from the brief alone, so they are the same for everyone.
"""

from __future__ import annotations

import math

from swarm.protocol.events import Cell
from swarm.protocol.messages import MissionConfig
from swarm.separation.shared_air import air_of_brief
from swarm.separation.slabs import POSITION_ERROR_M, planned_apart_m
from swarm.separation.tactical_motion import Agility, Place
from swarm.separation.tactical_traffic import TrafficRules

_SURELY_M_S2 = 1.5
"""With which every vehicle can brake: PX4 does so at 1.6, ArduCopter at 2.5 [m/s²]."""
_GRID_M = 50.0
_LEFT_FRAC = 0.1
"""So far beyond the border of its cell a UAV may be before it listens around the next one."""


def rules_of(brief: MissionConfig) -> TrafficRules | None:
    """By what the UAVs of that brief keep apart; None: by nothing."""
    if brief.separation_m is None or not brief.uavs:
        return None
    fastest_m_s = max(uav.speed_m_s for uav in brief.uavs)
    told_m_s2 = (uav.acceleration_m_s2 for uav in brief.uavs if uav.acceleration_m_s2 is not None)
    slowest_m_s2 = min(_SURELY_M_S2, min(told_m_s2, default=math.inf))
    flown_m = [uav.position_enu_m[2] + uav.layer_m for uav in brief.uavs]
    low_m, high_m = min(flown_m), max(flown_m)
    if brief.terrain is not None and (air := air_of_brief(brief)) is not None:
        # Who makes room is kept from the ground by its bridge.
        terrain, layers_m = brief.terrain.terrain(), air.slabs.layers_m
        low_m, high_m = terrain.lowest_m + layers_m[0], terrain.highest_m + layers_m[-1]
    elif brief.band_m is not None:
        high_m = max(high_m, low_m - brief.band_m[0] + brief.band_m[1])
    else:
        high_m += 2.0 * planned_apart_m(brief.separation_m)
    return TrafficRules(
        brief.separation_m,
        fastest_m_s,
        Agility(slowest_m_s2),
        POSITION_ERROR_M,
        low_m=low_m - POSITION_ERROR_M,
        high_m=high_m + POSITION_ERROR_M,
    )


def cell_m(rules: TrafficRules) -> float:
    """Width of a cell [m]: whoever matters is in the same one or next to it."""
    return _GRID_M * math.ceil(rules.reach_m / (1.0 - _LEFT_FRAC) / _GRID_M)


def cell_around(place: Place, width_m: float, before: Cell | None) -> Cell:
    """In which cell a UAV is, or still counts as being.

    Args:
        place: of the UAV [m].
        width_m: of a cell.
        before: in which it counted as being; None: in none.
    """
    if before is not None:
        off = [abs(at / width_m - cell - 0.5) for at, cell in zip(place[:2], before, strict=True)]
        if max(off) <= 0.5 + _LEFT_FRAC:
            return before
    return math.floor(place[0] / width_m), math.floor(place[1] / width_m)


def cells_near(cell: Cell) -> frozenset[Cell]:
    """That cell and the eight around it."""
    east, north = cell
    return frozenset((east + e, north + n) for e in (-1, 0, 1) for n in (-1, 0, 1))
