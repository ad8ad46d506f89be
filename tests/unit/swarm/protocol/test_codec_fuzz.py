"""Bytes and parts at random in the place of messages: dropped, and never more than that."""

from __future__ import annotations

import msgpack
from hypothesis import given, settings
from hypothesis import strategies as st

from swarm.protocol.codec import Codec
from swarm.protocol.encoding import encode
from swarm.protocol.messages import Message
from tests.support.builders import MISSION
from tests.support.spoilt_messages import CLAIM, EVERY_KIND, drop_reason, parts_of, plain


@given(st.sampled_from(EVERY_KIND), st.binary(max_size=200))
def test_random_bytes_are_dropped_and_counted(said: Message, data: bytes) -> None:
    assert drop_reason(said.key, data)


@given(st.sampled_from(EVERY_KIND), st.data())
def test_truncated_bytes_are_dropped_as_malformed(said: Message, data: st.DataObject) -> None:
    whole = encode(said)
    length = data.draw(st.integers(0, len(whole) - 1))

    assert drop_reason(said.key, whole[:length]) == "malformed"


@given(st.sampled_from(EVERY_KIND), st.binary(min_size=1, max_size=9))
def test_bytes_after_the_end_are_dropped_as_malformed(said: Message, tail: bytes) -> None:
    assert drop_reason(said.key, encode(said) + tail) == "malformed"


@settings(max_examples=500)
@given(st.sampled_from(EVERY_KIND), st.data())
def test_flipped_bits_never_raise_and_never_change_who_speaks(
    said: Message, data: st.DataObject
) -> None:
    flipped = bytearray(encode(said))
    for _ in range(data.draw(st.integers(1, 3))):
        flipped[data.draw(st.integers(0, len(flipped) - 1))] ^= 1 << data.draw(st.integers(0, 7))
    codec = Codec(MISSION)

    heard = codec.decode(said.key, bytes(flipped))

    assert (heard is None) == (codec.dropped.total() == 1)
    if heard is not None:
        assert (heard.mission, heard.key) == (MISSION, said.key)


@settings(max_examples=300)
@given(st.sampled_from(EVERY_KIND), st.integers(0, 6), plain)
def test_anything_in_the_place_of_a_part_never_raises(
    said: Message, place: int, instead: object
) -> None:
    parts = parts_of(said)
    parts[place] = instead
    codec = Codec(MISSION)

    heard = codec.decode(said.key, msgpack.packb(parts))

    assert (heard is None) == (codec.dropped.total() == 1)


@settings(max_examples=300)
@given(st.sampled_from(EVERY_KIND), plain, st.data())
def test_anything_in_the_place_of_a_field_never_raises(
    said: Message, instead: object, data: st.DataObject
) -> None:
    parts = parts_of(said)
    parts[6][data.draw(st.sampled_from(sorted(parts[6])))] = instead
    codec = Codec(MISSION)

    heard = codec.decode(said.key, msgpack.packb(parts))

    assert (heard is None) == (codec.dropped.total() == 1)


@given(plain)
def test_anything_that_is_messagepack_never_raises(thing: object) -> None:
    assert drop_reason(CLAIM.key, msgpack.packb(thing))
