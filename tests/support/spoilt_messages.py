"""A message of every kind, and why it is dropped once its bytes or parts are spoilt."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import msgpack
from hypothesis import strategies as st

from swarm.model.ids import COORDINATOR, OPERATOR
from swarm.protocol.codec import Codec
from swarm.protocol.encoding import encode
from swarm.protocol.messages import CommandKind, Message, OperatorCommand
from tests.support.builders import (
    MISSION,
    brief,
    choice,
    done,
    entry,
    epoch,
    held,
    message,
    status,
    uav,
)

BRIEF = message(COORDINATOR, brief(uav("u0"), uav("u1", t0=0.5)))
EPOCH = message(COORDINATOR, epoch("u1", "u0"))
BOARD = message(COORDINATOR, entry("t0"))
CLAIM = message("u0", held("t0", 1.0))
OUTCOME = message("u0", done("t0"))
STATUS = message("u0", status())
COMMAND = message(OPERATOR, OperatorCommand("u0", CommandKind.HOLD, 1, ""))
CHOICE = message("u0", choice("t0", left="t1"))
EVERY_KIND = [BRIEF, EPOCH, BOARD, CLAIM, OUTCOME, STATUS, COMMAND, CHOICE]
EVERY_KIND_IDS = [type(said.body).__name__ for said in EVERY_KIND]

Parts = list[Any]


def drop_reason(key: str, data: bytes) -> str:
    """Why ``data`` was dropped; fails when it was not, or was counted otherwise than once."""
    codec = Codec(MISSION)
    assert codec.decode(key, data) is None
    assert codec.dropped.total() == 1
    return next(iter(codec.dropped))


def parts_of(said: Message) -> Parts:
    parts: Parts = msgpack.unpackb(encode(said))
    return parts


def reason_with(said: Message, change: Callable[[Parts], object]) -> str:
    """Why ``said`` is dropped once ``change`` has been at its parts."""
    parts = parts_of(said)
    change(parts)
    return drop_reason(said.key, msgpack.packb(parts))


def reason_with_field(said: Message, **fields: object) -> str:
    return reason_with(said, lambda parts: parts[6].update(fields))


plain = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**63), 2**64 - 1)
    | st.floats()
    | st.text(max_size=5)
    | st.binary(max_size=5)
    | st.just(msgpack.ExtType(5, b"")),
    lambda inner: (
        st.lists(inner, max_size=8)
        | st.dictionaries(st.text(max_size=5) | st.binary(max_size=3), inner, max_size=4)
    ),
    max_leaves=20,
)
