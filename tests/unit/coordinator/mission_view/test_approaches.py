"""How near UAVs came to each other, from what they told: against looking very often."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from coordinator.mission_view import approaches
from coordinator.mission_view.approaches import Approach, ObservedApproaches
from swarm.protocol.fields import Point

GAP_S = 5.0


def told(
    rng: np.random.Generator, uavs: int, seconds: int
) -> dict[str, list[tuple[float, Point, Point]]]:
    """Places and velocities of UAVs that turn at random, in statuses at odd times."""
    found: dict[str, list[tuple[float, Point, Point]]] = {}
    for number in range(uavs):
        at_s, place, fixes = float(rng.uniform(0.0, 0.5)), rng.uniform(0.0, 120.0, 3), []
        while at_s < seconds:
            velocity = rng.uniform(-8.0, 8.0, 3)
            lasts_s = float(rng.uniform(0.2, 1.5))
            fixes.append((at_s, tuple(place.tolist()), tuple(velocity.tolist())))
            place, at_s = place + lasts_s * velocity, at_s + lasts_s
        found[f"u{number}"] = fixes
    return found


def heard(
    fixes: dict[str, list[tuple[float, Point, Point]]], near_m: float | None = None
) -> ObservedApproaches:
    """All of them, in the order in which they were said."""
    observed = ObservedApproaches(GAP_S, near_m)
    said = [(at_s, uav, p, v) for uav, each in fixes.items() for at_s, p, v in each]
    for at_s, uav, place, velocity in sorted(said):
        observed.fly(uav, at_s, place, velocity, started=True)
    return observed


def seen_m(fixes: dict[str, list[tuple[float, Point, Point]]], at_s: float) -> dict[str, Point]:
    """Where each is at that instant, of those that have told before and after."""
    places: dict[str, Point] = {}
    for uav, each in fixes.items():
        for (begin_s, begin, _), (end_s, end, _) in itertools.pairwise(each):
            if begin_s <= at_s <= end_s:
                share = (at_s - begin_s) / (end_s - begin_s)
                east, north, up = (a + share * (b - a) for a, b in zip(begin, end, strict=True))
                places[uav] = east, north, up
    return places


@pytest.mark.parametrize("batch", [1, 7, 512])
def test_it_is_what_one_finds_by_looking_very_often(
    batch: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(approaches, "_BATCH", batch)
    monkeypatch.setattr(approaches, "_AT_ONCE", 40 * batch)
    for seed in range(6):
        fixes = told(np.random.default_rng(seed), 4, 30)
        nearest = heard(fixes).nearest
        assert nearest is not None
        least_m = math.inf
        for at_s in np.arange(0.0, 30.0, 0.05).tolist():
            places = list(seen_m(fixes, at_s).values())
            apart_m = [math.dist(p, q) for p, q in itertools.combinations(places, 2)]
            least_m = min([least_m, *apart_m])
        assert nearest.distance_m <= least_m + 1e-9
        assert least_m <= nearest.distance_m + 0.05 * 28.0
        assert nearest.at_s is not None
        there = seen_m(fixes, nearest.at_s)
        for uav, place in zip(nearest.uavs, nearest.places_enu_m, strict=True):
            assert place == pytest.approx(there[uav])
        assert math.dist(*nearest.places_enu_m) == pytest.approx(nearest.distance_m)


def test_every_time_that_two_were_near_is_told_once() -> None:
    """Two that swing past each other, with a third far away, every 20 s."""
    fixes: dict[str, list[tuple[float, Point, Point]]] = {"a": [], "b": [], "far": []}
    for tick in range(400):
        at_s = 0.2 * tick
        east_m = 100.0 * math.cos(math.tau * at_s / 40.0)
        fixes["a"].append((at_s, (0.0, 0.0, 10.0), (0.0, 0.0, 0.0)))
        fixes["b"].append((at_s, (east_m, 3.0, 14.0), (0.0, 0.0, 0.0)))
        fixes["far"].append((at_s, (5000.0, 0.0, 10.0), (0.0, 0.0, 0.0)))
    observed = heard(fixes, 20.0)

    for uav in ("a", "b"):
        met = observed.of(uav)
        assert [near.distance_m for near in met] == pytest.approx([5.0] * 4, abs=0.01)
        assert [near.at_s for near in met] == pytest.approx([10.0, 30.0, 50.0, 70.0], abs=0.01)
    assert observed.of("far") == []
    assert heard(fixes).of("a") == []  # nobody asked for them


def test_who_has_landed_or_was_not_heard_for_long_is_near_to_nobody() -> None:
    observed = ObservedApproaches(GAP_S)
    still = (0.0, 0.0, 0.0)
    for at_s in (0.0, 1.0, 2.0):
        observed.fly("a", at_s, (0.0, 0.0, 10.0), still, started=True)
    observed.fly("b", 0.0, (50.0, 0.0, 10.0), still, started=True)
    observed.land("b")
    observed.fly("b", 2.0, (1.0, 0.0, 10.0), still, started=True)
    assert observed.nearest is None

    observed.fly("b", 2.0 + 1.1 * GAP_S, (1.0, 0.0, 10.0), still, started=True)
    observed.fly("a", 2.0 + 1.1 * GAP_S, (0.0, 0.0, 10.0), still, started=True)
    assert observed.nearest is None
    now = observed.nearest_now(2.5 + 1.1 * GAP_S, 0.0)
    assert now is not None
    assert (now.uavs, now.distance_m) == (("a", "b"), 1.0)


def test_what_was_before_the_start_is_not_compared_with_what_comes_after() -> None:
    observed = ObservedApproaches(GAP_S)
    for now_s, up_m in ((100.0, 2.0), (101.0, 4.0)):
        observed.fly("a", now_s, (0.0, 0.0, up_m), None, started=False)
        observed.fly("b", now_s, (4.0, 0.0, up_m + 3.0), None, started=False)
    before = observed.nearest
    assert before == Approach(5.0, None, ("a", "b"), ((0.0, 0.0, 2.0), (4.0, 0.0, 5.0)))
    for mission_s in (0.5, 1.0):
        observed.fly("a", mission_s, (0.0, 0.0, 4.0), None, started=True)
    observed.fly("b", 101.5, (0.0, 0.0, 4.0), None, started=False)
    assert observed.nearest == before


def test_the_error_is_what_curves_and_late_words_may_hide() -> None:
    """A circle of 20 m at 10 m/s, told every second, round one that stands in its middle."""
    observed, radius_m, speed_m_s = ObservedApproaches(GAP_S), 20.0, 10.0
    for at_s in range(13):
        turned = speed_m_s * at_s / radius_m
        place = radius_m * math.cos(turned), radius_m * math.sin(turned), 0.0
        velocity = -speed_m_s * math.sin(turned), speed_m_s * math.cos(turned), 0.0
        observed.fly("round", float(at_s), place, velocity, started=True)
        observed.fly("still", float(at_s), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), started=True)
    nearest = observed.nearest
    assert nearest is not None
    missed_m = radius_m - nearest.distance_m
    assert missed_m > 0.5
    assert missed_m <= nearest.error_m <= 2.0 * missed_m
