"""The UAVs of a running mission at a glance: what each does, and what is wrong.

Lines about trouble are there only when there is something to tell.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from rich.cells import set_cell_size
from rich.text import Text

from coordinator.mission_view.presentation import BAD, Signs, uav_colour
from coordinator.mission_view.scene import Scene
from coordinator.mission_view.uav_state import LOST, UavView
from coordinator.mission_view.wording import clean, command_in_words, zone_said
from swarm.model.ids import FLEET
from swarm.protocol.messages import CommandKind, MissionPhase
from swarm.protocol.uav_messages import StatusPhase

_DOES_CELLS = len(StatusPhase.PREPARING)
_ETA_CELLS = 7
_DONE_CELLS = 5
_BATTERY_CELLS = 5
_SORTIE_CELLS = 7
_SWAPS_CELLS = 6
_HEIGHT_CELLS = 6
_LONGEST_ID = 12
_SHORTEST_NOTE = 10
_SOON_S = 60.0
"""Who has to land within that is worth a look."""
_GAP = 2
"""Columns between two tables side by side."""


def fit_cells(text: str, width: int, signs: Signs) -> str:
    """``text`` in exactly ``width`` cells, marked where it was cut off."""
    if width <= 0:
        return ""
    sized = set_cell_size(text, width)
    if sized.rstrip() == text.rstrip():
        return sized
    return set_cell_size(text, width - 1) + signs.cut


@dataclass(frozen=True, slots=True)
class _ColumnWidths:
    """Widths [cells]."""

    id: int
    task: int
    battery: bool
    sorties: bool
    """Whether batteries end, so that it matters how long they last and how often they are
    changed."""
    heights: bool
    """Whether UAVs share height layers, so that it matters in which each is."""
    eta_digits: int

    @property
    def total(self) -> int:
        """All columns, without room for notes."""
        battery = _BATTERY_CELLS if self.battery else 0
        sorties = _SORTIE_CELLS + _SWAPS_CELLS if self.sorties else 0
        heights = _HEIGHT_CELLS if self.heights else 0
        before_task = 2 + self.id + 1 + _DOES_CELLS + 1
        return before_task + self.task + _ETA_CELLS + _DONE_CELLS + battery + sorties + heights


def table_width(scene: Scene) -> int:
    """Cells one table takes, without room for notes."""
    return _columns(scene).total


def fleet_table(scene: Scene, width: int, height: int, signs: Signs) -> list[Text]:
    """The table: ``height`` lines of at most ``width`` cells.

    A fleet that does not fit is shown in several columns; if it still does not fit, those come
    first that are to be looked at (`_urgency`), and the last line counts the others.
    """
    columns = _columns(scene)
    rows = max(0, height - 1)
    blocks = 1
    if len(scene.uavs) > rows:
        blocks = max(1, (width + _GAP) // (columns.total + _GAP))
    block_width = (width - _GAP * (blocks - 1)) // blocks
    shown: Sequence[UavView] = scene.uavs
    hidden: Sequence[UavView] = ()
    if len(shown) > rows * blocks:
        rows = max(0, rows - 1)
        meeting = scene.about_to_meet
        by_urgency = sorted(scene.uavs, key=lambda uav: _urgency(uav, meets=uav.id in meeting))
        shown, hidden = by_urgency[: rows * blocks], by_urgency[rows * blocks :]
    lines = [_joined([_heading(columns, block_width, signs)] * blocks, block_width)]
    for row in range(min(rows, len(shown))):
        cells = [_row(uav, columns, block_width, signs) for uav in shown[row::rows]]
        lines.append(_joined(cells, block_width))
    if hidden:
        counts = Counter(uav.does for uav in hidden).most_common()
        text = f"{signs.cut} and {len(hidden)} more: "
        text += ", ".join(f"{number} {does}" for does, number in counts)
        lines.append(Text(fit_cells(text, width, signs), "dim"))
    return lines[:height]


def task_lists(scene: Scene, width: int, height: int, signs: Signs) -> list[Text]:
    """Every UAV's list, flown and ahead, under a blank line; nothing if not all have room."""
    nothing = not any(uav.planned or uav.flown or uav.task for uav in scene.uavs)
    if nothing or height < len(scene.uavs) + 3:
        return []
    columns = _columns(scene)
    lines = [Text(), Text(fit_cells("  lists: flown, current and planned", width, signs), "dim")]
    for uav in scene.uavs:
        ahead = [task for task in uav.planned if task != uav.task]
        current = [] if uav.task is None else [uav.task]
        colour = f"bold {uav_colour(uav.number)}"
        parts = [
            *((f"{signs.done}{task}", colour) for task in uav.flown),
            *((f"{signs.taken}{task}", colour) for task in current),
            *((f"{signs.open}{task}", "dim") for task in ahead),
        ]
        line = Text().append(
            f"  {fit_cells(uav.id, columns.id, signs)}", "dim" if uav.troubled else ""
        )
        # What is long past makes room for what is next.
        past = len(uav.flown)
        while past > 1 and sum(len(part) + 1 for part, _ in parts) + line.cell_len + 4 > width:
            del parts[0]
            past -= 1
        if past < len(uav.flown):
            line.append(f" {signs.cut}", "dim")
        for number, (part, style) in enumerate(parts):
            left = 2 if number < len(parts) - 1 else 0
            if line.cell_len + 1 + len(part) + left > width:
                line.append(f" {signs.cut}", "dim")
                break
            line.append(f" {part}", style)
        lines.append(line)
    return lines


def _columns(scene: Scene) -> _ColumnWidths:
    longest_id = max((len(uav.id) for uav in scene.uavs), default=3)
    goals = [*(task.id for task in scene.mission.tasks), *(b.id for b in scene.mission.bases)]
    longest_task = max(map(len, goals), default=4)
    return _ColumnWidths(
        id=min(_LONGEST_ID, max(3, longest_id)),
        task=min(_LONGEST_ID, max(4, longest_task)),
        battery=any(uav.battery_frac is not None for uav in scene.uavs),
        sorties=scene.has_sorties,
        heights=scene.mission.separation_m is not None,
        eta_digits=2 if scene.mission.horizon_s < 100.0 else 0,
    )


def _heading(columns: _ColumnWidths, width: int, signs: Signs) -> Text:
    text = f"  {'UAV':<{columns.id}} {'does':<{_DOES_CELLS}} {'task':<{columns.task}}"
    text += f"{'ETA':>{_ETA_CELLS}}{'done':>{_DONE_CELLS}}"
    if columns.battery:
        text += f"{'batt':>{_BATTERY_CELLS}}"
    if columns.sorties:
        text += f"{'left':>{_SORTIE_CELLS}}{'swaps':>{_SWAPS_CELLS}}"
    if columns.heights:
        text += f"{'up':>{_HEIGHT_CELLS}}"
    return Text(fit_cells(text, width, signs), "dim")


def _row(uav: UavView, columns: _ColumnWidths, width: int, signs: Signs) -> Text:
    sign = signs.uav_lost if uav.troubled else signs.uav
    colour = BAD if uav.troubled else f"bold {uav_colour(uav.number)}"
    row = Text().append(f"{sign} {fit_cells(uav.id, columns.id, signs)} ", colour)
    does = uav.does.upper() if uav.troubled else uav.visit or uav.does
    if uav.silent_s is not None and not uav.troubled:
        does = f"silent {uav.silent_s:.0f}s"
    bad = uav.troubled or uav.silent_s is not None
    held = "yellow" if uav.does == StatusPhase.HOLDING else ""
    row.append(fit_cells(does, _DOES_CELLS, signs) + " ", BAD if bad else held)
    ascii_only = not signs.braille
    note = clean(uav.note, ascii_only=ascii_only)
    if uav.does in (StatusPhase.RETURNING, StatusPhase.HOME):
        note = ""  # the same for all, and the story's last line
    if note and (uav.unready or uav.does in (StatusPhase.OUT, StatusPhase.HOLDING)):
        row.append(fit_cells(note, width - row.cell_len, signs), "dim")
        return row
    row.append(fit_cells(uav.goal or signs.nothing, columns.task, signs), "" if uav.goal else "dim")
    row.append(f"{_eta(uav, columns.eta_digits):>{_ETA_CELLS}}{len(uav.flown):>{_DONE_CELLS}}")
    if columns.battery:
        charge = "" if uav.battery_frac is None else f"{100.0 * uav.battery_frac:.0f}%"
        row.append(f"{charge:>{_BATTERY_CELLS}}", BAD if uav.battery_low else "")
    if columns.sorties:
        left = "" if uav.sortie_left_s is None else f"{uav.sortie_left_s:.0f} s"
        row.append(f"{left:>{_SORTIE_CELLS}}{uav.swaps:>{_SWAPS_CELLS}}")
    if columns.heights:
        up = "" if uav.in_layer_enu_m is None else f"{uav.in_layer_enu_m[2]:.0f} m"
        row.append(f"{up:>{_HEIGHT_CELLS}}")
    room = width - row.cell_len - _GAP
    if note and room >= _SHORTEST_NOTE:
        row.append(" " * _GAP + fit_cells(note, room, signs), "dim")
    return row


def _eta(uav: UavView, digits: int) -> str:
    if uav.eta_s is None:
        return ""
    return f"{uav.eta_s:.{digits}f} s" if uav.eta_s > 0.0 else "now"


def _urgency(uav: UavView, *, meets: bool) -> int:
    """Trouble first, then who is about to meet another one or has to land soon, then those that
    keep the others waiting, then the busy."""
    if uav.troubled or uav.silent_s is not None:
        return 0
    if meets:
        return 1
    if uav.battery_low or (uav.sortie_left_s is not None and uav.sortie_left_s < _SOON_S):
        return 2
    if uav.unready or uav.does == StatusPhase.HOLDING:
        return 3
    return 4 if uav.busy else 5


def _joined(cells: Sequence[Text], width: int) -> Text:
    line = Text(no_wrap=True, end="")
    for number, cell in enumerate(cells):
        if number:
            line.append(" " * _GAP)
        padded = cell.copy()
        padded.truncate(width, overflow="crop", pad=number < len(cells) - 1)
        line.append_text(padded)
    return line


_MANY = 4
"""More names than that are counted instead of told."""
_LABEL_CELLS = 7


def alerts(scene: Scene, width: int, signs: Signs) -> list[Text]:
    """At most two lines of at most ``width`` cells: what is wrong, and the operator's words."""
    trouble, said = f" {signs.dot} ".join(_trouble(scene)), f" {signs.dot} ".join(_said(scene))
    parts = []
    if trouble:
        parts.append(("wrong", trouble, BAD, BAD))
    elif scene.dropped:
        text = f"nothing but {scene.dropped} dropped messages; see swarm status"
        parts.append(("wrong", text, "dim", "dim"))
    if said:
        parts.append(("orders", said, "bold yellow", "yellow"))
    lines = []
    for label, text, label_style, style in parts:
        line = Text().append(f"{label:<{_LABEL_CELLS}}", label_style)
        shown = clean(text, ascii_only=not signs.braille)
        lines.append(line.append(fit_cells(shown, width - _LABEL_CELLS, signs).rstrip(), style))
    return lines


def _trouble(scene: Scene) -> list[str]:
    """What is wrong right now, the worst first."""
    parts = []
    if scene.cut_s is not None:
        parts.append(f"own link LOST for {scene.cut_s:.0f} s: all this is old")
    if scene.phase is MissionPhase.RUNNING and not scene.coordinator and scene.cut_s is None:
        parts.append("coordinator not there")
    lost = [uav.id for uav in scene.uavs if uav.does == LOST]
    out = [uav.id for uav in scene.uavs if uav.does == StatusPhase.OUT]
    silent = [f"{uav.id} {uav.silent_s:.0f} s" for uav in scene.uavs if uav.silent_s is not None]
    parts += [
        f"{what} {', '.join(names) if len(names) <= _MANY else f'{len(names)} UAVs'}"
        for what, names in (("lost", lost), ("out", out), ("silent", silent))
        if names
    ]
    if parts and scene.dropped:
        parts.append(f"{scene.dropped} messages dropped")
    return parts


def _said(scene: Scene) -> list[str]:
    """What the operator has said that is still in force, the abort first."""
    lasting = [command for command in scene.commands if command.kind is not CommandKind.RESUME]
    ordered = sorted(lasting, key=lambda command: command.target != FLEET)
    drawn = [zone_said(edit) for edit in scene.zone_edits]
    return [*(command_in_words(command) for command in ordered), *drawn]
