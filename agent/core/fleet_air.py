"""What one UAV knows of the air that its fleet shares, and which ways it could ask for.

Leaves out: asking, granting and setting off (agent.core.airway).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise
from types import MappingProxyType

import numpy as np

from agent.core.interface import GoTo, Prepare, Return
from agent.core.last_departure import LastDeparture
from agent.core.mission_view import MissionView, Peers
from agent.core.own_layer import OwnLayer
from agent.core.wish import Wish
from agent.core.zone_stay import ZoneStay
from swarm.protocol.fields import Point
from swarm.protocol.messages import MissionConfig
from swarm.protocol.operator_commands import zones_in_force
from swarm.protocol.registers import Replica
from swarm.protocol.uav_messages import MOST_CORNERS, Claim, ClaimedWay, ClaimPhase
from swarm.separation.shared_air import SharedAir, air_of_brief, strength
from swarm.separation.shifted import shifted_path
from swarm.separation.slabs import apart
from swarm.separation.straight_pieces import not_flown, thinned
from swarm.separation.taken_ways import is_home
from swarm.separation.way_words import ends_like

STOP_LEG = 0
"""Of orders that are the airway's own; those of the core are numbered from 1."""
ENDLESS_S = 1800.0
"""How long the way of a lost UAV stays taken whose battery has no end, or is changed [s]."""
ASIDE_PATIENCE = 4.0
"""How long a UAV waits for its way aside, in intervals at which it asks anew."""
GIVES_UP_S = 10.0
"""How long a UAV waits for a way to a task before it looks for another task [s]."""
_TURNS = 2
"""Corners that a way in another layer has more than one in the own layer, at most."""
_ASIDE_M = (1.5, 3.0, 6.0, 12.0)
"""How far somebody steps aside, in separations."""
_DIRECTIONS = 8
_SPOT_M = 1.0
"""Who stands no farther from its start, seen from above, stands there [m]."""
_BESIDE_M = 0.1
"""Who is farther from a place, seen from above, is beside it."""


@dataclass(frozen=True, slots=True)
class FoundWay:
    """A way that a UAV could ask for."""

    way: ClaimedWay
    is_free: bool
    """Whether nobody is in its way, not even who only asks."""


class FleetAir:
    """The air of the brief in force, in the eyes of the agent of ``uav``."""

    def __init__(self, uav: str, replica: Replica, mission_view: MissionView, peers: Peers) -> None:
        self._uav = uav
        self._replica = replica
        self._mission_view = mission_view
        self._peers = peers
        self._brief: MissionConfig | None = None
        self._air: SharedAir | None = None
        self._others: frozenset[str] = frozenset()
        self._lost_s: dict[str, float] = {}
        """Who is lost, and since when [s mission time]."""
        self._everyone: Mapping[str, Claim] = {}
        """Claims, as of that version of the replica's."""
        self._everyone_as_of = -1
        self._zone_stay = ZoneStay(uav, replica, mission_view)
        self.last_departure = LastDeparture(mission_view, self._zone_stay)
        self.layer = OwnLayer(replica, mission_view)

    @property
    def shared(self) -> SharedAir | None:
        """None where nobody keeps apart, or this UAV is not in the brief."""
        brief = self._replica.brief
        if brief is not self._brief:
            self._brief = brief
            self._air = None if brief is None else air_of_brief(brief)
            uavs = () if brief is None else brief.uavs
            self._others = frozenset(uav.id for uav in uavs) - {self._uav}
        return self._air if self._mission_view.me is not None else None

    @property
    def hovers_first_enu_m(self) -> tuple[Point, ...]:
        """Where this UAV hovers after its first take-off [m]; none if it is not in the brief."""
        me = self._mission_view.me
        return () if me is None else (self._mission_view.in_layer(me.position_enu_m),)

    @property
    def rises_at_enu_m(self) -> Point | None:
        """Where it comes first when it takes off anew [m]: above its start, or where it stands."""
        me, telemetry = self._mission_view.me, self._mission_view.telemetry
        if me is None:
            return None
        start_enu_m = self._mission_view.in_layer(me.position_enu_m)
        if telemetry is None or math.dist(telemetry.position_enu_m[:2], start_enu_m[:2]) < _SPOT_M:
            return start_enu_m
        return *telemetry.position_enu_m[:2], start_enu_m[2]

    def corners(self, order: GoTo | Return | Prepare, here_enu_m: Point) -> tuple[Point, ...]:
        """Of the way of ``order`` in the own layer, from there [m]."""
        me, corners = self._mission_view.me, [here_enu_m]
        if isinstance(order, Prepare):
            corners.append(order.position_enu_m)
        elif isinstance(order, GoTo):
            corners += [*order.via_enu_m, order.position_enu_m]
        else:
            corners += [*order.path_enu_m, *([] if order.via_enu_m is None else [order.via_enu_m])]
            if not order.land and me is not None:
                corners.append(self._mission_view.in_layer(me.position_enu_m))
        return thinned(corners, MOST_CORNERS - _TURNS)

    def keeps_height(self, order: GoTo | Return | Prepare, end_enu_m: Point) -> bool:
        """Whether ``order`` ends there at that very height, in whatever layer it is flown [m].

        Home, a vehicle goes down to its own layer above its start by itself; and who is to stop
        where it has left its layer stays as high as it is.
        """
        if isinstance(order, GoTo):
            return self.layer.misses(end_enu_m)
        return isinstance(order, Return) and not order.land

    def ways(
        self, air: SharedAir, wish: Wish, now_shift_m: float, *, aside: bool
    ) -> Iterator[tuple[float, tuple[Point, ...]]]:
        """Shifts and corners of ways to what is wished, those that are nearest first.

        Args:
            air: in which.
            wish: what is to be flown.
            now_shift_m: how much higher than its own layer the UAV is.
            aside: it is to make room; wherever that leads, if it has no other corner.
        """
        me = self._mission_view.me
        if me is None:
            return
        shifts_m = [layer_m - me.layer_m for layer_m in air.slabs.layers_m]
        shifts_m.sort(key=lambda shift_m: abs(shift_m - now_shift_m))
        if wish.fixed:
            shifts_m = [0.0]
        aside = aside and len(wish.corners_enu_m) == 1
        if not aside and wish.climbs:  # straight, or in a layer between two climbs
            yield 0.0, wish.corners_enu_m
            level = self._in_layer(wish, me.layer_m)
            yield from ((shift_m, level) for shift_m in shifts_m)
            return
        if not aside:
            yield from ((shift_m, wish.corners_enu_m) for shift_m in shifts_m)
            return
        (east_m, north_m, up_m), *_ = wish.corners_enu_m
        others_m = [
            shift_m
            for shift_m in shifts_m
            if wish.out_of_layer or abs(shift_m - now_shift_m) > 1e-6
        ]
        yield from ((shift_m, wish.corners_enu_m[:1]) for shift_m in others_m)
        if self._brief is not None and self._brief.terrain is not None:
            return
        for away in _ASIDE_M:
            for turn in range(_DIRECTIONS):
                angle, away_m = 2.0 * math.pi * turn / _DIRECTIONS, away * air.slabs.separation_m
                there = east_m + away_m * math.cos(angle), north_m + away_m * math.sin(angle), up_m
                if self._is_clear(wish.corners_enu_m[0], there):
                    yield from ((shift_m, (wish.corners_enu_m[0], there)) for shift_m in shifts_m)

    def way(
        self,
        air: SharedAir,
        wish: Wish,
        here: ClaimedWay,
        claims: Mapping[str, Claim],
        *,
        grounded: bool,
        aside: bool,
    ) -> FoundWay | None:
        """The nearest layer in which nobody is in the way, else one to wait for; None: neither.

        Of those it takes one through few slabs, where it needs few grants and keeps few from going.

        Args:
            air: in which.
            wish: what is to be flown.
            here: where the UAV hovers; no path of one that stands on the ground.
            claims: of everyone, the own one as it is about to be said.
            grounded: it is on the ground, where it may wait.
            aside: it is to make room, wherever that leads.
        """
        expired = self.expired()
        number = max(here.number + 1, round(1e3 * self.mission_s))
        fallback: tuple[int, ClaimedWay] | None = None
        for shift_m, corners in self.ways(air, wish, here.shift_m, aside=aside):
            start = here.path_enu_m[0] if here.path_enu_m else corners[0]
            path = shifted_path(start, corners, shift_m, wish.end_enu_m)
            late = not grounded and not self.last_departure.can_fly(wish, path)
            if late or not self.layer.is_over(path):
                continue
            array = np.array(path)
            if not air.can_grant(array, claims, expired, self.reaches, grounded=grounded):
                continue
            asked = ClaimedWay(number, path, False, grounded, shift_m)
            if air.is_free(self._uav, array, claims, expired, grounded=grounded):
                return FoundWay(asked, is_free=True)
            slabs = len(air.slabs.asked(array, grounded=grounded))
            if fallback is None or slabs < fallback[0]:
                fallback = slabs, asked
        return None if fallback is None else FoundWay(fallback[1], is_free=False)

    def makes_room(self, place_enu_m: Point, *, own_height: bool) -> Wish:
        """What who hovers there, perhaps at the height of a task, wishes to make room [m]."""
        corner, high = place_enu_m, own_height or self.layer.misses(place_enu_m)
        if high:
            corner = self.layer.above(corner)
        aside = GoTo(STOP_LEG, corner)
        return Wish(aside, self._mission_view.now_s, (corner,), out_of_layer=high)

    def begin_at(self, wish: Wish, place_enu_m: Point) -> None:
        """The UAV, which has made room, waits there for its way [m; in its own layer].

        Round the same corners if nothing is between it and the first of them. Else, and where its
        way is work from there on, it goes back.
        """
        here, *rest = wish.corners_enu_m
        if math.dist(here[:2], place_enu_m[:2]) < _BESIDE_M:
            return
        back = wish.fixed or not rest or self._is_along_line(wish)
        back = back or not self._is_clear(place_enu_m, rest[0])
        wish.corners_enu_m = (place_enu_m, *([here] if back else []), *rest)

    def _is_along_line(self, wish: Wish) -> bool:
        """Whether it leads along its task, from one end to the other."""
        task = self._replica.board.get(wish.task or "")
        line = () if task is None else task.path_enu_m
        begins, stops = wish.corners_enu_m[0], wish.corners_enu_m[-1]
        return any(
            math.dist(begins[:2], one[:2]) < _SPOT_M and math.dist(stops[:2], other[:2]) < _BESIDE_M
            for one, other in ([(line[0], line[-1]), (line[-1], line[0])] if line else [])
        )

    def _is_clear(self, begin_enu_m: Point, end_enu_m: Point) -> bool:
        """Whether no zone is between the two, at whatever height."""
        if not zones_in_force(self._replica):
            return True
        problem = self._mission_view.board.field_problem
        network = None if problem is None else problem.network
        return network is not None and network.is_clear(begin_enu_m, end_enu_m)

    def way_out(self, wish: Wish, retry_s: float) -> Wish | None:
        """A wish to leave first the zone in which it waits for a way that leads farther.

        None as long as it has not waited in one until it looks again, ``retry_s`` [s] later, or if
        it could not go on from outside.
        """
        out_m, (here, *rest) = self._zone_stay.out_m(), wish.corners_enu_m
        if out_m is None or wish.fixed or not rest or self._zone_stay.lasts_s(here) < retry_s:
            return None
        there = self.layer.above(out_m)
        is_next = math.dist(there[:2], rest[0][:2]) < _BESIDE_M
        if (len(rest) == 1 and is_next) or not (is_next or self._is_clear(there, rest[0])):
            return None
        order, now_s = GoTo(STOP_LEG, there), self._mission_view.now_s
        return Wish(order, now_s, (here, there), out_of_layer=wish.out_of_layer)

    def _in_layer(self, wish: Wish, layer_m: float) -> tuple[Point, ...]:
        """The corners of a way with its ends in the layer: to be climbed to and left upright.

        Over hills a way to or from a height of a task's own lacks some of the layer, evenly more
        towards that end; what is added brings it nowhere nearer to the ground.
        """
        corners = wish.corners_enu_m
        if self._brief is None or self._brief.terrain is None:
            *between, (east_m, north_m, up_m) = corners
            last = (east_m, north_m, layer_m if wish.own_height else up_m)
            return (*((east_m, north_m, layer_m) for east_m, north_m, _ in between), last)
        along_m = [0.0, *accumulate(math.dist(a[:2], b[:2]) for a, b in pairwise(corners))]
        lack_m = [layer_m * wish.out_of_layer, layer_m * wish.own_height]
        return tuple(
            (east_m, north_m, up_m + lack_m[0] + share * (lack_m[1] - lack_m[0]))
            for (east_m, north_m, up_m), at_m in zip(corners, along_m, strict=True)
            for share in [at_m / along_m[-1] if along_m[-1] > 0.0 else 1.0]
        )

    # -- the others ------------------------------------------------------------------------------

    def note_losses(self) -> None:
        """Remember since when each of the fleet has been lost."""
        lost = self._others - self._peers.membership.present
        if lost != self._lost_s.keys():
            self._lost_s = {uav: self._lost_s.get(uav, self.mission_s) for uav in sorted(lost)}

    def expired(self) -> set[str]:
        """Who was lost so long ago that it can't be in the air any more.

        Where there are bases it may have got another battery since.
        """
        if not self._lost_s or self._brief is None:
            return set()
        endless = bool(self._brief.bases)
        return {
            uav.id
            for uav in self._brief.uavs
            if uav.id in self._lost_s
            and self.mission_s - self._lost_s[uav.id]
            > (ENDLESS_S if endless or uav.endurance_s is None else uav.endurance_s)
        }

    def stronger(
        self, air: SharedAir, wish: Wish, claims: Mapping[str, Claim]
    ) -> tuple[str, int] | None:
        """Who asks for what meets this UAV's request, with more right, and not seen before."""
        mine = air.way(self._uav, claims)
        if mine.flies:
            return None
        path = air.wanted(self._uav, mine)
        own = strength(self._uav, claims)
        for uav in air.in_the_way(self._uav, path, claims, self.expired()):
            asks = uav, air.way(uav, claims).number
            if strength(uav, claims) < own and asks not in wish.yielded:
                return asks
        return None

    def is_in_the_way(
        self, air: SharedAir, here: ClaimedWay, claims: Mapping[str, Claim], *, waits: bool
    ) -> bool:
        """Whether somebody asks for where this UAV hovers; if it ``waits`` itself, with more right.

        Args:
            air: in which.
            here: where it hovers.
            claims: of everyone, the own one as it is about to be said.
            waits: for a way of its own.
        """
        asking = air.in_the_way(self._uav, np.array(here.path_enu_m), claims, self.expired())
        own = strength(self._uav, claims)
        return any(not waits or own >= strength(uav, claims) for uav in asking)

    def left_for_others(
        self, air: SharedAir, way: ClaimedWay, place: Point | None, claims: Mapping[str, Claim]
    ) -> tuple[bool, tuple[Point, ...] | None]:
        """Whether anybody asks for any of the way that it flies, and what is left to be flown.

        Args:
            air: in which.
            way: that it flies.
            place: where it is [m]; None: it has not told.
            claims: of everyone, the own one as it is about to be said.

        Returns:
            None as the second if nobody who asks needs no more than what it has flown of it.
        """
        path = way.path_enu_m
        asking = air.in_the_way(self._uav, np.array(path), claims, self.expired())
        left = path if place is None else not_flown(path, place)
        return bool(asking), left if _helps(air, asking, left, claims) else None

    def can_wait(
        self, air: SharedAir, now: Claim, said: Claim, claims: Mapping[str, Claim]
    ) -> bool:
        """Whether nobody needs to know ``now`` of this UAV's way before its next word.

        That it has set off on what it was granted is told as it holds its task, which is soon; that
        it has come to the end, as soon as somebody asks for what it has flown.

        Args:
            air: in which.
            now: its claim as it is.
            said: its claim as others know it.
            claims: of everyone, the own one as it is about to be said.
        """
        way, known = now.way, said.way
        if way is None or known is None or not ends_like(way, known):
            return False
        if way.flies != known.flies and said.phase is not ClaimPhase.PROPOSED:
            return False
        if len(way.path_enu_m) == len(known.path_enu_m):
            return True
        asking = air.in_the_way(self._uav, np.array(known.path_enu_m), claims, self.expired())
        return not _helps(air, asking, way.path_enu_m, claims)

    def claims_with(self, own: Claim) -> Mapping[str, Claim]:
        """Claims of everyone, the ``own`` one that: the same object as long as none changes."""
        claims, version = self._replica.claims, self._replica.claim_version
        if version != self._everyone_as_of or self._everyone[self._uav] != own:
            self._everyone_as_of = version
            self._everyone = MappingProxyType({**claims, self._uav: own})
        return self._everyone

    def reaches(self, uav: str) -> bool:
        """Whether ``uav`` could hear a request."""
        return uav == self._uav or self._peers.membership.is_credible(uav)

    def heard(self) -> set[str]:
        """Whose requests count."""
        return {*self._peers.membership.present, self._uav}

    def heir(self, air: SharedAir) -> str | None:
        """Who is to keep this UAV's air: somebody who is heard, best one who takes part.

        Of these one with as few seats as can be beside this UAV's, so that the loss of one does not
        shut what three keep.
        """
        claims, expired = self._replica.claims, self.expired()
        fleet = [] if self._brief is None else [uav.id for uav in self._brief.uavs]
        after = 1 + fleet.index(self._uav) if self._uav in fleet else 0
        mine = air.stacks_of(self._uav, claims, expired)
        found: list[tuple[bool, int, int, str]] = []
        for uav in (*fleet[after:], *fleet[:after]):
            claim = claims.get(uav)
            if uav != self._uav and self.reaches(uav) and claim is not None and not is_home(claim):
                beside = len(mine & air.stacks_of(uav, claims, expired))
                found.append((claim.phase is ClaimPhase.OUT, beside, len(found), uav))
        return min(found)[-1] if found else None

    @property
    def mission_s(self) -> float:
        """Mission time of the step that is under way [s]."""
        return self._mission_view.mission_s(self._mission_view.now_s)


def _helps(
    air: SharedAir, asking: Iterable[str], left: Sequence[Point], claims: Mapping[str, Claim]
) -> bool:
    """Whether any of those who ask would meet nothing of what is ``left`` [m] of a way."""
    wanted = (air.wanted(uav, air.way(uav, claims)) for uav in asking)
    return any(apart(air.slabs, np.array(left), each) for each in wanted)
