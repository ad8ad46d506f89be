"""What is said on the bus: the messages, their bodies and their registers.

Instants are mission time [s]; no machine's clock crosses the wire. What a UAV says is in
swarm.protocol.uav_messages.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass, field, replace
from enum import StrEnum
from functools import lru_cache
from typing import Annotated

from annotated_types import Len
from pydantic import Strict

from swarm.model import Origin
from swarm.model.ids import AUTHORITY, FLEET, RESERVED
from swarm.model.vehicles import VehicleKind
from swarm.protocol.field_messages import (
    AreaSpec,
    BaseSpec,
    TerrainSpec,
    UavReady,
    ZoneEdit,
    ZoneSpec,
)
from swarm.protocol.fields import (
    MAX_COUNT,
    Acceleration,
    Checked,
    Count,
    Duration,
    Flag,
    Heading,
    Height,
    Horizon,
    Id,
    Instant,
    Limit,
    Metres,
    Point,
    Probability,
    Reason,
    Separation,
    Speed,
    Value,
    WindSpeed,
    Words,
)
from swarm.protocol.key_space import KeySpace
from swarm.protocol.uav_messages import Calibration, Choice, Claim, Nearby, Outcome, Status

SCHEMA_VERSION = 1
"""Grows only with what releases before cannot be mixed with; see swarm.protocol.codec."""
FIELD_VERSION = 2
"""Of statements that tell of what the field asks for, which releases before must not pass over."""
TERRAIN_VERSION = 3
"""Of briefs with a ground: who knows nothing of it would fly into it."""
SEPARATION_VERSION = 4
"""Of briefs with a separation: who knows nothing of it would keep to no distance."""
LONGEST_ROSTER = 1 << 20
"""Characters of a signed roster."""


@dataclass(frozen=True, slots=True, order=True)
class Stamp(Checked):
    """Order of one writer's statements in one register: later beats earlier."""

    incarnation: Count
    """Grows whenever the writer's process starts anew."""
    counter: Count
    """Grows with every statement of one incarnation."""


REVOKED_INCARNATION = 0
"""Incarnation of what nobody stands for any more; processes number their own from 1."""


@dataclass(frozen=True, slots=True)
class UavSpec(Checked):
    """One UAV as the brief describes it."""

    id: Id
    position_enu_m: Point
    """Start [m; mission origin], without the height layer."""
    speed_m_s: Speed
    success: Mapping[str, Probability]
    survival: Mapping[str, Probability]
    kind: Id | None
    layer_m: Metres
    """Height layer this UAV flies at [m], added to every place it flies to."""
    acceleration_m_s2: Acceleration | None = None
    """None: its speed changes at once."""
    airspeed_m_s: Speed | None = None
    """Speed through the air [m/s]; None: wind has no effect."""
    endurance_s: Horizon | None = None
    """Airborne time that a full battery gives [s]; None: endless."""
    reserve_frac: Probability = 0.2
    """Share of the endurance that is never planned with."""
    charge_frac: Probability = 1.0
    """Charge of the battery at mission time 0."""
    vehicle: VehicleKind = VehicleKind.COPTER
    """What it is to fly, or drive."""
    landing_heading_rad: Heading | None = None
    """In which it touches down at its start, clockwise from north; None: it needs no runway."""


@dataclass(frozen=True, slots=True)
class MissionConfig(Checked):
    """Register ``brief``: what stays the same for a whole mission."""

    horizon_s: Horizon
    success_default: Probability
    survival_default: Probability
    reattempt_failed: Flag
    run: Count
    """Tells this flight of the mission from earlier ones: stays when a coordinator resumes it."""
    origin: Point
    """Latitude [deg], longitude [deg], height above mean sea level [m]."""
    uavs: tuple[UavSpec, ...]
    bases: tuple[BaseSpec, ...] = ()
    """Where batteries are swapped."""
    zones: tuple[ZoneSpec, ...] = ()
    """Where not to fly, as long as the operator says nothing else."""
    wind_enu_m_s: tuple[WindSpeed, WindSpeed] = (0.0, 0.0)
    """Steady wind by where it blows to [m/s; east, north]."""
    zone_margin_m: Height = 0.0
    """Paths stay that far away from zones [m]."""
    band_m: tuple[Height, Height] | None = None
    """Heights above the ground that may be used [m]; None: each UAV in its own layer."""
    areas: tuple[AreaSpec, ...] = ()
    """What some of the tasks cover together."""
    terrain: TerrainSpec | None = None
    """The ground, on which all places lie, and above which heights of tasks count; None: it is
    flat, and nobody looks at it."""
    separation_m: Separation | None = None
    """Smallest distance of two UAVs in flight [m]; None: nothing but their layers keeps them
    apart."""

    def __post_init__(self) -> None:
        Origin(*self.origin)
        ids = {uav.id for uav in self.uavs}
        if len(ids) != len(self.uavs) or not ids.isdisjoint(RESERVED):
            raise ValueError(f"UAV ids must differ, from each other and from {', '.join(RESERVED)}")
        for what, named in (("base", self.bases), ("zone", self.zones), ("area", self.areas)):
            if len({spec.id for spec in named}) != len(named):
                raise ValueError(f"{what} ids must differ from each other")
        wind_m_s = math.hypot(*self.wind_enu_m_s)
        speeds_m_s = (uav.airspeed_m_s for uav in self.uavs if uav.airspeed_m_s is not None)
        if min(speeds_m_s, default=math.inf) <= wind_m_s:
            raise ValueError(f"a UAV is not faster than the wind of {wind_m_s:g} m/s")
        if self.band_m is not None and self.band_m[0] >= self.band_m[1]:
            raise ValueError(f"band_m must be two growing heights, not {self.band_m}")
        if self.band_m is not None and self.terrain is not None:
            self.terrain.terrain().check_band(self.band_m)


class MissionPhase(StrEnum):
    """How far the mission is."""

    PREPARING = "preparing"
    RUNNING = "running"
    ENDED = "ended"


@dataclass(frozen=True, slots=True)
class PlanEpoch(Checked):
    """Register ``plan``: the pecking order in force."""

    number: Count
    phase: MissionPhase
    rule: Id
    sequence: tuple[Id, ...]
    """Best rank first."""
    mission_s: Instant
    """Mission time at which this statement was made [s]."""
    reason: Words
    """Why this epoch, in words."""
    routes: Mapping[Id, tuple[Id, ...]]
    """Planned task lists by UAV; what rules make of them is theirs."""
    left_out: Mapping[Reason, tuple[Id, ...]] = field(default_factory=dict)
    """Open tasks that are on none of them, by why, in words of `swarm.model.plan.LeftOut`.

    For who looks on; no decision reads it. So it may be told anew under the same number.
    """

    @property
    def why_left_out(self) -> dict[str, str]:
        """By task that it leaves out, why."""
        return {task: why for why, tasks in self.left_out.items() for task in tasks}


@dataclass(frozen=True, slots=True)
class PostedTask(Checked):
    """What is said of one task, by whomever."""

    task: Id
    number: Count
    """Position on the board; ties between equally good tasks go to the smaller."""
    position_enu_m: Point
    """Of a line its first point."""
    value: Value
    service_s: Duration
    kind: Id | None
    withdrawn: Flag
    _: KW_ONLY
    due_s: Limit | None = None
    """Mission time by which it ends, or it is worth nothing [s]; it may be left out."""
    opens_s: Limit = 0.0
    """Mission time before which work on the spot does not begin [s]."""
    closes_s: Limit | None = None
    """Mission time after which work on the spot does not begin [s]."""
    path_enu_m: tuple[Point, ...] = ()
    """Points of a line [m; mission origin]; empty of a place."""
    height_m: Metres | None = None
    """Where it is flown [m above the origin; above the ground there if the brief has a terrain];
    None: in the UAV's own layer above the place."""
    trigger_m: Metres | None = None
    """Of a line, how far apart pictures are taken along it [m]; None: none are."""

    def __post_init__(self) -> None:
        path = self.path_enu_m
        if path and (len(path) < 2 or path[0] != self.position_enu_m):
            raise ValueError(f"path of task {self.task} must begin at its position and go on")
        if self.trigger_m is not None and not (path and self.trigger_m > 0.0):
            raise ValueError(f"trigger_m of task {self.task} must be > 0, and along a path")


@dataclass(frozen=True, slots=True)
class TaskEntry(PostedTask):
    """Register ``board/<task>``: one task of the task board."""


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
class OperatorCommand(Checked):
    """Register ``operator/<target>``: the operator's newest word to one UAV, or to the fleet."""

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
class TaskEdit(PostedTask):
    """Register ``operator/task/<task>``: a task that the operator adds, or takes off the board.

    For a task that the coordinator has posted, too, the operator's word counts.
    """

    run: Count
    """The flight of the mission that it is meant for, as in the brief; it counts in no other."""
    reason: Words
    """Why, in the operator's words; empty when there are none."""


@dataclass(frozen=True, slots=True)
class StartWithout(Checked):
    """Register ``operator/start/<uav>``: the operator lets the mission start without a UAV.

    Apart from the commands to that UAV, which hold as they are: it is told nothing by this, and
    takes part as soon as it is ready.
    """

    uav: Id
    run: Count
    """The flight of the mission that it is meant for, as in the brief; it counts in no other."""
    reason: Words
    """Why, in the operator's words; empty when there are none."""


@dataclass(frozen=True, slots=True)
class SignedRoster(Checked):
    """Register ``roster``: who belongs to the mission, in the words of its authority.

    It bears the authority's signature inside, so anyone may repeat it.
    """

    signed: Annotated[str, Strict(), Len(1, LONGEST_ROSTER)]
    """As `swarm.identity.roster.decode_roster` reads it; ASCII."""


Body = (
    MissionConfig
    | PlanEpoch
    | TaskEntry
    | Claim
    | Outcome
    | Calibration
    | Status
    | Choice
    | Nearby
    | OperatorCommand
    | TaskEdit
    | StartWithout
    | ZoneEdit
    | UavReady
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
    """Those bytes with their writer's signature, where the bus has keys (swarm.protocol.seal)."""
    fingerprint: int | None = field(init=False, default=None, repr=False, compare=False)
    """What `swarm.protocol.sync.fingerprint` has found; None: nobody has asked."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "key", _key_of(self.mission, self.writer, self.body))


def roster_message(mission: str, version: int, signed: str) -> Message:
    """The register ``roster``, as everyone stamps it: by its version."""
    return Message(mission, AUTHORITY, Stamp(version, 0), SignedRoster(signed))


@dataclass(frozen=True, slots=True)
class Snapshot:
    """Answer of ``state/<id>``: registers, and the mission time of the one who answers."""

    mission: str
    writer: str
    incarnation: Count
    """Of the process that answers."""
    mission_s: Instant | None
    messages: tuple[Message, ...]
    begun: bool = False
    """In an agent's own memory alone: its vehicle is on its way up, on its order."""


def as_heard(message: Message, said: bytes, envelope: bytes | None = None) -> Message:
    """``message``, just made of these bytes, so that it can be repeated exactly.

    For who makes a message, before anybody else has it; and for the one thread that publishes,
    which adds the envelope, whose bytes were there before.
    """
    object.__setattr__(message, "said", said)
    object.__setattr__(message, "envelope", envelope)
    object.__setattr__(message, "fingerprint", None)
    return message


def demoted(message: Message) -> Message:
    """What ``message`` says, for which nobody stands any more: any later word outdoes it.

    Of several such the later ones still come after the earlier, as far as numbers reach.
    """
    incarnation, counter = message.stamp.incarnation, message.stamp.counter
    if incarnation == REVOKED_INCARNATION:
        return message
    place = incarnation * 4096 + min(counter, 4095)  # milliseconds since 1970 have room for that
    return replace(message, stamp=Stamp(REVOKED_INCARNATION, min(place, MAX_COUNT)))


def _key_of(mission: str, writer: str, body: Body) -> str:
    keys = _keys_of(mission)
    match body:
        case MissionConfig():
            return keys.brief
        case PlanEpoch():
            return keys.plan
        case TaskEntry(task=task):
            return keys.board(task)
        case Claim():
            return keys.claim(writer)
        case Outcome(task=task):
            return keys.outcome(writer, task)
        case Calibration():
            return keys.calibration(writer)
        case Status():
            return keys.status(writer)
        case Choice():
            return keys.choice(writer)
        case Nearby(cell=(east, north)):
            return keys.near(writer, east, north)
        case OperatorCommand(target=target):
            return keys.operator(target)
        case TaskEdit(task=task):
            return keys.operator_task(task)
        case StartWithout(uav=uav):
            return keys.operator_start(uav)
        case ZoneEdit(zone=zone):
            return keys.operator_zone(zone.id)
        case UavReady(uav=uav):
            return keys.operator_ready(uav)
        case SignedRoster():
            return keys.roster


@lru_cache(maxsize=16)
def _keys_of(mission: str) -> KeySpace:
    return KeySpace(mission)
