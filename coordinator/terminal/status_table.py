"""How a mission stands, as an observer knows it: for people and for programs."""

from __future__ import annotations

from typing import Any

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from coordinator.mission_view.approaches import approach_as_json
from coordinator.mission_view.presentation import BAD, Signs, uav_colour
from coordinator.mission_view.scene import LEFT_OUT, TAKEN, Scene
from coordinator.mission_view.uav_state import ABSENT, LOST, UavView
from coordinator.mission_view.wording import (
    approach_in_words,
    because,
    clean,
    command_in_words,
    conflict_in_words,
    counted,
    left_out_in_words,
    listed,
    rates_in_words,
    shown_value,
    zone_said,
)
from coordinator.terminal.live_view import mission_title, task_counts
from swarm.protocol.board import TaskState

_MOST_LEFT_OUT = 8
"""Tasks named that are left out."""
_MOST_CONFLICTS = 4
"""Conflicts named, the soonest."""


def status_as_json(scene: Scene) -> dict[str, Any]:
    """``scene`` as `swarm status --json` prints it, ready for `json.dumps`."""
    count = scene.counts
    tasks = {state: count[state] for state in TaskState}
    tasks[TaskState.OPEN] += count[TAKEN] + count[LEFT_OUT]
    return {
        "mission": scene.mission.name,
        "phase": scene.phase,
        "epoch": scene.epoch,
        "reason": scene.reason,
        "rule": scene.rule,
        "sequence": list(scene.sequence),
        "mission_s": scene.mission_s,
        "horizon_s": scene.mission.horizon_s,
        "objective": scene.objective,
        "planned_objective": scene.planned_objective,
        "left_out": scene.left_out,
        "zones": [zone.id for zone in scene.mission.zones],
        "bases": [base.id for base in scene.mission.bases],
        "zone_edits": {
            edit.zone.id: {"withdrawn": edit.withdrawn, "reason": edit.reason}
            for edit in scene.zone_edits
        },
        "tasks": tasks | {TAKEN: count[TAKEN]},
        "link": scene.cut_s is None,
        "coordinator": scene.coordinator,
        "others": list(scene.others),
        "aborted": scene.aborted,
        "commands": {
            command.target: {"command": command.kind.value, "reason": command.reason}
            for command in scene.commands
        },
        **approach_as_json(scene.nearest, scene.mission.separation_m),
        "nearest_now": None if scene.nearest_now is None else scene.nearest_now.as_json(),
        "predicted_conflicts": [conflict.as_json() for conflict in scene.conflicts],
        "uavs": [_uav_as_json(uav) for uav in scene.uavs],
        "dropped": scene.dropped_by_reason,
    }


def _uav_as_json(uav: UavView) -> dict[str, Any]:
    return {
        "id": uav.id,
        "does": uav.now_does,
        "task": uav.now_task,
        "eta_s": uav.now_eta_s,
        "done": len(uav.flown),
        "position_enu_m": uav.in_layer_enu_m,
        "battery_frac": uav.battery_frac,
        "base": uav.base,
        "stage": uav.stage,
        "sortie_left_s": uav.sortie_left_s,
        "swaps": uav.swaps,
        "link_age_s": uav.link_age_s,
        "time_frac": uav.rates.time_frac,
        "drain_frac": uav.rates.drain_frac,
        "acceleration_m_s2": uav.rates.acceleration_m_s2,
        "speed_limit_m_s": uav.rates.speed_m_s,
        "note": uav.note,
        "dropped": dict(uav.dropped),
    }


def status_table(scene: Scene, width: int, signs: Signs) -> RenderableType:
    """``scene`` for a terminal of ``width`` columns, 80 or more for all to have room."""
    facts = Table.grid(padding=(0, 2, 0, 0))
    facts.add_column(style="bold", no_wrap=True)
    facts.add_column()
    if scene.epoch is not None:
        facts.add_row("epoch", _line(f"{scene.epoch}: {scene.reason}", signs))
    facts.add_row("tasks", task_counts(scene, signs))
    facts.add_row("J so far", f"{shown_value(scene.objective)} value{signs.product}s")
    for name, near in (("nearest now", scene.nearest_now), ("nearest so far", scene.nearest)):
        if near is not None:
            style = BAD if near.is_within(scene.mission.separation_m) else ""
            facts.add_row(name, Text(approach_in_words(near), style))
    if scene.conflicts:
        told = listed([conflict_in_words(each) for each in scene.conflicts], _MOST_CONFLICTS)
        facts.add_row("about to meet", Text(told, BAD))
    there = Text("there") if scene.coordinator else Text("not there", BAD)
    facts.add_row("coordinator", there)
    if scene.others:
        facts.add_row("also there", _line(", ".join(scene.others), signs))
    if scene.left_out:
        facts.add_row("left out", _line(left_out_in_words(scene.left_out, _MOST_LEFT_OUT), signs))
    if scene.mission.zones:
        facts.add_row("zones", _line(listed([z.id for z in scene.mission.zones]), signs))
    if scene.mission.bases:
        facts.add_row("bases", _bases(scene, signs))
    for command in scene.commands:
        facts.add_row("operator", _line(command_in_words(command), signs))
    for edit in scene.zone_edits:
        facts.add_row("operator", _line(zone_said(edit), signs))
    for uav in scene.uavs:
        if not uav.rates.as_briefed:
            told = "parameters" if uav.rates.as_measured else "measured"
            facts.add_row(told, _line(f"{uav.id} {rates_in_words(uav.rates)}", signs))
    parts: list[RenderableType] = [mission_title(scene, width, 1.0, signs), facts, ""]
    parts.append(_fleet(scene, signs))
    if any(uav.note for uav in scene.uavs):
        parts += ["", _notes(scene, signs)]
    if scene.dropped_by_reason:
        parts += ["", _dropped(scene, signs)]
    return Group(*parts)


def _fleet(scene: Scene, signs: Signs) -> Table:
    table = Table(box=None, pad_edge=False, padding=(0, 1, 0, 0), header_style="dim")
    table.add_column("  UAV", no_wrap=True)
    table.add_column("does", no_wrap=True)
    table.add_column("task", no_wrap=True)
    table.add_column("done", justify="right")
    table.add_column("place [m]", justify="right", no_wrap=True)
    table.add_column("batt", justify="right")
    if scene.has_sorties:
        table.add_column("left", justify="right", no_wrap=True)
        table.add_column("swaps", justify="right")
    table.add_column("heard", justify="right", no_wrap=True)
    table.add_column("dropped", justify="right")
    for uav in scene.uavs:
        gone = uav.now_does in (LOST, ABSENT)
        colour = BAD if gone else f"bold {uav_colour(uav.number)}"
        goal = uav.goal if uav.there else None
        left = "" if uav.sortie_left_s is None else f"{uav.sortie_left_s:.0f} s"
        sorties = (left, str(uav.swaps)) if scene.has_sorties else ()
        table.add_row(
            Text(f"{signs.uav_lost if gone else signs.uav} {uav.id}", colour),
            Text(uav.now_does.upper() if gone else uav.visit or uav.now_does, BAD if gone else ""),
            goal or Text(signs.nothing, "dim"),
            str(len(uav.flown)),
            _place(uav.in_layer_enu_m, signs),
            Text(
                "" if uav.battery_frac is None else f"{uav.battery_frac:.0%}",
                BAD if uav.battery_low else "",
            ),
            *sorties,
            signs.nothing if uav.link_age_s is None else f"{uav.link_age_s:.1f} s",
            str(sum(uav.dropped.values())),
        )
    return table


def _notes(scene: Scene, signs: Signs) -> Table:
    """What UAVs say of themselves, on lines of their own: a column for it would be narrow."""
    table = Table.grid(padding=(0, 2, 0, 0))
    table.add_column(no_wrap=True)
    table.add_column()
    for uav in scene.uavs:
        if uav.note:
            name = Text(f"  {uav.id}", f"bold {uav_colour(uav.number)}")
            table.add_row(name, _line(uav.note, signs))
    return table


def _bases(scene: Scene, signs: Signs) -> Text:
    """Every base, with who stands there or is on the way."""
    parts = []
    for base in scene.mission.bases:
        who = [f"{uav.id} {uav.visit}" for uav in scene.uavs if uav.base == base.id and uav.visit]
        slots = "" if base.slots is None else f" ({counted(base.slots, 'slot')})"
        parts.append(f"{base.id}{slots}{because(', '.join(who))}")
    return _line("; ".join(parts), signs)


def _dropped(scene: Scene, signs: Signs) -> Table:
    """Dropped messages by reason: of the fleet, and who dropped most of them."""
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style="dim")
    table.add_column("messages dropped as")
    table.add_column("by the fleet", justify="right")
    table.add_column("most by")
    for reason, count in scene.dropped_by_reason.items():
        most = max(scene.uavs, key=lambda uav: uav.dropped.get(reason, 0))
        share = f"{most.id} ({most.dropped[reason]})"
        table.add_row(_line(reason, signs), str(count), share)
    return table


def _place(position_enu_m: tuple[float, float, float] | None, signs: Signs) -> str:
    if position_enu_m is None:
        return signs.nothing
    digits = 1 if max(map(abs, position_enu_m)) < 10.0 else 0
    # Adding 0 turns -0 into 0.
    return ", ".join(f"{round(each, digits) + 0.0:.{digits}f}" for each in position_enu_m)


def _line(text: str, signs: Signs) -> Text:
    return Text(clean(text, ascii_only=not signs.braille))
