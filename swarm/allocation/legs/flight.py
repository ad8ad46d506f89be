"""How long a UAV flies: straight, along a path, with acceleration and wind.

Leaves out: which path it flies (swarm.allocation.legs.planner).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from swarm.allocation.problem import rest_to_rest_s, straight_m

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class FlightModel:
    """What the times of one kind of UAV follow from.

    A leg of length d at speed v, from rest to rest with acceleration a, takes d/v + v/a if it is
    long enough to reach v (d >= v²/a), else 2·√(d/a); without a, d/v. Corners are flown through.
    Each operation is rounded by itself and in the order written, so that every implementation of
    the same formulas finds the same floats; without acceleration and airspeed those of
    `swarm.allocation.Problem.travel_s`.

    Raises:
        ValueError: names the number that is out of range.
    """

    speed_m_s: float
    """Cruise speed over ground [m/s]; > 0."""
    acceleration_m_s2: float | None = None
    """To and from cruise speed [m/s²]; > 0. None: speeds change at once."""
    airspeed_m_s: float | None = None
    """Greatest speed through the air [m/s]; > 0. None: wind has no effect."""
    wind_enu_m_s: tuple[float, float] = (0.0, 0.0)
    """Steady wind, by where it blows to [m/s; east, north]."""

    def __post_init__(self) -> None:
        for name in ("speed_m_s", "acceleration_m_s2", "airspeed_m_s"):
            number = getattr(self, name)
            if number is None and name != "speed_m_s":
                continue
            if not (math.isfinite(number) and number > 0.0):
                raise ValueError(f"{name} must be > 0, not {number}")
        if len(self.wind_enu_m_s) != 2 or not all(math.isfinite(w) for w in self.wind_enu_m_s):
            raise ValueError(f"wind_enu_m_s must be two finite numbers, not {self.wind_enu_m_s}")

    @property
    def heeds_direction(self) -> bool:
        """Whether a way and the way back may take different times."""
        return self.airspeed_m_s is not None

    def straight_s(self, offset_m: FloatArray) -> FloatArray:
        """(...) times of straight legs with (3, ...) offsets [m; ENU]; inf: it can't [s]."""
        length_m = straight_m(offset_m)
        if not self.heeds_direction:
            return self.rest_to_rest_s(length_m)
        return self.rest_to_rest_s(length_m, self.speed_over_m_s(offset_m, length_m))

    def path_s(self, path_enu_m: FloatArray) -> float:
        """Time along (k, 3) places [m; ENU], from rest at the first to rest at the last [s].

        Pieces in wind differ in speed: the path is flown at length ÷ Σ(piece ÷ its speed).
        """
        offset_m = np.diff(np.asarray(path_enu_m, dtype=np.float64), axis=0).T
        if offset_m.shape[1] == 1:
            return float(self.straight_s(offset_m)[0])
        piece_m = straight_m(offset_m)
        length_m = piece_m.sum()
        if not self.heeds_direction:
            return float(self.rest_to_rest_s(length_m))
        moving = piece_m > 0.0
        speed_m_s = self.speed_over_m_s(offset_m[:, moving], piece_m[moving])
        with np.errstate(divide="ignore"):
            slow_s = (piece_m[moving] / speed_m_s).sum()
        return float(self.even_s(length_m, slow_s))

    def rest_to_rest_s(
        self, length_m: FloatArray, speed_m_s: FloatArray | float | None = None
    ) -> FloatArray:
        """(...) times over (...) lengths [m] at one speed each, by default the cruise speed [s].

        A speed of 0 m/s stands for a direction that can't be flown: inf, unless the length is 0.
        """
        if speed_m_s is None and self.acceleration_m_s2 is None:
            return length_m / self.speed_m_s
        v_m_s = self.speed_m_s if speed_m_s is None else speed_m_s
        a_m_s2 = np.inf if self.acceleration_m_s2 is None else self.acceleration_m_s2
        return rest_to_rest_s(length_m, v_m_s, a_m_s2)

    def even_s(self, length_m: FloatArray, slow_s: FloatArray) -> FloatArray:
        """(...) times over paths of (...) lengths [m], flown evenly [s].

        ``slow_s`` is Σ(piece ÷ its speed) [s]; inf, and so is the time: some piece can't be flown.
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            speed_m_s = np.where(slow_s > 0.0, length_m / slow_s, self.speed_m_s)
        return self.rest_to_rest_s(length_m, speed_m_s)

    def speed_over_m_s(self, offset_m: FloatArray, length_m: FloatArray) -> FloatArray:
        """(...) speeds over ground along (3, ...) offsets of ``length_m`` [m]; 0: can't [m/s].

        With unit direction e and wind w: min(speed, w·e + √(airspeed² − |w − (w·e)·e|²)).
        """
        if self.airspeed_m_s is None:
            return np.full(length_m.shape, self.speed_m_s)
        with np.errstate(divide="ignore", invalid="ignore"):
            east, north, up = (component / length_m for component in offset_m)
            blow_east_m_s, blow_north_m_s = self.wind_enu_m_s
            along_m_s = blow_east_m_s * east + blow_north_m_s * north
            aside_east_m_s = blow_east_m_s - along_m_s * east
            aside_north_m_s = blow_north_m_s - along_m_s * north
            aside_up_m_s = along_m_s * up
            aside_m2_s2 = (
                aside_east_m_s * aside_east_m_s + aside_north_m_s * aside_north_m_s
            ) + aside_up_m_s * aside_up_m_s
            own_m_s = np.sqrt(self.airspeed_m_s * self.airspeed_m_s - aside_m2_s2)
            over_m_s = np.minimum(self.speed_m_s, along_m_s + own_m_s)
        return np.where(over_m_s > 0.0, over_m_s, 0.0)  # nan: more wind across than airspeed
