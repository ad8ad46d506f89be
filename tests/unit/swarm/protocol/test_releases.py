"""Releases that differ hear each other, as far as what is said can be mixed."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import msgpack
import pytest
from hypothesis import given

from swarm.protocol import codec as wire
from swarm.protocol.codec import Codec
from swarm.protocol.encoding import KINDS, SMALL_LIMIT_BYTES, encode
from swarm.protocol.key_space import KeySpace
from swarm.protocol.messages import SEPARATION_VERSION, Message, Snapshot
from swarm.protocol.registers import Replica
from swarm.protocol.sync import fingerprint
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
from tests.support.keyring import Keyring
from tests.support.message_strategies import messages

CLAIM = message("u0", held("t0", 1.0))
STATE = KeySpace(MISSION).state("u1")
SAID = [
    message("coordinator", brief(uav("u0"))),
    message("coordinator", epoch("u0")),
    message("coordinator", entry("t0")),
    CLAIM,
    message("u0", done("t0")),
    message("u0", status()),
    message("u0", choice("t0")),
]


def by_a_newer_release(said: Message, **fields: object) -> bytes:
    """``said`` with more fields, and one more part."""
    parts: list[Any] = msgpack.unpackb(encode(said))
    parts[6] |= fields
    data: bytes = msgpack.packb([*parts, "one more part"])
    return data


def heard(said: Message, data: bytes) -> Message:
    codec = Codec(MISSION)
    message_heard = codec.decode(said.key, data)
    assert message_heard is not None, codec.dropped
    return message_heard


@given(messages())
def test_what_a_newer_release_says_besides_is_passed_over(said: Message) -> None:
    codec = Codec(MISSION)

    assert codec.decode(said.key, by_a_newer_release(said, wind_m_s=3.0)) == said
    assert codec.dropped == {}, "it is no fault"
    assert len(codec.newer) == 1


def test_it_is_passed_over_within_a_part_too() -> None:
    said = message("coordinator", brief(uav("u0")))
    parts: list[Any] = msgpack.unpackb(encode(said))
    parts[6]["uavs"][0]["colour"] = "red"

    assert heard(said, msgpack.packb(parts)) == said


def test_what_is_not_understood_is_repeated_all_the_same() -> None:
    """So that one newer process hears of another through older ones."""
    data = by_a_newer_release(CLAIM, wind_m_s=3.0)
    said = heard(CLAIM, data)
    answer = encode(Snapshot(MISSION, "u1", 1, 1.0, (said,)))

    snapshot = Codec(MISSION).decode_snapshot(STATE, answer)

    assert snapshot is not None
    assert [encode(each) for each in snapshot.messages] == [data]
    assert fingerprint(snapshot.messages[0]) == fingerprint(said)


def test_what_is_not_understood_stays_under_its_signature() -> None:
    keys = Keyring("u0", "u1")
    data = by_a_newer_release(CLAIM, wind_m_s=3.0)
    codec, nonce = Codec(MISSION, keys.seal("u1")), bytes(16)
    said = codec.decode(CLAIM.key, keys.seal("u0").wrap(data))
    assert said is not None
    answer, _ = codec.pack_answer(Snapshot(MISSION, "u1", 1, 1.0, (said,)), nonce)

    snapshot = Codec(MISSION, keys.seal("u0")).decode_snapshot(STATE, answer, nonce)

    assert snapshot is not None
    assert [encode(each) for each in snapshot.messages] == [data]


@pytest.mark.parametrize("order", [1, -1])
def test_of_one_statement_the_one_that_says_more_stays(order: int) -> None:
    """Whichever comes first: what came through a process that leaves things out, or not."""
    more, less = heard(CLAIM, by_a_newer_release(CLAIM, wind_m_s=3.0)), heard(CLAIM, encode(CLAIM))
    replica = Replica()

    news = [replica.join(said) for said in (more, less)[::order]]

    assert news == [True, False], "there is nothing new in it"
    known = replica.register(CLAIM.key)
    assert known is not None
    assert known.said == more.said
    assert replica.digest() == {"u0": fingerprint(more)}


def test_a_changed_copy_says_what_it_says() -> None:
    said = heard(CLAIM, by_a_newer_release(CLAIM, wind_m_s=3.0))

    copy = dataclasses.replace(said, writer="u1")

    assert encode(copy) == encode(message("u1", held("t0", 1.0)))


@pytest.mark.parametrize("said", SAID, ids=lambda said: type(said.body).__name__)
def test_an_older_release_need_not_say_what_has_a_wire_default(
    said: Message, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As if the last field of each kind had been added after the release that speaks."""
    parts: list[Any] = msgpack.unpackb(encode(said))
    name, value = list(parts[6].items())[-1]
    del parts[6][name]
    older = msgpack.packb(parts)
    monkeypatch.setattr(wire, "WIRE_DEFAULTS", {})
    assert Codec(MISSION).decode(said.key, older) is None, "without a default it is needed"

    monkeypatch.setattr(wire, "WIRE_DEFAULTS", {parts[5]: {name: value}})

    assert heard(said, older) == said
    assert heard(said, encode(said)) == said, "who says it is heard as before"


def test_an_epoch_of_a_release_that_says_nothing_of_it_leaves_nothing_out() -> None:
    said = message("coordinator", epoch("u0", left_out={"energy": ("t1",)}))
    parts: list[Any] = msgpack.unpackb(encode(said))
    assert parts[0] == 2, "releases that do not know of it drop it, and such missions"
    assert msgpack.unpackb(encode(message("coordinator", epoch("u0"))))[0] == 1
    del parts[6]["left_out"]

    assert heard(said, msgpack.packb(parts)).body == epoch("u0")


def test_an_epoch_has_room_to_leave_out_all_of_five_thousand_tasks() -> None:
    tasks = tuple(f"t{n:063}" for n in range(5000))
    said = message("coordinator", epoch("u0", left_out={"nobody can": tasks}))

    assert heard(said, encode(said)) == said


def test_wire_defaults_are_of_fields_that_there_are() -> None:
    for kind, defaults in wire.WIRE_DEFAULTS.items():
        fields = [field.name for field in dataclasses.fields(KINDS[kind])]
        assert fields[-len(defaults) :] == list(defaults), "new fields stand at the end"


def test_what_a_newer_release_adds_counts_to_the_size() -> None:
    codec = Codec(MISSION)
    data = by_a_newer_release(CLAIM, padding=bytes(SMALL_LIMIT_BYTES))

    assert codec.decode(CLAIM.key, data) is None
    assert codec.dropped == {"too large": 1}


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda parts: parts.__setitem__(5, "formation"), "unknown kind"),
        (lambda parts: parts.__setitem__(0, SEPARATION_VERSION + 1), "unknown version"),
        (lambda parts: parts[6].update(phase="hovering"), "malformed"),
    ],
)
def test_what_cannot_be_mixed_is_dropped_and_counted(
    change: Callable[[list[Any]], object], reason: str
) -> None:
    parts: list[Any] = msgpack.unpackb(encode(CLAIM))
    change(parts)
    codec = Codec(MISSION)

    assert codec.decode(CLAIM.key, msgpack.packb(parts)) is None
    assert codec.dropped == {reason: 1}


def test_a_snapshot_may_have_more_parts() -> None:
    parts: list[Any] = msgpack.unpackb(encode(Snapshot(MISSION, "u1", 1, 1.0, (CLAIM,))))

    snapshot = Codec(MISSION).decode_snapshot(STATE, msgpack.packb([*parts, {"more": 1}]))

    assert snapshot == Snapshot(MISSION, "u1", 1, 1.0, (CLAIM,))


# -- What must not be passed over -----------------------------------------------------------------


def test_a_brief_without_accelerations_is_what_every_release_understands() -> None:
    said = message("coordinator", brief(uav("u0")))
    version, *_, body = msgpack.unpackb(encode(said))

    assert version == 1
    assert "acceleration_m_s2" not in body["uavs"][0]


def test_a_brief_with_accelerations_says_another_version_and_comes_through() -> None:
    slow = dataclasses.replace(uav("u0"), acceleration_m_s2=2.5)
    said = message("coordinator", brief(slow, uav("u1")))
    data = encode(said)
    version, *_, body = msgpack.unpackb(data)

    assert version == 2
    assert body["uavs"][0]["acceleration_m_s2"] == 2.5
    assert "acceleration_m_s2" not in body["uavs"][1]
    assert heard(said, data) == said
    snapshot = Snapshot(MISSION, "u1", 1, 1.0, (said, CLAIM))
    assert msgpack.unpackb(encode(snapshot))[0] == 1  # who knows less still hears the rest of it
    assert Codec(MISSION).decode_snapshot(STATE, encode(snapshot)) == snapshot


@pytest.mark.parametrize("value", [0.0, -1.0, 1e9, float("nan"), "2.5", True])
def test_an_acceleration_out_of_bounds_is_malformed(value: object) -> None:
    said = message("coordinator", brief(uav("u0")))
    parts: list[Any] = msgpack.unpackb(encode(said))
    parts[6]["uavs"][0]["acceleration_m_s2"] = value
    codec = Codec(MISSION)

    assert codec.decode(said.key, msgpack.packb(parts)) is None
    assert codec.dropped == {"malformed": 1}
