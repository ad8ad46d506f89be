"""Stamps: always news, also after another life of the same writer."""

from __future__ import annotations

from hypothesis import assume, given
from hypothesis import strategies as st

from swarm.state.voice import Voice
from swarm.wire.codec import Codec, encode
from swarm.wire.messages import MAX_COUNT, Stamp
from tests.builders import IDLE, MISSION, message, status
from tests.message_strategies import stamps

LARGEST = Stamp(MAX_COUNT, MAX_COUNT)
large_counts = st.integers(MAX_COUNT - 2000, MAX_COUNT)
large_stamps = st.builds(Stamp, large_counts, large_counts) | st.just(LARGEST)


def test_every_statement_is_later_than_the_one_before() -> None:
    voice = Voice(MISSION, "u0", 5)
    said = [voice.say(IDLE).stamp for _ in range(3)]

    assert said == [Stamp(5, 1), Stamp(5, 2), Stamp(5, 3)]


def test_a_register_is_said_with_its_bytes_which_are_wanted_again_and_again() -> None:
    voice = Voice(MISSION, "u0", 5)

    claim, news = voice.say(IDLE), voice.say(status())
    assert claim.said == encode(claim) == encode(message("u0", IDLE, 1, 5))
    assert news.said is None


@given(stamps)
def test_what_others_remember_is_outdone(remembered: Stamp) -> None:
    voice = Voice(MISSION, "u0", 7)
    assume(voice.outdo(remembered))

    assert voice.say(IDLE).stamp > max(remembered, Stamp(7, 0))


@given(large_stamps)
def test_whatever_is_outdone_what_follows_can_be_said(remembered: Stamp) -> None:
    """A forged stamp near the largest must neither raise nor make anyone drop what follows."""
    voice, codec = Voice(MISSION, "u0", 7), Codec(MISSION)
    outdone = voice.outdo(remembered)
    said = [voice.say(IDLE) for _ in range(3)]

    assert [codec.decode(message.key, encode(message)) for message in said] == said
    assert (said[0].stamp > remembered) == outdone
    assert said[0].stamp < said[1].stamp < said[2].stamp


def test_what_leaves_nothing_above_it_is_not_followed() -> None:
    """Or nothing that is said afterwards could be told from the first of it."""
    voice = Voice(MISSION, "u0", 7)

    assert not voice.outdo(LARGEST)
    assert voice.say(IDLE).stamp == Stamp(7, 1)
    assert voice.outdo(Stamp(MAX_COUNT, MAX_COUNT // 2))
    assert voice.say(IDLE).stamp > Stamp(MAX_COUNT, MAX_COUNT // 2)


def test_two_lives_that_outdo_the_same_do_not_come_out_alike() -> None:
    one, other = Voice(MISSION, "u0", 7_001), Voice(MISSION, "u0", 7_002)
    for voice in (one, other):
        voice.outdo(Stamp(9_500, 3))

    assert one.incarnation != other.incarnation


def test_older_memories_change_nothing() -> None:
    voice = Voice(MISSION, "u0", 7)
    voice.outdo(Stamp(6, 100))

    assert voice.say(IDLE).stamp == Stamp(7, 1)


def test_two_lives_that_outdo_one_stamp_do_not_come_out_alike() -> None:
    heard = Stamp(5000, 3)
    first, second = Voice(MISSION, "u0", 7), Voice(MISSION, "u0", 8)
    for voice in (first, second):
        voice.outdo(heard)

    assert 5000 < first.incarnation <= 6000
    assert first.incarnation != second.incarnation
