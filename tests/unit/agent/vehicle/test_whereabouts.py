"""A place counts if the vehicle can have come there, or if enough others bear it out."""

from __future__ import annotations

from agent.vehicle.state import PositionFilter

HERE, NEAR, FAR = (0.0, 0.0, 10.0), (1.0, 0.0, 10.0), (-10_342e3, 0.0, 10.0)


def told(*places_m: tuple[float, float, float]) -> PositionFilter:
    where = PositionFilter()
    for count, place_m in enumerate(places_m):
        where.on_position(place_m, 0.1 * count)
    return where


def test_first_place_counts_once_others_bear_it_out() -> None:
    assert told(*[HERE] * 4).place_m(0.0) is None
    assert told(*[HERE] * 4, NEAR).place_m(0.0) == NEAR


def test_glitch_does_not_count_and_takes_nothing_away() -> None:
    assert told(*[HERE] * 5, FAR).place_m(0.0) == HERE
    assert told(*[HERE] * 5, FAR, NEAR).place_m(0.0) == NEAR


def test_glitches_between_good_places_never_count() -> None:
    assert told(*[HERE] * 5, *[FAR, NEAR] * 20).place_m(0.0) == NEAR


def test_position_that_was_put_right_counts_after_some_time() -> None:
    assert told(*[HERE] * 5, *[FAR] * 4).place_m(0.0) == HERE
    assert told(*[HERE] * 5, *[FAR] * 5).place_m(0.0) == FAR


def test_old_place_does_not_count() -> None:
    assert told(*[HERE] * 5, *[FAR] * 4).place_m(0.5) is None


def test_vehicle_may_have_flown_on_in_a_gap_but_not_anywhere() -> None:
    where = told(*[HERE] * 5)
    where.on_position((150.0, 0.0, 10.0), 4.0)
    assert where.place_m(4.0) == (150.0, 0.0, 10.0)
    where.on_position((650.0, 0.0, 10.0), 64.0)
    assert where.place_m(64.0) is None
