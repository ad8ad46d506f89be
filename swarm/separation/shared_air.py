"""Who keeps which slab of air, what air is taken, and what a keeper grants.

Each slab of air has three seats, or one, on each of which one UAV of the fleet sits at a time.
Nobody flies anywhere before most of those who sit in each slab that the way leads through have
granted it, and who sits there grants nothing that comes near to what it has granted before and is
not known to be over. Any two majorities share a seat, so ways that are flown are apart whatever is
lost, late or doubled on the bus, and however clocks differ: see README.md.

Leaves out: which way is asked for, and when a vehicle departs (agent.core.airway).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence

from swarm.protocol.messages import MissionConfig
from swarm.protocol.uav_messages import Claim, ClaimedWay, ClaimPhase
from swarm.separation.fleet_layers import slabs_over
from swarm.separation.slabs import Path, Slabs, apart, keeper_seats, planned_apart_m
from swarm.separation.taken_ways import NO_SUCCESSION, Starter, Succession, TakenWays, is_home


class SharedAir:
    """The air of one mission.

    Args:
        slabs: in which it is cut.
        fleet: every UAV of the brief, in its order.
    """

    def __init__(self, slabs: Slabs, fleet: Sequence[Starter]) -> None:
        self.slabs = slabs
        self._ways = TakenWays(fleet, planned_apart_m(slabs.separation_m))
        self._uavs = self._ways.uavs
        self._stacks = slabs.stacks
        rows = keeper_seats(len(self._stacks), len(fleet), level=slabs.level)
        self._first = [self._uavs[row] for each in rows for row in each]
        """By seat, who sits there first."""
        self._stack_of = [stack for stack, each in enumerate(rows) for _ in each]
        self._seats = [
            [seat for seat, its in enumerate(self._stack_of) if its == stack]
            for stack in range(len(rows))
        ]
        self._lined_up: Mapping[str, Succession] | None = None
        """By whose words seats were looked at last."""
        self._lined_up_but: Collection[str] = ()
        """And who was not in the air then."""
        self._lines_now: Sequence[Sequence[str | None]] = ()
        self._holders_now: frozenset[str | None] = frozenset()
        """Who sits anywhere by these: in a large fleet most do not."""

    # -- what is taken -------------------------------------------------------------------

    def way(self, uav: str, claims: Mapping[str, Claim]) -> ClaimedWay:
        """What air ``uav`` takes or asks for, by its last word."""
        return self._ways.way(uav, claims)

    def wanted(self, uav: str, way: ClaimedWay) -> Path:
        """(k, 3) all that ``way`` leads through [m]; k may be 0."""
        return self._ways.wanted(uav, way)

    def taken(self, uav: str, way: ClaimedWay, *, granted: bool) -> Path:
        """(k, 3) where ``uav`` may be [m]: on its way, or where that begins."""
        path = self.wanted(uav, way)
        if way.flies or granted:
            return path
        return path[:0] if way.grounded else path[:1]

    def is_free(
        self,
        uav: str,
        path: Path,
        claims: Mapping[str, Claim],
        expired: Collection[str],
        *,
        grounded: bool = False,
    ) -> bool:
        """Whether ``uav`` would meet nobody there, not even who only asks."""
        asked = self.slabs.asked(path, grounded=grounded)
        for other in self._ways.near(path, claims):
            if other == uav or other in expired:
                continue
            way = self.way(other, claims)
            wanted = self.wanted(other, way)
            if way.flies or grounded or not self._lets_by(uav, path, wanted, claims):
                if not apart(self.slabs, path, wanted, asked):
                    return False
            elif not apart(self.slabs, path, self.taken(other, way, granted=False), asked):
                return False
        return True

    def _lets_by(self, uav: str, path: Path, wanted: Path, claims: Mapping[str, Claim]) -> bool:
        """Whether ``uav`` is in the way where ``path`` begins, and will not be at its end.

        Nor will who lands there for good, wherever that is.
        """
        claim, here, there = claims.get(uav), path[:1], path[-1:]
        lands = claim is not None and claim.phase is ClaimPhase.OUT
        in_the_way = not apart(self.slabs, here, wanted)
        return in_the_way and (lands or apart(self.slabs, there, wanted))

    def concerns(self, uav: str, writer: str, said: Claim, claims: Mapping[str, Claim]) -> bool:
        """Whether ``uav``, which keeps no air, has to think of what ``writer`` says now.

        Else it is neither granted anything by it, nor asked for air that it takes or asks for, nor
        does anything change about who keeps what.

        Args:
            uav: who hears it.
            writer: of the claim.
            said: what it claims.
            claims: newest known of everyone before that.
        """
        before, way = claims.get(writer), said.way
        if before is None or before.way is None or way is None:
            return True
        if ClaimPhase.OUT in (before.phase, said.phase) or way.keeps != before.way.keeps:
            return True
        if way.grants.get(uav) != before.way.grants.get(uav):
            return True
        own = self.way(uav, claims)
        if way.flies or not self._ways.may_meet(uav, own, writer, way):
            return False
        return not apart(self.slabs, self.wanted(uav, own), self.wanted(writer, way))

    # -- who keeps it ----------------------------------------------------------------------

    def holder(
        self, seat: int, claims: Mapping[str, Claim], expired: Collection[str]
    ) -> str | None:
        """Who sits on a seat; None: nobody is left in the air."""
        return self._lines(claims, expired)[seat][-1]

    def stacks_of(
        self, uav: str, claims: Mapping[str, Claim], expired: Collection[str]
    ) -> frozenset[int]:
        """Stacks in which ``uav`` has a seat."""
        lines = self._lines(claims, expired)
        if uav not in self._holders_now:
            return frozenset()
        return frozenset(
            stack for stack, line in zip(self._stack_of, lines, strict=True) if line[-1] == uav
        )

    def beside(
        self, uav: str, claims: Mapping[str, Claim], expired: Collection[str]
    ) -> frozenset[str]:
        """Who else has a seat where ``uav`` has one."""
        lines, mine = self._lines(claims, expired), self.stacks_of(uav, claims, expired)
        holders = {
            line[-1] for stack, line in zip(self._stack_of, lines, strict=True) if stack in mine
        }
        return frozenset(each for each in holders if each is not None and each != uav)

    def _lines(
        self, claims: Mapping[str, Claim], expired: Collection[str]
    ) -> Sequence[Sequence[str | None]]:
        """By seat, all who have sat there, one after the other, up to who does now."""
        self._ways.look_at(claims)
        if self._ways.successions != self._lined_up or set(expired) != self._lined_up_but:
            self._lined_up, self._lined_up_but = dict(self._ways.successions), set(expired)
            told = ((uav, *self._ways.successions.get(uav, NO_SUCCESSION)) for uav in self._uavs)
            keeping = [(uav, keeps) for uav, keeps, home, _ in told if keeps and not home]
            self._lines_now = [
                self._line(
                    first,
                    [uav for uav, keeps in keeping if seat in keeps],
                    claims,
                    expired,
                )
                for seat, first in enumerate(self._first)
            ]
            self._holders_now = frozenset(line[-1] for line in self._lines_now)
        return self._lines_now

    def _line(
        self,
        first: str,
        keeping: Sequence[str],
        claims: Mapping[str, Claim],
        expired: Collection[str],
    ) -> list[str | None]:
        """All who have sat on one seat.

        Who is home for good has named an heir; of who has not, or can't be there any more, it is
        the next one in the brief's order. Who says that it has taken over sits there: it must have
        taken those before for gone.

        Args:
            first: who sat there first.
            keeping: who say that they have taken that seat over, and are not home.
            claims: newest known of everyone.
            expired: who is not in the air any more.
        """
        line: list[str | None] = []
        uav = first
        while True:
            after = next((other for other in keeping if other != uav), None)
            if after is None or after in line:
                if not (uav in expired or is_home(claims.get(uav))):
                    return [*line, uav]
                after = self.way(uav, claims).heir
            line.append(uav)
            if after is None or after in line or after not in self._ways:
                here = self._uavs.index(uav)
                order = [*self._uavs[here + 1 :], *self._uavs[:here]]
                after = next((each for each in order if each not in line), None)
            if after is None:
                return [*line, None]
            uav = after

    def can_grant(
        self,
        path: Path,
        claims: Mapping[str, Claim],
        expired: Collection[str],
        reaches: Callable[[str], bool],
        *,
        grounded: bool = False,
    ) -> bool:
        """Whether enough of those who keep the air of ``path`` could hear a request."""
        lines = self._lines(claims, expired)
        for seats in self._asked_seats(self.slabs.asked(path, grounded=grounded)):
            holders = [lines[seat][-1] for seat in seats]
            heard = sum(holder is not None and reaches(holder) for holder in holders)
            if heard < _majority(len(holders)):
                return False
        return True

    def _asked_seats(self, asked: frozenset[int]) -> Iterator[list[int]]:
        """By stack of which any slab is asked for."""
        for stack, seats in zip(self._stacks, self._seats, strict=True):
            if stack & asked:
                yield seats

    def inherited(
        self,
        uav: str,
        claims: Mapping[str, Claim],
        heard: Collection[str],
        expired: Collection[str],
    ) -> tuple[int, ...]:
        """Seats that ``uav`` has taken over, and may grant by.

        Those of its last word that are still its own, and others once it knows of all that those
        who sat there had granted, and what it has granted itself for other slabs fits in there.
        """
        told, lines = self.way(uav, claims).keeps, self._lines(claims, expired)
        if uav not in self._holders_now:
            return ()
        found = []
        for seat, (*before, now) in enumerate(lines):
            if now != uav or not before:
                continue
            known = all(each and self._is_settled(each, claims, heard, expired) for each in before)
            if seat in told or (
                known and self._fits(uav, self._stacks[self._stack_of[seat]], claims, expired)
            ):
                found.append(seat)
        return tuple(found)

    def _is_settled(
        self,
        keeper: str,
        claims: Mapping[str, Claim],
        heard: Collection[str],
        expired: Collection[str],
    ) -> bool:
        """Whether all requests that it had granted are known, or over.

        What one that is gone has granted is known of those alone who are heard.
        """
        if keeper in expired:
            return all(
                uav in heard or uav in expired or is_home(claims.get(uav)) for uav in self._uavs
            )
        granted = self.way(keeper, claims).grants
        return all(
            uav in expired or uav not in self._ways or self.way(uav, claims).number >= number
            for uav, number in granted.items()
        )

    def _fits(
        self,
        keeper: str,
        within: frozenset[int],
        claims: Mapping[str, Claim],
        expired: Collection[str],
    ) -> bool:
        """Whether requests that ``keeper`` has granted, and that wait, meet nobody in slabs."""
        grants = self._binding(keeper, claims, expired)
        for uav, number in self.way(keeper, claims).grants.items():
            way = None if uav not in self._ways else self.way(uav, claims)
            if way is None or way.flies or way.number != number or uav in expired:
                continue
            path = self.wanted(uav, way)
            others = self._taken_near(path, uav, claims, grants, expired)
            if not all(apart(self.slabs, path, other, within) for other in others):
                return False
        return True

    def _taken_near(
        self,
        path: Path,
        uav: str,
        claims: Mapping[str, Claim],
        grants: Sequence[Mapping[str, int]],
        expired: Collection[str],
    ) -> Iterator[Path]:
        """What others take of the air near ``path``, which ``uav`` asks for."""
        for other in self._ways.near(path, claims):
            if other != uav and other not in expired:
                way = self.way(other, claims)
                granted = any(each.get(other) == way.number for each in grants)
                yield self.taken(other, way, granted=granted)

    def _binding(
        self, keeper: str, claims: Mapping[str, Claim], expired: Collection[str]
    ) -> list[Mapping[str, int]]:
        """What ``keeper`` has granted, and what those did on whose seats it sits, or is to sit."""
        lines = self._lines(claims, expired)
        before = {each for *some, now in lines if now == keeper for each in some if each}
        return [self.way(each, claims).grants for each in (keeper, *sorted(before))]

    # -- what a keeper grants ----------------------------------------------------------------

    def granted(
        self,
        keeper: str,
        claims: Mapping[str, Claim],
        heard: Collection[str],
        expired: Collection[str],
    ) -> dict[str, int]:
        """By UAV the request that ``keeper`` has granted, those of its own claim among them.

        Requests are granted in the order of claims. One that would meet a stronger one waits for
        it, though that waits as well; but not who leaves the place where it is in its way.

        Args:
            keeper: who grants.
            claims: newest known of everyone, its own among them.
            heard: who is there to make requests.
            expired: who is not in the air any more, whatever it said.
        """
        own = self.way(keeper, claims)
        grants = {
            uav: number
            for uav, number in own.grants.items()
            if uav in self._ways and self.way(uav, claims).number <= number
        }
        if any(self.way(uav, claims).number < number for uav, number in grants.items()):
            return grants  # an earlier life has granted what this one has not heard of
        mine, needed = self._sits_in(keeper, claims, heard, self._lines(claims, expired))
        if not needed:
            return grants
        binding = [grants, *self._binding(keeper, claims, expired)]
        waiting: list[Path] = []
        self._ways.look_at(claims)
        for uav in sorted(self._ways.asking, key=lambda each: strength(each, claims)):
            way = self.way(uav, claims)
            if uav not in heard or uav in expired or grants.get(uav) == way.number:
                continue
            path = self.wanted(uav, way)
            asked = self.slabs.asked(path, grounded=way.grounded)
            if not asked & needed:
                continue
            others = self._taken_near(path, uav, claims, binding, expired)
            before_it = (
                other
                for other in waiting
                if way.grounded or not self._lets_by(uav, path, other, claims)
            )
            if all(apart(self.slabs, path, each, asked & mine) for each in (*before_it, *others)):
                grants[uav] = way.number
            else:
                waiting.append(path)
        return grants

    def _sits_in(
        self,
        keeper: str,
        claims: Mapping[str, Claim],
        heard: Collection[str],
        lines: Sequence[Sequence[str | None]],
    ) -> tuple[frozenset[int], frozenset[int]]:
        """Slabs in which ``keeper`` has a seat, and those in which its grant is needed as well.

        On the last seat of a slab it is not as long as all others there are heard.
        """
        mine, needed = set[int](), set[int]()
        if keeper not in self._holders_now:
            return frozenset(), frozenset()
        for stack, seats in zip(self._stacks, self._seats, strict=True):
            sitting = [self._sitting(seat, claims, lines) for seat in seats]
            if keeper in sitting:
                mine |= stack
                first = sitting[: _majority(len(seats))]
                if not all(each in heard and each != keeper for each in first):
                    needed |= stack
        return frozenset(mine), frozenset(needed)

    def _sitting(
        self, seat: int, claims: Mapping[str, Claim], lines: Sequence[Sequence[str | None]]
    ) -> str | None:
        """Whose grants count for that seat: an heir's once it says that it has taken over."""
        holder = lines[seat][-1]
        if holder is None or holder == self._first[seat]:
            return holder
        return holder if seat in self.way(holder, claims).keeps else None

    def is_granted(self, uav: str, claims: Mapping[str, Claim], expired: Collection[str]) -> bool:
        """Whether enough of those who keep the air of ``uav``'s request have granted it.

        Args:
            uav: who asks.
            claims: newest known of everyone, its own as it is about to be said.
            expired: who is not in the air any more.
        """
        way, lines = self.way(uav, claims), self._lines(claims, expired)
        path = self.wanted(uav, way)
        for seats in self._asked_seats(self.slabs.asked(path, grounded=way.grounded)):
            grants = 0
            for seat in seats:
                keeper = self._sitting(seat, claims, lines)
                granted = keeper is not None and self.way(keeper, claims).grants.get(uav)
                grants += granted == way.number
            if grants < _majority(len(seats)):
                return False
        return True

    def in_the_way(
        self, uav: str, here: Path, claims: Mapping[str, Claim], expired: Collection[str]
    ) -> list[str]:
        """Who asks for a way that meets ``uav`` where it is, the strongest first."""
        found = [
            other
            for other in self._ways.asking_near(here, claims)
            if other != uav
            and other not in expired
            and not apart(self.slabs, here, self.wanted(other, self.way(other, claims)))
        ]
        return sorted(found, key=lambda each: strength(each, claims))


def strength(uav: str, claims: Mapping[str, Claim]) -> tuple[bool, float, str]:
    """Sort key of who asks: who is to land or makes room, then who has been free for longest."""
    claim = claims.get(uav)
    if claim is None:
        return False, 0.0, uav
    return claim.task is not None, claim.decided_s, uav


def _majority(seats: int) -> int:
    return seats // 2 + 1


_recent: deque[tuple[MissionConfig, SharedAir]] = deque(maxlen=2)
"""In a simulation all of a fleet have the same brief, and see the same air."""


def air_of_brief(brief: MissionConfig) -> SharedAir | None:
    """The air of the mission that ``brief`` tells of; None if nobody keeps apart there.

    Of the very same brief it is the same air: all that it remembers is what was worked out.
    """
    if brief.separation_m is None or not brief.uavs:
        return None
    for known, air in tuple(_recent):
        if known is brief:
            return air
    air = _air_of(brief, brief.separation_m)
    _recent.append((brief, air))
    return air


def _air_of(brief: MissionConfig, separation_m: float) -> SharedAir:
    lowest_m = min(uav.layer_m for uav in brief.uavs)
    terrain = None if brief.terrain is None else brief.terrain.terrain()
    slabs = slabs_over(terrain, separation_m, len(brief.uavs), brief.band_m, lowest_m)
    fleet = []
    for uav in brief.uavs:
        east_m, north_m, up_m = uav.position_enu_m
        fleet.append(Starter(uav.id, (east_m, north_m, up_m + uav.layer_m)))
    return SharedAir(slabs, fleet)
