"""What one who decides for a whole team is told, and what it answers."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from enum import Enum, auto
from typing import Protocol

import numpy as np

from sim.world.motion import Point, between
from swarm.allocation import Problem, TeamState
from swarm.allocation.problem import FloatArray, IntArray
from swarm.runtime.clock import Clock


class TeamNews(Enum):
    """What may have happened since choices were last made."""

    BEGUN = auto()
    """The mission."""
    ENDED = auto()
    """An attempt, for good."""
    REOPENED = auto()
    """A task, as an attempt at it failed."""
    APPEARED = auto()
    """A task."""
    WITHDRAWN = auto()
    """A task that was open or being done."""
    LOST = auto()
    """A UAV; the task it was doing is open again."""
    TIME = auto()
    """The interval has passed after which a dispatcher wants to be asked."""


@dataclass(frozen=True, slots=True, eq=False)
class TeamLeg:
    """One UAV's way to a task, and its service there."""

    task: int
    start_enu_m: Point
    """Where the UAV believes it began [m]."""
    left_s: float
    """Mission time [s], as all below."""
    due_s: float
    """When it should have ended the task by its cruise speed."""
    true_start_enu_m: Point
    true_stop_enu_m: Point
    arrives_s: float
    """When it is really there."""

    def flown_frac(self, now_s: float) -> float:
        """Share of the way that is behind it; 1 while it serves."""
        if now_s >= self.arrives_s:
            return 1.0
        return max(0.0, now_s - self.left_s) / (self.arrives_s - self.left_s)


@dataclass(slots=True, eq=False)
class TeamSituation:
    """Where the mission stands; dispatchers read it and change nothing."""

    problem: Problem
    """All UAVs, and the tasks that have appeared so far: new ones come last."""
    state: TeamState
    """A UAV under way is free when it should have ended its task, at the task's place, or now if
    it is late; any other one is free now. Open is what nobody has ended or is doing; active is who
    lives. Where survival is drawn, S of eq. 1 is that of the task under way alone: what came
    before has been survived."""
    rank: IntArray
    """(n_uav,) place in the priority sequence; 0 decides first."""
    now_s: float = 0.0
    """Mission time [s]."""
    legs: dict[int, TeamLeg] = field(default_factory=dict)
    """By UAV index: what it is doing."""
    survived_before: FloatArray = field(default_factory=lambda: np.ones(0))
    """(n_uav,) S of eq. 1 without the tasks under way."""

    def in_flight(self) -> list[int]:
        """UAVs that have not arrived at their tasks."""
        return [uav for uav, leg in self.legs.items() if leg.arrives_s > self.now_s]

    def place_enu_m(self, uav: int) -> Point:
        """Where ``uav`` believes to be now [m]."""
        leg = self.legs.get(uav)
        if leg is None:
            return as_point(self.state.place_enu_m[uav])
        there = as_point(self.problem.task_enu_m[leg.task])
        return between(leg.start_enu_m, there, leg.flown_frac(self.now_s))

    def if_stopped(self) -> TeamState:
        """The state if all that are in flight gave up their tasks now."""
        state = self.state.copy()
        for uav in self.in_flight():
            state.free_s[uav] = self.now_s
            state.place_enu_m[uav] = self.place_enu_m(uav)
            state.survived[uav] = self.survived_before[uav]
            state.open[self.legs[uav].task] = True
        return state


@dataclass(slots=True)
class Account:
    """What a dispatcher tells of its work."""

    clock: Clock
    epochs: int = 0
    """Plans that came into force."""
    moved: int = 0
    """Tasks that stood on one UAV's list in a plan and on another's in the next."""
    decision_s: list[float] = field(default_factory=list)
    """Wall time of each decision or plan [s]."""

    @contextmanager
    def timed(self) -> Iterator[None]:
        """Note how long a decision or plan takes."""
        begin_s = self.clock.now_s()
        yield
        self.decision_s.append(self.clock.now_s() - begin_s)


class Dispatcher(Protocol):
    """Who decides for all."""

    @property
    def account(self) -> Account:
        """Of its work so far."""
        ...

    def hear(self, situation: TeamSituation, news: Collection[TeamNews]) -> Collection[int]:
        """Something has happened, all of it at the same moment.

        Returns:
            UAVs in flight that are to give up their tasks; they are asked what to do instead.
        """
        ...

    def choose(self, situation: TeamSituation, uav: int) -> int | None:
        """The open task that ``uav``, which is free, shall do now; None: it waits for news."""
        ...


def as_point(place_enu_m: FloatArray) -> Point:
    """The same place [m]."""
    east_m, north_m, up_m = place_enu_m.tolist()
    return east_m, north_m, up_m
