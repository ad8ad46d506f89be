"""Simulated vehicles for the UAVs of a scenario.

Leaves out: serving them (sim.autopilot.server).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sim.autopilot.config import BatteryFailsafe, VehicleConfig
from sim.wind import Wind, gusts_of
from swarm.model import Mission, UavId
from swarm.model.frames import DEFAULT_ORIGIN

__all__ = ["FleetMember", "Physics", "fleet_of"]

_MAX_SYSTEM_ID = 254


@dataclass(frozen=True, slots=True)
class FleetMember:
    """A UAV of the scenario and the vehicle it is."""

    uav: UavId
    config: VehicleConfig


@dataclass(frozen=True, slots=True)
class Physics:
    """What is more real about a fleet than ideal motion with a full battery in still air.

    Each number is checked where it is used.
    """

    acceleration_m_s2: float | None = None
    wind_enu_m_s: tuple[float, float] = (0.0, 0.0)
    """East and north, where the wind blows to [m/s]."""
    gust_m_s: float = 0.0
    seed: int = 0
    """Of the gusts; each UAV of a scenario has its own, wherever it is simulated."""
    endurance_s: float | None = None
    battery_failsafe: BatteryFailsafe | None = None
    position_failsafe_s: float | None = None

    def wind(self, place: int) -> Wind | None:
        """The air around the UAV at that place of the scenario; None if it is still."""
        gusts = None
        if self.gust_m_s > 0.0:
            gusts = gusts_of(self.gust_m_s, np.random.default_rng([self.seed, place]))
        air = Wind(self.wind_enu_m_s, gusts)
        return air if gusts is not None or air.speed_m_s > 0.0 else None


def fleet_of(
    mission: Mission,
    uavs: Sequence[UavId] | None = None,
    first_system_id: int | None = None,
    physics: Physics | None = None,
) -> tuple[FleetMember, ...]:
    """Vehicles standing at the starts of their UAVs, cruising as fast as those do.

    Args:
        mission: the scenario.
        uavs: which of its UAVs, in that order; all if None.
        first_system_id: system id of the first vehicle, the next ones counting on;
            if None, each UAV has its place in the scenario, from 1 on. Beyond 254
            ids begin at 1 again: every vehicle has a link of its own.
        physics: how real they are; ideal if None.

    Raises:
        ValueError: the mission has no UAV of that id, or the physics are out of range.
    """
    physics = physics or Physics()
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
            endurance_s=physics.endurance_s,
            battery_failsafe=physics.battery_failsafe,
            position_failsafe_s=physics.position_failsafe_s,
            acceleration_m_s2=physics.acceleration_m_s2,
            wind=physics.wind(place),
        )
        members.append(FleetMember(uav.id, config))
    return tuple(members)
