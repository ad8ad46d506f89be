"""What one glance tells of those near a UAV is what looking at each of them would."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarm.separation.tactical import TacticalResolver
from swarm.separation.tactical_advice import Maneuver, OwnFlight
from swarm.separation.tactical_look import pace_s
from swarm.separation.tactical_motion import STEP_S, Place, motion_m
from swarm.separation.tactical_traffic import (
    Grade,
    Precedence,
    TrafficPicture,
    TrafficRules,
    TrafficWord,
)

RULES = TrafficRules(6.0, 10.0, low_m=0.0, high_m=120.0)

flat = st.floats(-150.0, 150.0)
heights = st.one_of(st.sampled_from([30.0, 38.0, 46.0]), st.floats(0.0, 120.0))
places = st.tuples(flat, flat, heights)
paces = st.floats(-8.0, 8.0)
velocities = st.tuples(paces, paces, st.one_of(st.just(0.0), st.floats(-2.0, 2.0)))
paths = st.lists(places, max_size=4).map(tuple)
precedences = st.builds(Precedence, st.sampled_from(Grade), st.integers(0, 3), st.integers(0, 1))
words = st.builds(TrafficWord, places, velocities, paths, st.floats(0.5, 14.0), precedences)
flights = st.builds(OwnFlight, places, velocities, paths, st.floats(0.5, 10.0), precedences)
ages = st.floats(0.0, 8.0)


def looked_closely(monkeypatch: pytest.MonkeyPatch) -> None:
    """From now on nothing is told by a glance."""
    monkeypatch.setattr(TrafficPicture, "glance", lambda *_, **__: None)
    monkeypatch.setattr(TrafficPicture, "free_s", lambda *_, **__: None)


def decided(
    own: OwnFlight, heard: list[tuple[TrafficWord, float]], times_s: list[float]
) -> list[object]:
    """Advice, word and pace at these times, with these words of others heard at 0, so old."""
    picture, resolver = TrafficPicture(RULES, 225.0), TacticalResolver("u5", RULES)
    for number, (word, age_s) in enumerate(heard):
        picture.hear(f"u{number}", word, 0.0, age_s)
    found: list[object] = []
    for now_s in times_s:
        found += [resolver.decide(own, picture, now_s), resolver.word(own)]
        found.append(resolver.pace_s(own, picture, now_s))
    return found


@given(flights, st.lists(st.tuples(words, ages), max_size=8), st.floats(0.0, 4.0))
def test_whatever_is_heard_it_decides_as_if_it_had_looked_at_each(
    own: OwnFlight, heard: list[tuple[TrafficWord, float]], later_s: float
) -> None:
    times_s = [0.0, later_s, later_s + 3.5]
    quick = decided(own, heard, times_s)
    with pytest.MonkeyPatch.context() as patches:
        looked_closely(patches)
        assert quick == decided(own, heard, times_s)


def on_way(place: Place, velocity: Place, after_s: float) -> Place:
    (east, north, up), (east_m_s, north_m_s, up_m_s) = place, velocity
    return east + after_s * east_m_s, north + after_s * north_m_s, up + after_s * up_m_s


def flown_on(flight: OwnFlight, after_s: float) -> OwnFlight:
    return replace(
        flight, position_enu_m=on_way(flight.position_enu_m, flight.velocity_enu_m_s, after_s)
    )


def word_of(flight: OwnFlight) -> TrafficWord:
    return TacticalResolver("", RULES).word(flight)


def brakes(own: OwnFlight, other: OwnFlight, age_s: float) -> bool:
    """Whether it brakes before one that it heard so long ago and that has nothing to tell it."""
    picture = TrafficPicture(RULES, 225.0)
    last = replace(word_of(other), precedence=Precedence(Grade.FREE, 9))
    picture.hear("u9", last, 0.0, age_s)
    return TacticalResolver("u0", RULES).decide(own, picture, 0.0).braked


def somewhere(rng: np.random.Generator) -> OwnFlight:
    """One that flies straight on, in one of three layers."""
    place = (*rng.uniform(-40.0, 40.0, 2).tolist(), float(rng.choice([30.0, 38.0, 46.0])))
    speed, turn = rng.uniform(0.0, 8.0), rng.uniform(0.0, 2.0 * math.pi)
    velocity = speed * math.cos(turn), speed * math.sin(turn), 0.0
    way = (on_way(place, velocity, 60.0),)
    return OwnFlight(place, velocity, way, speed, Precedence(Grade.FLYING, 1))


@pytest.mark.parametrize("seed", range(6))
def test_while_one_takes_its_time_neither_has_to_brake(seed: int) -> None:
    """Both fly on as they said, and are not heard meanwhile."""
    rng, takes_time = np.random.default_rng(seed), 0
    for _ in range(400):
        own, other = somewhere(rng), somewhere(rng)
        age_s, share = rng.uniform(0.0, RULES.tick_s), rng.uniform(0.5, 1.0)
        picture = TrafficPicture(RULES, 225.0)
        picture.hear("u9", word_of(other), 0.0, age_s)
        later_s = share * pace_s(word_of(own), picture, RULES, 0.0, gives_way=True)
        if later_s > RULES.tick_s:
            takes_time += 1
            assert not brakes(flown_on(own, later_s), other, age_s + later_s)
            assert not brakes(flown_on(other, age_s + later_s), own, age_s + later_s)
    assert 300 < takes_time < 390


def test_however_short_a_wait_is_it_is_looked_who_is_close() -> None:
    rules = replace(RULES, beacon_s=0.2, tick_s=0.05)
    place, velocity = (0.0, 0.0, 30.0), (8.0, 0.0, 0.0)
    mine = TrafficWord(place, velocity, ((60.0, 0.0, 30.0),), 8.0, Precedence(Grade.FLYING, 1))
    stands = replace(mine, position_enu_m=(20.0, 0.0, 30.0), velocity_enu_m_s=(0.0, 0.0, 0.0))
    picture = TrafficPicture(rules, 225.0)
    picture.hear("u9", replace(stands, path_enu_m=()), 0.0, 0.0)

    assert picture.free_s(mine, 0.0, gives_way=True) == 0.0
    assert pace_s(mine, picture, rules, 0.0, gives_way=True) == rules.tick_s


def round_a_bend(bend_m: float, after_s: float) -> OwnFlight:
    """One that flies to the east at 10 m/s, and to the north after so many metres."""
    corners = ((bend_m, 0.0, 30.0), (bend_m, 200.0, 30.0))
    flown = (0.0, 0.0, 30.0), (10.0, 0.0, 0.0), corners, 10.0
    way_m = motion_m(*flown, RULES.agility, math.inf, after_s + 2.0 * STEP_S)
    here, after = way_m[round(after_s / STEP_S)], way_m[round(after_s / STEP_S) + 1]
    velocity = tuple(((after - here) / STEP_S).tolist())
    ahead = corners[1:] if here[1] > 0.1 else corners
    return OwnFlight(tuple(here.tolist()), velocity, ahead, 10.0, Precedence(Grade.FLYING, 1))


@pytest.mark.parametrize("bend_m", np.arange(6.0, 40.0, 2.0).tolist())
def test_who_comes_to_a_bend_looks_at_stops_before_and_behind_it(bend_m: float) -> None:
    """Braked before the bend it goes straight on, to where it does not come behind it."""
    own, rng = round_a_bend(bend_m, 0.0), np.random.default_rng(0)
    still = 0.0, 0.0, 0.0
    for _ in range(40):
        place = (*rng.uniform((5.0, -15.0), (60.0, 40.0)).tolist(), 30.0)
        stands = OwnFlight(place, still, (), 10.0, Precedence(Grade.FLYING, 1))
        picture = TrafficPicture(RULES, 225.0)
        picture.hear("u9", word_of(stands), 0.0, 0.1)
        wait_s = pace_s(word_of(own), picture, RULES, 0.0, gives_way=True)
        for step in range(2, 1 + round(wait_s / STEP_S)):
            after_s = step * STEP_S
            assert not brakes(round_a_bend(bend_m, after_s), stands, 0.1 + after_s)


def crossing(seed: int) -> list[tuple[Place, Place, float]]:
    """Where each of a crowd in three layers begins, how it moves, and its rank's number."""
    rng = np.random.default_rng(seed)
    flown = []
    for _ in range(14):
        place = (*rng.uniform(-150.0, 150.0, 2).tolist(), float(rng.choice([30.0, 38.0, 46.0])))
        turn = rng.uniform(0.0, 2.0 * math.pi)
        flown.append((place, (8.0 * math.cos(turn), 8.0 * math.sin(turn), 0.0), rng.random()))
    return flown


@pytest.mark.parametrize("seed", range(8))
def test_over_many_ticks_of_a_crowd_nothing_is_otherwise_and_mostly_a_glance_is_enough(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    glances: list[bool | None] = []
    told = TrafficPicture.glance

    def counted(self: TrafficPicture, *args: Any) -> bool | None:
        glances.append(told(self, *args))
        return glances[-1]

    def flown() -> list[object]:
        picture, resolver = TrafficPicture(RULES, 225.0), TacticalResolver("u00", RULES)
        found: list[object] = []
        for tick in range(40):
            now_s = 0.25 * tick
            for number, (place, velocity, rank) in enumerate(crossing(seed)):
                at, ahead = on_way(place, velocity, now_s), on_way(place, velocity, 60.0)
                if number == 0:
                    own = OwnFlight(at, velocity, (ahead,), 8.0, Precedence(Grade.FLYING, 5))
                elif (tick + number) % 4 == 0:
                    precedence = Precedence(Grade.FLYING, int(9 * rank))
                    word = TrafficWord(at, velocity, (ahead,), 8.0, precedence)
                    picture.hear(f"u{number:02}", word, now_s, 0.1)
                if number == 3 and tick == 20:
                    picture.forget("u03")
            found += [resolver.decide(own, picture, now_s), resolver.pace_s(own, picture, now_s)]
        return found

    monkeypatch.setattr(TrafficPicture, "glance", counted)
    quick = flown()
    assert glances.count(None) < 0.6 * len(quick) / 2
    looked_closely(monkeypatch)
    assert quick == flown()


def test_who_is_not_believed_has_to_be_looked_at() -> None:
    picture = TrafficPicture(RULES, 225.0)
    far = TrafficWord((100.0, 0.0, 100.0), (1.0, 0.0, 0.0), (), 8.0, Precedence(Grade.FLYING, 1))
    flown = (0.0, 0.0, 30.0), (8.0, 0.0, 0.0), ((50.0, 0.0, 30.0),), 8.0
    mine = Precedence(Grade.FLYING, 2)
    picture.hear("u1", far, 0.0, 0.0)
    assert picture.glance(*flown, mine, 0.0) is True
    assert picture.glance((5e3, 0.0, 30.0), *flown[1:], mine, 0.0) is False

    picture.hear("u1", replace(far, position_enu_m=(106.0, 0.0, 100.0)), 1.0, 0.0)
    picture.blame("u1", 1.0, 60.0)

    assert picture.glance(*flown, mine, 1.0) is None
    assert list(picture.near((0.0, 0.0, 30.0), 1.0)) == []


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_a_place_that_is_none_is_refused(bad: float) -> None:
    picture = TrafficPicture(RULES, 225.0)
    mine = Precedence(Grade.FLYING, 2)
    with pytest.raises(ValueError, match="place_m must be finite"):
        picture.glance((bad, 0.0, 0.0), (0.0, 0.0, 0.0), (), 8.0, mine, 0.0)


def test_the_greatest_numbers_that_a_word_may_hold_are_taken() -> None:
    picture = TrafficPicture(RULES, 225.0)
    corner = (1e8, -1e8, 1e8)
    greatest = Precedence(Grade.FREE, 2**63 - 1, 255)
    word = TrafficWord((-1e8, 1e8, -1e8), corner, (corner,) * 8, 1e6, greatest)

    assert picture.hear("u1", word, 0.0, 10.0)
    assert picture.glance((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (), 8.0, greatest, 0.0) is False


def test_its_advice_is_still_to_keep_on_where_nobody_is_in_the_way() -> None:
    picture, resolver = TrafficPicture(RULES, 225.0), TacticalResolver("u5", RULES)
    own = OwnFlight(
        *((0.0, 0.0, 30.0), (8.0, 0.0, 0.0), ((99.0, 0.0, 30.0),), 8.0),
        Precedence(Grade.FLYING, 1),
    )
    above = TrafficWord((9.0, 0.0, 46.0), (0.0, 0.0, 0.0), (), 8.0, Precedence(Grade.FLYING, 0))
    picture.hear("u1", above, 0.0, 0.0)

    assert resolver.decide(own, picture, 0.0).maneuver is Maneuver.KEEP
