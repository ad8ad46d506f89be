"""What is said: one frozen dataclass per kind of message, with its bounds.

Instants are mission time [s]; no machine's clock crosses the wire. Leaves out:
bytes and checking (swarm.wire.codec), and what a reader makes of it (swarm.state).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from functools import lru_cache
from typing import Annotated, ClassVar, Final

from annotated_types import Ge, Gt, Le, Len, Predicate
from pydantic import Strict

from swarm.model import Origin, valid_id
from swarm.model.ids import FLEET, RESERVED
from swarm.wire.keys import Keys

__all__ = [
    "LATEST_S",
    "MAX_COUNT",
    "SCHEMA_VERSION",
    "Board",
    "Body",
    "Brief",
    "Claim",
    "ClaimPhase",
    "Command",
    "CommandKind",
    "Epoch",
    "EpochPhase",
    "Fleet",
    "Message",
    "Outcome",
    "Result",
    "Snapshot",
    "Stamp",
    "Status",
    "StatusPhase",
]

SCHEMA_VERSION = 1

_CHECKED = {"extra": "forbid", "allow_inf_nan": False}

MAX_COUNT: Final = 2**53
"""Largest count; whoever counts on from what it heard stays within."""
LATEST_S: Final = 1e15
"""Farthest instant from mission time 0 [s]."""

# The bounds admit whatever a scenario may hold and keep every computation finite.
Id = Annotated[str, Strict(), Predicate(valid_id)]
Flag = Annotated[bool, Strict()]
Metres = Annotated[float, Strict(), Ge(-1e8), Le(1e8)]
Point = tuple[Metres, Metres, Metres]
Instant = Annotated[float, Strict(), Ge(-LATEST_S), Le(LATEST_S)]
Duration = Annotated[float, Strict(), Ge(0.0), Le(1e9)]
Horizon = Annotated[float, Strict(), Gt(0.0), Le(1e9)]
Speed = Annotated[float, Strict(), Ge(1e-6), Le(1e6)]
Value = Annotated[float, Strict(), Ge(0.0), Le(1e12)]
Probability = Annotated[float, Strict(), Ge(0.0), Le(1.0)]
Count = Annotated[int, Strict(), Ge(0), Le(MAX_COUNT)]
Reason = Annotated[str, Strict(), Len(1, 40)]
Words = Annotated[str, Strict(), Len(0, 200)]


@dataclass(frozen=True, slots=True, order=True)
class Stamp:
    """Order of one writer's statements in one register: later beats earlier."""

    __pydantic_config__: ClassVar = _CHECKED

    incarnation: Count
    """Grows whenever the writer's process starts anew."""
    counter: Count
    """Grows with every statement of one incarnation."""


@dataclass(frozen=True, slots=True)
class Fleet:
    """One UAV as the brief describes it."""

    __pydantic_config__: ClassVar = _CHECKED

    id: Id
    position_enu_m: Point
    """Start [m; mission origin], without the height layer."""
    speed_m_s: Speed
    success: Mapping[str, Probability]
    survival: Mapping[str, Probability]
    kind: Id | None
    layer_m: Metres
    """Height layer this UAV flies at [m], added to every place it flies to."""


@dataclass(frozen=True, slots=True)
class Brief:
    """Register ``brief``: what stays the same for a whole mission."""

    __pydantic_config__: ClassVar = _CHECKED

    horizon_s: Horizon
    success_default: Probability
    survival_default: Probability
    reattempt_failed: Flag
    run: Count
    """Tells this flight of the mission from earlier ones: stays when a coordinator resumes it."""
    origin: Point
    """Latitude [deg], longitude [deg], height above mean sea level [m]."""
    uavs: tuple[Fleet, ...]

    def __post_init__(self) -> None:
        Origin(*self.origin)
        ids = {uav.id for uav in self.uavs}
        if len(ids) != len(self.uavs) or not ids.isdisjoint(RESERVED):
            raise ValueError(f"UAV ids must differ, from each other and from {', '.join(RESERVED)}")


class EpochPhase(StrEnum):
    """How far the mission is."""

    PREPARING = "preparing"
    RUNNING = "running"
    ENDED = "ended"


@dataclass(frozen=True, slots=True)
class Epoch:
    """Register ``plan``: the pecking order in force."""

    __pydantic_config__: ClassVar = _CHECKED

    number: Count
    phase: EpochPhase
    rule: Id
    sequence: tuple[Id, ...]
    """Best rank first."""
    mission_s: Instant
    """Mission time at which this statement was made [s]."""
    reason: Words
    """Why this epoch, in words."""
    routes: Mapping[Id, tuple[Id, ...]]
    """Planned task lists by UAV; what rules make of them is theirs."""


@dataclass(frozen=True, slots=True)
class Board:
    """Register ``board/<task>``: one task of the task board."""

    __pydantic_config__: ClassVar = _CHECKED

    task: Id
    number: Count
    """Position on the board; ties between equally good tasks go to the smaller."""
    position_enu_m: Point
    value: Value
    service_s: Duration
    kind: Id | None
    withdrawn: Flag


class ClaimPhase(StrEnum):
    """How firmly a UAV holds its claim, or why it has none."""

    PROPOSED = "proposed"
    HELD = "held"
    IDLE = "idle"
    """Airborne and free to take a task."""
    PAUSED = "paused"
    """Stopped by the operator, in the air or on the ground: takes no task until told to go on."""
    OUT = "out"
    """Not taking part (any more)."""


@dataclass(frozen=True, slots=True)
class Claim:
    """Register ``uav/<id>/claim``: the task a UAV has taken."""

    __pydantic_config__: ClassVar = _CHECKED

    phase: ClaimPhase
    task: Id | None
    """None exactly when idle, paused or out: the tombstone of an earlier claim."""
    decided_s: Instant
    """Mission time at which the UAV was free to decide [s]."""
    rank: Count
    completion_s: Instant
    """Predicted completion [s mission time]."""
    handed_over: Flag = False
    """Out because somebody else has the vehicle: no later life of this agent commands it."""

    def __post_init__(self) -> None:
        if self.handed_over and self.phase is not ClaimPhase.OUT:
            raise ValueError(f"handed over, but {self.phase}")
        if (self.task is None) != (self.phase not in (ClaimPhase.PROPOSED, ClaimPhase.HELD)):
            raise ValueError(f"a claim that is {self.phase} names {self.task}")


class Result(StrEnum):
    """How an attempt ended."""

    DONE = "done"
    FAILED = "failed"


@dataclass(frozen=True, slots=True)
class Outcome:
    """Register ``uav/<id>/outcome/<task>``: how this UAV's last attempt ended."""

    __pydantic_config__: ClassVar = _CHECKED

    task: Id
    result: Result
    attempt: Annotated[int, Strict(), Ge(1), Le(MAX_COUNT)]
    completed_s: Instant
    """Mission time [s]."""


class StatusPhase(StrEnum):
    """What an agent is doing."""

    LEARNING = "learning"
    PREPARING = "preparing"
    IDLE = "idle"
    FLYING = "flying"
    SERVING = "serving"
    HOLDING = "holding"
    """Stopped by the operator."""
    RETURNING = "returning"
    HOME = "home"
    OUT = "out"


@dataclass(frozen=True, slots=True)
class Status:
    """Key ``uav/<id>/status``: news that may be dropped."""

    __pydantic_config__: ClassVar = _CHECKED

    phase: StatusPhase
    task: Id | None
    position_enu_m: Point | None
    """[m; mission origin], without the height layer."""
    velocity_enu_m_s: Point | None
    battery_frac: Probability | None
    mission_s: Instant | None
    dropped: Annotated[Mapping[Reason, Count], Len(0, 20)]
    """Messages this process has dropped, by reason: those of `swarm.wire.codec`, "too many"
    where the inbox was full, "stale" for registers older than known."""
    note: Words
    """What it waits for, in words."""


class CommandKind(StrEnum):
    """What an operator may want."""

    HOLD = "hold"
    """Stop where it is, give its task up and wait; on the ground, stay there."""
    RESUME = "resume"
    """Go on after a hold."""
    RETURN = "return"
    """Go home and take no further part."""
    ABORT = "abort"
    """Everybody goes home, and the mission is over."""


@dataclass(frozen=True, slots=True)
class Command:
    """Register ``operator/<target>``: the operator's newest word to one UAV, or to the fleet."""

    __pydantic_config__: ClassVar = _CHECKED

    target: Id
    """Id of a UAV, or the name that stands for the fleet."""
    kind: CommandKind
    run: Count
    """The flight of the mission that it is meant for, as in the brief; it counts in no other."""
    reason: Words
    """Why, in the operator's words; empty when there are none."""

    def __post_init__(self) -> None:
        if (self.target == FLEET) != (self.kind is CommandKind.ABORT):
            raise ValueError(f"{self.kind} is no command to {self.target}")


Body = Brief | Epoch | Board | Claim | Outcome | Status | Command


@dataclass(frozen=True, slots=True)
class Message:
    """A statement with its author and place in that author's order.

    Raises:
        ValueError: the mission name is not a valid id.
    """

    mission: str
    writer: str
    stamp: Stamp
    body: Body
    key: str = field(init=False, repr=False, compare=False)
    """The one key on which it may be said; names its register."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "key", _key_of(self.mission, self.writer, self.body))


@dataclass(frozen=True, slots=True)
class Snapshot:
    """Answer of ``state/<id>``: registers, and the mission time of the one who answers."""

    mission: str
    writer: str
    incarnation: Count
    """Of the process that answers."""
    mission_s: Instant | None
    messages: tuple[Message, ...]


def _key_of(mission: str, writer: str, body: Body) -> str:
    keys = _keys_of(mission)
    match body:
        case Brief():
            return keys.brief
        case Epoch():
            return keys.plan
        case Board(task=task):
            return keys.board(task)
        case Claim():
            return keys.claim(writer)
        case Outcome(task=task):
            return keys.outcome(writer, task)
        case Status():
            return keys.status(writer)
        case Command(target=target):
            return keys.operator(target)


@lru_cache(maxsize=16)
def _keys_of(mission: str) -> Keys:
    return Keys(mission)
