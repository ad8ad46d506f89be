"""What one UAV makes of the words of those near it, and how often it has to say and hear more."""

from __future__ import annotations

import math

import pytest

from swarm.separation.tactical import TacticalResolver
from swarm.separation.tactical_advice import Maneuver, OwnFlight
from swarm.separation.tactical_motion import Agility, Place
from swarm.separation.tactical_traffic import (
    FORGET_S,
    Grade,
    Precedence,
    TrafficPicture,
    TrafficRules,
    TrafficWord,
)

RULES = TrafficRules(10.0, 8.0, low_m=10.0, high_m=100.0)
FIRST = Precedence(Grade.BOUND, 0)


def at(east: float, north: float, up: float = 30.0) -> Place:
    return east, north, up


def pace_of(own: OwnFlight, *others: TrafficWord, flown_s: float = 10.0) -> float:
    """Of one that has decided for so long, and hears these all the time."""
    picture, resolver = TrafficPicture(RULES, 250.0), TacticalResolver("a", RULES)
    for tick in range(int(flown_s / RULES.tick_s) + 1):
        for number, word in enumerate(others):
            picture.hear(f"b{number}", word, tick * RULES.tick_s, 0.1)
        resolver.decide(own, picture, tick * RULES.tick_s)
    return resolver.pace_s(own, picture, flown_s)


def standing_word(place: Place, grade: Grade = Grade.FREE) -> TrafficWord:
    return TrafficWord(place, (0.0, 0.0, 0.0), (), 8.0, Precedence(grade, 5))


def hovering(place: Place, grade: Grade = Grade.FREE) -> OwnFlight:
    gives_way = grade is not Grade.BOUND
    return OwnFlight(place, (0.0, 0.0, 0.0), (), 8.0, Precedence(grade, 1), gives_way)


def test_who_is_alone_or_far_away_takes_its_time() -> None:
    assert pace_of(hovering(at(0, 0))) == RULES.beacon_s
    assert pace_of(hovering(at(0, 0)), standing_word(at(40, 0))) == RULES.beacon_s
    assert pace_of(own_of("a"), standing_word(at(180, 0))) == RULES.beacon_s


def test_who_may_soon_have_to_brake_does_not() -> None:
    assert pace_of(own_of("a"), standing_word(at(-25, 0))) == RULES.beacon_s / 2.0
    assert pace_of(hovering(at(0, 0)), standing_word(at(13, 0))) == RULES.beacon_s / 2.0
    assert pace_of(own_of("a"), standing_word(at(-35, 0))) == RULES.tick_s
    assert pace_of(hovering(at(0, 0)), standing_word(at(11.5, 0))) == RULES.tick_s


def test_who_has_just_begun_speaks_often_as_it_may_not_have_been_heard() -> None:
    assert pace_of(hovering(at(0, 0)), flown_s=1.0) == RULES.tick_s


def test_of_two_that_can_not_give_way_neither_has_to_hear_often() -> None:
    """As in a row of starts: all climb."""
    climbs = hovering(at(0, 0), Grade.BOUND)

    assert pace_of(climbs, standing_word(at(12, 0), Grade.BOUND)) == RULES.beacon_s
    assert pace_of(climbs, standing_word(at(12, 0), Grade.FREE)) == RULES.beacon_s / 2.0


def test_who_was_not_known_to_be_near_or_silent_is_news() -> None:
    picture, word = TrafficPicture(RULES, 250.0), standing_word(at(10, 0))

    assert picture.hear("b", word, 0.0, 0.1)
    assert not picture.hear("b", word, 1.0, 0.1)
    assert picture.hear("b", word, 10.0, 0.1)


def test_the_lower_rank_gives_way_and_the_higher_flies_on() -> None:
    advice = {}
    for me, other in (("a", "b"), ("b", "a")):
        picture = TrafficPicture(RULES, 250.0)
        picture.hear(other, word_of(other), 0.0, 0.1)
        advice[me] = TacticalResolver(me, RULES).decide(own_of(me), picture, 0.0)

    assert advice["a"].maneuver is Maneuver.KEEP
    assert not advice["a"].braked
    assert advice["b"].maneuver is not Maneuver.KEEP
    assert advice["b"].because_of == "a"


def own_of(uav: str) -> OwnFlight:
    """Two that are going to meet in the middle in 10 s."""
    side = 1.0 if uav == "a" else -1.0
    rank = 0 if uav == "a" else 1
    return OwnFlight(
        at(-80.0 * side, 0.0),
        (8.0 * side, 0.0, 0.0),
        (at(200.0 * side, 0.0),),
        8.0,
        Precedence(Grade.FLYING, rank),
    )


def word_of(uav: str) -> TrafficWord:
    return TacticalResolver(uav, RULES).word(own_of(uav))


def test_who_makes_room_goes_before_all_that_the_other_goes_before() -> None:
    lent = Precedence(Grade.FLYING, 3).of_who_makes_room

    assert Precedence(Grade.FLYING, 3) < lent < Precedence(Grade.FLYING, 4)


def test_words_out_of_order_change_nothing() -> None:
    picture = TrafficPicture(RULES, 250.0)
    picture.hear("b", word_of("b"), 1.0, 0.1)
    picture.hear("b", word_of("a"), 1.1, 0.9)

    ((_, track),) = picture.near(at(0, 0), 1.1)
    assert track.word == word_of("b")


def test_nobody_is_remembered_for_ever() -> None:
    picture = TrafficPicture(RULES, 1e9)
    picture.hear("b", word_of("b"), 0.0, 0.0)

    assert list(picture.near(at(0, 0), FORGET_S - 1.0))
    assert not list(picture.near(at(0, 0), FORGET_S + 1.0))
    assert picture.place_of("b") is None


def test_who_has_flown_out_of_hearing_is_forgotten_and_who_stays_away_silent_is_not() -> None:
    picture = TrafficPicture(RULES, 50.0)
    picture.hear("leaves", word_of("a"), 0.0, 0.0)
    stays = TrafficWord(at(-40, 0), (0.0, 0.0, 0.0), (), 8.0, FIRST)
    picture.hear("stays", stays, 0.0, 0.0)

    assert [uav for uav, _ in picture.near(at(-80, 0), 12.0)] == ["stays"]


def test_rules_out_of_range_are_refused() -> None:
    with pytest.raises(ValueError, match="separation_m"):
        TrafficRules(0.0, 8.0)
    with pytest.raises(ValueError, match="cruise_m_s"):
        TrafficRules(10.0, math.inf)
    with pytest.raises(ValueError, match="position_error_m"):
        TrafficRules(10.0, 8.0, position_error_m=-1.0)


def test_agility_must_be_positive() -> None:
    with pytest.raises(ValueError, match="climb_m_s"):
        Agility(climb_m_s=0.0)
