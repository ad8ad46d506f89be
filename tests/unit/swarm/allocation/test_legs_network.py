from __future__ import annotations

import math
import pickle

import numpy as np
import numpy.typing as npt
import pytest

from swarm.allocation.legs import Airspace, FlightModel, LegNetwork
from swarm.model.ids import ZoneId
from swarm.model.zones import Zone
from tests.support.plain_paths import random_zones
from tests.support.problems import random_problem

FloatArray = npt.NDArray[np.float64]

PLAIN = FlightModel(8.0)
WINDY = FlightModel(10.0, acceleration_m_s2=2.5, airspeed_m_s=9.0, wind_enu_m_s=(3.0, -1.0))
SQUARE = ((0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0))


def wall(floor_m: float | None = None, ceiling_m: float | None = None) -> Zone:
    return Zone(ZoneId("wall"), SQUARE, floor_m=floor_m, ceiling_m=ceiling_m)


def random_network(seed: int, margin_m: float, count: int = 25) -> LegNetwork:
    rng = np.random.default_rng(seed)
    airspace = Airspace(random_zones(rng, 4, n_corner=9, size_m=200.0), margin_m)
    flat_m = rng.uniform(0.0, 200.0, (20 * count, 2))
    flat_m = flat_m[airspace.concerning(0.0, 0.0).free(flat_m)][:count]
    return LegNetwork(airspace, np.column_stack([flat_m, rng.uniform(0.0, 20.0, count)]))


@pytest.mark.parametrize("seed", range(5))
def test_times_without_zones_are_those_of_the_problem_to_the_last_bit(seed: int) -> None:
    rng = np.random.default_rng(seed)
    problem = random_problem(rng, 2, 30)
    network = LegNetwork(Airspace(), problem.task_enu_m)
    place_m = rng.uniform(0.0, 10.0, 3)

    for uav in range(2):
        model = FlightModel(float(problem.speed_m_s[uav]))
        expected_s = problem.travel_between_s(uav)
        assert network.legs.times_s(model).tolist() == expected_s.tolist()
        from_place_s = network.legs_from(place_m).times_s(model)[0]
        assert from_place_s.tolist() == problem.travel_s(uav, place_m).tolist()


def test_legs_that_see_each_other_keep_their_times_beside_zones() -> None:
    rng = np.random.default_rng(7)
    nodes_m = rng.uniform(20.0, 90.0, (20, 3))
    there, gone = LegNetwork(Airspace([wall()], 2.0), nodes_m), LegNetwork(Airspace(), nodes_m)

    for model in (PLAIN, WINDY):
        assert there.legs.times_s(model).tolist() == gone.legs.times_s(model).tolist()


def test_height_is_gained_along_the_way() -> None:
    network = LegNetwork(Airspace([wall()]), np.array([[-5.0, 4.0, 0.0], [15.0, 4.0, 6.0]]))
    flat_m = 10.0 + 2.0 * math.hypot(5.0, 4.0)

    assert network.legs.length_m[0, 1] == math.sqrt(flat_m * flat_m + 36.0)
    assert network.legs.times_s(PLAIN)[0, 1] == network.legs.length_m[0, 1] / 8.0
    corners_m = network.legs.corners_m(0, 1)
    assert corners_m is not None
    assert corners_m[:, :2].tolist() == [[-5.0, 4.0], [0.0, 0.0], [10.0, 0.0], [15.0, 4.0]]
    rise = np.diff(corners_m[:, 2]) / np.hypot(*np.diff(corners_m[:, :2], axis=0).T)
    np.testing.assert_allclose(rise, 6.0 / flat_m)


def test_a_zone_concerns_only_who_uses_its_heights() -> None:
    airspace = Airspace([wall(floor_m=20.0, ceiling_m=60.0)])
    nodes_m = np.array([[-5.0, 4.0, 0.0], [15.0, 4.0, 0.0], [15.0, 5.0, 50.0]])
    below, inside = LegNetwork(airspace, nodes_m, 15.0, 15.0), LegNetwork(airspace, nodes_m, 30, 30)

    assert below.legs.length_m[0, 1] == 20.0
    assert inside.legs.length_m[0, 1] == 10.0 + 2.0 * math.hypot(5.0, 4.0)
    band = LegNetwork(airspace, nodes_m, 60.0, 110.0)
    assert band.legs.length_m[0, 1] == 20.0
    # Layers above the ends: only the leg that climbs comes into the zone.
    climbing = LegNetwork(airspace, nodes_m, nodes_m[:, 2] + 15.0, nodes_m[:, 2] + 15.0)
    assert climbing.legs.length_m[0, 1] == 20.0
    assert climbing.legs.length_m[0, 2] > math.hypot(20.0, 1.0, 50.0)
    assert climbing.legs.length_m[2, 0] == pytest.approx(climbing.legs.length_m[0, 2], rel=1e-12)
    from_low = climbing.legs_from(nodes_m[0], 15.0, 15.0)
    assert from_low.length_m[0].tolist() == climbing.legs.length_m[0].tolist()


@pytest.mark.parametrize("margin_m", [0.0, 6.0])
@pytest.mark.parametrize("seed", range(4))
def test_times_are_those_of_the_corners_flown(seed: int, margin_m: float) -> None:
    legs = random_network(seed, margin_m).legs
    windy_s, plain_s = legs.times_s(WINDY), legs.times_s(PLAIN)
    winding = 0

    for row in range(25):
        for column in range(25):
            corners_m = legs.corners_m(row, column)
            if row == column or corners_m is None:
                continue
            winding += len(corners_m) > 2
            assert WINDY.path_s(corners_m) == pytest.approx(windy_s[row, column], rel=3e-6)
            assert PLAIN.path_s(corners_m) == pytest.approx(plain_s[row, column], rel=1.01e-6)

    assert winding > 50


def test_wind_tells_there_from_back_and_calm_does_not() -> None:
    legs = random_network(1, 4.0).legs

    np.testing.assert_allclose(legs.times_s(PLAIN), legs.times_s(PLAIN).T, rtol=1e-12)
    there_s = legs.times_s(WINDY)
    apart = (there_s - there_s.T) / np.maximum(there_s, 1.0)
    assert apart.max() > 0.2


@pytest.mark.parametrize("seed", range(3))
def test_a_uav_in_flight_finds_the_floats_of_the_planner(seed: int) -> None:
    network = random_network(seed, 4.0)

    for row in (0, 11, 24):
        alone = network.legs_from(network.node_enu_m[row])
        for model in (PLAIN, WINDY):
            assert alone.times_s(model)[0].tolist() == network.legs.times_s(model)[row].tolist()
        again_m, planned_m = alone.corners_m(0, 3), network.legs.corners_m(row, 3)
        assert again_m is not None
        assert planned_m is not None
        assert again_m.tolist() == planned_m.tolist()


def test_a_uav_that_a_zone_is_drawn_over_leaves_it_first() -> None:
    network = LegNetwork(Airspace([wall()]), np.array([[20.0, 9.0, 0.0], [5.0, 5.0, 0.0]]))
    legs = network.legs_from(np.array([9.0, 9.5, 0.0]))

    corners_m = legs.corners_m(0, 0)

    assert corners_m is not None
    expected_m = np.array([[9.0, 9.5], [9.0, 10.0], [10.0, 10.0], [20.0, 9.0]])
    np.testing.assert_allclose(corners_m[:, :2], expected_m, atol=1e-5)
    assert legs.length_m[0, 0] == pytest.approx(1.5 + math.hypot(10.0, 1.0))
    assert legs.times_s(WINDY)[0, 0] == pytest.approx(WINDY.path_s(corners_m), rel=1e-9)
    assert legs.length_m[0, 1] == math.inf
    assert legs.times_s(WINDY)[0, 1] == math.inf
    assert legs.corners_m(0, 1) is None


def test_a_network_goes_to_other_processes() -> None:
    network = random_network(2, 4.0)
    again = pickle.loads(pickle.dumps(network))

    assert again.legs.times_s(WINDY).tolist() == network.legs.times_s(WINDY).tolist()


def test_a_network_may_be_empty() -> None:
    network = LegNetwork(Airspace([wall()]), np.empty((0, 3)))

    assert network.legs.times_s(PLAIN).shape == (0, 0)
    assert network.legs_from(np.zeros(3)).times_s(WINDY).shape == (1, 0)
    with pytest.raises(IndexError, match="no leg from place 0 to node 0"):
        network.legs.corners_m(0, 0)


def test_legs_from_one_place_are_worked_out_once_and_are_those_from_anywhere() -> None:
    network = random_network(3, margin_m=2.0)
    place_m = np.array([100.0, 90.0, 5.0])

    legs = network.legs_from_one(place_m, 5.0, 5.0)

    assert network.legs_from_one(place_m.copy(), 5.0, 5.0) is legs
    assert network.legs_from_one(place_m, 5.0, 6.0) is not legs
    expected = network.legs_from(place_m, 5.0, 5.0)
    assert legs.times_s(WINDY).tolist() == expected.times_s(WINDY).tolist()


def test_legs_from_few_places_are_kept_so_that_a_long_flight_needs_no_more_memory() -> None:
    network = LegNetwork(Airspace(), np.zeros((2, 3)))
    place_m = np.zeros(3)
    first = network.legs_from_one(place_m, 0.0, 0.0)

    for number in range(1, 33):
        network.legs_from_one(place_m + number, 0.0, 0.0)

    assert network.legs_from_one(place_m, 0.0, 0.0) is not first
