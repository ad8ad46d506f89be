"""How a UAV of a mission in the field flies a path: as plans have it, corner by corner.

Plans know places by the heights that the mission gives, so the height of a UAV's layer is no part
of a way; here it is added and taken off evenly along one. Where UAVs are kept apart they also fly
in other layers, which they climb to upright: such ways are as long as they are. Leaves out: which
paths are flown.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
import numpy.typing as npt

from sim.world.flown_path import FlownPath
from sim.world.motion import Point, ramps_over
from swarm.allocation.field.network import FieldNetwork, flight_model
from swarm.allocation.problem import straight_m
from swarm.model import Mission, Uav

FloatArray = npt.NDArray[np.float64]

_CHAIN_FRAC = 1e-5
"""Chains of chords in the place of round corners are longer than these by less than that share."""
_SAME_M = 1e-3
"""Heights or places that differ by less are the same."""


class FieldPaths:
    """Paths of one mission's UAVs, with the times that are planned for them.

    Args:
        mission: gives UAVs, wind, bases and tasks; zones matter for round corners alone.
    """

    def __init__(self, mission: Mission) -> None:
        self.mission = mission
        """Whose UAVs fly."""
        self._rows = {str(uav.id): row for row, uav in enumerate(mission.uavs)}
        self._models = [flight_model(uav, mission.wind_enu_m_s) for uav in mission.uavs]
        self._above_layers = {
            str(task.id): task.height_m for task in mission.tasks if task.height_m is not None
        }

    def uav(self, name: str) -> Uav:
        """The UAV of that name."""
        return self.mission.uavs[self._rows[name]]

    def in_layer(self, task: str | None) -> bool:
        """Whether a task, or any other place, is flown at in the UAV's layer."""
        return task is None or task not in self._above_layers

    def path(
        self, name: str, corners_enu_m: Sequence[Point], layers_m: tuple[float, float]
    ) -> FlownPath:
        """The way of UAV ``name`` from rest at the first of the corners to rest at the last.

        Args:
            name: of the UAV.
            corners_enu_m: (k, 3) where it flies [m; height included]; k >= 2.
            layers_m: what of the heights of the first and of the last is no part of the way [m].
        """
        row = self._rows[name]
        model = self._models[row]
        flown = np.array(corners_enu_m, dtype=np.float64)
        first_m, last_m = layers_m
        if self.mission.separation_m is not None and _is_level_or_upright(flown):
            last_m = first_m  # it climbs to a layer of its choice: all of that is part of the way
        planned = _without_layers(flown, first_m, last_m)
        offset_m = np.diff(planned, axis=0).T
        piece_m = straight_m(offset_m)
        length_m = float(piece_m.sum())
        corners = tuple(map(_point, flown))
        if length_m == 0.0:
            shares = np.linspace(0.0, 1.0, len(flown)).tolist()
            return FlownPath(corners, tuple(shares), 0.0)
        shares = (np.concatenate([[0.0], np.cumsum(piece_m)]) / length_m).tolist()
        duration_s = self._planned_s(row, planned, model.path_s(planned))
        ramps = None
        if (change_m_s2 := model.acceleration_m_s2) is not None:
            moving = piece_m > 0.0
            pieces_m_s = model.speed_over_m_s(offset_m[:, moving], piece_m[moving])
            speed_m_s = length_m / float((piece_m[moving] / pieces_m_s).sum())
            ramps = ramps_over(length_m, 0.0, speed_m_s, change_m_s2, change_m_s2)
        return FlownPath(corners, (*shares[:-1], 1.0), duration_s, ramps)

    def _planned_s(self, row: int, planned_enu_m: FloatArray, flown_s: float) -> float:
        """Time of the leg with its round corners, of which the path has chords [s]."""
        chords = self.mission.zone_margin_m > 0.0 and len(planned_enu_m) > 2
        if not chords and self.mission.terrain is None:
            return flown_s
        begin = self._nodes.get(_known_as(planned_enu_m[0]))
        end = self._nodes.get(_known_as(planned_enu_m[-1]))
        if begin is None or end is None:
            return flown_s
        network = self._network
        planned_s = float(network.leg_s[network.kind[row], begin, end])
        return planned_s if abs(planned_s - flown_s) <= _CHAIN_FRAC * flown_s else flown_s

    @cached_property
    def _network(self) -> FieldNetwork:
        return FieldNetwork(self.mission, self.mission.uavs, self.mission.tasks)

    @cached_property
    def _nodes(self) -> dict[Point, int]:
        places = list(map(_known_as, self._network.node_enu_m))
        return {place: node for node, place in reversed(list(enumerate(places)))}


def _is_level_or_upright(flown_enu_m: FloatArray) -> bool:
    """Whether each piece of a path keeps its height, or its place seen from above."""
    flat_m = np.hypot(*np.diff(flown_enu_m[:, :2], axis=0).T)
    up_m = np.abs(np.diff(flown_enu_m[:, 2]))
    return bool(np.all(np.minimum(flat_m, up_m) < _SAME_M))


def _without_layers(flown_enu_m: FloatArray, first_m: float, last_m: float) -> FloatArray:
    """(k, 3) corners as plans know them: the layers' heights change evenly along the way."""
    planned = flown_enu_m.copy()
    flat_m = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(flown_enu_m[:, :2], axis=0).T))])
    if first_m == last_m or flat_m[-1] == 0.0:
        share = np.linspace(0.0, 1.0, len(flat_m))
    else:
        share = flat_m / flat_m[-1]
    planned[:, 2] -= first_m + share * (last_m - first_m)
    return planned


def _point(place_enu_m: FloatArray) -> Point:
    east_m, north_m, up_m = place_enu_m.tolist()
    return east_m, north_m, up_m


def _known_as(place_enu_m: FloatArray) -> Point:
    east_m, north_m, up_m = place_enu_m.tolist()
    return east_m, north_m, round(up_m, 6)  # a sum with its layer taken off is rounded
