"""Heights at which the UAVs of a mission fly, if its file names none."""

from __future__ import annotations

from dataclasses import dataclass

from swarm.model.terrain import Terrain
from swarm.model.vehicles import TRAITS, VehicleKind

GROUND_M = 0.0
"""The layer of what drives."""


@dataclass(frozen=True, slots=True)
class FlightLayers:
    """Heights at which the UAVs fly, each its own.

    Raises:
        ValueError: a height is not positive.
    """

    lowest_m: float = 10.0
    """Height of the first UAV's layer above the places it visits [m]."""
    spacing_m: float = 3.0
    """Distance between neighbouring layers [m]."""

    def __post_init__(self) -> None:
        if not (self.lowest_m > 0.0 and self.spacing_m >= 0.0):
            raise ValueError(f"layers need lowest_m > 0 and spacing_m >= 0, not {self}")

    def layer_m(self, index: int) -> float:
        """Layer of the UAV with that place in the scenario [m]."""
        return self.lowest_m + index * self.spacing_m

    def layer_of_m(self, vehicle: VehicleKind, index: int) -> float:
        """Layer of a UAV of that kind at that place [m]."""
        return GROUND_M if TRAITS[vehicle].drives else self.layer_m(index)


HIGHEST_M = 120.0
"""Above it unmanned aircraft need a permit of their own in the EU, Britain and Switzerland; 122 m
(400 ft) in the USA."""


def layers_below(highest_m: float, n_uav: int, layers: FlightLayers) -> FlightLayers:
    """Those layers, closer to each other where the highest of ``n_uav`` would be too high.

    Vehicles that climb at 2.5 m/s need two minutes to the highest of a hundred layers 3 m apart.
    """
    room_m = max(0.0, highest_m - layers.lowest_m) / max(1, n_uav - 1)
    return FlightLayers(layers.lowest_m, min(layers.spacing_m, room_m))


def layers_over(terrain: Terrain | None, layers: FlightLayers | None = None) -> FlightLayers:
    """Those layers, or the usual ones, the lowest as far from the ground as paths are planned."""
    usual = FlightLayers() if layers is None else layers
    if terrain is None or usual.lowest_m >= terrain.planned_m:
        return usual
    return FlightLayers(terrain.planned_m, usual.spacing_m)
