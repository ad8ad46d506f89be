"""What brief and board tell, as missions have it and as arrays.

At 200 x 5000 the arrays of a board take 60 MB, and each task that appears makes new ones. A process
that holds the replicas of many UAVs, as a simulation does, has them once for all replicas that hold
the very same statements. Leaves out: what has become of the tasks (swarm.protocol.board).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from weakref import WeakValueDictionary

from swarm.allocation.problem import Problem
from swarm.model import Mission, Origin, Task, TaskId, Uav, UavId
from swarm.protocol.calibration import FlightRates, fleet_as_flown
from swarm.protocol.field_messages import ZoneSpec
from swarm.protocol.messages import MissionConfig, PostedTask, TaskEntry, UavSpec

_FLEETS_KEPT = 2
_TASKS_KEPT = 20_000
"""As many as a board has room for."""


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class BoardArrays:
    """One state of brief and board, and its arrays."""

    brief: MissionConfig
    entries: tuple[TaskEntry, ...]
    """In board order."""
    rates: Mapping[str, FlightRates]
    """Of UAVs that fly otherwise than the brief says; by id."""
    fleet: Mission
    """UAVs as they fly, without tasks."""
    tasks: tuple[Task, ...]
    """One for each entry."""
    problem: Problem


class BoardArraysCache:
    """Arrays of all boards of a process, each made once, as long as anybody uses them.

    Only replicas that were given the same objects share; to compare contents would take longer. The
    newest arrays of the last few fleets are kept, since the next ones are made from them.
    """

    def __init__(self) -> None:
        self._known: WeakValueDictionary[object, BoardArrays] = WeakValueDictionary()
        self._newest: dict[object, BoardArrays] = {}
        """By brief and rates, the one used last at the end."""
        self._fleets: dict[object, tuple[MissionConfig, Mission]] = {}
        """By brief, the last few, with what they are known by."""
        self._tasks: dict[int, tuple[TaskEntry, Task]] = {}
        """By identity of its entry, the last ones."""

    def task(self, entry: TaskEntry) -> Task:
        """The task of ``entry``, the same one as long as it is kept."""
        known = self._tasks.get(id(entry))
        if known is None:
            if len(self._tasks) == _TASKS_KEPT:
                self._tasks.clear()
            known = self._tasks[id(entry)] = entry, task_of(entry)
        return known[1]

    def fleet(self, mission: str, brief: MissionConfig) -> Mission:
        """UAVs of ``brief`` as it tells of them, without tasks and zones."""
        key = mission, id(brief)
        if key not in self._fleets:
            if len(self._fleets) == _FLEETS_KEPT:
                del self._fleets[next(iter(self._fleets))]
            self._fleets[key] = brief, mission_with(mission, brief, fleet_of(brief), (), ())
        return self._fleets[key][1]

    def of(
        self,
        mission: str,
        brief: MissionConfig,
        entries: Sequence[TaskEntry],
        rates: Mapping[str, FlightRates],
    ) -> BoardArrays:
        """Arrays of those ``entries``, in board order, and of the fleet as it flies."""
        by_fleet = mission, id(brief), tuple(sorted(rates.items()))
        key = by_fleet, tuple(map(id, entries))
        # Arrays hold what they are known by, so nothing else can have that identity meanwhile.
        found = self._known.get(key)
        if found is None:
            before = self._newest.pop(by_fleet, None)
            found = _made(self.fleet(mission, brief), brief, entries, rates, before)
            self._known[key] = self._newest[by_fleet] = found
            if len(self._newest) > _FLEETS_KEPT:
                del self._newest[next(iter(self._newest))]
        return found

    @property
    def n_known(self) -> int:
        """How many are in use, the newest included."""
        return len(self._known)


def _made(
    briefed: Mission,
    brief: MissionConfig,
    entries: Sequence[TaskEntry],
    rates: Mapping[str, FlightRates],
    before: BoardArrays | None,
) -> BoardArrays:
    """Arrays of `BoardArraysCache.of`, made from others of that fleet ``before`` if there are."""
    if before is None:
        fleet = fleet_as_flown(briefed, rates)
        tasks = tuple(map(task_of, entries))
        problem = Problem.from_mission(fleet, tasks=tasks)
        return BoardArrays(brief, tuple(entries), dict(rates), fleet, tasks, problem)
    had = {id(entry): column for column, entry in enumerate(before.entries)}
    columns = [had.get(id(entry), -1) for entry in entries]
    tasks = tuple(
        task_of(entry) if column < 0 else before.tasks[column]
        for entry, column in zip(entries, columns, strict=True)
    )
    problem = before.problem.with_tasks(before.fleet, tasks, columns)
    return BoardArrays(brief, tuple(entries), before.rates, before.fleet, tasks, problem)


BOARD_ARRAYS = BoardArraysCache()
"""Of this process."""


def mission_with(
    name: str,
    brief: MissionConfig,
    uavs: Iterable[Uav],
    tasks: Iterable[Task],
    zones: Iterable[ZoneSpec],
) -> Mission:
    """The mission of ``brief`` with those UAVs, tasks and zones."""
    return Mission(
        name=name,
        horizon_s=brief.horizon_s,
        uavs=tuple(uavs),
        tasks=tuple(tasks),
        success_default=brief.success_default,
        survival_default=brief.survival_default,
        reattempt_failed=brief.reattempt_failed,
        origin=Origin(*brief.origin),
        bases=tuple(base.base() for base in brief.bases),
        zones=tuple(zone.zone() for zone in zones),
        wind_enu_m_s=brief.wind_enu_m_s,
        zone_margin_m=brief.zone_margin_m,
        separation_m=brief.separation_m,
        band_m=brief.band_m,
        areas=tuple(area.area() for area in brief.areas),
        terrain=None if brief.terrain is None else brief.terrain.terrain(),
    )


def fleet_of(brief: MissionConfig) -> tuple[Uav, ...]:
    """The UAVs of ``brief``, as missions have them."""
    return tuple(map(_uav_of, brief.uavs))


def _uav_of(entry: UavSpec) -> Uav:
    return Uav(
        id=UavId(entry.id),
        position_enu_m=entry.position_enu_m,
        speed_m_s=entry.speed_m_s,
        success=entry.success,
        survival=entry.survival,
        kind=entry.kind,
        acceleration_m_s2=entry.acceleration_m_s2,
        airspeed_m_s=entry.airspeed_m_s,
        endurance_s=entry.endurance_s,
        reserve_frac=entry.reserve_frac,
        charge_frac=entry.charge_frac,
        vehicle=entry.vehicle,
        landing_heading_rad=entry.landing_heading_rad,
    )


def task_of(entry: PostedTask) -> Task:
    """The task that ``entry`` tells of, as missions have it."""
    return Task(
        id=TaskId(entry.task),
        position_enu_m=entry.position_enu_m,
        value=entry.value,
        service_s=entry.service_s,
        kind=entry.kind,
        due_s=entry.due_s,
        opens_s=entry.opens_s,
        closes_s=entry.closes_s,
        path_enu_m=entry.path_enu_m,
        height_m=entry.height_m,
        trigger_m=entry.trigger_m,
    )


def board_order(entry: TaskEntry) -> tuple[int, str]:
    """Sort key of tasks on the board."""
    return entry.number, entry.task
