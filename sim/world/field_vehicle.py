"""A vehicle in virtual time for missions in the field: corners, wind, batteries, landings.

It flies paths in the times that are planned for them, drains its battery by airborne time, lands
for another one, and falls out of the sky when it is empty. In a realization it flies at its own
speed and not quite where it thinks, as `StochasticVehicle` does; with position errors it is never
quite where it thinks.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

from agent.core.interface import (
    Arrived,
    AttemptFailed,
    GoTo,
    Held,
    Hold,
    Home,
    Landed,
    Prepare,
    Refused,
    Return,
    Swap,
    Swapped,
    Telemetry,
    VehicleOrder,
    VehicleReport,
    VehicleWord,
)
from sim.world.base_places import SAME_PLACE_M, base_at
from sim.world.battery import FlightBattery
from sim.world.engine import EventQueue
from sim.world.field_paths import FieldPaths
from sim.world.flown_path import FlownPath
from sim.world.motion import Point, between, minus, plus
from sim.world.track import drifting
from sim.world.uncertainty import Realization
from sim.world.vehicles import SimulatedVehicle, TracedVehicle, VehicleFactory
from swarm.model import Mission

_AT_REST: Point = (0.0, 0.0, 0.0)
_ABOVE_M = 0.5
"""Who is nearer than that to a place, seen from above, is there [m]."""
_MOMENT_S = 0.5
"""Its agent knows where it was so long ago, or later, and tells it to stop there [s]."""
_TOLERANCE_S = 1e-6
"""Limits are inclusive: who lands at the very instant at which its battery is empty has landed."""


class FieldVehicle(TracedVehicle):
    """One vehicle, airborne ``takeoff_s`` after it is told to.

    Args:
        queue: virtual time.
        uav: its name.
        report: is called with everything the vehicle says, at the time it says it.
        paths: of its mission.
        takeoff_s: from the order to prepare to the report that it is ready.
        fate: what comes true; None for an ideal one.
        errors: from where it believes to be to where it is, at first and at the end of each of its
            ways [m]; between them that changes evenly. None for one that knows where it is.
    """

    def __init__(
        self,
        queue: EventQueue,
        uav: str,
        report: Callable[[VehicleReport], None],
        paths: FieldPaths,
        takeoff_s: float = 0.0,
        fate: Realization | None = None,
        errors: Iterator[Point] | None = None,
    ) -> None:
        super().__init__()
        self._queue, self._report, self._paths = queue, report, paths
        self._uav = paths.uav(uav)
        self._takeoff_s = takeoff_s
        self._fate = fate
        self._tasks = {str(task.id): task for task in paths.mission.tasks}
        endurance_s, charge_frac = self._uav.endurance_s, self._uav.charge_frac
        self.battery = None if endurance_s is None else FlightBattery(endurance_s, charge_frac)
        """None for one without an end."""
        if self.battery is not None and fate is not None:
            self.battery.drain = fate.uncertainty.drain_frac
        self._mission_runs = False
        self._layer_m = 0.0
        self._start_enu_m = self._uav.position_enu_m
        self._path: FlownPath | None = None
        self._leaves_s = 0.0
        self._flown_for: str | None = None
        """The task to which that path leads."""
        self._place_enu_m: Point | None = None
        """Where it stands or hovers, if it flies nowhere; None before its first lift-off."""
        self._layers_m = 0.0, 0.0
        """What of its height is its layer's at both ends of its path."""
        self._flies = False
        self._swap_ends_s = -math.inf
        self._swapped = False
        """Whether it stands with another battery, or is about to get one."""
        self._errors = errors
        self._astray_m = self._becomes_m = _AT_REST if errors is None else next(errors)
        """From where it believes to be to where it is, at both ends of its path [m]."""
        self._orders = 0

    # -- what it is told ----------------------------------------------------------------

    def order(self, order: VehicleOrder, ready: VehicleReport) -> None:
        """Obey ``order``; ``ready`` is what it says once it is prepared."""
        now_s = self._queue.now_s()
        if isinstance(order, VehicleWord):  # it is ready by itself, and knows the zones
            return
        if isinstance(order, GoTo) and self._swap_ends_s > now_s:
            self._refuse(order, "its battery is being changed")
            return
        if isinstance(order, Swap) and self._base_swap_s(order.position_enu_m) is None:
            self._refuse(order, "there is no base")
            return
        self._orders += 1
        if not self._keeps_on(order, now_s):
            self._rest(now_s)
        match order:
            case Prepare():
                self._prepare(order, ready, now_s)
            case GoTo() if self._place_enu_m is not None:
                self._go(order, now_s)
            case Swap() if self._place_enu_m is not None:
                self._land_for(order, now_s)
            case Hold():
                self._later(now_s, Held())
            case Return():
                self._go_home(order, now_s)
            case _:
                pass

    def begin_mission(self) -> None:
        """Mission time 0: from now on its battery drains in the air."""
        self._mission_runs = True
        if self._flies and self.battery is not None:
            self.battery.drains_since(self._queue.now_s())
            self._watch_battery()

    def drain_by(self, drain: float) -> None:
        """Let its battery drain so much faster than planned from now on."""
        if self.battery is not None:
            self.battery.drain_by(drain, self._queue.now_s())
            self._watch_battery()

    def leave(self) -> None:
        """Its agent has ended; it goes on with what it does."""

    def telemetry(self) -> Telemetry | None:
        """Where it believes to be; None before its first lift-off."""
        if self._place_enu_m is None:
            return None
        now_s = self._queue.now_s()
        place, velocity = self._place_enu_m, _AT_REST
        if self._path is not None:
            flown_s = now_s - self._leaves_s
            place = self._path.position_enu_m(flown_s)
            velocity = self._path.velocity_enu_m_s(flown_s)
        charge_frac = None if self.battery is None else self.battery.frac(now_s)
        return Telemetry(place, velocity, charge_frac)

    # -- what it does -------------------------------------------------------------------

    def _prepare(self, order: Prepare, ready: VehicleReport, now_s: float) -> None:
        self._layer_m = order.position_enu_m[2] - self._start_enu_m[2]
        if self._place_enu_m is None:
            self._place_enu_m = order.position_enu_m
            self._layers_m = self._layer_m, self._layer_m
            self._lift_off(now_s + self._takeoff_s)
            self._later(now_s + self._takeoff_s, ready)
        elif order.resume:
            telemetry = self.telemetry()
            if telemetry is not None:
                self._later(now_s, telemetry)
            self._later(now_s, ready)
        else:
            self._later(self._fly((), order.position_enu_m, None, now_s), ready)

    def _go(self, order: GoTo, now_s: float) -> None:
        task = self._tasks.get(order.task or "")
        arrives_s = self._fly(order.via_enu_m, order.position_enu_m, order.task, now_s)
        fate = self._fate
        if fate is not None and task and not fate.succeeds(self._uav, task, order.attempt):
            self._later(arrives_s, AttemptFailed(order.leg))
        self._later(arrives_s, Arrived(order.leg))

    def _land_for(self, order: Swap, now_s: float) -> None:
        """Land above where it is told to, and get another battery, unless it is at that."""
        arrives_s = now_s
        if self._flies:
            here, there = self._place_enu_m or order.position_enu_m, order.position_enu_m
            if math.dist(here[:2], there[:2]) > _ABOVE_M:
                above = (there[0], there[1], there[2] + self._layer_m)
                arrives_s = self._fly((), above, None, now_s)
        if arrives_s > now_s:
            self._unless_told(arrives_s, lambda: self._touch_down_for(order))
        else:
            self._touch_down_for(order)

    def _touch_down_for(self, order: Swap) -> None:
        now_s = self._queue.now_s()
        if self._flies or not self._swapped:
            if self._flies:
                self._touch_down(order.position_enu_m, now_s)
            self._swapped = True
            self._swap_ends_s = now_s + (self._base_swap_s(order.position_enu_m) or 0.0)
            self._queue.at(self._swap_ends_s, self._change_battery)
        self._later(now_s, Landed(order.leg))
        self._later(max(now_s, self._swap_ends_s), Swapped(order.leg))

    def _change_battery(self) -> None:
        if self.battery is not None and not self._flies:
            self.battery.fill()

    def _go_home(self, order: Return, now_s: float) -> None:
        """Fly and land where it is told to, else where it was launched; at once on the ground."""
        arrives_s = now_s
        if self._flies and self._place_enu_m is not None:
            *corners, stop = self._corners_of(order) or [self._place_enu_m]
            arrives_s = self._fly(tuple(corners), stop, None, now_s)
        self._unless_told(arrives_s, self._be_home)

    def _be_home(self) -> None:
        if self._flies and self._place_enu_m is not None:
            now_s = self._queue.now_s()
            self._rest(now_s)
            self._touch_down(self._ground_below(self._place_enu_m), now_s)
        self._report(Home())

    def _ground_below(self, place_enu_m: Point) -> Point:
        """Where it lands from there, which over a base or its start may be in any layer."""
        east_m, north_m, up_m = place_enu_m
        if (base := base_at(self._paths.mission.bases, place_enu_m)) is not None:
            return east_m, north_m, base.position_enu_m[2]
        if math.dist(self._start_enu_m[:2], place_enu_m[:2]) <= SAME_PLACE_M:
            return east_m, north_m, self._start_enu_m[2]
        return east_m, north_m, up_m - self._layer_m

    # -- motion -------------------------------------------------------------------------

    def _corners_of(self, order: GoTo | Return) -> tuple[Point, ...]:
        """Where it is told to fly [m]; nowhere if it is to land where it is."""
        if isinstance(order, GoTo):
            return *order.via_enu_m, order.position_enu_m
        corners = (*order.path_enu_m, *(() if order.via_enu_m is None else (order.via_enu_m,)))
        if order.land:
            return corners
        east_m, north_m, up_m = self._start_enu_m
        return *corners, (east_m, north_m, up_m + self._layer_m)

    def _keeps_on(self, order: VehicleOrder, now_s: float) -> bool:
        """Whether it is told to fly what is left of its way: it does not stop for that."""
        path = self._path
        if path is None or not isinstance(order, GoTo | Return):
            return False
        same = (order.task if isinstance(order, GoTo) else None) == self._flown_for
        return same and path.corners_ahead_enu_m(now_s - self._leaves_s) == self._corners_of(order)

    def _fly(
        self, via_enu_m: tuple[Point, ...], stop_enu_m: Point, name: str | None, now_s: float
    ) -> float:
        """Leave for a place along corners, from the ground straight up first; when it arrives."""
        if self._path is not None:  # it is on that way already
            return self._leaves_s + self._path.duration_s
        if not self._flies:
            self._climb(now_s)
        here = self._place_enu_m or stop_enu_m
        ends_m = self._layers_m[1], self._layer_m if self._paths.in_layer(name) else 0.0
        if name is None and not via_enu_m and self._is_just_past(stop_enu_m):
            ends_m = ends_m[0], ends_m[0]  # it stays where it is, which need not be in its layer
        path = self._paths.path(self._uav.id, (here, *via_enu_m, stop_enu_m), ends_m)
        self._layers_m, self._leaves_s, self._flown_for = ends_m, now_s, name
        self._becomes_m = self._stops_astray_m(name, path)
        pace = self.speed_frac * self._true_pace(name, path)
        self._path = path = path.lasting(path.duration_s / pace)
        true = drifting(path.pieces(now_s), self._astray_m, self._becomes_m)
        self.track.fly(true, plus(stop_enu_m, self._becomes_m), now_s)
        return now_s + path.duration_s

    def _is_just_past(self, place_enu_m: Point) -> bool:
        """Whether it was there a moment ago at the most, or is there."""
        here = self._place_enu_m
        moment_m = self._uav.speed_m_s * _MOMENT_S
        return here is not None and math.dist(here, place_enu_m) <= moment_m

    def _rest(self, now_s: float) -> None:
        """Stop where it is."""
        path = self._path
        if path is None or self._place_enu_m is None:
            return
        flown_s = now_s - self._leaves_s
        share = path.share(flown_s)
        time_frac = 1.0 if path.duration_s <= flown_s else flown_s / path.duration_s
        first_m, last_m = self._layers_m
        layer_m = last_m if share >= 1.0 else first_m + share * (last_m - first_m)
        self._layers_m = layer_m, layer_m
        self._astray_m = self._becomes_m = between(self._astray_m, self._becomes_m, time_frac)
        self._place_enu_m, self._path = path.position_enu_m(flown_s), None
        self.track.fly([], plus(self._place_enu_m, self._astray_m), now_s)

    def _climb(self, now_s: float) -> None:
        """Take off from where it stands, which takes no mission time."""
        if self._place_enu_m is not None:
            east_m, north_m, up_m = self._place_enu_m
            self._place_enu_m = east_m, north_m, up_m + self._layer_m
        self._layers_m = self._layer_m, self._layer_m
        self._lift_off(now_s)

    def _lift_off(self, at_s: float) -> None:
        self._flies, self._swapped = True, False
        if self._place_enu_m is not None:
            self.track.lift_off(plus(self._place_enu_m, self._astray_m), at_s)
        if self.battery is not None and self._mission_runs:
            self.battery.drains_since(at_s)
            self._watch_battery()

    def _touch_down(self, place_enu_m: Point, now_s: float) -> None:
        self._rest(now_s)
        self._flies, self._place_enu_m = False, place_enu_m
        self.track.touch_down(now_s)
        if self.battery is not None:
            self.battery.touch_down(now_s)

    # -- what becomes of it -------------------------------------------------------------

    def _watch_battery(self) -> None:
        """Look when the battery should be empty; what has changed it by then has looked anew."""
        if self.battery is not None and self.battery.empty_s < math.inf:
            self._queue.at(self.battery.empty_s + _TOLERANCE_S, self._fall_if_empty)

    def _fall_if_empty(self) -> None:
        battery, now_s = self.battery, self._queue.now_s()
        if battery is None or not self._flies or battery.empty_s + _TOLERANCE_S > now_s:
            return
        self._rest(now_s)
        self._orders += 1  # it says nothing any more
        self._flies = False
        self.track.touch_down(now_s)
        battery.touch_down(now_s)
        self.when_empty()

    def _stops_astray_m(self, name: str | None, path: FlownPath) -> Point:
        if self._errors is not None:
            return next(self._errors) if path.duration_s > 0.0 else self._astray_m
        task = self._tasks.get(name or "")
        if self._fate is None or task is None:
            return self._astray_m
        return minus(self._fate.stop_enu_m(self._uav.id, task), task.position_enu_m)

    def _true_pace(self, name: str | None, path: FlownPath) -> float:
        """How much faster it is than planned in a realization."""
        if self._fate is None:
            return 1.0
        task = self._tasks.get(name or "")
        ends = path.corners_enu_m[0], path.corners_enu_m[-1]
        known = None if task is None else task.id
        return self._fate.speed_m_s(self._uav, known, *ends) / self._uav.speed_m_s

    def _base_swap_s(self, place_enu_m: Point) -> float | None:
        """How long a battery takes to be changed there [s]; None: there is no base."""
        base = base_at(self._paths.mission.bases, place_enu_m)
        return None if base is None else base.swap_s

    def _refuse(self, order: VehicleOrder, reason: str) -> None:
        self._queue.after(0.0, lambda: self._report(Refused(order, reason)))

    def _later(self, time_s: float, report: VehicleReport) -> None:
        self._unless_told(time_s, lambda: self._report(report))

    def _unless_told(self, time_s: float, do: Callable[[], None]) -> None:
        """Do that then, unless another order has come in between."""
        order = self._orders

        def act() -> None:
            if order == self._orders:
                do()

        self._queue.at(time_s, act)


def field_vehicles(
    mission: Mission,
    takeoff_s: float = 0.0,
    fate: Realization | None = None,
    errors: Callable[[str], Iterator[Point]] | None = None,
) -> VehicleFactory:
    """Vehicles of the UAVs of a ``mission`` in the field; ideal ones without a realization.

    ``errors`` are those of the position of each UAV; see `FieldVehicle`.
    """
    paths = FieldPaths(mission)

    def make(
        queue: EventQueue, uav: str, report: Callable[[VehicleReport], None]
    ) -> SimulatedVehicle:
        astray = None if errors is None else errors(uav)
        return FieldVehicle(queue, uav, report, paths, takeoff_s, fate, astray)

    return make
