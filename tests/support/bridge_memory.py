"""How much a bridge remembers, in all the parts that it is made of."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from typing import Any

from agent.vehicle.bridge import Bridge
from tests.support.broken_rule import hold

_MOST_REMEMBERED = 4_000
"""Entries of all collections that a bridge holds, its constants included."""
_MOST_BUFFERED_BYTES = 280
"""The longest frame there is."""


def see_buffer(bridge: Bridge) -> None:
    """It keeps no more of what it has heard than a frame that goes on."""
    buffered = len(bridge.codec._framer._buffer)
    hold(buffered <= _MOST_BUFFERED_BYTES, f"keeps {buffered} bytes")


def see_memory(bridge: Bridge) -> None:
    """It remembers no more for hearing more."""
    size = sum(len(part) for part in _collections(bridge, set()))
    hold(size <= _MOST_REMEMBERED, f"remembers {size} things")


def _collections(thing: Any, seen: set[int]) -> Iterator[Any]:
    """Every collection that ``thing`` holds, however deep, text and bytes left out."""
    if id(thing) in seen or isinstance(thing, str | bytes | int | float | type):
        return
    seen.add(id(thing))
    if isinstance(thing, dict):
        yield thing
        parts: Any = [*thing.keys(), *thing.values()]
    elif isinstance(thing, list | tuple | set | frozenset) or type(thing).__name__ == "deque":
        yield thing
        parts = list(thing)
    elif is_dataclass(thing):
        parts = [getattr(thing, each.name) for each in fields(thing)]
    else:
        parts = list(getattr(thing, "__dict__", {}).values())
    for part in parts:
        yield from _collections(part, seen)
