"""The height layers of one fleet: whose they are, and where each UAV begins.

Leaves out: who flies in which layer later, which is settled by claims.
"""

from __future__ import annotations

from swarm.model import Mission
from swarm.model.layers import FlightLayers, layers_below, layers_over
from swarm.model.terrain import Terrain
from swarm.separation.slabs import Slabs, keeper_rows, shared_layers_m, start_layers


def slabs_over(
    terrain: Terrain | None,
    separation_m: float,
    n_uav: int,
    band_m: tuple[float, float] | None,
    lowest_m: float,
) -> Slabs:
    """The air of a fleet that is kept apart.

    Args:
        terrain: the ground; None: it is flat.
        separation_m: smallest distance of two UAVs [m].
        n_uav: how many there are.
        band_m: lowest and greatest height above the ground [m]; None: from ``lowest_m`` up.
        lowest_m: height of the lowest layer where there is no band [m].
    """
    layers_m = shared_layers_m(separation_m, max(1, n_uav), band_m, lowest_m)
    if terrain is None:
        return Slabs.between(separation_m, layers_m)
    return Slabs.over(separation_m, layers_m, (terrain.lowest_m, terrain.highest_m))


def slabs_of(mission: Mission, lowest_m: float) -> Slabs | None:
    """The air of a mission whose UAVs are kept apart; None of any other.

    Args:
        mission: gives ground, separation, band and the size of the fleet.
        lowest_m: height of the lowest layer where there is no band [m].
    """
    separation_m, n_uav = mission.separation_m, len(mission.uavs)
    if separation_m is None:
        return None
    return slabs_over(mission.terrain, separation_m, n_uav, mission.band_m, lowest_m)


def fleet_layers_m(mission: Mission, layers: FlightLayers | None = None) -> tuple[float, ...]:
    """By UAV, the height of its layer at mission time 0 [m].

    Over hills layers that nobody shares lie in the band, if there is one.

    Args:
        mission: gives fleet, ground, separation and band.
        layers: as a coordinator was told; None: the usual ones.

    Raises:
        ValueError: some start so near to each other that the band has too few layers.
    """
    n_uav = len(mission.uavs)
    flown = layers_over(mission.terrain, layers)
    slabs = slabs_of(mission, flown.lowest_m)
    if slabs is None:
        if mission.terrain is not None and mission.band_m is not None:
            low_m, high_m = mission.band_m
            flown = layers_below(high_m, n_uav, FlightLayers(low_m, flown.spacing_m))
        return tuple(flown.layer_of_m(uav.vehicle, index) for index, uav in enumerate(mission.uavs))
    n_layer = len(slabs.layers_m)
    keepers = keeper_rows(n_layer, max(1, n_uav))
    starts = [uav.position_enu_m for uav in mission.uavs]
    preferred = [
        keepers.index(row) if row in keepers else row % n_layer for row in range(len(starts))
    ]
    found = start_layers(slabs, starts, preferred)
    if found is None:
        raise ValueError(
            f"starts are so near to each other that {n_layer} layers with "
            f"{slabs.separation_m:g} m between UAVs are too few"
        )
    return tuple(slabs.layers_m[layer] for layer in found)
