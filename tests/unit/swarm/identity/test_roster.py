"""A roster survives its way over bus and disk whole, or not at all."""

from __future__ import annotations

import json
from itertools import pairwise

import pytest
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from hypothesis import given
from hypothesis import strategies as st

from swarm.identity import Role, Roster, RosterEntry, decode_roster, encode_roster
from swarm.identity.roster import LONGEST_ROSTER_BYTES

AUTHORITY = Ed25519PrivateKey.from_private_bytes(bytes(range(32)))
PUBLIC_KEY = AUTHORITY.public_key().public_bytes_raw()
UAV1 = RosterEntry("uav1", Role.UAV, 1, bytes(31) + b"\x01", 1_800_000_000)
ROUTER = RosterEntry("router", Role.ROUTER, 3, bytes(31) + b"\x02", 1_800_000_000)
ROSTER = Roster("table-1", bytes(16), 4, (ROUTER, UAV1))
DATA = encode_roster(ROSTER, AUTHORITY)


@st.composite
def rosters(draw: st.DrawFn) -> Roster:
    names = draw(st.lists(st.from_regex(r"uav[A-Za-z0-9_.-]{0,8}", fullmatch=True), unique=True))
    entries = [
        RosterEntry(
            name,
            draw(st.sampled_from(Role)),
            draw(st.integers(1, 9999)),
            draw(st.binary(min_size=32, max_size=32)),
            draw(st.integers(0, 2**39)),
        )
        for name in sorted(names)
    ]
    series = draw(st.binary(min_size=16, max_size=16))
    return Roster("m", series, draw(st.integers(1, 2**60)), tuple(entries))


@given(rosters())
def test_what_is_decoded_is_what_was_encoded(roster: Roster) -> None:
    assert decode_roster(encode_roster(roster, AUTHORITY), PUBLIC_KEY) == roster


def test_equal_rosters_have_equal_bytes() -> None:
    again = Roster("table-1", bytes(16), 4, (ROUTER, UAV1))

    assert encode_roster(again, AUTHORITY) == DATA


def test_it_is_json_that_people_can_read() -> None:
    assert json.loads(DATA)["roster"]["entries"][0][:3] == ["router", "router", 3]


@pytest.mark.parametrize("flip", [0x01, 0x20, 0x80])
def test_no_byte_can_be_flipped(flip: int) -> None:
    for at in range(len(DATA)):
        tampered = bytearray(DATA)
        tampered[at] ^= flip
        with pytest.raises(ValueError, match="it is n"):
            decode_roster(bytes(tampered), PUBLIC_KEY)


@given(st.integers(0, len(DATA)), st.integers(0, len(DATA)), st.binary(max_size=8))
def test_nothing_can_be_cut_out_or_put_in(start: int, end: int, instead: bytes) -> None:
    tampered = DATA[:start] + instead + DATA[max(start, end) :]
    if tampered == DATA:
        return
    with pytest.raises(ValueError, match="it is n"):
        decode_roster(tampered, PUBLIC_KEY)


@given(st.binary(max_size=300))
def test_anything_else_is_refused(data: bytes) -> None:
    with pytest.raises(ValueError, match="it is no roster"):
        decode_roster(data, PUBLIC_KEY)


def test_another_authority_cannot_sign_it() -> None:
    data = encode_roster(ROSTER, Ed25519PrivateKey.generate())

    with pytest.raises(ValueError, match="not signed by this mission's authority"):
        decode_roster(data, PUBLIC_KEY)


def test_what_the_authority_signs_elsewhere_is_no_roster() -> None:
    inner = DATA[DATA.index(b'{"format"') : -2]
    signature = AUTHORITY.sign(inner).hex().encode()

    with pytest.raises(ValueError, match="not signed"):
        decode_roster(b'{"signature":"' + signature + b'","roster":' + inner + b"}\n", PUBLIC_KEY)


def test_a_roster_of_another_format_is_refused_though_it_is_signed() -> None:
    inner = b'{"format":"peckorder roster 2"}'
    signature = AUTHORITY.sign(b"peckorder roster 1\n" + inner).hex().encode()

    with pytest.raises(ValueError, match="no roster of this version"):
        decode_roster(b'{"signature":"' + signature + b'","roster":' + inner + b"}\n", PUBLIC_KEY)


def test_a_fleet_of_a_thousand_fits_into_a_message_with_room_to_spare() -> None:
    names = sorted(f"uav{number}" for number in range(1000))
    entries = tuple(RosterEntry(name, Role.UAV, 9, bytes(32), 1_800_000_000) for name in names)

    data = encode_roster(Roster("m", bytes(16), 1, entries), AUTHORITY)

    assert len(data) < LONGEST_ROSTER_BYTES / 8


def test_one_that_no_message_could_carry_is_not_made() -> None:
    names = sorted(f"uav{number:050}" for number in range(8000))
    entries = tuple(RosterEntry(name, Role.UAV, 9, bytes(32), 1_800_000_000) for name in names)

    with pytest.raises(ValueError, match="8000 names is too large"):
        encode_roster(Roster("m", bytes(16), 1, entries), AUTHORITY)


@pytest.mark.parametrize("entries", [(UAV1, ROUTER), (UAV1, UAV1)])
def test_names_are_in_order_and_there_once(entries: tuple[RosterEntry, ...]) -> None:
    with pytest.raises(ValueError, match="differ and be in order"):
        Roster("m", bytes(16), 1, entries)


def test_it_finds_who_is_in_force_by_name() -> None:
    assert ROSTER.entry("uav1") is UAV1
    assert ROSTER.entry("uav2") is None
    assert UAV1.common_name == "uav1@1"


def test_newer_ones_supersede_older_ones_of_the_same_mission() -> None:
    versions = [Roster("m", bytes(16), version, ()) for version in (1, 2, 5)]

    for older, newer in pairwise(versions):
        assert newer.supersedes(older)
        assert not older.supersedes(newer)
        assert not newer.supersedes(newer)
    assert not Roster("n", bytes(16), 9, ()).supersedes(versions[0])


def test_it_tells_whose_key_is_another_or_none_since_an_older_one() -> None:
    def entry(name: str, generation: int, key: int) -> RosterEntry:
        return RosterEntry(name, Role.UAV, generation, bytes([key]) * 32, 1 << 39)

    before = Roster("m", bytes(16), 1, (entry("a", 1, 1), entry("b", 1, 2), entry("c", 1, 3)))
    after = Roster("m", bytes(16), 2, (entry("a", 1, 1), entry("b", 2, 4), entry("d", 1, 5)))

    assert after.replaced_since(before) == {"b", "c"}
    assert after.replaced_since(after) == set()


@pytest.mark.parametrize(
    ("name", "role", "generation", "problem"),
    [
        ("a b", Role.UAV, 1, "is not 1 to 64 letters"),
        ("a@1", Role.UAV, 1, "is not 1 to 64 letters"),
        ("authority", Role.UAV, 1, "names the mission authority"),
        ("coordinator", Role.UAV, 1, "names the coordinator"),
        ("operator", Role.VIEWER, 1, "names the operator"),
        ("uav1", Role.UAV, 0, "must be at least 1"),
        ("u" * 63, Role.UAV, 1, "more than the 64 characters"),
    ],
)
def test_no_entry_takes_another_s_place(
    name: str, role: Role, generation: int, problem: str
) -> None:
    with pytest.raises(ValueError, match=problem):
        RosterEntry(name, role, generation, bytes(32), 0)


def test_its_text_shows_no_more_than_people_need() -> None:
    assert "public_key" not in repr(UAV1)
    assert "_by_name" not in repr(ROSTER)
