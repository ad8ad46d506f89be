"""Rows of a feed: which of their fields have changed since when, each made into text once."""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import takewhile

_encode = json.JSONEncoder(separators=(",", ":"), allow_nan=False).encode


def as_text(row: Mapping[str, object]) -> str:
    """``row`` as JSON without a needless sign."""
    return _encode(row)


@dataclass(slots=True)
class _Row:
    """One row, as it was told last."""

    values: Mapping[str, object]
    changed: int
    """When any of its fields changed last."""
    fields: dict[str, tuple[int, str]]
    """By name: when it changed last, and how it is told."""


class RowTable:
    """Rows that change; none vanishes but the oldest of more than ``keep``, if that is given.

    Args:
        key: the field that tells rows apart; it comes with whatever else has changed.
        but: a field whose change alone is none, as it grows by itself; see `touch`.
        keep: so many rows at most.
    """

    def __init__(self, key: str, *, but: str | None = None, keep: int | None = None) -> None:
        self._key = key
        self._but = but
        self._keep = keep
        self._rows: dict[object, _Row] = {}

    def put(self, values: Mapping[str, object], seq: int) -> None:
        """Take a row in, as of ``seq``; rows of a table have the same fields."""
        key = values[self._key]
        known = self._rows.get(key)
        if known is None:
            told = {name: (seq, _field(name, value)) for name, value in values.items()}
            self._rows[key] = _Row(values, seq, told)
            if self._keep is not None and len(self._rows) > self._keep:
                self._rows.pop(next(iter(self._rows)))
            return
        if values == known.values:
            return
        before = known.values
        new = [name for name, value in values.items() if value != before.get(name)]
        if new == [self._but]:
            return
        for name in new:
            known.fields[name] = seq, _field(name, values[name])
        known.values, known.changed = values, seq

    def touch(self, values: Mapping[str, object], seq: int, every: int) -> None:
        """Send the field that is `but` again if the row was last sent ``every`` or more ago."""
        known = self._rows[values[self._key]]
        if self._but is not None and seq - known.changed >= every:
            known.fields[self._but] = seq, _field(self._but, values[self._but])
            known.changed = seq

    def after(self, seq: int) -> list[str]:
        """Rows that have changed after ``seq``: their key, and the fields that have."""
        return [self._told(row, seq) for row in self._rows.values() if row.changed > seq]

    def _told(self, row: _Row, seq: int) -> str:
        key = row.fields[self._key][1]
        new = [text for name, (at, text) in row.fields.items() if at > seq and name != self._key]
        return f"{{{','.join((key, *new))}}}"

    def clear(self) -> None:
        """Forget all rows."""
        self._rows.clear()


def _field(name: str, value: object) -> str:
    return f'"{name}":{_encode(value)}'


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
