"""Read tables of a TOML document key by key, and gather everything that is wrong with them.

Leaves out: which keys there are.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

from swarm.scenario.findings import Document, Finding, Path, absent, close_match, shown

__all__ = [
    "TableReader",
    "ValueType",
    "WrongValueError",
    "array",
    "as_switch",
    "as_table",
    "as_tables",
    "as_word",
    "integer",
    "one_of",
]


T = TypeVar("T")
D = TypeVar("D")


@dataclass(frozen=True, slots=True)
class ValueType(Generic[T]):
    """What the value of a key may be."""

    right: str
    """In words."""
    check: Callable[[object], T]
    """The value; raises `WrongValueError` otherwise."""


class WrongValueError(Exception):
    """The message says what is wrong with a value."""


class TableReader:
    """Takes values out of tables; what is wrong is found in `findings`."""

    def __init__(self) -> None:
        self.findings: list[Finding] = []

    def required(self, table: Document, place: Path, key: str, kind: ValueType[T]) -> T | None:
        """The value of ``key``; None, and a finding, if it is missing or wrong."""
        if key not in table:
            self.findings.append(absent((*place, key), f"give {kind.right}"))
            return None
        return self.optional(table, place, key, kind, None)

    def optional(
        self, table: Document, place: Path, key: str, kind: ValueType[T], default: D
    ) -> T | D:
        """The value of ``key``; ``default`` without it or, with a finding, if it is wrong."""
        if key not in table:
            return default
        try:
            return kind.check(table[key])
        except WrongValueError as error:
            self.add((*place, key), str(error), f"give {kind.right}")
            return default

    def unknown_keys(self, table: Document, place: Path, keys: Sequence[str]) -> None:
        """Find all keys of ``table`` that are none of ``keys``."""
        for key in table:
            if key in keys:
                continue
            meant = close_match(key, [known for known in keys if known not in table])
            if meant is not None:
                remedy = f"did you mean {meant!r}?"
                found = Finding((*place, key), "unknown key", remedy, meant=(*place, meant))
                self.findings.append(found)
            else:
                self.add((*place, key), "unknown key", f"the keys here are {', '.join(keys)}")

    def add(self, place: Path, problem: str, remedy: str) -> None:
        """Find something wrong."""
        self.findings.append(Finding(place, problem, remedy))


def integer(low: int, high: int) -> ValueType[int]:
    """An integer within that range."""

    def check(value: object) -> int:
        if isinstance(value, bool) or not isinstance(value, int):
            raise WrongValueError(f"{shown(value)} is not an integer")
        if not low <= value <= high:
            raise WrongValueError(f"{shown(value)} is out of range")
        return value

    return ValueType(f"an integer within {low}..{high}", check)


def one_of(names: Sequence[str]) -> ValueType[str]:
    """One of ``names``."""

    def check(value: object) -> str:
        if not isinstance(value, str) or value not in names:
            raise WrongValueError(f"{shown(value)} is not one of them")
        return value

    return ValueType(f"one of {', '.join(names)}", check)


def array(example: str) -> ValueType[list[object]]:
    """An array with something in it."""

    def check(value: object) -> list[object]:
        if not isinstance(value, list):
            raise WrongValueError(f"{shown(value)} is not an array")
        if not value:
            raise WrongValueError("is empty")
        return value

    return ValueType(f"at least one in an array, such as {example}", check)


def as_table(value: object) -> Document:
    """A table; for a `ValueType`."""
    if not isinstance(value, Mapping):
        raise WrongValueError(f"{shown(value)} is not a table")
    return value


def as_tables(value: object) -> list[object]:
    """An array, such as one of tables; for a `ValueType`."""
    if not isinstance(value, list):
        raise WrongValueError(f"{shown(value)} is not an array of tables")
    return value


def as_word(value: object) -> str:
    """A string with something in it; for a `ValueType`."""
    if not isinstance(value, str) or not value:
        raise WrongValueError(f"{shown(value)} is not a name in quotes")
    return value


def as_switch(value: object) -> bool:
    """True or false; for a `ValueType`."""
    if not isinstance(value, bool):
        raise WrongValueError(f"{shown(value)} is not true or false")
    return value
