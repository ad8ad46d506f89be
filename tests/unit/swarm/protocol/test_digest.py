"""Digests: what is known just so is not told again, and everything else is."""

from __future__ import annotations

import msgpack
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarm.bus.port import MAX_PAYLOAD_BYTES
from swarm.model.ids import COORDINATOR
from swarm.protocol.fields import MAX_COUNT
from swarm.protocol.messages import Message
from swarm.protocol.registers import Replica
from swarm.protocol.sync import (
    MOST_WRITERS,
    combined,
    decode_digest,
    encode_digest,
    fingerprint,
    unknown,
)
from tests.support.builders import IDLE, brief, done, entry, held, message, uav
from tests.support.message_strategies import messages

crowds = st.lists(messages(all_kinds=False), max_size=5)


def replica_of(*said: Message) -> Replica:
    replica = Replica()
    replica.join_all(said)
    return replica


def news(answerer: Replica, asker: Replica) -> tuple[Message, ...]:
    return unknown(answerer.messages(), answerer.digest(), asker.digest())


@given(crowds, crowds)
def test_what_is_left_out_was_known(mine: list[Message], yours: list[Message]) -> None:
    """Joining the shortened answer gives what joining the whole one would have."""
    asker, answerer = replica_of(*mine), replica_of(*yours)
    through_all = replica_of(*asker.messages(), *answerer.messages())
    asker.join_all(news(answerer, asker))

    assert list(asker.messages()) == list(through_all.messages())


@given(crowds)
def test_who_knows_the_same_is_told_nothing(said: list[Message]) -> None:
    one, other = replica_of(*said), replica_of(*reversed(said))

    assert one.digest() == other.digest()
    assert news(one, other) == ()


@given(crowds)
def test_the_digest_of_all_writers_is_that_of_all_statements_in_any_order(
    said: list[Message],
) -> None:
    replica = replica_of(*said)
    one_by_one = [fingerprint(message) for message in replica.messages()]

    assert combined(replica.digest().values()) == combined(reversed(one_by_one))
    assert 0 <= combined(one_by_one) < MAX_COUNT


@given(crowds)
def test_a_digest_kept_up_to_date_equals_one_made_at_the_end(said: list[Message]) -> None:
    replica = Replica()
    for statement in said:
        replica.join(statement)
        replica.digest()

    assert replica.digest() == replica_of(*said).digest()


def test_all_registers_of_a_writer_are_told_when_one_is_news() -> None:
    theirs = [message(COORDINATOR, brief(uav("u0"))), message(COORDINATOR, entry("t0"), 2)]
    own, newer = message("u1", IDLE), message("u1", done("t0"), 2)

    assert news(replica_of(*theirs, own, newer), replica_of(*theirs, own)) == (own, newer)


def test_equal_stamps_with_other_contents_are_news() -> None:
    one, other = message("u0", held("t0", 1.0)), message("u0", held("t1", 1.0))

    assert news(replica_of(other), replica_of(one)) == (other,)


@given(crowds)
def test_every_digest_comes_back(said: list[Message]) -> None:
    known = replica_of(*said).digest()

    assert decode_digest(encode_digest(known)) == known
    assert decode_digest(b"") == {}


def test_a_digest_of_endlessly_many_writers_still_fits_a_question() -> None:
    endless = {f"{number:064d}": 2**64 - 1 for number in range(100_000)}
    data = encode_digest(endless)

    assert len(data) < MAX_PAYLOAD_BYTES
    assert decode_digest(data) == dict(list(endless.items())[:MOST_WRITERS])


@pytest.mark.parametrize("thing", [1, None, "u0", [], [["u0", 1]], {"u0": b"x"}, {1: 1}])
def test_what_is_no_digest_is_none(thing: object) -> None:
    assert decode_digest(msgpack.packb(thing)) is None


@given(st.binary(min_size=1, max_size=60))
def test_random_bytes_never_raise(data: bytes) -> None:
    known = decode_digest(data)

    assert known is None or decode_digest(encode_digest(known)) == known
