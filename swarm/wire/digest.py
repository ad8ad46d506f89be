"""What somebody knows, in eight bytes per writer, so that answers need not repeat it.

After a loss everyone asks everyone; without this each of N answers would hold all
registers of the lost, N² times in all. Leaves out: who asks and answers (swarm.shell).
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from typing import Any, Final

import msgpack

from swarm.wire.codec import encode, key_of
from swarm.wire.messages import Message

__all__ = ["decode_digest", "digest", "encode_digest", "unknown"]

SIZE_BYTES: Final = 8


def digest(messages: Iterable[Message]) -> dict[str, bytes]:
    """Writer -> fingerprint of all its registers; equal registers have equal ones."""
    by_writer: dict[str, list[tuple[str, bytes]]] = {}
    for message in messages:
        by_writer.setdefault(message.writer, []).append((key_of(message), encode(message)))
    return {writer: _fingerprint(registers) for writer, registers in by_writer.items()}


def unknown(messages: Iterable[Message], known: Mapping[str, bytes]) -> tuple[Message, ...]:
    """Those of ``messages`` whose writers ``known`` does not show to be known just so."""
    told = tuple(messages)
    news = {writer for writer, print_ in digest(told).items() if known.get(writer) != print_}
    return tuple(message for message in told if message.writer in news)


def encode_digest(known: Mapping[str, bytes]) -> bytes:
    """The bytes of a digest."""
    packed: bytes = msgpack.packb(dict(known))
    return packed


def decode_digest(data: bytes) -> dict[str, bytes] | None:
    """The digest in ``data``; None when it is none. No bytes at all say that nothing is known."""
    if not data:
        return {}
    try:
        found: Any = msgpack.unpackb(data, max_ext_len=0)
    except (ValueError, TypeError, msgpack.exceptions.UnpackException, RecursionError):
        return None
    valid = isinstance(found, dict) and all(
        isinstance(writer, str) and isinstance(print_, bytes) for writer, print_ in found.items()
    )
    return found if valid else None


def _fingerprint(registers: list[tuple[str, bytes]]) -> bytes:
    whole = hashlib.blake2b(digest_size=SIZE_BYTES)
    for _, data in sorted(registers):
        whole.update(data)
    return whole.digest()
