"""What makes a virtual world less than ideal, and who is told what happens in it."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Protocol

from agent.core.agent_core import AgentCore
from agent.core.interface import GoTo, VehicleReport
from coordinator.core.lifecycle import Replan
from coordinator.mission_view.mission_state import MissionState
from coordinator.planner.online import ReplanResult, replan
from sim.world.engine import EventQueue, LocalClock, Process
from sim.world.motion import Point
from sim.world.network import Network
from sim.world.uncertainty import Realization
from sim.world.vehicles import IdealVehicle, SimulatedVehicle, VehicleFactory
from swarm.model import Mission, Plan, UavId
from swarm.protocol.events import CommonAction, CommonEvent, LogLine
from swarm.protocol.messages import Message
from swarm.protocol.timing import Timing
from swarm.runtime.shell import Core

QUIET = Timing(announce_s=1e4, status_s=1e4, silence_s=2.5e4)
"""Timers for an ideal bus: nothing is said twice, and who is silent has nothing to say."""

Planner = Callable[[Mission, str, int], Plan]
"""Plans a mission by method and seed."""


Replanner = Callable[[Replan], ReplanResult]
"""Plans the rest of a running mission."""


def planned_anew(wanted: Replan) -> ReplanResult:
    """What the coordinator's process would do, without a limit in time."""
    situation, course = wanted.situation, wanted.course
    return replan(situation, course, wanted.method, seed=wanted.seed, threads=1)


def ideal_vehicle(
    queue: EventQueue, uav: str, report: Callable[[VehicleReport], None]
) -> SimulatedVehicle:
    """One that flies ideally, whoever it belongs to."""
    del uav
    return IdealVehicle(queue, report)


def vehicles_of(
    mission: Mission,
    takeoff_s: float = 0.0,
    fate: Realization | None = None,
    errors: Callable[[str], Iterator[Point]] | None = None,
) -> VehicleFactory:
    """Ideal vehicles of the UAVs of ``mission``, or those of a realization in the field.

    ``errors`` of positions are for missions in the field alone.
    """
    if mission.is_plain:
        return ideal_vehicle
    from sim.world.field_vehicle import field_vehicles  # plain missions never load it

    return field_vehicles(mission, takeoff_s, fate, errors)


class RestartMemory(StrEnum):
    """What a process that starts anew finds of its earlier life."""

    DISK = "disk"
    """What it had kept."""
    NONE = "none"
    """Nothing: its disk is empty."""
    PAST = "past"
    """What it had kept, but the machine's calendar clock went back to a time before that."""


@dataclass(frozen=True, slots=True)
class ScheduledLosses:
    """What is lost, and when.

    Raises:
        ValueError: a time is negative.
    """

    lost_at_s: Mapping[UavId, float] = field(default_factory=dict)
    """Mission time at which a UAV disappears with its agent [s]."""
    coordinator_lost_at_s: float | None = None
    """Mission time at which the coordinator dies [s]."""

    def __post_init__(self) -> None:
        times = [*self.lost_at_s.values(), self.coordinator_lost_at_s or 0.0]
        if not all(time_s >= 0.0 for time_s in times):
            raise ValueError(f"faults happen at mission times >= 0, not {times}")


class WorldListener(Protocol):
    """Is told all that happens."""

    def said(self, process: Process, message: Message) -> None:
        """``process`` publishes ``message``."""
        ...

    def stepped(self, process: Process) -> None:
        """``process`` has made a step."""
        ...

    def raised(self, process: Process, fault: Exception) -> None:
        """The core of ``process`` has raised."""
        ...

    def refused(self, process: Process, order: GoTo) -> None:
        """The vehicle of ``process`` will not obey."""
        ...

    def noted(self, process: Process, note: LogLine) -> None:
        """``process`` has written a line into its log."""
        ...


@dataclass(frozen=True, slots=True)
class WorldSettings:
    """What makes a world less than ideal."""

    network: Callable[[EventQueue], Network]
    """Makes the network."""
    replan: Replanner = planned_anew
    """Plans the rest of a running mission."""
    clocks: Mapping[str, LocalClock] = field(default_factory=dict)
    """By process; the clocks of all others show virtual time."""
    standby: bool = False
    """Whether a second coordinator stands by."""
    kept: Collection[str] = ()
    """Processes whose disks are needed later."""
    plan_s: float = 0.0
    """How long planning takes [s]."""
    start_timeout_s: float = 60.0
    """UAVs that are not airborne by then are given up [s]."""
    telemetry_s: float | None = None
    """Interval at which vehicles tell their agents where they are [s]; None: before all that agents
    hear from others, and not between."""
    without_bus_s: float | None = None
    """Agents without their link for that long go home [s]; None: they fly on."""
    vehicle: VehicleFactory = ideal_vehicle
    """Makes the vehicle of a UAV."""
    agent: Callable[..., AgentCore] = AgentCore
    """Makes the core of an agent, from the arguments of `AgentCore`."""
    observer: Callable[[MissionState], Core[CommonEvent, CommonAction]] = lambda mission_state: (
        mission_state
    )
    """Makes the core of the observer, around its mission state."""
