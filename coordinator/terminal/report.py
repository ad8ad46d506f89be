"""The report of a mission that is over: for people, for programs, and as a file."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from rich.console import Console, Group, RenderableType
from rich.table import Table
from rich.text import Text

from coordinator.mission_view.approaches import Approach, approach_as_json
from coordinator.mission_view.area_report import areas_as_json, areas_in_words
from coordinator.mission_view.missed import missed_tasks
from coordinator.mission_view.presentation import BAD, Signs, signs_for, story_style
from coordinator.mission_view.results import (
    MissionResult,
    ProtectionSummary,
    ReportFact,
    RouteComparison,
    RouteStop,
    compare_quantities,
    compare_routes,
    deviations,
    nearest_fact,
    summary_line,
)
from coordinator.mission_view.story import MissionEvent, notable
from coordinator.mission_view.wording import clean, counted, shown_s, shown_value
from coordinator.planner.plan_report import plan_as_json, schedule_as_json
from swarm.model import Mission, Plan, TaskId, UavId
from swarm.model.plan import Schedule
from swarm.runtime.errors import Fault, InputError

REPORT_SUFFIXES = (".json", ".md")
_LISTS_KEY = (
    "Each task @ its completion in s of mission time; `+` flown though not planned for this "
    "UAV, `(…)` planned for it but not flown by it, `!` after the horizon."
)
_ROWS = 16
"""UAVs whose lists are shown."""
_STORY_LINES = 12
_IDS = 10
"""Ids shown of one fact."""
_HINT = "More: --report FILE.md has the whole story; --json is for programs."


@dataclass(frozen=True, slots=True)
class MissionReport:
    """Everything there is to tell about one mission."""

    mission: Mission
    plan: Plan | None
    """The offline plan; None if there never was one."""
    result: MissionResult
    story: tuple[MissionEvent, ...]
    takeoff_s: float | None = None
    """From the first process to mission time 0 [s of the vehicles' clock]."""
    wall_s: float | None = None
    """Wall time from first to last [s]; None in virtual time."""
    speedup: float | None = None
    """Mission seconds per wall second; None in virtual time."""
    fates: tuple[str, ...] = ()
    """How processes ended that should not have, a line each."""
    lost_because: Mapping[UavId, str] = field(default_factory=dict)
    """When and why UAVs were lost, as far as that is known: in a simulation."""
    value: float | None = None
    """What was flown is worth by what was drawn in a simulation [value·s]; None if unknown."""
    security: ProtectionSummary | None = None
    """What protected it; None if nothing did, or nothing had to."""
    executed_schedule: Schedule = field(default_factory=dict)
    """Where UAVs really went, and when, as far as that is known."""
    closest_approach: Approach | None = None
    """The nearest that two UAVs in the air came to each other; None of a single one, or if it is
    not known."""
    nearest_zone_m: float | None = None
    """Least distance of a UAV in flight from a zone [m]; None without zones, or if not known."""
    lowest_clearance_m: float | None = None
    """Least height of a UAV above the ground between its take-offs and landings [m]; None without
    [terrain], or if not known."""
    lowest_charge_frac: Mapping[str, float] = field(default_factory=dict)
    """By UAV, the least charge of its battery that was told while it took part."""
    left_out: Mapping[str, str] = field(default_factory=dict)
    """Tasks that the last plan left out and that were not done after all, each with why."""
    hint: str = _HINT
    """How to get more; the last line of `render`."""

    @property
    def verdict(self) -> str:
        """The whole result in one line."""
        return summary_line(self.mission, self.plan, self.result)

    @property
    def missed(self) -> tuple[TaskId, ...]:
        """Tasks that should have been done, and were not."""
        return missed_tasks(self.mission, self.result)

    def as_json(self) -> dict[str, object]:
        """The report as `swarm run --json` prints it, ready for `json.dumps`.

        Holds the keys of `plan_as_json` (null or empty without a plan) and what was executed.
        Every number is finite; what is unknown is null.
        """
        result = self.result
        flown: dict[str, object] = {
            "executed_routes": {uav: list(tasks) for uav, tasks in result.executed_routes.items()},
            "executed_completion_s": dict(result.executed_completion_s),
            "executed_objective": result.executed_objective,
            "executed_schedule": schedule_as_json(self.executed_schedule),
            **approach_as_json(self.closest_approach, self.mission.separation_m),
            "nearest_zone_m": self.nearest_zone_m,
            "lowest_clearance_m": self.lowest_clearance_m,
            "lowest_charge_frac": dict(self.lowest_charge_frac),
            "done": list(result.done),
            "failed": list(result.failed),
            "open": list(result.open),
            "duplicate_visits": result.duplicate_visits,
            "makespan_s": result.makespan_s,
            "lost_uavs": list(result.lost_uavs),
            "epochs": result.epochs,
            "added": list(result.added),
            "takeoff_s": self.takeoff_s,
            "wall_s": self.wall_s,
            "speedup": self.speedup,
            "processes": list(self.fates),
            "security": None if self.security is None else self.security.as_json(),
            "story": [{"mission_s": line.mission_s, "text": line.text} for line in self.story],
            "lost_because": dict(self.lost_because),
            "value": self.value,
        }
        if result.rates:
            flown["calibration"] = {
                uav: {name: value for name, value in asdict(rates).items() if value}
                for uav, rates in result.rates.items()
            }
        planned = _no_plan(self.mission) if self.plan is None else plan_as_json(self.plan)
        planned |= areas_as_json(self.mission, _planned_tasks(self.plan), result.done)
        found: dict[str, object] = _finite({**planned, **flown})
        return found

    def as_markdown(self) -> str:
        """The report as a document, with the whole story."""
        parts = [
            f"# {self.mission.name}: mission report",
            f"**{self.verdict}.**",
            self._worth_as_markdown(),
            "\n".join(f"- {_escaped(line)}" for line in self._lines()),
            "## Lists",
            _LISTS_KEY,
            self._lists_as_markdown(),
            "## Story",
            self._story_as_markdown(),
        ]
        return "\n\n".join(part for part in parts if part) + "\n"

    def render(self, console: Console) -> None:
        """Print the report for people, in the width of ``console``, from 80 columns on."""
        mission, plan, result = self.mission, self.plan, self.result
        ascii_only = console.options.ascii_only
        signs = signs_for(ascii_only)
        style = BAD if self.missed else "bold green"
        parts: list[RenderableType] = [
            Text.assemble((f"{mission.name}: ", "bold"), (self.verdict, style))
        ]
        if plan is not None:
            sequence = list(plan.sequence or ())
            shown = sequence[:_IDS] + [signs.cut] * (len(sequence) > _IDS)
            order = "" if plan.sequence is None else f": {' > '.join(shown)}"
            parts.append(Text(f"planned by {plan.method}{order}", "dim"))
        parts += ["", _lists(compare_routes(mission, plan, result), plan is not None, signs)]
        parts += ["", _worth_table(plan, result, signs)]
        if notes := self.notes():
            parts += ["", _notes_table(notes, ascii_only)]
        if told := notable(self.story):
            parts += ["", _story_table(told, ascii_only)]
        if self.hint:
            parts += ["", Text(self.hint, "dim")]
        console.print(Group(*parts), highlight=False, markup=False)

    def notes(self) -> list[ReportFact]:
        """What went otherwise than planned, how long it took, and what became of processes."""
        found = deviations(self.mission, self.result)
        if self.lost_because:
            why = tuple(f"{uav} {what}" for uav, what in self.lost_because.items())
            found.insert(1, ReportFact("because", "", why))
        if self.value is not None and not math.isclose(self.value, self.result.executed_objective):
            text = f"{shown_value(self.value)} value·s: m·(D − t) of each success, failures nothing"
            found.append(ReportFact("by outcomes", text))
        if (near := self.closest_approach) is not None:
            found.append(nearest_fact(near, self.mission.separation_m))
        found += self._of_field()
        found += areas_in_words(self.mission, _planned_tasks(self.plan), self.result.done)
        spent = []
        if self.takeoff_s is not None:
            spent.append(f"take-off {shown_s(self.takeoff_s)} s")
        if self.wall_s is not None:
            fast = "" if self.speedup in (None, 1.0) else f" at speed-up {self.speedup:g}"
            spent.append(f"whole run {shown_s(self.wall_s)} s of wall time{fast}")
        if spent:
            found.append(ReportFact("time", "; ".join(spent)))
        if self.security is not None:
            found.append(self.security.fact)
        found += [ReportFact("process", clean(fate), bad=True) for fate in self.fates]
        return found

    def _of_field(self) -> list[ReportFact]:
        """What the plan left out and was not done after all; batteries that were changed."""
        found = []
        if self.left_out:
            ids = tuple(f"{task} ({why})" for task, why in self.left_out.items())
            found.append(ReportFact("left out", "by the plan", ids))
        swaps = {
            # The last entry may be a way home, where nothing is changed.
            uav: sum(
                e.base is not None and (e is not entries[-1] or e.end_s > e.begin_s)
                for e in entries
            )
            for uav, entries in self.executed_schedule.items()
        }
        if total := sum(swaps.values()):
            by = tuple(f"{uav} {count}" for uav, count in swaps.items() if count)
            found.append(ReportFact("batteries", f"changed {counted(total, 'time')}", by))
        return found

    def _lines(self) -> list[str]:
        lines = [f"{fact.name}: {fact.shown()}" for fact in self.notes()]
        if (plan := self.plan) is not None:
            order = "" if plan.sequence is None else f", sequence {' > '.join(plan.sequence)}"
            lines.insert(0, f"planned by {plan.method}{order}, seed {plan.seed}")
        return lines

    def _worth_as_markdown(self) -> str:
        rows = ["| | flown | planned | flown / planned | optimum | flown / optimum |"]
        rows.append("|---|---:|---:|---:|---:|---:|")
        for each in compare_quantities(self.plan, self.result):
            show = shown_s if each.unit == "s" else shown_value
            cells = [f"{each.name} [{each.unit}]", show(each.flown)]
            for other in (each.planned, each.optimum):
                cells.append("" if other is None else show(other))
                cells.append(f"{each.flown / other:.4f}" if other is not None and other > 0 else "")
            rows.append("| " + " | ".join(cells) + " |")
        return "\n".join(rows)

    def _lists_as_markdown(self) -> str:
        rows = ["| UAV | planned | flown | |", "|---|---|---|---|"]
        for each in compare_routes(self.mission, self.plan, self.result):
            planned = " ".join(stop.shown(planned=True) for stop in each.planned)
            flown = " ".join(stop.shown(planned=False) for stop in each.flown)
            said = "as planned" if each.same else "" if self.plan is None else "differs"
            mark = ", ".join(part for part in (said, "**lost**" if each.lost else "") if part)
            rows.append(f"| `{each.uav}` | {_code(planned)} | {_code(flown)} | {mark} |")
        return "\n".join(rows)

    def _story_as_markdown(self) -> str:
        if not self.story:
            return "Nothing was heard."
        rows = ["| mission time | |", "|---:|---|"]
        rows += [f"| {line.told_at} | {_escaped(clean(line.text))} |" for line in self.story]
        return "\n".join(rows)


def check_report_path(path: Path) -> None:
    """Refuse a report that could not be written, before there is anything to report.

    Raises:
        InputError: a wrong suffix, a directory, or a folder that is missing or closed to us.
    """
    suffixes = " or ".join(REPORT_SUFFIXES)
    problem, remedy = "", "name a file that can be written"
    if path.suffix.lower() not in REPORT_SUFFIXES:
        problem = f"no report is called {path.suffix!r}" if path.suffix else "it has no suffix"
        remedy = f"end it in {suffixes}"
    elif path.is_dir():
        problem = "it is a directory"
    elif not path.parent.is_dir():
        problem, remedy = f"there is no directory {path.parent}", "make it first"
    elif not os.access(path if path.exists() else path.parent, os.W_OK):
        problem = "it cannot be written"
    if problem:
        raise InputError(Fault("--report", str(path), problem, remedy))


def write_report(report: MissionReport, path: Path) -> None:
    """Write ``report`` to ``path``; its suffix says which kind.

    Raises:
        InputError: the suffix is not one of `REPORT_SUFFIXES`, or the file cannot be written.
    """
    check_report_path(path)
    if path.suffix.lower() == ".json":
        text = json.dumps(report.as_json(), allow_nan=False, indent=2) + "\n"
    else:
        text = report.as_markdown()
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        problem = f"cannot be written: {error.strerror or error}"
        remedy = "name a file that can"
        raise InputError(Fault("--report", str(path), problem, remedy)) from error


def _planned_tasks(plan: Plan | None) -> Collection[TaskId]:
    return () if plan is None else plan.completion_s


def _no_plan(mission: Mission) -> dict[str, object]:
    """The keys of a plan where there is none."""
    planned: dict[str, object] = {
        "scenario": mission.name,
        "method": None,
        "objective": None,
        "sequence": None,
        "routes": {},
        "completion_s": {},
        "optimum": None,
        "gap": None,
        "evaluations": 0,
        "elapsed_s": 0.0,
        "seed": None,
        "bound": None,
        "basis": None,
    }
    if mission.schema >= 2:  # nobody has decided what to leave out
        planned |= {"schedule": {}, "left_out": {}}
        planned |= {"required_left_out": None, "fewest_left_out": None}
    return planned


def _finite(value: Any) -> Any:
    """``value`` with null for every number JSON has no form for."""
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _code(text: str) -> str:
    return f"`{text}`" if text else "–"


def _escaped(text: str) -> str:
    """``text`` without anything that Markdown would obey."""
    return "".join(f"\\{sign}" if sign in "\\`*_[]<>|#" else sign for sign in text)


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
            share = "" if other is None or other <= 0.0 else f"{100.0 * each.flown / other:.2f} %"
            cells.append(Text(share))
        table.add_row(*cells[: len(table.columns)])
    return table


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
