"""A mission: its UAVs, its tasks and areas, its bases and zones, its horizon and its defaults."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

from swarm.model.areas import Area
from swarm.model.frames import Origin
from swarm.model.ids import RESERVED, BaseId, TaskId, UavId, require_id
from swarm.model.terrain import Terrain
from swarm.model.vehicles import TRAITS, VehicleKind, turn_radius_m
from swarm.model.zones import Zone

PLAIN_CONSTRAINTS = frozenset({"vehicle", "acceleration_m_s2"})
"""What asks for nothing that is not in the paper's missions but other times of legs."""

FLAT_CONSTRAINTS = PLAIN_CONSTRAINTS | {"separation_m", "band_m"}
"""What `swarm.allocation.Problem` heeds: ways through shared air are as long as straight ones to
plans and decisions. Any other makes a mission one of the field."""

PointEnu = tuple[float, float, float]
"""East, north, up [m from the mission origin]."""


@dataclass(frozen=True, slots=True)
class Uav:
    """Where a UAV starts, how it flies, how long, and how well it does what.

    Raises:
        ValueError: an id, position, speed, duration, share or probability is out of range.
    """

    id: UavId
    position_enu_m: tuple[float, float, float]
    """Start [m; east, north, up from the mission origin]."""
    speed_m_s: float
    """Cruise ground speed [m/s]; > 0."""
    success: Mapping[str, float] = field(default_factory=dict)
    """Probability p of success, by task id or task kind; the id wins."""
    survival: Mapping[str, float] = field(default_factory=dict)
    """Probability of surviving the task, by task id or task kind; the id wins."""
    kind: str | None = None
    acceleration_m_s2: float | None = None
    """With which it takes up speed and brakes [m/s²]; > 0; None: speeds change at once."""
    airspeed_m_s: float | None = None
    """Speed through the air [m/s]; > 0; None: wind has no effect."""
    endurance_s: float | None = None
    """Airborne time that a full battery gives [s]; > 0; None: endless."""
    reserve_frac: float = 0.2
    """Share of the endurance that is never planned with; within 0..1."""
    charge_frac: float = 1.0
    """Charge of the battery at mission time 0; within 0..1."""
    layer_m: float | None = None
    """Height of its layer above the places it visits [m]; None: by its place in the mission. No
    file names one: a fleet that is briefed already has it from its coordinator."""
    vehicle: VehicleKind = VehicleKind.COPTER
    """What flies, or drives. Of one that cannot stay the acceleration tells its turns
    (swarm.model.vehicles)."""
    landing_heading_rad: float | None = None
    """In which it touches down at its start, clockwise from north [rad]; within 0..2π; None of
    what needs no runway."""

    def __post_init__(self) -> None:
        require_id(self.id, "UAV id")
        if self.id in RESERVED:
            raise ValueError(
                f"UAV id {self.id!r} is taken: it names {RESERVED[self.id]} on the bus"
            )
        require_point(self.position_enu_m, f"position of UAV {self.id}")
        if not (math.isfinite(self.speed_m_s) and self.speed_m_s > 0.0):
            raise ValueError(f"speed of UAV {self.id} must be > 0 m/s, not {self.speed_m_s}")
        for name in ("acceleration_m_s2", "airspeed_m_s", "endurance_s"):
            number = getattr(self, name)
            if number is not None and not (math.isfinite(number) and number > 0.0):
                raise ValueError(f"{name} of UAV {self.id} must be > 0, not {number}")
        for name in ("reserve_frac", "charge_frac"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                share = getattr(self, name)
                raise ValueError(f"{name} of UAV {self.id} must be within 0..1, not {share}")
        if not TRAITS[self.vehicle].stays and self.acceleration_m_s2 is None:
            raise ValueError(f"how UAV {self.id} turns must be given, as it is a {self.vehicle}")
        heading_rad = self.landing_heading_rad
        if (heading_rad is None) is TRAITS[self.vehicle].needs_runway:
            raise ValueError(f"a landing heading of UAV {self.id} goes with a plane that needs one")
        if heading_rad is not None and not 0.0 <= heading_rad <= math.tau:
            raise ValueError(f"landing heading of UAV {self.id} must be within 0..2π")
        require_probabilities(self.success, f"success of UAV {self.id}")
        require_probabilities(self.survival, f"survival of UAV {self.id}")

    @property
    def turn_radius_m(self) -> float | None:
        """Of the circle on which it turns, and waits [m]; None of one that stays where it is."""
        if TRAITS[self.vehicle].stays or self.acceleration_m_s2 is None:
            return None
        return turn_radius_m(self.speed_m_s, self.acceleration_m_s2)


@dataclass(frozen=True, slots=True)
class Base:
    """Where UAVs land to have their batteries swapped.

    Raises:
        ValueError: an id, position, duration or number is out of range.
    """

    id: BaseId
    position_enu_m: PointEnu
    """Place [m; east, north, up from the mission origin]."""
    swap_s: float = 0.0
    """From touch-down to ready [s]; >= 0."""
    slots: int | None = None
    """UAVs served at a time; >= 1; None: no limit."""

    def __post_init__(self) -> None:
        require_id(self.id, "base id")
        require_point(self.position_enu_m, f"position of base {self.id}")
        if not (math.isfinite(self.swap_s) and self.swap_s >= 0.0):
            raise ValueError(f"swap_s of base {self.id} must be >= 0, not {self.swap_s}")
        if self.slots is not None and self.slots < 1:
            raise ValueError(f"slots of base {self.id} must be >= 1, not {self.slots}")


def require_point(point_enu_m: tuple[float, ...], what: str) -> None:
    """Raise ``ValueError`` unless ``point_enu_m`` is three finite numbers."""
    if len(point_enu_m) != 3 or not all(math.isfinite(c) for c in point_enu_m):
        raise ValueError(f"{what} must be three finite numbers [m], not {point_enu_m}")


def require_probabilities(table: Mapping[str, float], what: str) -> None:
    """Raise ``ValueError`` unless every value of ``table`` is within 0..1."""
    for name, value in table.items():
        if not 0.0 <= value <= 1.0:
            raise ValueError(f"{what} at {name} must be within 0..1, not {value}")


@dataclass(frozen=True, slots=True)
class Task:
    """A place to visit, or a line to fly along, and what that is worth.

    Raises:
        ValueError: an id, position, value or time is out of range, or a line has one point.
    """

    id: TaskId
    position_enu_m: PointEnu
    """Place [m; east, north, up from the mission origin]; of a line its first point."""
    value: float
    """m_i of eq. 1; >= 0."""
    service_s: float = 0.0
    """Time on the spot [s]; >= 0."""
    kind: str | None = None
    appears_s: float = 0.0
    """Mission time before which nobody knows the task [s]; > 0 marks a pop-up."""
    due_s: float | None = None
    """Mission time by which it ends, or it is worth nothing [s]; in the place of D in eq. 1. It may
    be left out. None: it is to be done, whenever that is."""
    opens_s: float = 0.0
    """Mission time before which work on the spot does not begin [s]; >= 0."""
    closes_s: float | None = None
    """Mission time after which work on the spot does not begin [s]; None: never too late."""
    path_enu_m: tuple[PointEnu, ...] = ()
    """Points of the line [m; as for the place], flown from one end to the other, whichever way is
    better; empty of a place."""
    trigger_m: float | None = None
    """Of a line, how far apart pictures are taken along it [m]; > 0. None: none are."""
    height_m: float | None = None
    """Where it is flown [m above the origin; of a mission with a terrain above the ground there];
    None: in the UAV's own layer above the place."""

    def __post_init__(self) -> None:
        require_id(self.id, "task id")
        require_point(self.position_enu_m, f"position of task {self.id}")
        for point_enu_m in self.path_enu_m:
            require_point(point_enu_m, f"path of task {self.id}")
        if self.path_enu_m and (
            len(self.path_enu_m) < 2 or self.path_enu_m[0] != self.position_enu_m
        ):
            raise ValueError(
                f"path of task {self.id} must have two points or more, the first its position"
            )
        for name in ("value", "service_s", "appears_s", "opens_s"):
            number = getattr(self, name)
            if not (math.isfinite(number) and number >= 0.0):
                raise ValueError(f"{name} of task {self.id} must be >= 0, not {number}")
        for name in ("due_s", "closes_s"):
            number = getattr(self, name)
            if number is not None and not (math.isfinite(number) and number >= 0.0):
                raise ValueError(f"{name} of task {self.id} must be >= 0, not {number}")
        if self.trigger_m is not None and not (self.path_enu_m and 0.0 < self.trigger_m < math.inf):
            raise ValueError(f"trigger_m of task {self.id} must be > 0, and along a path")
        if self.height_m is not None and not math.isfinite(self.height_m):
            raise ValueError(f"height_m of task {self.id} must be finite, not {self.height_m}")


@dataclass(frozen=True, slots=True)
class Mission:
    """What a scenario file describes.

    Raises:
        ValueError: an id is doubled or invalid, or a number is out of range.
    """

    name: str
    horizon_s: float
    """D of eq. 1 [s]; > 0."""
    uavs: tuple[Uav, ...]
    tasks: tuple[Task, ...]
    success_default: float = 1.0
    survival_default: float = 1.0
    reattempt_failed: bool = False
    origin: Origin | None = None
    bases: tuple[Base, ...] = ()
    zones: tuple[Zone, ...] = ()
    wind_enu_m_s: tuple[float, float] = (0.0, 0.0)
    """Steady wind by where it blows to [m/s; east, north]."""
    zone_margin_m: float = 0.0
    """Paths stay that far away from zones [m]; >= 0."""
    separation_m: float | None = None
    """Smallest distance of two UAVs in flight [m]; > 0. None: nothing keeps them apart but their
    layers."""
    band_m: tuple[float, float] | None = None
    """Heights above the ground that may be used [m]; None: each UAV in its own layer."""
    areas: tuple[Area, ...] = ()
    """What some of the tasks cover together; the lines of each are among the tasks."""
    terrain: Terrain | None = None
    """The ground, on which all places then lie; None: it is flat, and nobody looks at it."""
    schema: int = field(default=1, compare=False)
    """Of the file that it is from; 2 whenever it has constraints. Plans of such tell schedules."""

    def __post_init__(self) -> None:
        require_id(self.name, "mission name")
        if self.schema == 1 and (self.constraints or self.areas):
            object.__setattr__(self, "schema", 2)
        if not (math.isfinite(self.horizon_s) and self.horizon_s > 0.0):
            raise ValueError(f"horizon_s must be > 0, not {self.horizon_s}")
        for name in ("success_default", "survival_default"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ValueError(f"{name} must be within 0..1, not {getattr(self, name)}")
        for what, ids in (
            ("UAV", [uav.id for uav in self.uavs]),
            ("task", [task.id for task in self.tasks]),
            ("base", [base.id for base in self.bases]),
            ("zone", [zone.id for zone in self.zones]),
            ("area", [area.id for area in self.areas]),
        ):
            if len(set(ids)) != len(ids):
                raise ValueError(f"{what} ids must differ: {ids}")
        if not all(math.isfinite(speed_m_s) for speed_m_s in self.wind_enu_m_s):
            raise ValueError(f"wind must be two finite numbers [m/s], not {self.wind_enu_m_s}")
        wind_m_s = math.hypot(*self.wind_enu_m_s)
        for uav in self.uavs:
            if uav.airspeed_m_s is not None and uav.airspeed_m_s <= wind_m_s:
                raise ValueError(
                    f"airspeed_m_s of UAV {uav.id} must be more than the wind's {wind_m_s:g} m/s, "
                    f"not {uav.airspeed_m_s:g}"
                )
        if not (math.isfinite(self.zone_margin_m) and self.zone_margin_m >= 0.0):
            raise ValueError(f"zone_margin_m must be >= 0, not {self.zone_margin_m}")
        if self.separation_m is not None and not 0.0 < self.separation_m < math.inf:
            raise ValueError(f"separation_m must be > 0, not {self.separation_m}")
        if self.band_m is not None and not 0.0 <= self.band_m[0] < self.band_m[1] < math.inf:
            raise ValueError(f"band_m must be two growing heights >= 0, not {self.band_m}")
        if self.band_m is not None and self.terrain is not None:
            self.terrain.check_band(self.band_m)

    @property
    def constraints(self) -> tuple[str, ...]:
        """What it has beyond the paper's mission, by the keys of a scenario file."""
        of_uavs = ("acceleration_m_s2", "airspeed_m_s", "endurance_s")
        found = [key for key in of_uavs if any(getattr(uav, key) is not None for uav in self.uavs)]
        if any(uav.vehicle is not VehicleKind.COPTER for uav in self.uavs):
            found.insert(0, "vehicle")
        of_tasks = {
            "due_s": lambda task: task.due_s is not None,
            "opens_s": lambda task: task.opens_s > 0.0,
            "closes_s": lambda task: task.closes_s is not None,
            "path_m": lambda task: bool(task.path_enu_m),
            "trigger_m": lambda task: task.trigger_m is not None,
            "height_m": lambda task: task.height_m is not None,
        }
        found += [key for key, has in of_tasks.items() if any(map(has, self.tasks))]
        of_mission = {
            "wind_m_s": any(self.wind_enu_m_s),
            "base": self.bases,
            "zone": self.zones,
            "separation_m": self.separation_m is not None,
            "band_m": self.band_m is not None,
            "terrain": self.terrain is not None,
        }
        return (*found, *(key for key, has in of_mission.items() if has))

    @property
    def is_plain(self) -> bool:
        """Whether it asks for nothing in the air that the paper's missions do not ask for."""
        return PLAIN_CONSTRAINTS.issuperset(self.constraints)

    @property
    def is_flat(self) -> bool:
        """Whether plans and decisions need no more than `swarm.allocation.Problem` tells."""
        return FLAT_CONSTRAINTS.issuperset(self.constraints)

    def success(self, uav: Uav, task: Task) -> float:
        """p: probability that ``uav`` succeeds at ``task``; 0 means it never tries."""
        return chances(uav.success, [task], self.success_default)[0]

    def survival(self, uav: Uav, task: Task) -> float:
        """Probability that ``uav`` survives ``task``, a factor of S for all that follow."""
        return chances(uav.survival, [task], self.survival_default)[0]

    def known_at_start(self) -> Mission:
        """The same mission without its pop-ups (tasks with ``appears_s > 0``)."""
        return replace(self, tasks=tuple(task for task in self.tasks if task.appears_s == 0.0))


def chances(table: Mapping[str, float], tasks: Iterable[Task], default: float) -> list[float]:
    """One UAV's probability at each of ``tasks``.

    By its ``table`` of task ids and kinds, of which the id wins; else the ``default``.
    """
    if not table:
        return [default for _ in tasks]
    return [
        table.get(task.id, default if task.kind is None else table.get(task.kind, default))
        for task in tasks
    ]


def kinds_of(mission: Mission) -> tuple[VehicleKind, ...]:
    """The kinds of its UAVs, each once, in the order of the mission."""
    return tuple(dict.fromkeys(uav.vehicle for uav in mission.uavs))
