"""Write a mission as a scenario file that reads back as the same mission.

Positions are written in local metres, numbers with all their digits. Leaves
out: comments, and places in degrees (the origin is kept).
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping

from swarm.model import Mission, Task, Uav

__all__ = ["format_scenario", "toml_float", "toml_point", "toml_string"]


_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")


def format_scenario(mission: Mission) -> str:
    """The text of a scenario file for ``mission``; defaults of UAVs and tasks are left out.

    A mission whose numbers pass the limits of the format (see
    swarm.scenario.shapes) is written all the same and refused when read.
    """
    head = ["schema = 1", f"name = {toml_string(mission.name)}"]
    if not mission.tasks:
        head.append("task = []")
    blocks = [
        head,
        [
            "[mission]",
            f"horizon_s = {toml_float(mission.horizon_s)}",
            f"success_default = {toml_float(mission.success_default)}",
            f"survival_default = {toml_float(mission.survival_default)}",
            f"reattempt_failed = {'true' if mission.reattempt_failed else 'false'}",
        ],
    ]
    if (origin := mission.origin) is not None:
        place = (("lat_deg", origin.lat_deg), ("lon_deg", origin.lon_deg), ("alt_m", origin.alt_m))
        blocks.append(["[origin]", *(f"{key} = {toml_float(number)}" for key, number in place)])
    blocks += [list(_uav_lines(uav)) for uav in mission.uavs]
    blocks += [list(_task_lines(task)) for task in mission.tasks]
    return "\n\n".join("\n".join(block) for block in blocks) + "\n"


def _uav_lines(uav: Uav) -> Iterable[str]:
    yield "[[uav]]"
    yield f"id = {toml_string(uav.id)}"
    yield f"position_m = {toml_point(uav.position_enu_m)}"
    yield f"speed_m_s = {toml_float(uav.speed_m_s)}"
    if uav.success:
        yield f"success = {_table(uav.success)}"
    if uav.survival:
        yield f"survival = {_table(uav.survival)}"
    if uav.kind is not None:
        yield f"kind = {toml_string(uav.kind)}"


def _task_lines(task: Task) -> Iterable[str]:
    yield "[[task]]"
    yield f"id = {toml_string(task.id)}"
    yield f"position_m = {toml_point(task.position_enu_m)}"
    yield f"value = {toml_float(task.value)}"
    if task.service_s:
        yield f"service_s = {toml_float(task.service_s)}"
    if task.kind is not None:
        yield f"kind = {toml_string(task.kind)}"
    if task.appears_s:
        yield f"appears_s = {toml_float(task.appears_s)}"


def toml_point(point_enu_m: tuple[float, float, float]) -> str:
    """A place as ``position_m`` has it: without the height where that is 0."""
    numbers = point_enu_m if point_enu_m[2] else point_enu_m[:2]
    return f"[{', '.join(toml_float(number) for number in numbers)}]"


def _table(entries: Mapping[str, float]) -> str:
    inner = ", ".join(f"{_key(name)} = {toml_float(number)}" for name, number in entries.items())
    return f"{{ {inner} }}"


def _key(name: str) -> str:
    return name if _BARE_KEY.fullmatch(name) else toml_string(name)


def toml_string(text: str) -> str:
    """``text`` as a string of TOML."""
    # JSON's escapes are TOML's, but TOML forbids a bare DEL as well.
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def toml_float(number: float) -> str:
    """``number`` with all its digits."""
    return repr(float(number))
