"""What simulated UAVs really did, as a schedule: where they went, when, and what they did there.

Told the orders to each vehicle and what it reports, and when attempts end. Legs that led to
nothing, since somebody thought better of them or was lost, are not told: the next leg begins where
they ended. Leaves out: where vehicles were in between (sim.world.track).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from agent.core.fleet_air import STOP_LEG
from agent.core.interface import (
    Arrived,
    GoTo,
    Home,
    Landed,
    Return,
    Swap,
    Swapped,
    Telemetry,
    VehicleOrder,
    VehicleReport,
    VehicleWord,
)
from sim.world.base_places import base_at
from sim.world.motion import Point
from sim.world.track import Track
from swarm.model import BaseId, Mission, UavId
from swarm.model.plan import START, ScheduleEntry, at_base
from swarm.protocol.uav_messages import Outcome

_HELD_UP_S = 1.0
"""Whose agent says that an attempt ended longer ago than that, it hung: no clock is so far off."""

_MapPoint = tuple[float, float]


@dataclass(slots=True)
class _OpenLeg:
    """What a UAV is about."""

    task: str | None
    attempt: int
    depart_s: float
    from_m: _MapPoint
    via_m: list[_MapPoint]
    leg: int
    """Number of the vehicle's order."""
    go: str | None = None
    """Where it goes, in a schedule; None as long as that is not known."""
    base: BaseId | None = None
    """The same, if it is a base."""
    arrive_s: float | None = None
    begin_s: float | None = None
    is_reversed: bool = False
    came: _OpenLeg | None = None
    """Of who lands where it is, at a base: how it came there."""


@dataclass(slots=True)
class BaseStay:
    """A UAV stands at a base, on one of its slots."""

    uav: str
    base: BaseId
    begin_s: float
    """Its touch-down [s]."""
    ready_s: float = math.inf
    """When its battery has been changed [s]."""
    end_s: float = math.inf
    """Its lift-off, or when it has made room for others [s]."""


@dataclass(frozen=True, slots=True)
class LastSeen:
    """A UAV at the moment at which it is to take no further part."""

    at_s: float
    place_enu_m: Point
    """Where it believes to be [m; height included]."""
    battery_frac: float | None
    flies: bool


@dataclass(slots=True)
class _Flown:
    """One UAV's list so far."""

    entries: list[ScheduleEntry] = field(default_factory=list)
    open: _OpenLeg | None = None
    left: dict[tuple[str, int], _OpenLeg] = field(default_factory=dict)
    """By task and attempt where it has been, and nobody has said yet that this is over: the order
    for what comes next may be first."""
    home: _OpenLeg | None = None
    """The way home, once it is known to have landed there."""

    def leave(self) -> None:
        """Something else comes next; whether the attempt is over is still to be heard."""
        leg = self.open
        if leg is not None and leg.arrive_s is not None and leg.task is not None:
            self.left[leg.task, leg.attempt] = leg


class FlightLog:
    """Lists of all UAVs of a mission, in the world's time.

    Args:
        mission: pop-ups included.
        tracks: of its vehicles, by UAV; who has none is told as far as orders and reports go.
    """

    def __init__(self, mission: Mission, tracks: Mapping[str, Track]) -> None:
        self._mission = mission
        self._tracks = tracks
        self._tasks = {str(task.id): task for task in mission.tasks}
        self._flown = {str(uav.id): _Flown() for uav in mission.uavs}
        self.stays: list[BaseStay] = []
        """At bases, in the order of touch-down."""
        self.last_seen: dict[str, LastSeen] = {}
        """UAVs that were sent home for good."""

    # -- what happens -------------------------------------------------------------------

    def ordered(
        self, uav: str, order: VehicleOrder, telemetry: Telemetry | None, now_s: float
    ) -> None:
        """The vehicle that is there is told to do something; None: it is not known where."""
        flown = self._flown[uav]
        if telemetry is None or isinstance(order, VehicleWord):
            return
        place_enu_m = telemetry.position_enu_m
        track = self._tracks.get(uav)
        flies = track is None or track.airborne
        if isinstance(order, Return):
            frac = telemetry.battery_frac
            self.last_seen.setdefault(uav, LastSeen(now_s, place_enu_m, frac, flies))
        else:
            self.last_seen.pop(uav, None)
        if isinstance(order, GoTo):
            self.made_room(uav, now_s)
        match order:
            case GoTo():
                self._go(uav, flown, order, place_enu_m, now_s)
            case Swap():
                base = self._base_at(order.position_enu_m)
                leg = flown.open
                if leg is not None and leg.came is not None:
                    leg = self._rise(uav, flown, leg, leg.came, now_s)
                flown.home = None
                if base is not None and (leg is None or leg.task is not None):
                    here, there = place_enu_m[:2], order.position_enu_m[:2]
                    leg = flown.open = _OpenLeg(None, 1, now_s, here, [there], order.leg)
                if leg is not None and base is not None:
                    leg.go, leg.base, leg.leg = at_base(base), base, order.leg
            case Return():
                self._return(uav, flown, order, place_enu_m, now_s)
            case _:
                pass

    def reported(self, uav: str, report: VehicleReport, now_s: float) -> None:
        """The vehicle says something."""
        flown = self._flown[uav]
        leg = flown.open
        match report:
            case Arrived(number) if leg is not None and number == leg.leg and leg.arrive_s is None:
                leg.arrive_s = now_s
            case Landed(number) if leg is not None and number == leg.leg and leg.begin_s is None:
                leg.begin_s = now_s
                leg.arrive_s = now_s if leg.arrive_s is None else leg.arrive_s
                if leg.base is not None:
                    self.stays.append(BaseStay(uav, leg.base, now_s))
            case Swapped(number) if leg is not None and number == leg.leg:
                flown.entries.append(_entry(leg, now_s))
                flown.open = None
                for stay in self._here(uav):
                    stay.ready_s = now_s
            case Home() if leg is not None and leg is not flown.home and leg.leg < 0:
                flown.home = leg
            case _:
                pass

    def stands(self, uav: str) -> bool:
        """Whether it is on a slot of a base."""
        return any(True for _ in self._here(uav))

    def made_room(self, uav: str, now_s: float) -> None:
        """Its slot is free again: it has taken off, or its agent says that it stands elsewhere."""
        for stay in self._here(uav):
            stay.end_s = now_s

    def attempt_ended(self, uav: str, ended: Outcome, now_s: float, zero_s: float) -> None:
        """An attempt at a task is over, which may be said again, or long after it was so."""
        flown, task, attempt = self._flown[uav], ended.task, ended.attempt
        ended_s = zero_s + ended.completed_s
        leg = flown.left.pop((task, attempt), None)
        if flown.open is not None and (flown.open.task, flown.open.attempt) == (task, attempt):
            leg, flown.open = flown.open, None
        if leg is None or leg.arrive_s is None:
            return
        known = self._tasks.get(task)
        opens_s = 0.0 if known is None else zero_s + known.opens_s
        if leg.begin_s is None:
            leg.begin_s = max(leg.arrive_s, opens_s) if opens_s > zero_s else leg.arrive_s
        held_up = leg.begin_s <= ended_s < now_s - _HELD_UP_S
        flown.entries.append(_entry(leg, ended_s if held_up else now_s))

    def executed_schedule(self, zero_s: float | None) -> dict[UavId, tuple[ScheduleEntry, ...]]:
        """Every UAV's list, in mission time, which begins at ``zero_s``.

        Ends with the way home of who has come home; who did nothing before has none either.
        """
        schedule = {}
        for uav, flown in self._flown.items():
            entries = list(flown.entries)
            if entries and flown.home is not None:
                arrive_s = self._touch_down_s(uav, flown.home)
                flown.home.arrive_s = flown.home.begin_s = arrive_s
                entries.append(_entry(flown.home, arrive_s))
            schedule[UavId(uav)] = tuple(_since(zero_s or 0.0, entry) for entry in entries)
        return schedule

    def _here(self, uav: str) -> list[BaseStay]:
        """Its stay that goes on, if there is one."""
        return [stay for stay in self.stays if stay.uav == uav and stay.end_s == math.inf]

    # -- pieces -------------------------------------------------------------------------

    def _go(self, uav: str, flown: _Flown, order: GoTo, place_enu_m: Point, now_s: float) -> None:
        leg, here = flown.open, place_enu_m[:2]
        if order.leg == STOP_LEG and leg is not None and self._waits_to_begin(leg):
            return  # it only makes room meanwhile
        way = [corner[:2] for corner in (*order.via_enu_m, order.position_enu_m)]
        again = leg is not None and (leg.task, leg.attempt) == (order.task, order.attempt)
        if leg is None or not again or (order.task is None and leg.via_m[-1] != way[-1]):
            flown.leave()
            flown.open = _OpenLeg(order.task, order.attempt, now_s, here, way, order.leg)
            flown.open.go = order.task
            return
        task = self._tasks.get(order.task or "")
        leg.leg = order.leg
        if leg.arrive_s is not None and task is not None and task.path_enu_m:
            if leg.begin_s is None and way == leg.via_m[-1:]:
                return  # another life of its agent sends it where it is already, and waits on
            backwards = way[-1] == task.path_enu_m[0][:2]
            if leg.begin_s is None or leg.is_reversed != backwards:
                # What led along before was the way to its other end, or is flown all over again.
                leg.begin_s, leg.is_reversed = now_s, backwards
            return
        leg.via_m = [*self._passed_m(uav, leg.depart_s, now_s), here, *way]
        leg.arrive_s = None

    def _waits_to_begin(self, leg: _OpenLeg) -> bool:
        """Whether it is at an end of its line, along which it has not been sent yet."""
        task = self._tasks.get(leg.task or "")
        is_line = task is not None and bool(task.path_enu_m)
        return is_line and leg.arrive_s is not None and leg.begin_s is None

    def _return(
        self, uav: str, flown: _Flown, order: Return, place_enu_m: Point, now_s: float
    ) -> None:
        track, leg = self._tracks.get(uav), flown.open
        if track is not None and not track.airborne:
            if leg is not None and leg.base is not None and leg.begin_s is not None:
                # The swap that it has begun is for nothing any more: it is home there.
                flown.entries.append(_entry(leg, leg.begin_s))
                flown.open = None
            return
        flown.leave()
        corners = [*order.path_enu_m, *([] if order.via_enu_m is None else [order.via_enu_m])]
        way = [corner[:2] for corner in corners]
        start = next(each for each in self._mission.uavs if each.id == uav).position_enu_m[:2]
        if not order.land and way[-1:] != [start]:
            way.append(start)
        way = way or [place_enu_m[:2]]
        waits = flown.open if flown.open is not None and flown.open.task is None else None
        base = None if way[-1] == start else self._base_at((*way[-1], 0.0))
        leg = _OpenLeg(None, 1, now_s, place_enu_m[:2], way, -1)
        if (before := flown.open) is not None and before.leg < 0:
            passed_m = [*self._passed_m(uav, before.depart_s, now_s), leg.from_m]
            leg.via_m, leg.from_m = [*passed_m, *way], before.from_m
            leg.depart_s = before.depart_s
        leg.go = START if base is None else at_base(base)
        if waits is not None and waits.arrive_s is not None and base is not None:
            leg.came = waits
        flown.open, flown.home = leg, None

    def _rise(
        self, uav: str, flown: _Flown, home: _OpenLeg, came: _OpenLeg, now_s: float
    ) -> _OpenLeg:
        """It has stood beside the slots of a base, as at home, and takes one of them now.

        So it is told: it came home there, which ends its sortie, and later swaps from there.
        """
        came.go, came.base = home.go, self._base_at((*home.via_m[-1], 0.0))
        came.arrive_s = came.begin_s = min(now_s, self._touch_down_s(uav, home))
        flown.entries.append(_entry(came, came.arrive_s))
        there = came.via_m[-1]
        flown.open = _OpenLeg(None, 1, now_s, there, [there], came.leg, came.go, came.base)
        return flown.open

    def _passed_m(self, uav: str, since_s: float, now_s: float) -> list[_MapPoint]:
        """Corners that it has flown through."""
        track = self._tracks.get(uav)
        pieces = [] if track is None else track.pieces(since_s, now_s)
        return [piece.place_enu_m[:2] for piece in pieces if piece.begin_s > since_s]

    def _touch_down_s(self, uav: str, leg: _OpenLeg) -> float:
        """When it has landed at home [s]; vehicles that say so at once fly there all the same."""
        track = self._tracks.get(uav)
        flights_s = [] if track is None else track.flights_s
        ends_s = [down for _, down in flights_s if leg.depart_s <= down < math.inf]
        return min(ends_s, default=leg.depart_s)

    def _base_at(self, place_enu_m: Point) -> BaseId | None:
        base = base_at(self._mission.bases, place_enu_m)
        return None if base is None else base.id


def _entry(leg: _OpenLeg, end_s: float) -> ScheduleEntry:
    arrive_s = end_s if leg.arrive_s is None else leg.arrive_s
    begin_s = arrive_s if leg.begin_s is None else leg.begin_s
    return ScheduleEntry(
        go=leg.go or "",
        from_enu_m=leg.from_m,
        via_enu_m=tuple(leg.via_m),
        depart_s=leg.depart_s,
        arrive_s=arrive_s,
        begin_s=begin_s,
        end_s=end_s,
        is_reversed=leg.is_reversed,
    )


def _since(zero_s: float, entry: ScheduleEntry) -> ScheduleEntry:
    if zero_s == 0.0:
        return entry
    times_s = ("depart_s", "arrive_s", "begin_s", "end_s")
    return replace(entry, **{name: getattr(entry, name) - zero_s for name in times_s})
