"""Whom a UAV has heard near it, and whether any of them is a reason to fly otherwise than it does.

What the answers mean is defined in `swarm.separation.tactical` and `tactical_look`; see
`swarm.kernels.traffic.cpp`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple, dataclass

from swarm.kernels import _kernels
from swarm.kernels.motions import Vector

PrecedenceNumbers = tuple[int, int, int]
"""Grade, rank and depth; the smaller goes first."""


@dataclass(frozen=True, slots=True)
class TrafficNumbers:
    """Of a fleet and of how it is looked ahead; named as in `swarm.separation.tactical_traffic`."""

    separation_m: float
    apart_m: float
    reach_m: float
    fastest_m_s: float
    acceleration_m_s2: float
    climb_m_s: float
    reaction_s: float
    tick_s: float
    beacon_s: float
    horizon_s: float
    step_s: float
    silent_s: float
    forget_s: float
    grid_m: float
    wide_m: float
    slack_m: float
    stands_m: float
    most_column_m: float
    column_step_m: float


class TrafficTable:
    """The last words of those near one UAV, each under a number.

    Raises:
        ValueError: a number, here or below, is not finite, or makes no sense.
    """

    def __init__(self, numbers: TrafficNumbers) -> None:
        self._table = _kernels.TrafficTable(astuple(numbers))

    def hear(
        self,
        number: int,
        place_m: Vector,
        velocity_m_s: Vector,
        path_m: Sequence[Vector],
        speed_m_s: float,
        said_s: float,
        precedence: PrecedenceNumbers,
    ) -> None:
        """One says so of itself, as of ``said_s`` on the own clock."""
        self._table.hear(number, place_m, velocity_m_s, path_m, speed_m_s, said_s, precedence)

    def forget(self, number: int) -> None:
        """It counts no longer."""
        self._table.forget(number)

    def look(
        self,
        place_m: Vector,
        velocity_m_s: Vector,
        path_m: Sequence[Vector],
        speed_m_s: float,
        now_s: float,
        precedence: PrecedenceNumbers,
    ) -> tuple[bool, bool, bool]:
        """What there is to a UAV that flies so.

        Returns:
            Whether anybody matters; whether one of them has been silent, or somebody is to be
            forgotten, and nothing else is known therefore; whether somebody may be in the way or
            bar it. If not, nobody is and does.
        """
        return self._table.look(place_m, velocity_m_s, path_m, speed_m_s, now_s, precedence)

    def free_s(
        self,
        place_m: Vector,
        velocity_m_s: Vector,
        path_m: Sequence[Vector],
        speed_m_s: float,
        now_s: float,
        *,
        gives_way: bool,
    ) -> tuple[float, bool]:
        """For how long nobody is close, and whether that is not known, as of `look`."""
        flown = place_m, velocity_m_s, path_m, speed_m_s
        return self._table.free_s(*flown, now_s, gives_way)
