"""Areas of a scenario file: sound by themselves, and cut into lines that are tasks of the mission.

Like all checks those before a mission is made read the parsed document and pass over what has the
wrong shape. What only cutting shows is found in the mission.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

from swarm.model import Area, Mission
from swarm.scenario.findings import Document, Finding, Path, absent, number_of, shown
from swarm.scenario.keep_out import unsound_rings
from swarm.scenario.places import POLYGON, entries, origin_of, outline_faults
from swarm.survey.lines import Uncut, line_tasks

_MOST_TASKS = 20_000
"""Of a mission with areas: no plan is made for more."""
_OF_CAMERAS = ("height_m", "sidelap_frac", "frontlap_frac")
"""What a camera needs beside it."""


def area_faults(document: Document) -> Iterator[Finding]:
    """What is wrong with the areas of ``document``, each by itself."""
    frame = origin_of(document.get("origin"))
    for index, entry in entries(document, "area"):
        path: Path = ("area", index)
        yield from outline_faults(document, path, entry, POLYGON)
        yield from unsound_rings(path, entry, frame)
        yield from _unclear_spacing(path, entry)


def _unclear_spacing(path: Path, entry: Mapping[str, object]) -> Iterator[Finding]:
    if "spacing_m" in entry:
        for key in ("camera", "sidelap_frac", "frontlap_frac"):
            if key in entry:
                remedy = "keep either spacing_m or camera with its overlaps"
                yield Finding((*path, key), "is given beside spacing_m", remedy)
        return
    if "camera" not in entry:
        remedy = "give spacing_m, or camera with height_m, sidelap_frac and frontlap_frac"
        yield absent((*path, "spacing_m"), remedy)
        return
    if "trigger_m" in entry:
        remedy = "leave it out: frontlap_frac tells how far apart pictures are"
        yield Finding((*path, "trigger_m"), "is given beside a camera", remedy)
    for key in _OF_CAMERAS:
        if key not in entry:
            yield absent((*path, key), f"give {key} beside camera")
    height_m = number_of(entry.get("height_m"))
    if height_m is not None and height_m <= 0.0:
        problem = f"{shown(entry['height_m'])} is no height from which a camera sees the ground"
        yield Finding((*path, "height_m"), problem, "give a height > 0 [m]")


def with_lines(mission: Mission) -> tuple[Mission, list[Finding]]:
    """The mission with a task for each line of its areas, and what is wrong with these."""
    areas: list[Area] = []
    tasks = list(mission.tasks)
    places = {task.id: f"task[{index}]" for index, task in enumerate(tasks)}
    findings: list[Finding] = []
    for index, area in enumerate(mission.areas):
        lines = line_tasks(area, mission.zones, mission.zone_margin_m)
        if isinstance(lines, Uncut):
            findings.append(Finding(("area", index, lines.key), lines.problem, lines.remedy))
            continue
        if (named := next((line for line in lines if line.id in places), None)) is not None:
            problem = f"its line {shown(named.id)} has the id of {places[named.id]}"
            findings.append(Finding(("area", index, "id"), problem, "give the area another id"))
            continue
        if len(tasks) + len(lines) > _MOST_TASKS:
            problem = f"its {len(lines)} lines make more than {_MOST_TASKS} tasks of the mission"
            findings.append(Finding(("area", index), problem, "make several missions of it"))
            break
        places |= {line.id: f"a line of area[{index}]" for line in lines}
        tasks += lines
        areas.append(replace(area, lines=len(lines)))
    if findings:
        return mission, findings
    mission = replace(mission, tasks=tuple(tasks), areas=tuple(areas))
    return mission, list(_unknown_lines(mission))


def _unknown_lines(mission: Mission) -> Iterator[Finding]:
    """Chances of UAVs at lines that areas do not have."""
    known = {name for task in mission.tasks for name in (task.id, task.kind)}
    for index, uav in enumerate(mission.uavs):
        for table, chances in (("success", uav.success), ("survival", uav.survival)):
            for name in chances:
                if name not in known:
                    remedy = "give the id of a line that swarm plan tells"
                    yield Finding(("uav", index, table, name), "no area has this line", remedy)
