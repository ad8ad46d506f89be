"""What one UAV knows of the air that its fleet shares, and which ways it could ask for.

Leaves out: asking, granting and setting off (agent.core.airway).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import accumulate, pairwise

import numpy as np

from agent.core.interface import GoTo, Return
from agent.core.mission_view import MissionView, Peers
from swarm.protocol.fields import Point
from swarm.protocol.messages import MissionConfig
from swarm.protocol.operator_commands import zones_in_force
from swarm.protocol.registers import Replica
from swarm.protocol.uav_messages import MOST_CORNERS, BaseStage, Claim, ClaimedWay, ClaimPhase
from swarm.separation.shared_air import SharedAir, air_of_brief, is_home, strength
from swarm.separation.shifted import length_m, shifted_path
from swarm.separation.slabs import nearest_m, planned_apart_m

ENDLESS_S = 1800.0
"""How long the way of a lost UAV stays taken whose battery has no end, or is changed [s]."""
LAST_RESORT_S = 300.0
"""How long one that is to come home waits for a way before it comes without [s]."""
_OF_RESERVE = 0.25
"""Share of the reserve that a wait for the way home may use up."""
_ASIDE_M = (1.5, 3.0, 6.0, 12.0)
"""How far somebody steps aside, in separations."""
_DIRECTIONS = 8
_BESIDE_M = 0.1
"""Who is farther from a place, seen from above, is beside it."""


@dataclass(slots=True)
class Wish:
    """An order that waits for its way."""

    order: GoTo | Return
    since_s: float
    corners_enu_m: tuple[Point, ...]
    """In the own layer, from where the UAV is to where the order ends [m]."""
    own_height: bool = False
    """The height of its end is the task's."""
    fixed: bool = False
    """All of it is flown at the heights that it has."""
    out_of_layer: bool = False
    """It begins at the height of a task."""
    takes_s: float | None = None
    """How long its way takes, as reckoned [s]; None: nobody has said."""
    retry_at_s: float = -math.inf
    asked: bool = False
    """Whether the own claim asks for it."""
    yielded: set[tuple[str, int]] = field(default_factory=set)
    """Requests of others to which it has given way."""

    @property
    def climbs(self) -> bool:
        """Whether it leads from the layer, or to it."""
        return (self.out_of_layer or self.own_height) and not self.fixed

    @property
    def end_enu_m(self) -> Point | None:
        """Where it ends if that keeps its height [m]."""
        return self.corners_enu_m[-1] if self.own_height else None


class FleetAir:
    """The air of the brief in force, in the eyes of the agent of ``uav``."""

    def __init__(self, uav: str, replica: Replica, mission_view: MissionView, peers: Peers) -> None:
        self._uav = uav
        self._replica = replica
        self._mission_view = mission_view
        self._peers = peers
        self._brief: MissionConfig | None = None
        self._air: SharedAir | None = None
        self._lost_s: dict[str, float] = {}
        """Who is lost, and since when [s mission time]."""

    @property
    def shared(self) -> SharedAir | None:
        """None where nobody keeps apart, or this UAV is not in the brief."""
        brief = self._replica.brief
        if brief is not self._brief:
            self._brief = brief
            self._air = None if brief is None else air_of_brief(brief)
        return self._air if self._mission_view.me is not None else None

    def ways(
        self, air: SharedAir, wish: Wish, now_shift_m: float, *, aside: bool
    ) -> Iterator[tuple[float, tuple[Point, ...]]]:
        """Shifts and corners of ways to what is wished, those that are nearest first.

        Args:
            air: in which.
            wish: what is to be flown.
            now_shift_m: how much higher than its own layer the UAV is.
            aside: it is to make room, wherever that leads.
        """
        me = self._mission_view.me
        if me is None:
            return
        shifts_m = [layer_m - me.layer_m for layer_m in air.slabs.layers_m]
        shifts_m.sort(key=lambda shift_m: abs(shift_m - now_shift_m))
        if wish.fixed:
            shifts_m = [0.0]
        if not aside and wish.climbs:  # straight, or in a layer between two climbs
            yield 0.0, wish.corners_enu_m
            level = self._in_layer(wish, me.layer_m)
            yield from ((shift_m, level) for shift_m in shifts_m)
            return
        if not aside:
            yield from ((shift_m, wish.corners_enu_m) for shift_m in shifts_m)
            return
        (east_m, north_m, up_m), *_ = wish.corners_enu_m
        others_m = [shift_m for shift_m in shifts_m if abs(shift_m - now_shift_m) > 1e-6]
        yield from ((shift_m, wish.corners_enu_m[:1]) for shift_m in others_m)
        if self._brief is not None and self._brief.terrain is not None:
            return
        for away in _ASIDE_M:
            for turn in range(_DIRECTIONS):
                angle, away_m = 2.0 * math.pi * turn / _DIRECTIONS, away * air.slabs.separation_m
                there = east_m + away_m * math.cos(angle), north_m + away_m * math.sin(angle), up_m
                if self._is_clear(wish.corners_enu_m[0], there):
                    yield from ((shift_m, (wish.corners_enu_m[0], there)) for shift_m in shifts_m)

    def begin_at(self, wish: Wish, place_enu_m: Point) -> None:
        """The UAV, which has made room, waits there for its way [m; in its own layer].

        Round the same corners if nothing is between it and the first of them, else it goes back.
        """
        here, *rest = wish.corners_enu_m
        if math.dist(here[:2], place_enu_m[:2]) < _BESIDE_M:
            return
        back = wish.fixed or not rest or not self._is_clear(place_enu_m, rest[0])
        wish.corners_enu_m = (place_enu_m, *([here] if back else []), *rest)

    def _is_clear(self, begin_enu_m: Point, end_enu_m: Point) -> bool:
        """Whether no zone is between the two, at whatever height."""
        if not zones_in_force(self._replica):
            return True
        problem = self._mission_view.board.field_problem
        network = None if problem is None else problem.network
        return network is not None and network.is_clear(begin_enu_m, end_enu_m)

    def emptiest_way(
        self, air: SharedAir, wish: Wish, here: ClaimedWay, claims: Mapping[str, Claim]
    ) -> tuple[float, tuple[Point, ...]]:
        """Shift and path of the way home that keeps farthest from all that others take.

        Above the highest layer only where none below keeps a separation.
        """
        expired = self.expired()
        taken = [
            path
            for uav in claims
            if uav != self._uav and uav not in expired
            for path in (air.wanted(uav, air.way(uav, claims)),)
            if len(path)
        ]
        ways = list(self.ways(air, wish, here.shift_m, aside=False))
        step_m = planned_apart_m(air.slabs.separation_m)
        higher_m = max(shift_m for shift_m, _ in ways) + step_m
        if not wish.fixed:
            ways += [(higher_m, ways[-1][1]), (higher_m + step_m, ways[-1][1])]
        best: tuple[float, float, tuple[Point, ...]] | None = None
        for shift_m, corners in ways:
            path = shifted_path(here.path_enu_m[0], corners, shift_m, wish.end_enu_m)
            mine = np.array(path)
            near_m = min((nearest_m(mine, other, 0.5) for other in taken), default=math.inf)
            room_m = min(near_m, air.slabs.separation_m + 0.5)
            if len(path) <= MOST_CORNERS and (best is None or room_m > best[0]):
                best = room_m, shift_m, path
        return (0.0, here.path_enu_m) if best is None else best[1:]

    def must_go(self, wish: Wish, sortie_end_s: float, retry_s: float) -> bool:
        """Whether it would fall if it waited any longer: none of the reserve is left for that.

        Args:
            wish: for a way home.
            sortie_end_s: by when it must have landed, its reserve kept [s mission time].
            retry_s: how long it takes until it looks again [s].
        """
        me = self._mission_view.me
        if me is None or me.endurance_s is None or math.isinf(sortie_end_s):
            return self._mission_view.now_s - wish.since_s > LAST_RESORT_S
        way_s = wish.takes_s
        if way_s is None:
            way_s = length_m(wish.corners_enu_m) / me.speed_m_s
        falls_s = sortie_end_s + _OF_RESERVE * me.reserve_frac * me.endurance_s
        return self._mission_s + way_s + retry_s > falls_s

    def standing(self) -> tuple[str, BaseStage] | None:
        """Base and stage of who stands there, by its own last word."""
        claim = self._replica.claims.get(self._uav)
        stands = claim is not None and claim.stage in (BaseStage.LANDED, BaseStage.PARKED)
        return (
            (claim.base, claim.stage) if stands and claim and claim.base and claim.stage else None
        )

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
        present = self._peers.membership.present
        for uav in () if self._brief is None else self._brief.uavs:
            if uav.id == self._uav or uav.id in present:
                self._lost_s.pop(uav.id, None)
            else:
                self._lost_s.setdefault(uav.id, self._mission_s)

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
            and self._mission_s - self._lost_s[uav.id]
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

    def reaches(self, uav: str) -> bool:
        """Whether ``uav`` could hear a request."""
        return uav == self._uav or self._peers.membership.is_credible(uav)

    def heard(self) -> set[str]:
        """Whose requests count."""
        return {*self._peers.membership.present, self._uav}

    def heir(self) -> str | None:
        """Who is to keep this UAV's air: somebody who is heard, best one who takes part."""
        claims = self._replica.claims
        by_part: dict[bool, list[str]] = {True: [], False: []}
        fleet = [] if self._brief is None else [uav.id for uav in self._brief.uavs]
        after = 1 + fleet.index(self._uav) if self._uav in fleet else 0
        for uav in (*fleet[after:], *fleet[:after]):
            claim = claims.get(uav)
            heard = uav != self._uav and self.reaches(uav)
            if heard and claim is not None and not is_home(claim):
                by_part[claim.phase is not ClaimPhase.OUT].append(uav)
        return next(iter((*by_part[True], *by_part[False])), None)

    @property
    def _mission_s(self) -> float:
        return self._mission_view.mission_s(self._mission_view.now_s)
