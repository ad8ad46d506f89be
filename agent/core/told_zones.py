"""What the vehicle has been told of where not to fly.

Leaves out: ways round zones (agent.core.flights), and what the vehicle makes of it (agent.vehicle).
"""

from __future__ import annotations

from agent.core.interface import Action, KeepOut, OrderVehicle, Return, VehicleOrder
from swarm.protocol.field_messages import ZoneSpec
from swarm.protocol.operator_commands import zones_in_force
from swarm.protocol.registers import Replica


class ToldZones:
    """The zones that the vehicle heeds, by what it was told last.

    Args:
        replica: what is known, brief and operator's words among it.
    """

    def __init__(self, replica: Replica) -> None:
        self._replica = replica
        self._has_vehicle = False
        """Whether a vehicle was ordered to fly, which there is from then on."""
        self._told: tuple[ZoneSpec, ...] = ()

    def tell(self, actions: list[Action]) -> None:
        """Before it is ordered anything else, let the vehicle learn where not to fly."""
        orders = [action.order for action in actions if isinstance(action, OrderVehicle)]
        self._has_vehicle |= any(map(_begins_flight, orders))
        zones = zones_in_force(self._replica) if orders and self._has_vehicle else self._told
        brief = self._replica.brief
        if zones != self._told and brief is not None:
            self._told = zones
            known = tuple(zone.zone() for zone in zones)
            actions.insert(0, OrderVehicle(KeepOut(known, brief.zone_margin_m)))


def _begins_flight(order: VehicleOrder) -> bool:
    """Whether there is a vehicle from then on: a return alone asks for none."""
    return not isinstance(order, Return) or order.resume
