"""A vehicle of the virtual-time world: flies ideally, reports like a real one.

Speaks agent.vehicle, so the agent's core cannot tell it from a MAVLink autopilot.
It is airborne at its start at once: take-off is no part of mission time.
Leaves out: the autopilot's protocol (sim.autopilot).
"""

from __future__ import annotations

from collections.abc import Callable

from agent.vehicle import Arrived, GoTo, Home, Orders, Prepare, Report, Return, Telemetry
from sim.event_queue import EventQueue
from sim.kinematics import IdealMotion

__all__ = ["VirtualVehicle"]


class VirtualVehicle:
    """One ideal vehicle.

    Args:
        queue: virtual time.
        report: called with everything the vehicle says, at the time it says it.
    """

    def __init__(self, queue: EventQueue, report: Callable[[Report], None]) -> None:
        self._queue = queue
        self._report = report
        self._motion: IdealMotion | None = None
        self._speed_m_s = 1.0
        self._orders = 0

    def order(self, order: Orders, ready: Report) -> None:
        """Obey ``order``; ``ready`` is what it says once it is prepared."""
        self._orders += 1
        match order:
            case Prepare(position_enu_m=start, speed_m_s=speed_m_s):
                self._motion, self._speed_m_s = IdealMotion(start), speed_m_s
                self._later(self._queue.now_s(), ready)
            case GoTo(leg=leg, position_enu_m=target) if self._motion is not None:
                self._motion.fly_to(target, self._speed_m_s, self._queue.now_s())
                arrives_s = self._motion.arrives_s
                if arrives_s is not None:
                    self._later(arrives_s, Arrived(leg))
            case Return():
                self._later(self._queue.now_s(), Home())
            case _:
                pass

    def telemetry(self) -> Telemetry | None:
        """Where it is now; None before it was prepared."""
        if self._motion is None:
            return None
        now_s = self._queue.now_s()
        return Telemetry(
            self._motion.position_enu_m(now_s), self._motion.velocity_enu_m_s(now_s), None
        )

    def _later(self, time_s: float, report: Report) -> None:
        """Say ``report`` then, unless another order has come in between."""
        order = self._orders

        def say() -> None:
            if order == self._orders:
                self._report(report)

        self._queue.at(time_s, say)
