"""Values on a command line: several between commas, and sizes of missions."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import TypeVar

from swarm.errors import Fault, InputError

__all__ = ["each", "size_of"]

T = TypeVar("T")
_SIZE = re.compile(r"([1-9]\d{0,3})[x×]([1-9]\d{0,4})")


def each(flag: str, text: str, read: Callable[[str, str], T]) -> list[T]:
    """The values between commas, each once."""
    words = [word.strip() for word in text.split(",")]
    return list(dict.fromkeys(read(flag, word) for word in words))


def size_of(flag: str, word: str) -> tuple[int, int]:
    """How many UAVs and tasks ``word`` stands for.

    Raises:
        InputError: it is no size.
    """
    match = _SIZE.fullmatch(word)
    if match is None:
        raise InputError(Fault(flag, word, "no size", "write UAVs x tasks, such as 50x500"))
    return int(match[1]), int(match[2])
