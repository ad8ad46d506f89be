"""How a mission stands, as an observer knows it: for people and for programs.

`mission_status` is the one place that reads a `MissionState`; whoever shows it again and again
calls it again and again.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from coordinator.mission_view.mission_state import MissionState
from coordinator.mission_view.presentation import BAD, Signs, uav_colour
from coordinator.mission_view.scene import TAKEN, Scene, scene_of
from coordinator.mission_view.uav_state import ABSENT, LOST
from coordinator.mission_view.wording import clean, command_in_words, shown_value
from coordinator.terminal.live_view import mission_title, task_counts
from swarm.model import TaskId, UavId
from swarm.model.ids import COORDINATOR
from swarm.protocol.board import TaskState
from swarm.protocol.messages import OperatorCommand

__all__ = ["MissionStatus", "UavStatus", "mission_status", "status_as_json", "status_table"]


@dataclass(frozen=True, slots=True)
class UavStatus:
    """How one UAV stands."""

    id: UavId
    does: str
    """`StatusPhase`, or lost, absent or starting."""
    task: TaskId | None
    eta_s: float | None
    """Predicted completion of its task, from now [s of mission]."""
    done: int
    """Tasks it has done."""
    position_enu_m: tuple[float, float, float] | None
    """[m; mission origin], in its height layer; None as long as it has told none."""
    battery_frac: float | None
    link_age_s: float | None
    """Since it last said something [s of the observer's clock]; None when it never has."""
    note: str
    dropped: Mapping[str, int]
    """Messages its agents have dropped, by reason."""


@dataclass(frozen=True, slots=True)
class MissionStatus:
    """How a mission stands."""

    scene: Scene
    epoch: int | None
    reason: str
    """Why that epoch."""
    others: tuple[str, ...]
    """Who else is there under a name that is no UAV's."""
    uavs: tuple[UavStatus, ...]

    @property
    def coordinator(self) -> bool:
        """Whether it is there."""
        return self.scene.coordinator

    @property
    def commands(self) -> tuple[OperatorCommand, ...]:
        """The operator's newest word to each whom there was any, in this flight."""
        return self.scene.commands

    @property
    def dropped(self) -> Mapping[str, int]:
        """Messages that all agents together have dropped, by reason, most first."""
        total = sum((Counter(uav.dropped) for uav in self.uavs), Counter[str]())
        return dict(total.most_common())


def mission_status(mission_state: MissionState, now_s: float) -> MissionStatus:
    """What ``mission_state`` knows at ``now_s``, in its own clock's seconds."""
    scene, epoch = scene_of(mission_state, now_s), mission_state.replica.epoch
    uavs = [
        UavStatus(
            id=view.id,
            does=view.now_does,
            task=view.now_task,
            eta_s=view.now_eta_s,
            done=len(view.flown),
            position_enu_m=view.in_layer_enu_m,
            battery_frac=view.battery_frac,
            link_age_s=view.link_age_s,
            note=view.note,
            dropped=dict(view.dropped),
        )
        for view in scene.uavs
    ]
    known = {COORDINATOR, *(uav.id for uav in uavs)}
    return MissionStatus(
        scene=scene,
        epoch=None if epoch is None else epoch.number,
        reason="" if epoch is None else epoch.reason,
        others=tuple(sorted(mission_state.present - known)),
        uavs=tuple(uavs),
    )


def status_as_json(status: MissionStatus) -> dict[str, Any]:
    """``status`` as `swarm status --json` prints it, ready for `json.dumps`."""
    scene = status.scene
    tasks = {state: scene.counts[state] for state in TaskState}
    return {
        "mission": scene.mission.name,
        "phase": scene.phase,
        "epoch": status.epoch,
        "reason": status.reason,
        "rule": scene.rule,
        "sequence": list(scene.sequence),
        "mission_s": scene.mission_s,
        "horizon_s": scene.mission.horizon_s,
        "objective": scene.objective,
        "planned_objective": scene.planned_objective,
        "tasks": tasks
        | {TaskState.OPEN: tasks[TaskState.OPEN] + scene.counts[TAKEN], TAKEN: scene.counts[TAKEN]},
        "link": scene.cut_s is None,
        "coordinator": status.coordinator,
        "others": list(status.others),
        "aborted": scene.aborted,
        "commands": {
            command.target: {"command": command.kind.value, "reason": command.reason}
            for command in status.commands
        },
        "uavs": [asdict(uav) for uav in status.uavs],
        "dropped": dict(status.dropped),
    }


def status_table(status: MissionStatus, width: int, signs: Signs) -> RenderableType:
    """``status`` for a terminal of ``width`` columns, 80 or more for all to have room."""
    scene = status.scene
    facts = Table.grid(padding=(0, 2, 0, 0))
    facts.add_column(style="bold", no_wrap=True)
    facts.add_column()
    if status.epoch is not None:
        facts.add_row("epoch", _line(f"{status.epoch}: {status.reason}", signs))
    facts.add_row("tasks", task_counts(scene, signs))
    facts.add_row("J so far", f"{shown_value(scene.objective)} value{signs.product}s")
    there = Text("there") if status.coordinator else Text("not there", BAD)
    facts.add_row("coordinator", there)
    if status.others:
        facts.add_row("also there", _line(", ".join(status.others), signs))
    for command in status.commands:
        facts.add_row("operator", _line(command_in_words(command), signs))
    parts: list[RenderableType] = [mission_title(scene, width, 1.0, signs), facts, ""]
    parts.append(_fleet(status, signs))
    if status.dropped:
        parts += ["", _dropped(status, signs)]
    return Group(*parts)


def _fleet(status: MissionStatus, signs: Signs) -> Table:
    table = Table(box=None, pad_edge=False, padding=(0, 1, 0, 0), header_style="dim")
    table.add_column("  UAV", no_wrap=True)
    table.add_column("does", no_wrap=True)
    table.add_column("task", no_wrap=True)
    table.add_column("done", justify="right")
    table.add_column("place [m]", justify="right", no_wrap=True)
    table.add_column("batt", justify="right")
    table.add_column("heard", justify="right", no_wrap=True)
    table.add_column("dropped", justify="right")
    table.add_column("note")
    for number, (uav, view) in enumerate(zip(status.uavs, status.scene.uavs, strict=True)):
        gone = uav.does in (LOST, ABSENT)
        colour = BAD if gone else f"bold {uav_colour(number)}"
        table.add_row(
            Text(f"{signs.uav_lost if gone else signs.uav} {uav.id}", colour),
            Text(uav.does.upper() if gone else uav.does, BAD if gone else ""),
            uav.task or Text(signs.nothing, "dim"),
            str(uav.done),
            _place(uav.position_enu_m, signs),
            Text(
                "" if uav.battery_frac is None else f"{uav.battery_frac:.0%}",
                BAD if view.battery_low else "",
            ),
            signs.nothing if uav.link_age_s is None else f"{uav.link_age_s:.1f} s",
            str(sum(uav.dropped.values())),
            _line(uav.note, signs),
        )
    return table


def _dropped(status: MissionStatus, signs: Signs) -> Table:
    """Dropped messages by reason: of the fleet, and who dropped most of them."""
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style="dim")
    table.add_column("messages dropped as")
    table.add_column("by the fleet", justify="right")
    table.add_column("most by")
    for reason, count in status.dropped.items():
        most = max(status.uavs, key=lambda uav: uav.dropped.get(reason, 0))
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
