"""How near UAVs came to each other in flight, by the places that their statuses tell.

Between two statuses of a UAV a straight line flown evenly is taken, so that anybody who reads the
statuses of a recording finds the same figures; beside each stands how far it may be off for that.
Leaves out: who is in flight (coordinator.mission_view.observed_flights), and where nobody told.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from swarm.protocol.fields import Point

FloatArray = npt.NDArray[np.float64]
_Indices = npt.NDArray[np.intp]

NEAR_M: Final = 20.0
"""What `swarm explain` tells of in a mission that asks for no separation."""
_BATCH: Final = 32
"""Pieces of ways that are looked at together: few, as whoever looks hears nothing meanwhile."""
_AT_ONCE: Final = 500_000
"""Pairs of pieces likewise."""
_UAV, _STARTED, _BEGIN, _END, _ERROR = 0, 1, 2, 3, 10
_FROM, _TO = slice(4, 7), slice(7, 10)
_WIDTH: Final = 11
"""Columns of a piece: who, whether the mission had started, since and until when [s], from and to
where [m], and how far its middle may be off [m]."""


@dataclass(frozen=True, slots=True)
class Approach:
    """Two UAVs in flight at one instant, nearer than before and after."""

    distance_m: float
    """In all three dimensions."""
    at_s: float | None
    """Mission time; None before the mission started."""
    uavs: tuple[str, str]
    places_enu_m: tuple[Point, Point]
    """Where each of them was [m; mission origin]."""
    error_m: float = 0.0
    """How far the distance may be off, as places are told only every so often."""

    def is_within(self, separation_m: float | None) -> bool:
        """Whether that is nearer than was to be kept."""
        return separation_m is not None and self.distance_m < separation_m

    def as_json(self) -> dict[str, object]:
        """Ready for `json.dumps`."""
        return {
            "distance_m": self.distance_m,
            "error_m": self.error_m,
            "at_s": self.at_s,
            "uavs": list(self.uavs),
            "places_enu_m": [list(place) for place in self.places_enu_m],
        }


def approach_as_json(near: Approach | None, separation_m: float | None) -> dict[str, object]:
    """The keys of a report or status that tell how near UAVs came to each other."""
    return {
        "closest_approach_m": None if near is None else near.distance_m,
        "closest_approach": None if near is None else near.as_json(),
        "separation_m": separation_m,
    }


class Fix(NamedTuple):
    """A UAV in flight, as it told."""

    at_s: float
    """Mission time, or before the start the observer's."""
    started: bool
    place_enu_m: Point
    velocity_enu_m_s: Point | None


@dataclass(slots=True)
class _Encounter:
    """Two UAVs that are near each other for a while."""

    nearest: Approach
    until_s: float


class ObservedApproaches:
    """Of one fleet.

    Args:
        gap_s: of a UAV that told nothing for longer nobody knows where it flew meanwhile [s].
        near_m: remember every time that two came as near as this; None: only the nearest.
    """

    def __init__(self, gap_s: float, near_m: float | None = None) -> None:
        self._gap_s = gap_s
        self.near_m = near_m
        self._last: dict[str, Fix] = {}
        """The newest of each UAV in flight."""
        self._uavs: list[str] = []
        self._index: dict[str, int] = {}
        self._fresh: list[tuple[float, ...]] = []
        """Pieces that have not been looked at."""
        self._known = np.empty((0, _WIDTH))
        """Pieces that late ones may still have to be compared with."""
        self._nearest: Approach | None = None
        self._encounters: dict[tuple[str, str], list[_Encounter]] = {}

    # -- what is heard ------------------------------------------------------------------

    def fly(
        self,
        uav: str,
        at_s: float,
        place_enu_m: Point,
        velocity_enu_m_s: Point | None,
        *,
        started: bool,
    ) -> None:
        """A UAV in flight is there at ``at_s``: mission time once it ``started``."""
        last = self._last.get(uav)
        if last is not None and last.started == started and at_s <= last.at_s:
            return
        fix = self._last[uav] = Fix(at_s, started, place_enu_m, velocity_enu_m_s)
        if last is None or last.started != started or at_s - last.at_s > self._gap_s:
            return
        if uav not in self._index:
            self._index[uav] = len(self._uavs)
            self._uavs.append(uav)
        self._fresh.append(_piece(self._index[uav], last, fix))
        if len(self._fresh) >= _BATCH:
            self._look()

    def land(self, uav: str) -> None:
        """A UAV stands on the ground, where it is near to nobody."""
        self._last.pop(uav, None)

    # -- what follows -------------------------------------------------------------------

    @property
    def nearest(self) -> Approach | None:
        """The nearest that two in flight have come to each other; None if never two were."""
        self._look()
        return self._nearest

    def of(self, uav: str) -> list[Approach]:
        """Every time that another one came as near to it as `near_m`, in order of time."""
        self._look()
        found = [
            each.nearest
            for pair, encounters in self._encounters.items()
            if uav in pair
            for each in encounters
        ]
        return sorted(found, key=_order)

    def flying(self, mission_s: float | None, now_s: float) -> dict[str, Fix]:
        """Who is in flight now, and where it was when it told that last."""
        at_s, started = (now_s, False) if mission_s is None else (mission_s, True)
        return {
            uav: fix
            for uav, fix in self._last.items()
            if fix.started == started and abs(at_s - fix.at_s) <= self._gap_s
        }

    def nearest_now(self, mission_s: float | None, now_s: float) -> Approach | None:
        """The two in flight that are nearest to each other, carried on by their velocities."""
        at_s = now_s if mission_s is None else mission_s
        flying = list(self.flying(mission_s, now_s).items())
        if len(flying) < 2:
            return None
        places_m = np.array([_carried_on(fix, at_s) for _, fix in flying])
        apart_m = np.sqrt(((places_m[:, None] - places_m[None]) ** 2).sum(axis=2))
        apart_m[np.tril_indices(len(flying))] = math.inf
        one, other = divmod(int(apart_m.argmin()), len(flying))
        uavs, places = zip(*sorted((flying[k][0], k) for k in (one, other)), strict=True)
        return Approach(
            float(apart_m[one, other]),
            mission_s,
            (uavs[0], uavs[1]),
            (_point(places_m[places[0]]), _point(places_m[places[1]])),
        )

    # -- how near pieces come -----------------------------------------------------------

    def _look(self) -> None:
        """Compare pieces that have come with all others that were flown at the same time."""
        if not self._fresh:
            return
        fresh = np.array(self._fresh)
        self._fresh.clear()
        pieces = np.concatenate([self._known, fresh])
        rows = max(1, _AT_ONCE // len(pieces))
        for first in range(len(self._known), len(pieces), rows):
            last = min(first + rows, len(pieces))
            begin_s, end_s = pieces[first:last, _BEGIN].min(), pieces[first:last, _END].max()
            before = pieces[:last]
            meet = (before[:, _END] >= begin_s) & (before[:, _BEGIN] <= end_s)
            self._compare(before[meet], np.arange(np.count_nonzero(meet[:first]), meet.sum()))
        newest_s = [
            pieces[of_it, _END].max() if (of_it := pieces[:, _STARTED] == started).any() else 0.0
            for started in (0.0, 1.0)
        ]
        since_s = np.where(pieces[:, _STARTED] > 0.0, newest_s[1], newest_s[0]) - 2.0 * self._gap_s
        self._known = pieces[pieces[:, _END] >= since_s]

    def _compare(self, pieces: FloatArray, fresh: _Indices) -> None:
        """Compare each of the pieces ``fresh`` with those before it."""
        mine = pieces[fresh]
        begin_s = np.maximum(mine[:, None, _BEGIN], pieces[None, :, _BEGIN])
        end_s = np.minimum(mine[:, None, _END], pieces[None, :, _END])
        meet = (begin_s <= end_s) & (fresh[:, None] > np.arange(len(pieces)))
        meet &= mine[:, None, _UAV] != pieces[None, :, _UAV]
        meet &= mine[:, None, _STARTED] == pieces[None, :, _STARTED]
        limit_m = math.inf if self._nearest is None else self._nearest.distance_m
        limit_m = max(limit_m, self.near_m or 0.0)
        if limit_m < math.inf:
            middle_m = 0.5 * (pieces[:, _FROM] + pieces[:, _TO])
            half_m = 0.5 * np.linalg.norm(pieces[:, _TO] - pieces[:, _FROM], axis=1)
            between_m = middle_m[fresh][:, None] - middle_m[None]
            room_m = limit_m + half_m[fresh][:, None] + half_m[None]
            meet &= (between_m * between_m).sum(axis=2) <= room_m * room_m
        ones, others = np.nonzero(meet)
        if ones.size:
            self._take(_nearest(mine[ones], pieces[others]))

    def _take(self, found: _Found) -> None:
        """Remember what is nearer than anything before, or near enough to be told."""
        least = np.flatnonzero(found.distance_m == found.distance_m.min())
        nearest = min((self._approach(found, int(row)) for row in least), key=_rank)
        if self._nearest is None or _rank(nearest) < _rank(self._nearest):
            self._nearest = nearest
        if self.near_m is None:
            return
        near = np.flatnonzero(found.distance_m <= self.near_m)
        for row in near[np.argsort(found.begin_s[near], kind="stable")].tolist():
            self._meet(self._approach(found, row), *found.spans_s(row))

    def _meet(self, near: Approach, begin_s: float, end_s: float) -> None:
        """Two are near each other between these instants."""
        known = self._encounters.setdefault(near.uavs, [])
        last = known[-1] if known else None
        goes_on = last is not None and (last.nearest.at_s is None) == (near.at_s is None)
        if last is None or not goes_on or begin_s > last.until_s + self._gap_s:
            known.append(_Encounter(near, end_s))
            return
        last.until_s = max(last.until_s, end_s)
        if _rank(near) < _rank(last.nearest):
            last.nearest = near

    def _approach(self, found: _Found, row: int) -> Approach:
        one, other = (self._uavs[int(number)] for number in found.uavs[row])
        near = Approach(
            float(found.distance_m[row]),
            float(found.at_s[row]) if found.started[row] else None,
            (one, other),
            (_point(found.places_m[row, 0]), _point(found.places_m[row, 1])),
            float(found.error_m[row]),
        )
        if one < other:
            return near
        return replace(near, uavs=(other, one), places_enu_m=near.places_enu_m[::-1])


class _Found(NamedTuple):
    """Pairs of pieces at the instants at which they are nearest."""

    uavs: FloatArray
    """(n, 2) numbers of who."""
    started: npt.NDArray[np.bool_]
    begin_s: FloatArray
    """Since when both are flown."""
    end_s: FloatArray
    distance_m: FloatArray
    at_s: FloatArray
    places_m: FloatArray
    """(n, 2, 3)."""
    error_m: FloatArray

    def spans_s(self, row: int) -> tuple[float, float]:
        """Since and until when both are flown."""
        return float(self.begin_s[row]), float(self.end_s[row])


def _nearest(ones: FloatArray, others: FloatArray) -> _Found:
    """Pieces that are flown at the same time, row by row."""
    begin_s = np.maximum(ones[:, _BEGIN], others[:, _BEGIN])
    end_s = np.minimum(ones[:, _END], others[:, _END])
    first_m = _places(ones, begin_s) - _places(others, begin_s)
    change_m = _places(ones, end_s) - _places(others, end_s) - first_m
    square = (change_m * change_m).sum(axis=1)
    towards = -(first_m * change_m).sum(axis=1)
    share = np.divide(towards, square, out=np.zeros_like(square), where=square > 0.0)
    at_s = begin_s + np.clip(share, 0.0, 1.0) * (end_s - begin_s)
    places_m = np.stack([_places(ones, at_s), _places(others, at_s)], axis=1)
    return _Found(
        np.stack([ones[:, _UAV], others[:, _UAV]], axis=1),
        ones[:, _STARTED] > 0.0,
        begin_s,
        end_s,
        np.linalg.norm(places_m[:, 0] - places_m[:, 1], axis=1),
        at_s,
        places_m,
        ones[:, _ERROR] + others[:, _ERROR],
    )


def _places(pieces: FloatArray, at_s: FloatArray) -> FloatArray:
    """Where those who fly them are, each at its instant."""
    share = (at_s - pieces[:, _BEGIN]) / (pieces[:, _END] - pieces[:, _BEGIN])
    flown_m: FloatArray = share[:, None] * (pieces[:, _TO] - pieces[:, _FROM])
    return pieces[:, _FROM] + flown_m


def _piece(number: int, begin: Fix, end: Fix) -> tuple[float, ...]:
    """The way from one fix to the next."""
    lasts_s = end.at_s - begin.at_s
    way_m = [b - a for a, b in zip(begin.place_enu_m, end.place_enu_m, strict=True)]
    # Who flies evenly accelerated from one velocity to the other is off the even straight line by
    # a T²/8 = |change of velocity| T/8 at most; what the way is otherwise than these velocities
    # give is of times that were told late, or of more than one change.
    mean: Point = (way_m[0] / lasts_s, way_m[1] / lasts_s, way_m[2] / lasts_s)
    leaves, comes = begin.velocity_enu_m_s or mean, end.velocity_enu_m_s or mean
    bent_m = 0.125 * lasts_s * math.dist(leaves, comes)
    odd_m = math.hypot(
        *(w - 0.5 * lasts_s * (a + b) for w, a, b in zip(way_m, leaves, comes, strict=True))
    )
    ends_m = (*begin.place_enu_m, *end.place_enu_m)
    return (number, begin.started, begin.at_s, end.at_s, *ends_m, bent_m + odd_m)


def _carried_on(fix: Fix, at_s: float) -> list[float]:
    """Where it is then if it flies on as it told."""
    since_s = max(0.0, at_s - fix.at_s)
    velocity_m_s = fix.velocity_enu_m_s or (0.0, 0.0, 0.0)
    return [a + since_s * v for a, v in zip(fix.place_enu_m, velocity_m_s, strict=True)]


def _point(place_m: FloatArray) -> Point:
    east_m, north_m, up_m = place_m.tolist()
    return east_m, north_m, up_m


def _order(near: Approach) -> tuple[bool, float, tuple[str, str]]:
    """In which they are told: those before the start first."""
    return near.at_s is not None, near.at_s or 0.0, near.uavs


def _rank(near: Approach) -> tuple[float, bool, float, tuple[str, str]]:
    """Of equally near ones the first is meant, whenever it was looked for."""
    return near.distance_m, *_order(near)
