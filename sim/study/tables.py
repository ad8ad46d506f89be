"""The tables of a study: Markdown for documents, rich ones for terminals of any width.

They can stand between two comments of a Markdown file, ``<!-- study NAME -->`` and
``<!-- end of study -->``, where one command renews them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console, ConsoleOptions, RenderResult
from rich.text import Text

from sim.study.statistics import Estimate
from sim.study.style import (
    IDEAL,
    NONE,
    interval_text,
    number_text,
    policy_label,
    quantity_of,
    spread_text,
    trials_text,
    uncertainty_words,
)
from sim.study.summary import PointSummary, PolicyResult, StudySummary, WallTimes
from sim.study.trial import BOUND
from swarm.runtime.errors import Fault, InputError
from swarm.runtime.table import Column, ResultTable
from swarm.scenario.files import decode, read_bytes
from swarm.scenario.findings import printable

_GAP = 2


def as_markdown(summary: StudySummary, *, every_setting: bool = False) -> str:
    """Tables for a document, with what they are of above them."""
    parts = ["\n".join(_about(summary))]
    parts += [each.as_markdown() for each in _grids(summary, every_setting=every_setting)]
    what = summary.about.what
    said = [f"- `{name}`: {what[name]}" for name in summary.policies if name in what]
    parts += ["\n".join(said)] if said else []
    return "\n\n".join(parts) + "\n"


@dataclass(frozen=True, slots=True)
class TerminalTables:
    """The study's own setting and what is varied, in parts as wide as the terminal is."""

    summary: StudySummary

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """As rich asks."""
        for line in _about(self.summary):
            yield Text(line.replace("`", ""))
        for grid in _grids(self.summary, every_setting=False):
            for part in _fitting(grid, options.max_width):
                yield Text()
                yield part


# -- tables -----------------------------------------------------------------------------


def _grids(summary: StudySummary, *, every_setting: bool) -> Iterator[ResultTable]:
    own = summary.own
    if own is not None:
        yield from _of_setting(summary, own)
        times = _times(summary, own)
        if times is not None:
            yield times
    for vary, settings in summary.varied.items():
        yield _against(summary, vary, settings)
    if every_setting:
        for each in summary.settings:
            if each is not own:
                yield from _of_setting(summary, each)


def _of_setting(summary: StudySummary, setting: PointSummary) -> Iterator[ResultTable]:
    """Two tables: values, and what happened."""
    where = _where(summary, setting)
    found = summary.of(setting)
    reference = summary.reference
    columns: list[tuple[str, Callable[[PolicyResult], str]]] = [
        ("J [value·s]", lambda each: number_text(each.value.value)),
        (
            f"J / {reference}'s",
            lambda each: "1" if each.policy == reference else interval_text(each.ratio),
        ),
        ("better in", lambda each: _share(None if each.policy == reference else each.better)),
        ("J / bound", lambda each: "1" if each.policy == BOUND else interval_text(each.of_bound)),
        ("all done in", lambda each: _share(each.complete)),
    ]
    if BOUND not in setting.policies:
        del columns[3]
    if any(each.trials != setting.trials for each in found):
        columns.append(("trials", lambda each: str(each.trials)))
    yield _grid(summary, f"Value{where} ({trials_text([setting])})", found, columns)
    flown = [each for each in found if each.means]
    in_field = any("breaches" in each.means for each in flown)
    yield _grid(
        summary,
        f"Per mission{where}",
        flown,
        [
            ("done", _mean("done")),
            ("failed", _mean("failed")),
            ("missed", _mean("missed")),
            ("done twice", _mean("duplicate_visits")),
            ("moved", _mean("moved")),
            ("released", _mean("released")),
            ("epochs", _mean("epochs")),
            ("messages", _mean("messages")),
            ("makespan [s]", _mean("makespan_s")),
            *([("required left", _mean("required_left"))] if in_field else []),
            *([("breaches", _mean("breaches"))] if in_field else []),
        ],
    )


def _times(summary: StudySummary, setting: PointSummary) -> ResultTable | None:
    timed = [each for each in summary.of(setting) if each.wall is not None]
    if not timed:
        return None
    on = f", on {summary.about.machine}" if summary.about.machine else ""
    return _grid(
        summary,
        f"Wall time of a decision or plan{_where(summary, setting)}",
        timed,
        [
            ("per mission", _mean("decisions")),
            ("median [ms]", _wall_ms(lambda wall: wall.median_s)),
            ("p99 [ms]", _wall_ms(lambda wall: wall.p99_s)),
            ("longest [ms]", _wall_ms(lambda wall: wall.max_s)),
        ],
        f"Median and p99: the median over trials of each trial's{on}.",
    )


def _against(summary: StudySummary, vary: str, settings: Sequence[PointSummary]) -> ResultTable:
    """Ratios against the values of one quantity."""
    quantity = quantity_of(vary)
    rows = [
        (
            policy_label(summary, name),
            *(_spread(summary, each.policies.get(name)) for each in settings),
        )
        for name in summary.policies
    ]
    reference = [each.policies.get(summary.reference) for each in settings]
    values = [NONE if each is None else number_text(each.value.value) for each in reference]
    return _table(
        ("policy", *(quantity.text(each.at or 0.0) for each in settings)),
        (*rows, (f"J of {summary.reference} [value·s]", *values)),
        f"J / {summary.reference}'s against {quantity.name} ({trials_text(settings)})",
    )


def _grid(
    summary: StudySummary,
    title: str,
    found: Sequence[PolicyResult],
    columns: Sequence[tuple[str, Callable[[PolicyResult], str]]],
    note: str = "",
) -> ResultTable:
    return _table(
        ("policy", *(heading for heading, _ in columns)),
        [(policy_label(summary, m.policy), *(of(m) for _, of in columns)) for m in found],
        title,
        note,
    )


def _table(
    headings: Sequence[str], rows: Sequence[Sequence[str]], title: str, note: str = ""
) -> ResultTable:
    """The first column names policies, the others are numbers as text."""
    policy, *numbers = headings
    return ResultTable((Column(policy, words=True), *map(Column, numbers)), rows, title, note)


def _fitting(grid: ResultTable, width: int) -> Iterator[ResultTable]:
    """The same in as few parts as fit, each with the policies, and about as wide as each other."""
    table = [[column.heading for column in grid.columns], *grid.cells()]
    name, *widths = (max(map(len, column)) + _GAP for column in zip(*table, strict=True))
    room = max(0, width - name + _GAP)
    fewest = len(_filled(widths, room))
    parts = next(p for most in range(room + 1) if len(p := _filled(widths, most)) == fewest)
    for part in parts:
        places = (0, *(1 + place for place in part))
        yield ResultTable(
            [grid.columns[place] for place in places],
            [[row[place] for place in places] for row in grid.rows],
            grid.title if part is parts[0] else f"{grid.title}, continued",
            grid.note if part is parts[-1] else "",
        )


def _filled(widths: Sequence[int], room: int) -> list[list[int]]:
    """Places in order, in parts whose widths together are at most ``room`` or that have one."""
    parts: list[list[int]] = []
    left = 0
    for place, width in enumerate(widths):
        if parts and width <= left:
            parts[-1].append(place)
        else:
            parts.append([place])
            left = room
        left -= width
    return parts


# -- words ------------------------------------------------------------------------------


def _where(summary: StudySummary, setting: PointSummary) -> str:
    """Which setting it is, for a title."""
    if setting.at is None:
        return ", the study's own setting" if summary.varied else ""
    quantity = quantity_of(setting.vary)
    return f", {quantity.name}: {quantity.text(setting.at)}"


def _about(summary: StudySummary) -> list[str]:
    about = summary.about
    told = [about.missions] if about.missions else []
    told += [uncertainty_words(about.uncertainty)] if about.uncertainty is not None else []
    run = [trials_text(summary.settings)] if summary.settings else ["no trials yet"]
    run += [f"seed {about.seed}"] if about.seed is not None else []
    text = f"{'; '.join([*told, ', '.join(run)])}."
    compared = (
        f"Ratios are of mean J to `{summary.reference}`'s, over the trials that both flew, with "
        "their paired 95 % interval (Fieller's)."
    )
    lines = [text[0].upper() + text[1:], compared]
    if about.ideal:
        lines.append(f"{IDEAL} modelled with ideal communication only.")
    return lines


def _spread(summary: StudySummary, each: PolicyResult | None) -> str:
    if each is None or each.policy != summary.reference:
        return spread_text(None if each is None else each.ratio)
    return "1"


def _share(estimate: Estimate | None) -> str:
    return NONE if estimate is None else f"{100.0 * estimate.value:.0f} %"


def _mean(name: str) -> Callable[[PolicyResult], str]:
    return lambda each: number_text(each.means[name].value) if name in each.means else NONE


def _wall_ms(of: Callable[[WallTimes], float]) -> Callable[[PolicyResult], str]:
    return lambda each: NONE if each.wall is None else number_text(1e3 * of(each.wall), decimals=6)


_WHAT = "Markdown file"
_END = "<!-- end of study -->"


class MarkedFile:
    """A Markdown file with the markers of the study ``name``.

    It is read at once, so that it is refused before anything is flown.

    Raises:
        InputError: the file cannot be read, or the markers are not there.
    """

    def __init__(self, path: Path, name: str) -> None:
        self._path = path
        self._begin = f"<!-- study {name} -->"
        self._parts()

    def replace(self, text: str) -> None:
        """Put ``text`` between the markers; everything else stays.

        Raises:
            InputError: the file cannot be written, or the markers have gone.
        """
        before, after = self._parts()
        try:
            with self._path.open("w", encoding="utf-8", newline="") as file:
                file.write(f"{before}{self._begin}\n\n{text.strip()}\n\n{_END}{after}")
        except OSError as error:
            problem = f"cannot be written: {error.strerror or error}"
            raise InputError(self._fault(problem, "give a file that can be written")) from error

    def _parts(self) -> tuple[str, str]:
        """What stands before and after the markers."""
        text = decode(read_bytes(self._path, _WHAT), printable(str(self._path)), _WHAT)
        before, begin, rest = text.partition(self._begin)
        _, end, after = rest.partition(_END)
        if not begin or not end:
            problem = f"has no lines {self._begin} and {_END}"
            raise InputError(self._fault(problem, "put them where the table is to stand"))
        return before, after

    def _fault(self, problem: str, remedy: str) -> Fault:
        return Fault("--update", printable(str(self._path)), problem, remedy)
