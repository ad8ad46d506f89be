"""Bytes <-> snapshots: whole, in part where they are too large, and without what is bad in them."""

from __future__ import annotations

import math
import tracemalloc
from dataclasses import replace

import msgpack
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swarm.bus.port import MAX_PAYLOAD_BYTES
from swarm.model.ids import COORDINATOR
from swarm.protocol.codec import Codec
from swarm.protocol.encoding import SNAPSHOT_LIMIT_BYTES, encode, fit
from swarm.protocol.fields import MAX_COUNT
from swarm.protocol.key_space import KeySpace
from swarm.protocol.messages import SEPARATION_VERSION, Message, Snapshot
from tests.support.builders import MISSION, brief, done, epoch, held, message, uav
from tests.support.message_strategies import messages
from tests.support.spoilt_messages import BOARD, BRIEF, CLAIM, OUTCOME, Parts, plain

STATE_KEY = KeySpace(MISSION).state("u0")


def snapshot_parts(*said: Message) -> Parts:
    parts: Parts = msgpack.unpackb(encode(Snapshot(MISSION, "u0", 1, 1.0, said)))
    return parts


def snapshot_drop_reason(data: bytes, key: str = STATE_KEY) -> str:
    codec = Codec(MISSION)
    assert codec.decode_snapshot(key, data) is None
    assert codec.dropped.total() == 1
    return next(iter(codec.dropped))


@given(st.binary(max_size=200) | plain.map(msgpack.packb))
def test_what_is_no_snapshot_never_raises(data: bytes) -> None:
    assert snapshot_drop_reason(data)


@given(st.data())
def test_truncated_snapshots_are_malformed(data: st.DataObject) -> None:
    whole = encode(Snapshot(MISSION, "u0", 1, 1.0, (CLAIM, OUTCOME)))
    length = data.draw(st.integers(0, len(whole) - 1))

    assert snapshot_drop_reason(whole[:length]) == "malformed"


def test_the_largest_fleets_with_the_shortest_names_come_through_whole() -> None:
    """Though their messages have many small parts for their size."""
    names = [f"u{number}" for number in range(1000)]
    order = replace(epoch(*names), routes=dict.fromkeys(names, ()))
    said = [message(COORDINATOR, order), message(COORDINATOR, brief(*(uav(n) for n in names)))]
    said += [message(name, held("t", 0.0)) for name in names]
    said += [message(name, done(f"t{task}")) for name in names for task in range(5)]
    snapshot = Snapshot(MISSION, "u0", 1, 1.0, tuple(said))

    assert Codec(MISSION).decode_snapshot(STATE_KEY, encode(snapshot)) == snapshot


@pytest.mark.parametrize("part", [b"\x80", b"\x81\x00\x00", b"\x91\x00"])
def test_few_bytes_cannot_fill_the_memory(part: bytes) -> None:
    head = encode(Snapshot(MISSION, "u0", 1, 1.0, ()))
    assert head.endswith(b"\x90")
    count = (SNAPSHOT_LIMIT_BYTES - 100) // len(part)
    hostile = head[:-1] + b"\xdd" + count.to_bytes(4, "big") + part * count
    codec = Codec(MISSION)

    tracemalloc.start()
    try:
        assert codec.decode_snapshot(STATE_KEY, hostile) is None
        _, peak_bytes = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()

    assert codec.dropped == {"malformed": 1}
    assert peak_bytes < 40 * SNAPSHOT_LIMIT_BYTES


@settings(max_examples=300)
@given(st.data())
def test_snapshots_with_flipped_bits_never_raise(data: st.DataObject) -> None:
    flipped = bytearray(encode(Snapshot(MISSION, "u0", 1, 1.0, (CLAIM, OUTCOME, BRIEF))))
    flipped[data.draw(st.integers(0, len(flipped) - 1))] ^= 1 << data.draw(st.integers(0, 7))

    Codec(MISSION).decode_snapshot(STATE_KEY, bytes(flipped))


@pytest.mark.parametrize(
    ("place", "instead", "reason"),
    [
        (0, 2, "unknown version"),
        (1, "other", "another mission"),
        (2, "u1", "said on another's key"),
        (2, "a/b", "malformed"),
        (2, 5, "malformed"),
        (3, -1, "malformed"),
        (3, MAX_COUNT + 1, "malformed"),
        (3, True, "malformed"),
        (3, 1.0, "malformed"),
        (4, math.nan, "malformed"),
        (4, math.inf, "malformed"),
        (4, 1e200, "malformed"),
        (4, "1", "malformed"),
        (4, True, "malformed"),
        (5, "claims", "malformed"),
        (5, None, "malformed"),
        (5, {}, "malformed"),
    ],
)
def test_snapshots_with_a_wrong_part_are_dropped(place: int, instead: object, reason: str) -> None:
    parts = snapshot_parts(CLAIM)
    parts[place] = instead

    assert snapshot_drop_reason(msgpack.packb(parts)) == reason


def test_a_snapshot_answered_on_anothers_key_is_dropped() -> None:
    data = encode(Snapshot(MISSION, "u0", 1, 1.0, ()))

    assert snapshot_drop_reason(data, KeySpace(MISSION).state("u1")) == "said on another's key"
    assert snapshot_drop_reason(data, "state/u0") == "said on another's key"


def test_a_snapshot_may_be_as_large_as_the_bus_carries_and_no_larger() -> None:
    assert SNAPSHOT_LIMIT_BYTES <= MAX_PAYLOAD_BYTES
    data = encode(Snapshot(MISSION, "u0", 1, 1.0, (BRIEF,) * (SNAPSHOT_LIMIT_BYTES // 200)))
    assert len(data) > SNAPSHOT_LIMIT_BYTES

    assert snapshot_drop_reason(data) == "too large"


def test_a_snapshot_that_fits_is_answered_whole() -> None:
    snapshot = Snapshot(MISSION, "u0", 1, 1.0, (BRIEF, CLAIM))

    assert fit(snapshot) is snapshot
    assert fit(snapshot, len(encode(snapshot))) is snapshot


@given(st.lists(messages(), max_size=8).map(tuple), st.integers(100, 1500))
def test_of_a_snapshot_too_large_there_stays_what_fits_the_own_first(
    said: tuple[Message, ...], limit_bytes: int
) -> None:
    snapshot = Snapshot(MISSION, "u0", 1, 1.0, said)
    fitted = fit(snapshot, limit_bytes)

    assert len(encode(fitted)) <= limit_bytes
    assert all(m in said for m in fitted.messages)
    left_out = [m for m in said if m not in fitted.messages]
    for message_out in left_out:
        if message_out.writer == "u0":  # no stranger's register took its room
            own = sum(len(encode(m)) for m in fitted.messages if m.writer == "u0")
            assert own + len(encode(message_out)) > limit_bytes - 60


def test_bad_registers_in_a_snapshot_are_left_out_and_the_others_kept() -> None:
    parts = snapshot_parts(CLAIM, OUTCOME, BOARD)
    parts[5][0][0] = SEPARATION_VERSION + 1
    parts[5][1][6]["completed_s"] = math.nan
    parts[5] += ["nonsense", None, [], parts[5][2][:5]]
    codec = Codec(MISSION)

    heard = codec.decode_snapshot(STATE_KEY, msgpack.packb(parts))

    assert heard == Snapshot(MISSION, "u0", 1, 1.0, (BOARD,))
    assert codec.dropped == {"unknown version": 1, "malformed": 5}


def test_a_snapshot_may_hold_registers_of_others_but_not_swap_the_roles() -> None:
    theirs, forged = replace(CLAIM, writer="u1"), replace(BOARD, writer="u0")
    codec = Codec(MISSION)

    heard = codec.decode_snapshot(
        STATE_KEY, encode(Snapshot(MISSION, "u0", 1, 1.0, (theirs, forged)))
    )

    assert heard is not None
    assert heard.messages == (theirs,)
    assert codec.dropped == {"said on another's key": 1}
