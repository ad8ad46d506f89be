"""Times of legs and lines by hand: acceleration, wind, heights, zones that concern a UAV."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

from tests.support.field_oracle.flight import FlightTimes, Leg
from tests.support.field_oracle.scenario import FieldScenario, _uav, read

WALL = {"id": "wall", "polygon_m": [[40, -30], [60, -30], [60, 40], [40, 40]]}


def scenario(
    *tasks: dict[str, Any],
    uav: dict[str, Any] | None = None,
    mission: dict[str, Any] | None = None,
    zone: list[dict[str, Any]] | None = None,
) -> FieldScenario:
    return read(
        {
            "schema": 2,
            "name": "legs",
            "mission": {"horizon_s": 100.0, **(mission or {})},
            "uav": [{"id": "u1", "position_m": [0.0, 0.0], "speed_m_s": 10.0, **(uav or {})}],
            "zone": zone or [],
            "task": [{"id": f"t{i + 1}", "value": 1.0, **task} for i, task in enumerate(tasks)],
        }
    )


def leg(of: FieldScenario, task: str = "t1") -> Leg:
    found = FlightTimes(of).leg(of.uavs[0], of.uavs[0].start, of.task(task).stops[0])
    assert found is not None
    return found


def line_s(of: FieldScenario, *, backwards: bool) -> float:
    found = FlightTimes(of).line_s(of.uavs[0], of.task("t1"), backwards=backwards)
    assert found is not None
    return found


def test_speed_changes_at_once_without_an_acceleration() -> None:
    assert leg(scenario({"position_m": [30.0, 40.0]})).time_s == 5.0


@pytest.mark.parametrize(
    ("length_m", "time_s"),
    [
        (100.0, 100.0 / 10.0 + 10.0 / 2.5),  # up to 10 m/s within 20 m, and down again
        (40.0, 8.0),  # just
        (22.5, 6.0),  # half of it up: sqrt(22.5 / 2.5) = 3 s
        (0.0, 0.0),
    ],
)
def test_leg_is_flown_from_rest_to_rest(length_m: float, time_s: float) -> None:
    one = scenario({"position_m": [length_m, 0.0]}, uav={"acceleration_m_s2": 2.5})

    assert leg(one).time_s == pytest.approx(time_s, abs=1e-12)


def test_length_has_the_difference_of_the_given_heights() -> None:
    up = scenario({"position_m": [40.0, 0.0, 37.0]}, uav={"position_m": [0.0, 0.0, 7.0]})
    flown_at = scenario(
        {"position_m": [40.0, 0.0, 5.0], "height_m": 30.0}, uav={"position_m": [0.0, 0.0]}
    )

    assert leg(up).length_m == 50.0
    assert leg(flown_at).length_m == 50.0


@pytest.mark.parametrize(
    ("to_m", "wind_m_s", "speed_m_s"),
    [
        ([100.0, 0.0], [3.0, 0.0], 12.0),  # 13 by wind and air, but never more than speed_m_s
        ([100.0, 0.0], [-3.0, 0.0], 7.0),
        ([100.0, 0.0], [0.0, 6.0], 8.0),
        ([0.0, 50.0], [3.0, -6.0], math.sqrt(91.0) - 6.0),
    ],
)
def test_wind_changes_the_speed_over_ground(
    to_m: list[float], wind_m_s: list[float], speed_m_s: float
) -> None:
    one = scenario(
        {"position_m": to_m},
        uav={"speed_m_s": 12.0, "airspeed_m_s": 10.0},
        mission={"wind_m_s": wind_m_s},
    )

    assert leg(one).time_s == pytest.approx(math.hypot(*to_m) / speed_m_s, rel=1e-12)


def test_wind_has_no_effect_without_an_airspeed() -> None:
    one = scenario({"position_m": [100.0, 0.0]}, mission={"wind_m_s": [-3.0, 0.0]})

    assert leg(one).time_s == 10.0


def test_way_of_several_pieces_takes_its_length_by_the_times_of_its_pieces() -> None:
    """Over the wall: 50 m up, 20 m along, 50 m down, the wind from the east."""
    one = scenario(
        {"position_m": [100.0, 10.0]},
        uav={"position_m": [0.0, 10.0], "airspeed_m_s": 10.0, "acceleration_m_s2": 1.0},
        mission={"wind_m_s": [-2.0, 0.0]},
        zone=[WALL],
    )

    slanted_m_s = -2.0 * 0.8 + math.sqrt(100.0 - (2.0 * 0.6) ** 2)
    spent_s = 50.0 / slanted_m_s + 20.0 / 8.0 + 50.0 / slanted_m_s
    speed_m_s = 120.0 / spent_s
    assert leg(one).way.length_m == 120.0
    assert leg(one).time_s == pytest.approx(120.0 / speed_m_s + speed_m_s / 1.0, rel=1e-12)


def test_line_takes_the_same_formula_and_its_direction_matters() -> None:
    one = scenario(
        {"path_m": [[0.0, 0.0], [60.0, 0.0], [60.0, 40.0]]},
        uav={"airspeed_m_s": 10.0, "acceleration_m_s2": 2.0},
        mission={"wind_m_s": [0.0, -2.0]},
    )

    across_m_s, back_m_s = math.sqrt(96.0), 8.0
    for backwards, along_m_s in ((False, back_m_s), (True, 10.0)):
        speed_m_s = 100.0 / (60.0 / across_m_s + 40.0 / along_m_s)
        right_s = 100.0 / speed_m_s + speed_m_s / 2.0
        assert line_s(one, backwards=backwards) == pytest.approx(right_s, rel=1e-12)


@pytest.mark.parametrize(
    ("zone", "mission", "concerned"),
    [
        ({}, {}, True),
        ({"floor_m": 0.0, "ceiling_m": 9.0}, {}, False),  # its layer is 10 m up
        ({"floor_m": 0.0, "ceiling_m": 11.0}, {}, True),
        ({"floor_m": 41.0}, {}, False),
        ({"floor_m": 39.0}, {}, True),  # the task lies 30 m up
        ({"floor_m": 41.0}, {"band_m": [30.0, 110.0]}, True),
        ({"ceiling_m": 29.0}, {"band_m": [30.0, 110.0]}, False),
    ],
)
def test_zone_concerns_a_uav_only_at_heights_that_it_may_use(
    zone: dict[str, Any], mission: dict[str, Any], concerned: bool
) -> None:
    one = scenario({"position_m": [100.0, 0.0, 30.0]}, zone=[{**WALL, **zone}], mission=mission)

    assert (leg(one).way.length_m > 100.0) is concerned


def test_layer_of_the_second_uav_lies_higher() -> None:
    zone = {**WALL, "floor_m": 12.0, "ceiling_m": 20.0}
    one = scenario({"position_m": [100.0, 0.0]}, zone=[zone], uav={"id": "low"})
    table = {"id": "high", "position_m": [0.0, 0.0], "speed_m_s": 10.0}
    both = replace(one, uavs=(*one.uavs, _uav(table, 1, None)))
    times = FlightTimes(both)

    legs = [times.leg(uav, uav.start, both.tasks[0].stops[0]) for uav in both.uavs]

    assert [leg is not None and leg.way.length_m > 100.0 for leg in legs] == [False, True]


def test_home_is_the_quickest_of_start_and_bases() -> None:
    """With the wind the farther one is the quicker one."""
    table = {
        "schema": 2,
        "name": "home",
        "mission": {"horizon_s": 100.0, "wind_m_s": [4.0, 0.0]},
        "uav": [
            {"id": "u1", "position_m": [0.0, 0.0], "speed_m_s": 20.0, "airspeed_m_s": 10.0},
        ],
        "base": [{"id": "b0", "position_m": [210.0, 0.0]}],
        "task": [{"id": "t1", "position_m": [100.0, 0.0], "value": 1.0}],
    }
    one = read(table)

    home = FlightTimes(one).home(one.uavs[0], one.tasks[0].stops[0])

    assert home is not None
    assert home[0].name == "base:b0"
    assert home[1].time_s == pytest.approx(110.0 / 14.0)
