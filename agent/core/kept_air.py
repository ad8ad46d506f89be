"""What air one UAV keeps for its fleet: seats that it has taken over, and what it has granted.

Leaves out: who sits where, and what may be granted (swarm.separation.shared_air).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import replace

from swarm.model.ids import COORDINATOR
from swarm.protocol.uav_messages import Claim, ClaimedWay
from swarm.separation.shared_air import SharedAir


class KeptAir:
    """The air that ``uav`` keeps, as it says with its own way.

    Args:
        uav: who keeps it.
        again_s: after how long it tells once more who was granted something, and still asks [s].
    """

    def __init__(self, uav: str, again_s: float) -> None:
        self._uav = uav
        self._again_s = again_s
        self.tell_again_at_s: float | None = None
        """When it is to look whether somebody has not heard what it was granted."""
        self._grants: dict[str, int] = {}
        self._looked_at: dict[str, int] = {}
        """What it had granted when it looked last, in this life."""
        self._seats: tuple[int, ...] = ()
        """Those that it has taken over."""
        self._sits = True
        self._told: ClaimedWay | None = None
        self._made_of: tuple[object, ...] = ()

    @property
    def any(self) -> bool:
        """Whether it sits anywhere, or has granted anything."""
        return self._sits or bool(self._grants)

    def recall(self, way: ClaimedWay) -> None:
        """An earlier life of its agent said so."""
        self._grants, self._seats = dict(way.grants), way.keeps

    def told(self, way: ClaimedWay) -> ClaimedWay:
        """Its own ``way`` with what it grants: the same object as long as nothing changes."""
        made_of = way, self._grants, self._seats
        if self._told is None or made_of != self._made_of:  # most words are about something else
            self._made_of = made_of
            self._told = replace(way, grants=dict(self._grants), keeps=self._seats)
        return self._told

    def look(
        self,
        air: SharedAir,
        claims: Callable[[], Mapping[str, Claim]],
        heard: Collection[str],
        expired: Collection[str],
        now_s: float,
    ) -> None:
        """Grant what is asked for and free.

        Args:
            air: of the mission.
            claims: gives the newest known of everyone, its own as it is about to be said.
            heard: who is there to make requests.
            expired: who is not in the air any more, whatever it said.
            now_s: now [s].
        """
        self._seats = air.inherited(self._uav, claims(), heard, expired)
        self._grants = air.granted(self._uav, claims(), heard, expired)
        self._sits = bool(air.stacks_of(self._uav, claims(), expired))
        if not self._grants.items() <= self._looked_at.items():
            self.tell_again_at_s = now_s + self._again_s
        self._looked_at = self._grants

    def told_to(
        self,
        said: Claim,
        air: SharedAir,
        claims: Callable[[], Mapping[str, Claim]],
        expired: Collection[str],
        now_s: float,
    ) -> tuple[Claim, list[str]] | None:
        """What was ``said`` with what it has granted since, and who is to be told that at once.

        These are who was granted it, and, should this UAV forget it, who can tell it so: who keeps
        the same air, and the coordinator, which newcomers ask. None: nothing is new to them.

        Args:
            said: the own claim as it was said last.
            air: of the mission.
            claims: gives the newest known of everyone, the own one as it is about to be said.
            expired: who is not in the air any more, whatever it said.
            now_s: now [s].
        """
        way = said.way
        if way is None:
            return None
        new = {uav for uav, number in self._grants.items() if way.grants.get(uav) != number}
        if new:
            to = {*new, *air.beside(self._uav, claims(), expired), COORDINATOR}
        elif self.tell_again_at_s is not None and self.tell_again_at_s <= now_s:
            to = {uav for uav in self._grants if self._waits(air.way(uav, claims()), uav)}
            self.tell_again_at_s = now_s + self._again_s if to - {self._uav} else None
        else:
            return None
        to.discard(self._uav)
        if new:
            said = replace(said, way=replace(way, grants=dict(self._grants)))
        return (said, sorted(to)) if new or to else None

    def _waits(self, way: ClaimedWay, uav: str) -> bool:
        """Whether ``uav`` asks for just what it was granted, as far as is known."""
        return not way.flies and way.number == self._grants[uav]
