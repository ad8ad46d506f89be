"""The live picture of a running mission in a terminal: map, fleet, worth and story.

Off a terminal, only new lines of the story are printed.
"""

from __future__ import annotations

from collections.abc import Sequence
from types import TracebackType
from typing import Self

from rich.console import Console, Group, RenderableType
from rich.control import Control
from rich.live import Live
from rich.text import Text

from coordinator.mission_view.mission_state import MissionState
from coordinator.mission_view.observation import deserted
from coordinator.mission_view.presentation import (
    BAD,
    Signs,
    signs_for,
    story_line,
    story_style,
)
from coordinator.mission_view.results import refusals
from coordinator.mission_view.scene import LEFT_OUT, TAKEN, Scene, scene_of
from coordinator.mission_view.story import MissionEvent
from coordinator.mission_view.wording import clean, conflict_in_words, shown_m, shown_value
from coordinator.terminal.fleet_table import alerts, fit_cells, fleet_table, table_width, task_lists
from coordinator.terminal.map_panel import ideal_width, map_panel
from swarm.protocol.board import TaskState
from swarm.protocol.messages import MissionPhase

_WIDE = 104
"""Columns from which on the story stands beside the map and not below."""
_COLUMN = 48
"""Narrowest column beside the map that can hold counts and story."""
_NARROWEST_MAP = 24
_TALLEST = 60
"""No picture is higher, however high the terminal."""
_PHASE_STYLE = {
    MissionPhase.PREPARING: "bold yellow",
    MissionPhase.RUNNING: "bold green",
    MissionPhase.ENDED: "bold",
}


def live_picture(
    mission_state: MissionState,
    now_s: float,
    *,
    width: int,
    height: int,
    speedup: float = 1.0,
    secure: bool = False,
    ascii_only: bool = False,
) -> RenderableType:
    """What ``mission_state`` knows, as exactly ``height`` lines of at most ``width`` cells.

    From 8 lines on everything has a place. The speed-up [mission s per wall s] is shown when not 1;
    ``secure`` missions have keys, and it says how much was refused.
    """
    signs = signs_for(ascii_only)
    scene = scene_of(mission_state, now_s)
    body = _wide if width >= _WIDE else _narrow
    refused = sum(refusals(mission_state.dropped.values()).values()) if secure else None
    lines = [mission_title(scene, width, speedup, signs, refused)]
    lines += body(mission_state, scene, width, height - 1, signs)
    lines += [Text() for _ in range(height - len(lines))]
    for line in lines:
        line.truncate(width, overflow="crop")
        line.no_wrap = True
        line.end = "\n"
    return Group(*lines[:height])


class LiveView:
    """Shows a mission on ``console`` while it runs; use it as a context manager.

    On a terminal a picture is redrawn by every `update` and its last state stays there.
    Elsewhere each new line of the story is printed once.

    Args:
        console: where to; standard error, so that results have standard output alone.
    """

    def __init__(self, console: Console, *, speedup: float = 1.0, secure: bool = False) -> None:
        self._console = console
        self._speedup = speedup
        self._secure = secure
        self._told = 0
        self._noticed = ""
        self._cut = False
        self._size = console.size
        self._live: Live | None = None

    def __enter__(self) -> Self:
        if self._console.is_terminal and not self._console.is_dumb_terminal:
            self._live = Live(
                console=self._console,
                auto_refresh=False,
                # Standard output is for results; what goes to standard error meanwhile, such
                # as logs, appears above the picture.
                redirect_stdout=False,
            )
            self._live.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if self._live is not None:
            self._live.stop()
            self._live = None

    def update(self, mission_state: MissionState, now_s: float) -> None:
        """Show what ``mission_state`` knows at ``now_s``."""
        if self._live is None:
            self._tell(mission_state)
            return
        # One line less than there is: a full screen would scroll at its end.
        width, height = self._console.size
        frame = live_picture(
            mission_state,
            now_s,
            width=width,
            height=min(_TALLEST, max(1, height - 1)),
            speedup=self._speedup * mission_state.pace,
            secure=self._secure,
            ascii_only=self._ascii_only,
        )
        self._show(frame)

    def wait(self, text: str) -> None:
        """Say what is waited for, before there is a mission to show."""
        if self._live is not None:
            line = Text(clean(text, ascii_only=self._ascii_only), "dim", no_wrap=True)
            self._show(line)
        else:
            self._notice(text)

    def _show(self, frame: RenderableType) -> None:
        if self._live is None:
            return
        if self._console.size != self._size:
            # What stands there was wrapped anew by the terminal: nobody knows where it begins.
            self._size = self._console.size
            self._console.control(Control.clear(), Control.home())
        self._live.update(frame, refresh=True)

    def _tell(self, mission_state: MissionState) -> None:
        for happening in mission_state.told_since(self._told):
            line = story_line(happening, ascii_only=self._ascii_only)
            self._console.print(Text(line), soft_wrap=True)
        self._told = mission_state.told
        cut = mission_state.cut_since_s is not None and not deserted(mission_state)
        if cut != self._cut:
            self._cut = cut
            self._notice(f"own link to the bus is {'lost' if cut else 'back'}")

    def _notice(self, text: str) -> None:
        """Print ``text`` unless it is what was printed last."""
        if text != self._noticed:
            self._noticed = text
            self._console.print(Text(clean(text, ascii_only=self._ascii_only)), soft_wrap=True)

    @property
    def _ascii_only(self) -> bool:
        return self._console.options.ascii_only


# -- layouts ------------------------------------------------------------------------


def _narrow(
    mission_state: MissionState, scene: Scene, width: int, height: int, signs: Signs
) -> list[Text]:
    """Map and fleet side by side, counts and story below."""
    n_story = max(0, min(10, height // 4))
    worth = [*_worth(scene, width, signs), *alerts(scene, width, signs)]
    above = max(0, height - len(worth) - n_story)
    lines = []
    map_width = min(max(_NARROWEST_MAP, ideal_width(scene, above)), width - table_width(scene) - 2)
    if map_width >= _NARROWEST_MAP and above >= 5:
        rest = width - map_width - 1
        table = fleet_table(scene, rest, above, signs)
        table += task_lists(scene, rest, above - len(table), signs)
        lines += _beside(map_panel(scene, map_width, above, signs), table)
    else:
        lines += fleet_table(scene, width, above, signs)
    lines += [Text()] * (above - len(lines))
    return [*lines, *worth, *_story(mission_state, width, n_story, signs)]


def _wide(
    mission_state: MissionState, scene: Scene, width: int, height: int, signs: Signs
) -> list[Text]:
    """The map as large as can be; fleet, counts and story in a column beside it."""
    column = max(_COLUMN, table_width(scene))
    map_width = min(max(_NARROWEST_MAP, ideal_width(scene, height)), width - column - 2)
    rest = width - map_width - 1
    worth = [*_worth(scene, rest, signs), *alerts(scene, rest, signs)]
    least_story = max(4, height // 5)
    n_table = min(len(scene.uavs) + 1, max(2, height - len(worth) - least_story - 2))
    table = fleet_table(scene, rest, n_table, signs)
    table += task_lists(scene, rest, height - len(table) - len(worth) - least_story - 2, signs)
    n_story = height - len(table) - len(worth) - 2
    story = _story(mission_state, rest, n_story, signs)
    return _beside(
        map_panel(scene, map_width, height, signs), [*table, Text(), *worth, Text(), *story]
    )


def _beside(left: list[Text], right: list[Text]) -> list[Text]:
    lines = []
    for number, line in enumerate(left):
        joined = Text.assemble(line, " ", no_wrap=True)
        if number < len(right):
            joined.append_text(right[number])
        lines.append(joined)
    return lines


# -- parts --------------------------------------------------------------------------


def mission_title(
    scene: Scene, width: int, speedup: float, signs: Signs, refused: int | None = None
) -> Text:
    """One line: mission, phase, time and pecking order; with keys, what has been refused."""
    line = Text().append(clean(scene.mission.name), "bold")
    between = f" {signs.dot} "
    line.append(between)
    aborted = scene.aborted and scene.phase is not MissionPhase.ENDED
    line.append("ABORTED" if aborted else scene.phase.upper(), _PHASE_STYLE[scene.phase])
    if refused is not None:
        line.append(f"{between}secure", "green")
        line.append(f", {refused} refused" if refused else "", BAD)
    if scene.mission_s is not None:
        horizon_s = scene.mission.horizon_s
        line.append(f"{between}mission time {scene.mission_s:.1f} s")
        late = scene.phase is MissionPhase.RUNNING and scene.mission_s > horizon_s
        line.append(f" (D = {horizon_s:g} s)", BAD if late else "dim")
    if speedup != 1.0:
        line.append(f"{between}{signs.times}{speedup:.3g}")
    if scene.rule is not None:
        order = " > ".join(scene.sequence)
        text = f"{between}{scene.rule}" + (f": {order}" if order else "")
        line.append(fit_cells(text, max(0, width - line.cell_len), signs).rstrip())
    return line


def task_counts(scene: Scene, signs: Signs) -> Text:
    """Tasks by state, which is also the key to their signs."""
    count = scene.counts
    withdrawn = count[TaskState.WITHDRAWN]
    parts = [
        (signs.done, f"{count[TaskState.DONE]} of {len(scene.tasks) - withdrawn} done", ""),
        (signs.taken, f"{count[TAKEN]} taken", ""),
        (signs.open, f"{count[TaskState.OPEN]} open", ""),
    ]
    if left_out := count[LEFT_OUT]:
        parts.append((signs.left_out, f"{left_out} left out", "yellow"))
    if failed := count[TaskState.FAILED]:
        parts.append((signs.failed, f"{failed} failed", BAD))
    if withdrawn:
        parts.append((" ", f"{withdrawn} withdrawn", "dim"))
    counts = Text()
    for sign, text, style in parts:
        counts.append(f"{sign} ", f"bold {style}")
        counts.append(f"{text}  ", style)
    return counts


def _worth(scene: Scene, width: int, signs: Signs) -> list[Text]:
    """Tasks by state, and J against plan and optimum."""
    counts = Text().append("tasks  ", "bold").append_text(task_counts(scene, signs))
    value = Text().append("J      ", "bold")
    value.append(shown_value(scene.objective), "bold")
    if scene.planned_objective is not None:
        value.append(f" of {shown_value(scene.planned_objective)} planned")
    if scene.optimum is not None:
        value.append(f", optimum {shown_value(scene.optimum)}")
    bar_width = width - value.cell_len - 2
    if width < _WIDE - _COLUMN:
        bar_width = max(0, width - 8)
        bar = Text("       ").append_text(_bar(scene, bar_width, signs))
        return [counts, value, bar, *_near(scene, width, signs)]
    value.append("  ")
    value.append_text(_bar(scene, min(60, bar_width), signs))
    return [counts, value, *_near(scene, width, signs)]


def _near(scene: Scene, width: int, signs: Signs) -> list[Text]:
    """Who is near to whom, who has been, and who would soon come too near."""
    lines = _nearest(scene, width, signs)
    if scene.conflicts:
        soonest, more = conflict_in_words(scene.conflicts[0]), len(scene.conflicts) - 1
        told = f"{soonest}{f', and {more} more' if more else ''}"
        shown = clean(told, ascii_only=not signs.braille)
        line = Text(f"{'meet':<7}", BAD)
        lines.append(line.append(fit_cells(shown, width - 7, signs).rstrip(), BAD))
    return lines


def _nearest(scene: Scene, width: int, signs: Signs) -> list[Text]:
    """Which two UAVs are nearest to each other, and which have been; nothing of a single one."""
    told = []
    for near, when in ((scene.nearest_now, "now"), (scene.nearest, "so far")):
        if near is None:
            continue
        at = "" if when == "now" or near.at_s is None else f" at {near.at_s:.1f} s"
        apart = f"{' '.join(near.uavs)} {shown_m(near.distance_m)} m {when}{at}"
        style = BAD if near.is_within(scene.mission.separation_m) else ""
        told.append(Text(clean(apart, ascii_only=not signs.braille), style))
    heading = Text("near   ", "bold")
    if heading.cell_len + sum(each.cell_len for each in told) + 3 <= width:
        return [heading.append_text(Text("   ").join(told))] if told else []
    return [
        Text.assemble("       " if number else heading, each) for number, each in enumerate(told)
    ]


def _bar(scene: Scene, width: int, signs: Signs) -> Text:
    """J so far, with marks where plan and optimum are."""
    marks = [mark for mark in (scene.planned_objective, scene.optimum) if mark is not None]
    largest = max([scene.objective, *marks, 0.0])
    if not marks or width < 8 or largest <= 0.0:
        return Text()
    cells = [signs.bar_empty] * width
    styles = ["dim"] * width
    for cell in range(round(width * max(0.0, scene.objective) / largest)):
        cells[cell], styles[cell] = signs.bar_full, "green"
    for mark in marks:
        if mark > 0.0:
            cell = min(width - 1, round(width * mark / largest))
            cells[cell], styles[cell] = signs.bar_mark, "bold"
    return Text.assemble(*zip(cells, styles, strict=True))


def _story(mission_state: MissionState, width: int, height: int, signs: Signs) -> list[Text]:
    """The newest lines of the story under a headline."""
    if height < 2:
        return [Text()] * max(0, height)
    headline = f"{signs.horizontal * 2} story "
    lines = [Text(headline + signs.horizontal * max(0, width - len(headline)), "dim")]
    for happening in _newest(mission_state.story, height - 1):
        line = story_line(happening, ascii_only=not signs.braille)
        lines.append(Text(fit_cells(line, width, signs).rstrip(), story_style(happening)))
    return lines + [Text()] * (height - len(lines))


def _newest(story: Sequence[MissionEvent], count: int) -> list[MissionEvent]:
    """The newest lines; the last things that went wrong stay among them."""
    newest = list(story[-count:])
    pinned = [line for line in story[:-count] if line.is_trouble][-max(1, count // 4) :]
    return [*pinned, *newest[len(pinned) :]]
