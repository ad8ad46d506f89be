"""Whether a scenario can be flown as it is.

Leaves out: what is right and wrong in a file (swarm.scenario).
"""

from __future__ import annotations

from pathlib import Path

from coordinator.briefing import FlightLayers, height_warning
from sim.doctor.finding import Finding, fails, fine, warns
from swarm.errors import InputError
from swarm.model import Mission
from swarm.scenario import load_scenario

__all__ = ["check_scenario"]


def check_scenario(path: Path) -> tuple[Mission | None, list[Finding]]:
    """The mission, if the file is sound, and what is to be said of it."""
    try:
        mission = load_scenario(path)
    except InputError as error:
        return None, [
            fails("scenario", f"{fault.source}: {fault.place}: {fault.problem}", fault.remedy)
            for fault in error.faults
        ]
    text = f"{mission.name}: {len(mission.uavs)} UAVs, {len(mission.tasks)} tasks"
    if mission.origin is None:
        remedy = "give it [origin] with the place of your field before flying outdoors"
        found = [warns("scenario", f"{text}, and no origin", remedy)]
    else:
        found = [fine("scenario", f"{text}, D = {mission.horizon_s:g} s")]
    if (warning := height_warning(mission, FlightLayers())) is not None:
        problem, _, remedy = warning.partition(": ")
        found.append(warns("height", problem, remedy))
    return mission, found
