"""What must hold of everything said on a bus, whatever happened to the processes.

Looks at a recording from outside, with the view of one who hears all sides: at agreement and
visits here, at single statements as `sim.faults.message_log` does.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

from sim.faults.message_log import MessageLog
from sim.fleet.faults.recorder import BusEntry
from swarm.protocol.board import TaskBoard, TaskState
from swarm.protocol.messages import Message
from swarm.protocol.registers import Replica
from swarm.protocol.uav_messages import Choice, Claim, Nearby, Status

AGREE_WITHIN_S = 5.0
"""After the end of a trouble, living UAVs have this long to agree on all claims [s]."""
SHORT_RIVALRY_S = 1.5
"""In a whole network, two UAVs that decide at one moment agree within this time [s]."""


@dataclass(frozen=True, slots=True)
class ProcessDown:
    """A process was killed or paused: what it claimed before counts no longer."""

    at_s: float
    writer: str


@dataclass(frozen=True, slots=True)
class Trouble:
    """A time in which processes or links were not as they should be."""

    begin_s: float
    end_s: float
    """When everything was whole again."""


@dataclass(frozen=True, slots=True)
class Rivalry:
    """A time in which several living UAVs claimed one open task."""

    task: str
    uavs: tuple[str, ...]
    """All that took part."""
    begin_s: float
    end_s: float


@dataclass(frozen=True, slots=True, order=True)
class CompletedVisit:
    """A UAV has done a task."""

    completed_s: float
    """Mission time [s]."""
    task: str
    uav: str


def message_logs(entries: Iterable[BusEntry]) -> list[MessageLog]:
    """What was said at each seat, with the rules it breaks."""
    found: dict[int, MessageLog] = {}
    for entry in entries:
        message = entry.what
        log = found.setdefault(entry.seat, MessageLog())
        log.said(entry.at_s, message.writer, message.stamp.incarnation, message)
    return list(found.values())


def visits(told: Iterable[MessageLog]) -> list[CompletedVisit]:
    """Every visit that ended done, duplicates included, in order of completion."""
    found = {
        CompletedVisit(completed_s, task, uav)
        for message_log in told
        for (uav, task), times_s in message_log.visits.items()
        for completed_s in times_s
    }
    return sorted(found)


def rivalries(
    entries: Sequence[BusEntry], mission: str, fates: Iterable[ProcessDown] = ()
) -> list[Rivalry]:
    """All times in which one open task was claimed by several living UAVs.

    A claim counts from when its UAV has said it until it says another one, or dies; a task
    is open until its first outcome is known. Short rivalries are normal: two UAVs decide at
    the same moment, and one gives way as soon as it hears of it.
    """
    found: list[Rivalry] = []
    present: dict[str, Rivalry] = {}
    at_s = 0.0
    for at_s, claimed in _claims(entries, mission, fates):
        for task, rivals in claimed.items():
            begun = present.get(task, Rivalry(task, (), at_s, at_s))
            uavs = tuple(sorted({*begun.uavs, *rivals}))
            present[task] = replace(begun, uavs=uavs)
        over = present.keys() - claimed.keys()
        found += [replace(present.pop(task), end_s=at_s) for task in over]
    found += [replace(rivalry, end_s=at_s) for rivalry in present.values()]
    return sorted(found, key=lambda rivalry: (rivalry.begin_s, rivalry.task))


def agreement_s(found: Iterable[Rivalry], trouble: Trouble) -> float:
    """How long after the end of ``trouble`` the last rivalry that it left had ended [s]."""
    limit_s = trouble.end_s + SHORT_RIVALRY_S
    left = [each for each in found if trouble.begin_s <= each.begin_s <= limit_s]
    return max((max(0.0, each.end_s - trouble.end_s) for each in left), default=0.0)


def disagreements(found: Iterable[Rivalry], troubles: Sequence[Trouble]) -> list[str]:
    """Rivalries that went on although the network had long been whole, in words."""
    faults = []
    for each in found:
        unexcused_s = each.end_s - each.begin_s - _overlap_s(each, troubles)
        if unexcused_s > SHORT_RIVALRY_S:
            who = ", ".join(each.uavs)
            faults.append(f"{who} claimed {each.task} for {unexcused_s:.1f} s too long")
    return faults


def _overlap_s(rivalry: Rivalry, troubles: Sequence[Trouble]) -> float:
    """Time in which a rivalry is excused by a trouble or the healing after it."""
    excused_s, until_s = 0.0, rivalry.begin_s
    for trouble in sorted(troubles, key=lambda trouble: trouble.begin_s):
        begin_s = max(until_s, trouble.begin_s)
        end_s = min(rivalry.end_s, trouble.end_s + AGREE_WITHIN_S)
        excused_s += max(0.0, end_s - begin_s)
        until_s = max(until_s, end_s)
    return excused_s


def _claims(
    entries: Sequence[BusEntry], mission: str, fates: Iterable[ProcessDown]
) -> Iterator[tuple[float, dict[str, list[str]]]]:
    """After each change: when, and the open tasks that several UAVs claim, with those UAVs."""
    replica = Replica()
    board = TaskBoard(replica, mission)
    claims: dict[str, Claim] = {}
    happened: list[BusEntry | ProcessDown] = sorted([*entries, *fates], key=lambda each: each.at_s)
    for each in happened:
        match each:
            case ProcessDown(writer=writer):
                claims.pop(writer, None)
            case BusEntry(what=Message(body=Status() | Choice() | Nearby())):
                continue
            case BusEntry(what=message):
                news = replica.join(message)
                body = message.body
                if isinstance(body, Claim) and (news or replica.known(message) == message):
                    claims[message.writer] = body
        by_task: dict[str, list[str]] = {}
        for uav, claim in claims.items():
            if claim.task is not None and board.states.get(claim.task) is TaskState.OPEN:
                by_task.setdefault(claim.task, []).append(uav)
        yield each.at_s, {task: uavs for task, uavs in by_task.items() if len(uavs) > 1}
