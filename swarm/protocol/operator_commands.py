"""What the operator has said about the flight that is on: which word counts for whom.

A command names the run it was given for, so a new flight of the same mission inherits none.
Of those to one UAV and those to the fleet the newest decides what the UAV does; that the
mission is aborted holds whatever is said to a single UAV afterwards.
"""

from __future__ import annotations

from swarm.model.ids import FLEET
from swarm.protocol.field_messages import UavReady, ZoneEdit, ZoneSpec
from swarm.protocol.messages import CommandKind, OperatorCommand, Stamp, StartWithout, TaskEdit
from swarm.protocol.registers import Replica

BEING_STOPPED = "being stopped, "
"""Begins the note of a held UAV whose vehicle has not been seen to stand yet."""
CANNOT_HOLD = "cannot hold: "
"""Begins the note of a held UAV whose vehicle goes on."""
NOT_READY = "not ready: "
"""Begins the note of a UAV on the ground that must not start, though the operator said it may."""

_WORDS = {
    CommandKind.HOLD: "held by the operator",
    CommandKind.RESUME: "told by the operator to go on",
    CommandKind.RETURN: "sent home by the operator",
    CommandKind.ABORT: "aborted by the operator",
}


def anything_said(replica: Replica, run: int) -> bool:
    """Whether the operator has said anything about the flight of that number."""
    words: list[OperatorCommand | TaskEdit | StartWithout | ZoneEdit | UavReady] = [
        *(command for _, command in replica.commands.values()),
        *replica.task_orders.values(),
        *replica.starts.values(),
        *replica.zone_edits.values(),
        *(ready for _, ready in replica.readies.values()),
    ]
    return any(word.run == run for word in words)


def in_force(replica: Replica) -> dict[str, OperatorCommand]:
    """Target -> newest command to it; of the flight that the brief tells of, and no other."""
    return {target: command for target, (_, command) in _of_this_run(replica).items()}


def newest_command(replica: Replica, uav: str) -> tuple[Stamp, OperatorCommand] | None:
    """The newest command that concerns ``uav``, with its stamp; None if there is none."""
    if not replica.commands:
        return None
    commands = _of_this_run(replica)
    concerning = [commands[target] for target in (uav, FLEET) if target in commands]
    return max(concerning, key=lambda stamped: stamped[0], default=None)


def abort_command(replica: Replica) -> OperatorCommand | None:
    """The command that has ended this flight; None if there is none."""
    return in_force(replica).get(FLEET) if replica.commands else None


def dispensable(replica: Replica) -> dict[str, StartWithout]:
    """UAV -> the operator's word that this flight may start without it."""
    brief = replica.brief
    if brief is None:
        return {}
    return {uav: start for uav, start in replica.starts.items() if start.run == brief.run}


def zone_edits(replica: Replica) -> dict[str, ZoneEdit]:
    """Zone -> the operator's word about it in this flight, in the order of their ids."""
    brief = replica.brief
    if brief is None or not replica.zone_edits:
        return {}
    words = sorted(replica.zone_edits.items())
    return {zone: edit for zone, edit in words if edit.run == brief.run}


def zones_in_force(replica: Replica) -> tuple[ZoneSpec, ...]:
    """Where not to fly in this flight: the brief's zones as the operator has left them, then his.

    Equal wherever the registers are; who has no brief knows of none.
    """
    brief = replica.brief
    if brief is None:
        return ()
    if not replica.zone_edits:
        return brief.zones
    zones = {zone.id: zone for zone in brief.zones}
    for name, edit in zone_edits(replica).items():
        if edit.withdrawn:
            zones.pop(name, None)
        else:
            zones[name] = edit.zone
    return tuple(zones.values())


def readiness(replica: Replica) -> dict[str, Stamp]:
    """UAV -> stamp of the newest word that it may start again; each stamp counts once."""
    brief = replica.brief
    if brief is None:
        return {}
    return {uav: stamp for uav, (stamp, word) in replica.readies.items() if word.run == brief.run}


def describe_command(command: OperatorCommand) -> str:
    """What has happened to whom it concerns, and why."""
    said = _WORDS[command.kind]
    return f"{said}: {command.reason}"[:200] if command.reason else said


def _of_this_run(replica: Replica) -> dict[str, tuple[Stamp, OperatorCommand]]:
    if not replica.commands or replica.brief is None:
        return {}
    run = replica.brief.run
    return {
        target: stamped for target, stamped in replica.commands.items() if stamped[1].run == run
    }
