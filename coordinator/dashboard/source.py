"""What a page is fed from: a living mission, or a recording that is played."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

from coordinator.mission_view.mission_state import MissionState
from coordinator.operator.requests import OperatorRequest
from swarm.runtime.errors import SwarmError


class CommandState(StrEnum):
    """What has come of something the operator said."""

    PENDING = "pending"
    OBEYED = "obeyed"
    NOT_OBEYED = "not obeyed"


@dataclass(frozen=True, slots=True)
class CommandRow:
    """Something the operator said here, and what came of it."""

    n: int
    """Counts from 1 as long as the source lives."""
    text: str
    """What, in words: ``hold uav1``."""
    state: CommandState
    result: str
    """What came of it, in words; empty as long as that is open."""
    task: str | None = None
    """Id of the task that it is about, if any."""


class Refusal(StrEnum):
    """Why nothing was said on the bus."""

    WRONG = "wrong"
    """What was asked for makes no sense in this mission."""
    TOO_EARLY = "too early"
    """There is no mission yet."""


class RefusedError(SwarmError):
    """An order was not given; the text is one sentence for a person."""

    def __init__(self, why: Refusal, text: str) -> None:
        super().__init__(text)
        self.why = why


class RequestSink(Protocol):
    """Takes what an operator wants said."""

    def give(self, wish: OperatorRequest, who: str) -> int:
        """Say it on the bus; the number of its `CommandRow`. ``who`` asks for it, for the log.

        Raises:
            RefusedError: it was not said.
        """
        ...


@dataclass(frozen=True, slots=True)
class PlaybackState:
    """How far a recording is played."""

    t_s: float
    """In the recording's own time, from 0."""
    playing: bool
    speed: float
    """Recorded seconds per wall second."""


class PlaybackControl(Protocol):
    """Plays a recording."""

    @property
    def duration_s(self) -> float:
        """Of the recording, in its own time."""
        ...

    @property
    def state(self) -> PlaybackState:
        """How far it is."""
        ...

    def control(self, *, playing: bool | None, speed: float | None, t_s: float | None) -> None:
        """Play or stop, at that speed, from there; None leaves a thing as it is."""
        ...


class DashboardSource(Protocol):
    """What a page is fed from."""

    @property
    def mission_state(self) -> MissionState | None:
        """What is known; None before there is a mission. Another one when it begins anew, or
        when a recording is wound back."""
        ...

    @property
    def link(self) -> bool:
        """Whether the own link to the bus is up."""
        ...

    def now_s(self) -> float:
        """Now, in the seconds of the observer."""
        ...

    @property
    def speedup(self) -> float:
        """Seconds of the observer per wall second, of then in a recording."""
        ...

    @property
    def dropped(self) -> Mapping[str, int]:
        """Messages that this very process has dropped, by reason."""
        ...

    @property
    def commands(self) -> Sequence[CommandRow]:
        """What was said here, oldest first; an old row may be gone, its number is not reused."""
        ...

    @property
    def orders(self) -> RequestSink | None:
        """Takes orders; None where there is nobody to give them to."""
        ...

    @property
    def player(self) -> PlaybackControl | None:
        """Of a recording; None for a living mission."""
        ...
