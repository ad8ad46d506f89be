"""Heights of the ground and paths over it are what plain loops say."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from swarm.allocation.legs.ground import LINE_ABOVE_M, Ground
from swarm.kernels.ground import FEWER_CORNERS_M, drape_paths, ground_up_m
from tests.support.hills import above_m, hills, plain_length_m, plain_up_m

SEEDS = st.integers(0, 2**32 - 1)


@given(SEEDS)
@settings(max_examples=30, deadline=None)
def test_heights_are_bilinear_and_beyond_the_edges_those_of_the_edge(seed: int) -> None:
    terrain = hills(seed % 100)
    places_m = np.random.default_rng(seed).uniform(-400.0, 400.0, (30, 2))

    found_m = Ground(terrain).up_m(places_m)

    np.testing.assert_allclose(
        found_m, [plain_up_m(terrain, *place) for place in places_m.tolist()], atol=1e-9
    )


@given(SEEDS)
@settings(max_examples=60, deadline=None)
def test_no_point_of_a_path_over_the_ground_is_nearer_to_it_than_its_room(seed: int) -> None:
    rng = np.random.default_rng(seed)
    terrain = hills(seed % 100)
    ground = Ground(terrain)
    flat_m = rng.uniform(-250.0, 250.0, (int(rng.integers(2, 5)), 2))
    room_m = rng.uniform(0.0, 30.0, 2)
    ends_up_m = ground.up_m(flat_m[[0, -1]]) + room_m + rng.uniform(-4.0, 20.0, 2)

    path_m = ground.over_m(flat_m, tuple(ends_up_m), tuple(room_m))

    along_m = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path_m[:, :2], axis=0).T))])
    raised_m = path_m.copy()  # as if nothing had to be kept: the room changes evenly
    raised_m[:, 2] -= room_m[0] + along_m / along_m[-1] * (room_m[1] - room_m[0])
    inner = np.flatnonzero((along_m > 0.0) & (along_m < along_m[-1]))
    flown_m = raised_m[inner[0] - 1 : inner[-1] + 2] if len(inner) else raised_m
    vertical = np.hypot(*np.diff(flown_m[:, :2], axis=0).T) == 0.0
    assert not vertical[1:-1].any()
    begin = 1 if vertical[0] else 0
    end = len(flown_m) - (1 if vertical[-1] else 0)
    if len(inner):
        assert above_m(terrain, flown_m[begin:end]).min() >= -1e-6
    assert tuple(path_m[0]) == (*flat_m[0], ends_up_m[0])
    assert tuple(path_m[-1]) == (*flat_m[-1], ends_up_m[1])
    for corner in flat_m:
        assert (path_m[:, :2] == corner).all(axis=1).any()


@given(SEEDS)
@settings(max_examples=30, deadline=None)
def test_a_straight_path_is_the_shortest_but_for_having_few_corners(seed: int) -> None:
    rng = np.random.default_rng(seed)
    terrain = hills(seed % 100)
    ground = Ground(terrain)
    flat_m = rng.uniform(-250.0, 250.0, (2, 2))
    ends_up_m = ground.up_m(flat_m) + rng.uniform(0.0, 10.0, 2)

    path_m = ground.over_m(flat_m, tuple(ends_up_m), (0.0, 0.0))

    length_m = float(np.linalg.norm(np.diff(path_m, axis=0), axis=1).sum())
    ends_m = np.column_stack([flat_m, ends_up_m])
    least_m = plain_length_m(terrain, ends_m[0], ends_m[1], 600)
    assert least_m - 1e-3 <= length_m <= least_m + 4.0 * FEWER_CORNERS_M


def test_a_path_that_the_ground_does_not_touch_is_straight() -> None:
    ground = Ground(hills(1))
    path_m = ground.over_m(np.array([[-200.0, 0.0], [200.0, 50.0]]), (90.0, 120.0), (20.0, 20.0))
    np.testing.assert_array_equal(path_m, [[-200.0, 0.0, 90.0], [200.0, 50.0, 120.0]])


def test_who_is_too_low_climbs_before_anything_else() -> None:
    terrain = hills(2)
    ground = Ground(terrain)
    flat_m = np.array([[0.0, 0.0], [200.0, 50.0]])
    ground_m = ground.up_m(flat_m)
    path_m = ground.over_m(flat_m, (ground_m[0], ground_m[1] + 25.0), (25.0, 25.0))
    assert tuple(path_m[1, :2]) == (0.0, 0.0)
    assert path_m[1, 2] >= ground_m[0] + 25.0 - 1e-6


@given(SEEDS)
@example(seed=9999)
@settings(max_examples=40, deadline=None)
def test_a_line_follows_the_ground_alike_from_both_ends(seed: int) -> None:
    rng = np.random.default_rng(seed)
    terrain = hills(seed % 100)
    ground = Ground(terrain)
    points_m = rng.uniform(-200.0, 200.0, (int(rng.integers(2, 5)), 2))

    line_m = ground.along_m(points_m)

    over_m = above_m(terrain, line_m)
    assert over_m.min() >= -0.05
    assert over_m.max() <= LINE_ABOVE_M + 0.1
    np.testing.assert_array_equal(ground.along_m(points_m[::-1].copy()), line_m[::-1])


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("up_m", np.zeros((1, 4))),
        ("up_m", np.full((3, 3), np.nan)),
        ("frame_m", np.array([0.0, 0.0, 0.0, 1.0])),
        ("place_m", np.full((2, 2), np.inf)),
        ("first", np.array([0, 1])),
        ("first", np.array([0, 3])),
        ("ends_up_m", np.zeros((1, 3))),
    ],
)
def test_arguments_out_of_range_are_named(name: str, value: np.ndarray) -> None:
    given_ = {
        "up_m": np.zeros((3, 3)),
        "frame_m": np.array([0.0, 0.0, 1.0, 1.0]),
        "place_m": np.zeros((2, 2)),
        "first": np.array([0, 2]),
        "ends_up_m": np.zeros((1, 2)),
        "room_m": np.zeros((1, 2)),
        name: value,
    }
    with pytest.raises(ValueError, match=name):
        drape_paths(**given_)


def test_heights_of_no_places_are_none() -> None:
    assert ground_up_m(np.zeros((2, 2)), np.array([0.0, 0.0, 1.0, 1.0]), np.zeros((0, 2))).size == 0
