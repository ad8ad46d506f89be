"""Values between commas on a command line."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

__all__ = ["each"]

T = TypeVar("T")


def each(flag: str, text: str, read: Callable[[str, str], T]) -> list[T]:
    """The values between commas, each once."""
    words = [word.strip() for word in text.split(",")]
    return list(dict.fromkeys(read(flag, word) for word in words))
