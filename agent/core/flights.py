"""Where one UAV's vehicle is sent, and which way: straight, or round what is to be kept out of.

Of a plain mission all ways are straight. With the field's constraints they are those by which
decisions are made, so a UAV flies what it reckoned with. Leaves out: why it flies there.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from agent.core.calibration import FlightMeter
from agent.core.context import AgentContext, AgentPart
from agent.core.interface import GoTo, Ready, Return, Swap
from agent.core.path_clearance import PathClearance
from swarm.allocation import field
from swarm.allocation.problem import rest_to_rest_s
from swarm.model import TaskId, UavId
from swarm.protocol.field_messages import BaseSpec, ZoneSpec
from swarm.protocol.fields import Point
from swarm.protocol.messages import TaskEntry, UavSpec
from swarm.protocol.operator_commands import zones_in_force
from swarm.separation.slabs import planned_apart_m
from swarm.survey.structures import structure_middle_m

if TYPE_CHECKING:
    from swarm.allocation.legs.ground import Ground

_AT_BASE_M = 25.0
"""Who is no farther from a base, or from its own spot there, is at it: agent.vehicle.standing."""


@dataclass(frozen=True, slots=True)
class HomeFlight:
    """The way home of a UAV, to the nearest base or its own start."""

    via_enu_m: tuple[Point, ...]
    """Corners on the way [m; mission origin, heights included]."""
    target_enu_m: Point
    """Above where it lands [m; alike]."""
    base: str | None
    """Which base that is; None: its own start."""
    duration_s: float
    lands: bool = True
    """It lands there: where there are bases, its own way may lead to one that it took off from."""


class Flights(AgentPart):
    """Orders one UAV's vehicle from place to place."""

    def __init__(self, context: AgentContext) -> None:
        super().__init__(context)
        self.leg = 0
        """Number of the last order to fly somewhere; what the vehicle says of others is late."""
        self.meter = FlightMeter(context)
        """Is told of every leg."""
        context.airway.when_departed = self.meter.depart_late
        context.airway.when_detoured = self.meter.disturb
        context.airway.last_departure.sortie_end_s = lambda: self.meter.sortie.end_s
        context.airway.last_departure.drain_frac = lambda: self.meter.cautious_drain_frac
        self._zones: tuple[ZoneSpec, ...] = ()
        self._home: HomeFlight | None = None
        self._home_from: object = None
        """Place and problem of that way home."""
        self._clearance_m = context.path_clearance_m
        self._clearance: PathClearance | None = None
        self._clearance_of: field.FieldProblem | None = None
        self._verticals = context.verticals
        self._spots: dict[str, Point] = {}
        """By base, where it lands."""
        self._spots_of: object = None
        """The brief by which that is."""

    # -- what is known of the field -------------------------------------------------------

    @property
    def problem(self) -> field.FieldProblem | None:
        """Of a mission with the field's constraints in which this UAV is; None of a plain one."""
        problem = self._mission_view.board.field_problem
        return problem if problem is not None and self._uav in problem.uav_ids else None

    def base(self, name: str) -> BaseSpec | None:
        """That base as the brief has it; None: there is none."""
        brief = self._replica.brief
        bases = () if brief is None else brief.bases
        return next((base for base in bases if base.id == name), None)

    def spot(self, base: BaseSpec) -> Point:
        """Where this UAV lands at that base [m; on the ground]: each of a fleet elsewhere."""
        brief = self._replica.brief
        if self._verticals is None or brief is None:
            return base.position_enu_m
        if self._spots_of is not brief:
            self._spots, self._spots_of = {}, brief
        if base.id not in self._spots:
            fleet = [uav.id for uav in brief.uavs]
            verticals, least_m = self._verticals, brief.separation_m
            if least_m is not None:  # nobody lands or takes off too near to anybody else there
                apart_m = max(verticals.apart_m, planned_apart_m(least_m))
                verticals = replace(verticals, apart_m=apart_m)
            spot = verticals.spot(
                base.position_enu_m,
                fleet.index(self._uav) if self._uav in fleet else 0,
                [uav.position_enu_m for uav in brief.uavs],
                [zone.zone() for zone in brief.zones],
                brief.zone_margin_m,
            )
            if self.ground is not None:
                spot = _over(self.ground, [spot], None)[0]
            self._spots[base.id] = spot
        return self._spots[base.id]

    def base_here(self) -> BaseSpec | None:
        """The base at which the vehicle is, by where it was told last, seen from above."""
        brief, telemetry = self._replica.brief, self._mission_view.telemetry
        if brief is None or telemetry is None:
            return None
        flat_m = telemetry.position_enu_m[:2]
        near = [
            (
                min(
                    math.dist(flat_m, place[:2]) for place in (base.position_enu_m, self.spot(base))
                ),
                base,
            )
            for base in brief.bases
        ]
        away_m, nearest = min(near, key=_distance, default=(math.inf, None))
        return nearest if away_m <= _AT_BASE_M else None

    @property
    def land_s(self) -> float:
        """How long it takes from above a base until it has landed, as predictions have it [s]."""
        problem = self.problem
        return 0.0 if problem is None else problem.landing_s(self._row(problem), 0)

    @property
    def climb_s(self) -> float:
        """How long it takes from a base to where its legs begin, likewise [s]."""
        problem = self.problem
        if problem is None or problem.network is None:
            return 0.0
        return float(problem.network.climb_s[self._row(problem)])

    @property
    def ground(self) -> Ground | None:
        """The ground of the brief; None: nobody looks at it."""
        brief = self._replica.brief
        if brief is None or brief.terrain is None:
            return None
        from swarm.allocation.legs.ground import ground_of

        return ground_of(brief.terrain.terrain())

    def points(self, task: TaskEntry, *, backwards: bool) -> tuple[Point, ...]:
        """A task from its beginning to its end in that direction, as heights are given."""
        points, ground = task.path_enu_m or (task.position_enu_m,), self.ground
        if ground is not None:
            points = _over(ground, points, task.height_m)
        elif task.height_m is not None:
            points = tuple((east, north, task.height_m) for east, north, _ in points)
        return points[::-1] if backwards else points

    def reached(self, place_enu_m: Point, task: TaskEntry) -> None:
        """The vehicle is at one end of a task, in its layer or at the height that it asks for."""
        self._mission_view.arrive(place_enu_m, own_height=task.height_m is not None)

    def zones_changed(self) -> bool:
        """Whether other zones are in force than when this was last asked, and ways may be wrong.

        Where UAVs are kept apart a way round what is gone is still the best: another one would have
        to be asked for from a stop.
        """
        before, self._zones = self._zones, zones_in_force(self._replica)
        if self._keeps_apart and set(before).issuperset(self._zones):
            return False
        return before != self._zones

    def nodes(self, task: str, *, backwards: bool) -> tuple[int, int] | None:
        """Nodes where that task begins and ends in that direction; None: the problem lacks it."""
        problem = self.problem
        if problem is None or task not in problem.task_ids:
            return None
        column = problem.task_ids.index(TaskId(task))
        return field.task_nodes(problem, column, backwards=backwards)

    def line_s(self, task: str, *, backwards: bool) -> float:
        """Time along that task's line [s]; 0 of a place."""
        problem = self.problem
        if problem is None or task not in problem.task_ids:
            return 0.0
        column = problem.task_ids.index(TaskId(task))
        return float(problem.line_s[problem.kind[self._row(problem)], column, int(backwards)])

    def home_s(self, node: int) -> float:
        """Time home from a node of the problem [s]."""
        problem = self.problem
        return 0.0 if problem is None else float(problem.home_s[self._row(problem), node])

    def way_to_task(self, task: str, *, backwards: bool) -> field.Way | None:
        """From where the UAV is to where that task begins; None: there is none."""
        nodes = self.nodes(task, backwards=backwards)
        return None if nodes is None else self._way(nodes[0])

    def way_to_base(self, base: str) -> field.Way | None:
        """From where the UAV is to above that base; None: there is none."""
        problem = self.problem
        if problem is None or base not in problem.base_ids:
            return None
        return self._way(field.base_node(problem, base))

    def way_home(self) -> HomeFlight | None:
        """From where the UAV is; None where that is not known, or there is none."""
        problem, place_enu_m = self.problem, self._mission_view.place_enu_m
        if place_enu_m is None:
            return None
        if problem is None:
            return self._straight_home(place_enu_m) if self._keeps_apart else None
        flown_m = self._mission_view.flown_m
        if self._home_from != (place_enu_m, flown_m, problem):
            way = self._widened(field.way_home(problem, self._row(problem), place_enu_m, flown_m))
            self._home_from = place_enu_m, flown_m, problem
            self._home = (
                None
                if way is None
                else HomeFlight(
                    way.via_enu_m, way.end_enu_m, way.base, way.duration_s, self._lands_by_itself
                )
            )
        return self._home

    @property
    def _lands_by_itself(self) -> bool:
        """Whether the way home ends with a landing right there, and not in the return mode.

        That leads to where it took off last, and up to a height of its own before, past others.
        """
        problem = self.problem
        to_bases = problem is not None and problem.n_base > 0
        return to_bases or (self._keeps_apart and self._verticals is not None)

    @property
    def _keeps_apart(self) -> bool:
        """Whether the fleet shares its air."""
        brief = self._replica.brief
        return brief is not None and brief.separation_m is not None

    def _straight_home(self, place_enu_m: Point) -> HomeFlight | None:
        """To the own start, of a mission in which nothing but its fleet is in the way."""
        me = self._mission_view.me
        if me is None:
            return None
        length_m = np.array([math.dist(place_enu_m, me.position_enu_m)])
        speed_m_s, acceleration_m_s2 = self._told_motion(me)
        duration_s = float(rest_to_rest_s(length_m, speed_m_s, acceleration_m_s2 or math.inf)[0])
        end_enu_m = self._mission_view.in_layer(me.position_enu_m)
        return HomeFlight((), end_enu_m, None, duration_s, self._lands_by_itself)

    def way_out(self) -> Point | None:
        """Where the UAV leaves the zone that it is in, as high as it flies; None: it is in none."""
        problem, place_enu_m = self.problem, self._mission_view.place_enu_m
        if problem is None or problem.network is None or place_enu_m is None:
            return None
        out_m = problem.network.way_out_m(self._row(problem), place_enu_m)
        if out_m is None or self._mission_view.flown_m is not None:
            return out_m
        return self._mission_view.in_layer(out_m)

    def _way(self, node: int) -> field.Way | None:
        problem, place_enu_m = self.problem, self._mission_view.place_enu_m
        if problem is None or place_enu_m is None:
            return None
        row, flown_m = self._row(problem), self._mission_view.flown_m
        way = self._widened(field.way_to(problem, row, place_enu_m, node, flown_m))
        if way is None or not self._mission_view.stands:
            return way
        climb_s = self.climb_s
        way = replace(way, duration_s=way.duration_s + climb_s, upright_s=way.upright_s + climb_s)
        if self.ground is None:
            return way
        # A vehicle climbs to the height of what it is sent to first; from where a way over a slope
        # begins, it may go down.
        begin_enu_m = self._mission_view.in_layer(self._standing_m(place_enu_m))
        return replace(way, via_enu_m=(begin_enu_m, *way.via_enu_m))

    def _widened(self, way: field.Way | None) -> field.Way | None:
        """That way as a vehicle is led that does not fly quite where it is told, to its spot."""
        problem, brief, place_enu_m = (
            self.problem,
            self._replica.brief,
            self._mission_view.place_enu_m,
        )
        base = None if way is None or way.base is None else self.base(way.base)
        if way is not None and base is not None and self._verticals is not None:
            way = replace(way, end_enu_m=self._mission_view.in_layer(self.spot(base)))
        if way is None or not self._clearance_m or brief is None or place_enu_m is None:
            return way
        if self._clearance is None or self._clearance_of is not problem:
            zones = [zone.zone() for zone in zones_in_force(self._replica)]
            margin_m = brief.zone_margin_m
            self._clearance = PathClearance(zones, margin_m, self._clearance_m)
            self._clearance_of = problem
        begin_enu_m = self._standing_m(place_enu_m)
        if self._mission_view.flown_m is None:
            begin_enu_m = self._mission_view.in_layer(begin_enu_m)
        points = self._clearance.widened((begin_enu_m, *way.via_enu_m, way.end_enu_m))
        return replace(way, via_enu_m=self._over_ground(points, way.node)[1:-1])

    def _over_ground(self, points: tuple[Point, ...], node: int) -> tuple[Point, ...]:
        """A way that was led otherwise than it was planned, at the heights that it now takes."""
        ground, problem = self.ground, self.problem
        if ground is None or problem is None or problem.network is None:
            return points
        out_of_layer = self._mission_view.flown_m is not None
        rooms_m = problem.network.rooms_m(self._row(problem), node, out_of_layer=out_of_layer)
        flat_m = np.array(points)[:, :2]
        path_m = ground.over_m(flat_m, (points[0][2], points[-1][2]), rooms_m)
        return tuple((east, north, up) for east, north, up in path_m.tolist())

    def _standing_m(self, place_enu_m: Point) -> Point:
        """Where it really is whose place is reckoned to be a base's."""
        brief, telemetry = self._replica.brief, self._mission_view.telemetry
        if self._verticals is None or brief is None or telemetry is None:
            return place_enu_m
        return next(
            (self.spot(base) for base in brief.bases if base.position_enu_m == place_enu_m),
            place_enu_m,
        )

    def _row(self, problem: field.FieldProblem) -> int:
        return problem.uav_ids.index(UavId(self._uav))

    # -- orders ---------------------------------------------------------------------------

    def to_task(self, task: TaskEntry, attempt: int, *, idled: bool = False) -> None:
        """Fly straight to a task, and stay as long as its service takes."""
        self.leg += 1
        self.meter.depart(self.leg, self._straight_s(task.position_enu_m))
        place_enu_m = self._mission_view.in_layer(task.position_enu_m)
        self._mission_view.set_off()
        goes = GoTo(self.leg, place_enu_m, task.service_s, idled, task.task, attempt)
        self._order(goes)

    def along(
        self,
        way: field.Way,
        task: TaskEntry | None,
        attempt: int,
        stay_s: float,
        *,
        idled: bool = False,
    ) -> None:
        """Fly that way, to a task or above a base."""
        self.leg += 1
        flown_s = way.duration_s - way.upright_s
        self._mission_view.set_off()
        self.meter.depart(self.leg, flown_s / self._time_frac())
        name = None if task is None else task.task
        via_enu_m = way.via_enu_m
        trigger_m = None if task is None or task.trigger_m is None else 0.0  # along the line only
        goes = GoTo(self.leg, way.end_enu_m, stay_s, idled, name, attempt, via_enu_m, trigger_m)
        own_height = task is not None and task.height_m is not None
        self._order(goes, own_height=own_height, takes_s=way.duration_s)

    def along_line(self, task: TaskEntry, attempt: int, *, backwards: bool) -> Point:
        """Fly the line of a task from end to end; gives where that is, without the layer."""
        points = self.points(task, backwards=backwards)
        flown = [self._flown(task, point) for point in points]
        self.leg += 1
        line_s = self.line_s(task.task, backwards=backwards)
        self.meter.depart(self.leg, line_s / self._time_frac())
        via_enu_m, stay_s = tuple(flown[1:-1]), task.service_s
        name, trigger_m = task.task, task.trigger_m
        own_height = task.height_m is not None
        goes = GoTo(self.leg, flown[-1], stay_s, False, name, attempt, via_enu_m, trigger_m)
        goes = replace(goes, look_at_m=structure_middle_m(task.kind, flown))
        self._order(goes, own_height=own_height, fixed=own_height)
        return points[-1]

    def _time_frac(self) -> float:
        """Of its times as the brief has them, what ways take by the problem."""
        problem = self.problem
        if problem is None or problem.network is None:
            return 1.0
        return float(problem.network.time_frac[self._row(problem)])

    def _straight_s(self, stop_enu_m: Point) -> float | None:
        """Time of a straight leg from where the UAV is, by brief and parameters [s].

        None: nobody can tell.
        """
        me, place_enu_m = self._mission_view.me, self._mission_view.place_enu_m
        if me is None or place_enu_m is None:
            return None
        speed_m_s, acceleration_m_s2 = self._told_motion(me)
        if acceleration_m_s2 is None:
            return None
        length_m = np.array([math.dist(place_enu_m, stop_enu_m)])
        return float(rest_to_rest_s(length_m, speed_m_s, acceleration_m_s2)[0])

    def _told_motion(self, me: UavSpec) -> tuple[float, float | None]:
        """Speed [m/s] and acceleration [m/s²; None: none is given] by parameters and brief."""
        rates = self.meter.rates
        return rates.speed_m_s or me.speed_m_s, rates.acceleration_m_s2 or me.acceleration_m_s2

    def _flown(self, task: TaskEntry, point: Point) -> Point:
        return point if task.height_m is not None else self._mission_view.in_layer(point)

    def stop(self) -> None:
        """Hover where the vehicle is; in a zone, by the shortest way out of it."""
        telemetry, ground = self._mission_view.telemetry, self.ground
        if telemetry is None:
            return
        here = self._airway.stop_enu_m or telemetry.position_enu_m
        there = self.way_out() or here
        via_enu_m: tuple[Point, ...] = ()
        if ground is not None and there[:2] != here[:2]:
            room_m = ground.terrain.planned_m
            east, north, up = _over(ground, [there], room_m)[0]
            there = east, north, max(up, there[2])
            flat_m = np.array([here[:2], there[:2]])
            path_m = ground.over_m(flat_m, (here[2], there[2]), (room_m, room_m))
            via_enu_m = tuple((east, north, up) for east, north, up in path_m[1:-1].tolist())
        self.leg += 1
        self.meter.depart(self.leg)
        self._order(GoTo(self.leg, there, via_enu_m=via_enu_m))

    def swap(self, base: BaseSpec) -> None:
        """Land at a base, and get another battery."""
        self.leg += 1
        self.meter.land()
        me = self._mission_view.me
        speed_m_s = None if me is None else me.speed_m_s
        self._order(Swap(self.leg, self.spot(base), base.swap_s, speed_m_s))

    def let_start(self) -> None:
        """A person has seen to the vehicle, which stands at a base."""
        self._order(Ready(self.leg))

    def land_beside(self, base: BaseSpec, *, resume: bool = False) -> None:
        """Land at a base without taking any of its slots; it may be down (``resume``)."""
        self.meter.land()
        self.leg += 1  # nothing is heard any more of how it came there
        above_enu_m = self._mission_view.in_layer(self.spot(base))
        reason = f"its battery is used up, and no slot of base {base.id} is free"
        self._order(Return(reason, resume, via_enu_m=above_enu_m, land=True))


def _over(ground: Ground, points: Sequence[Point], height_m: float | None) -> tuple[Point, ...]:
    from swarm.allocation.field.network import points_over  # plain missions start sooner without

    return points_over(ground, points, height_m)


def _distance(near: tuple[float, BaseSpec]) -> float:
    return near[0]
