"""Names of columns and properties: slips of those that mean something.

A file people have may hold anything beside what a task needs, so unknown names
are passed over and told; one that is nearly right is a slip and a fault.
"""

from __future__ import annotations

from collections.abc import Collection
from difflib import get_close_matches

__all__ = ["slip_of"]


def slip_of(name: str, known: Collection[str]) -> str | None:
    """The one of ``known`` that ``name`` misspells; None if it is one itself, or none at all."""
    if name in known or len(name) > 64:
        return None
    matches = get_close_matches(name, known, n=1, cutoff=0.8)
    return matches[0] if matches else None
