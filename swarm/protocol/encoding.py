"""Messages to MessagePack, and MessagePack from the network to plain values.

Written: the bytes of a bus without keys, and what fits into them. Read: no more than the
length of the bytes is worth.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from operator import attrgetter
from types import SimpleNamespace
from typing import Any, Final

import msgpack

from swarm.protocol.field_messages import (
    AreaSpec,
    BaseSpec,
    CameraSpec,
    TerrainSpec,
    UavReady,
    ZoneEdit,
    ZoneSpec,
)
from swarm.protocol.messages import (
    FIELD_VERSION,
    SCHEMA_VERSION,
    SEPARATION_VERSION,
    TERRAIN_VERSION,
    Body,
    Message,
    MissionConfig,
    OperatorCommand,
    PlanEpoch,
    SignedRoster,
    Snapshot,
    StartWithout,
    TaskEdit,
    TaskEntry,
    UavSpec,
)
from swarm.protocol.seal import UnacceptableError
from swarm.protocol.uav_messages import (
    Calibration,
    Candidate,
    Choice,
    ChoiceBasis,
    Claim,
    ClaimedWay,
    Nearby,
    Outcome,
    Status,
)

SMALL_LIMIT_BYTES: Final = 4 * 1024
LARGE_LIMIT_BYTES: Final = 1024 * 1024
SNAPSHOT_LIMIT_BYTES: Final = 4 * 1024 * 1024
"""As much as a bus carries at once."""
KINDS: Final[dict[str, type[Body]]] = {
    "brief": MissionConfig,
    "epoch": PlanEpoch,
    "board": TaskEntry,
    "claim": Claim,
    "outcome": Outcome,
    "calibration": Calibration,
    "status": Status,
    "choice": Choice,
    "near": Nearby,
    "command": OperatorCommand,
    "task": TaskEdit,
    "start": StartWithout,
    "zone": ZoneEdit,
    "ready": UavReady,
    "roster": SignedRoster,
}
NAMES: Final[dict[type[Body], str]] = {kind: name for name, kind in KINDS.items()}
FIELDS: Final[dict[type, tuple[str, ...]]] = {
    part: tuple(field.name for field in dataclasses.fields(part))
    for part in (
        *KINDS.values(),
        UavSpec,
        BaseSpec,
        ZoneSpec,
        AreaSpec,
        CameraSpec,
        TerrainSpec,
        ChoiceBasis,
        Candidate,
        ClaimedWay,
    )
}
"""Of everything that a message is made of."""
_OF_TASKS: Final = frozenset(
    {"due_s", "opens_s", "closes_s", "path_enu_m", "height_m", "trigger_m"}
)
_OF_CLAIMS: Final = ("base", "stage", "arrives_s", "sortie_end_s", "reversed", "departs_s", "way")
_OF_UAVS: Final = (
    "airspeed_m_s",
    "endurance_s",
    "reserve_frac",
    "charge_frac",
    "vehicle",
    "landing_heading_rad",
)
_OF_BRIEFS: Final = (
    "bases",
    "zones",
    "wind_enu_m_s",
    "zone_margin_m",
    "band_m",
    "areas",
    "terrain",
    "separation_m",
)
SINCE_FIELD: Final[dict[type, frozenset[str]]] = {
    UavSpec: frozenset({"acceleration_m_s2", *_OF_UAVS}),
    MissionConfig: frozenset(_OF_BRIEFS),
    PlanEpoch: frozenset({"left_out"}),
    TaskEntry: _OF_TASKS,
    TaskEdit: _OF_TASKS,
    Claim: frozenset(_OF_CLAIMS),
    Outcome: frozenset({"reversed"}),
    Status: frozenset({"layer_m"}),
    Choice: frozenset({"base"}),
    ChoiceBasis: frozenset({"sortie_end_s", "landed_at", "parked", "blocking", "flown_m"}),
    Calibration: frozenset({"land_s", "climb_s", "acceleration_m_s2", "speed_m_s"}),
}
"""Fields that came with `FIELD_VERSION`; left out where they are as by default, so that a statement
that has none of them is to the last byte what every release understands."""
FIELD_DEFAULTS: Final[dict[type, dict[str, object]]] = {
    part: {
        field.name: field.default
        if field.default_factory is dataclasses.MISSING
        else field.default_factory()
        for field in dataclasses.fields(part)
        if field.name in names
    }
    for part, names in SINCE_FIELD.items()
}
"""What they are then."""
PLAIN_FIELDS: Final[dict[type, tuple[str, ...]]] = {
    part: tuple(name for name in names if name not in SINCE_FIELD.get(part, ()))
    for part, names in FIELDS.items()
}
"""All others."""
_ADDED: Final = {
    part: (attrgetter(*defaults), attrgetter(*defaults)(SimpleNamespace(**defaults)))
    for part, defaults in FIELD_DEFAULTS.items()
}
"""How the added fields are read at once, and what that gives by default."""
_PARTS: Final[dict[type, Callable[[Any], Iterable[object]]]] = {
    MissionConfig: lambda brief: brief.uavs,
    Choice: lambda choice: (choice.basis,),
}
"""What a body is made of that has added fields of its own."""
LARGE: Final = frozenset({"brief", "choice", "epoch", "roster"})


def encode(what: Message | Snapshot) -> bytes:
    """The bytes of a message or snapshot, as a bus without keys carries them.

    A message that was heard gives the very bytes that were heard, and so does one that is kept.
    Nothing is written into it, so any thread may encode what another one has.
    """
    if isinstance(what, Snapshot):
        return snapshot_bytes(what, [encode(message) for message in what.messages])
    return _message_bytes(what) if what.said is None else what.said


def encode_memory(snapshot: Snapshot) -> bytes:
    """``snapshot`` with the envelopes of its messages, for `decode_memory` of a later life."""
    return snapshot_bytes(snapshot, [_remembered(message) for message in snapshot.messages])


def fit_memory(snapshot: Snapshot) -> Snapshot:
    """What of ``snapshot`` there is room for in a memory; see `fit`."""
    return fit(snapshot, SNAPSHOT_LIMIT_BYTES, _remembered)


def fit(
    snapshot: Snapshot,
    limit_bytes: int = SNAPSHOT_LIMIT_BYTES,
    as_bytes: Callable[[Message], bytes] = encode,
) -> Snapshot:
    """``snapshot``, without some of the registers when there is no room for all.

    Those of its own writer stay before those of others, for which others answer too. ``as_bytes``
    is what becomes of each message in it.
    """
    parts = [as_bytes(message) for message in snapshot.messages]
    if len(snapshot_bytes(snapshot, parts)) <= limit_bytes:
        return snapshot
    room = limit_bytes - len(snapshot_bytes(snapshot, ())) - 4  # a longer array head
    kept = []
    for message, part in sorted(
        zip(snapshot.messages, parts, strict=True),
        key=lambda each: each[0].writer != snapshot.writer,
    ):
        if len(part) <= room:
            room -= len(part)
            kept.append(message)
    return replace(snapshot, messages=tuple(kept))


def _message_bytes(message: Message) -> bytes:
    stamp, body = message.stamp, message.body
    plain = _is_plain(body)
    parts = (
        SCHEMA_VERSION if plain else _version_of(body),
        message.mission,
        message.writer,
        stamp.incarnation,
        stamp.counter,
        NAMES[type(body)],
        body,
    )
    packer = msgpack.Packer(default=_plain_fields_of if plain else _fields_of)
    packed: bytes = packer.pack(parts)  # by `packb` a claim takes a tenth longer
    return packed


def _version_of(body: Body) -> int:
    """Which releases must understand what has more in it than the first one did."""
    if not isinstance(body, MissionConfig):
        return FIELD_VERSION
    if body.separation_m is not None:
        return SEPARATION_VERSION
    return FIELD_VERSION if body.terrain is None else TERRAIN_VERSION


def _is_plain(part: object) -> bool:
    """Whether a release without `FIELD_VERSION` understands all that ``part`` says."""
    kind = type(part)
    if kind in _ADDED:
        read, default = _ADDED[kind]
        if read(part) != default:
            return False
    return kind not in _PARTS or all(map(_is_plain, _PARTS[kind](part)))


def _plain_fields_of(part: object) -> dict[str, object]:
    return {name: getattr(part, name) for name in PLAIN_FIELDS[type(part)]}


def _fields_of(part: object) -> dict[str, object]:
    told = _plain_fields_of(part)
    for name, default in FIELD_DEFAULTS.get(type(part), {}).items():
        if (value := getattr(part, name)) != default:
            told[name] = value
    return told


def snapshot_bytes(snapshot: Snapshot, registers: Sequence[bytes]) -> bytes:
    """``snapshot`` with these in the place of its messages."""
    head = (
        SCHEMA_VERSION,
        snapshot.mission,
        snapshot.writer,
        snapshot.incarnation,
        snapshot.mission_s,
    )
    packed: list[bytes] = [msgpack.packb(part) for part in head]
    begun = [msgpack.packb(snapshot.begun)] if snapshot.begun else []
    return _array([*packed, _array(registers), *begun])


def _array(parts: Sequence[bytes]) -> bytes:
    """An array of what is MessagePack already."""
    head: bytes = msgpack.Packer().pack_array_header(len(parts))
    return head + b"".join(parts)


def _remembered(message: Message) -> bytes:
    if message.envelope is None:
        return encode(message)
    packed: bytes = msgpack.packb(message.envelope)
    return packed


BYTES_EACH: Final = 8
"""Of an array or map in a large message, with its share of the rest, at least."""


def unpacked(data: bytes, most: int | None = None) -> object:
    """What ``data`` holds, with tuples for arrays; None when it is not MessagePack.

    At ``most`` so many arrays and maps are in it; by default as many as its length is worth.
    """
    hooks = {}
    if len(data) > SMALL_LIMIT_BYTES:
        budget = _Budget(1000 + len(data) // BYTES_EACH if most is None else most)
        hooks = {"list_hook": budget.array, "object_pairs_hook": budget.map}
    try:
        return msgpack.unpackb(data, use_list=False, max_ext_len=0, **hooks)
    except (ValueError, TypeError, msgpack.exceptions.UnpackException, RecursionError):
        # ValueError covers msgpack's FormatError, StackError, ExtraData and bad UTF-8.
        return None


def repacked(register: object) -> bytes:
    """The bytes of what `unpacked` gave.

    Raises:
        UnacceptableError: it is nested deeper than this MessagePack can write again.
    """
    try:
        packed: bytes = msgpack.packb(register)
    except (ValueError, RecursionError):
        raise UnacceptableError("malformed") from None
    return packed


class _Budget:
    """Counts the arrays and maps of one piece of MessagePack, until there are too many.

    An empty map is one byte and takes 64 in memory, so that few bytes could fill all of it.
    """

    def __init__(self, most: int) -> None:
        self._left = most

    def array(self, items: tuple[object, ...]) -> tuple[object, ...]:
        """One more array."""
        self._spend()
        return items

    def map(self, pairs: Sequence[tuple[object, object]]) -> dict[object, object]:
        """One more map."""
        self._spend()
        return dict(pairs)

    def _spend(self) -> None:
        self._left -= 1
        if self._left < 0:
            raise ValueError("more arrays and maps than a message of that size has")
