"""What every policy that a study compares looks like.

Leaves out: the policies (sim.study.policies).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from sim.fate import Fate
from sim.study.flight import Flight
from swarm.clock import Clock
from swarm.model import Mission, Plan

__all__ = ["Bound", "Planner", "Policy"]

Planner = Callable[[Mission, str], Plan]
"""The offline plan of what is known of a mission at its start, by method; the same for all
policies that meet the same fate, and worked out once."""


class Policy(Protocol):
    """A way to run a fleet."""

    @property
    def name(self) -> str:
        """By which studies ask for it."""
        ...

    @property
    def what(self) -> str:
        """In a few words, for a table."""
        ...

    def fly(self, fate: Fate, plan: Planner, clock: Clock) -> Flight:
        """Fly a mission to its end.

        Args:
            fate: what happens.
            plan: offline planner.
            clock: times decisions, and decides nothing.
        """
        ...


class Bound(Protocol):
    """A value that no policy can exceed."""

    @property
    def name(self) -> str:
        """By which studies ask for it."""
        ...

    @property
    def what(self) -> str:
        """In a few words, for a table."""
        ...

    def value(self, fate: Fate, plan: Planner) -> float:
        """The bound for that fate [value·s]."""
        ...
