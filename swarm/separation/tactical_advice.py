"""How a UAV flies by itself, and what it is told to do about those near it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from swarm.separation.tactical_motion import Place
from swarm.separation.tactical_traffic import Precedence


class Maneuver(Enum):
    """What a UAV does about those near it."""

    KEEP = "keep"
    """It flies as it would alone."""
    SLOW = "slow"
    HOLD = "hold"
    OVER = "over"
    """It flies on past another one: higher, lower or, where it can't, round it."""
    ASIDE = "aside"
    """It makes room."""


@dataclass(frozen=True, slots=True)
class OwnFlight:
    """How a UAV flies by itself, and what would be next."""

    position_enu_m: Place
    velocity_enu_m_s: Place
    path_enu_m: tuple[Place, ...]
    """Corners ahead, then where it stops; empty: it hovers where it is, or is about to stop."""
    speed_m_s: float
    """At which it flies that."""
    precedence: Precedence
    """Its own."""
    gives_way: bool = True
    """Whether it may be told otherwise: not while it takes off, lands or returns by itself."""


@dataclass(frozen=True, slots=True)
class Advice:
    """What a UAV is to do until the next decision."""

    maneuver: Maneuver
    path_enu_m: tuple[Place, ...] = ()
    """Of OVER and ASIDE: where to fly instead."""
    speed_m_s: float | None = None
    """Of SLOW."""
    because_of: str | None = None
    """To whom it gives way, or before whom it brakes."""
    braked: bool = False
    """It would go on, and stands until another one has moved."""

    @property
    def stands(self) -> bool:
        """Whether the vehicle is to stop, or stay stopped."""
        return self.braked or self.maneuver is Maneuver.HOLD
