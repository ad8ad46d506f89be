"""The target under way: the order, and the leg that carries it out.

Leaves out: when a target may be taken (agent.mavlink.duty), and how each kind of leg is
flown (agent.mavlink.leg, agent.mavlink.mission_leg).
"""

from __future__ import annotations

from collections.abc import Sequence

from agent.mavlink.commands import CommandEnded
from agent.mavlink.flavours import Flavour
from agent.mavlink.leg import Leg, RepositionLeg
from agent.mavlink.messages import Inbound, Outbound, Text
from agent.mavlink.mission_leg import MissionLeg
from agent.mavlink.seat import Seat
from agent.vehicle import Arrived, GoTo, HandedOver, Refused
from swarm.model.frames import wgs84_from_enu

__all__ = ["Target"]

Point = tuple[float, float, float]


class Target:
    """Carries out one `GoTo`.

    Args:
        order: the order.
        seat: the vehicle.
        flavour: its firmware.
        speed_m_s: cruise speed.
    """

    def __init__(self, order: GoTo, seat: Seat, flavour: Flavour, speed_m_s: float) -> None:
        self._order = order
        self._seat = seat
        self._flavour = flavour
        self._leg = _leg_to(order, seat, flavour, speed_m_s)

    def start(self) -> None:
        """Tell the vehicle, in place of whatever it was told before."""
        self._seat.say(*self._leg.start(self._seat.now_s))

    def on_ended(self, ended: CommandEnded) -> None:
        """Take the outcome of a command."""
        self._leg.on_ended(ended)

    def on_message(self, message: Inbound) -> None:
        """Take what the vehicle says of the target."""
        if isinstance(message, Text) and self._flavour.ignores_target(message.text):
            self._leg.ignored(message.text)

    def on_position(self, place_enu_m: Point, velocity_enu_m_s: Point) -> None:
        """Judge arrival."""
        out: Sequence[Outbound] = self._leg.on_position(
            place_enu_m, velocity_enu_m_s, self._seat.now_s
        )
        self._seat.say(*out)

    def outcome(self) -> Arrived | HandedOver | Refused | None:
        """How the leg ended; None while it is under way."""
        if self._leg.arrived:
            return Arrived(self._order.leg)
        if self._leg.stopped is not None:
            return HandedOver(self._leg.stopped)
        failure = self._leg.failure
        if failure is None:
            return None
        return Refused(self._order, self._seat.in_its_words(failure))


def _leg_to(order: GoTo, seat: Seat, flavour: Flavour, speed_m_s: float) -> Leg:
    target_enu_m, config = order.position_enu_m, seat.config
    if seat.mission is not None:
        return MissionLeg(target_enu_m, order.stay_s, speed_m_s, config, seat.mission)
    place = wgs84_from_enu(config.origin, target_enu_m)
    message = flavour.reposition(*place, speed_m_s)
    insists = not flavour.pilots_stop_it_there
    return RepositionLeg(
        target_enu_m,
        message,
        config,
        seat.commands,
        lambda result: flavour.place_refusal(seat.vehicle, result),
        insists=insists,
    )
