"""The roster: who belongs to a mission and in which role, signed by its authority.

A roster is public. It names everyone whose certificate is in force, with role, generation
and public key; who was revoked is not in it. It travels as bytes, on the bus and on disk::

    {"signature":"<128 hex digits>","roster":{"format":"peckorder roster 1",…}}

The signature is that of the authority over a context of its own and the exact bytes of the
inner object; it is checked before anything inside is read.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Final

from swarm.model.ids import RESERVED, require_id

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey


class Role(StrEnum):
    """What one may do; everyone may read everything of the mission."""

    UAV = "uav"
    """Speaks for the UAV of its name."""
    COORDINATOR = "coordinator"
    """Writes brief, plan and board."""
    ROUTER = "router"
    """Carries everything between others and says nothing itself."""
    VIEWER = "viewer"
    """Reads only: dashboard, recorder, status."""
    OPERATOR = "operator"
    """Commands the fleet."""


_FIRST_NAMES = {
    Role.COORDINATOR: "coordinator",
    Role.ROUTER: "router",
    Role.VIEWER: "dashboard",
    Role.OPERATOR: "operator",
}


def numbered(first: str, count: int) -> Iterator[str]:
    """``first``, ``first-2``, ``first-3`` … ; ``count`` of them."""
    for number in range(1, count + 1):
        yield first if number == 1 else f"{first}-{number}"


def fleet_names(uavs: Sequence[str], counts: Mapping[Role, int]) -> dict[str, Role]:
    """Role by name of a whole fleet, of which there are so many of each role but UAVs.

    Raises:
        ValueError: two of them would have one name.
    """
    names = dict.fromkeys(uavs, Role.UAV)
    if len(names) != len(uavs):
        raise ValueError("UAV ids must differ")
    for role, count in counts.items():
        for name in numbered(_FIRST_NAMES[role], count):
            if name in names:
                raise ValueError(f"UAV id {name!r} is the name of the {role}'s keys")
            names[name] = role
    return names


KEY_BYTES: Final = 32
SERIES_BYTES: Final = 16
LONGEST_COMMON_NAME: Final = 64
"""Characters that X.509 allows (RFC 5280, ub-common-name)."""
LONGEST_ROSTER_BYTES: Final = 1 << 20
_FORMAT: Final = "peckorder roster 1"
_CONTEXT: Final = b"peckorder roster 1\n"
_SIGNATURE_BYTES: Final = 64
_BEFORE: Final = b'{"signature":"'
_BETWEEN: Final = b'","roster":'
_AFTER: Final = b"}\n"
_ROSTER_AT: Final = len(_BEFORE) + 2 * _SIGNATURE_BYTES + len(_BETWEEN)
_NEWEST_S: Final = 1 << 40


@dataclass(frozen=True, slots=True)
class RosterEntry:
    """One identity in force.

    Raises:
        ValueError: a part is out of range.
    """

    name: str
    role: Role
    generation: int
    """1 for the first certificate of that name; grows with each that follows."""
    public_key: bytes = field(repr=False)
    """Ed25519, 32 bytes."""
    not_after_s: int
    """When its certificate expires [unix s]."""

    def __post_init__(self) -> None:
        require_id(self.name, "name")
        if self.name in RESERVED and self.name != self.role:
            raise ValueError(f"{self.name!r} names {RESERVED[self.name]}, not a {self.role}")
        if self.generation < 1:
            raise ValueError(f"generation of {self.name!r} must be at least 1")
        if len(self.common_name) > LONGEST_COMMON_NAME:
            raise ValueError(
                f"{self.common_name!r} has more than the {LONGEST_COMMON_NAME} characters "
                "that a certificate's name may have"
            )
        if len(self.public_key) != KEY_BYTES:
            raise ValueError(f"the public key of {self.name!r} has not {KEY_BYTES} bytes")
        if not 0 <= self.not_after_s < _NEWEST_S:
            raise ValueError(f"{self.name!r} expires at no possible time")

    @property
    def common_name(self) -> str:
        """Name in its certificate: ``uav1@1``."""
        return f"{self.name}@{self.generation}"


@dataclass(frozen=True, slots=True)
class Roster:
    """Everyone of one mission whose certificate is in force.

    Raises:
        ValueError: a part is out of range, or a name is there twice.
    """

    mission: str
    series: bytes
    """What is signed under one series is worth nothing under another."""
    version: int
    """Grows with every change, also from one series to the next."""
    entries: tuple[RosterEntry, ...]
    """In the order of their names."""
    _by_name: dict[str, RosterEntry] = field(init=False, compare=False, repr=False)

    def __post_init__(self) -> None:
        require_id(self.mission, "mission name")
        if len(self.series) != SERIES_BYTES:
            raise ValueError(f"a series has {SERIES_BYTES} bytes, not {len(self.series)}")
        if self.version < 1:
            raise ValueError("the version of a roster must be at least 1")
        names = [entry.name for entry in self.entries]
        if any(one >= next_ for one, next_ in pairwise(names)):
            raise ValueError("the names of a roster must differ and be in order")
        object.__setattr__(self, "_by_name", {entry.name: entry for entry in self.entries})

    def entry(self, name: str) -> RosterEntry | None:
        """That of ``name``; None if it is not in force."""
        return self._by_name.get(name)

    def supersedes(self, other: Roster) -> bool:
        """Whether it takes the place of ``other``, which the same authority has signed."""
        return self.mission == other.mission and self.version > other.version

    def replaced_since(self, before: Roster) -> frozenset[str]:
        """Names that had another key in the roster ``before``, and this or none by now."""
        keys = {entry.name: entry.public_key for entry in self.entries}
        return frozenset(e.name for e in before.entries if keys.get(e.name) != e.public_key)


def encode_roster(roster: Roster, authority: Ed25519PrivateKey) -> bytes:
    """``roster`` signed by ``authority``.

    Raises:
        ValueError: it would be larger than what the bus carries.
    """
    document = {
        "format": _FORMAT,
        "mission": roster.mission,
        "series": roster.series.hex(),
        "version": roster.version,
        "entries": [
            [each.name, str(each.role), each.generation, each.public_key.hex(), each.not_after_s]
            for each in roster.entries
        ],
    }
    inner = json.dumps(document, separators=(",", ":")).encode("ascii")
    signature = authority.sign(_CONTEXT + inner).hex().encode("ascii")
    data = _BEFORE + signature + _BETWEEN + inner + _AFTER
    if len(data) > LONGEST_ROSTER_BYTES:
        raise ValueError(f"a roster of {len(roster.entries)} names is too large for the bus")
    return data


def decode_roster(data: bytes, authority_public_key: bytes) -> Roster:
    """The roster in ``data``, as `encode_roster` made it.

    Raises:
        ValueError: it is no roster, or not signed by the authority of that Ed25519 key.
    """
    inner = _verified(data, authority_public_key)
    try:
        document: Any = json.loads(inner)
    except (ValueError, RecursionError):
        raise ValueError("it is no roster") from None
    match document:
        case {
            "format": str(form),
            "mission": str(mission),
            "series": str(series),
            "version": int(version),
            "entries": list(entries),
        } if form == _FORMAT:
            return Roster(
                mission, bytes.fromhex(series), version, tuple(_entry(each) for each in entries)
            )
        case _:
            raise ValueError("it is no roster of this version")


def _verified(data: bytes, authority_public_key: bytes) -> bytes:
    """The inner object of ``data``, which the authority has signed."""
    from cryptography.exceptions import InvalidSignature
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey

    signature = data[len(_BEFORE) : _ROSTER_AT - len(_BETWEEN)]
    framed = (
        len(data) <= LONGEST_ROSTER_BYTES
        and data[: len(_BEFORE)] == _BEFORE
        and data[_ROSTER_AT - len(_BETWEEN) : _ROSTER_AT] == _BETWEEN
        and data[-len(_AFTER) :] == _AFTER
        and len(data) > _ROSTER_AT + len(_AFTER)
        and all(digit in b"0123456789abcdef" for digit in signature)
    )
    if not framed:
        raise ValueError("it is no roster")
    inner = data[_ROSTER_AT : -len(_AFTER)]
    try:
        public_key = Ed25519PublicKey.from_public_bytes(authority_public_key)
        public_key.verify(bytes.fromhex(signature.decode("ascii")), _CONTEXT + inner)
    except InvalidSignature:
        raise ValueError("it is not signed by this mission's authority") from None
    return inner


def _entry(parts: Any) -> RosterEntry:
    match parts:
        case [str(name), str(role), int(generation), str(public_key), int(not_after_s)]:
            return RosterEntry(name, Role(role), generation, bytes.fromhex(public_key), not_after_s)
        case _:
            raise ValueError("it has an entry that is none")
