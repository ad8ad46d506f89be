"""Paths in shared layers: apart by slabs means apart at any time, against brute force."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarm.separation.slabs import (
    Slabs,
    apart,
    keeper_rows,
    keeper_seats,
    shared_layers_m,
    start_layers,
)
from tests.support.paths_reference import least_flat_m

SLABS = Slabs.between(10.0, (30.0, 42.0, 54.0))


def path_of(rng: np.random.Generator, slabs: Slabs) -> np.ndarray:
    """Some corners, in a layer, between layers or anywhere."""
    corners = rng.uniform(0.0, 60.0, (int(rng.integers(1, 5)), 3))
    kind = rng.integers(3)
    if kind == 0:
        corners[:, 2] = rng.choice(slabs.layers_m)
    elif kind == 1:
        corners[:, 2] = rng.choice(slabs.layers_m, len(corners))
    else:
        corners[:, 2] = rng.uniform(20.0, 65.0, len(corners))
    return corners


def sampled(path: np.ndarray) -> np.ndarray:
    """Many points of it."""
    if len(path) == 1:
        return path
    shares = np.linspace(0.0, 1.0, 60)[:, None]
    return np.concatenate([a + shares * (b - a) for a, b in itertools.pairwise(path)])


@given(seed=st.integers(0, 2**32 - 1))
def test_paths_that_are_apart_have_no_two_points_nearer_than_the_separation_and_1_m(
    seed: int,
) -> None:
    rng = np.random.default_rng(seed)
    one, other = path_of(rng, SLABS), path_of(rng, SLABS)
    gaps = np.linalg.norm(sampled(one)[:, None] - sampled(other)[None], axis=2)
    if apart(SLABS, one, other):
        assert gaps.min() >= SLABS.separation_m + 1.0 - 1e-9  # beside each other it is 2 m more
    assert apart(SLABS, one, other) == apart(SLABS, other, one)


@given(seed=st.integers(0, 2**32 - 1), relief_m=st.floats(0.0, 900.0))
def test_paths_over_hills_that_are_apart_have_no_two_points_nearer(
    seed: int, relief_m: float
) -> None:
    rng = np.random.default_rng(seed)
    slabs = Slabs.over(10.0, (30.0, 42.0, 54.0), (-20.0, relief_m - 20.0))
    one, other = (
        np.column_stack([each[:, :2], each[:, 2] + rng.uniform(-30.0, min(relief_m, 60.0))])
        for each in (path_of(rng, slabs), path_of(rng, slabs))
    )
    gaps = np.linalg.norm(sampled(one)[:, None] - sampled(other)[None], axis=2)
    if apart(slabs, one, other):
        assert gaps.min() >= slabs.separation_m - 1e-9
    elif least_flat_m(flat(one), flat(other)) >= slabs.separation_m + 2.0:
        raise AssertionError("what is apart as seen from above is apart")
    assert apart(slabs, one, other) == apart(slabs, other, one)
    for path in (one, other):
        reaches_m = [slabs.reach_m(slab) for slab in range(len(slabs))]
        assert slabs.touched(path) == {
            slab
            for slab, (low_m, high_m) in enumerate(reaches_m)
            if path[:, 2].min() < high_m and path[:, 2].max() > low_m
        }


def flat(path: np.ndarray) -> np.ndarray:
    """Its pieces, seen from above."""
    ends = np.concatenate([path, path[-1:]])[:, :2]
    return np.stack([ends[:-1], ends[1:]], axis=1)


@given(up_m=st.floats(-50.0, 400.0), relief_m=st.floats(0.0, 400.0))
def test_over_hills_level_flight_a_layer_higher_touches_nothing_in_common(
    up_m: float, relief_m: float
) -> None:
    slabs = Slabs.over(10.0, (30.0, 42.0), (0.0, relief_m))
    crossing = np.array([[0.0, 0.0, up_m], [50.0, 50.0, up_m]])
    higher = crossing + np.array([0.0, 0.0, 12.0 + 1e-6])
    inside = 30.0 < up_m < relief_m + 30.0

    assert not (slabs.touched(crossing) & slabs.touched(higher)) or not inside
    assert apart(slabs, crossing, higher) or not inside
    assert not apart(slabs, crossing, crossing + np.array([0.0, 0.0, 9.9]))


def test_over_mountains_slabs_are_thicker_and_not_more() -> None:
    slabs = Slabs.over(10.0, (30.0, 42.0), (0.0, 3000.0))
    assert len(slabs) == 256
    assert slabs.cuts_m[1] - slabs.cuts_m[0] == pytest.approx(3012.0 / 256)


@given(seed=st.integers(0, 2**32 - 1))
def test_paths_in_one_layer_are_apart_exactly_where_brute_force_says_so(seed: int) -> None:
    rng = np.random.default_rng(seed)
    one, other = path_of(rng, SLABS), path_of(rng, SLABS)
    one[:, 2] = other[:, 2] = 42.0
    gap_m = np.linalg.norm(sampled(one)[:, None] - sampled(other)[None], axis=2).min()
    if gap_m < 12.0 - 1e-3:  # both may be 1 m wrong
        assert not apart(SLABS, one, other)
    elif gap_m > 13.0:  # between two samples it is less by no more than that
        assert apart(SLABS, one, other)


@given(seed=st.integers(0, 2**32 - 1))
def test_least_distance_seen_from_above_is_that_of_brute_force(seed: int) -> None:
    rng = np.random.default_rng(seed)
    ones, others = rng.uniform(0.0, 10.0, (3, 2, 2)), rng.uniform(0.0, 10.0, (4, 2, 2))
    shares = np.linspace(0.0, 1.0, 200)[:, None, None]
    near = [
        (pieces[:, 0] + shares * (pieces[:, 1] - pieces[:, 0])).reshape(-1, 2)
        for pieces in (ones, others)
    ]
    brute_m = np.linalg.norm(near[0][:, None] - near[1][None], axis=2).min()
    exact_m = least_flat_m(ones, others)
    assert exact_m <= brute_m + 1e-9
    assert brute_m <= exact_m + 0.1


def test_level_flight_in_a_layer_touches_its_slab_alone() -> None:
    level = np.array([[0.0, 0.0, 42.0], [50.0, 0.0, 42.0]])
    assert SLABS.touched(level) == {1}
    assert SLABS.asked(level) == {1}


def test_a_way_that_slants_past_level_flight_keeps_room_for_errors_of_both_heights() -> None:
    """Where one ends 10.5 m below the other, which flies in the layer above, they are not apart."""
    slants = np.array([[0.0, 0.0, 30.0], [50.0, 0.0, 31.5]])
    level = np.array([[50.0, -50.0, 42.0], [50.0, 50.0, 42.0]])
    assert not apart(SLABS, slants, level)
    assert apart(SLABS, slants - np.array([0.0, 0.0, 1.1]), level)


def test_who_climbs_from_where_it_hovers_asks_the_layers_above_alone() -> None:
    climb = np.array([[0.0, 0.0, 30.0], [0.0, 0.0, 54.0], [50.0, 0.0, 54.0]])
    assert SLABS.touched(climb) == {0, 1, 2}
    assert SLABS.asked(climb) == {1, 2}
    assert SLABS.asked(climb, grounded=True) == {0, 1, 2}


def test_who_stays_where_it_hovers_asks_nobody() -> None:
    assert SLABS.asked(np.array([[0.0, 0.0, 30.0]])) == frozenset()


def test_who_hovers_keeps_the_whole_height_of_its_slab() -> None:
    hover = np.array([[0.0, 0.0, 42.0]])
    below = np.array([[11.0, -50.0, 36.5], [11.0, 50.0, 36.5]])  # beyond 12 m
    assert math.dist((0.0, 0.0, 42.0), (11.0, 0.0, 36.5)) > 12.0
    assert not apart(SLABS, hover, below)


def test_slabs_that_do_not_matter_are_left_out() -> None:
    crossing = np.array([[-5.0, 0.0, 42.0], [5.0, 0.0, 42.0]])
    assert not apart(SLABS, crossing, crossing)
    assert apart(SLABS, crossing, crossing, within=frozenset({0, 2}))


def test_a_band_has_as_many_layers_as_keep_the_separation_with_both_heights_wrong() -> None:
    assert shared_layers_m(10.0, 40, (30.0, 110.0), 10.0) == (
        30.0,
        42.0,
        54.0,
        66.0,
        78.0,
        90.0,
        102.0,
    )
    assert shared_layers_m(10.0, 40, (30.0, 30.5), 10.0) == (30.0,)


def test_without_a_band_everybody_finds_a_layer() -> None:
    assert shared_layers_m(10.0, 3, None, 10.0) == (10.0, 22.0, 34.0)


def test_layers_that_are_too_near_are_refused() -> None:
    with pytest.raises(ValueError, match="nearer than 12 m"):
        Slabs.between(10.0, (30.0, 40.0))


def test_starts_that_are_near_each_other_have_layers_that_differ() -> None:
    starts = [(0.0, 0.0, 0.0), (5.0, 0.0, 0.0), (50.0, 0.0, 0.0)]
    assert start_layers(SLABS, starts, (0, 0, 0)) == (0, 1, 0)


def test_a_start_too_crowded_for_the_layers_is_refused() -> None:
    starts = [(0.0, float(k), 0.0) for k in range(4)]
    assert start_layers(SLABS, starts, (0, 0, 0, 0)) is None


@given(layers=st.integers(1, 12), low_m=st.floats(-100.0, 500.0), relief_m=st.floats(0.0, 3000.0))
def test_slabs_over_hills_form_as_many_stacks_of_neighbours_as_layers(
    layers: int, low_m: float, relief_m: float
) -> None:
    heights_m = tuple(30.0 + 12.0 * k for k in range(layers))
    slabs = Slabs.over(10.0, heights_m, (low_m, low_m + relief_m))
    in_order = [slab for stack in slabs.stacks for slab in sorted(stack)]

    assert in_order == list(range(len(slabs)))
    assert len(slabs.stacks) == min(layers, len(slabs))
    sizes = [len(stack) for stack in slabs.stacks]
    assert max(sizes) - min(sizes) <= 1


def test_each_level_layer_is_a_stack_of_its_own() -> None:
    assert SLABS.stacks == (frozenset({0}), frozenset({1}), frozenset({2}))


@pytest.mark.parametrize(
    ("slabs", "uavs", "rows"),
    [(3, 5, (0, 1, 2)), (7, 2, (0, 0, 0, 0, 1, 1, 1)), (3, 1, (0, 0, 0))],
)
def test_every_slab_has_a_keeper(slabs: int, uavs: int, rows: tuple[int, ...]) -> None:
    assert keeper_rows(slabs, uavs) == rows


@pytest.mark.parametrize(
    ("slabs", "uavs", "seats"),
    [
        (2, 3, ((0, 1, 2), (1, 2, 0))),
        (2, 9, ((0, 3, 6), (1, 4, 7))),
        (3, 3, ((0,), (1,), (2,))),
        (1, 2, ((0,),)),
    ],
)
def test_three_keep_a_slab_where_not_everybody_can_have_one(
    slabs: int, uavs: int, seats: tuple[tuple[int, ...], ...]
) -> None:
    assert keeper_seats(slabs, uavs) == seats
    assert all(len(set(each)) == len(each) for each in keeper_seats(slabs, uavs))


def test_over_hills_three_keep_each_stack_as_soon_as_there_are_three() -> None:
    assert keeper_seats(3, 3, level=False) == ((0, 1, 2), (1, 2, 0), (2, 0, 1))
    assert keeper_seats(7, 3, level=False)[-1] == (2, 0, 1)
    assert keeper_seats(3, 2, level=False) == ((0,), (0,), (1,))
