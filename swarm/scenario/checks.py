"""Rules between several places of a scenario file: ids, references, places, abilities.

The checks read the parsed document itself and pass over whatever has the wrong
shape, so that one run names every fault of a file.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from swarm.model.frames import Origin, enu_from_wgs84
from swarm.model.ids import RESERVED
from swarm.scenario.findings import Document, Finding, Path, absent, close_match, number_of, shown

_FARTHEST_M = 1e7
_HINTS = 20
"""References that get a suggestion; comparing names is slow, and a file with more is generated."""

_Entry = tuple[int, Mapping[str, object]]


def check(document: Document) -> list[Finding]:
    """Everything wrong between the places of ``document``, in no order."""
    uavs = list(_entries(document, "uav"))
    tasks = list(_entries(document, "task"))
    return [
        *_doubled_ids("uav", uavs),
        *_doubled_ids("task", tasks),
        *_reserved_ids(uavs),
        *_misplaced(document, "uav", uavs),
        *_misplaced(document, "task", tasks),
        # Without an array of tasks every reference is unknown; that says nothing new.
        *(_unknown_references(uavs, tasks) if isinstance(document.get("task"), list) else ()),
        *_impossible_tasks(document, uavs, tasks),
    ]


def _entries(document: Document, name: str) -> Iterator[_Entry]:
    array = document.get(name)
    for index, entry in enumerate(array if isinstance(array, list) else ()):
        if isinstance(entry, Mapping):
            yield index, entry


def _doubled_ids(name: str, entries: list[_Entry]) -> Iterator[Finding]:
    first: dict[str, int] = {}
    for index, entry in entries:
        identity = entry.get("id")
        if isinstance(identity, str) and first.setdefault(identity, index) != index:
            problem = f"{shown(identity)} is already the id of {name}[{first[identity]}]"
            yield Finding((name, index, "id"), problem, "give every one an id of its own")


def _reserved_ids(uavs: list[_Entry]) -> Iterator[Finding]:
    for index, entry in uavs:
        identity = entry.get("id")
        if isinstance(identity, str) and identity in RESERVED:
            problem = f"{shown(identity)} is the name of {RESERVED[identity]} on the bus"
            yield Finding(("uav", index, "id"), problem, "give the UAV another id")


def _misplaced(document: Document, name: str, entries: list[_Entry]) -> Iterator[Finding]:
    origin = document.get("origin")
    frame = origin_of(origin)
    for index, entry in entries:
        path: Path = (name, index)
        if "position_m" in entry:
            yield from _not_both(path, entry)
            continue
        if not {"lat_deg", "lon_deg", "alt_m"} & entry.keys():
            remedy = "give position_m = [east, north], or lat_deg and lon_deg"
            yield absent((*path, "position_m"), remedy)
            continue
        for key, other in (("lat_deg", "lon_deg"), ("lon_deg", "lat_deg")):
            if key not in entry:
                there = other if other in entry else "alt_m"
                remedy = f"give {key} beside {there}, or position_m = [east, north]"
                yield absent((*path, key), remedy)
        if origin is None:
            problem = "a place in degrees needs an origin"
            remedy = "add a table [origin] with lat_deg, lon_deg and alt_m, or give position_m"
            yield Finding((*path, next(k for k in entry if k in _DEGREES)), problem, remedy)
        elif frame is not None and _too_far(frame, entry):
            problem = f"is more than {_FARTHEST_M:g} m from the origin"
            yield Finding((*path, "lat_deg"), problem, "give an origin near the mission")


_DEGREES = ("lat_deg", "lon_deg", "alt_m")


def _not_both(path: Path, entry: Mapping[str, object]) -> Iterator[Finding]:
    if "lat_deg" in entry or "lon_deg" in entry:
        key = "lat_deg" if "lat_deg" in entry else "lon_deg"
        remedy = "keep either position_m or lat_deg, lon_deg and alt_m"
        yield Finding((*path, key), "a second position beside position_m", remedy)
    elif "alt_m" in entry:
        remedy = "give the height above the origin as a third number of position_m"
        yield Finding((*path, "alt_m"), "goes with lat_deg and lon_deg only", remedy)


def _too_far(frame: Origin, entry: Mapping[str, object]) -> bool:
    lat_deg, lon_deg = number_of(entry.get("lat_deg")), number_of(entry.get("lon_deg"))
    if lat_deg is None or lon_deg is None:
        return False
    point_enu_m = enu_from_wgs84(frame, lat_deg, lon_deg, frame.alt_m)
    return max(abs(coordinate_m) for coordinate_m in point_enu_m) > _FARTHEST_M


def origin_of(table: object) -> Origin | None:
    """The origin that the table ``[origin]`` gives; None unless it is there and right."""
    if not isinstance(table, Mapping):
        return None
    numbers = [number_of(table.get(key)) for key in _DEGREES]
    lat_deg, lon_deg, alt_m = numbers
    if lat_deg is None or lon_deg is None or alt_m is None:
        return None
    try:
        return Origin(lat_deg, lon_deg, alt_m)
    except ValueError:
        return None  # named by the shapes


def _unknown_references(uavs: list[_Entry], tasks: list[_Entry]) -> Iterator[Finding]:
    names = {
        name
        for _, task in tasks
        for name in (task.get("id"), task.get("kind"))
        if isinstance(name, str)
    }
    hints = _HINTS
    for index, uav in uavs:
        for table in ("success", "survival"):
            entries = uav.get(table)
            for name in entries if isinstance(entries, Mapping) else ():
                if name in names:
                    continue
                meant = close_match(name, names) if hints > 0 else None
                hints -= 1
                remedy = f"did you mean {meant!r}?" if meant else "give the id or kind of a task"
                problem = "no task has this id or kind"
                yield Finding(("uav", index, table, name), problem, remedy)


def _impossible_tasks(
    document: Document, uavs: list[_Entry], tasks: list[_Entry]
) -> Iterator[Finding]:
    """Tasks with p = 0 for every UAV; a probability that is itself wrong counts as able."""
    mission = document.get("mission")
    default = mission.get("success_default", 1.0) if isinstance(mission, Mapping) else 1.0
    tables = [uav.get("success", {}) for _, uav in uavs]
    if not tables:
        return
    able_by_default = not _is_zero(default)
    for index, task in tasks:
        if not any(_able(table, task, able_by_default) for table in tables):
            problem = "no UAV can do it: success is 0 for all"
            yield Finding(("task", index), problem, "give one a success > 0, or leave the task out")


def _able(table: object, task: Mapping[str, object], by_default: bool) -> bool:
    if not isinstance(table, Mapping):
        return True
    for key in ("id", "kind"):  # the id wins over the kind
        name = task.get(key)
        if isinstance(name, str) and name in table:
            return not _is_zero(table[name])
    return by_default


def _is_zero(value: object) -> bool:
    return number_of(value) == 0.0
