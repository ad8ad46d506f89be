"""Envelopes: what its writer has signed is believed, and nothing else, byte for byte."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace

import msgpack
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarm.model.ids import AUTHORITY, COORDINATOR, OPERATOR
from swarm.protocol.codec import Codec
from swarm.protocol.encoding import encode, encode_memory
from swarm.protocol.key_space import KeySpace
from swarm.protocol.messages import (
    CommandKind,
    Message,
    OperatorCommand,
    SignedRoster,
    Snapshot,
    Stamp,
    as_heard,
    demoted,
)
from swarm.protocol.seal import ANSWER, Seal, UnacceptableError, open_envelope
from swarm.protocol.uav_messages import Nearby
from tests.support.builders import MISSION, choice, done, entry, epoch, held, message, status
from tests.support.keyring import Keyring

KEYS = Keyring("u0", "u1")
OTHERS = Keyring("u0", "u1")
"""Of another authority, with the same names."""
CLAIM = message("u0", held("t0", 1.0))
SEALS = {name: KEYS.seal(name) for name in KEYS.private}
NONCE = bytes(range(16))
STATE = KeySpace(MISSION).state("u0")

NEARBY = Nearby(
    (3, -2),
    True,
    (760.0, -310.0, 40.0),
    (8.0, 0.0, 0.0),
    ((900.0, -310.0, 40.0),),
    8.0,
    1,
    0,
    0,
    1.0,
)
HONEST = [
    (CLAIM, "u0"),
    (message("u0", done("t0")), "u0"),
    (message("u0", status()), "u0"),
    (message("u0", choice("t0")), "u0"),
    (message("u0", NEARBY), "u0"),
    (message(COORDINATOR, epoch("u0")), COORDINATOR),
    (message(COORDINATOR, entry("t0")), "coordinator-2"),
    (message(OPERATOR, OperatorCommand("u0", CommandKind.HOLD, 1, "")), OPERATOR),
]


def envelope(said: Message, signer: str, keys: Keyring = KEYS) -> bytes:
    return keys.seal(signer).wrap(encode(said))


def drop_reason(key: str, data: bytes, seal: Seal | None = None) -> str:
    codec = Codec(MISSION, seal or KEYS.seal("u1"))
    assert codec.decode(key, data) is None
    assert codec.dropped.total() == 1
    return next(iter(codec.dropped))


# -- what is signed is believed ---------------------------------------------------------


@pytest.mark.parametrize(("said", "signer"), HONEST)
def test_what_its_writer_has_signed_comes_through_with_its_envelope(
    said: Message, signer: str
) -> None:
    codec = Codec(MISSION, KEYS.seal("u1"))

    packed = Codec(MISSION, KEYS.seal(signer)).pack(said)
    assert packed is not None
    heard = codec.decode(said.key, packed)

    assert heard == said
    assert heard is not None
    assert (heard.said, heard.envelope) == (encode(said), packed)
    assert codec.pack(heard) == packed, "it is repeated as it was heard"
    assert codec.dropped.total() == 0


def test_a_statement_that_is_only_repeated_is_the_one_that_was_believed() -> None:
    codec = Codec(MISSION, KEYS.seal("u1"))
    packed = Codec(MISSION, KEYS.seal("u0")).pack(CLAIM)
    assert packed is not None
    known = codec.decode(CLAIM.key, packed)
    assert known is not None

    assert codec.decode(CLAIM.key, packed, known) is known
    assert codec.decode(CLAIM.key, encode(CLAIM), known) is None, "unsigned, as it says"
    gone = demoted(known)
    again = codec.decode(CLAIM.key, packed, gone)
    assert again is not gone, "nobody stands for that any more, so it is checked anew"
    assert again == known


@given(st.binary(max_size=300), st.sampled_from([b"", b"question", ANSWER + NONCE]))
def test_an_envelope_gives_back_what_was_put_into_it(said: bytes, bound: bytes) -> None:
    opened = SEALS["u1"].unwrap(SEALS["u0"].wrap(said, bound), bound)

    assert (opened.signer, opened.said) == ("u0", said)


@pytest.mark.parametrize("length", [0, 255, 256, 65535, 65536])
def test_envelopes_are_messagepack_of_every_length(length: int) -> None:
    data = SEALS["u0"].wrap(bytes(length))

    mark, signer, signature, said = msgpack.unpackb(data)

    opened = open_envelope(data)
    assert opened is not None
    assert (mark, signer, signature, said) == ("sealed 1", "u0", opened.signature, bytes(length))


# -- nothing else is ---------------------------------------------------------------------


@given(st.data())
def test_an_envelope_with_a_flipped_bit_is_dropped(data: st.DataObject) -> None:
    whole = bytearray(SEALS["u0"].wrap(encode(CLAIM)))
    whole[data.draw(st.integers(0, len(whole) - 1))] ^= 1 << data.draw(st.integers(0, 7))

    assert drop_reason(CLAIM.key, bytes(whole), SEALS["u1"]) in {
        "not signed",
        "wrongly signed",
        "signer unknown",
        "malformed",
    }


@given(st.data())
def test_cut_or_lengthened_envelopes_are_dropped(data: st.DataObject) -> None:
    whole = SEALS["u0"].wrap(encode(CLAIM))
    cut = whole[: data.draw(st.integers(0, len(whole) - 1))]
    longer = whole + data.draw(st.binary(min_size=1, max_size=3))

    assert drop_reason(CLAIM.key, cut, SEALS["u1"]) in {"not signed", "malformed"}
    assert drop_reason(CLAIM.key, longer, SEALS["u1"]) == "malformed"


@pytest.mark.parametrize(("said", "signer"), HONEST)
def test_what_is_not_signed_is_dropped_where_there_are_keys(said: Message, signer: str) -> None:
    assert drop_reason(said.key, encode(said)) == "not signed"


def test_what_is_signed_is_dropped_where_there_are_no_keys() -> None:
    codec = Codec(MISSION)

    assert codec.decode(CLAIM.key, envelope(CLAIM, "u0")) is None
    assert codec.dropped == {"signed, but no keys here": 1}


@pytest.mark.parametrize("said", [said for said, _ in HONEST])
@pytest.mark.parametrize("liar", ["u1", "dashboard", "router"])
def test_nobody_speaks_for_another(said: Message, liar: str) -> None:
    assert drop_reason(said.key, envelope(said, liar)) == "not the signer's to say"


def test_a_uav_cannot_command_and_an_operator_not_claim() -> None:
    by_operator = envelope(CLAIM, OPERATOR)
    by_coordinator = envelope(CLAIM, COORDINATOR)

    assert drop_reason(CLAIM.key, by_operator) == "not the signer's to say"
    assert drop_reason(CLAIM.key, by_coordinator) == "not the signer's to say"


def test_a_signature_under_anothers_name_is_wrong() -> None:
    opened = open_envelope(envelope(CLAIM, "u1"))
    assert opened is not None
    forged = msgpack.packb(["sealed 1", "u0", opened.signature, opened.said])

    assert drop_reason(CLAIM.key, forged) == "wrongly signed"


def test_keys_of_another_authority_are_worth_nothing() -> None:
    assert drop_reason(CLAIM.key, envelope(CLAIM, "u0", OTHERS)) == "wrongly signed"


def test_what_was_signed_under_another_series_is_worth_nothing() -> None:
    old = replace(KEYS.roster, series=b"x" * 16)
    earlier = KEYS.seal("u0", old).wrap(encode(CLAIM))

    assert drop_reason(CLAIM.key, earlier) == "wrongly signed"


def test_who_is_not_in_the_roster_is_unknown() -> None:
    data = envelope(CLAIM, "u0")

    assert drop_reason(CLAIM.key, data, KEYS.seal("u1", KEYS.without("u0"))) == "signer unknown"


def test_an_honest_envelope_on_anothers_key_is_dropped() -> None:
    key = KeySpace(MISSION).claim("u1")

    assert drop_reason(key, envelope(CLAIM, "u0")) == "said on another's key"


def test_where_somebody_is_counts_in_the_cell_for_which_it_was_said_alone() -> None:
    """Or its old words could be told to those who fly elsewhere by now."""
    said = message("u0", NEARBY)
    elsewhere = KeySpace(MISSION).near("u0", 0, 0)

    assert drop_reason(elsewhere, envelope(said, "u0")) == "said on another's key"


def test_what_is_wrongly_signed_is_not_even_parsed() -> None:
    """No parser meets bytes whose writer is not known."""
    nonsense = b"\xc1" * 50
    forged = msgpack.packb(["sealed 1", "u0", bytes(64), nonsense])

    assert drop_reason(CLAIM.key, forged) == "wrongly signed"
    assert drop_reason(CLAIM.key, SEALS["u0"].wrap(nonsense), SEALS["u1"]) == "malformed"


def test_a_statement_signed_as_an_answer_is_no_statement() -> None:
    bound = SEALS["u0"].wrap(encode(CLAIM), ANSWER + NONCE)

    assert drop_reason(CLAIM.key, bound) == "wrongly signed"


# -- answers -----------------------------------------------------------------------------


def answer_of(name: str, *said: Message, writer: str = "u0", nonce: bytes = NONCE) -> bytes:
    return Codec(MISSION, KEYS.seal(name)).pack_answer(
        Snapshot(MISSION, writer, 1, 1.0, said), nonce
    )[0]


def heard_by_u1(said: Message, signer: str) -> Message:
    heard = Codec(MISSION, KEYS.seal("u1")).decode(said.key, envelope(said, signer))
    assert heard is not None
    return heard


def test_an_answer_repeats_others_in_their_own_envelopes() -> None:
    theirs = Codec(MISSION, KEYS.seal("u0")).decode(
        "swarm/test/plan", envelope(message(COORDINATOR, epoch("u0")), COORDINATOR)
    )
    assert theirs is not None
    codec = Codec(MISSION, KEYS.seal("u1"))

    heard = codec.decode_snapshot(STATE, answer_of("u0", CLAIM, theirs), NONCE)

    assert heard == Snapshot(MISSION, "u0", 1, 1.0, (CLAIM, theirs))
    assert [said.envelope is not None for said in heard.messages] == [True, True]


def test_of_an_answer_only_envelopes_and_a_roster_are_unpacked() -> None:
    """A member of the fleet must not fill the others' memory either."""
    head = encode(Snapshot(MISSION, "u0", 1, 1.0, ()))
    count = 4_000_000
    said = head[:-1] + b"\xdd" + count.to_bytes(4, "big") + b"\x80" * count
    codec, hostile = Codec(MISSION, KEYS.seal("u1")), KEYS.seal("u0").wrap(said, ANSWER + NONCE)

    tracemalloc.start()
    try:
        assert codec.decode_snapshot(STATE, hostile, NONCE) is None
        _, peak_bytes = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()

    assert codec.dropped == {"malformed": 1}
    assert peak_bytes < 10 * len(hostile)


def test_an_answer_counts_for_its_question_alone() -> None:
    codec = Codec(MISSION, KEYS.seal("u1"))

    assert codec.decode_snapshot(STATE, answer_of("u0", CLAIM), bytes(16)) is None
    assert codec.dropped == {"wrongly signed": 1}


def test_nobody_answers_for_another() -> None:
    codec = Codec(MISSION, KEYS.seal("u1"))
    said = Codec(MISSION, None).pack_answer(Snapshot(MISSION, "u0", 1, 1.0, ()), b"")[0]
    lie = KEYS.seal("u1").wrap(said, ANSWER + NONCE)

    assert codec.decode_snapshot(STATE, lie, NONCE) is None
    assert codec.decode_snapshot(STATE, said, NONCE) is None
    assert codec.dropped == {"not the signer's to say": 1, "not signed": 1}


def test_what_a_liar_puts_into_its_own_answer_is_left_out_and_the_rest_kept() -> None:
    codec = Codec(MISSION, KEYS.seal("u1"))
    forged = message(COORDINATOR, epoch("u0"))
    own = KEYS.seal("u0")
    registers = [
        own.wrap(encode(forged)),
        envelope(forged, "u0", OTHERS),
        msgpack.unpackb(encode(forged)),
        msgpack.unpackb(encode(CLAIM)),
        own.wrap(encode(CLAIM)),
    ]
    said = msgpack.packb([1, MISSION, "u0", 1, 1.0, registers])

    heard = codec.decode_snapshot(STATE, own.wrap(said, ANSWER + NONCE), NONCE)

    assert heard is not None
    assert heard.messages == (CLAIM,)
    assert codec.dropped == {"not the signer's to say": 1, "wrongly signed": 1, "not signed": 2}


def test_what_nobody_would_believe_is_not_repeated() -> None:
    """As a statement from a memory of before there were keys."""
    codec, remembered = Codec(MISSION, KEYS.seal("u1")), message("u0", held("t0", 1.0))

    assert codec.pack(remembered) is None
    answer, left_out = codec.pack_answer(Snapshot(MISSION, "u1", 1, 1.0, (remembered,)), NONCE)

    heard = Codec(MISSION, KEYS.seal("u0")).decode_snapshot(
        KeySpace(MISSION).state("u1"), answer, NONCE
    )
    assert heard == Snapshot(MISSION, "u1", 1, 1.0, ())
    assert left_out == 0


# -- cost --------------------------------------------------------------------------------


def test_a_repeated_register_is_signed_once() -> None:
    count = 0
    private = KEYS.private["u0"]

    def sign(data: bytes) -> bytes:
        nonlocal count
        count += 1
        return private.sign(data)

    public = KEYS.authority.public_key().public_bytes_raw()
    codec = Codec(MISSION, Seal("u0", sign, KEYS.signed(), public))
    said = message("u0", held("t0", 1.0))

    first = codec.pack(said)

    assert [codec.pack(said) for _ in range(5)] == [first] * 5
    assert count == 1


# -- rosters -----------------------------------------------------------------------------

ROSTER_KEY = KeySpace(MISSION).roster


def roster_message(signed: str, version: int) -> Message:
    return Message(MISSION, AUTHORITY, Stamp(version, 0), SignedRoster(signed))


def test_a_roster_needs_no_envelope_and_anyone_may_repeat_it() -> None:
    said = roster_message(KEYS.signed(KEYS.without("u0")), 2)
    codec = Codec(MISSION, KEYS.seal("u1"))

    assert codec.decode(ROSTER_KEY, encode(said)) == said
    heard = codec.decode_snapshot(STATE, answer_of("u0", said), NONCE)
    assert heard is not None
    assert heard.messages == (said,)


def test_rosters_that_the_authority_has_not_signed_are_dropped() -> None:
    forged = roster_message(OTHERS.signed(OTHERS.without("u0")), 2)

    assert drop_reason(ROSTER_KEY, encode(forged)) == "wrongly signed"
    assert drop_reason(ROSTER_KEY, encode(roster_message("{}", 2))) == "wrongly signed"
    assert drop_reason(ROSTER_KEY, encode(roster_message("\N{SNOWMAN}", 2))) == "wrongly signed"


def test_a_roster_under_a_newer_stamp_than_its_version_is_dropped() -> None:
    """Or an old one could be made to hide all that follow."""
    assert drop_reason(ROSTER_KEY, encode(roster_message(KEYS.signed(), 9))) == "wrongly signed"


def test_a_roster_of_another_mission_is_dropped() -> None:
    other = KEYS.signed(replace(KEYS.without("u0"), mission="other"))

    assert drop_reason(ROSTER_KEY, encode(roster_message(other, 2))) == "another mission"


def test_only_a_newer_roster_comes_into_force() -> None:
    seal = KEYS.seal("u1", KEYS.without("u0"))

    assert not seal.put_in_force(KEYS.signed())
    assert not seal.put_in_force(KEYS.signed(KEYS.without("u0")))
    assert seal.put_in_force(KEYS.signed(replace(KEYS.without("u0", OPERATOR), version=3)))
    assert not seal.may_speak_for(OPERATOR, OPERATOR)
    with pytest.raises(UnacceptableError):
        seal.put_in_force(OTHERS.signed(replace(OTHERS.without("u0"), version=9)))


def test_who_is_revoked_is_believed_no_longer_not_even_what_was_known() -> None:
    seal = KEYS.seal("u1")
    codec, data = Codec(MISSION, seal), envelope(CLAIM, "u0")
    heard = codec.decode(CLAIM.key, data)
    assert heard is not None

    seal.put_in_force(KEYS.signed(KEYS.without("u0")))

    assert codec.decode(CLAIM.key, data) is None
    assert codec.pack(heard) is None
    assert not seal.knows("u0")


def test_what_the_others_have_said_needs_no_new_check_after_a_new_roster(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Or a fleet would check all it knows at once, in the air."""
    seal, data = KEYS.seal("u1"), envelope(CLAIM, "u0")
    codec = Codec(MISSION, seal)
    assert codec.decode(CLAIM.key, data) is not None

    seal.put_in_force(KEYS.signed(KEYS.without("dashboard")))
    monkeypatch.setattr("swarm.protocol.seal._verify", lambda *_: False)

    assert codec.decode(CLAIM.key, data) is not None
    assert codec.decode(CLAIM.key, envelope(CLAIM, "u0")[:-1] + b"!") is None


def test_what_is_remembered_of_who_has_other_keys_by_now_gives_way_to_any_word() -> None:
    keys = Keyring("u0", "u1")
    messages = []
    for writer, signer in (("u0", "u0"), ("u1", "u1")):
        said = message(writer, held("t0", 1.0), 7, 7)
        messages.append(as_heard(said, encode(said), envelope(said, signer, keys)))
    memory = encode_memory(Snapshot(MISSION, "u0", 1, 7.0, tuple(messages)))

    recalled = Codec(MISSION, keys.seal("u1", keys.renewed("u0"))).decode_memory(STATE, memory)

    assert recalled is not None
    assert [m.body for m in recalled.messages] == [m.body for m in messages]
    assert [m.stamp.incarnation for m in recalled.messages] == [0, 7]


def test_what_was_believed_by_an_older_roster_is_nobodys_once_its_signer_has_other_keys() -> None:
    keys = Keyring("u0", "u1")
    seal = keys.seal("u1")
    codec = Codec(MISSION, seal)
    words = [message(writer, held("t0", 1.0), 7, 7) for writer in ("u0", "u1")]
    heard = [codec.decode(m.key, envelope(m, m.writer, keys)) for m in words]
    snapshot = Snapshot(MISSION, "u1", 1, 7.0, tuple(m for m in heard if m))
    assert codec.by_present_keys(snapshot) == snapshot

    seal.put_in_force(keys.signed(keys.renewed("u0")))

    told = codec.by_present_keys(snapshot).messages
    assert [(m.body, m.stamp.incarnation) for m in told] == [(words[0].body, 0), (words[1].body, 7)]


def test_what_is_remembered_of_a_flight_without_keys_is_nobodys_but_the_own_word() -> None:
    said = tuple(message(writer, held("t0", 1.0), 7, 7) for writer in ("u0", "u1"))
    memory = encode_memory(Snapshot(MISSION, "u0", 1, 7.0, said))

    recalled = Codec(MISSION, KEYS.seal("u0")).decode_memory(STATE, memory)

    assert recalled is not None
    assert {m.writer: m.stamp.incarnation for m in recalled.messages} == {"u0": 7, "u1": 0}


def test_a_roster_of_an_earlier_life_does_not_come_before_that_of_the_keys() -> None:
    """Its authority may have been another one, with more versions than the present one has."""
    old = Message(MISSION, AUTHORITY, Stamp(57, 0), SignedRoster(OTHERS.signed()))
    memory = encode_memory(Snapshot(MISSION, "u0", 1, 7.0, (CLAIM, old)))

    recalled = Codec(MISSION).decode_memory(STATE, memory)
    assert recalled is not None
    assert recalled.messages == (CLAIM,)


@pytest.mark.parametrize("depth", [500, 600, 1000])
def test_a_register_that_is_nested_as_deep_as_can_be_read_stops_nobody(depth: int) -> None:
    """Not every release of MessagePack writes again what it has read."""
    parts = msgpack.unpackb(encode(CLAIM), use_list=False)
    deep = msgpack.unpackb(b"\x91" * depth + b"\xc0", use_list=False)

    for codec in (Codec(MISSION), Codec(MISSION, KEYS.seal("u1"))):
        heard = codec.decode_register((*parts, deep))
        assert heard in (None, CLAIM)
