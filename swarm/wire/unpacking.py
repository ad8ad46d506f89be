"""MessagePack from the network: no more of it than its length is worth, and written again.

Leaves out: what it means (swarm.wire.codec).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import msgpack

from swarm.wire.encoding import SMALL_LIMIT_BYTES
from swarm.wire.seal import UnacceptableError

__all__ = ["repacked", "unpacked"]

BYTES_EACH: Final = 8
"""Of an array or map in a large message, with its share of the rest, at least."""


def unpacked(data: bytes, most: int | None = None) -> object:
    """What ``data`` holds, with tuples for arrays; None when it is not MessagePack.

    Args:
        data: from the network.
        most: of arrays and maps in it; by default as many as its length is worth.
    """
    hooks = {}
    if len(data) > SMALL_LIMIT_BYTES:
        budget = _Budget(1000 + len(data) // BYTES_EACH if most is None else most)
        hooks = {"list_hook": budget.array, "object_pairs_hook": budget.map}
    try:
        return msgpack.unpackb(data, use_list=False, max_ext_len=0, **hooks)
    except (ValueError, TypeError, msgpack.exceptions.UnpackException, RecursionError):
        # ValueError covers msgpack's FormatError, StackError, ExtraData and bad UTF-8.
        return None


def repacked(register: object) -> bytes:
    """The bytes of what `unpacked` gave.

    Raises:
        UnacceptableError: it is nested deeper than this MessagePack can write again.
    """
    try:
        packed: bytes = msgpack.packb(register)
    except (ValueError, RecursionError):
        raise UnacceptableError("malformed") from None
    return packed


class _Budget:
    """Counts the arrays and maps of one piece of MessagePack, until there are too many.

    An empty map is one byte and takes 64 in memory, so that few bytes could fill all of it.
    """

    def __init__(self, most: int) -> None:
        self._left = most

    def array(self, items: tuple[object, ...]) -> tuple[object, ...]:
        """One more array."""
        self._spend()
        return items

    def map(self, pairs: Sequence[tuple[object, object]]) -> dict[object, object]:
        """One more map."""
        self._spend()
        return dict(pairs)

    def _spend(self) -> None:
        self._left -= 1
        if self._left < 0:
            raise ValueError("more arrays and maps than a message of that size has")
