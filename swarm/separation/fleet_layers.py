"""The height layers of one fleet: whose they are, and where each UAV begins.

Leaves out: who flies in which layer later, which is settled by claims.
"""

from __future__ import annotations

from swarm.model import Mission
from swarm.model.layers import FlightLayers, layers_over
from swarm.separation.slabs import Slabs, keeper_rows, shared_layers_m, start_layers


def slabs_of(mission: Mission, lowest_m: float) -> Slabs | None:
    """The air of a mission whose UAVs are kept apart; None of any other.

    Args:
        mission: gives separation, band and the size of the fleet.
        lowest_m: height of the lowest layer where there is no band [m].
    """
    if mission.separation_m is None:
        return None
    layers_m = shared_layers_m(
        mission.separation_m, max(1, len(mission.uavs)), mission.band_m, lowest_m
    )
    return Slabs(mission.separation_m, layers_m)


def fleet_layers_m(mission: Mission, layers: FlightLayers | None = None) -> tuple[float, ...]:
    """By UAV, the height of its layer at mission time 0 [m].

    Args:
        mission: gives fleet, ground, separation and band.
        layers: as a coordinator was told; None: the usual ones.

    Raises:
        ValueError: some start so near to each other that the band has too few layers.
    """
    flown = layers_over(mission.terrain, layers)
    slabs = slabs_of(mission, flown.lowest_m)
    if slabs is None:
        return tuple(flown.layer_m(index) for index in range(len(mission.uavs)))
    keepers = keeper_rows(len(slabs), max(1, len(mission.uavs)))
    starts = [uav.position_enu_m for uav in mission.uavs]
    preferred = [
        keepers.index(row) if row in keepers else row % len(slabs) for row in range(len(starts))
    ]
    found = start_layers(slabs, starts, preferred)
    if found is None:
        raise ValueError(
            f"starts are so near to each other that {len(slabs)} layers with "
            f"{slabs.separation_m:g} m between UAVs are too few"
        )
    return tuple(slabs.layers_m[layer] for layer in found)
