"""What studies infer: means, paired differences, ratios of paired means and shares, each with an
interval that covers the truth in 95 % of studies.

All but shares stand on Student's t: exact for normal values, and good for the averages of many
trials of any kind. Sums are exactly rounded, so no result depends on the order of the trials.
Leaves out: corrections for many comparisons at once; each interval speaks for itself.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

_CONFIDENCE = 0.95
_TAIL = 0.5 + 0.5 * _CONFIDENCE

_Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Estimate:
    """A figure with its 95 % interval."""

    value: float
    """NaN where it is undefined."""
    low: float
    """Minus infinity where the trials say nothing of it."""
    high: float
    """Infinity where the trials say nothing of it."""
    n: int
    """Trials, or pairs of them, that it stands on."""

    @property
    def half_width(self) -> float:
        """From the value to the further end."""
        return max(self.high - self.value, self.value - self.low)

    def as_json(self) -> dict[str, float | int | None]:
        """Ready for `json.dumps`; None for what is not finite."""
        value, low, high = (
            figure if math.isfinite(figure) else None
            for figure in (self.value, self.low, self.high)
        )
        return {"value": value, "low_95": low, "high_95": high, "n": self.n}


def mean_of(values: Sequence[float] | _Array) -> Estimate:
    """Mean of independent values, by Student's t.

    Args:
        values: (n,), n >= 1; one value has no interval.

    Raises:
        ValueError: there are none, or one is not finite.
    """
    xs = _checked(values)
    n, middle = len(xs), _mean(xs)
    if n == 1:
        return Estimate(middle, -math.inf, math.inf, n)
    half = _t(n) * math.sqrt(_moment(xs - middle, xs - middle) / n)
    return Estimate(middle, middle - half, middle + half, n)


def difference_of(ours: Sequence[float] | _Array, theirs: Sequence[float] | _Array) -> Estimate:
    """Mean of ours − theirs, pair by pair: Student's t on the differences; see `ratio_of`."""
    ys, xs = _pairs(ours, theirs)
    return mean_of(ys - xs)


def ratio_of(ours: Sequence[float] | _Array, theirs: Sequence[float] | _Array) -> Estimate:
    """Mean of ours / mean of theirs, from pairs, with Fieller's interval.

    It holds every ratio ρ for which the mean of ours − ρ·theirs does not differ from 0 by Student's
    t (Fieller 1954, doi:10.1111/j.2517-6161.1954.tb00159.x), which heeds how pairs vary together
    and is exact for normal pairs. Where theirs might have mean 0 this set is unbounded, and the
    interval given is everything. Ours equal to theirs in every pair is a ratio of exactly 1; any
    other where the mean of theirs is 0 is undefined.

    Args:
        ours: (n,), n >= 1.
        theirs: (n,) of the same trials in the same order.

    Raises:
        ValueError: there are none, one is not finite, or they are not as many.
    """
    ys, xs = _pairs(ours, theirs)
    n = len(xs)
    below = _mean(xs)
    same = bool(np.array_equal(ys, xs))
    if below == 0.0 and not same:
        return Estimate(math.nan, -math.inf, math.inf, n)
    ratio = 1.0 if same else _mean(ys) / below
    if n == 1:
        return Estimate(ratio, -math.inf, math.inf, n)
    # Fieller's quadratic in δ = ρ − ratio: a δ² + 2b δ − c <= 0, with c and b built from what is
    # left of ours, so that nothing cancels where it follows theirs closely
    left, spread = ys - ratio * xs, xs - below
    left = left - _mean(left)
    scale = _t(n) ** 2 / n
    a = below**2 - scale * _moment(spread, spread)
    b = scale * _moment(left, spread)
    c = scale * _moment(left, left)
    if c == 0.0:  # ours is the same multiple of theirs in every pair
        return Estimate(ratio, ratio, ratio, n)
    if a <= 0.0:
        return Estimate(ratio, -math.inf, math.inf, n)
    root = math.sqrt(b**2 + a * c)
    return Estimate(ratio, ratio - (b + root) / a, ratio + (root - b) / a, n)


def share_of(hits: int, n: int) -> Estimate:
    """Share of independent trials in which something happened, with Wilson's score interval.

    It keeps within 0..1, is no point at its ends, and covers at its nominal rate on average over
    shares (Wilson 1927, doi:10.1080/01621459.1927.10502953; Brown, Cai and DasGupta 2001,
    doi:10.1214/ss/1009213286).

    Raises:
        ValueError: there are no trials, or hits are not within 0..n.
    """
    if n < 1 or not 0 <= hits <= n:
        raise ValueError(f"hits must be within 0..n and n >= 1, not {hits} of {n}")
    from scipy.special import ndtri

    z = float(ndtri(_TAIL))
    share = hits / n
    middle = (share + z**2 / (2 * n)) / (1 + z**2 / n)
    half = z / (1 + z**2 / n) * math.sqrt(share * (1 - share) / n + z**2 / (4 * n**2))
    low = 0.0 if hits == 0 else middle - half
    high = 1.0 if hits == n else middle + half
    return Estimate(share, low, high, n)


def _t(n: int) -> float:
    """Quantile of Student's t for n >= 2 values."""
    from scipy.special import stdtrit

    return float(stdtrit(n - 1, _TAIL))


def _mean(values: _Array) -> float:
    """Exactly summed, and not outside the values by rounding."""
    mean = math.fsum(values) / len(values)
    return float(min(max(mean, values.min()), values.max()))


def _moment(xs: _Array, ys: _Array) -> float:
    """Covariance of two or more deviations from their means."""
    return math.fsum(xs * ys) / (len(xs) - 1)


def _pairs(
    ours: Sequence[float] | _Array, theirs: Sequence[float] | _Array
) -> tuple[_Array, _Array]:
    ys, xs = _checked(ours), _checked(theirs)
    if len(ys) != len(xs):
        raise ValueError(f"pairs must be complete, not {len(ys)} and {len(xs)} values")
    return ys, xs


def _checked(values: Sequence[float] | _Array) -> _Array:
    array = np.asarray(values, dtype=np.float64)
    if array.ndim != 1 or array.size == 0 or not np.isfinite(array).all():
        raise ValueError(f"values must be finite, one or more, in a row, not {values!r}")
    return array
