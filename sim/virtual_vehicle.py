"""A vehicle of the virtual-time world: flies ideally, reports like a real one.

Speaks agent.vehicle, so the agent's core cannot tell it from a MAVLink autopilot.
It is airborne at its start at once, or after a given time: take-off is no part of mission
time. Like a real one
it outlives its agent: resumed by the next, it flies on to where it was sent.
Leaves out: the autopilot's protocol (sim.autopilot).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from agent.vehicle import (
    Arrived,
    GoTo,
    Held,
    Hold,
    Home,
    Orders,
    Prepare,
    Report,
    Return,
    Telemetry,
)
from sim.event_queue import EventQueue
from sim.kinematics import IdealMotion

__all__ = ["SimulatedVehicle", "VehicleFactory", "VirtualVehicle"]


class SimulatedVehicle(Protocol):
    """The vehicle of one UAV in virtual time, whatever lies between it and its agent."""

    def order(self, order: Orders, ready: Report) -> None:
        """Obey ``order``; ``ready`` is what an ideal vehicle says once it is prepared."""
        ...

    def leave(self) -> None:
        """The process that commanded it has ended; it goes on with what it does."""
        ...

    def telemetry(self) -> Telemetry | None:
        """Where it is now; None on the ground, and for one that reports that by itself."""
        ...


VehicleFactory = Callable[[EventQueue, str, Callable[[Report], None]], SimulatedVehicle]
"""Makes the vehicle of a UAV in a queue's time; it says what it has to say by the callback."""


class VirtualVehicle:
    """One ideal vehicle.

    Args:
        queue: virtual time.
        report: called with everything the vehicle says, at the time it says it.
        takeoff_s: until it is airborne once it is told to.
    """

    def __init__(
        self, queue: EventQueue, report: Callable[[Report], None], takeoff_s: float = 0.0
    ) -> None:
        self.speed_frac = 1.0
        """Share of the ordered speed at which it flies from its next order on."""
        self._queue = queue
        self._report = report
        self._takeoff_s = takeoff_s
        self._motion: IdealMotion | None = None
        self._speed_m_s = 1.0
        self._orders = 0

    def order(self, order: Orders, ready: Report) -> None:
        """Obey ``order``; ``ready`` is what it says once it is prepared."""
        self._orders += 1
        match order:
            case Prepare():
                self._prepare(order, ready)
            case GoTo() if self._motion is not None:
                self._fly(self._motion, order)
            case Hold():
                if self._motion is not None:
                    self._motion.stop(self._queue.now_s())
                self._later(self._queue.now_s(), Held())
            case Return():
                self._motion = None
                self._later(self._queue.now_s(), Home())
            case _:
                pass

    def _fly(self, motion: IdealMotion, order: GoTo) -> None:
        speed_m_s = self._speed_m_s * self.speed_frac
        motion.fly_to(order.position_enu_m, speed_m_s, self._queue.now_s())
        if motion.arrives_s is not None:
            self._later(motion.arrives_s, Arrived(order.leg))

    def _prepare(self, order: Prepare, ready: Report) -> None:
        now_s, motion = self._queue.now_s(), self._motion
        self._speed_m_s = order.speed_m_s
        if motion is None:
            self._motion = IdealMotion(order.position_enu_m)
            self._later(now_s + self._takeoff_s, ready)
        elif order.resume:
            self._later(now_s, self._telemetry(motion))
            self._later(now_s, ready)
        else:
            motion.fly_to(order.position_enu_m, self._speed_m_s, now_s)
            self._later(max(now_s, motion.arrives_s or now_s), ready)

    def leave(self) -> None:
        """Its agent has ended; it flies on."""

    def telemetry(self) -> Telemetry | None:
        """Where it is now; None on the ground."""
        return None if self._motion is None else self._telemetry(self._motion)

    def _telemetry(self, motion: IdealMotion) -> Telemetry:
        now_s = self._queue.now_s()
        return Telemetry(motion.position_enu_m(now_s), motion.velocity_enu_m_s(now_s), None)

    def _later(self, time_s: float, report: Report) -> None:
        """Say ``report`` then, unless another order has come in between."""
        order = self._orders

        def say() -> None:
            if order == self._orders:
                self._report(report)

        self._queue.at(time_s, say)
