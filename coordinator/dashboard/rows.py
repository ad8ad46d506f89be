"""Rows of a feed: what has changed since when, each made into text once."""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Hashable, Mapping
from itertools import takewhile


def as_text(row: Mapping[str, object]) -> str:
    """``row`` as JSON without a needless sign."""
    return json.dumps(row, separators=(",", ":"), allow_nan=False)


class RowTable:
    """Rows that change; none vanishes but the oldest of more than ``keep``, if that is given."""

    def __init__(self, keep: int | None = None) -> None:
        self._keep = keep
        self._rows: dict[Hashable, tuple[object, int, str]] = {}
        """By key: what the row is made from, when it changed, its text."""

    def put(
        self, key: Hashable, row: Mapping[str, object], seq: int, but: str | None = None
    ) -> None:
        """Take ``row`` in, as of ``seq``; a change of the field ``but`` alone is none."""
        heart = row if but is None else {name: row[name] for name in row if name != but}
        known = self._rows.get(key)
        if known is None or known[0] != heart:
            self._rows[key] = heart, seq, as_text(row)
            if self._keep is not None and len(self._rows) > self._keep:
                self._rows.pop(next(iter(self._rows)))

    def touch(self, key: Hashable, row: Mapping[str, object], seq: int, every: int) -> None:
        """Send ``row`` again if it was last sent ``every`` or more calls ago."""
        heart, since, _ = self._rows[key]
        if seq - since >= every:
            self._rows[key] = heart, seq, as_text(row)

    def after(self, seq: int) -> list[str]:
        """Rows that have changed after ``seq``."""
        return [text for _, changed, text in self._rows.values() if changed > seq]

    def clear(self) -> None:
        """Forget all rows."""
        self._rows.clear()


class AppendOnlyTable:
    """Rows that are added and never change; the newest ``keep`` are kept."""

    def __init__(self, keep: int) -> None:
        self._rows: deque[tuple[int, str]] = deque(maxlen=keep)

    def add(self, text: str, seq: int) -> None:
        """Add a row's text as of ``seq``."""
        self._rows.append((seq, text))

    def after(self, seq: int) -> list[str]:
        """Rows that have been added after ``seq``, oldest first."""
        new = [text for _, text in takewhile(lambda row: row[0] > seq, reversed(self._rows))]
        return new[::-1]

    def clear(self) -> None:
        """Forget all rows."""
        self._rows.clear()
