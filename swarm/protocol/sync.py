"""Synchronise state: when to ask everyone, what a question says, what an answer may omit.

A question carries a digest, one number per writer, so that answers need not repeat what the
asker knows: else, after a loss, each of N answers would hold all registers. Where the bus has
keys a question bears a nonce too, and its answers are bound to it and to who asks.
"""

from __future__ import annotations

import hashlib
import math
from bisect import bisect
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from functools import reduce
from itertools import chain, islice
from operator import xor
from typing import Any, Final

import msgpack

from swarm.model.ids import COORDINATOR
from swarm.protocol.encoding import encode
from swarm.protocol.fields import MAX_COUNT
from swarm.protocol.messages import Message
from swarm.protocol.seal import QUESTION, Seal, UnacceptableError

EVERYONE_UP_TO: Final = 16
"""Of a larger fleet only some are asked, where all that they know is enough."""
SOME: Final = 6
"""So many in turn, and as many that are wanted in particular."""


def some_of(
    own: str, present: Collection[str], wanted: Collection[str] = (), turn: int = 0
) -> tuple[str, ...]:
    """Whom ``own`` asks for all they know; nobody where everyone is to be asked.

    The coordinator, ``wanted`` ones, others by turns, and whoever else has the own name.
    """
    others = sorted(set(present) - {own, COORDINATOR})
    if len(others) < EVERYONE_UP_TO:
        return ()
    begin = bisect(others, own) + turn * SOME
    asked = [own, COORDINATOR, *[name for name in others if name in wanted][:SOME]]
    asked += [others[(begin + place) % len(others)] for place in range(SOME)]
    return tuple(dict.fromkeys(asked))


MOST_OPEN: Final = 2
"""Questions to everyone that may be open: one that may be outdated by now, and another."""


class QuestionTimer:
    """Gathers wishes to ask into questions at least ``gap_s`` apart [s].

    Args:
        gap_s: that interval [s].
        most_open: so many may wait for their answers, each of which `answered` tells; None: any
            number. Where answers are read more slowly than questions come they would only grow.
    """

    def __init__(self, gap_s: float, most_open: int | None = None) -> None:
        self.stretch = 1.0
        """By what that interval grows, where everyone answers and there are many."""
        self._gap_s = gap_s
        self._most_open = math.inf if most_open is None else most_open
        self.open = 0
        """Questions without an answer, where that counts."""
        self._free_at_s = -math.inf
        self._ask_at_s: float | None = None

    def want(self, now_s: float) -> None:
        """There is a reason to ask then, or before; several before the next question are one."""
        at_s = max(now_s, self._free_at_s)
        self._ask_at_s = at_s if self._ask_at_s is None else min(self._ask_at_s, at_s)

    def due(self, now_s: float) -> bool:
        """Whether to ask now; True once for each question."""
        if self._ask_at_s is None or now_s < self._ask_at_s or self.is_full:
            return False
        self._ask_at_s = None
        self.open += 1
        self._free_at_s = now_s + self.stretch * self._gap_s
        return True

    def next_deadline_s(self) -> float | None:
        """When `due` will next be true; None while there is nothing to ask, or no room."""
        return None if self.is_full else self._ask_at_s

    @property
    def is_full(self) -> bool:
        """Whether as many questions as may wait for their answers."""
        return self.open >= self._most_open

    def answered(self) -> None:
        """One has been answered by everyone who could."""
        self.open = max(0, self.open - 1)


MOST_WRITERS: Final = 10_000
"""More than any fleet has, and what they take still travels as one question."""


def fingerprint(message: Message) -> int:
    """64 bits of a statement; those of a writer's registers are combined by exclusive or.

    They are kept with it: in a simulation each of a thousand replicas wants to know them.
    """
    known = message.fingerprint
    if known is None:
        known = int.from_bytes(hashlib.blake2b(encode(message), digest_size=8).digest(), "big")
        object.__setattr__(message, "fingerprint", known)
    return known


def combined(numbers: Iterable[int]) -> int:
    """Digests of several writers, or of any statements, as one; in any order."""
    return reduce(xor, numbers, 0) % MAX_COUNT


def digest_of(told: Iterable[Iterable[Message]]) -> dict[str, int]:
    """The digest of who knows these statements alone, of each register the newest."""
    newest: dict[str, Message] = {}
    for message in chain.from_iterable(told):
        known = newest.setdefault(message.key, message)
        if message.stamp > known.stamp:
            newest[message.key] = message
    digest: dict[str, int] = {}
    for message in newest.values():
        digest[message.writer] = digest.get(message.writer, 0) ^ fingerprint(message)
    return digest


def unknown(
    messages: Iterable[Message], mine: Mapping[str, int], theirs: Mapping[str, int]
) -> tuple[Message, ...]:
    """Those of ``messages``, all registers of some writers, that may be news to somebody.

    ``mine`` is the digest of the replica they are from, ``theirs`` of what the other one knows.
    """
    known = {writer for writer, number in theirs.items() if mine.get(writer) == number}
    return tuple(message for message in messages if message.writer not in known)


def encode_digest(known: Mapping[str, int]) -> bytes:
    """The bytes of a digest; of very many writers some, since any may be left out."""
    packed: bytes = msgpack.packb(dict(islice(known.items(), MOST_WRITERS)))
    return packed


def decode_digest(data: bytes) -> dict[str, int] | None:
    """The digest in ``data``; None when it is none. No bytes at all say that nothing is known."""
    if not data:
        return {}
    try:
        found: Any = msgpack.unpackb(data, max_ext_len=0)
    except (ValueError, TypeError, msgpack.exceptions.UnpackException, RecursionError):
        return None
    valid = isinstance(found, dict) and all(
        isinstance(writer, str) and type(number) is int for writer, number in found.items()
    )
    return found if valid else None


NONCE_BYTES: Final = 16
_ALL_THAT_IS_KNOWN: Final = ""
"""In a digest the name of nobody: whoever is asked so tells all it knows, not only what it answers
for. Releases that do not know that answer as ever."""


@dataclass(frozen=True, slots=True)
class Question:
    """A question that was put."""

    known: Mapping[str, int]
    """Digest of what the asker knows."""
    asker: str | None
    """Who has signed it; None on a bus without keys."""
    nonce: bytes
    whole: bool = False
    """Whether whatever is known is wanted, not only what who is asked answers for."""

    @property
    def bond(self) -> bytes:
        """What its answers are bound to."""
        return bond(self.asker, self.nonce)


def bond(asker: str | None, nonce: bytes) -> bytes:
    """What answers are bound to, by who asks and the nonce of the question."""
    return nonce + (asker or "").encode()


def encode_question(
    known: Mapping[str, int], nonce: bytes, seal: Seal | None, *, whole: bool = False
) -> bytes:
    """The bytes of a question; its nonce counts only where there are keys."""
    digest = encode_digest({_ALL_THAT_IS_KNOWN: 1, **known} if whole else known)
    return digest if seal is None else seal.wrap(nonce + digest, QUESTION)


def decode_question(data: bytes, seal: Seal | None) -> Question:
    """The question in ``data``.

    Raises:
        UnacceptableError: it is none, or nobody of this mission has signed it.
    """
    asker, nonce = None, b""
    if seal is not None:
        envelope = seal.unwrap(data, QUESTION)
        asker, said = envelope.signer, envelope.said
        nonce, data = said[:NONCE_BYTES], said[NONCE_BYTES:]
    known = decode_digest(data)
    if known is None or (seal is not None and len(nonce) < NONCE_BYTES):
        raise UnacceptableError("malformed")
    whole = known.pop(_ALL_THAT_IS_KNOWN, 0) == 1
    return Question(known, asker, nonce, whole)
