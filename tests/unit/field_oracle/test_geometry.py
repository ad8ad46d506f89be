"""Shortest ways: by hand, against a grid, and arcs between polygons in and round them."""

from __future__ import annotations

import heapq
import itertools
import math
import random

import pytest

from tests.support.field_oracle.geometry import Side, StraightWays, Way, blocks, side_of
from tests.support.field_oracle.made_up import made_up
from tests.support.field_oracle.rounded import RoundedWays, distance_m
from tests.support.field_oracle.scenario import FieldZone, Point, read
from tests.support.field_oracle.walk import intrusion_m

INF = math.inf


def zone(*rings: list[Point], inclusive: bool = False, name: str = "z") -> FieldZone:
    return FieldZone(name, tuple(tuple(ring) for ring in rings), -INF, INF, inclusive)


def box(west: float, south: float, east: float, north: float) -> list[Point]:
    return [(west, south), (east, south), (east, north), (west, north)]


def length_m(way: Way | None) -> float:
    assert way is not None
    return way.length_m


def test_inside_border_and_outside_are_told_apart_to_the_last_bit() -> None:
    triangle = [((0.0, 0.0), (3.0, 1.0), (0.0, 5.0))]

    assert side_of((1.5, 0.5), triangle) is Side.BORDER
    assert side_of((1.5, math.nextafter(0.5, 1.0)), triangle) is Side.INSIDE
    assert side_of((1.5, math.nextafter(0.5, 0.0)), triangle) is Side.OUTSIDE


def test_way_round_a_box_bends_at_its_corners() -> None:
    ways = StraightWays([zone(box(-2.0, -10.0, 2.0, 3.0))])

    way = ways.find((-6.0, 0.0), (6.0, 0.0))

    assert way is not None
    assert way.points == ((-6.0, 0.0), (-2.0, 3.0), (2.0, 3.0), (6.0, 0.0))
    assert way.length_m == 14.0


def test_way_along_a_border_is_straight() -> None:
    ways = StraightWays([zone(box(-2.0, -3.0, 2.0, 0.0))])

    assert length_m(ways.find((-6.0, 0.0), (6.0, 0.0))) == 12.0
    assert length_m(ways.find((-2.0, -3.0), (-2.0, 8.0))) == 11.0  # from corner to beyond


def test_each_zone_keeps_out_by_itself_so_a_common_border_is_a_way() -> None:
    north, south = zone(box(-2.0, 0.0, 2.0, 9.0)), zone(box(-2.0, -9.0, 2.0, 0.0))

    assert length_m(StraightWays([north, south]).find((-6.0, 0.0), (6.0, 0.0))) == 12.0


def test_overlapping_zones_are_gone_round_together() -> None:
    north, south = zone(box(-2.0, -1.0, 2.0, 9.0)), zone(box(-3.0, -3.0, 3.0, 1.0))

    way = StraightWays([north, south]).find((-7.0, 0.0), (7.0, 0.0))

    assert way is not None
    assert way.points == ((-7.0, 0.0), (-3.0, -3.0), (3.0, -3.0), (7.0, 0.0))
    assert way.length_m == 16.0


def test_hole_is_free_and_shut() -> None:
    ring = zone(box(0.0, 0.0, 10.0, 10.0), box(4.0, 4.0, 6.0, 6.0))

    assert length_m(StraightWays([ring]).find((4.5, 4.5), (5.5, 4.5))) == 1.0
    assert StraightWays([ring]).find((5.0, 5.0), (20.0, 5.0)) is None


def test_hole_that_touches_the_border_of_its_zone_has_a_gate() -> None:
    ring = zone(box(0.0, 0.0, 10.0, 10.0), [(5.0, 2.0), (10.0, 5.0), (5.0, 8.0)])

    assert length_m(StraightWays([ring]).find((7.0, 5.0), (20.0, 5.0))) == 13.0


def test_inclusive_zone_is_the_only_place_where_to_fly() -> None:
    horseshoe = [(0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (6.0, 10.0)]
    horseshoe += [(6.0, 4.0), (4.0, 4.0), (4.0, 10.0), (0.0, 10.0)]
    ways = StraightWays([zone(horseshoe, inclusive=True)])

    assert length_m(ways.find((4.0, 9.0), (6.0, 9.0))) == 12.0
    assert length_m(ways.find((0.0, 0.0), (0.0, 10.0))) == 10.0  # its border
    assert ways.find((1.0, 1.0), (20.0, 1.0)) is None


def test_of_two_inclusive_zones_only_what_both_have_is_free() -> None:
    west, east = box(0.0, 0.0, 6.0, 9.0), box(4.0, 0.0, 10.0, 9.0)
    ways = StraightWays([zone(west, inclusive=True), zone(east, inclusive=True)])

    assert length_m(ways.find((4.0, 1.0), (6.0, 1.0))) == 2.0
    assert ways.find((1.0, 1.0), (9.0, 1.0)) is None


def test_pieces_have_directions_and_lengths() -> None:
    way = StraightWays([zone(box(-2.0, -10.0, 2.0, 3.0))]).find((-6.0, 0.0), (6.0, 0.0))

    assert way is not None
    assert [piece.length_m for piece in way.pieces] == [5.0, 4.0, 5.0]
    assert [piece.direction for piece in way.pieces] == [(0.8, 0.6), (1.0, 0.0), (0.8, -0.6)]


def test_no_length_has_no_pieces() -> None:
    way = StraightWays([]).find((1.0, 2.0), (1.0, 2.0))

    assert way is not None
    assert (way.length_m, way.pieces) == (0.0, ())


@pytest.mark.parametrize("kind", ["zones", "inclusive"])
@pytest.mark.parametrize("seed", range(4))
def test_way_is_free_and_no_grid_knows_a_shorter_one(kind: str, seed: int) -> None:
    scenario = read(made_up(seed, kind))
    ways = StraightWays(scenario.zones)
    ends = [task.stops[0].at for task in scenario.tasks]
    grid = Grid(scenario.zones)

    for a, b in itertools.pairwise(ends):
        way, rough_m = ways.find(a, b), grid.length_m(a, b)
        if way is None:
            assert rough_m is None
            continue
        for one, two in itertools.pairwise(way.points):
            assert all(intrusion_m(each, one, two, 0.0) < 1e-9 for each in scenario.zones)
        assert rough_m is None or way.length_m <= rough_m + 1e-9
        # Directions are 16, so by the best of them a straight way is 1.03 times as long.
        assert rough_m is None or rough_m <= 1.1 * way.length_m + 60.0


class Grid:
    """Ways from point to point of a grid, tested by points on them; quite another search."""

    STEP_M = 12.5

    def __init__(self, zones: tuple[FieldZone, ...]) -> None:
        self._zones = zones
        self._good: dict[Point, bool] = {}

    def length_m(self, a: Point, b: Point) -> float | None:
        """The shortest way that keeps to the grid but for its ends; None if it knows none."""
        best = {node: math.dist(a, node) for node in self._near(a)}
        queue = [(length, node) for node, length in best.items()]
        heapq.heapify(queue)
        done = set()
        while queue:
            length, node = heapq.heappop(queue)
            if node in done:
                continue
            done.add(node)
            for east, north in STEPS:
                other = (node[0] + east * self.STEP_M, node[1] + north * self.STEP_M)
                further = length + math.dist(node, other)
                if further < best.get(other, INF) and self._is_free(node, other):
                    best[other] = further
                    heapq.heappush(queue, (further, other))
        ends = [best[node] + math.dist(node, b) for node in self._near(b) if node in best]
        return min(ends, default=None)

    def _near(self, end: Point) -> list[Point]:
        corner = [math.floor(c / self.STEP_M) * self.STEP_M for c in end]
        around = itertools.product((-self.STEP_M, 0.0, self.STEP_M, 2 * self.STEP_M), repeat=2)
        near = [(corner[0] + dx, corner[1] + dy) for dx, dy in around]
        return [node for node in near if self._is_free(end, node)]

    def _is_free(self, a: Point, b: Point) -> bool:
        if not all(-50.0 <= c <= 460.0 for c in b):
            return False
        shares = [index / 8 for index in range(9)]
        return all(
            self._is_good(a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])) for t in shares
        )

    def _is_good(self, x: float, y: float) -> bool:
        if (x, y) not in self._good:
            self._good[x, y] = all(z.inclusive == winds_round(z, x, y) for z in self._zones)
        return self._good[x, y]


STEPS = [(x, y) for x, y in itertools.product(range(-2, 3), repeat=2) if math.gcd(x, y) == 1]


def winds_round(zone: FieldZone, x: float, y: float) -> bool:
    """Whether the borders of ``zone`` wind round a point: by the sum of angles."""
    n_rings = 0
    for ring in zone.rings:
        angles = [math.atan2(cy - y, cx - x) for cx, cy in ring]
        turns = (b - a for a, b in zip(angles, [*angles[1:], angles[0]], strict=True))
        n_rings += abs(sum(math.remainder(turn, math.tau) for turn in turns)) > 3.0
    return n_rings == 1


def test_margin_over_two_corners_by_hand() -> None:
    ways = RoundedWays([zone(box(-1.0, -100.0, 1.0, 10.0))], 5.0)

    way = ways.find((-50.0, 0.0), (50.0, 0.0))

    tangent_m = math.sqrt(49.0**2 + 10.0**2 - 5.0**2)
    turn_rad = math.atan2(10.0, 49.0) + math.asin(5.0 / math.hypot(49.0, 10.0))
    assert length_m(way) == pytest.approx(2.0 * tangent_m + 2.0 * 5.0 * turn_rad + 2.0, abs=1e-9)


def test_margin_shuts_a_gap_that_is_narrower_than_twice() -> None:
    gate = [zone(box(-60.0, 0.0, -4.0, 5.0)), zone(box(4.0, 0.0, 60.0, 5.0), name="y")]

    assert length_m(RoundedWays(gate, 4.0).find((0.0, -20.0), (0.0, 20.0))) == 40.0
    assert length_m(RoundedWays(gate, 4.1).find((0.0, -20.0), (0.0, 20.0))) > 120.0


def test_margin_within_an_inclusive_zone() -> None:
    corner = [(0.0, 0.0), (20.0, 0.0), (20.0, 20.0), (10.0, 20.0), (10.0, 10.0), (0.0, 10.0)]
    ways = RoundedWays([zone(corner, inclusive=True)], 2.0)

    way = ways.find((2.0, 8.0), (12.0, 18.0))

    # Along both walls, and a quarter of a circle round the corner that juts in.
    assert length_m(way) == pytest.approx(8.0 + 8.0 + math.pi, abs=1e-9)


def test_chain_of_an_arc_is_hardly_shorter_than_the_arc() -> None:
    way = RoundedWays([zone(box(-1.0, -100.0, 1.0, 10.0))], 9.0).find((-20.0, 0.0), (20.0, 0.0))

    assert way is not None
    chain_m = math.fsum(math.dist(a, b) for a, b in itertools.pairwise(way.points))
    assert way.length_m * (1.0 - 3.2e-6) < chain_m < way.length_m


@pytest.mark.parametrize("seed", range(6))
def test_arcs_lie_between_polygons_in_and_round_them(seed: int) -> None:
    """The margin of a convex zone is a hull of circles; polygons in and round those bound it."""
    rng = random.Random(seed)
    margin_m, n = rng.uniform(3.0, 25.0), 12
    zones, within, around = [], [], []
    for index in range(rng.randint(1, 2)):
        middle = (rng.uniform(60.0, 240.0), rng.uniform(40.0, 260.0))
        spread = [(middle[0] + rng.gauss(0, 40), middle[1] + rng.gauss(0, 40)) for _ in range(6)]
        corners = hull(spread)
        zones.append(zone(corners, name=f"z{index}"))
        within.append(zone(hull(circles(corners, margin_m, n))))
        around.append(zone(hull(circles(corners, margin_m / math.cos(math.pi / n), n))))
    free = [
        point
        for point in ((rng.uniform(0.0, 300.0), rng.uniform(0.0, 300.0)) for _ in range(40))
        if not any(blocks(each, point, point) for each in around)
    ]

    for a, b in itertools.pairwise(free[:4]):
        way = RoundedWays(zones, margin_m).find(a, b)
        shorter, longer = StraightWays(within).find(a, b), StraightWays(around).find(a, b)
        assert length_m(shorter) - 1e-6 <= length_m(way) <= length_m(longer) + 1e-6


def circles(corners: list[Point], radius_m: float, n: int) -> list[Point]:
    angles = [math.tau * index / n for index in range(n)]
    return [
        (x + radius_m * math.cos(angle), y + radius_m * math.sin(angle))
        for x, y in corners
        for angle in angles
    ]


def hull(points: list[Point]) -> list[Point]:
    """The convex hull (gift wrapping)."""
    start = min(points)
    corners = [start]
    while True:
        here, best = corners[-1], points[0] if points[0] != corners[-1] else points[1]
        for point in points:
            turn = (best[0] - here[0]) * (point[1] - here[1])
            turn -= (best[1] - here[1]) * (point[0] - here[0])
            if point != here and turn < 0.0:
                best = point
        if best == start or len(corners) > len(points):
            return corners
        corners.append(best)


@pytest.mark.parametrize("kind", ["zones", "inclusive"])
@pytest.mark.parametrize("seed", range(4))
def test_smallest_margin_hardly_changes_a_way(kind: str, seed: int) -> None:
    """Corners that jut in, holes and inclusive zones: two searches with nothing in common."""
    scenario = read(made_up(seed, kind))
    straight, rounded = StraightWays(scenario.zones), RoundedWays(scenario.zones, 1e-3)
    ends = [task.stops[0].at for task in scenario.tasks]

    for a, b in itertools.pairwise(ends):
        one, two = straight.find(a, b), rounded.find(a, b)
        assert (one is None) is (two is None)
        if one is not None:
            assert one.length_m - 1e-6 <= length_m(two) <= one.length_m + 0.05


@pytest.mark.parametrize("seed", range(6))
def test_way_keeps_the_margin(seed: int) -> None:
    scenario = read(made_up(seed, "margin"))
    ways = RoundedWays(scenario.zones, scenario.margin_m)
    ends = [task.stops[0].at for task in scenario.tasks]

    for a, b in itertools.pairwise(ends):
        way = ways.find(a, b)
        for one, two in itertools.pairwise(() if way is None else way.points):
            deep_m = max(intrusion_m(z, one, two, scenario.margin_m) for z in scenario.zones)
            assert deep_m < 1e-5 * scenario.margin_m + 1e-6


def test_distance_of_straight_pieces() -> None:
    assert distance_m((0.0, 0.0), (4.0, 0.0), (2.0, -1.0), (2.0, 1.0)) == 0.0
    assert distance_m((0.0, 0.0), (4.0, 0.0), (7.0, 4.0), (7.0, 9.0)) == 5.0
    assert distance_m((0.0, 0.0), (4.0, 0.0), (1.0, 3.0), (9.0, 3.0)) == 3.0
