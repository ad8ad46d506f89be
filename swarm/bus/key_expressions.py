"""Keys and key expressions: a subset of Zenoh's, the same on every bus.

A key is chunks joined by ``/``. In an expression the chunk ``*`` stands for any one
chunk and ``**`` for any number of them, none included. Neither stands for a chunk
that starts with ``@``. Zenoh's ``$*``, wildcards inside a chunk, is left out: no key of ours needs
it. Source: https://zenoh.io/docs/manual/abstractions/#key-expression
"""

from __future__ import annotations

from functools import lru_cache

ANY_CHUNK = "*"
ANY_CHUNKS = "**"
CACHE_SIZE = 1 << 16


def check_key(key: str) -> str:
    """Return ``key``.

    Raises:
        ValueError: it is not a key: empty, or with an empty chunk or one of ``*$#?``.
    """
    fault = _fault(key)
    if fault is None and "*" in key:
        fault = "a key names one thing, without *"
    if fault is not None:
        raise ValueError(f"not a key: {key!r}: {fault}")
    return key


def check_key_expr(key_expr: str) -> str:
    """Return ``key_expr``.

    Raises:
        ValueError: it is not a key expression in its one canonical form: ``**``
            follows neither itself nor precedes ``*``.
    """
    fault = _fault(key_expr)
    if fault is not None:
        raise ValueError(f"not a key expression: {key_expr!r}: {fault}")
    return key_expr


@lru_cache(maxsize=CACHE_SIZE)
def intersects(one: str, other: str) -> bool:
    """Whether some key matches both expressions; a key is an expression too."""
    return _intersect(tuple(one.split("/")), tuple(other.split("/")))


def _fault(key_expr: str) -> str | None:
    if not key_expr:
        return "it is empty"
    if not key_expr.isascii() and any("\ud800" <= sign <= "\udfff" for sign in key_expr):
        return "half a surrogate pair is no text"
    before = None
    for chunk in key_expr.split("/"):
        if not chunk:
            return "an empty chunk (a / at either end, or two together)"
        if any(sign in chunk for sign in "$#?"):
            return "$, # and ? are reserved"
        if "*" in chunk and chunk not in (ANY_CHUNK, ANY_CHUNKS):
            return "* and ** stand alone between slashes"
        if before == ANY_CHUNKS and chunk in (ANY_CHUNK, ANY_CHUNKS):
            return "write */** for **/* and ** for **/**"
        before = chunk
    return None


def _intersect(one: tuple[str, ...], other: tuple[str, ...]) -> bool:
    if not one or not other:
        return all(chunk == ANY_CHUNKS for chunk in one + other)
    if other[0] == ANY_CHUNKS:
        one, other = other, one
    first, second = one[0], other[0]
    if first == ANY_CHUNKS:
        swallow = not second.startswith("@") and _intersect(one, other[1:])
        return swallow or _intersect(one[1:], other)
    return _chunks_meet(first, second) and _intersect(one[1:], other[1:])


def _chunks_meet(one: str, other: str) -> bool:
    if one == other:
        return True
    if one == ANY_CHUNK:
        return not other.startswith("@")
    return other == ANY_CHUNK and not one.startswith("@")
