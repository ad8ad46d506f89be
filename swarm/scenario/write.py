"""Write a mission as a scenario file that reads back as the same mission.

Positions are written in local metres, numbers with all their digits. A mission that schema 1 can
hold is written in it, so that older releases read it.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, fields

from swarm.model import Area, Base, Camera, Mission, Task, Uav, Zone
from swarm.model.vehicles import VehicleKind
from swarm.scenario.ground import off_ground
from swarm.scenario.plain import nobody_can
from swarm.survey.cameras import name_of

_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")


def format_scenario(mission: Mission) -> str:
    """The text of a scenario file for ``mission``, with defaults left out.

    A mission whose numbers pass the limits of the format (see
    swarm.scenario.shapes) is written all the same and refused when read. One over ground names the
    file that the heights are from; where that is not known, as of a mission from the bus, it is
    written without ``[terrain]``, its places as high as they are.
    """
    schema, terrain = 1 if is_plain(mission) else 2, mission.terrain
    if terrain is not None and terrain.file is not None:
        mission = off_ground(mission)
    areas, rest = _areas_and_other_tasks(mission)
    head: dict[str, object] = {"name": mission.name}
    if not rest and not areas:
        head["task"] = []
    rules = ("horizon_s", "success_default", "survival_default", "reattempt_failed")
    table = {key: getattr(mission, key) for key in rules} | _field_rules(mission)
    uavs, tasks = [_uav(uav) for uav in mission.uavs], [_task(task) for task in rest]
    zones = [_zone(zone) for zone in mission.zones]
    blocks = [[f"schema = {schema}", *toml_lines(head)], ["[mission]", *toml_lines(table)]]
    if mission.origin is not None:
        blocks.append(["[origin]", *toml_lines(asdict(mission.origin))])
    if terrain is not None and terrain.file is not None:
        about = {"file": terrain.file, "clearance_m": terrain.clearance_m}
        blocks.append(["[terrain]", *toml_lines(about)])
    blocks += [["[[uav]]", *toml_lines(uav)] for uav in uavs]
    blocks += [["[[base]]", *_base_lines(base)] for base in mission.bases]
    blocks += [["[[zone]]", *toml_lines(zone)] for zone in zones]
    blocks += [["[[area]]", *_area_lines(area)] for area in areas]
    blocks += [["[[task]]", *toml_lines(task)] for task in tasks]
    return "\n\n".join("\n".join(block) for block in blocks) + "\n"


def is_plain(mission: Mission) -> bool:
    """Whether schema 1 can hold the mission: no word of schema 2, and somebody for every task."""
    return not (
        mission.bases
        or mission.zones
        or mission.areas
        or mission.terrain
        or _field_rules(mission)
        or any(_kind(uav) or _given(uav, _OF_UAV) for uav in mission.uavs)
        or any(task.path_enu_m or _given(task, _OF_TASK) for task in mission.tasks)
        or nobody_can(mission)
    )


def _areas_and_other_tasks(mission: Mission) -> tuple[Sequence[Area], Sequence[Task]]:
    """The areas whose lines are as cutting them gives, and the tasks that are no such lines.

    Of any other area the lines that are left are tasks as all others.
    """
    if not mission.areas:
        return (), mission.tasks
    from swarm.survey.lines import Uncut, line_tasks

    by_id = {task.id: task for task in mission.tasks}
    areas = []
    for area in mission.areas:
        lines = line_tasks(area, mission.zones, mission.zone_margin_m)
        if not isinstance(lines, Uncut) and all(by_id.get(line.id) == line for line in lines):
            areas.append(area)
    theirs = {line for area in areas for line in area.line_ids}
    return areas, [task for task in mission.tasks if task.id not in theirs]


_OF_UAV = ("airspeed_m_s", "endurance_s", "reserve_frac", "charge_frac")
_OF_TASK = ("due_s", "opens_s", "closes_s", "trigger_m", "height_m")


def _given(item: Uav | Task | Area, names: Sequence[str]) -> dict[str, object]:
    """Those of ``names`` that are not as they are by default."""
    defaults = {each.name: each.default for each in fields(item)}
    values = {name: getattr(item, name) for name in names}
    return {name: value for name, value in values.items() if value != defaults[name]}


def _field_rules(mission: Mission) -> dict[str, object]:
    more = {
        "wind_m_s": list(mission.wind_enu_m_s) if any(mission.wind_enu_m_s) else None,
        "zone_margin_m": mission.zone_margin_m or None,
        "separation_m": mission.separation_m,
        "band_m": None if mission.band_m is None else list(mission.band_m),
    }
    return {key: value for key, value in more.items() if value is not None}


def _uav(uav: Uav) -> dict[str, object]:
    more = {"success": uav.success or None, "survival": uav.survival or None, "kind": uav.kind}
    return {
        "id": uav.id,
        "position_m": toml_place(uav.position_enu_m),
        "speed_m_s": uav.speed_m_s,
        **{key: value for key, value in more.items() if value is not None},
        **_kind(uav),
        **_given(uav, _OF_UAV),
    }


def _kind(uav: Uav) -> dict[str, object]:
    """What it is, and how it turns or takes up speed."""
    known = {
        "vehicle": None if uav.vehicle is VehicleKind.COPTER else str(uav.vehicle),
        "turn_radius_m": None if uav.turn_radius_m is None else float(f"{uav.turn_radius_m:.12g}"),
        "landing_heading_deg": _landing_heading_deg(uav),
        "acceleration_m_s2": uav.acceleration_m_s2 if uav.turn_radius_m is None else None,
    }
    return {key: value for key, value in known.items() if value is not None}


def _landing_heading_deg(uav: Uav) -> float | None:
    heading_rad = uav.landing_heading_rad
    return None if heading_rad is None else float(f"{math.degrees(heading_rad):.12g}")


def _base_lines(base: Base) -> Iterator[str]:
    yield from toml_lines({"id": base.id, "position_m": toml_place(base.position_enu_m)})
    if base.swap_s:
        yield from toml_lines({"swap_s": base.swap_s})
    if base.slots is not None:
        yield f"slots = {base.slots}"  # the one number of the format that is whole


def _zone(zone: Zone) -> dict[str, object]:
    more = {
        "holes_m": [list(map(list, hole)) for hole in zone.holes_enu_m] or None,
        "floor_m": zone.floor_m,
        "ceiling_m": zone.ceiling_m,
        "inclusive": zone.inclusive or None,
    }
    return {
        "id": zone.id,
        "polygon_m": list(map(list, zone.polygon_enu_m)),
        **{key: value for key, value in more.items() if value is not None},
    }


_OF_AREA = (
    "spacing_m",
    "trigger_m",
    "height_m",
    "sidelap_frac",
    "frontlap_frac",
    "heading_deg",
    "max_line_m",
    "kind",
    "service_s",
    "due_s",
    "opens_s",
    "closes_s",
    "appears_s",
)


def _area_lines(area: Area) -> Iterator[str]:
    rings: dict[str, object] = {"polygon_m": list(map(list, area.polygon_enu_m))}
    if area.holes_enu_m:
        rings["holes_m"] = [list(map(list, hole)) for hole in area.holes_enu_m]
    yield from toml_lines({"id": area.id, **rings, "value": area.value})
    if area.camera is not None:
        yield f"camera = {_camera(area.camera)}"
    yield from toml_lines(_given(area, _OF_AREA))


def _camera(camera: Camera) -> str:
    """By its name, or by numbers, of which those of pixels are whole."""
    if (name := name_of(camera)) is not None:
        return toml_string(name)
    numbers = {
        key: str(value) if key.endswith("_px") else toml_value(value)
        for key, value in asdict(camera).items()
    }
    return f"{{ {', '.join(f'{key} = {value}' for key, value in numbers.items())} }}"


def _task(task: Task) -> dict[str, object]:
    place: dict[str, object] = {"position_m": toml_place(task.position_enu_m)}
    if task.path_enu_m:
        place = {"path_m": list(map(toml_place, task.path_enu_m))}
    more = {
        "service_s": task.service_s or None,
        "kind": task.kind,
        "appears_s": task.appears_s or None,
    }
    return {
        "id": task.id,
        **place,
        "value": task.value,
        **{key: value for key, value in more.items() if value is not None},
        **_given(task, _OF_TASK),
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
