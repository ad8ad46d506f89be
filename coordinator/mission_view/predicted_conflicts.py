"""Which UAVs would soon come too near to each other, if all went on as they do.

By the motion that UAVs themselves look ahead with (swarm.separation), from what all of them tell:
place and velocity of their statuses, and the way of their claims. Each is taken to go on along
its way as fast as it flies now, so who stands to let another one pass is taken to stand. Leaves
out: what UAVs tell only those near them, and what they will do about it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from coordinator.mission_view.approaches import Fix
from swarm.kernels.motions import meetings
from swarm.protocol.fields import Point
from swarm.protocol.messages import MissionConfig
from swarm.protocol.registers import Replica
from swarm.protocol.uav_messages import Claim
from swarm.separation.straight_pieces import still_ahead
from swarm.separation.tactical_motion import STEP_S
from swarm.separation.tactical_rules import rules_of
from swarm.separation.tactical_traffic import (
    Grade,
    NearbyTrack,
    Precedence,
    TrafficRules,
    TrafficWord,
)

_AS_ANY = Precedence(Grade.FLYING, 0)
"""Who gives way to whom is no part of the prediction."""
_STANDS_M_S = 0.3
"""Who is slower than that stands."""


@dataclass(frozen=True, slots=True)
class PredictedConflict:
    """Two UAVs that would come nearer to each other than they are to keep apart."""

    uavs: tuple[str, str]
    in_s: float
    """When they would be nearest, from now [s of mission]."""
    distance_m: float
    """How near."""
    places_enu_m: tuple[Point, Point]
    """Where [m; mission origin]."""

    def as_json(self) -> dict[str, object]:
        """Ready for `json.dumps`."""
        return {
            "uavs": list(self.uavs),
            "in_s": self.in_s,
            "distance_m": self.distance_m,
            "places_enu_m": [list(place) for place in self.places_enu_m],
        }


class ConflictForecast:
    """Of one fleet, by the distance that its brief asks for."""

    def __init__(self) -> None:
        self._brief: MissionConfig | None = None
        self._rules: TrafficRules | None = None

    def conflicts(
        self, replica: Replica, flying: Mapping[str, Fix], at_s: float
    ) -> tuple[PredictedConflict, ...]:
        """As `predicted_conflicts` finds them; none where no distance is to be kept."""
        brief = replica.brief
        if brief is not self._brief:
            self._brief, self._rules = brief, None if brief is None else rules_of(brief)
        if self._rules is None:
            return ()
        return predicted_conflicts(flying, replica.claims, at_s, self._rules)


def predicted_conflicts(
    flying: Mapping[str, Fix], claims: Mapping[str, Claim], at_s: float, rules: TrafficRules
) -> tuple[PredictedConflict, ...]:
    """All within the time that UAVs look ahead, the soonest first.

    Args:
        flying: who is in flight, and where it was when it told that last.
        claims: what each is about.
        at_s: now, in the time of ``flying``.
        rules: by what UAVs keep apart.
    """
    names = sorted(flying)
    ages_s = [max(0.0, at_s - flying[uav].at_s) for uav in names]
    spans_s = [age_s + rules.horizon_s + STEP_S for age_s in ages_s]
    words = [
        _word(flying[uav], claims.get(uav), span_s)
        for uav, span_s in zip(names, spans_s, strict=True)
    ]
    ones, others = _within_reach(words, spans_s, rules.separation_m)
    if not ones.size:
        return ()
    row_of: dict[int, int] = {}
    motions: list[npt.NDArray[np.float64]] = []
    for number in np.union1d(ones, others).tolist():
        row_of[number] = len(motions)
        track = NearbyTrack(words[number], at_s, ages_s[number])
        motions.append(track.expected_m(at_s, rules))
    motions_m = np.stack(motions)
    rows = np.array([[row_of[n] for n in pair] for pair in np.stack([ones, others], 1).tolist()])
    distance_m, when = meetings(motions_m[rows[:, 0]], motions_m[rows[:, 1]])
    found = []
    for pair in np.flatnonzero(distance_m < rules.separation_m).tolist():
        one, other = rows[pair].tolist()
        sample = float(when[pair])
        places = _place(motions_m[one], sample), _place(motions_m[other], sample)
        uavs = names[ones[pair]], names[others[pair]]
        in_s = STEP_S * sample
        found.append(PredictedConflict(uavs, in_s, float(distance_m[pair]), places))
    return tuple(sorted(found, key=lambda each: (each.in_s, each.uavs)))


def _word(fix: Fix, claim: Claim | None, ahead_s: float) -> TrafficWord:
    """What a UAV would tell of itself if it went on as it does: along its way, or else straight."""
    place, velocity_m_s = fix.place_enu_m, fix.velocity_enu_m_s or (0.0, 0.0, 0.0)
    speed_m_s = math.hypot(*velocity_m_s)
    path_m: tuple[Point, ...] = ()
    if speed_m_s >= _STANDS_M_S:
        way = None if claim is None else claim.way
        if way is not None and way.flies:
            path_m = still_ahead(way.path_enu_m, place)[1:]
        if not path_m or (len(path_m) == 1 and _leads_away(place, velocity_m_s, path_m[0])):
            # As when it lands, or comes home by itself.
            east_m, north_m, up_m = (
                at + ahead_s * each for at, each in zip(place, velocity_m_s, strict=True)
            )
            path_m = ((east_m, north_m, up_m),)
    return TrafficWord(place, velocity_m_s, path_m, speed_m_s, _AS_ANY)


def _leads_away(place: Point, velocity_m_s: Point, end: Point) -> bool:
    """Whether one flies away from the end of its way."""
    return sum(v * (b - a) for v, a, b in zip(velocity_m_s, place, end, strict=True)) < 0.0


def _within_reach(
    words: list[TrafficWord], spans_s: list[float], separation_m: float
) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    """Pairs that may come that near in these times: nobody becomes faster."""
    places_m = np.array([word.position_enu_m for word in words]).reshape(-1, 3)
    flown_m = np.array(spans_s) * [word.speed_m_s for word in words]
    near_m = flown_m[:, None] + flown_m[None] + separation_m
    between_m = places_m[:, None] - places_m[None]
    near = np.einsum("ijk,ijk->ij", between_m, between_m) <= near_m * near_m
    ones, others = np.nonzero(np.triu(near, 1))
    return ones, others


def _place(motion_m: npt.NDArray[np.float64], sample: float) -> Point:
    """Where one is at that moment of its motion, evenly between two samples."""
    before = min(int(sample), len(motion_m) - 2)
    share = sample - before
    east_m, north_m, up_m = (
        (1.0 - share) * motion_m[before] + share * motion_m[before + 1]
    ).tolist()
    return east_m, north_m, up_m
