"""What is uncertain about a mission, and one drawn future of it, its realization.

Everything follows from one seed by streams of their own, each named after what it decides and for
whom. So asking for losses does not change which tasks pop up, and another UAV changes nobody's
speed. A realization answers by UAV, task and attempt, never by the order of the questions, so that
policies that decide differently meet the same future (common random numbers).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace

import numpy as np
import numpy.typing as npt

from sim.world.engine import stream
from sim.world.motion import Point
from sim.world.wind import Wind
from swarm.model import Mission, Task, TaskId, Uav, UavId

_ATTEMPTS = 8
"""Drawn at once."""
_AIRSPEED_FRAC = 1.25
"""Greatest speed through the air, as a share of the cruise speed or the wind's, if that is more."""


@dataclass(frozen=True, slots=True)
class FleetPartition:
    """Part of the fleet is cut off."""

    at_s: float
    """Mission time [s]."""
    for_s: float
    group: frozenset[str]
    """UAVs that hear each other, and nobody else."""


@dataclass(frozen=True, slots=True)
class Uncertainty:
    """How uncertain a mission is.

    Raises:
        ValueError: a probability is outside 0..1, another number negative or not finite, or a
            speed or drain zero.
    """

    loss: float = 0.0
    """Probability that a UAV is lost, at a random moment of the mission."""
    popup: float = 0.0
    """Probability that a task known at the start appears during the mission instead."""
    popups_per_min: float = 0.0
    """Rate of tasks that appear besides: each like a random one of the mission, elsewhere."""
    withdrawals_per_min: float = 0.0
    """Rate at which a random task is taken off the board."""
    outcomes: bool = False
    """Whether attempts succeed or fail by chance; otherwise each is worth its p."""
    survival: bool = False
    """Whether tasks cost UAVs by chance; otherwise later tasks are worth their S."""
    speed_frac: float = 1.0
    """Share of its cruise speed at which every UAV really flies, on average; > 0."""
    drain_frac: float = 1.0
    """How many times as fast as they should batteries really drain; > 0."""
    speed_sd_frac: float = 0.0
    """Standard deviation of a UAV's speed, as a share of its cruise speed."""
    leg_sd_frac: float = 0.0
    """The same for each leg by itself."""
    wind_m_s: float = 0.0
    """Speed of a steady wind from a random direction [m/s]."""
    position_error_m: float = 0.0
    """Standard deviation, east and north each, of where a UAV stops for a task [m]."""
    message_loss: float = 0.0
    """Share of messages that never arrive."""
    delay_s: float = 0.0
    """Least delay of a message [s]."""
    jitter_s: float = 0.0
    """Mean of what comes on top of it [s]."""
    partitions_per_min: float = 0.0
    """Rate at which half of the fleet is cut off from the rest and the coordinator."""
    partition_s: float = 30.0
    """How long such a partition lasts [s]."""
    lost_at_s: Mapping[UavId, float] = field(default_factory=dict)
    """UAVs that are lost in any case, and when [s mission time]."""
    withdrawn_at_s: Mapping[TaskId, float] = field(default_factory=dict)
    """Tasks that are withdrawn in any case, and when [s mission time]."""

    def __post_init__(self) -> None:
        for name in _SHARES:
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ValueError(f"{name} must be within 0..1, not {getattr(self, name)}")
        for item in fields(self):
            value = getattr(self, item.name)
            if isinstance(value, float) and not 0.0 <= value < math.inf:
                raise ValueError(f"{item.name} must be >= 0 and finite, not {value}")
        if not (self.speed_frac > 0.0 and self.drain_frac > 0.0):
            shares = f"{self.speed_frac} and {self.drain_frac}"
            raise ValueError(f"speed_frac and drain_frac must be > 0, not {shares}")
        for times_s in (self.lost_at_s, self.withdrawn_at_s):
            if not all(0.0 <= time_s < math.inf for time_s in times_s.values()):
                raise ValueError(f"what is listed happens at mission times >= 0, not {times_s}")

    @property
    def ideal_communication(self) -> bool:
        """Whether everyone hears everything at once."""
        troubles = (self.message_loss, self.delay_s, self.jitter_s, self.partitions_per_min)
        return not any(troubles)

    def draw(self, mission: Mission, span_s: float, seed: int) -> Realization:
        """One future of ``mission``.

        Args:
            mission: as the scenario says.
            span_s: what happens by chance happens within this mission time [s]; tasks known at
                the start that pop up instead do so within its first half.
            seed: of all streams; >= 0.
        """
        losses, popups = (np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(2))
        # Whether and when, one row each, so that more of them change nothing for the first ones.
        late = popups.random((len(mission.tasks), 2)).tolist()
        tasks = tuple(
            _appearing(task, 0.5 * span_s * when)
            if draw < self.popup and task.appears_s == 0.0
            else task
            for task, (draw, when) in zip(mission.tasks, late, strict=True)
        )
        drawn = self._with_more_tasks(replace(mission, tasks=tasks), span_s, seed)
        lost = losses.random((len(mission.uavs), 2)).tolist()
        gone_at_s = {
            uav.id: span_s * when
            for uav, (draw, when) in zip(mission.uavs, lost, strict=True)
            if draw < self.loss
        }
        for uav, when_s in self.lost_at_s.items():
            gone_at_s[uav] = min(when_s, gone_at_s.get(uav, math.inf))
        return Realization(
            mission=drawn,
            seed=seed,
            span_s=span_s,
            lost_at_s=gone_at_s,
            withdrawn_at_s=self._withdrawals(drawn, span_s, seed),
            partitions=self._partitions(mission, span_s, seed),
            speed_frac={
                uav.id: self.speed_frac
                * lognormal(
                    float(stream(seed, "speed", uav.id).standard_normal()), self.speed_sd_frac
                )
                for uav in mission.uavs
            },
            wind=self._wind(seed),
            uncertainty=self,
        )

    def _with_more_tasks(self, mission: Mission, span_s: float, seed: int) -> Mission:
        """Poisson pop-ups: each is like a random task, at a random place among them."""
        rng = stream(seed, "more-tasks")
        times_s = _poisson_s(rng, self.popups_per_min, span_s)
        if not times_s or not mission.tasks:
            return mission
        low, high = bounding_box(mission.tasks)
        tasks, like = list(mission.tasks), dict[str, Task]()
        for number, when_s in enumerate(times_s, start=1):
            model = mission.tasks[int(rng.integers(len(mission.tasks)))]
            place = rng.uniform(low, high)
            name = TaskId(f"popup{number}")
            like[name] = model
            moved = _moved(model, float(place[0]), float(place[1]))
            tasks.append(replace(moved, id=name, appears_s=when_s))
        uavs = tuple(
            replace(
                uav,
                success=_as_of(uav.success, like),
                survival=_as_of(uav.survival, like),
            )
            for uav in mission.uavs
        )
        return replace(mission, uavs=uavs, tasks=tuple(tasks))

    def _withdrawals(self, mission: Mission, span_s: float, seed: int) -> dict[TaskId, float]:
        """Poisson withdrawals of any task that has appeared by then, done or not."""
        rng = stream(seed, "withdrawals")
        withdrawn_at_s = dict(self.withdrawn_at_s)
        for when_s in _poisson_s(rng, self.withdrawals_per_min, span_s):
            place = float(rng.random())
            there = [
                task.id
                for task in mission.tasks
                if task.appears_s <= when_s and withdrawn_at_s.get(task.id, math.inf) > when_s
            ]
            if there:
                withdrawn_at_s[there[int(place * len(there))]] = when_s
        return withdrawn_at_s

    def _partitions(self, mission: Mission, span_s: float, seed: int) -> tuple[FleetPartition, ...]:
        rng = stream(seed, "partitions")
        ids = [uav.id for uav in mission.uavs]

        def half() -> frozenset[str]:
            order = rng.permutation(len(ids)).tolist()
            return frozenset(ids[place] for place in order[: len(ids) // 2])

        times_s = _poisson_s(rng, self.partitions_per_min, span_s)
        return tuple(FleetPartition(when_s, self.partition_s, half()) for when_s in times_s)

    def _wind(self, seed: int) -> Wind:
        way_rad = float(stream(seed, "wind").uniform(0.0, math.tau))
        return Wind((self.wind_m_s * math.cos(way_rad), self.wind_m_s * math.sin(way_rad)))


@dataclass(frozen=True, slots=True, eq=False)
class Realization:
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
    partitions: tuple[FleetPartition, ...] = ()
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
        """Speed over ground of ``uav`` from one true place to another [m/s].

        The leg belongs to ``task``; None for any other leg.
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


_SHARES = ("loss", "popup", "message_loss")


def _poisson_s(rng: np.random.Generator, rate_per_min: float, span_s: float) -> list[float]:
    """Times of a Poisson process within 0..span [s]."""
    times_s: list[float] = []
    if rate_per_min > 0.0:
        time_s = float(rng.exponential(60.0 / rate_per_min))
        while time_s < span_s:
            times_s.append(time_s)
            time_s += float(rng.exponential(60.0 / rate_per_min))
    return times_s


def _appearing(task: Task, appears_s: float) -> Task:
    """``task`` as it is if it appears then: its window and due time as much later as it has been
    open without anybody's knowledge."""
    late_s = max(0.0, appears_s - task.opens_s)
    return replace(
        task,
        appears_s=appears_s,
        opens_s=task.opens_s + late_s if task.closes_s is not None else task.opens_s,
        closes_s=None if task.closes_s is None else task.closes_s + late_s,
        due_s=None if task.due_s is None else task.due_s + late_s,
    )


def _moved(task: Task, east_m: float, north_m: float) -> Task:
    """``task`` at another place; a line with all of its points, so that it stays as it is."""
    place_m = east_m, north_m, task.position_enu_m[2]
    off_m = east_m - task.position_enu_m[0], north_m - task.position_enu_m[1]
    # The first point is the place itself, to the last bit.
    path_m = tuple((e_m + off_m[0], n_m + off_m[1], up_m) for e_m, n_m, up_m in task.path_enu_m[1:])
    path_m = (place_m, *path_m) if task.path_enu_m else ()
    return replace(task, position_enu_m=place_m, path_enu_m=path_m)


def _as_of(table: Mapping[str, float], like: Mapping[str, Task]) -> Mapping[str, float]:
    """``table`` with the new tasks as what they are like."""
    more = {name: table[model.id] for name, model in like.items() if model.id in table}
    return {**table, **more} if more else table
