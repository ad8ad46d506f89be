"""Stamps: always news, also after another life of the same writer."""

from __future__ import annotations

from hypothesis import given

from swarm.state.voice import Voice
from swarm.wire.messages import Stamp
from tests.builders import IDLE, MISSION
from tests.message_strategies import stamps


def test_every_statement_is_later_than_the_one_before() -> None:
    voice = Voice(MISSION, "u0", 5)
    said = [voice.say(IDLE).stamp for _ in range(3)]

    assert said == [Stamp(5, 1), Stamp(5, 2), Stamp(5, 3)]


@given(stamps)
def test_what_others_remember_is_outdone(remembered: Stamp) -> None:
    voice = Voice(MISSION, "u0", 7)
    voice.outdo(remembered)

    assert voice.say(IDLE).stamp > max(remembered, Stamp(7, 0))


def test_older_memories_change_nothing() -> None:
    voice = Voice(MISSION, "u0", 7)
    voice.outdo(Stamp(6, 100))

    assert voice.say(IDLE).stamp == Stamp(7, 1)
