"""How measurements of a UAV's flight become what is told of it."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from agent.core.calibration import STEP_FRAC, RunningMedian, told_anew
from agent.core.energy import DrainGauge, SortieClock
from swarm.protocol.calibration import TIME_FRAC_RANGE
from swarm.protocol.messages import UavSpec

shares = st.floats(0.1, 10.0)
ME = UavSpec("u0", (0.0, 0.0, 0.0), 10.0, {}, {}, None, 0.0, endurance_s=100.0, reserve_frac=0.2)


def estimate(votes: list[float], known: float = 1.0) -> float:
    running = RunningMedian(known)
    for vote in votes:
        running.add(vote)
    return running.value


@given(st.lists(shares, max_size=30), shares)
def test_estimates_lie_among_what_was_measured_and_what_was_known(
    votes: list[float], known: float
) -> None:
    assert min([known, *votes]) <= estimate(votes, known) <= max([known, *votes])


@given(shares, st.integers(0, 20), st.integers(0, 20))
def test_one_odd_leg_changes_nothing(odd: float, before: int, after: int) -> None:
    assert estimate([1.0] * before + [odd] + [1.0] * after) == 1.0


@given(shares)
def test_few_legs_change_little_and_some_more_all(true: float) -> None:
    assert estimate([]) == estimate([true]) == 1.0
    assert estimate([true, true]) == (1.0 + true) / 2.0
    assert estimate([true] * 3) == estimate([true] * 20) == true


@given(shares, shares)
def test_what_was_measured_long_ago_is_forgotten(old: float, new: float) -> None:
    assert estimate([old] * 30 + [new] * 5) == new


@given(st.floats(0.5, 3.0), shares)
def test_what_is_told_moves_in_steps_within_what_is_believable(told: float, found: float) -> None:
    low, high = TIME_FRAC_RANGE
    now = told_anew(told, found, TIME_FRAC_RANGE)

    assert low <= now <= high
    if abs(found / told - 1.0) < STEP_FRAC:
        assert now == told
    assert told_anew(now, found, TIME_FRAC_RANGE) == now  # nothing flutters


@given(st.floats(-1e-9, 1e-9))
def test_rounding_is_no_news(error: float) -> None:
    assert told_anew(1.0, 1.0 + error, TIME_FRAC_RANGE) == 1.0


def test_votes_of_this_life_are_told_from_what_was_known() -> None:
    running = RunningMedian(1.0)
    assert running.measured is None
    running.add(1.3)
    assert running.measured == 1.3
    for _ in range(20):
        running.add(1.2)
    assert running.measured == running.value == 1.2


def test_a_sortie_ends_by_how_fast_the_battery_drains() -> None:
    sortie = SortieClock()
    sortie.heed(1.25, 0.0)
    sortie.begin(ME, 0.0)
    assert sortie.end_s == 80.0 / 1.25
    # What is left: so much that it would last until 50 s, were it not for the drain.
    assert sortie.measure(ME, 0.5, 20.0)
    assert sortie.end_s == 20.0 + 30.0 / 1.25

    sortie.depart(ME, 100.0)
    assert sortie.end_s == 100.0 + 80.0 / 1.25
    sortie.heed(1.0, 140.0)  # 24 s of 64 s are left, worth 30 s
    assert math.isclose(sortie.end_s, 170.0)


def test_what_an_earlier_life_said_of_the_sortie_holds_its_drain_already() -> None:
    before, later = SortieClock(), SortieClock()
    before.heed(1.6, 0.0)
    before.begin(ME, 0.0)
    assert before.end_s == 50.0

    later.recall(before.told_s, 1.6)
    later.heed(1.6, 20.0)

    assert later.end_s == 50.0


@pytest.mark.parametrize("told", [1.0, 1.32])
def test_a_later_life_does_not_count_again_what_the_earlier_one_had_measured_but_not_told(
    told: float,
) -> None:
    before, later = SortieClock(), SortieClock()
    before.begin(ME, 0.0)
    before.heed(1.6, 0.0)
    assert before.end_s == 50.0

    later.recall(before.told_s, told)
    later.measure(ME, 0.68, 20.0)  # 0.48 above the reserve: it drains 1.6 times as fast as planned
    later.heed(1.6, 20.0)
    later.measure(ME, 0.68, 20.0)

    assert later.end_s == 50.0
    later.measure(ME, 0.36, 30.0)  # and from now on by its charge
    assert later.end_s == 40.0


def test_what_slow_legs_may_cost_counts_for_what_is_left_where_the_charge_is_told() -> None:
    """Nothing of it is owed for a time that has passed in a hover meanwhile."""
    sortie = SortieClock()
    sortie.begin(ME, 0.0)
    sortie.measure(ME, 1.0, 0.0)
    sortie.heed(1.25, 0.0)
    sortie.measure(ME, 1.0, 0.0)
    assert sortie.end_s == 64.0  # 80 s above the reserve, as slowly as it flies

    sortie.measure(ME, 0.4, 60.0)  # but as much as planned is left after a minute
    assert sortie.end_s == 76.0


def test_without_a_charge_that_is_told_what_slow_legs_cost_is_counted() -> None:
    sortie = SortieClock()
    sortie.begin(ME, 0.0)
    sortie.heed(1.25, 0.0)

    assert sortie.end_s == 64.0


def test_a_sortie_that_drains_as_planned_is_as_it_was() -> None:
    sortie, plain = SortieClock(), SortieClock()
    for each in (sortie, plain):
        each.begin(ME, 3.1)
    sortie.heed(1.0, 7.7)
    assert sortie.end_s == plain.end_s


@given(
    endurance_s=st.floats(60.0, 3000.0),
    drain_frac=st.floats(0.5, 2.0),
    phase_s=st.floats(0.0, 30.0),
    data=st.data(),
)
def test_a_drain_is_measured_whatever_the_steps_in_which_charge_is_told(
    endurance_s: float, drain_frac: float, phase_s: float, data: st.DataObject
) -> None:
    """Told in whole per cent, twice a second and up to a second late: at most 10 % off.

    What a shorter span says of it at least is never too much.
    """
    gauge = DrainGauge()
    late_s = data.draw(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=8))
    votes, told_at_s = [], phase_s
    for step in range(400):
        now_s = phase_s + 0.5 * step
        told_at_s = max(told_at_s, now_s - late_s[step % len(late_s)])
        left_frac = 1.0 - told_at_s * drain_frac / endurance_s
        used_1_s = gauge.read(math.ceil(100.0 * left_frac) / 100.0, now_s)
        votes += [] if used_1_s is None else [used_1_s * endurance_s]
        least_frac = (gauge.least_1_s or 0.0) * endurance_s
        assert least_frac <= drain_frac * (1.0 + 1e-9)

    assert votes or 200.0 * drain_frac / endurance_s < 0.06 or endurance_s / drain_frac < 30.0
    assert all(abs(vote / drain_frac - 1.0) < 0.1 for vote in votes), votes


def test_a_fast_drain_is_known_in_part_before_a_span_is_long_enough() -> None:
    gauge = DrainGauge()
    for at_s, frac in ((0.0, 0.9), (1.0, 0.88), (4.0, 0.82)):
        gauge.read(frac, at_s)
    assert gauge.least_1_s is None  # 6 % may be a voltage that sags in a climb

    assert gauge.read(0.68, 11.0) is None
    assert gauge.least_1_s == pytest.approx(0.2 / 12.0)
    assert gauge.read(0.48, 21.0) == pytest.approx(0.02)
    assert gauge.least_1_s is None


def test_a_drain_is_measured_anew_in_each_flight_and_with_each_battery() -> None:
    gauge = DrainGauge()
    used_1_s = [gauge.read(frac, at_s) for at_s, frac in ((0.0, 0.9), (1.0, 0.89), (41.0, 0.81))]
    assert used_1_s == [None, None, pytest.approx(0.002)]

    assert gauge.read(1.0, 50.0) is None  # another battery
    assert gauge.read(0.9, 80.0) is None  # the first that it tells of a fall
    assert gauge.read(0.8, 105.0) == pytest.approx(0.004)
    gauge.begin()
    assert gauge.read(0.7, 130.0) is None
    assert gauge.read(0.6, 155.0) is None
