"""A made-up later release: its messages have one more field and part, and it has one more kind.

Releases that there have been are in tests/process/test_mixed_versions.py.
"""

from __future__ import annotations

from typing import Any

import msgpack
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from swarm.model.ids import COORDINATOR
from swarm.protocol.codec import Codec
from swarm.protocol.encoding import encode
from swarm.protocol.key_space import KeySpace
from swarm.protocol.messages import Message, Snapshot
from swarm.protocol.sync import fingerprint
from tests.support.builders import MISSION, entry, message
from tests.support.message_strategies import messages

LATER: Any = {"limit_m": 120.0, "names": ["north", "south"]}
SLOW = [HealthCheck.too_slow]  # the first draws, on a busy machine
NEW_KIND = [1, MISSION, "u1", 1, 1, "weather", {"wind_m_s": 4.0}]


def grown(value: Any) -> Any:
    """``value`` with a field more wherever there are named fields."""
    if isinstance(value, list):
        return [grown(each) for each in value]
    if not isinstance(value, dict):
        return value
    # What is named by ids of UAVs and tasks is a table, which no release gives fields of its own.
    inner = {name: each if name in TABLES else grown(each) for name, each in value.items()}
    return {**inner, "later": LATER}


TABLES = ("dropped", "heads", "left_out", "routes", "success", "survival")


def said_later(said: Message) -> bytes:
    """``said`` as the later release says it."""
    *head, body = msgpack.unpackb(encode(said))
    packed: bytes = msgpack.packb([*head, grown(body), "a part more"])
    return packed


def heard(codec: Codec, said: Message) -> Message | None:
    return codec.decode(said.key, said_later(said))


@settings(max_examples=60, suppress_health_check=SLOW)
@given(said=messages())
def test_what_it_says_is_understood_and_nothing_is_dropped(said: Message) -> None:
    codec = Codec(MISSION)

    assert heard(codec, said) == said
    assert not codec.dropped
    assert len(codec.newer) == 1


@settings(max_examples=30, suppress_health_check=SLOW)
@given(said=messages())
def test_what_it_says_is_repeated_with_what_only_it_understands(said: Message) -> None:
    understood = heard(Codec(MISSION), said)

    assert understood is not None
    assert encode(understood) == said_later(said)
    assert fingerprint(understood) != fingerprint(said), "asked again, it would tell its own anew"


@settings(max_examples=20, suppress_health_check=SLOW)
@given(said=st.lists(messages(), max_size=4))
def test_its_answers_are_understood_up_to_kinds_that_are_new(said: list[Message]) -> None:
    registers = [msgpack.unpackb(said_later(each)) for each in said]
    answer = msgpack.packb([1, MISSION, "u1", 1, 2.0, [*registers, NEW_KIND], "a part more"])
    codec = Codec(MISSION)

    snapshot = codec.decode_snapshot(KeySpace(MISSION).state("u1"), answer)

    assert snapshot == Snapshot(MISSION, "u1", 1, 2.0, tuple(said))
    assert codec.dropped == {"unknown kind": 1}


def test_an_answer_hands_on_its_registers_as_it_has_said_them() -> None:
    said = message(COORDINATOR, entry("t0"))
    understood = heard(Codec(MISSION), said)
    assert understood is not None

    answer = encode(Snapshot(MISSION, "u0", 1, None, (understood,)))

    assert msgpack.unpackb(answer)[5] == [msgpack.unpackb(said_later(said))]
