"""What must hold of a mission in the field, by where its vehicles truly were and what they did.

- *fell*: nobody runs out of energy in the air;
- *in a zone*: nobody flies in a zone at its heights, or nearer to it than the margin; who is in one
  that is drawn over it leaves, and does not come back;
- *out of its window*: no work that is done has begun before it opens, or after it closes, or ends
  after it is due;
- *no slot*: no more UAVs stand at a base than it has slots;
- *left undone*: see `Chances`.

Read from the text of the field's problem and the tables of its legs, with nothing of how agents
decide.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from sim.world.flight_log import LastSeen
from sim.world.flown_path import MotionPiece
from sim.world.virtual_world import World
from swarm.allocation.field import FieldProblem
from swarm.model import Mission, Zone
from swarm.model.layers import FlightLayers

if TYPE_CHECKING:
    import shapely

_CHORDS = 8
"""In the place of a piece of a curve."""
_SLACK_M = 1e-3
_MARGIN_SLACK_FRAC = 1e-3
"""Chains of chords in the place of round corners."""
_SAME_BASE_M = 1.0


@dataclass(frozen=True, slots=True)
class DrawnZone:
    """A zone that counts from some moment on, until another."""

    zone: Zone
    since_s: float = 0.0
    """In the world's time [s]; until a reaction later UAVs in it may be on their way out."""
    until_s: float = math.inf


@dataclass(frozen=True, slots=True)
class FieldJudge:
    """Judges one world that is over."""

    world: World
    time_s: float = 1e-5
    """What is forgiven of windows: agents' clocks are not the world's [s]."""
    reaction_s: float = 5.0
    """Until when everybody has heard of a zone, and changed its course [s]."""

    def complaints(self, zones: Sequence[DrawnZone] | None = None) -> list[tuple[str, str]]:
        """Invariants that were broken, and how.

        Args:
            zones: those that there were; by default the scenario's.
        """
        if zones is None:
            zones = [DrawnZone(zone) for zone in self.world.mission.zones]
        return [
            *(("fell", f"{uav} at {at_s:.3f} s") for uav, at_s in self.world.fallen_s.items()),
            *(("in a zone", text) for text in self._intrusions(zones)),
            *(("out of its window", text) for text in self._out_of_windows()),
            *(("no slot", text) for text in self._crowds()),
        ]

    # -- zones --------------------------------------------------------------------------

    def _intrusions(self, zones: Sequence[DrawnZone]) -> Iterable[str]:
        margin_m = self.world.mission.zone_margin_m
        for drawn in zones:
            forbidden = _forbidden(drawn.zone, margin_m)
            for uav, track in self.world.tracks.items():
                begun = drawn.since_s > 0.0
                inside = False
                for piece in track.pieces(drawn.since_s, drawn.until_s):
                    enters = _enters(piece, drawn.zone, forbidden)
                    late = not begun or piece.begin_s > drawn.since_s + self.reaction_s
                    if enters and late and not (begun and inside):
                        yield f"{uav} in {drawn.zone.id} from {piece.begin_s:.3f} s on"
                        break
                    inside = enters

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
                here = [
                    other.uav
                    for other in stays
                    if other.begin_s <= stay.begin_s and stay.begin_s + 1e-9 < other.end_s
                ]
                if len(here) > (base.slots or 0):
                    yield f"{', '.join(here)} stand at {base.id} at {stay.begin_s:.3f} s"


def _forbidden(zone: Zone, margin_m: float) -> shapely.Geometry:
    """Where a path may not be."""
    import shapely

    slack_m = _SLACK_M + _MARGIN_SLACK_FRAC * margin_m
    shape = zone.shape()
    if not zone.inclusive:
        return shapely.buffer(shape, margin_m - slack_m, quad_segs=64)
    allowed = shapely.buffer(shape, slack_m - margin_m, quad_segs=64)
    return shapely.difference(shapely.box(-1e7, -1e7, 1e7, 1e7), allowed)


def _enters(piece: MotionPiece, zone: Zone, forbidden: shapely.Geometry) -> bool:
    import shapely

    lasts_s = 0.0 if piece.end_s == math.inf else piece.end_s - piece.begin_s
    if piece.velocity_enu_m_s == piece.acceleration_enu_m_s2 == (0.0, 0.0, 0.0):
        lasts_s = 0.0
    instants_s = [piece.begin_s + lasts_s * n / _CHORDS for n in range(_CHORDS + 1)]
    places = [piece.position_enu_m(at_s) for at_s in instants_s]
    heights_m = [up_m for _, _, up_m in places]
    if not zone.concerns(min(heights_m), max(heights_m)):
        return False
    flat = [place[:2] for place in places]
    if lasts_s == 0.0:
        return bool(shapely.intersects(forbidden, shapely.Point(flat[0])))
    return any(
        bool(shapely.intersects(forbidden, shapely.LineString([one, other])))
        for one, other in pairwise(flat)
    )


class Chances:
    """What UAVs could still have done when they were sent home for good.

    *left undone*: in the end no task without due time is open that some UAV could have done then,
    from its place and charge, as its only one, over as many bases as that takes, every slot free.

    Args:
        mission: with the zones that counted then.
        zero_s: mission time 0 in the time of what was seen [s].
    """

    def __init__(self, mission: Mission, zero_s: float) -> None:
        layers = FlightLayers()
        self._layers_m = [layers.layer_m(place) for place in range(len(mission.uavs))]
        self._mission, self._zero_s = mission, zero_s
        self._problem = FieldProblem.from_mission(mission)

    def could_do(self, seen: dict[str, LastSeen], tasks: Collection[str]) -> dict[str, list[str]]:
        """By task without due time: who could have done it."""
        found: dict[str, list[str]] = {}
        for row, uav in enumerate(self._problem.uav_ids):
            if uav not in seen:
                continue
            for column, task in enumerate(self._mission.tasks):
                wanted = task.id in tasks and task.due_s is None
                if wanted and self._ends_s(row, column, seen[uav]) < math.inf:
                    found.setdefault(task.id, []).append(uav)
        return found

    def _ends_s(self, row: int, column: int, seen: LastSeen) -> float:
        """When that UAV would have ended that task [s mission time]; infinite: it can't."""
        problem, uav = self._problem, self._mission.uavs[row]
        if not problem.capable[row, column]:
            return math.inf
        now_s = seen.at_s - self._zero_s
        left_s = math.inf
        if uav.endurance_s is not None and seen.battery_frac is not None:
            left_s = (seen.battery_frac - uav.reserve_frac) * uav.endurance_s
        base = None if seen.flies else self._base_at(seen)
        if not seen.flies and base is None:
            return math.inf  # at its start, for good
        ready_s = np.full(problem.n_base, math.inf)
        best_s = math.inf
        if seen.flies:
            legs_s = self._legs_from_s(row, seen)
            best_s = self._work_s(row, column, legs_s, now_s, left_s, landed=False)
            to_s = legs_s[problem.n_uav : problem.n_uav + problem.n_base]
            there = to_s <= left_s + 1e-6
            ready_s[there] = now_s + to_s[there] + problem.swap_s[there]
        elif base is not None:
            ready_s[base] = now_s
        for _ in range(problem.n_base):
            for here in np.flatnonzero(np.isfinite(ready_s)).tolist():
                legs_s = problem.leg_s[problem.kind[row], problem.n_uav + here]
                to_s = legs_s[problem.n_uav : problem.n_uav + problem.n_base]
                there = to_s <= problem.full_s[row] + 1e-6
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
            # Who could have done it only to the second is not held to it.
            if begin_s < closes_s - 1.0 and end_s - depart_s + back_s < left_s - 1.0:
                best_s = min(best_s, end_s)
        return best_s

    def _legs_from_s(
        self, row: int, seen: LastSeen
    ) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
        east_m, north_m, up_m = seen.place_enu_m
        place = (east_m, north_m, up_m - self._layers_m[row])
        return self._problem.legs_from_s(row, place, flown_m=up_m)

    def _base_at(self, seen: LastSeen) -> int | None:
        for number, base in enumerate(self._mission.bases):
            if math.dist(base.position_enu_m[:2], seen.place_enu_m[:2]) <= _SAME_BASE_M:
                return number
        return None
