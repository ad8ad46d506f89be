"""A commented scenario made of a file of tasks and a few options, for a person to go on from."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, field, replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from swarm.model import Mission
from swarm.scenario.area_defaults import AreaDefaults, complete_areas
from swarm.scenario.edition import edition_of
from swarm.scenario.read import build_mission
from swarm.scenario.task_files import FileEntry, TaskFile
from swarm.scenario.task_files.task_file import AREA_KEYS, LINE_KEYS
from swarm.scenario.write import toml_float, toml_lines, toml_string, toml_value

SPEED_M_S = 5.0
"""Cruise speed where neither the file nor its reader names one [m/s]."""
CLEARANCE_M = 20.0
"""How near UAVs may come to the ground, if it is known and nobody says so [m]."""
PAD_SPACING_M = 5.0
"""Distance between the pads of neighbouring UAVs [m]."""
_SHORTEST_HORIZON_S = 60.0
_LONGEST_HORIZON_S = 1e9
_KEYS = ("id", "position_m", "lat_deg", "lon_deg", "alt_m", "path_m", "path", *LINE_KEYS[1:])
_AREA_KEYS = ("id", "polygon_m", "polygon", "holes_m", *AREA_KEYS[1:])


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
    areas: AreaDefaults = field(default_factory=AreaDefaults)
    """What areas are covered by that say nothing of it."""
    terrain: Path | None = None
    """File of the ground, if it is known."""
    clearance_m: float = CLEARANCE_M
    """How near to it UAVs may come [m]."""
    folder: Path | None = None
    """Where the scenario is to be, so that it names its files from there."""


@dataclass(frozen=True, slots=True)
class Draft:
    """A scenario made of files of tasks."""

    text: str
    lines: int
    """How many lines the areas are cut into."""
    notes: tuple[str, ...]
    """What has been assumed, a sentence each."""


def draft_scenario(tasks: TaskFile, fleet: DraftOptions) -> Draft:
    """A scenario in which ``fleet`` does the ``tasks``, starting from their home.

    Raises:
        InputError: with every fault of the tasks, at its place in their file.
    """
    defaults = {"value": fleet.value} | ({"service_s": fleet.service_s} if fleet.service_s else {})
    entries = [replace(entry, table={**defaults, **entry.table}) for entry in tasks.entries]
    areas, notes = complete_areas(tasks.areas, tasks.home, fleet.areas, fleet.value)
    tasks = replace(tasks, entries=tuple(entries), areas=areas)
    speed_m_s = fleet.speed_m_s or tasks.speed_m_s or SPEED_M_S
    uavs = [
        {
            "id": f"uav{number + 1}",
            "position_m": [number * PAD_SPACING_M, 0.0],
            "speed_m_s": speed_m_s,
        }
        for number in range(fleet.uavs)
    ]
    document: dict[str, object] = {
        "schema": 2,
        "name": fleet.name,
        "mission": {"horizon_s": fleet.horizon_s or _SHORTEST_HORIZON_S},
        "uav": uavs,
        "task": [],
    }
    if fleet.terrain is not None:
        document["terrain"] = {
            "file": str(fleet.terrain.resolve()),
            "clearance_m": fleet.clearance_m,
        }
    mission = build_mission(document, tasks.source, tasks)
    horizon_s = fleet.horizon_s or horizon_for(mission)
    text = "\n".join(_lines(tasks, fleet, uavs, horizon_s)) + "\n"
    return Draft(text, len(mission.tasks) - len(tasks.entries), (*tasks.notes, *notes))


def horizon_for(mission: Mission) -> float:
    """A horizon D: when one UAV alone would have done every task, going to the nearest next [s]."""
    uav = mission.uavs[0]
    here = np.array(uav.position_enu_m)
    lines = [task.path_enu_m or (task.position_enu_m,) for task in mission.tasks]
    ends = np.array([(line[0], line[-1]) for line in lines]).reshape(-1, 2, 3)
    along_m = [sum(math.dist(*piece) for piece in pairwise(line)) for line in lines]
    open_tasks = np.full((len(lines), 1), True)
    length_m = sum(along_m)
    for _ in lines:
        distances_m = np.linalg.norm(ends - here, axis=2)
        nearest, end = divmod(int(np.argmin(np.where(open_tasks, distances_m, np.inf))), 2)
        length_m += float(distances_m[nearest, end])
        open_tasks[nearest] = False
        here = ends[nearest, 1 - end]
    service_s = sum(task.service_s for task in mission.tasks)
    latest_s = max((max(task.appears_s, task.opens_s) for task in mission.tasks), default=0.0)
    needed_s = length_m / uav.speed_m_s + service_s + latest_s
    return min(max(_SHORTEST_HORIZON_S, 10.0 * math.ceil(needed_s / 10.0)), _LONGEST_HORIZON_S)


def _lines(
    tasks: TaskFile, fleet: DraftOptions, uavs: Iterable[Mapping[str, object]], horizon_s: float
) -> Iterator[str]:
    counts = [
        f"{len(entries)} {word}{'s'[: len(entries) - 1]}"
        for word, entries in (("task", tasks.entries), ("area", tasks.areas))
        if entries
    ]
    yield f"# {' and '.join(counts)} of {tasks.source} for a fleet of {fleet.uavs}."
    yield "# To look over: where the UAVs stand, how fast they fly, and what each task is worth."
    yield ""
    words = {
        "task": _tables(tasks.entries),
        "area": _tables(tasks.areas),
        "zone": _tables(tasks.zones),
    }
    yield f"schema = {2 if fleet.terrain is not None else edition_of(words)}"
    yield f"name = {toml_string(fleet.name)}"
    if not tasks.entries:
        yield "task = []  # all come from areas"
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
    yield from _terrain_lines(fleet)
    yield ""
    yield "# Where each UAV takes off [m east, m north of home], and its cruise speed."
    for uav in uavs:
        yield "[[uav]]"
        yield from toml_lines(uav)
        yield ""
    yield from _zone_lines(tasks.zones)
    yield from _about_heights(tasks, on_ground=fleet.terrain is not None)
    yield from _area_lines(tasks.areas)
    for number, entry in enumerate(tasks.entries):
        if number:
            yield ""
        yield "[[task]]"
        yield from toml_lines({key: entry.table[key] for key in _KEYS if key in entry.table})


def _tables(entries: Iterable[FileEntry]) -> list[Mapping[str, object]]:
    return [entry.table for entry in entries]


def _zone_lines(zones: Iterable[FileEntry]) -> Iterator[str]:
    for number, zone in enumerate(zones):
        if not number:
            yield "# Zones: where not to fly, or if inclusive the only place where to."
        yield "[[zone]]"
        yield from toml_lines(zone.table)
        yield ""


def _area_lines(areas: Iterable[FileEntry]) -> Iterator[str]:
    for number, area in enumerate(areas):
        if not number:
            yield "# Areas are cut into lines, each a task; their value is shared out by length."
        yield "[[area]]"
        table = {key: area.table[key] for key in _AREA_KEYS if key in area.table}
        camera = table.pop("camera", None)
        yield from toml_lines(table)
        if camera is not None:
            yield f"camera = {_camera(camera)}"
        yield ""


def _camera(value: object) -> str:
    """A camera by its name, or by its numbers, of which those of pixels are whole."""
    if not isinstance(value, Mapping):
        return toml_value(value)
    numbers = (
        f"{key} = {each if key.endswith('_px') else toml_value(each)}"
        for key, each in value.items()
    )
    return f"{{ {', '.join(numbers)} }}"


def _terrain_lines(fleet: DraftOptions) -> Iterator[str]:
    if fleet.terrain is None:
        return
    file = fleet.terrain
    if fleet.folder is not None and not file.is_absolute():
        file = Path(os.path.relpath(file, fleet.folder))
    yield ""
    yield "# The ground, and how near to it UAVs may come; places stand on it."
    yield "[terrain]"
    yield from toml_lines({"file": file.as_posix(), "clearance_m": fleet.clearance_m})


def _about_heights(tasks: TaskFile, *, on_ground: bool) -> Iterator[str]:
    if any("height_m" not in entry.table for entry in (*tasks.entries, *tasks.areas)):
        yield "# A UAV flies above the places of tasks, each in a layer of its own: the first 10 m,"
        yield "# every other 3 m higher than the one before."
        if tasks.below_m and any("alt_m" in entry.table for entry in tasks.entries):
            yield f"# Each place is {tasks.below_m:g} m below its waypoint for that reason."
    if any("height_m" in entry.table for entry in (*tasks.entries, *tasks.areas)):
        above = "the ground there" if on_ground else "home"
        yield f"# With height_m it flies that high above {above}, whichever UAV it is."
