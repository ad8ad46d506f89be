"""Errors that callers catch; every message is one clear line.

Leaves out: expected outcomes (infeasible, refused), which are return values.
"""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["BusError", "Fault", "InputError", "SwarmError"]


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
