"""Stamps: always news, also after another life of the same writer."""

from __future__ import annotations

from hypothesis import assume, given
from hypothesis import strategies as st

from swarm.protocol.codec import Codec
from swarm.protocol.encoding import encode
from swarm.protocol.fields import MAX_COUNT
from swarm.protocol.messages import Stamp
from swarm.protocol.register_writer import RegisterWriter
from tests.support.builders import IDLE, MISSION, message, status
from tests.support.message_strategies import stamps

LARGEST = Stamp(MAX_COUNT, MAX_COUNT)
large_counts = st.integers(MAX_COUNT - 2000, MAX_COUNT)
large_stamps = st.builds(Stamp, large_counts, large_counts) | st.just(LARGEST)


def test_every_statement_is_later_than_the_one_before() -> None:
    register_writer = RegisterWriter(MISSION, "u0", 5)
    said = [register_writer.say(IDLE).stamp for _ in range(3)]

    assert said == [Stamp(5, 1), Stamp(5, 2), Stamp(5, 3)]


def test_a_register_is_said_with_its_bytes_which_are_wanted_again_and_again() -> None:
    register_writer = RegisterWriter(MISSION, "u0", 5)

    claim, news = register_writer.say(IDLE), register_writer.say(status())
    assert claim.said == encode(claim) == encode(message("u0", IDLE, 1, 5))
    assert news.said is None


@given(stamps)
def test_what_others_remember_is_outdone(remembered: Stamp) -> None:
    register_writer = RegisterWriter(MISSION, "u0", 7)
    assume(register_writer.observe(remembered))

    assert register_writer.say(IDLE).stamp > max(remembered, Stamp(7, 0))


@given(large_stamps)
def test_whatever_is_outdone_what_follows_can_be_said(remembered: Stamp) -> None:
    """A forged stamp near the largest must neither raise nor make anyone drop what follows."""
    register_writer, codec = RegisterWriter(MISSION, "u0", 7), Codec(MISSION)
    outdone = register_writer.observe(remembered)
    said = [register_writer.say(IDLE) for _ in range(3)]

    assert [codec.decode(message.key, encode(message)) for message in said] == said
    assert (said[0].stamp > remembered) == outdone
    assert said[0].stamp < said[1].stamp < said[2].stamp


def test_what_leaves_nothing_above_it_is_not_followed() -> None:
    """Or nothing that is said afterwards could be told from the first of it."""
    register_writer = RegisterWriter(MISSION, "u0", 7)

    assert not register_writer.observe(LARGEST)
    assert register_writer.say(IDLE).stamp == Stamp(7, 1)
    assert register_writer.observe(Stamp(MAX_COUNT, MAX_COUNT // 2))
    assert register_writer.say(IDLE).stamp > Stamp(MAX_COUNT, MAX_COUNT // 2)


def test_two_lives_that_outdo_the_same_do_not_come_out_alike() -> None:
    one, other = RegisterWriter(MISSION, "u0", 7_001), RegisterWriter(MISSION, "u0", 7_002)
    for register_writer in (one, other):
        register_writer.observe(Stamp(9_500, 3))

    assert one.incarnation != other.incarnation


def test_older_memories_change_nothing() -> None:
    register_writer = RegisterWriter(MISSION, "u0", 7)
    register_writer.observe(Stamp(6, 100))

    assert register_writer.say(IDLE).stamp == Stamp(7, 1)


def test_two_lives_that_outdo_one_stamp_do_not_come_out_alike() -> None:
    heard = Stamp(5000, 3)
    first, second = RegisterWriter(MISSION, "u0", 7), RegisterWriter(MISSION, "u0", 8)
    for register_writer in (first, second):
        register_writer.observe(heard)

    assert 5000 < first.incarnation <= 6000
    assert first.incarnation != second.incarnation
