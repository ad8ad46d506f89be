"""What must hold of a mission in the field, by where its vehicles truly were and what they did.

- *fell*: nobody runs out of energy in the air;
- *underground*: without hills, nobody flies lower than the lowest place that is visited;
- *in a zone*: nobody flies in a zone at its heights, or nearer to it than the margin; who is in one
  that is drawn over it leaves in time, and does not come back;
- *out of its window*: no work that is done has begun before it opens, or after it closes, or ends
  after it is due;
- *no slot*: nobody comes down at a base at all of whose slots UAVs stand, of which it may know;
- *left undone*: see `Chances`.

Read from the text of the field's problem and the tables of its legs, with nothing of how agents
decide.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from sim.faults.drawn_zones import DrawnZone
from sim.world.base_places import base_at
from sim.world.flight_log import LastSeen
from sim.world.flown_path import MotionPiece
from sim.world.motion import Point, flown_s
from sim.world.virtual_world import World
from swarm.allocation.field import problem_of
from swarm.model import Mission, Zone
from swarm.separation.fleet_layers import fleet_layers_m
from swarm.separation.slabs import shared_layers_m

if TYPE_CHECKING:
    import shapely

_CHORDS = 8
"""In the place of a piece of a curve."""
_SLACK_M = 1e-3
_MARGIN_SLACK_FRAC = 1e-3
"""Chains of chords in the place of round corners."""
_LOW_M = 0.5
"""Who is no lower than that is on the ground."""


@dataclass(frozen=True, slots=True)
class VehicleFlaw:
    """A vehicle flies worse than planned, from then on."""

    uav: str
    since_s: float
    speed_frac: float = 1.0
    """Share of its speed."""
    drain_frac: float = 1.0
    """Multiple of the charge that a second in the air should take."""


REACTION_S = 5.0
"""Until when who hears of a zone has ordered its way out [s]."""
_GRANTED_S = 5.0
"""Who has no way out of a zone after that where UAVs are kept apart lands (swarm/separation)."""


def _all_is_heard(_one: str, _other: str, _since_s: float, _until_s: float) -> bool:
    return False


@dataclass(frozen=True, slots=True)
class FieldJudge:
    """Judges one world that is over.

    What an agent can promise of zones follows from what it knows. It knows where its vehicle was
    ``stale_s`` ago or less. Who is sent elsewhere in flight therefore flies from up to
    speed · ``stale_s`` beside where its way was reckoned from, and so far beside that way at most:
    to be kept out by more than that is what a margin is for. The same goes for the ``astray_m``
    that it is at most from where it believes to be, in height too.

    Whoever hears of a zone that it is in orders its way out in the step in which it hears of it,
    or, if it has to ask others first what it has missed, when they have answered: at the latest
    ``reaction_s`` later. Then its vehicle stops, and flies the shortest way out from rest; see
    `_leaves_s` for how long that takes. A vehicle that refuses that way gives it as long again.
    Where UAVs are kept apart its way has to be granted first, and may lead through any layer: it
    waits 5 s for that at most, and climbs or sinks on its way out.

    Whose words reach each other nowhere from when one stands at a base until the other comes down
    there cannot share its slots out: a base says nothing, and neither can wait for words that may
    never come, as its battery ends before (``unheard``). Those who hear the one are not excused.
    """

    world: World
    time_s: float = 1e-5
    """What is forgiven of windows: agents' clocks are not the world's [s]."""
    reaction_s: float = REACTION_S
    """Until when everybody has heard of a zone, and ordered its way out [s]."""
    stale_s: float = 0.0
    """How old what an agent knows of its vehicle's place may be [s]."""
    astray_m: float = 0.0
    """How far UAVs are at most from where they believe to be [m]."""
    flaws: Sequence[VehicleFlaw] = ()
    unheard: Callable[[str, str, float, float], bool] = _all_is_heard
    """Whether nothing that one UAV said from then until then [s] can be known to another."""

    def complaints(self, zones: Sequence[DrawnZone] | None = None) -> list[tuple[str, str]]:
        """Invariants that were broken, and how.

        Args:
            zones: those that there were; by default the scenario's.
        """
        if zones is None:
            zones = [DrawnZone(zone) for zone in self.world.mission.zones]
        return [
            *(("fell", f"{uav} at {at_s:.3f} s") for uav, at_s in self.world.fallen_s.items()),
            *(("underground", text) for text in self._descents()),
            *(("in a zone", text) for text in self._intrusions(zones)),
            *(("out of its window", text) for text in self._out_of_windows()),
            *(("no slot", text) for text in self._crowds()),
        ]

    def _descents(self) -> Iterable[str]:
        mission = self.world.mission
        low_m = min(_heights_m(mission)) - self.astray_m - _LOW_M
        for uav, track in self.world.tracks.items() if mission.terrain is None else ():
            for piece in track.pieces():
                begin_s, up_m = piece.begin_s, piece.position_enu_m(piece.begin_s)[2]
                if up_m < low_m:
                    yield f"{uav} at {up_m:.1f} m at {begin_s:.3f} s"
                    break

    # -- zones --------------------------------------------------------------------------

    def _intrusions(self, zones: Sequence[DrawnZone]) -> Iterable[str]:
        import shapely

        margin_m = self.world.mission.zone_margin_m
        speeds_m_s = {str(uav.id): uav.speed_m_s for uav in self.world.mission.uavs}
        for drawn in zones:
            whole = _forbidden(drawn.zone, margin_m, 0.0)
            for uav, track in self.world.tracks.items():
                beside_m = self.astray_m + self.stale_s * speeds_m_s[uav]
                forbidden = _forbidden(drawn.zone, margin_m, beside_m)
                since_s = drawn.heeded_by_s(uav, self.reaction_s)
                if since_s == math.inf:
                    continue
                leaves_s = self._leaves_s(uav, since_s, whole) if drawn.since_s > 0.0 else 0.0
                outside, cut_s = leaves_s == 0.0, min(max(since_s, leaves_s), drawn.until_s)
                pieces = [*track.pieces(since_s, cut_s), *track.pieces(cut_s, drawn.until_s)]
                for begin_s, chord, deep in _chords_in(pieces, drawn.zone, self.astray_m):
                    enters = deep and bool(shapely.intersects(forbidden, chord))
                    # Who is astray by what is forgiven has not left yet.
                    outside = outside or chord is None or not shapely.intersects(whole, chord)
                    if enters and (outside or begin_s >= leaves_s):
                        yield f"{uav} in {drawn.zone.id} at {begin_s:.3f} s"
                        break

    def _leaves_s(self, uav: str, since_s: float, whole: shapely.Geometry) -> float:
        """By when it must have left what has been drawn over it [s]; 0 if it is outside.

        At ``since_s`` its way out is ordered at the latest, wherever it was going. With the speed
        v, the acceleration a and d from the border it takes v / a to stop, v² / 2a farther in at
        worst, and then the time of a leg of d + v² / 2a from rest. In wind the way out may lead
        against it: the speed over ground is the airspeed less the wind's, or more.
        """
        import shapely

        place = self.world.tracks[uav].position_enu_m(since_s)
        if place is None or not shapely.intersects(whole, shapely.Point(place[:2])):
            return 0.0
        row = next(each for each in self.world.mission.uavs if each.id == uav)
        speed_m_s, a_m_s2 = row.speed_m_s, row.acceleration_m_s2
        if row.airspeed_m_s is not None:
            against_m_s = row.airspeed_m_s - math.hypot(*self.world.mission.wind_enu_m_s)
            speed_m_s = min(speed_m_s, against_m_s)
        stops_s = 0.0 if a_m_s2 is None else row.speed_m_s / a_m_s2
        out_m = float(shapely.distance(shapely.boundary(whole), shapely.Point(place[:2])))
        out_m += row.speed_m_s * stops_s / 2.0
        waits_s = 0.0
        if self.world.mission.separation_m is not None:
            waits_s, out_m = _GRANTED_S, out_m + _layers_apart_m(self.world.mission)
        takes_s = flown_s(out_m, speed_m_s, a_m_s2) / _slowest(self.flaws, uav)
        return since_s + waits_s + stops_s + takes_s

    # -- times --------------------------------------------------------------------------

    def _out_of_windows(self) -> Iterable[str]:
        world, slack_s = self.world, self.time_s
        tasks = {str(task.id): task for task in world.mission.tasks}
        done = set(world.mission_state.result().done)
        for uav, entries in world.executed_schedule().items():
            for entry in entries:
                task = tasks.get(entry.go)
                if task is None or task.id not in done:
                    continue
                closes_s = math.inf if task.closes_s is None else task.closes_s
                if not task.opens_s - slack_s <= entry.begin_s <= closes_s + slack_s:
                    yield f"{uav} began {task.id} at {entry.begin_s:.6f} s"
                if task.due_s is not None and entry.end_s > task.due_s + slack_s:
                    yield f"{uav} ended {task.id} at {entry.end_s:.6f} s, due {task.due_s:g} s"

    # -- bases --------------------------------------------------------------------------

    def _crowds(self) -> Iterable[str]:
        for base in self.world.mission.bases:
            stays = [stay for stay in self.world.flight_log.stays if stay.base == base.id]
            for stay in stays if base.slots is not None else []:
                here = sorted(
                    {
                        other.uav
                        for other in stays
                        if other.begin_s <= stay.begin_s and stay.begin_s + 1e-9 < other.end_s
                        if not self.unheard(stay.uav, other.uav, other.begin_s, stay.begin_s)
                    }
                )
                if len(here) > (base.slots or 0):
                    yield f"{', '.join(here)} stand at {base.id} at {stay.begin_s:.3f} s"


def _heights_m(mission: Mission) -> list[float]:
    """Of all places that are visited, and of tasks' own [m]."""
    up_m = [place[2] for task in mission.tasks for place in (task.position_enu_m, *task.path_enu_m)]
    up_m += [uav.position_enu_m[2] for uav in mission.uavs]
    up_m += [base.position_enu_m[2] for base in mission.bases]
    return up_m + [task.height_m for task in mission.tasks if task.height_m is not None]


def _layers_apart_m(mission: Mission) -> float:
    """Between the lowest and the highest layer above any place that is visited [m]."""
    separation_m, up_m = mission.separation_m or 0.0, _heights_m(mission)
    layers_m = shared_layers_m(separation_m, len(mission.uavs), mission.band_m, 0.0)
    return layers_m[-1] - layers_m[0] + max(up_m) - min(up_m)


def _slowest(flaws: Iterable[VehicleFlaw], uav: str) -> float:
    """The least share of its speed at which it flew."""
    return min((flaw.speed_frac for flaw in flaws if flaw.uav == uav), default=1.0)


def _drain_frac(flaws: Iterable[VehicleFlaw], uav: str) -> float:
    """How many times as fast as planned its battery drained at most."""
    return max((flaw.drain_frac for flaw in flaws if flaw.uav == uav), default=1.0)


def _forbidden(zone: Zone, margin_m: float, astray_m: float) -> shapely.Geometry:
    """Where a path may not be that is flown so far astray at most."""
    import shapely

    slack_m = _SLACK_M + _MARGIN_SLACK_FRAC * margin_m + astray_m
    shape = zone.shape()
    if not zone.inclusive:
        return shapely.buffer(shape, margin_m - slack_m, quad_segs=64)
    allowed = shapely.buffer(shape, slack_m - margin_m, quad_segs=64)
    return shapely.difference(shapely.box(-1e7, -1e7, 1e7, 1e7), allowed)


def _chords_in(
    pieces: Iterable[MotionPiece], zone: Zone, astray_m: float
) -> Iterator[tuple[float, shapely.Geometry | None, bool]]:
    """When each chord of a flight begins [s], and what of it is at the heights of a zone.

    None: it is above or below. And whether it is farther than ``astray_m`` from floor and ceiling.
    """
    import shapely

    for piece in pieces:
        instants_s, places = _chords(piece)
        heights_m = [up_m for _, _, up_m in places]
        if not zone.concerns(min(heights_m), max(heights_m)):
            yield piece.begin_s, None, False
            continue
        deep = zone.concerns(min(heights_m) + astray_m, max(heights_m) - astray_m)
        for begin_s, (one, other) in zip(instants_s, pairwise(places), strict=False):
            flat = one[:2], other[:2]
            chord = shapely.Point(flat[0]) if flat[0] == flat[1] else shapely.LineString(flat)
            yield begin_s, chord, deep


def _chords(piece: MotionPiece) -> tuple[list[float], list[Point]]:
    """Instants of a piece [s], one more than chords, and where it is then."""
    if piece.velocity_enu_m_s == piece.acceleration_enu_m_s2 == (0.0, 0.0, 0.0):
        return [piece.begin_s, piece.end_s], [piece.place_enu_m] * 2
    lasts_s = piece.end_s - piece.begin_s
    instants_s = [piece.begin_s + lasts_s * n / _CHORDS for n in range(_CHORDS + 1)]
    return instants_s, [piece.position_enu_m(at_s) for at_s in instants_s]


class Chances:
    """What UAVs could still have done when they were sent home for good.

    *left undone*: in the end no task without due time is open that some UAV could have done then,
    from its place and charge, as its only one, over as many bases as that takes, every slot free
    but those on which the lost stand.

    Args:
        mission: with the zones that counted then.
        zero_s: mission time 0 in the time of what was seen [s].
        slack_s: who could have done it only to so many seconds is not held to it [s].
        blocked: bases on all of whose slots lost UAVs stand.
        flaws: that there were by then: agents measure them, and do without what they rule out.
    """

    def __init__(
        self,
        mission: Mission,
        zero_s: float,
        slack_s: float = 1.0,
        blocked: Collection[str] = (),
        flaws: Sequence[VehicleFlaw] = (),
    ) -> None:
        self._layers_m = fleet_layers_m(mission)
        self._mission, self._zero_s = mission, zero_s
        times = [1.0 / _slowest(flaws, uav.id) for uav in mission.uavs]
        self._drains = [_drain_frac(flaws, uav.id) for uav in mission.uavs]
        self._problem = problem_of(mission).calibrated(times, self._drains)
        self._slack_s = slack_s
        self._swaps = np.array([base.id not in blocked for base in mission.bases], dtype=np.bool_)

    def can_go_on(self, seen: LastSeen, uav: str, task: str) -> bool:
        """Whether ``uav`` can do ``task`` at once, without another battery, before it is due."""
        row = [str(each) for each in self._problem.uav_ids].index(uav)
        column = [str(each.id) for each in self._mission.tasks].index(task)
        due_s = self._mission.tasks[column].due_s
        ends_s = self._ends_s(row, column, seen, visits=0)
        return ends_s < (math.inf if due_s is None else due_s - self._slack_s)

    def could_do(self, seen: dict[str, LastSeen], tasks: Collection[str]) -> dict[str, list[str]]:
        """By task without due time: who could have done it."""
        found: dict[str, list[str]] = {}
        for row, uav in enumerate(self._problem.uav_ids):
            if uav not in seen:
                continue
            for column, task in enumerate(self._mission.tasks):
                if task.id not in tasks or task.due_s is not None:
                    continue
                if self._ends_s(row, column, seen[uav], self._problem.n_base) < math.inf:
                    found.setdefault(task.id, []).append(uav)
        return found

    def _ends_s(self, row: int, column: int, seen: LastSeen, visits: int) -> float:
        """When that UAV would have ended that task [s mission time]; infinite: it can't.

        After so many ``visits`` to bases at most.
        """
        problem, uav = self._problem, self._mission.uavs[row]
        if not problem.capable[row, column]:
            return math.inf
        now_s = seen.at_s - self._zero_s
        left_s = math.inf
        if uav.endurance_s is not None and seen.battery_frac is not None:
            left_s = (seen.battery_frac - uav.reserve_frac) * uav.endurance_s / self._drains[row]
        base = None if seen.flies else self._base_at(seen)
        if not seen.flies and base is None:
            return math.inf  # at its start, for good
        ready_s = np.full(problem.n_base, math.inf)
        best_s = math.inf
        if seen.flies:
            legs_s = self._legs_from_s(row, seen)
            best_s = self._work_s(row, column, legs_s, now_s, left_s, landed=False)
            to_s = legs_s[problem.n_uav : problem.n_uav + problem.n_base]
            there = (to_s <= left_s - self._slack_s) & self._swaps & (visits > 0)
            ready_s[there] = now_s + to_s[there] + problem.swap_s[there]
        elif base is not None:
            ready_s[base] = now_s
        for _ in range(visits):
            for here in np.flatnonzero(np.isfinite(ready_s)).tolist():
                legs_s = problem.leg_s[problem.kind[row], problem.n_uav + here]
                to_s = legs_s[problem.n_uav : problem.n_uav + problem.n_base]
                there = (to_s <= problem.full_s[row] - self._slack_s) & self._swaps
                later_s = ready_s[here] + to_s + problem.swap_s
                ready_s = np.where(there, np.minimum(ready_s, later_s), ready_s)
        for here in np.flatnonzero(np.isfinite(ready_s)).tolist():
            legs_s = problem.leg_s[problem.kind[row], problem.n_uav + here]
            times = float(ready_s[here]), float(problem.full_s[row])
            best_s = min(best_s, self._work_s(row, column, legs_s, *times, landed=True))
        return best_s

    def _work_s(
        self,
        row: int,
        column: int,
        legs_s: np.ndarray[tuple[int, ...], np.dtype[np.float64]],
        free_s: float,
        left_s: float,
        *,
        landed: bool,
    ) -> float:
        """End of the task by who departs there then with so much airborne time left [s]."""
        problem, best_s = self._problem, math.inf
        for way in (0, 1):
            enter, leave = problem.enter[column, [way, 1 - way]].tolist()
            leg_s = float(legs_s[enter])
            opens_s, closes_s = float(problem.opens_s[column]), float(problem.closes_s[column])
            depart_s = max(free_s, opens_s - leg_s) if landed else free_s
            begin_s = max(depart_s + leg_s, opens_s)
            line_s = float(problem.line_s[problem.kind[row], column, way])
            end_s = begin_s + line_s + float(problem.service_s[column])
            back_s = float(problem.home_s[row, leave])
            spare_s = left_s - self._slack_s
            if begin_s < closes_s - self._slack_s and end_s - depart_s + back_s < spare_s:
                best_s = min(best_s, end_s)
        return best_s

    def _legs_from_s(
        self, row: int, seen: LastSeen
    ) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
        """Times of legs from there [s].

        Who is kept apart in the layer of somebody else flies level there, and upright at the
        height of its task, as if it was in its own layer: no slanted way is granted to it. Who may
        hover at a task's own height has that far to climb or sink, as plans know no layers.
        """
        east_m, north_m, up_m = seen.place_enu_m
        place = (east_m, north_m, up_m - self._layers_m[row])
        legs_s = self._problem.legs_from_s(row, place, flown_m=up_m)
        if any(task.height_m is not None for task in self._mission.tasks):
            high_s = self._problem.legs_from_s(row, seen.place_enu_m, flown_m=up_m)
            legs_s = np.maximum(legs_s, high_s)
        if self._mission.separation_m is None:
            return legs_s
        return np.maximum(legs_s, self._problem.legs_from_s(row, (east_m, north_m, 0.0)))

    def _base_at(self, seen: LastSeen) -> int | None:
        base = base_at(self._mission.bases, seen.place_enu_m)
        return None if base is None else self._mission.bases.index(base)
