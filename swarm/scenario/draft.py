"""A commented scenario made of a file of tasks and a few options, for a person to go on from."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, replace

import numpy as np

from swarm.model import Mission
from swarm.scenario.edition import edition_of
from swarm.scenario.read import build_mission
from swarm.scenario.task_files import TaskFile
from swarm.scenario.task_files.task_file import TASK_KEYS
from swarm.scenario.write import toml_float, toml_lines, toml_string

SPEED_M_S = 5.0
"""Cruise speed where neither the file nor its reader names one [m/s]."""
PAD_SPACING_M = 5.0
"""Distance between the pads of neighbouring UAVs [m]."""
_SHORTEST_HORIZON_S = 60.0
_LONGEST_HORIZON_S = 1e9
_KEYS = ("id", "position_m", "lat_deg", "lon_deg", "alt_m", *TASK_KEYS[1:])


@dataclass(frozen=True, slots=True)
class DraftOptions:
    """What a scenario says beside its tasks."""

    name: str
    """Name of the mission."""
    uavs: int
    speed_m_s: float | None = None
    """Cruise speed [m/s]; None for the one the file names."""
    horizon_s: float | None = None
    """D [s]; None for what a single UAV would need for all tasks."""
    value: float = 1.0
    """Value of a task that the file gives none."""
    service_s: float = 0.0
    """Time on the spot of a task that the file gives none [s]."""


def draft_scenario(tasks: TaskFile, fleet: DraftOptions) -> str:
    """The text of a scenario in which ``fleet`` does the ``tasks``, starting from their home.

    Raises:
        InputError: with every fault of the tasks, at its place in their file.
    """
    defaults = {"value": fleet.value} | ({"service_s": fleet.service_s} if fleet.service_s else {})
    entries = [replace(entry, table={**defaults, **entry.table}) for entry in tasks.entries]
    tasks = replace(tasks, entries=tuple(entries))
    speed_m_s = fleet.speed_m_s or tasks.speed_m_s or SPEED_M_S
    uavs = [
        {
            "id": f"uav{number + 1}",
            "position_m": [number * PAD_SPACING_M, 0.0],
            "speed_m_s": speed_m_s,
        }
        for number in range(fleet.uavs)
    ]
    mission = build_mission(
        {
            "schema": 2,
            "name": fleet.name,
            "mission": {"horizon_s": fleet.horizon_s or _SHORTEST_HORIZON_S},
            "uav": uavs,
            "zone": list(tasks.zones),
            "task": [],
        },
        tasks.source,
        tasks,
    )
    horizon_s = fleet.horizon_s or horizon_for(mission)
    return "\n".join(_lines(tasks, fleet, uavs, horizon_s)) + "\n"


def horizon_for(mission: Mission) -> float:
    """A horizon D: when one UAV alone would have done every task, going to the nearest next [s]."""
    uav = mission.uavs[0]
    here = np.array(uav.position_enu_m)
    places = np.array([task.position_enu_m for task in mission.tasks]).reshape(-1, 3)
    open_tasks = np.full(len(places), True)
    length_m = 0.0
    for _ in range(len(places)):
        distances_m = np.linalg.norm(places - here, axis=1)
        nearest = int(np.argmin(np.where(open_tasks, distances_m, np.inf)))
        length_m += float(distances_m[nearest])
        open_tasks[nearest] = False
        here = places[nearest]
    service_s = sum(task.service_s for task in mission.tasks)
    latest_s = max((max(task.appears_s, task.opens_s) for task in mission.tasks), default=0.0)
    needed_s = length_m / uav.speed_m_s + service_s + latest_s
    return min(max(_SHORTEST_HORIZON_S, 10.0 * math.ceil(needed_s / 10.0)), _LONGEST_HORIZON_S)


def _lines(
    tasks: TaskFile, fleet: DraftOptions, uavs: Iterable[Mapping[str, object]], horizon_s: float
) -> Iterator[str]:
    yield f"# Tasks of {tasks.source} ({len(tasks.entries)}) for a fleet of {fleet.uavs}."
    yield "# To look over: where the UAVs stand, how fast they fly, and what each task is worth."
    yield ""
    words = {"task": [entry.table for entry in tasks.entries], "zone": list(tasks.zones)}
    yield f"schema = {edition_of(words)}"
    yield f"name = {toml_string(fleet.name)}"
    yield ""
    yield "[mission]"
    yield "# D: a task done t seconds after the start is worth p · value · (D − t)."
    if fleet.horizon_s is None:
        yield "# This is about what a single UAV would need for all of them."
    yield f"horizon_s = {toml_float(horizon_s)}"
    yield "success_default = 1.0  # p: how likely a UAV succeeds at a task"
    if tasks.home is not None:
        yield ""
        yield "# Home, the zero of position_m; alt_m is its height above mean sea level."
        yield "[origin]"
        yield from toml_lines(asdict(tasks.home))
    yield ""
    yield "# Where each UAV takes off [m east, m north of home], and its cruise speed."
    for uav in uavs:
        yield "[[uav]]"
        yield from toml_lines(uav)
        yield ""
    if tasks.zones:
        yield "# The geofence: where not to fly, or if inclusive the only place where to."
    for zone in tasks.zones:
        yield "[[zone]]"
        yield from toml_lines(zone)
        yield ""
    yield from _about_heights(tasks)
    for number, entry in enumerate(tasks.entries):
        if number:
            yield ""
        yield "[[task]]"
        yield from toml_lines({key: entry.table[key] for key in _KEYS if key in entry.table})


def _about_heights(tasks: TaskFile) -> Iterator[str]:
    yield "# A UAV flies above the places of tasks, each in a layer of its own: the first 10 m,"
    yield "# every other 3 m higher than the one before."
    if tasks.below_m:
        yield f"# Each place is {tasks.below_m:g} m below its waypoint for that reason."
