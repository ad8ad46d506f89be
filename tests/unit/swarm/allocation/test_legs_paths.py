from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest

from swarm.allocation.legs import PathPlanner
from swarm.model.ids import ZoneId
from swarm.model.rings import Corner
from swarm.model.zones import Zone
from tests.support.plain_paths import PlainZones, random_zones

FloatArray = npt.NDArray[np.float64]

SQUARE: tuple[Corner, ...] = ((0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0))


def zone(polygon: tuple[Corner, ...], *holes: tuple[Corner, ...], inclusive: bool = False) -> Zone:
    return Zone(ZoneId("z"), polygon, holes, inclusive=inclusive)


def box(west: float, south: float, east: float, north: float) -> Zone:
    return zone(((west, south), (east, south), (east, north), (west, north)))


def at(east_m: float, north_m: float) -> FloatArray:
    return np.array([east_m, north_m])


def length_m(planner: PathPlanner, from_m: FloatArray, to_m: FloatArray) -> float:
    return float(planner.targets(to_m[None]).paths_from(from_m[None]).length_m[0, 0])


def flown_m(corners_m: FloatArray) -> float:
    return float(np.hypot(*np.diff(corners_m, axis=0).T).sum())


def free_places(
    rng: np.random.Generator, planner: PathPlanner, count: int, size_m: float = 100.0
) -> FloatArray:
    places_m = rng.uniform(0.0, size_m, (20 * count, 2))
    return places_m[planner.free(places_m)][:count]


# -- By hand --------------------------------------------------------------------------------------


def test_path_round_a_square_bends_at_its_corners() -> None:
    planner = PathPlanner([zone(SQUARE)])

    path_m = planner.path_m(at(-5.0, 4.0), at(15.0, 4.0))

    assert path_m is not None
    assert path_m.tolist() == [[-5.0, 4.0], [0.0, 0.0], [10.0, 0.0], [15.0, 4.0]]
    assert length_m(planner, path_m[0], path_m[-1]) == 10.0 + 2.0 * math.hypot(5.0, 4.0)


def test_margin_rounds_the_corners() -> None:
    planner = PathPlanner([zone(SQUARE)], margin_m=1.0)
    to_tangent_m = math.sqrt(5.0**2 + 5.0**2 - 1.0)
    turn_rad = math.pi / 4 + math.asin(1.0 / math.hypot(5.0, 5.0))

    found_m = length_m(planner, at(-5.0, 5.0), at(15.0, 5.0))

    assert found_m == pytest.approx(2.0 * (to_tangent_m + turn_rad) + 10.0, rel=1e-12)


def test_borders_are_outside() -> None:
    """Along an edge, from corner to corner, and between two zones that share an edge."""
    planner = PathPlanner([box(0.0, 0.0, 10.0, 10.0), box(10.0, 0.0, 20.0, 10.0)])
    from_m = np.array([[-5.0, 0.0], [10.0, -5.0], [0.0, 10.0], [5.0, -1.0], [0.0, 0.0]])
    to_m = np.array([[25.0, 0.0], [10.0, 15.0], [20.0, 10.0], [5.0, 0.0], [20.0, 10.0]])

    assert planner.clear(from_m, to_m).tolist() == [True, True, True, True, False]
    assert planner.free(np.array([[10.0, 5.0], [10.1, 5.0]])).tolist() == [True, False]


def test_margin_closes_a_gap_that_is_narrower_than_two() -> None:
    two = [box(0.0, 0.0, 10.0, 30.0), box(12.0, 0.0, 22.0, 30.0)]
    below_m, above_m = at(11.0, -5.0), at(11.0, 35.0)

    assert length_m(PathPlanner(two, margin_m=1.0), below_m, above_m) == 40.0
    assert length_m(PathPlanner(two, margin_m=1.01), below_m, above_m) > 50.0


def test_overlapping_margins_hide_corners() -> None:
    """Arcs cross in the notch between two boxes: none is passed inside of the other."""
    two = [box(0.0, 0.0, 10.0, 10.0), box(10.5, -3.0, 20.0, 10.0)]
    planner, plain = PathPlanner(two, margin_m=1.0), PlainZones(two, margin_m=1.0)

    path_m = planner.path_m(at(-5.0, 2.0), at(15.0, -8.0))

    assert path_m is not None
    assert max_depth_m(plain, path_m) < 2e-6
    assert flown_m(path_m) <= plain.length_m(path_m[0], path_m[-1])


def test_hole_of_a_zone_may_be_flown_in_but_is_not_left() -> None:
    ring = zone(SQUARE, ((2.0, 2.0), (8.0, 2.0), (8.0, 8.0), (5.0, 4.0), (2.0, 8.0)))
    planner = PathPlanner([ring])

    assert length_m(planner, at(2.5, 7.0), at(7.5, 7.0)) == pytest.approx(2 * math.hypot(2.5, 3.0))
    assert length_m(planner, at(5.0, 3.0), at(5.0, 12.0)) == math.inf
    assert planner.path_m(at(5.0, 3.0), at(5.0, 12.0)) is None


def test_inclusive_zone_is_the_only_place_where_to_fly() -> None:
    bay = zone(
        (
            (0.0, 0.0),
            (30.0, 0.0),
            (30.0, 30.0),
            (16.0, 30.0),
            (15.0, 5.0),
            (14.0, 30.0),
            (0.0, 30.0),
        ),
        ((2.0, 2.0), (4.0, 2.0), (4.0, 4.0), (2.0, 4.0)),
        inclusive=True,
    )
    planner = PathPlanner([bay])

    assert planner.free(np.array([[0.0, 0.0], [3.0, 3.0], [15.0, 20.0], [-1.0, 5.0]])).tolist() == [
        True,
        False,
        False,
        False,
    ]
    path_m = planner.path_m(at(10.0, 20.0), at(20.0, 20.0))
    assert path_m is not None
    assert path_m.tolist() == [[10.0, 20.0], [15.0, 5.0], [20.0, 20.0]]
    narrow = PathPlanner([bay], margin_m=1.0)
    assert narrow.free(np.array([[0.5, 10.0], [1.0, 10.0], [4.5, 4.5]])).tolist() == [
        False,
        True,
        False,
    ]


def test_several_inclusive_zones_leave_what_they_share() -> None:
    shapes = [box(0.0, 0.0, 10.0, 10.0), box(5.0, 0.0, 15.0, 10.0)]
    both = PathPlanner([zone(shape.polygon_enu_m, inclusive=True) for shape in shapes])

    assert both.free(np.array([[2.0, 5.0], [7.0, 5.0], [12.0, 5.0]])).tolist() == [
        False,
        True,
        False,
    ]


def test_place_in_a_zone_is_left_by_the_shortest_way_and_not_flown_to() -> None:
    two = [box(0.0, 0.0, 10.0, 10.0), box(8.0, 0.0, 18.0, 10.0)]
    planner = PathPlanner(two, margin_m=1.0)
    inside_m = at(9.0, 3.0)

    path_m = planner.path_m(inside_m, at(9.0, -20.0))

    assert path_m is not None
    np.testing.assert_allclose(path_m, [[9.0, 3.0], [9.0, -1.0], [9.0, -20.0]], atol=1e-3)
    assert length_m(planner, inside_m, at(9.0, -20.0)) == pytest.approx(23.0)
    assert length_m(planner, at(9.0, -20.0), inside_m) == math.inf
    assert length_m(planner, inside_m, at(9.0, 20.0)) > 2 * 4.0 + 21.0


def test_without_zones_paths_are_straight() -> None:
    planner = PathPlanner([])

    assert planner.path_m(at(1.0, 2.0), at(4.0, 6.0)).tolist() == [[1.0, 2.0], [4.0, 6.0]]  # type: ignore[union-attr]
    assert length_m(planner, at(1.0, 2.0), at(4.0, 6.0)) == 5.0


def test_margin_below_zero_is_refused() -> None:
    with pytest.raises(ValueError, match="margin_m must be >= 0, not -1"):
        PathPlanner([], margin_m=-1.0)


# -- Against a plain reference --------------------------------------------------------------------


def max_depth_m(plain: PlainZones, corners_m: FloatArray) -> float:
    return float(plain.depth_along_m(corners_m[:-1], corners_m[1:]).max())


@pytest.mark.parametrize("seed", range(12))
def test_paths_are_as_short_as_those_of_a_plain_visibility_graph(seed: int) -> None:
    rng = np.random.default_rng(seed)
    zones = random_zones(rng, 3)
    planner, plain = PathPlanner(zones), PlainZones(zones)
    places_m = free_places(rng, planner, 4)

    found_m = planner.targets(places_m).paths_from(places_m).length_m

    for row, from_m in enumerate(places_m):
        for column in range(row):
            expected_m = plain.length_m(from_m, places_m[column])
            assert found_m[row, column] == pytest.approx(expected_m, rel=1e-9)


@pytest.mark.parametrize("seed", range(6))
def test_paths_with_a_margin_are_no_longer_than_plain_ones_round_chords(seed: int) -> None:
    rng = np.random.default_rng(seed)
    zones = random_zones(rng, 2, n_corner=5)
    planner, plain = PathPlanner(zones, margin_m=3.0), PlainZones(zones, margin_m=3.0)
    from_m, to_m = free_places(rng, planner, 40)[[0, -1]]

    found_m = length_m(planner, from_m, to_m)

    reference_m = plain.length_m(from_m, to_m)
    assert found_m <= reference_m * (1.0 + 1e-9)
    assert found_m >= reference_m * (1.0 - 3e-3)


@pytest.mark.parametrize("margin_m", [0.0, 2.5])
@pytest.mark.parametrize("seed", range(4))
def test_no_path_meets_the_inside_of_a_zone_or_its_margin(seed: int, margin_m: float) -> None:
    rng = np.random.default_rng(seed)
    zones = random_zones(rng, 4)
    planner, plain = PathPlanner(zones, margin_m), PlainZones(zones, margin_m)
    places_m = free_places(rng, planner, 4)
    paths = planner.targets(places_m).paths_from(places_m)

    for row in range(len(places_m)):
        for column in range(row):
            if not math.isfinite(paths.length_m[row, column]):
                continue
            corners_m = paths.corners_m(row, column)
            assert corners_m[0].tolist() == places_m[row].tolist()
            assert corners_m[-1].tolist() == places_m[column].tolist()
            assert max_depth_m(plain, corners_m) < 2e-6
            excess = flown_m(corners_m) / paths.length_m[row, column] - 1.0
            assert -1e-12 < excess < 1e-6


@pytest.mark.parametrize("margin_m", [0.0, 4.0])
@pytest.mark.parametrize("seed", range(8))
def test_lengths_are_a_metric_that_zones_only_lengthen(seed: int, margin_m: float) -> None:
    """The same both ways, never shorter than straight or than with fewer zones, no short cut."""
    rng = np.random.default_rng(seed)
    zones = random_zones(rng, 6, n_corner=12, size_m=300.0)
    planner = PathPlanner(zones, margin_m)
    places_m = free_places(rng, planner, 60, size_m=300.0)

    found_m = planner.targets(places_m).paths_from(places_m).length_m

    straight_m = np.hypot(*(places_m[:, None] - places_m).T)
    before_m = PathPlanner(zones[:4], margin_m).targets(places_m).paths_from(places_m).length_m
    np.testing.assert_allclose(found_m, found_m.T, rtol=1e-12)
    assert (found_m >= straight_m * (1.0 - 1e-12)).all()
    assert (found_m >= before_m * (1.0 - 1e-12)).all()
    over_m = (found_m[:, :, None] + found_m[None]).min(axis=1)
    assert (found_m <= over_m * (1.0 + 1e-12) + 1e-9).all()
    assert (found_m > straight_m * 1.001).any()


@pytest.mark.parametrize("seed", range(4))
def test_an_answer_does_not_depend_on_what_else_is_asked(seed: int) -> None:
    """So that a UAV in flight finds the same floats as the planner that asked for all pairs."""
    rng = np.random.default_rng(seed)
    planner = PathPlanner(random_zones(rng, 5, n_corner=9, size_m=200.0), margin_m=2.0)
    places_m = free_places(rng, planner, 30, size_m=200.0)
    targets = planner.targets(places_m)

    all_m = targets.paths_from(places_m).length_m

    for row in range(0, 30, 7):
        assert (
            targets.paths_from(places_m[row : row + 1]).length_m[0].tolist() == all_m[row].tolist()
        )
        assert length_m(planner, places_m[row], places_m[3]) == all_m[row, 3]


@pytest.mark.parametrize("margin_m", [0.0, 4.0])
@pytest.mark.parametrize("seed", range(5))
def test_on_its_way_a_uav_finds_the_rest_of_its_path(seed: int, margin_m: float) -> None:
    """Although places on a border, on an arc or at a corner are rounded."""
    rng = np.random.default_rng(seed)
    planner = PathPlanner(random_zones(rng, 5, n_corner=9, size_m=200.0), margin_m)
    places_m = free_places(rng, planner, 12, size_m=200.0)
    targets = planner.targets(places_m)
    paths = targets.paths_from(places_m)
    bent = np.isfinite(paths.length_m) & ~paths.is_straight

    for row, column in np.argwhere(bent)[:25]:
        corners_m = paths.corners_m(int(row), int(column))
        piece_m = np.hypot(*np.diff(corners_m, axis=0).T)
        begun = rng.integers(0, len(piece_m), 4)
        share = np.append(rng.uniform(0.0, 1.0, 3), 0.0)
        here_m = corners_m[begun] + share[:, None] * (corners_m[begun + 1] - corners_m[begun])
        rest_m = [
            piece_m[n + 1 :].sum() + (1.0 - s) * piece_m[n]
            for n, s in zip(begun, share, strict=True)
        ]
        found_m = targets.paths_from(here_m).length_m[:, column]
        np.testing.assert_allclose(found_m, rest_m, atol=2e-6 * paths.length_m[row, column])
