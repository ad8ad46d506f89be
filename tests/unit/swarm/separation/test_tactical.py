"""UAVs near each other keep apart and all arrive: by construction, in crowds, and among liars."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np
import pytest
import shapely

from swarm.separation.tactical import TacticalResolver
from swarm.separation.tactical_advice import OwnFlight
from swarm.separation.tactical_motion import Place
from swarm.separation.tactical_traffic import (
    DISBELIEF_S,
    PATIENCE_S,
    Grade,
    NearbyTrack,
    Precedence,
    TrafficPicture,
    TrafficRules,
    TrafficWord,
)
from tests.support.traffic_crowd import Crowd, Flyer, random_crowd

RULES = TrafficRules(10.0, 8.0, low_m=10.0, high_m=100.0)
UP_M = 30.0
FIRST = Precedence(Grade.BOUND, 0)


def at(east: float, north: float, up: float = UP_M) -> Place:
    return east, north, up


def flyer(uav: str, rank: int, *way: Place, speed_m_s: float = 8.0) -> Flyer:
    return Flyer(uav, np.array(way[0]), list(way[1:]), speed_m_s, rank)


def standing(uav: str, rank: int, place: Place, grade: Grade) -> Flyer:
    return Flyer(uav, np.array(place), [], 8.0, rank, grade=grade, arrived_s=0.0)


def star(count: int, radius_m: float) -> list[Flyer]:
    flyers = []
    for number in range(count):
        angle = 2.0 * math.pi * number / count
        east, north = radius_m * math.cos(angle), radius_m * math.sin(angle)
        flyers.append(flyer(f"u{number}", number, at(east, north), at(-east, -north)))
    return flyers


CONSTRUCTED: dict[str, Callable[[], Sequence[Flyer]]] = {
    "head-on": lambda: [
        flyer("a", 0, at(0, 0), at(200, 0)),
        flyer("b", 1, at(200, 0), at(0, 0)),
    ],
    "crossing": lambda: [
        flyer("a", 1, at(0, 0), at(200, 0)),
        flyer("b", 0, at(100, -100), at(100, 100)),
    ],
    "overtaking by who goes first": lambda: [
        flyer("a", 0, at(0, 0), at(300, 0)),
        flyer("b", 1, at(30, 0), at(320, 0), speed_m_s=3.0),
    ],
    "overtaking by who goes last": lambda: [
        flyer("a", 1, at(0, 0), at(300, 0)),
        flyer("b", 0, at(30, 0), at(280, 0), speed_m_s=3.0),
    ],
    "past one with nothing to do": lambda: [
        flyer("a", 1, at(0, 0), at(200, 0)),
        standing("b", 0, at(100, 0), Grade.FREE),
    ],
    "past one that must not move": lambda: [
        flyer("a", 0, at(0, 0), at(200, 0)),
        standing("b", 1, at(100, 0), Grade.BOUND),
    ],
    "each to where the other was": lambda: [
        flyer("a", 0, at(0, 0), at(20, 0)),
        flyer("b", 1, at(20, 0), at(0, 0)),
    ],
    "star of eight": lambda: star(8, 80.0),
}


@pytest.mark.parametrize("name", CONSTRUCTED)
@pytest.mark.parametrize(("loss_frac", "delay_s"), [(0.0, 0.05), (0.2, 0.4)])
def test_all_arrive_and_nobody_comes_too_near(name: str, loss_frac: float, delay_s: float) -> None:
    flyers = CONSTRUCTED[name]()
    crowd = Crowd(RULES, flyers, seed=3, loss_frac=loss_frac, delay_s=delay_s)

    arrived = crowd.fly(300.0)

    assert arrived, crowd.told()
    least_m = RULES.separation_m - 2.0 * RULES.position_error_m
    assert crowd.nearest_m >= least_m, crowd.told()


def test_where_there_is_one_layer_one_that_must_not_move_is_flown_round() -> None:
    flyers = CONSTRUCTED["past one that must not move"]()
    crowd = Crowd(replace(RULES, low_m=UP_M - 1.0, high_m=UP_M + 6.0), flyers)

    assert crowd.fly(120.0), crowd.told()
    assert crowd.nearest_m >= RULES.separation_m - 2.0, crowd.told()


def test_one_that_stands_right_before_another_makes_room_beside_where_there_is_one_layer() -> None:
    """It can't be off the way before the other one would be there, if that did not brake."""
    flyers = [
        flyer("a", 0, at(0, 0), at(60, 0)),
        standing("b", 1, at(11.05, 0.5), Grade.FREE),
    ]
    crowd = Crowd(replace(RULES, low_m=UP_M - 1.0, high_m=UP_M + 6.0), flyers)

    assert crowd.fly(120.0), crowd.told()
    assert crowd.nearest_m >= RULES.separation_m - 2.0, crowd.told()


def test_without_giving_way_they_would_collide() -> None:
    crowd = Crowd(RULES, CONSTRUCTED["crossing"](), deaf=True)

    crowd.fly(300.0)

    assert crowd.nearest_m < 1.0


def test_two_pass_a_gap_between_zones_one_above_the_other() -> None:
    """It is too narrow for two side by side."""
    walls = [shapely.box(90, 4, 110, 200), shapely.box(90, -200, 110, -4)]

    def clear(path: Sequence[Place]) -> bool:
        line = shapely.LineString([place[:2] for place in path])
        return not any(line.distance(wall) < 1.0 for wall in walls)

    flyers = CONSTRUCTED["head-on"]()
    crowd = Crowd(RULES, flyers, clear=clear)

    def look() -> None:
        for each in flyers:
            here = shapely.Point(each.place_m[:2])
            assert not any(wall.contains(here) for wall in walls), crowd.told()

    crowd.on_step = look

    assert crowd.fly(300.0), crowd.told()
    assert crowd.nearest_m >= RULES.separation_m - 2.0, crowd.told()


@pytest.mark.parametrize(
    "seed", [*range(6), *(pytest.param(n, marks=pytest.mark.slow) for n in range(6, 60))]
)
def test_crowds_keep_apart_and_all_arrive(seed: int) -> None:
    """2 to 10 UAVs in a small field, up to 20 % loss, words up to 0.6 s late, places 1 m off."""
    crowd = random_crowd(seed)

    arrived = crowd.fly(900.0)

    assert arrived, crowd.told()
    assert crowd.nearest_m >= crowd.rules.separation_m - 2.0, crowd.told()


def test_one_that_falls_silent_in_the_way_is_flown_past() -> None:
    first, other = CONSTRUCTED["head-on"]()
    other.dies_s = 9.0  # its vehicle goes on to where it was told to go last
    crowd = Crowd(RULES, [first, other])

    assert crowd.fly(300.0), crowd.told()
    assert first.arrived_s is not None
    assert crowd.nearest_m >= RULES.separation_m - 2.0, crowd.told()


@pytest.mark.parametrize("length_s", [2.0, 6.0])
def test_who_hears_nothing_for_a_while_keeps_its_distance(length_s: float) -> None:
    flyers = CONSTRUCTED["crossing"]()
    for each in flyers:
        each.deaf_s = (8.0, 8.0 + length_s)
    crowd = Crowd(RULES, flyers)

    assert crowd.fly(300.0), crowd.told()
    assert crowd.nearest_m >= RULES.separation_m - 2.0, crowd.told()


# -- who lies ----------------------------------------------------------------------------

Lie = Callable[[Crowd], Iterator[tuple[str, TrafficWord]]]


def jumping(crowd: Crowd) -> Iterator[tuple[str, TrafficWord]]:
    """It says that it is somewhere else each time, right before one of the others."""
    for number, each in enumerate(crowd.flyers):
        if int(crowd.now_s * 4) % len(crowd.flyers) == number:
            place = (each.place_m + 6.0 * np.array([1.0, 0.2, 0.0])).tolist()
            yield "liar", TrafficWord(tuple(place), (0.0, 0.0, 0.0), (), 8.0, FIRST)


def staying_before(uav: str) -> Lie:
    """It says that it flies along right before one of the others, wherever that turns to."""

    def lie(crowd: Crowd) -> Iterator[tuple[str, TrafficWord]]:
        each = next(each for each in crowd.flyers if each.uav == uav)
        way = each.detour_m or each.path_m
        aim = np.array(way[0]) - each.place_m if way else np.zeros(3)
        ahead = aim / max(1.0, float(np.linalg.norm(aim)))
        place = (each.place_m + 11.0 * ahead).tolist()
        yield "liar", TrafficWord(tuple(place), (0.0, 0.0, 0.0), (), 8.0, FIRST)

    return lie


def circling(place: Place) -> Lie:
    """It says that it flies round and round where somebody wants to go."""

    def lie(crowd: Crowd) -> Iterator[tuple[str, TrafficWord]]:
        angle = 0.5 * crowd.now_s
        east, north = place[0] + 8.0 * math.cos(angle), place[1] + 8.0 * math.sin(angle)
        velocity = (-4.0 * math.sin(angle), 4.0 * math.cos(angle), 0.0)
        yield "liar", TrafficWord((east, north, place[2]), velocity, (place,), 4.0, FIRST)

    return lie


def coming_and_going(lie: Lie) -> Lie:
    """It lies so, and says now and then that it has landed."""

    def lie_on(crowd: Crowd) -> Iterator[tuple[str, TrafficWord]]:
        if int(crowd.now_s) % 20 == 0:
            for picture in crowd.pictures.values():
                picture.forget("liar")
        else:
            yield from lie(crowd)

    return lie_on


def up_and_down(place: Place) -> Lie:
    """It says that it climbs and lands there all the time, which one can't do otherwise."""

    def lie(crowd: Crowd) -> Iterator[tuple[str, TrafficWord]]:
        phase = crowd.now_s % 80.0
        up, end = (60.0 - phase, 0.0) if phase < 40.0 else (phase - 20.0, 60.0)
        velocity = (0.0, 0.0, -1.0 if phase < 40.0 else 1.0)
        way = (at(place[0], place[1], end),)
        yield "liar", TrafficWord(at(place[0], place[1], up), velocity, way, 1.0, FIRST)

    return lie


def boundless(crowd: Crowd) -> Iterator[tuple[str, TrafficWord]]:
    """It says that it flies at a million metres a second, as far up and down as can be said."""
    for number, each in enumerate(crowd.flyers):
        east, north, up = each.place_m.tolist()
        sign = 1.0 if number % 2 else -1.0
        way = (at(east + 12.0, north, sign * 1e6),)
        yield (
            f"liar {number}",
            TrafficWord(at(east + 12.0, north, up), (0.0, 0.0, sign * 1e6), way, 1e6, FIRST),
        )


LIES: dict[str, Lie] = {
    "jumping": jumping,
    "staying before": staying_before("a"),
    "staying before, with landings in between": coming_and_going(staying_before("a")),
    "circling at the goal": circling(at(200.0, 0.0)),
    "climbing and landing at the goal": up_and_down(at(200.0, 0.0)),
    "boundless": boundless,
}


BY_DAY = ("jumping", "staying before, with landings in between", "boundless")


@pytest.mark.parametrize(
    "name",
    [name if name in BY_DAY else pytest.param(name, marks=pytest.mark.slow) for name in LIES],
)
def test_a_liar_neither_makes_others_collide_nor_stops_them_for_good(name: str) -> None:
    crowd = Crowd(RULES, CONSTRUCTED["crossing"](), liars=[LIES[name]])

    arrived = crowd.fly(40.0 + 5.0 * PATIENCE_S)

    assert arrived, crowd.told()
    assert crowd.nearest_m >= RULES.separation_m - 2.0, crowd.told()


def test_one_that_only_stands_is_never_disbelieved() -> None:
    picture = TrafficPicture(RULES, 250.0)
    resolver = TacticalResolver("a", TrafficRules(10.0, 8.0, low_m=29.0, high_m=31.0), no_way_round)
    word = TrafficWord(at(20, 0), (0.0, 0.0, 0.0), (), 8.0, FIRST)
    own = OwnFlight(at(0, 0), (0.0, 0.0, 0.0), (at(40, 0),), 8.0, Precedence(Grade.FLYING, 1))
    for tick in range(int(4 * (PATIENCE_S + DISBELIEF_S))):
        picture.hear("b", word, 0.25 * tick, 0.1)
        advice = resolver.decide(own, picture, 0.25 * tick)

    assert advice.stands
    assert advice.because_of == "b"


def test_what_no_uav_can_do_costs_others_no_more_to_look_at_than_what_one_can() -> None:
    """Or a single word would keep all who hear it busy for minutes."""
    track = NearbyTrack(
        TrafficWord(at(0, 0), (0.0, 0.0, -1e6), (at(0, 0, -1e6),), 1e6, FIRST).within(
            RULES.fastest_m_s
        ),
        0.0,
        0.0,
    )
    stops_m, _ = track.stops_m(0.0, RULES)
    column = track.column_m()

    assert len(stops_m) < 60
    assert column is not None
    assert len(column) < 310
    assert track.word.speed_m_s == RULES.fastest_m_s
    assert math.hypot(*track.word.velocity_enu_m_s) == pytest.approx(RULES.fastest_m_s)


def test_one_that_lands_is_waited_for_longer_than_one_that_moves_about() -> None:
    """It costs half: a landing from a hundred metres takes longer than patience lasts."""
    lands = NearbyTrack(TrafficWord(at(0, 0), (0, 0, -1.0), (at(0, 0, 0),), 1.0, FIRST), 0.0, 0.0)
    word = TrafficWord(at(0, 9), (0, 0, -1.0), (at(0, 9, 0),), 1.0, FIRST)
    lands.hear(word, 1.0, 0.0, RULES)
    lands.blame(2.0, 1.5 * PATIENCE_S)
    assert lands.is_believed(3.0)
    lands.blame(3.0, 0.6 * PATIENCE_S)
    assert not lands.is_believed(4.0)


def no_way_round(_path: Sequence[Place]) -> bool:
    return False
