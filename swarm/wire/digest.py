"""What somebody knows, as one number per writer, so that answers need not repeat it.

After a loss everyone asks everyone; without this each of N answers would hold all
registers of the lost, N² times in all. Leaves out: keeping the numbers up to date
(swarm.state.registers), who asks and answers (swarm.shell).
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from functools import reduce
from itertools import islice
from operator import xor
from typing import Any, Final

import msgpack

from swarm.wire.codec import encode
from swarm.wire.messages import MAX_COUNT, Message

__all__ = ["combined", "decode_digest", "encode_digest", "fingerprint", "unknown"]


MOST_WRITERS: Final = 10_000
"""More than any fleet has, and what they take still travels as one question."""


def fingerprint(message: Message) -> int:
    """64 bits of a statement; those of a writer's registers are combined by exclusive or."""
    return int.from_bytes(hashlib.blake2b(encode(message), digest_size=8).digest(), "big")


def combined(numbers: Iterable[int]) -> int:
    """Digests of several writers, or of any statements, as one; in any order."""
    return reduce(xor, numbers, 0) % MAX_COUNT


def unknown(
    messages: Iterable[Message], mine: Mapping[str, int], theirs: Mapping[str, int]
) -> tuple[Message, ...]:
    """Those of ``messages`` that may be news to somebody.

    Args:
        messages: all registers of some writers.
        mine: digest of the replica they are from.
        theirs: digest of what the other one knows.
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
