"""What air one UAV keeps for its fleet: seats that it has taken over, and what it has granted.

Leaves out: who sits where, and what may be granted (swarm.separation.shared_air).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import replace

from swarm.protocol.uav_messages import Claim, ClaimedWay
from swarm.separation.shared_air import SharedAir


class KeptAir:
    """The air that ``uav`` keeps, as it says with its own way."""

    def __init__(self, uav: str) -> None:
        self._uav = uav
        self._grants: dict[str, int] = {}
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
    ) -> None:
        """Grant what is asked for and free.

        Args:
            air: of the mission.
            claims: gives the newest known of everyone, its own as it is about to be said.
            heard: who is there to make requests.
            expired: who is not in the air any more, whatever it said.
        """
        self._seats = air.inherited(self._uav, claims(), heard, expired)
        self._grants = air.granted(self._uav, claims(), heard, expired)
        self._sits = bool(air.stacks_of(self._uav, claims(), expired))
