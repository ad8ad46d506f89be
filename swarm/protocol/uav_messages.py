"""What a UAV says: its claim, its outcomes, its status, and why it chose a task.

A choice is said for those who look on and record; no agent listens, nothing is decided by it,
and it may be lost. With its basis anyone who has the statements themselves can decide again
and compare.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Annotated

from annotated_types import Ge, Le, Len
from pydantic import Strict

from swarm.protocol.fields import (
    MAX_COUNT,
    Acceleration,
    Checked,
    Count,
    Duration,
    Factor,
    Flag,
    Id,
    Instant,
    Metres,
    Point,
    Probability,
    Reason,
    Score,
    Speed,
    Words,
)

MAX_CANDIDATES = 5
"""How many tasks a choice tells of, the one taken among them."""


@dataclass(frozen=True, slots=True)
class Candidate(Checked):
    """A task that could have been taken."""

    task: Id
    score: Score
    """By the rule in force, the higher the better."""


@dataclass(frozen=True, slots=True)
class ChoiceBasis(Checked):
    """What a choice rested on, beside the statements of others."""

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
    """Of all statements that were known; equal wherever they are. See swarm.protocol.sync."""
    sortie_end_s: Instant | None = None
    """Mission time by which the UAV had to land [s]; None: endless, or of no matter at a base."""
    landed_at: Id | None = None
    """Base at which it stood ready."""
    parked: Flag = False
    """Whether it stood there beside the slots."""
    blocking: tuple[tuple[Id, Id], ...] = ()
    """Lost UAVs, each with the base on whose slot it stood."""
    flown_m: Metres | None = None
    """Height at which it hovered out of its layer over the ground [m]; None: it did not."""


@dataclass(frozen=True, slots=True)
class Choice(Checked):
    """Key ``uav/<id>/choice``: why that UAV took a task, or flies to a base."""

    number: Count
    """Of the choices of this life of the agent, from 1; with UAV and incarnation its id in logs."""
    task: Id | None
    """None: it flies to a base instead."""
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
    """Predicted completion, or when it will be ready at the base [s mission time]."""
    candidates: Annotated[tuple[Candidate, ...], Len(0, MAX_CANDIDATES)]
    """Best first, as far as the rule values them one by one; may be empty."""
    basis: ChoiceBasis
    base: Id | None = None
    """The base it flies to; None: it took a task."""

    def __post_init__(self) -> None:
        if (self.task is None) == (self.base is None):
            raise ValueError("a choice is of a task or of a base")


def choice_id(uav: str, number: int) -> str:
    """What a choice is called in logs, where lines about its task name it.

    Unique in one life of the agent.
    """
    return f"{uav}-{number}"


MOST_CORNERS_AHEAD = 4
"""Of its way ahead a UAV tells those near it."""
CellIndex = Annotated[int, Strict(), Ge(-(2**31)), Le(2**31)]
Depth = Annotated[int, Strict(), Ge(0), Le(255)]
Grade = Annotated[int, Strict(), Ge(0), Le(2)]


@dataclass(frozen=True, slots=True)
class Nearby(Checked):
    """Key ``uav/<id>/near/<east>/<north>``: where a UAV is, for those near it; may be lost.

    What follows from it is said in swarm.separation.
    """

    cell: tuple[CellIndex, CellIndex]
    """Of the grid of the mission, counted from its origin to the east and to the north; where
    the UAV is, or was last heard to be."""
    airborne: Flag
    """Whether it flies; if not, nobody need keep away from it, and it may be about to take off."""
    position_enu_m: Point
    """[m; mission origin, height included]."""
    velocity_enu_m_s: Point
    path_enu_m: Annotated[tuple[Point, ...], Len(0, MOST_CORNERS_AHEAD)]
    """Where it is about to fly next, corner by corner [m; alike]; empty: it stops and stays."""
    speed_m_s: Speed
    """At which it flies that."""
    grade: Grade
    """How much it may be asked to give way: 0 not at all, 2 the most."""
    rank: Count
    """Among those of its grade, from its place in the priority sequence."""
    depth: Depth
    """0: its own precedence; else it makes room for one of depth - 1."""
    said_s: Instant | None
    """Mission time [s]; None before it is known."""


MOST_REASONS = 20
"""Reasons of which one status tells."""


class ClaimPhase(StrEnum):
    """How firmly a UAV holds its claim, or why it has none."""

    PROPOSED = "proposed"
    HELD = "held"
    IDLE = "idle"
    """Airborne and free to take a task."""
    PAUSED = "paused"
    """Stopped by the operator, in the air or on the ground: takes no task until told to go on."""
    OUT = "out"
    """Not taking part (any more)."""


class BaseStage(StrEnum):
    """How far a visit to a base is."""

    APPROACHING = "approaching"
    WAITING = "waiting"
    """Above it, until a slot is free."""
    LANDED = "landed"
    """Holds a slot: its battery is being changed, or it waits on the ground."""
    PARKED = "parked"
    """On the ground, but off the slots."""


MOST_CORNERS = 100
"""Of the way that a claim tells."""


@dataclass(frozen=True, slots=True)
class ClaimedWay(Checked):
    """What air a UAV takes or asks for, where UAVs are to be kept apart; see swarm.separation."""

    number: Count
    """Of the request, greater than in any earlier one of this UAV."""
    path_enu_m: Annotated[tuple[Point, ...], Len(0, MOST_CORNERS)] = ()
    """From where it hovers to where it is going to [m; mission origin, height included]; one
    point: it stays there. None: it stands on the ground."""
    flies: Flag = False
    """Whether all who keep that air have granted it; else it waits where the path begins."""
    grounded: Flag = False
    """Whether it stands on the ground as long as it does not fly; or, with ``flies``, has not taken
    off yet, but keeps the air above its start."""
    shift_m: Metres = 0.0
    """How much higher its layer is on that path than the brief's."""
    grants: Mapping[Id, Count] = field(default_factory=dict)
    """What it has granted as a keeper of air: by UAV the number of its request."""
    heir: Id | None = None
    """Who keeps its air from now on, as it is home for good."""
    keeps: tuple[Count, ...] = ()
    """Seats that it has taken over from other keepers of air, with all that these had granted."""


@dataclass(frozen=True, slots=True)
class Claim(Checked):
    """Register ``uav/<id>/claim``: the task or base, or both, that a UAV has taken."""

    phase: ClaimPhase
    task: Id | None
    """None when idle, paused or out, the tombstone of an earlier claim, and of a base alone."""
    decided_s: Instant
    """Mission time at which the UAV was free to decide [s]."""
    rank: Count
    completion_s: Instant
    """Predicted completion [s mission time]; of a base alone, when the UAV is ready there."""
    handed_over: Flag = False
    """Out because somebody else has the vehicle: no later life of this agent commands it."""
    base: Id | None = None
    """It flies to it, or stands at it."""
    stage: BaseStage | None = None
    """Of the visit to that base; None exactly when there is none."""
    arrives_s: Instant | None = None
    """Predicted, then true arrival above the base [s mission time]."""
    sortie_end_s: Instant | None = None
    """Mission time by which it must have landed, its reserve kept [s]; None: endless, or landed."""
    reversed: Flag | None = None
    """The task, a line, is flown from its last point to its first; None of a place."""
    departs_s: Instant | None = None
    """Mission time until which it waits at the base before it flies to the task [s]."""

    way: ClaimedWay | None = None
    """None where UAVs are not kept apart by what they claim."""

    def __post_init__(self) -> None:
        if self.handed_over and self.phase is not ClaimPhase.OUT:
            raise ValueError(f"handed over, but {self.phase}")
        taken = self.is_taken
        if taken and self.task is None and self.base is None:
            raise ValueError(f"a claim that is {self.phase} names nothing")
        if not taken and self.task is not None:
            raise ValueError(f"a claim that is {self.phase} names {self.task}")
        if self.reversed is not None and self.task is None:
            raise ValueError("a claim on no task is reversed")
        if self.base is not None or self.stage is not None:
            self._require_visit(taken=taken)
        elif self.arrives_s is not None or self.departs_s is not None:
            raise ValueError("a claim on no base arrives there or departs")

    def _require_visit(self, *, taken: bool) -> None:
        if self.base is None or self.stage is None:
            raise ValueError(f"a claim on base {self.base} is {self.stage}")
        if not taken and self.stage in (BaseStage.APPROACHING, BaseStage.WAITING):
            raise ValueError(f"a claim that is {self.phase} is {self.stage}")
        if self.departs_s is not None and self.task is None:
            raise ValueError("a claim that departs from a base names no task")

    @property
    def is_taken(self) -> bool:
        """Whether the UAV is at something, or about to be."""
        return self.phase in (ClaimPhase.PROPOSED, ClaimPhase.HELD)


class AttemptResult(StrEnum):
    """How an attempt ended."""

    DONE = "done"
    FAILED = "failed"


@dataclass(frozen=True, slots=True)
class Outcome(Checked):
    """Register ``uav/<id>/outcome/<task>``: how this UAV's last attempt ended."""

    task: Id
    result: AttemptResult
    attempt: Annotated[int, Strict(), Ge(1), Le(MAX_COUNT)]
    completed_s: Instant
    """Mission time [s]."""
    reversed: Flag | None = None
    """The task, a line, was flown from its last point to its first; None of a place."""


@dataclass(frozen=True, slots=True)
class Calibration(Checked):
    """Register ``uav/<id>/calibration``: how this UAV flies, by its parameters and in flight.

    What was measured is told as multiples of what brief and parameters say; see
    swarm.protocol.calibration.
    """

    time_frac: Factor
    """Of the times of its legs: 1.2 takes a fifth longer."""
    drain_frac: Factor
    """Of the charge that a second in the air takes: 1.25 is empty a fifth earlier."""
    legs: Count
    """How many legs that rests on."""
    land_s: Duration = 0.0
    """From above a base or its start, in its layer, until it has touched down [s]."""
    climb_s: Duration = 0.0
    """From a base back to its layer, at rest there [s]."""
    acceleration_m_s2: Acceleration | None = None
    """By its parameters: a leg from rest to rest takes length / speed + speed / this. None: it does
    not say, or the brief does."""
    speed_m_s: Speed | None = None
    """It flies no faster by its parameters; None: not below what the brief says."""


class StatusPhase(StrEnum):
    """What an agent is doing."""

    LEARNING = "learning"
    PREPARING = "preparing"
    IDLE = "idle"
    FLYING = "flying"
    SERVING = "serving"
    HOLDING = "holding"
    """Stopped by the operator."""
    RETURNING = "returning"
    HOME = "home"
    OUT = "out"


@dataclass(frozen=True, slots=True)
class Status(Checked):
    """Key ``uav/<id>/status``: news that may be dropped."""

    phase: StatusPhase
    task: Id | None
    position_enu_m: Point | None
    """Where it is now [m; mission origin], without the height layer."""
    velocity_enu_m_s: Point | None
    battery_frac: Probability | None
    mission_s: Instant | None
    dropped: Annotated[Mapping[Reason, Count], Len(0, MOST_REASONS)]
    """Messages this process has dropped, by reason: those of `swarm.protocol.codec`, "too many"
    where the inbox was full, "stale" for registers older than known, "no room" for those of which
    there were too many."""
    note: Words
    """What it waits for, in words."""
    layer_m: Metres | None = None
    """How much higher than that position it is [m]; None: by the brief's layer."""

    def flown_enu_m(self, layer_m: float) -> Point | None:
        """Where it really is [m; mission origin]; ``layer_m`` is its layer in the brief."""
        if self.position_enu_m is None:
            return None
        east_m, north_m, up_m = self.position_enu_m
        return east_m, north_m, up_m + (layer_m if self.layer_m is None else self.layer_m)


News = Status | Choice | Nearby
"""What is no register: said once, kept by nobody, and may be lost."""
