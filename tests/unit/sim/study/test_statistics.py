from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy import stats

from sim.study.statistics import Estimate, difference_of, mean_of, ratio_of, share_of

Array = npt.NDArray[np.float64]

REPLICATIONS = 4000
TOLERANCE = stats.binom.interval(0.9999, REPLICATIONS, 0.95)
"""How many of the replications an interval covers that covers in 95 %."""
EVERYTHING = (-math.inf, math.inf)

values = st.floats(-1e6, 1e6).map(lambda value: round(value, 3))
rows = st.integers(2, 12).flatmap(lambda n: arrays(np.float64, n, elements=values))
pairs = st.integers(2, 12).flatmap(lambda n: arrays(np.float64, (2, n), elements=values))


def ends(estimate: Estimate) -> tuple[float, float]:
    return estimate.low, estimate.high


def covered(truth: float, of: Callable[[int], Estimate]) -> int:
    """In how many replications the interval holds ``truth``."""
    found = [of(i) for i in range(REPLICATIONS)]
    return sum(each.low <= truth <= each.high for each in found)


def is_nominal(hits: int) -> bool:
    return bool(TOLERANCE[0] <= hits <= TOLERANCE[1])


def correlated(n: int, seed: int, *, sd: float = 1.0) -> tuple[Array, Array]:
    """(REPLICATIONS, n) normal pairs: theirs of mean 10, ours of mean 9, correlated by 0.8."""
    covariance = sd**2 * np.array([[1.0, 0.8], [0.8, 1.0]])
    rng = np.random.default_rng(seed)
    draws = rng.multivariate_normal((9.0, 10.0), covariance, (REPLICATIONS, n))
    return draws[..., 0], draws[..., 1]


# -- against other implementations ------------------------------------------------------


@settings(max_examples=50)
@given(rows)
def test_mean_has_scipys_t_interval(xs: Array) -> None:
    found = mean_of(xs)

    sem = stats.sem(xs)
    low, high = stats.t.interval(0.95, len(xs) - 1, xs.mean(), sem) if sem else (xs[0], xs[0])
    assert (found.value, found.low, found.high) == pytest.approx(
        (xs.mean(), low, high), rel=1e-9, abs=1e-6
    )


@settings(max_examples=50)
@given(pairs)
def test_difference_has_the_interval_of_scipys_paired_t_test(both: Array) -> None:
    ours, theirs = both
    if np.ptp(ours - theirs) < 1e-3:  # SciPy gives NaN, and warns
        return

    expected = stats.ttest_rel(ours, theirs).confidence_interval(0.95)

    assert ends(difference_of(ours, theirs)) == pytest.approx(tuple(expected), rel=1e-7, abs=1e-5)


def test_ratio_holds_what_the_paired_t_test_does_not_reject() -> None:
    ours, theirs = correlated(15, 1)
    found = ratio_of(ours[0], theirs[0])

    for end in ends(found):  # by definition of Fieller's set
        assert stats.ttest_rel(ours[0], end * theirs[0]).pvalue == pytest.approx(0.05)
    inside = 0.9 * found.low + 0.1 * found.high
    assert stats.ttest_rel(ours[0], inside * theirs[0]).pvalue > 0.05


@settings(max_examples=50)
@given(st.integers(1, 60).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n))))
def test_share_has_scipys_wilson_interval(counts: tuple[int, int]) -> None:
    expected = stats.binomtest(*counts).proportion_ci(method="wilson")

    assert ends(share_of(*counts)) == pytest.approx((expected.low, expected.high), abs=1e-12)


# -- intervals cover at their nominal rate ----------------------------------------------


def test_mean_of_normal_values_is_covered_at_the_nominal_rate() -> None:
    xs = np.random.default_rng(2).normal(3.0, 2.0, (REPLICATIONS, 5))

    assert is_nominal(covered(3.0, lambda i: mean_of(xs[i])))


def test_mean_of_many_skewed_values_is_covered_at_the_nominal_rate() -> None:
    xs = np.random.default_rng(3).exponential(4.0, (REPLICATIONS, 150))

    assert is_nominal(covered(4.0, lambda i: mean_of(xs[i])))


def test_difference_of_correlated_pairs_is_covered_at_the_nominal_rate() -> None:
    ours, theirs = correlated(8, 4)

    assert is_nominal(covered(-1.0, lambda i: difference_of(ours[i], theirs[i])))


@pytest.mark.parametrize("sd", [0.5, 5.0])
def test_ratio_of_correlated_pairs_is_covered_at_the_nominal_rate(sd: float) -> None:
    ours, theirs = correlated(8, 5, sd=sd)

    assert is_nominal(covered(0.9, lambda i: ratio_of(ours[i], theirs[i])))


def test_ratio_of_many_skewed_pairs_is_covered_at_the_nominal_rate() -> None:
    rng = np.random.default_rng(6)
    theirs = rng.exponential(1.0, (REPLICATIONS, 150))
    ours = theirs * rng.lognormal(0.0, 0.3, theirs.shape) * 0.9 / math.exp(0.5 * 0.3**2)

    assert is_nominal(covered(0.9, lambda i: ratio_of(ours[i], theirs[i])))


def test_shares_are_covered_at_the_nominal_rate_on_average() -> None:
    rng = np.random.default_rng(7)
    shares = rng.uniform(0.0, 1.0, REPLICATIONS)
    hits = rng.binomial(50, shares)

    found = [share_of(int(each), 50) for each in hits]

    held = [e.low <= share <= e.high for e, share in zip(found, shares, strict=True)]
    assert is_nominal(sum(held))


def test_pairing_narrows_the_interval_of_policies_that_meet_the_same_luck() -> None:
    ours, theirs = correlated(20, 8)

    paired = ratio_of(ours[0], theirs[0]).half_width

    assert paired < 0.8 * ratio_of(ours[0], theirs[1]).half_width


def test_known_parameters_are_recovered() -> None:
    rng = np.random.default_rng(9)
    theirs = rng.gamma(4.0, 25.0, 100_000)
    ours = 0.8 * theirs + rng.normal(5.0, 10.0, theirs.size)

    assert mean_of(theirs).value == pytest.approx(100.0, rel=0.01)
    assert difference_of(ours, theirs).value == pytest.approx(-15.0, rel=0.01)
    assert ratio_of(ours, theirs).value == pytest.approx(0.85, rel=0.001)
    assert share_of(int((theirs > 100.0).sum()), theirs.size).value == pytest.approx(
        stats.gamma(4.0, scale=25.0).sf(100.0), rel=0.01
    )


# -- exactness and odd cases ------------------------------------------------------------


@settings(max_examples=50)
@given(rows)
def test_policy_compared_with_itself_differs_by_exactly_nothing(xs: Array) -> None:
    assert difference_of(xs, xs) == Estimate(0.0, 0.0, 0.0, len(xs))
    assert ratio_of(xs, xs) == Estimate(1.0, 1.0, 1.0, len(xs))


@settings(max_examples=50)
@given(pairs, st.integers(0, 1000))
def test_order_of_trials_changes_nothing_at_all(both: Array, seed: int) -> None:
    order = np.random.default_rng(seed).permutation(both.shape[1])
    ours, theirs = both

    assert mean_of(ours[order]) == mean_of(ours)
    assert difference_of(ours[order], theirs[order]) == difference_of(ours, theirs)
    assert str(ratio_of(ours[order], theirs[order])) == str(ratio_of(ours, theirs))  # NaN is NaN


@settings(max_examples=50)
@given(pairs, st.sampled_from((2.0**-20, 0.25, 8.0, 2.0**30)))
def test_unit_of_values_scales_means_and_differences_and_leaves_ratios(
    both: Array, unit: float
) -> None:
    ours, theirs = both

    scaled, plain = difference_of(unit * ours, unit * theirs), difference_of(ours, theirs)

    assert ends(scaled) == tuple(unit * end for end in ends(plain))
    assert mean_of(unit * ours).high == unit * mean_of(ours).high
    assert str(ratio_of(unit * ours, unit * theirs)) == str(ratio_of(ours, theirs))


@settings(max_examples=50)
@given(pairs)
def test_interval_holds_its_value(both: Array) -> None:
    ours, theirs = both

    for found in (mean_of(ours), difference_of(ours, theirs), ratio_of(ours, theirs)):
        assert math.isnan(found.value) or found.low <= found.value <= found.high


def test_one_trial_shows_a_value_and_no_interval() -> None:
    assert mean_of([5.0]) == Estimate(5.0, *EVERYTHING, 1)
    assert difference_of([5.0], [4.0]) == Estimate(1.0, *EVERYTHING, 1)
    assert ratio_of([5.0], [4.0]) == Estimate(1.25, *EVERYTHING, 1)
    assert mean_of([5.0]).as_json() == {"value": 5.0, "low_95": None, "high_95": None, "n": 1}


def test_equal_values_leave_no_doubt() -> None:
    assert mean_of([0.1] * 3) == Estimate(0.1, 0.1, 0.1, 3)
    assert ratio_of([3.0, 6.0], [1.0, 2.0]) == Estimate(3.0, 3.0, 3.0, 2)
    assert ratio_of([0.0, 0.0], [1.0, 2.0]) == Estimate(0.0, 0.0, 0.0, 2)


def test_ratio_to_what_may_be_nothing_is_bounded_by_nothing() -> None:
    assert ratio_of([1.0, 2.0, 3.0], [9.0, -7.0, 1.0]) == Estimate(2.0, *EVERYTHING, 3)


def test_ratio_to_nothing_is_undefined() -> None:
    found = ratio_of([1.0, 2.0], [0.0, 0.0])

    assert math.isnan(found.value)
    assert ends(found) == EVERYTHING
    assert found.as_json() == {"value": None, "low_95": None, "high_95": None, "n": 2}


def test_ratio_of_negative_values_is_theirs_of_positive_ones() -> None:
    ours, theirs = np.array([9.0, 8.5, 9.4, 9.9]), np.array([10.0, 9.0, 10.5, 10.2])

    assert ratio_of(-ours, -theirs) == ratio_of(ours, theirs)


@pytest.mark.parametrize("bad", [[], [1.0, math.nan], [math.inf], [[1.0, 2.0]]])
def test_what_is_no_row_of_finite_values_is_refused(bad: list[float]) -> None:
    with pytest.raises(ValueError, match="values must be finite, one or more, in a row"):
        mean_of(bad)


def test_incomplete_pairs_are_refused() -> None:
    with pytest.raises(ValueError, match="pairs must be complete, not 2 and 1 values"):
        ratio_of([1.0, 2.0], [1.0])


@pytest.mark.parametrize(("hits", "n"), [(0, 0), (-1, 3), (4, 3)])
def test_impossible_share_is_refused(hits: int, n: int) -> None:
    with pytest.raises(ValueError, match=r"hits must be within 0\.\.n"):
        share_of(hits, n)


@pytest.mark.parametrize("n", [1, 7, 200])
def test_share_of_none_and_all_reaches_the_end_and_is_no_point(n: int) -> None:
    none, every = share_of(0, n), share_of(n, n)

    assert none.low == 0.0 < none.high < 1.0
    assert 0.0 < every.low < every.high == 1.0
