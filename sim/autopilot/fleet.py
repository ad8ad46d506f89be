"""Simulated vehicles for the UAVs of a scenario.

Leaves out: serving them (sim.autopilot.server).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from sim.autopilot.config import VehicleConfig
from swarm.model import Mission, UavId
from swarm.model.frames import DEFAULT_ORIGIN

__all__ = ["FleetMember", "fleet_of"]

_MAX_SYSTEM_ID = 254


@dataclass(frozen=True, slots=True)
class FleetMember:
    """A UAV of the scenario and the vehicle it is."""

    uav: UavId
    config: VehicleConfig


def fleet_of(
    mission: Mission, uavs: Sequence[UavId] | None = None, first_system_id: int | None = None
) -> tuple[FleetMember, ...]:
    """Vehicles standing at the starts of their UAVs, cruising as fast as those do.

    Args:
        mission: the scenario.
        uavs: which of its UAVs, in that order; all if None.
        first_system_id: system id of the first vehicle, the next ones counting on;
            if None, each UAV has its place in the scenario, from 1 on. Beyond 254
            ids begin at 1 again: every vehicle has a link of its own.

    Raises:
        ValueError: the mission has no UAV of that id.
    """
    places = {uav.id: place for place, uav in enumerate(mission.uavs)}
    members = []
    for number, wanted in enumerate(places if uavs is None else uavs):
        if wanted not in places:
            raise ValueError(f"no UAV {wanted!r}")
        place = places[wanted]
        number_from_0 = place if first_system_id is None else first_system_id - 1 + number
        uav = mission.uavs[place]
        config = VehicleConfig(
            system_id=number_from_0 % _MAX_SYSTEM_ID + 1,
            start_enu_m=uav.position_enu_m,
            origin=mission.origin or DEFAULT_ORIGIN,
            cruise_m_s=uav.speed_m_s,
        )
        members.append(FleetMember(uav.id, config))
    return tuple(members)
