"""Why a UAV took a task: what it chose from, and all that its choice rested on.

Said for those who look on and record; no agent listens, nothing is decided by it, and it may
be lost. With its basis anyone who has the statements themselves can decide again and compare.
Leaves out: deciding (agent.deciding).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, ClassVar

from annotated_types import Len

from swarm.wire.bounds import CHECKED, Count, Duration, Flag, Id, Instant, Point, Score

__all__ = ["MAX_CANDIDATES", "Basis", "Candidate", "Choice", "choice_id"]

MAX_CANDIDATES = 5
"""How many tasks a choice tells of, the one taken among them."""


@dataclass(frozen=True, slots=True)
class Candidate:
    """A task that could have been taken."""

    __pydantic_config__: ClassVar = CHECKED

    task: Id
    score: Score
    """By the rule in force, the higher the better."""


@dataclass(frozen=True, slots=True)
class Basis:
    """What a choice rested on, beside the statements of others."""

    __pydantic_config__: ClassVar = CHECKED

    decided_s: Instant
    """Mission time at which the UAV became free [s]."""
    place_enu_m: Point
    """Where it was [m; mission origin], without the height layer."""
    patience_s: Duration
    """How late a UAV might be at its task and still be expected to decide in its turn."""
    credible: tuple[Id, ...]
    """Others whose claims counted."""
    awaited: tuple[Id, ...]
    """Free UAVs expected to decide in their turn."""
    excluded: tuple[Id, ...]
    """Tasks the UAV could not take, whatever their value."""
    heads: Mapping[Id, tuple[Count, Count]]
    """Writer -> incarnation and counter of its newest statement that was known."""
    digest: Count
    """Of all statements that were known; equal wherever they are. See swarm.wire.digest."""


@dataclass(frozen=True, slots=True)
class Choice:
    """Key ``uav/<id>/choice``: why that UAV took a task."""

    __pydantic_config__: ClassVar = CHECKED

    number: Count
    """Of the choices of this life of the agent, from 1; with UAV and incarnation its id in logs."""
    task: Id
    left: Id | None
    """The task it turned aside from; None when it was free."""
    chosen_s: Instant
    """Mission time [s]."""
    epoch: Count
    rule: Id
    rank: Count
    score: Score
    second_score: Score | None
    """Of the best task it did not take; None when there was no other."""
    certificate: Flag
    """Whether Theorem 5 proves the choice optimal for this UAV."""
    completion_s: Instant
    """Predicted completion [s mission time]."""
    candidates: Annotated[tuple[Candidate, ...], Len(0, MAX_CANDIDATES)]
    """Best first, as far as the rule values them one by one; may be empty."""
    basis: Basis


def choice_id(uav: str, number: int) -> str:
    """What a choice is called in logs, where lines about its task name it.

    Unique in one life of the agent.
    """
    return f"{uav}-{number}"
