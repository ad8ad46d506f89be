"""What of a scenario does not go with its kinds of vehicles: refused where it could not be safe."""

from __future__ import annotations

from collections.abc import Iterator

from swarm.model import Mission
from swarm.model.vehicles import TRAITS, VehicleKind
from swarm.scenario.findings import Finding
from swarm.scenario.shapes import Scenario


def table_faults(scenario: Scenario) -> Iterator[Finding]:
    """Tables of UAVs whose turns are missing, or given of a vehicle that needs none."""
    for index, uav in enumerate(scenario.uav):
        place = ("uav", index, "turn_radius_m")
        if TRAITS[uav.vehicle].stays:
            if uav.turn_radius_m is not None:
                problem = f"is not known of a {uav.vehicle}, which stops where it is told to"
                yield Finding(place, problem, "leave it out")
        elif uav.acceleration_m_s2 is not None:
            problem = f"does not tell how a {uav.vehicle} turns"
            yield Finding(("uav", index, "acceleration_m_s2"), problem, "give turn_radius_m")
        elif uav.turn_radius_m is None:
            problem = f"is missing, and a {uav.vehicle} waits on a circle"
            yield Finding(place, problem, "give its radius, such as 60.0")
        place = ("uav", index, "landing_heading_deg")
        if TRAITS[uav.vehicle].needs_runway:
            if uav.landing_heading_deg is None:
                problem = f"is missing, and a {uav.vehicle} lands along a runway"
                yield Finding(place, problem, "give the direction in which it is to touch down")
        elif uav.landing_heading_deg is not None:
            problem = f"does not matter to a {uav.vehicle}, which lands upright"
            yield Finding(place, problem, "leave it out")


def vehicle_faults(mission: Mission, scenario: Scenario) -> Iterator[Finding]:
    """What cannot be asked of the vehicles of ``mission``, which ``scenario`` describes."""
    asked = {
        "separation_m": mission.separation_m is not None,
        "band_m": mission.band_m is not None,
        "[terrain]": scenario.terrain is not None,
    }
    beside = [key for key, given in asked.items() if given]
    lines = [task.id for task in mission.tasks if task.path_enu_m]
    for index, uav in enumerate(mission.uavs):
        place = ("uav", index, "vehicle")
        if uav.vehicle is not VehicleKind.COPTER and beside:
            problem = f"a {uav.vehicle} is not known beside {beside[0]}"
            yield Finding(place, problem, f"leave {beside[0]} out, or give a copter")
        if TRAITS[uav.vehicle].stays:
            continue
        if mission.bases:
            problem = f"a {uav.vehicle} lands where it started, and not at a [[base]]"
            yield Finding(place, problem, "leave the bases out, or give a copter")
        if mission.zones:
            problem = f"a {uav.vehicle} turns beside its way, perhaps in a [[zone]]"
            yield Finding(place, problem, "leave the zones out, or give a copter")
        tasks = {task.id: task for task in mission.tasks}
        able = [line for line in lines if mission.success(uav, tasks[line]) > 0.0]
        if able:
            problem = f"a {uav.vehicle} flies no lines, such as {able[0]}"
            yield Finding(place, problem, "give it success = 0 there, by task id or kind")
