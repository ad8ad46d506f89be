"""Legs, lines and ways home of a mission's UAVs, as the tables of `FieldProblem`.

Nodes are the starts of the UAVs, then the bases, then the ends of the tasks: a place has one node,
a line one for each end. UAVs that fly alike, and whose zones concern them alike, share a table.
Leaves out: the paths themselves and how long they take (swarm.allocation.legs).
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from swarm.model import Base, Mission, Task, Uav, Zone
from swarm.model.layers import layers_over
from swarm.separation.fleet_layers import slabs_of

if TYPE_CHECKING:
    from swarm.allocation.legs import FlightModel, LegNetwork
    from swarm.allocation.legs.ground import Ground

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int32]
Point = tuple[float, float, float]

_HIGHER_M = 3.0
"""Paths may be higher above the ground than they need be [m]: lines, and where corners are few."""

START = -1
"""In the place of a base: the UAV's own start."""
MOST_LEGS = 40_000_000
"""From every node to every other, for each kind of UAV: tables of 0.3 GB, and a few times as much
while they are made."""


class TooManyLegsError(ValueError):
    """The tables of a mission's legs would not fit."""

    def __init__(self, n_node: int, n_kind: int) -> None:
        super().__init__(
            f"{n_node} starts, bases and ends of tasks for {n_kind} kinds of UAVs make "
            f"{n_node * n_node * n_kind} legs, more than the {MOST_LEGS} that fit"
        )


class FieldNetwork:
    """All that is between the nodes of a mission, UAV by UAV.

    Args:
        mission: gives bases, zones with their margin, wind and band.
        uavs: rows.
        tasks: columns.
        layers_m: (n_uav,) heights of the UAVs' layers [m]; when None, their own, or as a
            coordinator flies them by default, by their places in the mission, else in ``uavs``.

    Raises:
        ValueError: there is not one layer for each UAV.
        TooManyLegsError: there are more than `MOST_LEGS`.
    """

    def __init__(
        self,
        mission: Mission,
        uavs: Sequence[Uav],
        tasks: Sequence[Task],
        layers_m: Sequence[float] | None = None,
    ) -> None:
        # Only where it is needed: plain missions would start a tenth later.
        from swarm.allocation.legs import Airspace, LegNetwork
        from swarm.allocation.legs.ground import ground_of

        if layers_m is not None and len(layers_m) != len(uavs):
            raise ValueError(f"layers_m must have a height for each of {len(uavs)} UAVs")
        self._layers_m = (
            _layers_m(mission, uavs) if layers_m is None else list(map(float, layers_m))
        )
        self._band_m = mission.band_m
        lowest_m = min(self._layers_m, default=0.0)  # of no UAVs whatever
        if self._band_m is None and (slabs := slabs_of(mission, lowest_m)) is not None:
            self._band_m = slabs.layers_m[0], slabs.layers_m[-1]
        zones = mission.zones
        self._ground: Ground | None = None
        if mission.terrain is not None:
            self._ground = ground_of(mission.terrain)
            highest_m = max(self._layers_m, default=0.0)
            if self._band_m is not None:
                highest_m = max(highest_m, self._band_m[1])
            zones = tuple(_zones_over(self._ground, mission, highest_m))
            # Heights over the ground follow from the paths: zones that could matter, matter.
            self._band_m = -np.inf, np.inf
        self._airspace = Airspace(zones, mission.zone_margin_m)
        flown = [_points(task, self._ground) for task in tasks]
        self.node_enu_m, self.enter, self._in_layer = _nodes(uavs, mission.bases, tasks, flown)
        self._lines = _Lines(tasks, flown)
        networks: dict[bytes, LegNetwork] = {}
        kinds: dict[tuple[FlightModel, bytes], int] = {}
        kind = []
        self._kinds: list[tuple[FlightModel, LegNetwork]] = []
        for uav, layer_m in zip(uavs, self._layers_m, strict=True):
            model = flight_model(uav, mission.wind_enu_m_s)
            low_m, high_m = self._heights_m(layer_m, self.node_enu_m, self._in_layer)
            sides = self._sides(low_m, high_m)
            # What lies between the ends of lines may be higher than both.
            line_m, in_layer = self._lines.point_m, self._lines.in_layer
            sides += self._sides(*self._heights_m(layer_m, line_m, in_layer))
            if sides not in networks:
                networks[sides] = LegNetwork(
                    self._airspace,
                    self.node_enu_m,
                    low_m,
                    high_m,
                    self._ground,
                    np.where(self._in_layer, 0.0, self._room_m),
                )
            if (model, sides) not in kinds:
                kinds[model, sides] = len(kinds)
                self._kinds.append((model, networks[sides]))
            kind.append(kinds[model, sides])
        if len(self._kinds) * len(self.node_enu_m) ** 2 > MOST_LEGS:
            raise TooManyLegsError(len(self.node_enu_m), len(self._kinds))
        self.kind: IntArray = np.array(kind, dtype=np.int32)
        """(n_uav,) row of the tables of legs."""
        self.leg_s: FloatArray = self._leg_s()
        """(n_kind, n_node, n_node) times of legs [s]."""
        self.line_s: FloatArray = np.zeros((len(kinds), len(tasks), 2))
        """(n_kind, n_task, 2) times along lines, forwards and backwards [s]; infinite: through
        zones."""
        for row, (model, _) in enumerate(self._kinds):
            _add_lines_s(model, flown, self.line_s[row])
            if self._airspace.zones:
                self.line_s[row, self._cut_off(self._layers_m[kind.index(row)])] = np.inf
        self.home_s, self.home = self._homes(len(mission.bases))
        self.time_frac: FloatArray = np.ones(len(uavs))
        """(n_uav,) multiples of these times that are in the tables."""
        self.land_s: FloatArray = np.zeros(len(uavs))
        """(n_uav,) landings that are in the times of legs to starts and bases [s]."""
        self.climb_s: FloatArray = np.zeros(len(uavs))
        """(n_uav,) climbs that are in the times of legs from bases [s]."""
        self._n_home = len(uavs) + len(mission.bases)

    def calibrated(
        self,
        time_frac: Sequence[float] | FloatArray,
        land_s: Sequence[float] | FloatArray | None = None,
        climb_s: Sequence[float] | FloatArray | None = None,
    ) -> FieldNetwork:
        """The same where legs and lines of each UAV take so many times as long.

        Legs to starts and bases end on the ground, those from bases begin there: these take so
        much longer. From a base to itself nobody flies.

        Whatever fits no more, as UAVs that flew alike no longer do, stays as it is.

        Args:
            time_frac: (n_uav,) multiples of the times here; > 0.
            land_s: (n_uav,) more to starts and bases [s]; when None, nothing.
            climb_s: (n_uav,) more from bases [s]; when None, nothing.
        """
        fracs = np.asarray(time_frac, dtype=np.float64)
        down_s, up_s = (
            np.zeros(len(fracs)) if each is None else np.asarray(each, dtype=np.float64)
            for each in (land_s, climb_s)
        )
        flown = zip(self.kind.tolist(), fracs.tolist(), down_s.tolist(), up_s.tolist(), strict=True)
        ways = list(flown)
        kinds = {way: row for row, way in enumerate(dict.fromkeys(ways))}
        alike = (fracs == 1.0).all() and not (down_s.any() or up_s.any())
        if alike or len(kinds) * len(self.node_enu_m) ** 2 > MOST_LEGS:
            return self
        same = copy.copy(self)
        before, each, down, up = (np.array(column) for column in zip(*kinds, strict=True))
        rows = before.astype(np.int32)
        same.kind = np.array([kinds[way] for way in ways], dtype=np.int32)
        same.leg_s = self.leg_s[rows] * each[:, None, None]
        same.line_s = self.line_s[rows] * each[:, None, None]
        same.home_s = self.home_s * fracs[:, None] + down_s[:, None]
        bases = range(len(self.kind), self._n_home)
        same.leg_s[:, :, : self._n_home] += down[:, None, None]
        same.leg_s[:, bases, :] += up[:, None, None]
        same.leg_s[:, bases, bases] = self.leg_s[rows][:, bases, bases] * each[:, None]
        same.time_frac = self.time_frac * fracs
        same.land_s = self.land_s + down_s
        same.climb_s = self.climb_s + up_s
        same._kinds = [self._kinds[row] for row in rows.tolist()]  # noqa: SLF001 -- its own copy
        return same

    def legs_from_s(
        self, uav: int, place_enu_m: Sequence[float] | FloatArray, flown_m: float | None = None
    ) -> FloatArray:
        """(n_node,) times of ``uav`` from anywhere to every node [s]; infinite: no way.

        Args:
            uav: its row.
            place_enu_m: (3,) place [m; ENU], its height as tasks give theirs, without the layer.
            flown_m: height there [m above the origin]; in the UAV's layer above it when None.
                The place's own height says that it is out of its layer.
        """
        model, network = self._kind_of(uav)
        placed = self._placed(uav, place_enu_m, flown_m)
        times_s: FloatArray = network.legs_from_one(*placed).times_s(model)[0]
        flown_s: FloatArray = times_s * self.time_frac[uav]
        flown_s[: self._n_home] += self.land_s[uav]
        return flown_s

    def corners_m(self, uav: int, begin: int, end: int) -> FloatArray | None:
        """(k, 3) places [m; ENU] of the leg between two nodes, both included; None: no way."""
        _, network = self._kind_of(uav)
        return network.legs.corners_m(begin, end)

    def flown_between_m(self, uav: int, begin: int, end: int) -> FloatArray | None:
        """The same with the heights at which ``uav`` flies them over the ground.

        None: there is no way, or nobody looks at the ground.
        """
        corners_m = None if self._ground is None else self.corners_m(uav, begin, end)
        if corners_m is None:
            return None
        out_of_layer = not self._in_layer[begin]
        return self.flown_enu_m(uav, corners_m, end, out_of_layer=out_of_layer)

    def corners_from_m(
        self,
        uav: int,
        place_enu_m: Sequence[float] | FloatArray,
        end: int,
        flown_m: float | None = None,
    ) -> FloatArray | None:
        """The same from anywhere, as `legs_from_s` has it, to a node."""
        _, network = self._kind_of(uav)
        return network.legs_from_one(*self._placed(uav, place_enu_m, flown_m)).corners_m(0, end)

    def flown_enu_m(
        self, uav: int, corners_enu_m: FloatArray, end: int, *, out_of_layer: bool = False
    ) -> FloatArray:
        """(k, 3) corners [m; ENU] of a leg to a node, with the heights at which ``uav`` flies them.

        Its layer is added where it keeps to it: at the beginning, and at the end unless the task
        there gives its own height. In between height is gained evenly.

        Args:
            uav: its row.
            corners_enu_m: (k, 3) as `corners_from_m` gives them.
            end: the node.
            out_of_layer: that the height of the first corner is the one flown.
        """
        layer_m = self._layers_m[uav]
        piece_m = np.hypot(*np.diff(corners_enu_m[:, :2], axis=0).T)
        along_m = np.concatenate([[0.0], np.cumsum(piece_m)])
        share = along_m / along_m[-1] if along_m[-1] > 0.0 else np.ones(len(along_m))
        flown_m = corners_enu_m.copy()
        if out_of_layer:
            flown_m[:, 2] += layer_m * share if self._in_layer[end] else 0.0
        else:
            flown_m[:, 2] += layer_m if self._in_layer[end] else layer_m * (1.0 - share)
        return flown_m

    def rooms_m(self, uav: int, end: int, *, out_of_layer: bool) -> tuple[float, float]:
        """What a way of ``uav`` to a node keeps above the ground at its ends, layers included."""
        layer_m, room_m = self._layers_m[uav], self._room_m
        return room_m if out_of_layer else layer_m, layer_m if self._in_layer[end] else room_m

    def way_out_m(
        self, uav: int, place_enu_m: Sequence[float] | FloatArray
    ) -> tuple[float, float, float] | None:
        """The nearest place outside of all zones [m; ENU], as heights are given; None: it is one.

        Whoever has nowhere to go is told where it is.
        """
        place_m, low_m, high_m, _ = self._placed(uav, place_enu_m)
        out_m, free = self._airspace.concerning(low_m, high_m).way_out_m(place_m[:, :2])
        return None if free[0] else (float(out_m[0, 0]), float(out_m[0, 1]), float(place_m[0, 2]))

    def is_clear(self, begin_enu_m: Sequence[float], end_enu_m: Sequence[float]) -> bool:
        """Whether straight on from place to place [m] leads through no zone, however high."""
        planner = self._airspace.concerning(-np.inf, np.inf)
        begin_m, end_m = (np.array([place[:2]]) for place in (begin_enu_m, end_enu_m))
        return bool(planner.clear(begin_m, end_m)[0] and planner.free(end_m)[0])

    def _kind_of(self, uav: int) -> tuple[FlightModel, LegNetwork]:
        return self._kinds[int(self.kind[uav])]

    def _placed(
        self, uav: int, place_enu_m: Sequence[float] | FloatArray, flown_m: float | None = None
    ) -> tuple[FloatArray, float, float, float]:
        """The place, lowest and greatest height there, and what it keeps above the ground [m]."""
        place_m = np.asarray(place_enu_m, dtype=np.float64).reshape(1, 3)
        if self._band_m is not None:
            return place_m, *self._band_m, self._room_m if flown_m == place_m[0, 2] else 0.0
        height_m = float(place_m[0, 2]) + self._layers_m[uav] if flown_m is None else flown_m
        return place_m, height_m, height_m, 0.0

    @property
    def _room_m(self) -> float:
        """What UAVs out of their layers keep above the ground [m]; in a layer that is the layer."""
        return 0.0 if self._ground is None else self._ground.terrain.planned_m

    def _heights_m(
        self, layer_m: float, place_m: FloatArray, in_layer: npt.NDArray[np.bool_]
    ) -> tuple[FloatArray, FloatArray]:
        """(n,) lowest and greatest heights that a UAV may use at places [m above the origin]."""
        up_m = place_m[:, 2]
        if self._band_m is not None:
            low_m, high_m = self._band_m
            return np.full_like(up_m, low_m), np.full_like(up_m, high_m)
        flown_m = np.where(in_layer, up_m + layer_m, up_m)
        return flown_m, flown_m

    def _cut_off(self, layer_m: float) -> IntArray:
        """Columns of the lines that lead through a zone which concerns who flies in that layer."""
        lines = self._lines
        low_m, high_m = self._heights_m(layer_m, lines.point_m, lines.in_layer)
        low_m = np.minimum(low_m[lines.piece], low_m[lines.piece + 1])
        high_m = np.maximum(high_m[lines.piece], high_m[lines.piece + 1])
        cut = np.zeros(len(lines.piece), dtype=np.bool_)
        for bounds_m in sorted(set(zip(low_m.tolist(), high_m.tolist(), strict=True))):
            alike = (low_m == bounds_m[0]) & (high_m == bounds_m[1])
            ends_m = lines.point_m[lines.piece[alike]], lines.point_m[lines.piece[alike] + 1]
            planner = self._airspace.concerning(*bounds_m)
            cut[alike] = ~planner.clear(ends_m[0][:, :2], ends_m[1][:, :2])
        return np.unique(lines.column[lines.piece[cut]])

    def _sides(self, low_m: FloatArray, high_m: FloatArray) -> bytes:
        """On which sides of all zones' floors and ceilings the nodes lie."""
        zones = self._airspace.zones
        below = low_m[:, None] < np.array([zone.top_m for zone in zones])
        above = high_m[:, None] > np.array([zone.bottom_m for zone in zones])
        return below.tobytes() + above.tobytes()

    def _leg_s(self) -> FloatArray:
        n_node = len(self.node_enu_m)
        tables_s = [network.legs.times_s(model) for model, network in self._kinds]
        if len(tables_s) == 1:  # the largest array of all is not copied
            return tables_s[0][None]
        return np.array(tables_s).reshape(-1, n_node, n_node)

    def _homes(self, n_base: int) -> tuple[FloatArray, IntArray]:
        """(n_uav, n_node) times to the nearest base or own start [s], and which that is.

        Of those that are as near the start goes first, then the mission's order.
        """
        n_uav, n_node = len(self.kind), len(self.node_enu_m)
        home_s = np.empty((n_uav, n_node))
        home = np.empty((n_uav, n_node), dtype=np.int32)
        for uav in range(n_uav):
            ends = [uav, *range(n_uav, n_uav + n_base)]
            to_s = self.leg_s[self.kind[uav]][:, ends]
            nearest = to_s.argmin(axis=1)
            home[uav] = nearest + START
            home_s[uav] = to_s[np.arange(n_node), nearest]
        return home_s, home


def _layers_m(mission: Mission, uavs: Sequence[Uav]) -> list[float]:
    layers = layers_over(mission.terrain)
    places = {uav.id: index for index, uav in enumerate(mission.uavs)}
    return [
        layers.layer_of_m(uav.vehicle, places.get(uav.id, row))
        if uav.layer_m is None
        else uav.layer_m
        for row, uav in enumerate(uavs)
    ]


def _nodes(
    uavs: Sequence[Uav],
    bases: Sequence[Base],
    tasks: Sequence[Task],
    flown: Sequence[Sequence[Point]],
) -> tuple[FloatArray, IntArray, npt.NDArray[np.bool_]]:
    """(n_node, 3) places [m], (n_task, 2) nodes, (n_node,) whether UAVs keep to their layers there.

    Heights of places are those that the mission gives.
    """
    places = [uav.position_enu_m for uav in uavs] + [base.position_enu_m for base in bases]
    in_layer = [True] * len(places)
    enter = []
    for task, points in zip(tasks, flown, strict=True):
        ends = points[:: max(1, len(points) - 1)]
        enter.append((len(places), len(places) + len(ends) - 1))
        places += ends
        in_layer += [task.height_m is None] * len(ends)
    return (
        np.array(places, dtype=np.float64).reshape(-1, 3),
        np.array(enter, dtype=np.int32).reshape(-1, 2),
        np.array(in_layer, dtype=np.bool_),
    )


class _Lines:
    """The lines among tasks, point by point."""

    def __init__(self, tasks: Sequence[Task], flown: Sequence[Sequence[Point]]) -> None:
        lines = [(column, flown[column]) for column, task in enumerate(tasks) if task.path_enu_m]
        column = [each for each, line in lines for _ in line]
        points = [point for _, line in lines for point in line]
        self.column: IntArray = np.array(column, dtype=np.int32)
        """(k,) whose point it is."""
        self.point_m: FloatArray = np.array(points, dtype=np.float64).reshape(-1, 3)
        """(k, 3) places [m; ENU], heights as the mission gives them."""
        self.in_layer = np.array([tasks[each].height_m is None for each in column], dtype=np.bool_)
        """(k,) whether UAVs keep to their layers there."""
        self.piece: IntArray = np.flatnonzero(np.diff(self.column) == 0).astype(np.int32)
        """First points of straight pieces."""


def _points(task: Task, ground: Ground | None) -> Sequence[Point]:
    """Where a task is flown, a place as one point; height_m goes before what points say.

    Over the ground it counts from there, lines follow it, and layers are still to be added.
    """
    points = task.path_enu_m or (task.position_enu_m,)
    if ground is not None:
        return points_over(ground, points, task.height_m)
    if task.height_m is None:
        return points
    return [(east_m, north_m, task.height_m) for east_m, north_m, _ in points]


def points_over(
    ground: Ground, points: Sequence[Point], height_m: float | None
) -> tuple[Point, ...]:
    """Where a place or a line is flown that high above the ground, or without its layer [m].

    Never lower than paths are planned: whoever posts tasks may not know of the ground.
    """
    flat_m = np.array(points, dtype=np.float64)[:, :2]
    if len(points) == 1:
        flown_m = np.column_stack([flat_m, ground.up_m(np.ascontiguousarray(flat_m))])
    else:
        flown_m = ground.along_m(flat_m)
    if height_m is not None:
        flown_m[:, 2] += max(height_m, ground.terrain.planned_m)
    return tuple((east_m, north_m, up_m) for east_m, north_m, up_m in flown_m.tolist())


def _zones_over(ground: Ground, mission: Mission, layer_m: float) -> list[Zone]:
    """Those of the mission's zones that what flies over the ground could be as high as."""
    heights_m = [task.height_m for task in mission.tasks if task.height_m is not None]
    everywhere = (-np.inf, -np.inf, np.inf, np.inf)
    high_m = ground.range_m(*everywhere)[1] + max(layer_m, *heights_m, 0.0) + _HIGHER_M
    concerned = []
    for zone in mission.zones:
        margin_m = mission.zone_margin_m
        corners_m = np.array(zone.polygon_enu_m)
        around = *(corners_m.min(axis=0) - margin_m), *(corners_m.max(axis=0) + margin_m)
        low_m = ground.range_m(*(everywhere if zone.inclusive else around))[0]
        if zone.concerns(low_m + ground.terrain.clearance_m, high_m):
            concerned.append(zone)
    return concerned


def flight_model(uav: Uav, wind_enu_m_s: tuple[float, float]) -> FlightModel:
    """How ``uav`` flies in that wind [m/s; east, north]."""
    from swarm.allocation.legs import FlightModel

    airspeed_m_s, speed_m_s = uav.airspeed_m_s, uav.speed_m_s
    if airspeed_m_s is None:
        return FlightModel(speed_m_s, uav.acceleration_m_s2)
    if not any(wind_enu_m_s):  # in calm air direction is no matter
        return FlightModel(min(speed_m_s, airspeed_m_s), uav.acceleration_m_s2)
    return FlightModel(speed_m_s, uav.acceleration_m_s2, airspeed_m_s, wind_enu_m_s)


def _add_lines_s(model: FlightModel, flown: Sequence[Sequence[Point]], line_s: FloatArray) -> None:
    """Set the (n_task, 2) times of those tasks that are lines, by all their points [s]."""
    straight = [index for index, points in enumerate(flown) if len(points) == 2]
    for index, points in enumerate(flown):
        if len(points) > 2:
            path_m = np.array(points, dtype=np.float64)
            line_s[index] = model.path_s(path_m), model.path_s(path_m[::-1])
            if not model.heeds_direction:  # sums of pieces may differ in their last bit
                line_s[index, 1] = line_s[index, 0]
    if straight:
        ends_m = np.array([flown[index] for index in straight], dtype=np.float64)
        offset_m = (ends_m[:, 1] - ends_m[:, 0]).T
        line_s[straight, 0] = model.straight_s(offset_m)
        line_s[straight, 1] = model.straight_s(-offset_m)
