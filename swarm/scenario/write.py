"""Write a mission as a scenario file that reads back as the same mission.

Positions are written in local metres, numbers with all their digits.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import asdict

from swarm.model import Mission, Task, Uav

_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")


def format_scenario(mission: Mission) -> str:
    """The text of a scenario file for ``mission``; defaults of UAVs and tasks are left out.

    A mission whose numbers pass the limits of the format (see
    swarm.scenario.shapes) is written all the same and refused when read.
    """
    head: dict[str, object] = {"name": mission.name}
    if not mission.tasks:
        head["task"] = []
    rules = ("horizon_s", "success_default", "survival_default", "reattempt_failed")
    blocks = [
        ["schema = 1", *toml_lines(head)],
        ["[mission]", *toml_lines({key: getattr(mission, key) for key in rules})],
    ]
    if mission.origin is not None:
        blocks.append(["[origin]", *toml_lines(asdict(mission.origin))])
    blocks += [["[[uav]]", *toml_lines(_uav(uav))] for uav in mission.uavs]
    blocks += [["[[task]]", *toml_lines(_task(task))] for task in mission.tasks]
    return "\n\n".join("\n".join(block) for block in blocks) + "\n"


def _uav(uav: Uav) -> dict[str, object]:
    more = {"success": uav.success or None, "survival": uav.survival or None, "kind": uav.kind}
    return {
        "id": uav.id,
        "position_m": toml_place(uav.position_enu_m),
        "speed_m_s": uav.speed_m_s,
        **{key: value for key, value in more.items() if value is not None},
    }


def _task(task: Task) -> dict[str, object]:
    more = {
        "service_s": task.service_s or None,
        "kind": task.kind,
        "appears_s": task.appears_s or None,
    }
    return {
        "id": task.id,
        "position_m": toml_place(task.position_enu_m),
        "value": task.value,
        **{key: value for key, value in more.items() if value is not None},
    }


def toml_place(point_enu_m: tuple[float, float, float]) -> list[float]:
    """A place as ``position_m`` has it: without the height where that is 0."""
    return list(point_enu_m if point_enu_m[2] else point_enu_m[:2])


def toml_lines(table: Mapping[str, object]) -> Iterator[str]:
    """What is in ``table``, a key a line."""
    for key, value in table.items():
        yield f"{key} = {toml_value(value)}"


def toml_value(value: object) -> str:
    """A string, truth value or number, or an array or table of such, on one line.

    Raises:
        TypeError: it is nothing that a scenario holds.
    """
    match value:
        case str():
            return toml_string(value)
        case bool():
            return str(value).lower()
        case int() | float():
            return toml_float(value)
        case list():
            return f"[{', '.join(map(toml_value, value))}]"
        case Mapping():
            inner = ", ".join(f"{_key(name)} = {toml_value(each)}" for name, each in value.items())
            return f"{{ {inner} }}"
        case _:
            raise TypeError(f"no value of a scenario: {value!r}")


def _key(name: str) -> str:
    return name if _BARE_KEY.fullmatch(name) else toml_string(name)


def toml_string(text: str) -> str:
    """``text`` as a string of TOML."""
    # JSON's escapes are TOML's, but TOML forbids a bare DEL as well.
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def toml_float(number: float) -> str:
    """``number`` with all its digits."""
    return repr(float(number))
