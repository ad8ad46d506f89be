"""Random missions in the field whose UAVs are to keep a distance: crowded, with few layers."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache

from sim.faults.field_missions import AREA_M, random_field_mission
from sim.world.engine import stream
from swarm.model import Mission
from swarm.separation.fleet_layers import fleet_layers_m
from swarm.separation.slabs import planned_apart_m

_IN_AREA = 10.0
"""UAVs for which the usual area is large enough; for more it grows with their number."""


@lru_cache(maxsize=64)
def random_separated_mission(
    seed: int, most: tuple[int, int], uavs: int, tasks: int, popups: int
) -> Mission:
    """A mission of ``uavs`` and ``tasks`` out of the ``most`` of either.

    From 5 to 12 m are kept, with two to five layers for all; more if the starts ask for them.
    """
    rng = stream(seed, "separation")
    area_m = AREA_M * math.sqrt(max(1.0, most[0] / _IN_AREA))
    whole = random_field_mission(seed, most, *most, popups, area_m)
    separation_m = round(float(rng.uniform(5.0, 12.0)), 1)
    lowest_m, layers = round(float(rng.uniform(15.0, 40.0)), 1), int(rng.integers(2, 6))
    for count in range(layers, layers + most[0]):
        highest_m = lowest_m + (count - 1) * planned_apart_m(separation_m) + 1.0
        kept = replace(whole, separation_m=separation_m, band_m=(lowest_m, highest_m))
        try:
            fleet_layers_m(kept)
        except ValueError:
            continue
        break
    return replace(kept, uavs=kept.uavs[:uavs], tasks=kept.tasks[:tasks])
