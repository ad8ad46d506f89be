"""A core whose every fact is written down.

Whatever is wrapped decides and acts as before; a recorder is told what it was told, and what
it says itself. Leaves out: what is made of it (coordinator.recording.recorder).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Generic, Protocol, TypeVar

from coordinator.observer import Observer
from coordinator.recording.records import Begun, Recorded
from swarm.events import BusFact, Heard, Publish
from swarm.model import Plan
from swarm.shell import Core

__all__ = ["Notebook", "RecordedCore"]

A = TypeVar("A")


class Notebook(Protocol):
    """Takes down facts."""

    def note(self, what: Recorded, now_s: float) -> None:
        """At ``now_s`` of the core's clock; returns at once."""
        ...


class RecordedCore(Generic[A]):
    """A core that hears the bus, and a recorder beside it.

    Args:
        core: an onlooker, or whoever else hears what onlookers hear.
        notebook: told every fact before the core is.
        observer: may be given a plan by somebody else, which is written down, too.
    """

    def __init__(self, core: Core[BusFact, A], notebook: Notebook, observer: Observer) -> None:
        self._core = core
        self._notebook = notebook
        self._observer = observer
        self._plan: Plan | None = None

    def start(self, now_s: float) -> Sequence[A]:
        """Start the core."""
        self._notebook.note(Begun(), now_s)
        return self._told(self._core.start(now_s), now_s)

    def step(self, event: BusFact, now_s: float) -> Sequence[A]:
        """Step the core."""
        if self._observer.plan is not self._plan and self._observer.plan is not None:
            self._plan = self._observer.plan
            self._notebook.note(self._plan, now_s)
        self._notebook.note(event, now_s)
        return self._told(self._core.step(event, now_s), now_s)

    def next_deadline_s(self) -> float | None:
        """Of the core."""
        return self._core.next_deadline_s()

    def _told(self, wishes: Sequence[A], now_s: float) -> Sequence[A]:
        # A process does not hear itself.
        for wish in wishes:
            if isinstance(wish, Publish):
                self._notebook.note(Heard(wish.message), now_s)
        return wishes
