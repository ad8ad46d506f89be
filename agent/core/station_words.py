"""What a ground station beside the fleet may want of one UAV, what it is answered and shown.

Such a station hears the vehicle through the agent (`swarm agent --forward`). It is a person at the
vehicle, not the mission's operator: nobody on the bus knows of it. Leaves out: what of it reaches
the agent, and by which MAVLink messages (agent.vehicle.station_desk); what follows from it
(agent.core.ground_station).
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from swarm.protocol.uav_messages import StatusPhase


class StationWish(Enum):
    """What a ground station may ask for."""

    HOLD = "hold"
    """Stop, give the task up and wait; on the ground, stay there."""
    RESUME = "resume"
    """Go on after a hold that was asked for in this way."""
    RETURN = "return"
    """Fly home and take no further part."""
    READY = "ready"
    """Start again from the base: somebody has changed the battery."""
    ABORT = "abort"
    """As a return, of every vehicle that hears of it."""


class StationVerdict(Enum):
    """What became of a wish."""

    DONE = "done"
    """It is as was wished, or about to be."""
    NOT_NOW = "not now"
    """Asked again later it may be done."""
    DENIED = "denied"


@dataclass(frozen=True, slots=True)
class StationAsked:
    """A ground station asks for something."""

    number: int
    """Repeated by the answer."""
    wish: StationWish


@dataclass(frozen=True, slots=True)
class AnswerStation:
    """Tell the ground station what became of its wish."""

    number: int
    """That of the `StationAsked`."""
    verdict: StationVerdict
    reason: str = ""
    """For people, where there is more to say."""


@dataclass(frozen=True, slots=True)
class ShowStations:
    """Show every ground station what the UAV does."""

    uav: str
    phase: StatusPhase
    task: str | None
    """Id of the task that it claims."""
    task_number: int
    """Place of that task among all of the mission by id, from 1; 0 without one."""
    note: str
    """What its status tells a reader."""
    n_done: int
    n_open: int
    eta_s: float | None
    """Until its work at the task is predicted to end [s]; None without one."""


StationAction = AnswerStation | ShowStations
