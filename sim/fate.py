"""One drawn future of a mission: what happens in it, whoever decides what.

A fate answers by UAV, task and attempt, never by the order of the questions, so that two
policies that send the same UAV to the same task see the same thing happen. Leaves out: drawing
it (sim.uncertainty).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from sim.kinematics import Point
from sim.streams import stream
from sim.wind import Wind
from swarm.model import Mission, Task, TaskId, Uav, UavId

if TYPE_CHECKING:
    from sim.uncertainty import Uncertainty

__all__ = ["Fate", "Partition", "bounding_box", "lognormal"]

_ATTEMPTS = 8
"""Drawn at once."""
_AIRSPEED_FRAC = 1.25
"""Greatest speed through the air, as a share of the cruise speed or the wind's, if that is more."""


@dataclass(frozen=True, slots=True)
class Partition:
    """Part of the fleet is cut off."""

    at_s: float
    """Mission time [s]."""
    for_s: float
    group: frozenset[str]
    """UAVs that hear each other, and nobody else."""


@dataclass(frozen=True, slots=True, eq=False)
class Fate:
    """A drawn future."""

    mission: Mission
    """The scenario with the moments at which its tasks appear, and what pops up besides."""
    seed: int
    span_s: float
    """What happens by chance happens within this mission time [s]."""
    uncertainty: Uncertainty
    """From which it was drawn."""
    lost_at_s: Mapping[UavId, float] = field(default_factory=dict)
    """When UAVs are lost that are lost whatever they do [s mission time]."""
    withdrawn_at_s: Mapping[TaskId, float] = field(default_factory=dict)
    """When tasks are taken off the board, if they are still on it [s mission time]."""
    partitions: tuple[Partition, ...] = ()
    speed_frac: Mapping[UavId, float] = field(default_factory=dict)
    """Share of its cruise speed at which a UAV really flies in still air."""
    wind: Wind = field(default_factory=Wind)
    _draws: dict[tuple[str, TaskId, int], npt.NDArray[np.float64]] = field(
        default_factory=dict, repr=False
    )
    _rows: dict[UavId, int] = field(default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        self._rows.update({uav.id: row for row, uav in enumerate(self.mission.uavs)})

    # -- attempts ---------------------------------------------------------------------

    def succeeds(self, uav: Uav, task: Task, attempt: int) -> bool:
        """Whether that attempt of ``uav`` at ``task`` succeeds; they are counted from 1."""
        if not self.uncertainty.outcomes:
            return True
        draw = self._uniform("success", uav.id, task.id, attempt)
        return draw < self.mission.success(uav, task)

    def survives(self, uav: Uav, task: Task, attempt: int) -> bool:
        """Whether ``uav`` is still there after that attempt."""
        if not self.uncertainty.survival:
            return True
        draw = self._uniform("survival", uav.id, task.id, attempt)
        return draw < self.mission.survival(uav, task)

    # -- flying -----------------------------------------------------------------------

    def stop_enu_m(self, uav: UavId, task: Task) -> Point:
        """Where ``uav`` really stands when it believes to be at ``task`` [m]."""
        sd_m = self.uncertainty.position_error_m
        east_m, north_m, up_m = task.position_enu_m
        if sd_m == 0.0:
            return task.position_enu_m
        error = self._normal("place", uav, task.id, 2)
        return east_m + sd_m * float(error[0]), north_m + sd_m * float(error[1]), up_m

    def speed_m_s(self, uav: Uav, task: TaskId | None, start: Point, stop: Point) -> float:
        """Speed over ground of ``uav`` on its way from ``start`` to ``stop`` [m/s].

        Args:
            uav: who flies.
            task: to which the leg belongs; None for any other leg.
            start: true place at its beginning [m].
            stop: true place at its end [m].
        """
        speed_m_s = uav.speed_m_s * self.speed_frac.get(uav.id, 1.0)
        if task is not None and self.uncertainty.leg_sd_frac > 0.0:
            normal = float(self._normal("leg", uav.id, task, 1)[0])
            speed_m_s *= lognormal(normal, self.uncertainty.leg_sd_frac)
        length_m = math.dist(start, stop)
        if self.wind.speed_m_s == 0.0 or length_m == 0.0:
            return speed_m_s
        way = tuple((b - a) / length_m for a, b in zip(start, stop, strict=True))
        airspeed_m_s = _AIRSPEED_FRAC * max(speed_m_s, self.wind.speed_m_s)
        return self.wind.ground_speed_m_s((way[0], way[1], way[2]), speed_m_s, airspeed_m_s)

    # -- draws ------------------------------------------------------------------------

    def _uniform(self, what: str, uav: UavId, task: TaskId, attempt: int) -> float:
        block, row = divmod(attempt - 1, _ATTEMPTS)
        key = what, task, block
        draws = self._draws.get(key)
        if draws is None:
            rng = stream(self.seed, what, task, str(block))
            draws = self._draws[key] = rng.random((len(self._rows), _ATTEMPTS))
        return float(draws[self._rows[uav], row])

    def _normal(self, what: str, uav: UavId, task: TaskId, size: int) -> npt.NDArray[np.float64]:
        key = what, task, 0
        draws = self._draws.get(key)
        if draws is None:
            rng = stream(self.seed, what, task)
            draws = self._draws[key] = rng.standard_normal((len(self._rows), size))
        normals: npt.NDArray[np.float64] = draws[self._rows[uav]]
        return normals


def lognormal(normal: float, sd_frac: float) -> float:
    """A positive number of mean 1 and that standard deviation, from a standard normal one."""
    if sd_frac == 0.0:
        return 1.0
    variance = math.log1p(sd_frac**2)
    return math.exp(math.sqrt(variance) * normal - 0.5 * variance)


def bounding_box(tasks: Sequence[Task]) -> tuple[list[float], list[float]]:
    """South-western and north-eastern corner of the box around ``tasks`` [m; east, north]."""
    places = [task.position_enu_m for task in tasks]
    low = [min(place[axis] for place in places) for axis in (0, 1)]
    high = [max(place[axis] for place in places) for axis in (0, 1)]
    return low, high
