"""The design of a study: missions, what is uncertain about them, policies, and how often.

A study flies its own setting of the uncertainty and, for each factor that it varies, the same
setting with that number changed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np

from sim.options import with_reattempts
from sim.study.baselines.index_rules import makespan_s, value_per_time
from sim.study.field_generator import FieldShape, field_span_s, random_field_mission
from sim.study.generator import mission_of, random_mission
from sim.world.uncertainty import Uncertainty
from swarm.allocation.problem import Problem
from swarm.model import Mission
from swarm.scenario.findings import number_of, shown

NUMBERS = tuple(item.name for item in fields(Uncertainty) if item.type == "float")
"""What of the uncertainty can be varied."""
SWITCHES = tuple(item.name for item in fields(Uncertainty) if item.type == "bool")
LISTED = tuple(item.name for item in fields(Uncertainty) if item.name not in (*NUMBERS, *SWITCHES))
"""What of it happens at listed moments."""
FIELD_NUMBERS = tuple(item.name for item in fields(FieldShape))
"""What of the shape of random missions in the field can be varied."""
FIELD_SHARES = ("windows_frac", "due_frac", "lines_frac")
"""Those of them that are within 0..1."""
PROBABILITIES = ("loss", "popup", "message_loss")
"""Those of `NUMBERS` that are within 0..1."""


@dataclass(frozen=True, slots=True)
class SameMission:
    """Every trial flies the same mission."""

    mission: Mission

    def of_trial(self, seed: int, trial: int) -> Mission:
        """The mission of that trial."""
        del seed, trial
        return self.mission


@dataclass(frozen=True, slots=True)
class RandomMissions:
    """Trial k of a study with seed s flies the random mission of seed s + k."""

    uavs: int
    tasks: int
    shape: FieldShape | None = None
    """What constrains them; None for the paper's."""

    def of_trial(self, seed: int, trial: int) -> Mission:
        """The mission of that trial."""
        if self.shape is not None:
            name = f"field-{self.uavs}x{self.tasks}-{seed + trial}"
            return random_field_mission(self.uavs, self.tasks, seed + trial, self.shape, name)
        name = f"random-{self.uavs}x{self.tasks}-{seed + trial}"
        return mission_of(random_mission(self.uavs, self.tasks, seed + trial), name)


@dataclass(frozen=True, slots=True)
class Factor:
    """One number of the uncertainty, or of missions, that is varied while the others stay."""

    what: str
    """One of `NUMBERS` or `FIELD_NUMBERS`."""
    values: tuple[float, ...]
    trials: int | None = None
    """None for as many as the study's own setting has."""


@dataclass(frozen=True, slots=True)
class DesignPoint:
    """One setting of the uncertainty and the missions."""

    index: int
    vary: str
    """One of `NUMBERS` or `FIELD_NUMBERS`; empty for the study's own setting."""
    at: float | None
    uncertainty: Uncertainty
    missions: SameMission | RandomMissions
    trials: int
    world: int
    """Least index of the points with the same setting; they share what is flown there."""


@dataclass(frozen=True, slots=True)
class Study:
    """Everything that decides what a study finds."""

    name: str
    missions: SameMission | RandomMissions
    policies: tuple[str, ...]
    trials: int
    seed: int = 0
    reference: str | None = None
    """The policy to which all others are compared, trial by trial; the first one when None."""
    bound: bool = True
    """Whether the value that no policy can exceed is worked out, too."""
    uncertainty: Uncertainty = field(default_factory=Uncertainty)
    reattempt: bool | None = None
    """Whether failed tasks open again; None leaves that to the mission."""
    varied: tuple[Factor, ...] = ()

    @property
    def compared_to(self) -> str:
        """The reference policy."""
        return self.policies[0] if self.reference is None else self.reference

    @property
    def certain(self) -> bool:
        """Whether all trials are alike."""
        plain = self.uncertainty == Uncertainty() and not self.varied
        return plain and isinstance(self.missions, SameMission)

    @property
    def in_field(self) -> bool:
        """Whether it is of missions with the field's constraints."""
        match self.missions:
            case RandomMissions(shape=shape):
                return shape is not None
            case SameMission(mission):
                return not mission.is_plain

    def points(self) -> tuple[DesignPoint, ...]:
        """All settings: the study's own, then every value of every number that is varied."""
        points: list[DesignPoint] = []
        for vary, at, trials in self._settings():
            change: dict[str, Any] = {} if at is None else {vary: at}
            missions, setting = self.missions, self.uncertainty
            if vary in FIELD_NUMBERS and isinstance(missions, RandomMissions):
                shape = replace(missions.shape or FieldShape(), **change)
                missions = replace(missions, shape=shape)
            else:
                setting = replace(setting, **change)
            index = len(points)
            alike = (p.index for p in points if (p.uncertainty, p.missions) == (setting, missions))
            world = next(alike, index)
            points.append(DesignPoint(index, vary, at, setting, missions, trials, world))
        return tuple(points)

    def _settings(self) -> Iterator[tuple[str, float | None, int]]:
        yield "", None, self.trials
        for varied in self.varied:
            trials = self.trials if varied.trials is None else varied.trials
            for value in varied.values:
                yield varied.what, value, trials

    def mission(self, trial: int, missions: SameMission | RandomMissions | None = None) -> Mission:
        """What is flown in that trial of the study's own missions, or of a point's."""
        mission = (missions or self.missions).of_trial(self.seed, trial)
        return with_reattempts(mission, reattempt=self.reattempt)


def fate_seed(seed: int, trial: int) -> int:
    """Seed of the realization that all policies and points of a trial meet."""
    sequence = np.random.SeedSequence(seed, spawn_key=(trial,))
    return int(sequence.generate_state(1)[0])


def span_s(mission: Mission) -> float:
    """Time within which chance strikes [s]: what the whole mission takes by value per time.

    That asks no policy that is studied, and is the same for all of them.
    """
    if not mission.is_plain:
        return field_span_s(mission)
    problem = Problem.from_mission(mission)
    return makespan_s(problem, value_per_time(problem))


def wrong_number(name: str, value: object) -> str | None:
    """What is wrong with ``value`` for the number ``name`` of the uncertainty; None if nothing."""
    number = number_of(value)
    if number is None:
        return f"{shown(value)} is not a finite number"
    share = name in (*PROBABILITIES, *FIELD_SHARES)
    if number < 0.0 or (share and number > 1.0):
        return f"{shown(value)} is not {'within 0..1' if share else '>= 0'}"
    return None


def unlisted(
    uncertainty: Uncertainty, missions: SameMission | RandomMissions
) -> Iterator[tuple[str, str, list[str]]]:
    """What happens at listed moments to what is not in the mission: where it is listed, its id,
    and the ids that there are. Random missions all have the same ids.
    """
    mission = missions.of_trial(0, 0)
    known: dict[str, list[str]] = {
        "lost_at_s": [uav.id for uav in mission.uavs],
        "withdrawn_at_s": [task.id for task in mission.tasks],
    }
    for key, ids in known.items():
        for name in getattr(uncertainty, key):
            if name not in ids:
                yield key, name, ids


def right_number(name: str) -> str:
    """What the number ``name`` may be."""
    if name in FIELD_SHARES:
        return "a share within 0..1"
    return "a probability within 0..1" if name in PROBABILITIES else "a number >= 0"


def wrong_values(name: str, values: Sequence[object]) -> Iterator[tuple[int, str, str]]:
    """Index, problem and remedy of all ``values`` to which ``name`` cannot be varied."""
    for index, value in enumerate(values):
        if problem := wrong_number(name, value):
            yield index, problem, f"give {right_number(name)}"
        elif value in values[:index]:
            yield index, f"{shown(value)} is there twice", "give it once"
