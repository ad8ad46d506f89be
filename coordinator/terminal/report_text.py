"""The report of a mission for a terminal, from 80 columns on."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from coordinator.mission_view.presentation import (
    BAD,
    Signs,
    story_style,
)
from coordinator.mission_view.results import (
    MissionResult,
    ReportFact,
    RouteComparison,
    RouteStop,
    compare_quantities,
    compare_routes,
    summary_line,
)
from coordinator.mission_view.story import MissionEvent, notable
from coordinator.mission_view.wording import clean, shown_s, shown_value
from swarm.model import Mission, Plan

__all__ = ["report_text"]


_ROWS = 16
"""UAVs whose lists are shown."""
_STORY_LINES = 12
_IDS = 10
"""Ids shown of one fact."""


def report_text(
    mission: Mission,
    plan: Plan | None,
    result: MissionResult,
    story: Sequence[MissionEvent],
    *,
    notes: Sequence[ReportFact],
    hint: str,
    signs: Signs,
) -> RenderableType:
    """The report: verdict, lists, worth, what went otherwise, and the notable story."""
    ascii_only = not signs.braille
    headline = Text.assemble(
        (f"{mission.name}: ", "bold"),
        (summary_line(mission, plan, result), "bold green" if result.is_complete else BAD),
    )
    parts: list[RenderableType] = [headline]
    if plan is not None:
        order = "" if plan.sequence is None else f": {_order(plan.sequence, signs)}"
        parts.append(Text(f"planned by {plan.method}{order}", "dim"))
    parts += ["", _lists(compare_routes(mission, plan, result), plan is not None, signs)]
    parts += ["", _worth_table(plan, result, signs)]
    if notes:
        parts += ["", _notes_table(notes, ascii_only)]
    told = notable(story)
    if told:
        parts += ["", _story_table(told, ascii_only)]
    if hint:
        parts += ["", Text(hint, "dim")]
    return Group(*parts)


def _order(sequence: Sequence[str], signs: Signs) -> str:
    shown = " > ".join(sequence[:_IDS])
    return shown if len(sequence) <= _IDS else f"{shown} > {signs.cut}"


def _lists(compared: Sequence[RouteComparison], planned: bool, signs: Signs) -> RenderableType:
    """One row per UAV that kept to its plan, two where the lists differ."""
    shown = list(compared)
    if len(shown) > _ROWS:
        shown = [each for each in compared if not each.same][:_ROWS]
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    table.add_column("UAV", no_wrap=True)
    table.add_column("list", no_wrap=True)
    table.add_column(Text("each task @ its completion in s"))
    for each in shown:
        name = Text(each.uav, BAD if each.lost else "bold")
        if each.lost:
            name.append(" lost")
        flown = _stops(each.flown, planned=False, compared=planned and not each.same, signs=signs)
        if each.same or not planned:
            said = Text("as planned", "green") if each.same else Text("flown")
            table.add_row(name, said, flown)
            continue
        table.add_row(name, Text("planned"), _stops(each.planned, True, True, signs))
        table.add_row(Text(), Text("flown", "yellow"), flown)
    below = []
    if any(stop.odd for each in shown for stop in (*each.planned, *each.flown)) and planned:
        below.append("+ flown but planned for another   ( ) planned but flown by another or nobody")
    if any(stop.late for each in shown for stop in (*each.planned, *each.flown)):
        below.append("! after the horizon: counts against J")
    hidden = [each for each in compared if each not in shown]
    if hidden:
        same = sum(each.same for each in hidden)
        other = len(hidden) - same
        counts = [f"{same} more as planned"] if same else []
        counts += [f"{other} more that differ"] if other else []
        below.append(f"{signs.cut} and {', '.join(counts)}")
    return Group(table, *(Text(line, "dim") for line in below))


def _stops(stops: Sequence[RouteStop], planned: bool, compared: bool, signs: Signs) -> Text:
    if not stops:
        return Text(signs.nothing, "dim")
    text = Text()
    for number, stop in enumerate(stops):
        odd = stop.odd and compared
        style = BAD if stop.late else "yellow" if odd else ""
        shown = stop if odd == stop.odd else RouteStop(stop.task, stop.time_s, stop.late, odd=False)
        text.append(" " if number else "")
        text.append(shown.shown(planned=planned), style)
    return text


def _worth_table(plan: Plan | None, result: MissionResult, signs: Signs) -> Table:
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    table.add_column("", no_wrap=True, style="bold")
    table.add_column("flown", justify="right", no_wrap=True)
    if plan is not None:
        for heading in ("planned", "of planned"):
            table.add_column(heading, justify="right", no_wrap=True)
        if plan.optimum is not None:
            for heading in ("optimum", "of optimum"):
                table.add_column(heading, justify="right", no_wrap=True)
    for each in compare_quantities(plan, result):
        show = shown_s if each.unit == "s" else shown_value
        unit = each.unit.replace("·", signs.product)
        cells = [Text(f"{each.name} [{unit}]"), Text(show(each.flown))]
        for other in (each.planned, each.optimum):
            cells.append(Text("" if other is None else show(other)))
            cells.append(Text(_share(each.flown, other)))
        table.add_row(*cells[: len(table.columns)])
    return table


def _share(flown: float, other: float | None) -> str:
    return f"{100.0 * flown / other:.2f} %" if other is not None and other > 0.0 else ""


def _notes_table(notes: Sequence[ReportFact], ascii_only: bool) -> Table:
    table = Table.grid(padding=(0, 2, 0, 0))
    table.add_column(no_wrap=True)
    table.add_column()
    for note in notes:
        text = clean(note.shown(_IDS), ascii_only=ascii_only)
        style = BAD if note.bad else ""
        table.add_row(Text(note.name, style or "bold"), Text(text, style))
    return table


def _story_table(told: Sequence[MissionEvent], ascii_only: bool) -> RenderableType:
    table = Table.grid(padding=(0, 2, 0, 0))
    table.add_column(justify="right", no_wrap=True)
    table.add_column()
    for line in told[-_STORY_LINES:]:
        text = clean(line.text, ascii_only=ascii_only)
        table.add_row(Text(line.told_at), Text(text, story_style(line)))
    earlier = len(told) - _STORY_LINES
    return Group(Text(f"{earlier} earlier lines", "dim"), table) if earlier > 0 else table
