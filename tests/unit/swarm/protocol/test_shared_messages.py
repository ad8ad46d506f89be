"""What several agents of one process hear is read once, and believed no more than before."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from hypothesis import given

from swarm.model.ids import COORDINATOR
from swarm.protocol.codec import Codec
from swarm.protocol.encoding import encode
from swarm.protocol.key_space import KeySpace
from swarm.protocol.messages import Message, Snapshot
from swarm.protocol.shared_messages import SharedMessages
from swarm.protocol.uav_messages import Nearby
from tests.support.builders import IDLE, MISSION, entry, held, message, status
from tests.support.message_strategies import messages


@given(messages())
def test_what_another_has_read_is_the_same_statement(said: Message) -> None:
    shared = SharedMessages()
    first, second = Codec(MISSION, shared=shared), Codec(MISSION, shared=shared)

    assert first.decode(said.key, encode(said)) == said
    assert second.decode(said.key, encode(said)) == said
    assert second.decode("another/key", encode(said)) is None
    assert second.dropped == {"said on another's key": 1}


@pytest.mark.parametrize("first", ["on the bus", "in an answer"])
def test_a_statement_is_read_once_however_it_comes(first: str) -> None:
    said, shared = message("u1", held("t0", 1.0)), SharedMessages()

    def on_the_bus(codec: Codec) -> Message | None:
        return codec.decode(said.key, encode(said))

    def in_an_answer(codec: Codec) -> Message | None:
        answer = encode(Snapshot(MISSION, "u2", 1, None, (said,)))
        told = codec.decode_snapshot(KeySpace(MISSION).state("u2"), answer)
        assert told is not None
        return told.messages[0]

    ways: list[Callable[[Codec], Message | None]] = [on_the_bus, in_an_answer]
    read = [way(Codec(MISSION, shared=shared)) for way in ways[:: 1 if "bus" in first else -1]]

    assert read[0] == said
    assert read[0] is read[1]


def test_what_is_not_said_again_goes_and_what_is_stays() -> None:
    shared = SharedMessages()
    repeated, once = message("u0", IDLE), message("u1", IDLE)
    for said in (repeated, once):
        shared.keep(encode(said), said)

    for number in range(10_000):
        task = message(COORDINATOR, entry(f"t{number}"), number)
        shared.keep(encode(task), task)
        assert shared.find(encode(repeated)) is repeated

    assert shared.find(encode(once)) is None


def test_what_is_for_onlookers_is_not_kept() -> None:
    shared, said = SharedMessages(), message("u0", status())

    shared.keep(encode(said), said)

    assert shared.find(encode(said)) is None


def nearby(place_m: float) -> Nearby:
    place = (place_m, 0.0, 30.0)
    return Nearby((0, 0), True, place, (0.0, 0.0, 0.0), (), 8.0, 1, 2, 0, 5.0)


def test_where_somebody_is_is_kept_for_all_near_it_and_drives_out_nothing_that_is_repeated() -> (
    None
):
    shared, repeated = SharedMessages(), message("u1", held("t0", 1.0))
    shared.keep(encode(repeated), repeated)

    for number in range(10_000):
        said = message("u0", nearby(float(number)), number)
        shared.keep(encode(said), said)
        assert shared.find(encode(said)) is said

    assert shared.find(encode(repeated)) is repeated
    assert shared.find(encode(message("u0", nearby(0.0), 0))) is None
