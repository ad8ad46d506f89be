"""A new scenario that flies as it is, with every field explained, for a person to make their own.

The fields and their defaults are those of swarm.scenario.shapes; here is what they mean.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass

from pydantic import BaseModel
from pydantic_core import PydanticUndefined

from swarm.model import Mission, Origin, Task, TaskId, Uav, UavId
from swarm.scenario.draft import PAD_SPACING_M, horizon_for
from swarm.scenario.edition import EDITIONS
from swarm.scenario.shapes import (
    AreaTable,
    BaseTable,
    MissionTable,
    OriginTable,
    Scenario,
    TaskTable,
    TerrainTable,
    UavTable,
    ZoneTable,
)
from swarm.scenario.write import toml_lines, toml_place, toml_value

_SPEED_M_S = 8.0
_SPACING_M = 60.0
"""About how far tasks lie from their neighbours."""
_GOLDEN_ANGLE_RAD = math.pi * (3.0 - math.sqrt(5.0))
"""Points on a spiral, that angle after each other, cover a disk evenly (H. Vogel, 1979,
https://doi.org/10.1016/0025-5564(79)90080-4)."""
_WIDTH = 92

_IN_DEGREES: Mapping[str, str] = {
    "lat_deg": "Instead of position_m: latitude and longitude [deg], and the height above mean "
    "sea level [m]; without alt_m it is the origin's.",
    "lon_deg": "",
    "alt_m": "",
}
_ABOUT: Mapping[str, Mapping[str, str]] = {
    "": {
        "schema": "Version of this format. One of version 1 has nothing of wind, heights, energy, "
        "bases, zones, windows, lines and areas.",
        "name": "Name of the mission: what --mission and swarm status call it. Letters, digits, "
        "'_', '-' and '.'.",
        "tasks_from": "A file beside this one whose points are tasks, too: a QGroundControl .plan, "
        ".waypoints, .geojson or .csv.",
        "mission": "",
        "origin": "",
        "terrain": "",
        "uav": "",
        "base": "",
        "zone": "",
        "area": "",
        "task": "",
    },
    "mission": {
        "horizon_s": "D, the horizon [s]: a task done t seconds after the start is worth "
        "p · S · value · (D − t). Later than D it counts against the mission, so let D be later "
        "than the last task can be done.",
        "success_default": "p, how likely a UAV succeeds at a task (0..1), where its table "
        "success says nothing else. 0 means that it cannot do the task at all.",
        "survival_default": "How likely a UAV survives a task (0..1), where its table survival "
        "says nothing else; S is the product over those before. Below 1, risky tasks come late.",
        "reattempt_failed": "Whether a task whose attempt failed opens again for everyone; "
        "otherwise it is closed as failed.",
        "wind_m_s": "Steady wind by where it blows to [m/s east, m/s north]; UAVs with an "
        "airspeed_m_s feel it. Absent: calm.",
        "zone_margin_m": "Paths stay that far away from zones [m].",
        "separation_m": "Smallest distance of two UAVs in flight [m]. Absent: each keeps to a "
        "height of its own, 3 m from the next one's, and nothing else keeps them apart.",
        "band_m": "Lowest and highest height above the ground that may be used [m]; with a "
        "separation_m all UAVs share the layers in it. Absent: each flies in a layer of its own. "
        "Beside [terrain] it begins at clearance_m + 3 or higher.",
    },
    "origin": {
        "lat_deg": "Latitude and longitude (WGS84) of the place where position_m is [0, 0] [deg]. "
        "Without [origin] simulated vehicles fly near Zürich; real ones need their own field here.",
        "lon_deg": "",
        "alt_m": "Height of that place above mean sea level [m]. A vehicle that finds its ground "
        "more than 10 m above or below is not started.",
    },
    "terrain": {
        "file": "Heights of the ground, beside this file: a GeoTIFF (.tif) or an SRTM tile "
        "(N47E008.hgt, zipped or not). All places then stand on that ground and take no heights of "
        "their own; layers and height_m count from the ground below.",
        "clearance_m": "Nobody comes nearer to that ground between take-off and landing [m]; "
        "plans keep 3 m more.",
    },
    "uav": {
        "id": "Name of the UAV: what --uav, hold and return call it.",
        "position_m": "Where it takes off [m east, m north] of the origin; a third number is the "
        "height above it. UAVs at one place are told apart in the air by height layers.",
        **_IN_DEGREES,
        "speed_m_s": "Cruise speed over ground [m/s]; plans count on it, and the vehicle is told "
        "to fly at it.",
        "success": "p by task id or by kind of task; an id goes before a kind.",
        "survival": "How likely it survives a task, by task id or by kind of task.",
        "kind": "What kind of UAV it is; for people.",
        "acceleration_m_s2": "With which it takes up speed and brakes [m/s²]; a leg then takes "
        "speed / acceleration longer. Absent: speeds change at once.",
        "vehicle": 'What it is: "copter", "rover" (drives), "quadplane" (a plane that '
        'takes off and lands upright) or "plane" (which needs a runway). Only a copter goes with '
        "separation_m, band_m and [terrain].",
        "landing_heading_deg": "Of a plane: in which it touches down at its start, clockwise from "
        "north.",
        "turn_radius_m": "Of a quadplane or plane, instead of acceleration_m_s2: the radius of the "
        "circle on which it turns, and waits [m].",
        "airspeed_m_s": "Speed through the air [m/s]; more than the wind's. Absent: wind has no "
        "effect on it.",
        "endurance_s": "Airborne time that a full battery gives [s]. Absent: endless.",
        "reserve_frac": "Share of the endurance that is never planned with (0..1).",
        "charge_frac": "Charge of the battery at the start of the mission (0..1).",
    },
    "base": {
        "id": "Where batteries are swapped. A UAV's own start is such a place only if a base is "
        "there.",
        "position_m": "Where it is [m east, m north] of the origin; a third number is the height "
        "above it.",
        **_IN_DEGREES,
        "swap_s": "From touch-down to ready [s].",
        "slots": "How many UAVs it serves at a time. Absent: no limit.",
    },
    "zone": {
        "id": "Where not to fly. Starts, bases and tasks lie outside of it.",
        "polygon_m": "Corners round it [m east, m north], convex or not; lines between them do not "
        "cross.",
        "polygon": "Instead of polygon_m: corners by latitude and longitude [deg].",
        "holes_m": "Holes in it, where one may fly: polygons as polygon_m.",
        "floor_m": "Lowest height of it above the origin [m]. Absent: from the ground up.",
        "ceiling_m": "Greatest height of it above the origin [m]. Absent: unlimited.",
        "inclusive": "true: keeps out of all that is not inside, instead of what is.",
    },
    "area": {
        "id": "An area to be covered by lines; these are tasks, called field-a-01, field-a-02, …",
        "polygon_m": "Corners round it [m east, m north], convex or not; lines between them do not "
        "cross. What lies in zones or nearer than their margin is cut off.",
        "polygon": "Instead of polygon_m: corners by latitude and longitude [deg].",
        "holes_m": "Holes in it, where nothing is to be covered: polygons as polygon_m.",
        "value": "m of all its lines together, shared out by length.",
        "spacing_m": "Between neighbouring lines at most [m].",
        "trigger_m": "A picture every so many metres along the lines [m]. Absent: none.",
        "camera": "Instead of spacing_m and trigger_m: a known camera (sony-a6000-16mm, …; a wrong "
        "name tells all), or its numbers: sensor_width_mm, sensor_height_mm, focal_length_mm, "
        "image_width_px and image_height_px, maybe landscape (true: the longer side across the "
        "flight) and exposure_s (0.001). Takes the height and both overlaps.",
        "height_m": "Lines are flown that high above the origin [m]. Absent: in the UAV's layer.",
        "sidelap_frac": "Share of a picture that is on those of the next line, too.",
        "frontlap_frac": "Share of a picture that is on the next one of its line, too.",
        "heading_deg": "Of the lines, clockwise from north [deg]. Absent: the direction with the "
        "fewest turns.",
        "max_line_m": "Longer lines are cut into equal parts, so that UAVs can share them [m]. "
        "Absent: none is.",
        "kind": "What the rest says of a task is said of every line.",
        "service_s": "",
        "appears_s": "",
        "due_s": "",
        "opens_s": "",
        "closes_s": "",
    },
    "task": {
        "id": "Name of the task: what reports and swarm task call it.",
        "position_m": "Where it is [m east, m north] of the origin; a third number is the height "
        "above it. A UAV flies its height layer above that place: the first 10 m, every other "
        "one 3 m more.",
        **_IN_DEGREES,
        "value": "m, what it is worth; only the ratios to other tasks count.",
        "service_s": "Time on the spot [s]: the UAV waits there for so long.",
        "kind": "What kind of task it is; success and survival of UAVs may name it.",
        "appears_s": "When it becomes known [s of mission time]: later than 0 it is a pop-up that "
        "no plan made before the start knows of.",
        "due_s": "When it ends at the latest [s of mission time]; it is worth "
        "p · S · value · (due_s − t) then, and may be left out. Absent: it is to be done, whenever "
        "that is.",
        "opens_s": "Work on the spot begins not before [s of mission time].",
        "closes_s": "Nor later [s of mission time]. Absent: never too late.",
        "path_m": "Instead of position_m: a line flown from one end to the other, whichever way "
        "is better; points as position_m.",
        "path": "The same by latitude and longitude [deg].",
        "trigger_m": "A picture every so many metres along the line [m]. Absent: none.",
        "height_m": "It is flown that high above the origin, with [terrain] above the ground "
        "there [m]. Absent: in the UAV's layer.",
    },
}
"""What every field means, by table; empty for one that is explained with the one before."""
_TABLES: Mapping[str, type[BaseModel]] = {
    "": Scenario,
    "mission": MissionTable,
    "origin": OriginTable,
    "terrain": TerrainTable,
    "uav": UavTable,
    "base": BaseTable,
    "zone": ZoneTable,
    "area": AreaTable,
    "task": TaskTable,
}
_EXAMPLES: Mapping[tuple[str, str], str] = {
    ("", "tasks_from"): '"survey.plan"',
    ("mission", "wind_m_s"): "[3.0, -1.0]",
    ("mission", "zone_margin_m"): "5.0",
    ("mission", "separation_m"): "10.0",
    ("mission", "band_m"): "[30.0, 110.0]",
    ("uav", "lat_deg"): "47.397742",
    ("uav", "lon_deg"): "8.545594",
    ("uav", "alt_m"): "488.0",
    ("uav", "acceleration_m_s2"): "2.5",
    ("uav", "vehicle"): '"copter"',
    ("uav", "turn_radius_m"): "60.0",
    ("uav", "landing_heading_deg"): "90.0",
    ("uav", "airspeed_m_s"): "12.0",
    ("uav", "endurance_s"): "1200.0",
    ("uav", "reserve_frac"): "0.2",
    ("uav", "charge_frac"): "1.0",
    ("base", "lat_deg"): "47.397742",
    ("base", "lon_deg"): "8.545594",
    ("base", "alt_m"): "488.0",
    ("base", "swap_s"): "120.0",
    ("base", "slots"): "2",
    ("zone", "polygon"): "[[47.399, 8.549], [47.399, 8.55], [47.4, 8.549]]",
    ("zone", "holes_m"): "[[[310.0, 210.0], [330.0, 210.0], [310.0, 230.0]]]",
    ("zone", "floor_m"): "0.0",
    ("zone", "ceiling_m"): "120.0",
    ("zone", "inclusive"): "false",
    ("area", "polygon"): "[[47.394, 8.546], [47.394, 8.549], [47.396, 8.546]]",
    ("area", "holes_m"): "[[[50.0, -310.0], [80.0, -310.0], [50.0, -280.0]]]",
    ("area", "trigger_m"): "20.0",
    ("area", "camera"): '"dji-phantom-4-pro"',
    ("area", "height_m"): "60.0",
    ("area", "sidelap_frac"): "0.7",
    ("area", "frontlap_frac"): "0.8",
    ("area", "heading_deg"): "30.0",
    ("area", "max_line_m"): "400.0",
    ("area", "kind"): '"photograph"',
    ("area", "service_s"): "0.0",
    ("area", "appears_s"): "60.0",
    ("area", "due_s"): "300.0",
    ("area", "opens_s"): "60.0",
    ("area", "closes_s"): "240.0",
    ("uav", "success"): "{ t1 = 0.9 }",
    ("uav", "survival"): "{ t1 = 0.99 }",
    ("uav", "kind"): '"quad"',
    ("task", "lat_deg"): "47.398",
    ("task", "lon_deg"): "8.546",
    ("task", "alt_m"): "488.0",
    ("task", "service_s"): "5.0",
    ("task", "kind"): '"inspect"',
    ("task", "appears_s"): "60.0",
    ("task", "due_s"): "300.0",
    ("task", "opens_s"): "60.0",
    ("task", "closes_s"): "240.0",
    ("task", "path_m"): "[[0.0, 60.0], [200.0, 60.0]]",
    ("task", "path"): "[[47.398, 8.546], [47.398, 8.549]]",
    ("task", "trigger_m"): "20.0",
    ("task", "height_m"): "60.0",
}
"""Values of fields that may be left out, as they could be."""
_ENTRIES: Mapping[str, Mapping[str, object]] = {
    "terrain": {"file": "hills.tif", "clearance_m": 20.0},
    "base": {"id": "b1", "position_m": [0.0, -20.0]},
    "zone": {"id": "z1", "polygon_m": [[300.0, 200.0], [400.0, 200.0], [300.0, 300.0]]},
    "area": {
        "id": "field-a",
        "polygon_m": [[0.0, -400.0], [300.0, -400.0], [300.0, -250.0], [0.0, -250.0]],
        "value": 40.0,
        "spacing_m": 25.0,
    },
    "task": {"id": "t1", "position_m": [60.0, 0.0], "value": 1.0},
}
"""Tables that the file may have none of, as they could be."""


@dataclass(frozen=True, slots=True)
class Blank:
    """What is asked of a new scenario."""

    name: str
    uavs: int
    tasks: int
    origin: Origin


def blank_scenario(blank: Blank) -> str:
    """The text of a commented scenario in which that many UAVs do tasks all around them."""
    mission = _mission(blank)
    return "\n".join(_lines(blank, mission)) + "\n"


def _mission(blank: Blank) -> Mission:
    uavs = tuple(
        Uav(UavId(f"uav{number + 1}"), (number * PAD_SPACING_M, 0.0, 0.0), _SPEED_M_S)
        for number in range(blank.uavs)
    )
    tasks = tuple(_task(number) for number in range(blank.tasks))
    mission = Mission(blank.name, 60.0, uavs, tasks, origin=blank.origin)
    return Mission(blank.name, horizon_for(mission), uavs, tasks, origin=blank.origin)


def _task(number: int) -> Task:
    radius_m = _SPACING_M * math.sqrt(number + 1.0)
    angle_rad = number * _GOLDEN_ANGLE_RAD
    east_m, north_m = radius_m * math.cos(angle_rad), radius_m * math.sin(angle_rad)
    # Adding 0 turns -0 into 0.
    place = (round(east_m) + 0.0, round(north_m) + 0.0, 0.0)
    return Task(TaskId(f"t{number + 1}"), place, 1.0 + number % 5)


def _lines(blank: Blank, mission: Mission) -> Iterator[str]:
    fleet = f"{blank.uavs} UAV{'s'[: blank.uavs - 1]}, {blank.tasks} tasks"
    yield f"# Scenario {blank.name}: {fleet}. It flies as it is; make it yours."
    yield "#"
    yield from _wrapped(
        "Lines that begin with '#' are comments; fields in them may be left out and show "
        "examples. Every fault of this file is told by:  swarm plan FILE"
    )
    yield ""
    top = {"schema": EDITIONS[-1], "name": mission.name}
    yield from _explained("", top)
    if not mission.tasks:
        yield "task = []  # none yet: an operator adds them (swarm task add), or tables follow"
        yield ""
    yield "[mission]"
    yield from _explained("mission", {"horizon_s": mission.horizon_s})
    yield "[origin]"
    yield from _explained("origin", asdict(blank.origin))
    yield from _commented("terrain")
    for number, uav in enumerate(mission.uavs):
        given = {
            "id": uav.id,
            "position_m": toml_place(uav.position_enu_m),
            "speed_m_s": uav.speed_m_s,
        }
        yield from _entry("uav", given, explained=number == 0)
    yield from _commented("base")
    yield from _commented("zone")
    yield from _commented("area")
    for number, task in enumerate(mission.tasks):
        given = {
            "id": task.id,
            "position_m": toml_place(task.position_enu_m),
            "value": task.value,
        }
        yield from _entry("task", given, explained=number == 0)
    if not mission.tasks:
        yield from _commented("task")


def _commented(table: str) -> Iterator[str]:
    """A table as it could be, all of it in comments."""
    yield f"# [{table}]" if table == "terrain" else f"# [[{table}]]"
    for line in _explained(table, _ENTRIES[table]):
        yield line if not line or line.startswith("#") else f"# {line}"


def _entry(table: str, given: Mapping[str, object], *, explained: bool) -> Iterator[str]:
    yield f"[[{table}]]"
    if explained:
        yield from _explained(table, given)
        return
    yield from toml_lines(given)
    yield ""


def _explained(table: str, given: Mapping[str, object]) -> Iterator[str]:
    """Every field of a table with what it means; those not ``given`` as comments."""
    fields = _TABLES[table].model_fields
    keys = {field.alias or name: field for name, field in fields.items()}
    ordered = sorted(keys, key=list(_ABOUT[table]).index)
    for key in ordered:
        if table == "" and key in _TABLES:
            continue  # a table of its own, below
        about = _ABOUT[table][key]
        default = keys[key].get_default(call_default_factory=True)
        if default not in (PydanticUndefined, None, {}, []):
            about += f" Default: {toml_value(default)}."
        yield from _wrapped(about)
        if key in given:
            yield f"{key} = {given[key] if key == 'schema' else toml_value(given[key])}"
        elif (table, key) in _EXAMPLES:
            yield f"# {key} = {_EXAMPLES[table, key]}"
        else:
            yield f"{key} = {toml_value(default)}"
    yield ""


def _wrapped(text: str) -> Iterator[str]:
    yield from (f"# {line}" for line in textwrap.wrap(text, _WIDTH))
