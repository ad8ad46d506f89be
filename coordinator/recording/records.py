"""What a recording holds besides pictures: every fact its core got, as JSON of a published schema.

Facts are written so that reading gives back the very same: numbers digit by digit, messages field
by field. A recording is made of *lines*; a line knows its topic, schema and JSON.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, make_dataclass
from functools import cache
from typing import Annotated, Any, Final, Literal

from pydantic import Field, TypeAdapter, ValidationError

from coordinator.planner.plan_report import plan_as_json, plan_from_json
from swarm.model import Plan
from swarm.protocol.events import (
    CommonEvent,
    KeysReplaced,
    LinkChanged,
    MessageReceived,
    PeerGone,
    PeerSeen,
    SnapshotsReceived,
    Tick,
)
from swarm.protocol.field_messages import UavReady, ZoneEdit
from swarm.protocol.fields import Count, Flag, Id, Instant
from swarm.protocol.key_space import KeySpace
from swarm.protocol.messages import (
    Body,
    Message,
    MissionConfig,
    OperatorCommand,
    PlanEpoch,
    SignedRoster,
    Snapshot,
    Stamp,
    StartWithout,
    TaskEdit,
    TaskEntry,
)
from swarm.protocol.uav_messages import Calibration, Choice, Claim, Nearby, Outcome, Status

FORMAT: Final = "1"
"""Version of all schemas here; grows when what was written before cannot be read any more."""

_BODIES: Final[dict[str, type[Body]]] = {
    "Brief": MissionConfig,
    "Epoch": PlanEpoch,
    "Board": TaskEntry,
    "Claim": Claim,
    "Outcome": Outcome,
    "Calibration": Calibration,
    "Status": Status,
    "Choice": Choice,
    "Nearby": Nearby,
    "Command": OperatorCommand,
    "TaskOrder": TaskEdit,
    "StartWithout": StartWithout,
    "Zone": ZoneEdit,
    "Ready": UavReady,
    "SignedRoster": SignedRoster,
}
"""By the second part of their schemas' names, which files keep whatever the classes are called."""
_NAMES: Final = {body: name for name, body in _BODIES.items()}
_CHECKED: Final = {"extra": "forbid", "allow_inf_nan": False}


class UnreadableError(Exception):
    """A line that does not say what its schema promises."""


@dataclass(frozen=True, slots=True)
class RecordingStarted:
    """The recording core started: the first thing in every recording."""


RecordableFact = CommonEvent | RecordingStarted | Plan
"""What can be written down, each with the core's time."""


@dataclass(frozen=True, slots=True)
class FileMessage:
    """One message of the file."""

    topic: str
    schema: str
    data: bytes


# -- shapes of the JSON ------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class _Moment:
    """The recording process itself: its core began, or stepped because a deadline had come."""

    __pydantic_config__ = _CHECKED

    now_s: Instant
    """Of the recording core's clock [s]."""
    what: Literal["begun", "tick"]


@dataclass(frozen=True, slots=True)
class _Presence:
    """A liveliness token came or went."""

    __pydantic_config__ = _CHECKED

    now_s: Instant
    writer: str
    there: Flag


@dataclass(frozen=True, slots=True)
class _Keys:
    """A newer roster gave these names other keys, or none."""

    __pydantic_config__ = _CHECKED

    now_s: Instant
    names: tuple[Id, ...]


@dataclass(frozen=True, slots=True)
class _Link:
    """The recording process's own link to the bus came up or went down."""

    __pydantic_config__ = _CHECKED

    now_s: Instant
    up: Flag


@dataclass(frozen=True, slots=True)
class _EntrySaid:
    """A leg of a schedule and what is done at its end, as `swarm plan --json` has it."""

    __pydantic_config__ = _CHECKED

    go: str
    from_m: list[float]
    via_m: list[list[float]]
    depart_s: float
    arrive_s: float
    begin_s: float
    end_s: float
    reversed: bool
    up_m: list[float] = field(default_factory=list)
    """Heights of the corners and of the end, in missions over a ground."""


@dataclass(frozen=True, slots=True)
class _PlanSaid:
    """As `swarm plan --json` has it."""

    __pydantic_config__ = _CHECKED

    scenario: str
    method: str
    objective: float
    sequence: list[str] | None
    routes: dict[str, list[str]]
    completion_s: dict[str, float]
    optimum: float | None
    gap: float | None
    evaluations: int
    elapsed_s: float
    seed: int
    bound: float | None
    basis: str
    schedule: dict[str, list[_EntrySaid]] | None = None
    """Of missions of schema 2; so are the following."""
    left_out: dict[str, str] = field(default_factory=dict)
    required_left_out: int = 0
    fewest_left_out: int | None = None


@dataclass(frozen=True, slots=True)
class _Plan:
    """A plan the coordinator made: lists, sequence, value and bound."""

    __pydantic_config__ = _CHECKED

    now_s: Instant
    plan: _PlanSaid


def _said(name: str, body: type[Body], *, kind: bool) -> type[Any]:
    """Shape of a message: on a topic of its own, or with its kind in an answer."""
    fields: list[Any] = [
        ("mission", Id),
        ("writer", Id),
        ("incarnation", Count),
        ("counter", Count),
        ("body", body),
    ]
    if kind:
        fields.insert(0, ("kind", Literal[name]))
    else:
        fields += [("now_s", Instant), ("mission_s", float | None)]
    shape = make_dataclass(f"{'Known' if kind else ''}{name}", fields, frozen=True, slots=True)
    shape.__doc__ = body.__doc__
    shape.__pydantic_config__ = _CHECKED  # type: ignore[attr-defined]  # read by pydantic alone
    return shape


_SAID: Final = {name: _said(name, body, kind=False) for name, body in _BODIES.items()}
_KNOWN: Final = {name: _said(name, body, kind=True) for name, body in _BODIES.items()}


def _any_known() -> Any:
    shapes = tuple(_KNOWN.values())
    union: Any = shapes[0]
    for shape in shapes[1:]:
        union = union | shape
    return Annotated[union, Field(discriminator="kind")]


_Answer: Final = make_dataclass(
    "_Answer",
    [
        ("mission", Id),
        ("writer", Id),
        ("incarnation", Count),
        ("mission_s", Instant | None),
        ("messages", tuple[_any_known(), ...]),  # type: ignore[misc]  # made at run time
    ],
    frozen=True,
    slots=True,
)
_Answers: Final = make_dataclass(
    "_Answers",
    [("now_s", Instant), ("snapshots", tuple[_Answer, ...])],  # type: ignore[valid-type]  # likewise
    frozen=True,
    slots=True,
)
_Answers.__doc__ = "All answers to a question of the recording core, maybe none."
_Answers.__pydantic_config__ = _CHECKED  # type: ignore[attr-defined]  # read by pydantic alone

_SHAPES: Final[Mapping[str, Any]] = {
    "peckorder.Moment": _Moment,
    "peckorder.Presence": _Presence,
    "peckorder.Keys": _Keys,
    "peckorder.Link": _Link,
    "peckorder.Answers": _Answers,
    "peckorder.Plan": _Plan,
    **{f"peckorder.{name}": shape for name, shape in _SAID.items()},
}
SCHEMAS: Final = tuple(_SHAPES)


def body_name(body: Body) -> str:
    """What a message's kind is called outside the source, whatever its class is called."""
    return _NAMES[type(body)]


def schema_of(name: str) -> bytes:
    """The JSON schema by that name."""
    schema = _adapter(name).json_schema()
    schema["title"] = name
    return json.dumps(schema, separators=(",", ":")).encode()


@cache
def _adapter(name: str) -> TypeAdapter[Any]:
    return TypeAdapter(_SHAPES[name])


# -- writing -----------------------------------------------------------------------------


def topics_of(mission: str) -> Mapping[str, str]:
    """Topics of what is no message, by schema; `Presence` has one per writer below its own."""
    root = f"/{KeySpace(mission).root}"
    return {
        "peckorder.Moment": f"{root}/recorder/moment",
        "peckorder.Link": f"{root}/recorder/link",
        "peckorder.Keys": f"{root}/recorder/keys",
        "peckorder.Answers": f"{root}/recorder/answers",
        "peckorder.Plan": f"{root}/recorder/plan",
        "peckorder.Presence": f"{root}/alive",
    }


def encode(
    what: RecordableFact, mission: str, now_s: float, mission_s: float | None
) -> FileMessage | None:
    """The line that says ``what``; None for what only the recorder's own process was told."""
    match what:
        case MessageReceived(message):
            name = body_name(message.body)
            said = _SAID[name](*_parts(message), now_s, mission_s)
            return _line(_topic(message), f"peckorder.{name}", said)
        case SnapshotsReceived(snapshots):
            schema, shape = "peckorder.Answers", _Answers(now_s, tuple(map(_answer, snapshots)))
        case PeerSeen(writer):
            schema, shape = "peckorder.Presence", _Presence(now_s, writer, True)
        case PeerGone(writer):
            schema, shape = "peckorder.Presence", _Presence(now_s, writer, False)
        case KeysReplaced(names):
            schema, shape = "peckorder.Keys", _Keys(now_s, tuple(sorted(names)))
        case LinkChanged(up):
            schema, shape = "peckorder.Link", _Link(now_s, up)
        case Tick():
            schema, shape = "peckorder.Moment", _Moment(now_s, "tick")
        case RecordingStarted():
            schema, shape = "peckorder.Moment", _Moment(now_s, "begun")
        case Plan():
            plan: dict[str, Any] = plan_as_json(what)
            schema, shape = "peckorder.Plan", _Plan(now_s, _plan_said(plan))
        case _:
            return None
    return _line(topics_of(mission)[schema], schema, shape)


def _plan_said(plan: dict[str, Any]) -> _PlanSaid:
    legs: dict[str, Any] | None = plan.pop("schedule", None)
    if legs is None:
        return _PlanSaid(**plan)
    schedule = {uav: [_EntrySaid(**leg) for leg in of_uav] for uav, of_uav in legs.items()}
    return _PlanSaid(**plan, schedule=schedule)


def _line(topic: str, schema: str, shape: Any) -> FileMessage:
    return FileMessage(topic, schema, _adapter(schema).dump_json(shape))


def _topic(message: Message) -> str:
    """Its bus key, without the task where there is one: a topic for each would be too many."""
    key = f"/{message.key}"
    match message.body:
        case TaskEntry() | Outcome() | TaskEdit() | OperatorCommand() | StartWithout():
            return key.rpartition("/")[0]
        case ZoneEdit() | UavReady():
            return key.rpartition("/")[0]
        case _:
            return key


def _parts(message: Message) -> tuple[object, ...]:
    stamp = message.stamp
    return message.mission, message.writer, stamp.incarnation, stamp.counter, message.body


def _answer(snapshot: Snapshot) -> Any:
    messages = []
    for message in snapshot.messages:
        name = body_name(message.body)
        messages.append(_KNOWN[name](name, *_parts(message)))
    return _Answer(
        snapshot.mission, snapshot.writer, snapshot.incarnation, snapshot.mission_s, tuple(messages)
    )


# -- reading -----------------------------------------------------------------------------


def decode(schema: str, data: bytes) -> tuple[float, RecordableFact]:
    """What a line says, and the core's time [s]; inverse of `encode`.

    Raises:
        UnreadableError: it is not what its schema says.
    """
    try:
        shape = _adapter(schema).validate_json(data)
        return shape.now_s, _meant(schema, shape)
    except (ValidationError, ValueError, KeyError, TypeError) as fault:
        raise UnreadableError(str(fault)) from None


def _meant(schema: str, shape: Any) -> RecordableFact:
    match schema:
        case "peckorder.Moment":
            return RecordingStarted() if shape.what == "begun" else Tick()
        case "peckorder.Presence":
            return PeerSeen(shape.writer) if shape.there else PeerGone(shape.writer)
        case "peckorder.Keys":
            return KeysReplaced(frozenset(shape.names))
        case "peckorder.Link":
            return LinkChanged(shape.up)
        case "peckorder.Plan":
            return plan_from_json(asdict(shape.plan))
        case "peckorder.Answers":
            return SnapshotsReceived(tuple(map(_snapshot, shape.snapshots)))
        case _:
            return MessageReceived(_message(shape))


def _message(shape: Any) -> Message:
    stamp = Stamp(shape.incarnation, shape.counter)
    return Message(shape.mission, shape.writer, stamp, shape.body)


def _snapshot(shape: Any) -> Snapshot:
    messages = tuple(map(_message, shape.messages))
    return Snapshot(shape.mission, shape.writer, shape.incarnation, shape.mission_s, messages)
