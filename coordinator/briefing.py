"""A mission in the words of its registers: the brief, the board, and how they differ from a file.

Leaves out: when these are said (coordinator.core).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from swarm.model import Mission, Origin, Task
from swarm.model.frames import DEFAULT_ORIGIN
from swarm.state.registers import Replica
from swarm.wire.messages import Board, Brief, Fleet

__all__ = ["FlightLayers", "brief_of", "differences", "entry_of", "height_warning"]

HIGHEST_M = 120.0
"""Above it unmanned aircraft need a permit of their own in the EU, Britain and Switzerland; 122 m
(400 ft) in the USA."""


@dataclass(frozen=True, slots=True)
class FlightLayers:
    """Heights at which the UAVs fly, each its own.

    Raises:
        ValueError: a height is not positive.
    """

    lowest_m: float = 10.0
    """Height of the first UAV's layer above the places it visits [m]."""
    spacing_m: float = 3.0
    """Distance between neighbouring layers [m]."""

    def __post_init__(self) -> None:
        if not (self.lowest_m > 0.0 and self.spacing_m >= 0.0):
            raise ValueError(f"layers need lowest_m > 0 and spacing_m >= 0, not {self}")

    def layer_m(self, index: int) -> float:
        """Layer of the UAV with that place in the scenario [m]."""
        return self.lowest_m + index * self.spacing_m


def brief_of(mission: Mission, layers: FlightLayers, run: int) -> Brief:
    """What the agents need to know of ``mission``."""
    origin: Origin = mission.origin or DEFAULT_ORIGIN
    return Brief(
        horizon_s=mission.horizon_s,
        success_default=mission.success_default,
        survival_default=mission.survival_default,
        reattempt_failed=mission.reattempt_failed,
        run=run,
        origin=(origin.lat_deg, origin.lon_deg, origin.alt_m),
        uavs=tuple(
            Fleet(
                id=uav.id,
                position_enu_m=uav.position_enu_m,
                speed_m_s=uav.speed_m_s,
                success=dict(uav.success),
                survival=dict(uav.survival),
                kind=uav.kind,
                layer_m=layers.layer_m(index),
            )
            for index, uav in enumerate(mission.uavs)
        ),
    )


def height_warning(mission: Mission, layers: FlightLayers) -> str | None:
    """What to say of layers that reach too high, and what to do; None if they do not."""
    count = len(mission.uavs)
    above = sum(layers.layer_m(index) > HIGHEST_M for index in range(count))
    if not above:
        return None
    who = "1 UAV flies" if above == 1 else f"{above} UAVs fly"
    return (
        f"the highest of {count} height layers is {layers.layer_m(count - 1):g} m up, and {who} "
        f"above {HIGHEST_M:g} m, which many countries forbid: fly fewer UAVs, or let swarm "
        "coordinator lower --layer-spacing-m or --lowest-layer-m"
    )


def entry_of(task: Task, number: int) -> Board:
    """``task`` as an entry of the board, its ``number``-th."""
    return Board(
        task=task.id,
        number=number,
        position_enu_m=task.position_enu_m,
        value=task.value,
        service_s=task.service_s,
        kind=task.kind,
        withdrawn=False,
    )


def differences(mission: Mission, layers: FlightLayers, replica: Replica) -> list[str]:
    """In what the mission that the registers describe is not the one of the scenario file.

    What the operator has ordered about tasks is no difference, nor that a coordinator has
    withdrawn some or posted others, which it does for an operator.
    """
    found = []
    brief = replica.brief
    if brief is not None and brief != brief_of(mission, layers, brief.run):
        found.append("fleet, horizon or defaults")
    for number, task in enumerate(mission.tasks):
        entry = replica.posted.get(task.id)
        if entry is not None and replace(entry, withdrawn=False) != entry_of(task, number):
            found.append(f"task {task.id}")
    return found
