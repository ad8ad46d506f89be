"""What is said: one frozen dataclass per kind of message, with its bounds.

Instants are mission time [s]; no machine's clock crosses the wire. Leaves out:
bytes and checking (swarm.wire.codec), and what a reader makes of it (swarm.state).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import lru_cache
from typing import Annotated, ClassVar

from annotated_types import Ge, Le, Len
from pydantic import Strict

from swarm.model import Origin
from swarm.model.ids import FLEET, RESERVED
from swarm.wire.bounds import (
    CHECKED,
    LATEST_S,
    MAX_COUNT,
    Count,
    Duration,
    Flag,
    Horizon,
    Id,
    Instant,
    Metres,
    Point,
    Probability,
    Reason,
    Speed,
    Value,
    Words,
)
from swarm.wire.choice import Choice
from swarm.wire.keys import Keys

__all__ = [
    "LATEST_S",
    "MAX_COUNT",
    "MOST_REASONS",
    "NOBODYS",
    "SCHEMA_VERSION",
    "Board",
    "Body",
    "Brief",
    "Choice",
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
    "SignedRoster",
    "Snapshot",
    "Stamp",
    "StartWithout",
    "Status",
    "StatusPhase",
    "TaskOrder",
    "as_heard",
    "disowned",
]

SCHEMA_VERSION = 1
"""Grows only with what releases before cannot be mixed with; see swarm.wire.codec."""
MOST_REASONS = 20
"""Reasons of which one status tells."""
LONGEST_ROSTER = 1 << 20
"""Characters of a signed roster."""


@dataclass(frozen=True, slots=True, order=True)
class Stamp:
    """Order of one writer's statements in one register: later beats earlier."""

    __pydantic_config__: ClassVar = CHECKED

    incarnation: Count
    """Grows whenever the writer's process starts anew."""
    counter: Count
    """Grows with every statement of one incarnation."""


NOBODYS = 0
"""Incarnation of what nobody stands for any more; processes number their own from 1."""


@dataclass(frozen=True, slots=True)
class Fleet:
    """One UAV as the brief describes it."""

    __pydantic_config__: ClassVar = CHECKED

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

    __pydantic_config__: ClassVar = CHECKED

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

    __pydantic_config__: ClassVar = CHECKED

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

    __pydantic_config__: ClassVar = CHECKED

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

    __pydantic_config__: ClassVar = CHECKED

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

    __pydantic_config__: ClassVar = CHECKED

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

    __pydantic_config__: ClassVar = CHECKED

    phase: StatusPhase
    task: Id | None
    position_enu_m: Point | None
    """[m; mission origin], without the height layer."""
    velocity_enu_m_s: Point | None
    battery_frac: Probability | None
    mission_s: Instant | None
    dropped: Annotated[Mapping[Reason, Count], Len(0, MOST_REASONS)]
    """Messages this process has dropped, by reason: those of `swarm.wire.codec`, "too many"
    where the inbox was full, "stale" for registers older than known, "no room" for those of which
    there were too many."""
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

    __pydantic_config__: ClassVar = CHECKED

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


@dataclass(frozen=True, slots=True)
class TaskOrder:
    """Register ``operator/task/<task>``: a task that the operator adds, or takes off the board.

    For a task that the coordinator has posted, too, the operator's word counts.
    """

    __pydantic_config__: ClassVar = CHECKED

    task: Id
    number: Count
    """Position on the board, as in `Board`."""
    position_enu_m: Point
    value: Value
    service_s: Duration
    kind: Id | None
    withdrawn: Flag
    run: Count
    """The flight of the mission that it is meant for, as in the brief; it counts in no other."""
    reason: Words
    """Why, in the operator's words; empty when there are none."""


@dataclass(frozen=True, slots=True)
class StartWithout:
    """Register ``operator/start/<uav>``: the operator lets the mission start without a UAV.

    Apart from the commands to that UAV, which hold as they are: it is told nothing by this, and
    takes part as soon as it is ready.
    """

    __pydantic_config__: ClassVar = CHECKED

    uav: Id
    run: Count
    """The flight of the mission that it is meant for, as in the brief; it counts in no other."""
    reason: Words
    """Why, in the operator's words; empty when there are none."""


@dataclass(frozen=True, slots=True)
class SignedRoster:
    """Register ``roster``: who belongs to the mission, in the words of its authority.

    It bears the authority's signature inside, so anyone may repeat it.
    """

    __pydantic_config__: ClassVar = CHECKED

    signed: Annotated[str, Strict(), Len(1, LONGEST_ROSTER)]
    """As `swarm.identity.roster.decode_roster` reads it; ASCII."""


Body = (
    Brief
    | Epoch
    | Board
    | Claim
    | Outcome
    | Status
    | Choice
    | Command
    | TaskOrder
    | StartWithout
    | SignedRoster
)


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
    said: bytes | None = field(init=False, default=None, repr=False, compare=False)
    """The very bytes that were heard, what this release does not understand among them, or that
    were made here of a register; None for what is said once. Copies made by
    `dataclasses.replace` say something else: None."""
    envelope: bytes | None = field(init=False, default=None, repr=False, compare=False)
    """Those bytes with their writer's signature, where the bus has keys; see swarm.wire.seal."""

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


def as_heard(message: Message, said: bytes, envelope: bytes | None = None) -> Message:
    """``message``, just made of these bytes, so that it can be repeated exactly.

    For who makes a message, before anybody else has it; and for the one thread that publishes,
    which adds the envelope, whose bytes were there before.
    """
    object.__setattr__(message, "said", said)
    object.__setattr__(message, "envelope", envelope)
    return message


def disowned(message: Message) -> Message:
    """What ``message`` says, for which nobody stands any more: any later word outdoes it.

    Of several such the later ones still come after the earlier, as far as numbers reach.
    """
    incarnation, counter = message.stamp.incarnation, message.stamp.counter
    if incarnation == NOBODYS:
        return message
    place = incarnation * 4096 + min(counter, 4095)  # milliseconds since 1970 have room for that
    return replace(message, stamp=Stamp(NOBODYS, min(place, MAX_COUNT)))


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
        case Choice():
            return keys.choice(writer)
        case Command(target=target):
            return keys.operator(target)
        case TaskOrder(task=task):
            return keys.operator_task(task)
        case StartWithout(uav=uav):
            return keys.operator_start(uav)
        case SignedRoster():
            return keys.roster


@lru_cache(maxsize=16)
def _keys_of(mission: str) -> Keys:
    return Keys(mission)
