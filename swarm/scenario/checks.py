"""Rules between several places of a scenario file: ids, references, places, abilities.

The checks read the parsed document itself and pass over whatever has the wrong
shape, so that one run names every fault of a file.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from swarm.model.ids import RESERVED
from swarm.scenario.edition import edition_of
from swarm.scenario.findings import Document, Finding, close_match, number_of, shown
from swarm.scenario.places import Entry, entries, misplaced

_HINTS = 20
"""References that get a suggestion; comparing names is slow, and a file with more is generated."""


def check(document: Document) -> list[Finding]:
    """Everything wrong between the places of ``document``, in no order."""
    uavs = list(entries(document, "uav"))
    tasks = list(entries(document, "task"))
    bases = list(entries(document, "base"))
    areas = list(entries(document, "area"))
    of_edition: Iterable[Finding]
    if edition_of(document) == 1:
        of_edition = _impossible_tasks(document, uavs, tasks)
    else:  # where a task that nobody can do is left out, which a plan tells
        from swarm.scenario.area_faults import area_faults  # plain missions never load these
        from swarm.scenario.keep_out import field_faults

        of_edition = [*field_faults(document), *area_faults(document)]
    return [
        *_doubled_ids("uav", uavs),
        *_doubled_ids("task", tasks),
        *_doubled_ids("base", bases),
        *_doubled_ids("zone", entries(document, "zone")),
        *_doubled_ids("area", areas),
        *_reserved_ids(uavs),
        *misplaced(document, "uav", uavs),
        *misplaced(document, "task", tasks),
        *misplaced(document, "base", bases),
        # Without an array of tasks every reference is unknown; that says nothing new.
        *(
            _unknown_references(uavs, tasks, areas)
            if isinstance(document.get("task"), list)
            else ()
        ),
        *of_edition,
    ]


def _doubled_ids(name: str, found: Iterable[Entry]) -> Iterator[Finding]:
    first: dict[str, int] = {}
    for index, entry in found:
        identity = entry.get("id")
        if isinstance(identity, str) and first.setdefault(identity, index) != index:
            problem = f"{shown(identity)} is already the id of {name}[{first[identity]}]"
            yield Finding((name, index, "id"), problem, "give every one an id of its own")


def _reserved_ids(uavs: list[Entry]) -> Iterator[Finding]:
    for index, entry in uavs:
        identity = entry.get("id")
        if isinstance(identity, str) and identity in RESERVED:
            problem = f"{shown(identity)} is the name of {RESERVED[identity]} on the bus"
            yield Finding(("uav", index, "id"), problem, "give the UAV another id")


def _unknown_references(
    uavs: list[Entry], tasks: list[Entry], areas: list[Entry]
) -> Iterator[Finding]:
    """Of lines of areas it is known how they are called once these are cut."""
    named = [task.get(key) for _, task in tasks for key in ("id", "kind")]
    named += [area.get("kind") for _, area in areas]
    names = {name for name in named if isinstance(name, str)}
    lines = tuple(f"{area.get('id')}-" for _, area in areas)
    hints = _HINTS
    for index, uav in uavs:
        for table in ("success", "survival"):
            chances = uav.get(table)
            for name in chances if isinstance(chances, Mapping) else ():
                if name in names or name.startswith(lines):
                    continue
                meant = close_match(name, names) if hints > 0 else None
                hints -= 1
                remedy = f"did you mean {meant!r}?" if meant else "give the id or kind of a task"
                problem = "no task has this id or kind"
                yield Finding(("uav", index, table, name), problem, remedy)


def _impossible_tasks(
    document: Document, uavs: list[Entry], tasks: list[Entry]
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
