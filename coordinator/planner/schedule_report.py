"""What people read of a plan that has a schedule: lists with swaps and waits, and what is left out.

Leaves out: what every plan has (coordinator.planner.plan_report).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from rich.text import Text

from coordinator.mission_view.wording import LEFT_OUT_WORDS
from swarm.model import Mission, Plan, TaskId, Uav
from swarm.model.plan import START, LeftOut, ScheduleEntry
from swarm.runtime.table import NONE, Column

SCHEDULE_COLUMNS = (
    Column("UAV", words=True, style="bold"),
    Column("tasks"),
    Column("in order: task@end, waits, swaps from-to, home@landing, in s", words=True),
)
"""Of the table of lists; the last column is `flown`."""
_LATE = "bold red"
_SWAP = "cyan"
_WAIT = "yellow"
_HOME = "dim"
_LEAST_WAIT_S = 0.05
_MOST_NAMED = 8
"""Tasks named for one reason; the JSON has them all."""


def around(mission: Mission) -> str:
    """A line about bases, zones and wind, to follow another; nothing where there are none."""
    counts = ((len(mission.bases), "base"), (len(mission.zones), "zone"))
    parts = [f"{count} {noun}{'s' if count > 1 else ''}" for count, noun in counts if count]
    if any(mission.wind_enu_m_s):
        parts.append(f"wind {math.hypot(*mission.wind_enu_m_s):.1f} m/s")
    return f"\n{', '.join(parts)}" if parts else ""


def charge_at_landing(uav: Uav, entries: Sequence[ScheduleEntry]) -> list[float | None]:
    """Per entry the share of a full battery that is left on landing there [0..1].

    None where it does not land, or its endurance is endless.
    """
    if uav.endurance_s is None:
        return [None] * len(entries)
    left_s, since_s = uav.charge_frac * uav.endurance_s, 0.0
    charges: list[float | None] = []
    for number, entry in enumerate(entries):
        is_last = number == len(entries) - 1
        if entry.base is None and not is_last:
            charges.append(None)
            continue
        left_s -= entry.begin_s - since_s
        charges.append(left_s / uav.endurance_s)
        if not is_last:
            left_s, since_s = uav.endurance_s, entries[number + 1].depart_s
    return charges


def waits_s(entries: Sequence[ScheduleEntry]) -> list[float]:
    """Per entry how long it waits before its work or swap begins, in the air and on the ground."""
    departed_s = [0.0, *(entry.end_s for entry in entries)]
    return [
        entry.depart_s - before_s + entry.begin_s - entry.arrive_s
        for before_s, entry in zip(departed_s, entries, strict=False)
    ]


def flown(mission: Mission, plan: Plan, uav: Uav) -> Text:
    """The list of ``uav`` in the order of flight, a word or two for each entry."""
    entries = (plan.schedule or {}).get(uav.id, ())
    lasting = {task.id: task.due_s is None for task in mission.tasks}
    digits = 2 if mission.horizon_s < 10.0 else 1 if mission.horizon_s < 10_000.0 else 0
    words = Text()

    def say(text: str, style: str = "") -> None:
        words.append(" " if words else "").append(text, style=style)

    for entry, charge, wait_s in zip(
        entries, charge_at_landing(uav, entries), waits_s(entries), strict=True
    ):
        left = "" if charge is None else f"({100.0 * charge:.0f}%)"
        if wait_s >= _LEAST_WAIT_S:
            say(f"wait:{wait_s:.{digits}f}", _WAIT)
        if entry is entries[-1]:
            place = entry.base or START
            say(f"home:{place}@{entry.end_s:.{digits}f}{left}", _HOME)
        elif entry.base is not None:
            say(
                f"swap:{entry.base}@{entry.begin_s:.{digits}f}-{entry.end_s:.{digits}f}{left}",
                _SWAP,
            )
        else:
            late = lasting.get(TaskId(entry.go), True) and entry.end_s > mission.horizon_s
            way = "(reversed)" if entry.is_reversed else ""
            text = f"{entry.go}{way}@{entry.end_s:.{digits}f}{'!' if late else ''}"
            say(text, _LATE if late else "")
    return words or Text(NONE, style="dim")


def reasons(mission: Mission, left_out: Mapping[TaskId, LeftOut]) -> Iterator[tuple[str, Text]]:
    """Rows that say in words what is left out and why; red if it was required."""
    required = {task.id for task in mission.tasks if task.due_s is None}
    for reason, words in LEFT_OUT_WORDS.items():
        tasks = [task for task, why in left_out.items() if why is reason]
        if not tasks:
            continue
        named = ", ".join(tasks[:_MOST_NAMED])
        more = f" and {len(tasks) - _MOST_NAMED} more" if len(tasks) > _MOST_NAMED else ""
        style = _LATE if required & set(tasks) else ""
        yield "left out", Text(f"{named}{more}: {words}", style=style)
