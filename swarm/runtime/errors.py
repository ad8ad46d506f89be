"""Errors that callers catch, and remedies that name what was probably meant.

Every message is one clear line. Expected outcomes (infeasible, refused) are return values.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from difflib import get_close_matches

EXIT_INTERRUPTED = 130
"""Status after SIGINT, as shells have it: 128 + 2."""


class SwarmError(Exception):
    """Base of all errors raised on purpose by this project."""


@dataclass(frozen=True, slots=True)
class Fault:
    """One thing wrong with an input."""

    source: str
    """File or flag the input came from."""
    place: str
    """Place inside it, such as ``uav[2].speed_m_s`` or ``line 3``; empty for the whole."""
    problem: str
    """What is wrong."""
    remedy: str
    """What would be right."""

    def __str__(self) -> str:
        where = f"{self.source}: {self.place}" if self.place else self.source
        return f"{where}: {self.problem}; {self.remedy}"


class InputError(SwarmError):
    """Wrong usage or input: the command ends with exit status 2."""

    def __init__(self, *faults: Fault) -> None:
        if not faults:
            raise ValueError("an InputError needs at least one fault")
        super().__init__("\n".join(str(fault) for fault in faults))
        self.faults = faults


class BusError(SwarmError):
    """The bus could not be opened or has been closed."""


def remedy_for_name(name: str, names: Iterable[str], what: str = "choose one of") -> str:
    """The remedy for a ``name`` that is none of ``names``: the nearest; then ``what`` and all."""
    known = [str(each) for each in names]
    close = get_close_matches(name, known, n=1)
    choices = f"{what} {', '.join(known)}"
    return f"did you mean {close[0]!r}? {choices[:1].upper()}{choices[1:]}" if close else choices
