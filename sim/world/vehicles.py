"""Vehicles in virtual time: one that flies ideally, and one that flies as a realization says.

Both speak agent.core.interface, so that an agent's core cannot tell them from a MAVLink autopilot,
and both outlive their agent: resumed by the next, they fly on to where they were sent. They are
airborne at their start at once or after a given time, as take-off is no part of mission time. The
second flies at its own speed, in wind, and not quite where it thinks; its telemetry tells where it
believes to be, so its agent notices lateness and failures only.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Protocol

from agent.core.interface import (
    Arrived,
    AttemptFailed,
    GoTo,
    Held,
    Hold,
    Home,
    Prepare,
    Return,
    Telemetry,
    VehicleOrder,
    VehicleReport,
    VehicleWord,
)
from sim.world.engine import EventQueue
from sim.world.flown_path import FlownPath, MotionPiece
from sim.world.motion import IdealMotion, Point, between, flown_s, minus, plus
from sim.world.track import Track, drifting
from sim.world.uncertainty import Realization
from swarm.model import UavId
from swarm.protocol.messages import MissionConfig
from swarm.protocol.uav_messages import Status


class SimulatedVehicle(Protocol):
    """The vehicle of one UAV in virtual time, whatever lies between it and its agent."""

    def order(self, order: VehicleOrder, ready: VehicleReport) -> None:
        """Obey ``order``; ``ready`` is what an ideal vehicle says once it is prepared."""
        ...

    def leave(self) -> None:
        """The process that commanded it has ended; it goes on with what it does."""
        ...

    def telemetry(self) -> Telemetry | None:
        """Where it is now; None on the ground, and for one that reports that by itself."""
        ...


VehicleFactory = Callable[[EventQueue, str, Callable[[VehicleReport], None]], SimulatedVehicle]
"""Makes the vehicle of a UAV in a queue's time; it says what it has to say by the callback."""


def as_flown(uav: str, status: Status, told: Telemetry | None, brief: MissionConfig) -> Status:
    """``status`` with the place that its vehicle would have told by now.

    Real vehicles tell theirs all the time; ideal ones only when their agents hear something else,
    which saves time, and nothing that agents decide hangs on what is between.
    """
    if told is None or status.position_enu_m is None:
        return status
    layers_m = {spec.id: spec.layer_m for spec in brief.uavs}
    east_m, north_m, up_m = told.position_enu_m
    below_m = layers_m[uav] if status.layer_m is None else status.layer_m
    return replace(
        status,
        position_enu_m=(east_m, north_m, up_m - below_m),
        velocity_enu_m_s=told.velocity_enu_m_s,
    )


class TracedVehicle:
    """What all vehicles have that move in the world itself, not behind a bridge."""

    def __init__(self) -> None:
        self.speed_frac = 1.0
        """Share of its speed at which it flies from its next order on."""
        self.track = Track()
        """Where it truly was."""
        self.when_empty: Callable[[], None] = lambda: None
        """Is called when it falls out of the sky with an empty battery."""

    def begin_mission(self) -> None:
        """Mission time begins, which batteries are planned by."""

    def drain_by(self, drain: float) -> None:
        """Let its battery, if it has one, drain so much faster than planned from now on."""


class IdealVehicle(TracedVehicle):
    """One ideal vehicle, airborne ``takeoff_s`` after it is told to.

    ``report`` is called with everything the vehicle says, at the time it says it.
    """

    def __init__(
        self, queue: EventQueue, report: Callable[[VehicleReport], None], takeoff_s: float = 0.0
    ) -> None:
        super().__init__()
        self._queue = queue
        self._report = report
        self._takeoff_s = takeoff_s
        self._motion: IdealMotion | None = None
        self._start_enu_m: Point | None = None
        self._speed_m_s = 1.0
        self._acceleration_m_s2: float | None = None
        self._orders = 0

    def order(self, order: VehicleOrder, ready: VehicleReport) -> None:
        """Obey ``order``; ``ready`` is what it says once it is prepared."""
        if isinstance(order, VehicleWord):
            return
        self._orders += 1
        match order:
            case Prepare():
                self._prepare(order, ready)
            case GoTo() if self._motion is not None:
                self._fly(self._motion, order)
            case Hold():
                if self._motion is not None:
                    self._motion.stop(self._queue.now_s())
                    self._trace([], self._motion.target_enu_m)
                self._later(self._queue.now_s(), Held())
            case Return():
                self._trace_home()
                self._motion = None
                self._later(self._queue.now_s(), Home())
            case _:
                pass

    def _fly(self, motion: IdealMotion, order: GoTo) -> None:
        speed_m_s = self._speed_m_s * self.speed_frac
        now_s = self._queue.now_s()
        motion.fly_to(order.position_enu_m, speed_m_s, now_s, self._acceleration_m_s2)
        self._trace(FlownPath.of(motion).pieces(now_s), motion.target_enu_m)
        if motion.arrives_s is not None:
            self._later(motion.arrives_s, Arrived(order.leg))

    def _prepare(self, order: Prepare, ready: VehicleReport) -> None:
        now_s, motion = self._queue.now_s(), self._motion
        self._speed_m_s, self._acceleration_m_s2 = order.speed_m_s, order.acceleration_m_s2
        if motion is None:
            self._motion = IdealMotion(order.position_enu_m)
            self._start_enu_m = order.position_enu_m
            self.track.lift_off(order.position_enu_m, now_s + self._takeoff_s)
            self._later(now_s + self._takeoff_s, ready)
        elif order.resume:
            told = Telemetry(motion.position_enu_m(now_s), motion.velocity_enu_m_s(now_s), None)
            self._later(now_s, told)
            self._later(now_s, ready)
        else:
            motion.fly_to(order.position_enu_m, self._speed_m_s, now_s, self._acceleration_m_s2)
            self._trace(FlownPath.of(motion).pieces(now_s), motion.target_enu_m)
            self._later(max(now_s, motion.arrives_s or now_s), ready)

    def _trace(self, pieces: list[MotionPiece], stop: Point) -> None:
        """Its true motion from now on, until the next order; what it believes to fly is true."""
        self.track.fly(pieces, stop, self._queue.now_s())

    def _trace_home(self) -> None:
        """It says at once that it is home, as no plan waits for that, but flies there in time."""
        motion, start = self._motion, self._start_enu_m
        if motion is None or start is None:
            return
        now_s = self._queue.now_s()
        home = IdealMotion(motion.position_enu_m(now_s))
        home.fly_to(start, self._speed_m_s * self.speed_frac, now_s, self._acceleration_m_s2)
        self._trace(FlownPath.of(home).pieces(now_s), start)
        self.track.touch_down(home.arrives_s or now_s)

    def leave(self) -> None:
        """Its agent has ended; it flies on."""

    def telemetry(self) -> Telemetry | None:
        """Where it is now; None on the ground."""
        return self.telemetry_at(self._queue.now_s())

    def telemetry_at(self, time_s: float) -> Telemetry | None:
        """Where it was then, since when it has been ordered nothing."""
        motion = self._motion
        if motion is None:
            return None
        return Telemetry(motion.position_enu_m(time_s), motion.velocity_enu_m_s(time_s), None)

    def _later(self, time_s: float, report: VehicleReport) -> None:
        """Say ``report`` then, unless another order has come in between."""
        order = self._orders

        def say() -> None:
            if order == self._orders:
                self._report(report)

        self._queue.at(time_s, say)


_NOWHERE_ELSE = 0.0, 0.0, 0.0


class StochasticVehicle(IdealVehicle):
    """One vehicle in a realization."""

    def __init__(
        self,
        queue: EventQueue,
        uav: str,
        report: Callable[[VehicleReport], None],
        fate: Realization,
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

    def order(self, order: VehicleOrder, ready: VehicleReport) -> None:
        """Obey ``order``; ``ready`` is what it says once it is prepared."""
        if isinstance(order, VehicleWord):
            return
        self._astray_m = self._becomes_m = self._astray_now_m()
        super().order(order, ready)

    def _fly(self, motion: IdealMotion, order: GoTo) -> None:
        now_s, task = self._queue.now_s(), self._tasks.get(order.task or "")
        believed = motion.position_enu_m(now_s)
        if task is not None:
            stop = self._fate.stop_enu_m(self._uav.id, task)
            self._becomes_m = minus(stop, task.position_enu_m)
        here = plus(believed, self._astray_m)
        there = plus(order.position_enu_m, self._becomes_m)
        name = None if task is None else task.id
        true_m_s = self.speed_frac * self._fate.speed_m_s(self._uav, name, here, there)
        length_m, believed_m = math.dist(here, there), math.dist(believed, order.position_enu_m)
        true_m_s2 = self._uav.acceleration_m_s2
        arrives_s = now_s + flown_s(length_m, true_m_s, true_m_s2)
        # It believes to cover the way it believes in, in the time it really takes.
        shown = believed_m / length_m if believed_m and length_m else 1.0
        shown_m_s2 = None if true_m_s2 is None else true_m_s2 * shown
        motion.fly_to(order.position_enu_m, true_m_s * shown, now_s, shown_m_s2)
        self._way_s = now_s, arrives_s
        self._trace(FlownPath.of(motion).pieces(now_s), motion.target_enu_m)
        if task is not None and not self._fate.succeeds(self._uav, task, order.attempt):
            self._later(arrives_s, AttemptFailed(order.leg))
        self._later(arrives_s, Arrived(order.leg))

    def _trace(self, pieces: list[MotionPiece], stop: Point) -> None:
        """It is beside where it believes to be."""
        true = drifting(pieces, self._astray_m, self._becomes_m)
        self.track.fly(true, plus(stop, self._becomes_m), self._queue.now_s())

    def _astray_now_m(self) -> Point:
        leaves_s, arrives_s = self._way_s
        now_s = self._queue.now_s()
        if now_s >= arrives_s:
            return self._becomes_m
        share = (now_s - leaves_s) / (arrives_s - leaves_s)
        return between(self._astray_m, self._becomes_m, share)
