"""What is wrong in a running mission, and what its operator has said, at a glance.

Lines that are there only when there is something to tell. Leaves out: when it came about,
which the story tells (coordinator.view.story).
"""

from __future__ import annotations

from collections.abc import Sequence

from rich.text import Text

from coordinator.view.fleet_table import fit
from coordinator.view.scene import LOST, Scene
from coordinator.view.signs import BAD, Signs
from coordinator.view.story import clean
from swarm.model.ids import FLEET
from swarm.state.commands import words
from swarm.wire.messages import CommandKind, EpochPhase, StatusPhase

__all__ = ["alerts"]

_MANY = 4
"""More names than that are counted instead of told."""
_LABEL_CELLS = 7


def alerts(scene: Scene, width: int, signs: Signs) -> list[Text]:
    """At most two lines of at most ``width`` cells: what is wrong, and the operator's words."""
    lines = []
    if trouble := _trouble(scene):
        line = Text().append(f"{'wrong':<{_LABEL_CELLS}}", BAD)
        text = clean(f" {signs.dot} ".join(trouble), ascii_only=not signs.braille)
        lines.append(line.append(fit(text, width - _LABEL_CELLS, signs).rstrip(), BAD))
    elif scene.dropped:
        text = f"nothing but {scene.dropped} dropped messages; see swarm status"
        line = Text().append(f"{'wrong':<{_LABEL_CELLS}}", "dim")
        lines.append(line.append(fit(text, width - _LABEL_CELLS, signs).rstrip(), "dim"))
    if said := _said(scene):
        text = clean(f" {signs.dot} ".join(said), ascii_only=not signs.braille)
        line = Text().append(f"{'orders':<{_LABEL_CELLS}}", "bold yellow")
        lines.append(line.append(fit(text, width - _LABEL_CELLS, signs).rstrip(), "yellow"))
    return lines


def _trouble(scene: Scene) -> list[str]:
    """What is wrong right now, the worst first."""
    parts = []
    if scene.cut_s is not None:
        parts.append(f"own link LOST for {scene.cut_s:.0f} s: all this is old")
    if scene.phase is EpochPhase.RUNNING and not scene.coordinator and scene.cut_s is None:
        parts.append("coordinator not there")
    lost = [uav.id for uav in scene.uavs if uav.does == LOST]
    out = [uav.id for uav in scene.uavs if uav.does == StatusPhase.OUT]
    silent = [f"{uav.id} {uav.silent_s:.0f} s" for uav in scene.uavs if uav.silent_s is not None]
    parts += [
        f"{what} {_named(names)}"
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
    whom = {FLEET: "mission"}
    return [f"{whom.get(command.target, command.target)} {words(command)}" for command in ordered]


def _named(names: Sequence[str]) -> str:
    return ", ".join(names) if len(names) <= _MANY else f"{len(names)} UAVs"
