"""Bytes <-> messages: MessagePack, checked field by field.

`decode` never raises on what came from the network: whatever is not a valid
message of this mission, on the key that belongs to its writer, is None and
counted under a reason. Leaves out: whether a message is news (swarm.state).
"""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import cache
from typing import Any, Final

import msgpack
from pydantic import TypeAdapter, ValidationError

from swarm.model.ids import COORDINATOR, OPERATOR, valid_id
from swarm.wire.choice import Basis, Candidate
from swarm.wire.keys import Keys
from swarm.wire.messages import (
    LATEST_S,
    MAX_COUNT,
    SCHEMA_VERSION,
    Board,
    Body,
    Brief,
    Choice,
    Claim,
    Command,
    Epoch,
    Fleet,
    Message,
    Outcome,
    Snapshot,
    Stamp,
    Status,
    TaskOrder,
)

__all__ = [
    "LARGE_LIMIT_BYTES",
    "SMALL_LIMIT_BYTES",
    "SNAPSHOT_LIMIT_BYTES",
    "Codec",
    "encode",
    "fit",
]

SMALL_LIMIT_BYTES: Final = 4 * 1024
LARGE_LIMIT_BYTES: Final = 1024 * 1024
SNAPSHOT_LIMIT_BYTES: Final = 4 * 1024 * 1024
"""As much as a bus carries at once."""

_KINDS: Final[dict[str, type[Body]]] = {
    "brief": Brief,
    "epoch": Epoch,
    "board": Board,
    "claim": Claim,
    "outcome": Outcome,
    "status": Status,
    "choice": Choice,
    "command": Command,
    "task": TaskOrder,
}
_NAMES: Final[dict[type[Body], str]] = {kind: name for name, kind in _KINDS.items()}
_FIELDS: Final[dict[type, tuple[str, ...]]] = {
    part: tuple(field.name for field in dataclasses.fields(part))
    for part in (*_KINDS.values(), Fleet, Basis, Candidate)
}
"""Of everything that a message is made of."""
_LARGE: Final = frozenset({"brief", "choice", "epoch"})


def encode(message: Message | Snapshot) -> bytes:
    """The bytes of a message or snapshot."""
    packed: bytes = msgpack.packb(_packable(message), default=_fields_of)
    return packed


def fit(snapshot: Snapshot, limit_bytes: int = SNAPSHOT_LIMIT_BYTES) -> Snapshot:
    """``snapshot``, without some of the registers when there is no room for all.

    Those of its own writer stay before those of others, for which others answer too.
    """
    if len(encode(snapshot)) <= limit_bytes:
        return snapshot
    room = limit_bytes - len(encode(replace(snapshot, messages=()))) - 4  # a longer array head
    kept = []
    for message in sorted(snapshot.messages, key=lambda each: each.writer != snapshot.writer):
        size_bytes = len(encode(message))
        if size_bytes <= room:
            room -= size_bytes
            kept.append(message)
    return replace(snapshot, messages=tuple(kept))


def _packable(message: Message | Snapshot) -> list[Any]:
    if isinstance(message, Snapshot):
        return [
            SCHEMA_VERSION,
            message.mission,
            message.writer,
            message.incarnation,
            message.mission_s,
            [_packable(each) for each in message.messages],
        ]
    return [
        SCHEMA_VERSION,
        message.mission,
        message.writer,
        message.stamp.incarnation,
        message.stamp.counter,
        _NAMES[type(message.body)],
        message.body,
    ]


def _fields_of(part: object) -> dict[str, object]:
    """A body, or a dataclass within one, by the names of its fields."""
    return {name: getattr(part, name) for name in _FIELDS[type(part)]}


@cache
def _bodies(kind: str) -> TypeAdapter[Body]:
    return TypeAdapter(_KINDS[kind])


@cache
def _stamps() -> TypeAdapter[Stamp]:
    return TypeAdapter(Stamp)


class Codec:
    """Decodes what one mission's processes say, and counts what it drops."""

    def __init__(self, mission: str) -> None:
        self._mission = mission
        self.dropped: Counter[str] = Counter()
        """Messages dropped so far, by reason."""

    def decode(self, key: str, data: bytes) -> Message | None:
        """The message in ``data``, heard on ``key``; None when it must be dropped."""
        try:
            _require(len(data) <= LARGE_LIMIT_BYTES, "too large")
            message = self._message(_unpack(data))
            large = _NAMES[type(message.body)] in _LARGE
            _require(large or len(data) <= SMALL_LIMIT_BYTES, "too large")
            _require(message.key == key, "said on another's key")
        except _UnacceptableError as fault:
            self.dropped[fault.reason] += 1
            return None
        return message

    def decode_snapshot(self, key: str, data: bytes) -> Snapshot | None:
        """The snapshot in ``data``, answered on ``key``; bad registers in it are left out."""
        try:
            _require(len(data) <= SNAPSHOT_LIMIT_BYTES, "too large")
            parts = _unpack(data)
            if not isinstance(parts, tuple) or len(parts) != 6:
                raise _UnacceptableError("malformed")
            version, mission, writer, incarnation, mission_s, registers = parts
            _require(version == SCHEMA_VERSION, "unknown version")
            _require(mission == self._mission, "another mission")
            _require(isinstance(writer, str) and valid_id(writer), "malformed")
            _require(key == Keys(mission).state(writer), "said on another's key")
            _require(type(incarnation) is int and 0 <= incarnation <= MAX_COUNT, "malformed")
            known = isinstance(mission_s, float) and abs(mission_s) <= LATEST_S
            _require(known or mission_s is None, "malformed")
            _require(isinstance(registers, tuple), "malformed")
        except _UnacceptableError as fault:
            self.dropped[fault.reason] += 1
            return None
        return Snapshot(mission, writer, incarnation, mission_s, tuple(self._acceptable(registers)))

    def _acceptable(self, registers: Iterable[object]) -> Iterator[Message]:
        for register in registers:
            try:
                yield self._message(register)
            except _UnacceptableError as fault:
                self.dropped[fault.reason] += 1

    def _message(self, parts: object) -> Message:
        if not isinstance(parts, tuple) or len(parts) != 7:
            raise _UnacceptableError("malformed")
        version, mission, writer, incarnation, counter, kind, fields = parts
        _require(version == SCHEMA_VERSION, "unknown version")
        _require(mission == self._mission, "another mission")
        _require(isinstance(writer, str) and valid_id(writer), "malformed")
        if not isinstance(kind, str) or kind not in _KINDS:
            raise _UnacceptableError("unknown kind")
        # Defaults are for those who write messages: on the wire every field is needed.
        complete = isinstance(fields, dict) and fields.keys() == set(_FIELDS[_KINDS[kind]])
        _require(complete, "malformed")
        try:
            stamp = _stamps().validate_python({"incarnation": incarnation, "counter": counter})
            body = _bodies(kind).validate_python(fields)
        except (ValidationError, RecursionError):
            raise _UnacceptableError("malformed") from None
        _require(_may_say(writer, body), "said on another's key")
        return Message(mission, writer, stamp, body)


def _may_say(writer: str, body: Body) -> bool:
    """Whether statements of that kind are this writer's to make."""
    match body:
        case Brief() | Epoch() | Board():
            return writer == COORDINATOR
        case Command() | TaskOrder():
            return writer == OPERATOR
        case Claim() | Outcome() | Status() | Choice():
            return writer not in (COORDINATOR, OPERATOR)


class _UnacceptableError(Exception):
    """Received bytes that are not a message of ours; never leaves this module."""

    def __init__(self, reason: str) -> None:
        super().__init__(reason)
        self.reason = reason


def _require(condition: bool, reason: str) -> None:
    if not condition:
        raise _UnacceptableError(reason)


def _unpack(data: bytes) -> object:
    """What ``data`` holds, with tuples for arrays; None when it is not MessagePack."""
    try:
        return msgpack.unpackb(data, use_list=False, max_ext_len=0)
    except (ValueError, TypeError, msgpack.exceptions.UnpackException, RecursionError):
        # ValueError covers msgpack's FormatError, StackError, ExtraData and bad UTF-8.
        return None
