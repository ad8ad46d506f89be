"""That something did which it must not do."""

from __future__ import annotations


class BrokenError(AssertionError):
    """A bridge did what it must not do."""


def hold(condition: bool, what: str) -> None:
    if not condition:
        raise BrokenError(what)
