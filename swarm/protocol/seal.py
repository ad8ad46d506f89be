"""Who says so: statements in envelopes that bear their writer's signature.

On a bus with keys everything that is said travels as MessagePack
``["sealed 1", signer, signature, statement]``, where the statement is the very bytes of a bus
without keys. The signature (Ed25519) is over a context of its own, the series of the roster
in force, what the statement is bound to, and those bytes; it is checked before any of them is
parsed. So neither a broken router nor an answer that repeats others' registers can speak for
somebody else, and an answer counts for the one question it was given to.

What is signed once is signed for good (the same bytes give the same signature), and what was
found genuine once is known by its hash, since registers are repeated all the time. Against what is
replayed whole stamps help (swarm.protocol.registers).
"""

from __future__ import annotations

import hashlib
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Final

import msgpack

from swarm.identity.folder import ROSTER_FILE, Identity
from swarm.identity.roster import Role, Roster, decode_roster
from swarm.model.ids import COORDINATOR, OPERATOR, valid_id

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey

SEALED_MARK: Final = "sealed 1"
ENVELOPE_BYTES: Final = 160
"""By how much an envelope is longer than what is in it, at most."""
ANSWER: Final = b"answer "
"""What answers are bound to, before the `bond` of the question; see swarm.protocol.sync."""
QUESTION: Final = b"question"
"""What questions are bound to."""
SIGNATURE_BYTES: Final = 64
NOT_SIGNED: Final = "not signed"
WRONGLY_SIGNED: Final = "wrongly signed"
SIGNER_UNKNOWN: Final = "signer unknown"
NOT_THE_SIGNERS: Final = "not the signer's to say"
_CONTEXT: Final = b"peckorder sealed 1\n"
_HEAD: Final = b"\x94" + msgpack.packb(SEALED_MARK)
_SIGNATURE_HEAD: Final = bytes([0xC4, SIGNATURE_BYTES])
_LONGEST_NAME: Final = 64
_KEPT_ROSTERS: Final = 4
_KEPT_VERDICTS: Final = 16384
_HASH_BYTES: Final = 16


class UnacceptableError(Exception):
    """What was heard is no message of ours, or not to be believed."""

    def __init__(self, reason: str) -> None:
        super().__init__(reason)
        self.reason = reason
        """Under which it is counted."""


@dataclass(frozen=True, slots=True)
class Envelope:
    """What an envelope says of itself, believed or not."""

    signer: str
    signature: bytes
    said: bytes


def is_envelope(data: bytes) -> bool:
    """Whether ``data`` begins as envelopes do, and nothing else that is said."""
    return data.startswith(_HEAD)


def open_envelope(data: bytes) -> Envelope | None:
    """The parts of an envelope, which are not checked; None when ``data`` is none.

    There is one way to write an envelope, and only that is read: no MessagePack is parsed
    before it is known who wrote it.
    """
    if not data.startswith(_HEAD):
        return None
    place = len(_HEAD)
    head = data[place : place + 1]
    if head and 0xA0 <= head[0] <= 0xBF:
        place, length = place + 1, head[0] - 0xA0
    elif head == b"\xd9":
        place, length = place + 2, data[place + 1] if len(data) > place + 1 else 0
        if length < 32:
            return None
    else:
        return None
    name, place = data[place : place + length], place + length
    if length > _LONGEST_NAME or data[place : place + 2] != _SIGNATURE_HEAD:
        return None
    place += 2
    signature, place = data[place : place + SIGNATURE_BYTES], place + SIGNATURE_BYTES
    for width, code in ((1, 0xC4), (2, 0xC5), (4, 0xC6)):
        if data[place : place + 1] == bytes([code]):
            told, said = data[place + 1 : place + 1 + width], data[place + 1 + width :]
            length = int.from_bytes(told, "big")
            shortest = length >= {1: 0, 2: 1 << 8, 4: 1 << 16}[width]
            if shortest and len(told) == width and len(said) == length:
                break
    else:
        return None
    signer = name.decode("ascii", "replace")
    return Envelope(signer, signature, said) if valid_id(signer) else None


class Seal:
    """What one process needs to be believed, and to believe others.

    Args:
        name: of this process in the roster.
        sign: makes its Ed25519 signature of some bytes.
        signed_roster: the newest roster it knows, as its authority has signed it.
        authority_public_key: Ed25519, 32 bytes.
        keep: puts a newer roster where the next life of this process finds it.

    Raises:
        ValueError: that authority has not signed the roster.
    """

    def __init__(
        self,
        name: str,
        sign: Callable[[bytes], bytes],
        signed_roster: str,
        authority_public_key: bytes,
        keep: Callable[[bytes], object] = bytes,
    ) -> None:
        self.name = name
        """Of this process among the signers."""
        self._sign = sign
        self._authority_public_key = authority_public_key
        self._keep_roster = keep
        self._rosters: OrderedDict[str, Roster] = OrderedDict()
        """Those read lately; everyone repeats the same."""
        self._signed_roster = signed_roster
        self._roster = decode_roster(signed_roster.encode(), authority_public_key)
        self._own = self._roster.entry(name)
        self._genuine: OrderedDict[bytes, bytes] = OrderedDict()
        """Of envelopes found genuine: their hash, and the public key that they bear out."""

    @property
    def roster(self) -> Roster:
        """In force."""
        return self._roster

    @property
    def signed_roster(self) -> str:
        """The same, in the words of the authority."""
        return self._signed_roster

    def read_roster(self, signed: str) -> Roster:
        """The roster that the authority of this mission has signed.

        Raises:
            UnacceptableError: it has not.
        """
        known = self._rosters.get(signed)
        if known is None:
            try:
                known = decode_roster(signed.encode("ascii"), self._authority_public_key)
            except ValueError:  # of which UnicodeError is one
                raise UnacceptableError(WRONGLY_SIGNED) from None
            if known.mission != self._roster.mission:
                raise UnacceptableError("another mission")
            self._rosters[signed] = known
            if len(self._rosters) > _KEPT_ROSTERS:
                self._rosters.popitem(last=False)
        return known

    def put_in_force(self, signed: str) -> bool:
        """From now on that roster says whose word counts, if it is newer than the one that does.

        Raises:
            UnacceptableError: the authority has not signed it.
            OSError: it counts, but could not be kept for the next life.
        """
        roster = self.read_roster(signed)
        if not roster.supersedes(self._roster):
            return False
        if roster.series != self._roster.series:  # nothing said so far counts any more
            self._genuine.clear()
        self._roster, self._signed_roster = roster, signed
        self._keep_roster(signed.encode())
        return True

    @property
    def is_in_force(self) -> bool:
        """Whether the roster still knows this process by the key that it signs with."""
        own, before = self._roster.entry(self.name), self._own
        return own is not None and before is not None and own.public_key == before.public_key

    @property
    def may_publish_roster(self) -> bool:
        """Whether routers let this process say who belongs to the mission."""
        member = self._roster.entry(self.name)
        return member is not None and member.role in (Role.COORDINATOR, Role.OPERATOR)

    # -- being believed ---------------------------------------------------------------

    def wrap(self, said: bytes, bound: bytes = b"") -> bytes:
        """``said``, a statement's bytes, in an envelope of this process.

        ``bound`` is what it is bound to, at most 255 bytes; empty for what holds by itself.
        """
        signature = self._sign(_signed_bytes(self._roster.series, bound, said))
        envelope: bytes = msgpack.packb([SEALED_MARK, self.name, signature, said])
        if not bound and self._own is not None:
            self._keep(_hash(envelope), self._own.public_key)
        return envelope

    # -- believing ----------------------------------------------------------------------

    def unwrap(self, data: bytes, bound: bytes = b"") -> Envelope:
        """What is in the envelope ``data``, which its signer has signed and which is ``bound`` so.

        Raises:
            UnacceptableError: it is no envelope, or not to be believed.
        """
        envelope = open_envelope(data)
        if envelope is None:
            raise UnacceptableError("malformed" if is_envelope(data) else NOT_SIGNED)
        member = self._roster.entry(envelope.signer)
        if member is None:
            raise UnacceptableError(SIGNER_UNKNOWN)
        known = b"" if bound else _hash(data)
        if self._genuine.get(known) == member.public_key:
            self._genuine.move_to_end(known)
            return envelope
        signed = _signed_bytes(self._roster.series, bound, envelope.said)
        if not _verify(member.public_key, envelope.signature, signed):
            raise UnacceptableError(WRONGLY_SIGNED)
        if known:
            self._keep(known, member.public_key)
        return envelope

    def is_genuine(self, data: bytes) -> bool:
        """Whether the envelope ``data`` still counts, so that it is worth repeating."""
        try:
            self.unwrap(data)
        except UnacceptableError:
            return False
        return True

    def may_speak_for(self, signer: str, writer: str) -> bool:
        """Whether statements of ``writer`` are ``signer``'s to make."""
        member = self._roster.entry(signer)
        if member is None:
            return False
        match member.role:
            case Role.UAV:
                return signer == writer
            case Role.COORDINATOR:
                return writer == COORDINATOR
            case Role.OPERATOR:
                return writer == OPERATOR
            case Role.ROUTER | Role.VIEWER:
                return False

    def knows(self, writer: str) -> bool:
        """Whether anyone in the roster may be that writer; of what cannot be signed."""
        return writer in (COORDINATOR, OPERATOR) or self.may_speak_for(writer, writer)

    def _keep(self, known: bytes, public_key: bytes) -> None:
        self._genuine[known] = public_key
        if len(self._genuine) > _KEPT_VERDICTS:
            self._genuine.popitem(last=False)


def _hash(envelope: bytes) -> bytes:
    return hashlib.blake2b(envelope, digest_size=_HASH_BYTES).digest()


def _signed_bytes(series: bytes, bound: bytes, said: bytes) -> bytes:
    return b"".join((_CONTEXT, series, bytes([len(bound)]), bound, said))


def _verify(public_key: bytes, signature: bytes, data: bytes) -> bool:
    from cryptography.exceptions import InvalidSignature

    try:
        _key(public_key).verify(signature, data)
    except (InvalidSignature, ValueError):
        return False
    return True


@lru_cache(maxsize=2048)
def _key(public_key: bytes) -> Ed25519PublicKey:
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey

    return Ed25519PublicKey.from_public_bytes(public_key)


def seal_of(identity: Identity | None) -> Seal | None:
    """The seal of that identity; None for a process without keys.

    Raises:
        OSError: its roster cannot be read any more.
        ValueError: that has been changed since the identity was loaded.
    """
    if identity is None:
        return None
    return Seal(
        identity.name,
        identity.private_key.sign,
        (identity.folder / ROSTER_FILE).read_bytes().decode(),
        identity.authority_public_key,
        identity.keep_roster,
    )
