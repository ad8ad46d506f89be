from __future__ import annotations

import math

import numpy as np
import pytest

from swarm.allocation.legs import FlightModel
from tests.support.problems import random_problem


def one(model: FlightModel, *offset_m: float) -> float:
    return float(model.straight_s(np.array(offset_m)))


# -- Plain ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(20))
def test_plain_times_are_those_of_the_problem_to_the_last_bit(seed: int) -> None:
    rng = np.random.default_rng(seed)
    problem = random_problem(rng, 3, 40)
    place_m = rng.uniform(-1e3, 1e3, 3)
    columns_m = np.ascontiguousarray(problem.task_enu_m.T)

    for uav in range(3):
        model = FlightModel(float(problem.speed_m_s[uav]))
        from_place_s = model.straight_s(columns_m - place_m[:, None])
        between_s = model.straight_s(columns_m[:, None, :] - columns_m[:, :, None])

        assert from_place_s.tolist() == problem.travel_s(uav, place_m).tolist()
        assert between_s.tolist() == problem.travel_between_s(uav).tolist()
        assert [one(model, *(task_m - place_m)) for task_m in problem.task_enu_m] == (
            from_place_s.tolist()
        )
        assert model.path_s(np.stack([place_m, problem.task_enu_m[4]])) == from_place_s[4]


# -- Acceleration ---------------------------------------------------------------------------------


def test_acceleration_adds_the_time_to_reach_the_speed_once() -> None:
    model = FlightModel(10.0, acceleration_m_s2=2.5)

    assert one(model, 100.0, 0.0, 0.0) == 10.0 + 4.0
    assert one(model, 40.0, 0.0, 0.0) == 8.0  # v²/a: the speed is reached for a moment
    assert one(model, 0.0, 0.0, 10.0) == 2.0 * math.sqrt(4.0)
    assert one(model, 0.0, 0.0, 0.0) == 0.0


def test_times_with_acceleration_agree_where_the_formulas_meet() -> None:
    model = FlightModel(12.0, acceleration_m_s2=3.0)

    below_s, above_s = one(model, 48.0 * (1 - 1e-12), 0.0, 0.0), one(model, 48.0, 0.0, 0.0)

    assert below_s == pytest.approx(above_s, rel=1e-11)


def test_corners_are_flown_through() -> None:
    model = FlightModel(10.0, acceleration_m_s2=2.5)

    assert model.path_s(np.array([[0.0, 0, 0], [60, 0, 0], [60, 40, 0]])) == 14.0
    assert model.path_s(np.array([[0.0, 0, 0], [10, 0, 0], [0, 0, 0]])) == 2.0 * math.sqrt(8.0)


# -- Wind -----------------------------------------------------------------------------------------


def test_wind_helps_no_further_than_cruise_speed_and_hinders() -> None:
    model = FlightModel(10.0, airspeed_m_s=12.0, wind_enu_m_s=(5.0, 0.0))

    assert one(model, 100.0, 0.0, 0.0) == 10.0
    assert one(model, -70.0, 0.0, 0.0) == 10.0
    assert one(model, 0.0, 100.0, 0.0) == 10.0  # √(144 − 25) is more than cruise speed
    assert one(FlightModel(20.0, None, 13.0, (5.0, 0.0)), 0.0, 120.0, 0.0) == 10.0
    assert one(FlightModel(20.0, None, 13.0, (5.0, 0.0)), 0.0, 0.0, 120.0) == 10.0


@pytest.mark.parametrize("seed", range(10))
def test_speed_over_ground_closes_the_triangle_of_winds(seed: int) -> None:
    """Ground velocity minus wind is as fast through the air as the UAV can, or it flies at v."""
    rng = np.random.default_rng(seed)
    blow = rng.uniform(-6.0, 6.0, 2)
    model = FlightModel(11.0, None, 10.0, (float(blow[0]), float(blow[1])))
    offset_m = rng.uniform(-50.0, 50.0, (3, 200))
    length_m = np.sqrt((offset_m**2).sum(axis=0))

    ground_m_s = length_m / model.straight_s(offset_m)

    velocity_m_s = offset_m / length_m * ground_m_s
    through_air_m_s = np.sqrt(((velocity_m_s - np.append(blow, 0.0)[:, None]) ** 2).sum(axis=0))
    capped = ground_m_s > 11.0 - 1e-9
    np.testing.assert_allclose(through_air_m_s[~capped], 10.0, rtol=1e-12)
    assert (through_air_m_s[capped] <= 10.0 + 1e-9).all()
    assert capped.any()
    assert not capped.all()


def test_what_the_wind_forbids_takes_for_ever() -> None:
    model = FlightModel(10.0, 2.0, airspeed_m_s=4.0, wind_enu_m_s=(5.0, 0.0))

    assert one(model, 0.0, 100.0, 0.0) == math.inf  # drifts
    assert one(model, -100.0, 0.0, 0.0) == math.inf  # is blown back
    assert one(model, 90.0, 0.0, 0.0) == 9.0 / 0.9 + 9.0 / 2.0
    assert one(model, 0.0, 0.0, 0.0) == 0.0
    assert model.path_s(np.array([[0.0, 0, 0], [60, 0, 0], [60, 40, 0]])) == math.inf


def test_path_in_wind_is_flown_at_length_by_the_sum_of_its_pieces() -> None:
    model = FlightModel(20.0, 2.0, airspeed_m_s=13.0, wind_enu_m_s=(5.0, 0.0))
    there_and_back_m = np.array([[0.0, 0, 0], [180, 0, 0], [180, 0, 0], [0, 0, 0]])
    evenly_m_s = 360.0 / (180.0 / 18.0 + 180.0 / 8.0)

    assert model.path_s(there_and_back_m) == pytest.approx(360.0 / evenly_m_s + evenly_m_s / 2.0)
    assert model.path_s(there_and_back_m[1:]) == model.path_s(there_and_back_m[[1, 3]])


def test_calm_air_without_airspeed_takes_the_same_both_ways() -> None:
    assert not FlightModel(10.0, 2.0, wind_enu_m_s=(5.0, 0.0)).heeds_direction
    assert one(FlightModel(10.0, wind_enu_m_s=(5.0, 0.0)), -50.0, 0.0, 0.0) == 5.0


@pytest.mark.parametrize(
    ("numbers", "words"),
    [
        ({"speed_m_s": 0.0}, "speed_m_s must be > 0, not 0.0"),
        ({"acceleration_m_s2": -1.0}, "acceleration_m_s2 must be > 0, not -1.0"),
        ({"airspeed_m_s": math.inf}, "airspeed_m_s must be > 0, not inf"),
        ({"wind_enu_m_s": (1.0, math.nan)}, "wind_enu_m_s must be two finite numbers"),
    ],
)
def test_numbers_out_of_range_are_refused(numbers: dict[str, float], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        FlightModel(**{"speed_m_s": 5.0, **numbers})  # type: ignore[arg-type]
