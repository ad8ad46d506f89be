"""What a process of a mission subscribes to, and how others see that it is there."""

from __future__ import annotations

from swarm.bus.port import Bus
from swarm.protocol.key_space import KeySpace


def gathered_keys(keys: KeySpace) -> tuple[str, ...]:
    """What everybody says with each decision, and what is only repeated."""
    return keys.claim("*"), keys.outcome("*", "*"), keys.board("*")


def join_mission(
    bus: Bus,
    mission: str,
    name: str | None,
    *,
    status: bool,
    every_status: bool = False,
    addressed: bool = False,
) -> None:
    """Subscribe to what every process of a mission needs, and show that this one is there.

    Subscribes to ``brief``, ``plan``, ``board/*``, ``uav/*/claim``, ``uav/*/outcome/*``,
    ``uav/*/calibration``, ``operator/*``, ``operator/task/*``, ``operator/start/*``,
    ``operator/zone/*`` and ``operator/ready/*``, where there are keys ``roster``, watches
    ``alive/*``.

    Args:
        bus: an open bus.
        mission: mission name.
        name: writer id: declares ``alive/<name>`` and serves ``state/<name>``; None for
            an observer.
        status: subscribe to ``uav/*/status`` too, newest first, and to ``uav/*/choice``.
        every_status: of status keep all there is, for who records, not the newest alone.
        addressed: subscribe to ``uav/*/claim/<name>``, what UAVs claim and say to it alone.
    """
    keys = KeySpace(mission)
    for key_expr in (
        keys.brief,
        keys.plan,
        keys.board("*"),
        keys.claim("*"),
        keys.outcome("*", "*"),
        keys.calibration("*"),
        keys.operator("*"),
        keys.operator_task("*"),
        keys.operator_start("*"),
        keys.operator_zone("*"),
        keys.operator_ready("*"),
    ):
        bus.subscribe(key_expr)
    if status:
        bus.subscribe(keys.status("*"), latest=not every_status)
        bus.subscribe(keys.choice("*"))
    if bus.seal is not None:
        bus.subscribe(keys.roster)
    if addressed and name is not None:
        bus.subscribe(keys.claim_to("*", name))
    bus.watch_tokens(keys.alive("*"))
    if name is not None:
        bus.serve(keys.state(name))
        bus.declare_token(keys.alive(name))
