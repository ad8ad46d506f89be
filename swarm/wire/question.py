"""What a question says: what the asker knows already, and where the bus has keys who asks.

There a question bears a nonce, and its answers are bound to that and to who asks, so that no
answer to another question can be given to it; without keys it is the digest alone. Leaves out:
who asks and answers (swarm.shell), what is answered (swarm.wire.codec).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from swarm.wire.digest import decode_digest, encode_digest
from swarm.wire.seal import QUESTION, Seal, UnacceptableError

__all__ = ["NONCE_BYTES", "Question", "bond", "decode_question", "encode_question"]

NONCE_BYTES: Final = 16


@dataclass(frozen=True, slots=True)
class Question:
    """A question that was put."""

    known: Mapping[str, int]
    """Digest of what the asker knows."""
    asker: str | None
    """Who has signed it; None on a bus without keys."""
    nonce: bytes

    @property
    def bond(self) -> bytes:
        """What its answers are bound to."""
        return bond(self.asker, self.nonce)


def bond(asker: str | None, nonce: bytes) -> bytes:
    """What answers are bound to, by who asks and the nonce of the question."""
    return nonce + (asker or "").encode()


def encode_question(known: Mapping[str, int], nonce: bytes, seal: Seal | None) -> bytes:
    """The bytes of a question; its nonce counts only where there are keys."""
    digest = encode_digest(known)
    return digest if seal is None else seal.wrap(nonce + digest, QUESTION)


def decode_question(data: bytes, seal: Seal | None) -> Question:
    """The question in ``data``.

    Raises:
        UnacceptableError: it is none, or nobody of this mission has signed it.
    """
    asker, nonce = None, b""
    if seal is not None:
        envelope = seal.unwrap(data, QUESTION)
        asker, nonce, data = (
            envelope.signer,
            envelope.said[:NONCE_BYTES],
            envelope.said[NONCE_BYTES:],
        )
    known = decode_digest(data)
    if known is None or (seal is not None and len(nonce) < NONCE_BYTES):
        raise UnacceptableError("malformed")
    return Question(known, asker, nonce)
