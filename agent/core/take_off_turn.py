"""When one UAV may take off among others that start or fly beside it.

Those who start nearer to each other than they may fly do so one after the other, the one with the
highest layer first: so nobody climbs through another one's layer. And nobody climbs where somebody
is heard to fly. Leaves out: the checks before, which all vehicles go through at once.
"""

from __future__ import annotations

import math

from agent.core.context import AgentContext, AgentPart
from swarm.kernels.motions import least_distance_m
from swarm.protocol.fields import Point
from swarm.protocol.messages import UavSpec
from swarm.separation.tactical_motion import column_m
from swarm.separation.tactical_traffic import TrafficPicture, TrafficRules

ORDER_S = 60.0
"""So long a UAV waits at most for those that are to take off before it: one may never be ready."""
_APART_S = 10.0
_ROOM_M = 0.5
_UP_M = 2.0
"""Who is no farther below its layer has reached it."""


class TakeOffTurn(AgentPart):
    """Whose turn it is, as far as it concerns one UAV."""

    def __init__(self, context: AgentContext) -> None:
        super().__init__(context)
        self._top_enu_m: Point | None = None
        self._since_s = 0.0
        self._is_first = False

    @property
    def is_awaited(self) -> bool:
        """Whether it stands on the ground, and has not been let go yet."""
        return self._top_enu_m is not None

    def begin(self, top_enu_m: Point, *, first: bool) -> None:
        """It is to climb to there, from its start (``first``) or from a base."""
        self._top_enu_m, self._is_first = top_enu_m, first
        self._since_s = self._mission_view.now_s

    def end(self) -> None:
        """It has been let go, or is not to take off any more."""
        self._top_enu_m = None

    def goes_before(
        self, place_enu_m: Point, picture: TrafficPicture, rules: TrafficRules, now_s: float
    ) -> str | None:
        """For whom it has to wait; None: it may take off.

        Args:
            place_enu_m: where it stands [m].
            picture: who is heard to fly near it.
            rules: of the fleet.
            now_s: now, on the own clock.
        """
        top_enu_m = self._top_enu_m
        if top_enu_m is None:
            return None
        there = who_is_in(place_enu_m, top_enu_m[2], picture, rules, now_s)
        if there is not None or not self._is_first:
            return there
        before = self._to_start_before(picture, rules)
        # Those who have waited in vain do not all start at once.
        waits_s = ORDER_S + _APART_S * len(before)
        return before[0] if before and now_s - self._since_s < waits_s else None

    def _to_start_before(self, picture: TrafficPicture, rules: TrafficRules) -> list[str]:
        """Who starts beside it, has a higher layer, and is there but not up there yet."""
        found: list[str] = []
        brief, me = self._replica.brief, self._mission_view.me
        if brief is None or me is None:
            return found
        present = self._peers.membership.present
        for each in brief.uavs:
            beside_m = math.dist(each.position_enu_m[:2], me.position_enu_m[:2])
            if each.id == self._uav or beside_m >= rules.apart_m or each.id not in present:
                continue
            place_enu_m = picture.place_of(each.id)
            up_m = -math.inf if place_enu_m is None else place_enu_m[2]
            is_up = up_m >= each.position_enu_m[2] + each.layer_m - _UP_M
            if _order(each) < _order(me) and not is_up and each.id not in self._replica.claims:
                found.append(each.id)
        return found


def who_is_in(
    place_enu_m: Point, end_up_m: float, picture: TrafficPicture, rules: TrafficRules, now_s: float
) -> str | None:
    """Who is too near to what a UAV would climb or come down through; None: nobody."""
    through_m = column_m(place_enu_m, end_up_m)
    for uav, track in picture.near(place_enu_m, now_s):
        # Where they have said: those who hover a layer above must not count as lower.
        stops_m, _ = track.stops_m(now_s, rules)
        if least_distance_m(through_m, stops_m) < rules.separation_m + _ROOM_M:
            return uav
    return None


def _order(uav: UavSpec) -> tuple[float, str]:
    """The highest first."""
    return -(uav.position_enu_m[2] + uav.layer_m), uav.id
