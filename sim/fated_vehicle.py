"""A vehicle that flies as a fate says: at its own speed, in wind, and not quite where it thinks.

It differs from the ideal one (sim.virtual_vehicle) in when it arrives, in where it then really
stands, and in attempts that fail. Its telemetry tells where it believes to be, so its agent
notices lateness and failures only. Leaves out: losses, which are the world's (sim.fated_world).
"""

from __future__ import annotations

import math
from collections.abc import Callable

from agent.vehicle import Arrived, AttemptFailed, GoTo, Orders, Report
from sim.event_queue import EventQueue
from sim.fate import Fate
from sim.kinematics import IdealMotion, Point
from sim.virtual_vehicle import VirtualVehicle
from swarm.model import UavId

__all__ = ["FatedVehicle"]

_NOWHERE_ELSE = 0.0, 0.0, 0.0


class FatedVehicle(VirtualVehicle):
    """One vehicle in a fate.

    Args:
        queue: virtual time.
        uav: whose vehicle it is.
        report: called with everything the vehicle says, at the time it says it.
        fate: what happens to it.
        takeoff_s: until it is airborne once it is told to.
    """

    def __init__(
        self,
        queue: EventQueue,
        uav: str,
        report: Callable[[Report], None],
        fate: Fate,
        takeoff_s: float = 0.0,
    ) -> None:
        super().__init__(queue, report, takeoff_s)
        self._fate = fate
        self._uav = next(each for each in fate.mission.uavs if each.id == UavId(uav))
        self._tasks = {str(task.id): task for task in fate.mission.tasks}
        self._astray_m: Point = _NOWHERE_ELSE
        """From where it believes to be to where it is, when it last set off [m]."""
        self._becomes_m: Point = _NOWHERE_ELSE
        """The same at the end of its way."""
        self._way_s = 0.0, 0.0
        """When it set off and arrives."""

    def order(self, order: Orders, ready: Report) -> None:
        """Obey ``order``; ``ready`` is what it says once it is prepared."""
        self._astray_m = self._becomes_m = self._astray_now_m()
        super().order(order, ready)

    def _fly(self, motion: IdealMotion, order: GoTo) -> None:
        now_s, task = self._queue.now_s(), self._tasks.get(order.task or "")
        believed = motion.position_enu_m(now_s)
        if task is not None:
            stop = self._fate.stop_enu_m(self._uav.id, task)
            self._becomes_m = _from_to(task.position_enu_m, stop)
        here = _moved(believed, self._astray_m)
        there = _moved(order.position_enu_m, self._becomes_m)
        name = None if task is None else task.id
        true_m_s = self.speed_frac * self._fate.speed_m_s(self._uav, name, here, there)
        length_m, believed_m = math.dist(here, there), math.dist(believed, order.position_enu_m)
        arrives_s = now_s + length_m / true_m_s
        # It believes to cover the way it believes in, in the time it really takes.
        shown = believed_m / length_m if believed_m and length_m else 1.0
        motion.fly_to(order.position_enu_m, true_m_s * shown, now_s)
        self._way_s = now_s, arrives_s
        if task is not None and not self._fate.succeeds(self._uav, task, order.attempt):
            self._later(arrives_s, AttemptFailed(order.leg))
        self._later(arrives_s, Arrived(order.leg))

    def _astray_now_m(self) -> Point:
        leaves_s, arrives_s = self._way_s
        now_s = self._queue.now_s()
        if now_s >= arrives_s:
            return self._becomes_m
        share = (now_s - leaves_s) / (arrives_s - leaves_s)
        east_m, north_m, up_m = (
            a + share * (b - a) for a, b in zip(self._astray_m, self._becomes_m, strict=True)
        )
        return east_m, north_m, up_m


def _from_to(one: Point, other: Point) -> Point:
    return other[0] - one[0], other[1] - one[1], other[2] - one[2]


def _moved(place: Point, by: Point) -> Point:
    return place[0] + by[0], place[1] + by[1], place[2] + by[2]
