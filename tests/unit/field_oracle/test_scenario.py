"""What is read where a scenario says nothing, and places in degrees."""

from __future__ import annotations

import math
from typing import Any

import pytest

from swarm.model.frames import DEFAULT_ORIGIN, wgs84_from_enu
from tests.support.field_oracle.scenario import read

ORIGIN = {
    "lat_deg": DEFAULT_ORIGIN.lat_deg,
    "lon_deg": DEFAULT_ORIGIN.lon_deg,
    "alt_m": DEFAULT_ORIGIN.alt_m,
}


def table(**changed: Any) -> dict[str, Any]:
    return {
        "schema": 2,
        "name": "small",
        "mission": {"horizon_s": 10},
        "uav": [{"id": "u1", "position_m": [1, 2], "speed_m_s": 3}],
        "task": [{"id": "t1", "position_m": [4, 5, 6], "value": 7}],
        **changed,
    }


def test_what_is_absent_limits_nothing() -> None:
    scenario = read(table(base=[{"id": "b0", "position_m": [0, 0]}]))
    uav, task, base = scenario.uavs[0], scenario.tasks[0], scenario.bases[0]

    assert (scenario.wind_m_s, scenario.margin_m, scenario.band_m) == ((0.0, 0.0), 0.0, None)
    assert (uav.acceleration_m_s2, uav.airspeed_m_s, uav.first_budget_s) == (None, None, math.inf)
    assert (task.due_s, task.opens_s, task.closes_s, task.service_s) == (None, 0.0, math.inf, 0.0)
    assert (base.swap_s, base.slots) == (0.0, None)
    assert scenario.success(uav, task) == scenario.survival(uav, task) == 1.0


def test_a_fifth_of_the_battery_is_reserved_unless_said() -> None:
    rows = [
        {"id": "u1", "position_m": [1, 2], "speed_m_s": 3, "endurance_s": 100.0},
        {
            "id": "u2",
            "position_m": [1, 2],
            "speed_m_s": 3,
            "endurance_s": 100.0,
            "charge_frac": 0.5,
        },
    ]
    uavs = read(table(uav=rows)).uavs

    assert [uav.first_budget_s for uav in uavs] == [80.0, 30.0]
    assert [uav.full_budget_s for uav in uavs] == [80.0, 80.0]
    assert [uav.layer_m for uav in uavs] == [10.0, 13.0]


def test_height_m_takes_the_place_of_the_third_number() -> None:
    low = {"id": "t1", "position_m": [4, 5, 6], "value": 7}
    stops = [
        read(table(task=[low | extra])).tasks[0].stops[0] for extra in ({}, {"height_m": 60.0})
    ]

    assert [stop.up_m for stop in stops] == [6.0, 60.0]
    assert [stop.flown_m(10.0) for stop in stops] == [16.0, 60.0]


def test_degrees_are_places_too() -> None:
    lat, lon, alt_m = wgs84_from_enu(DEFAULT_ORIGIN, (100.0, 200.0, 30.0))
    corners = [list(wgs84_from_enu(DEFAULT_ORIGIN, (x, y, 0.0))[:2]) for x, y in ((0, 0), (9, 0))]
    scenario = read(
        table(
            origin=ORIGIN,
            task=[
                {"id": "t1", "lat_deg": lat, "lon_deg": lon, "alt_m": alt_m, "value": 1},
                {"id": "t2", "path": corners, "value": 1},
            ],
            zone=[{"id": "z", "polygon": [*corners, [lat, lon]]}],
        )
    )

    assert scenario.tasks[0].stops[0].at == pytest.approx((100.0, 200.0), abs=1e-6)
    assert scenario.tasks[0].stops[0].up_m == pytest.approx(30.0)
    assert scenario.tasks[1].stops[1].at == pytest.approx((9.0, 0.0), abs=1e-6)
    assert scenario.zones[0].rings[0][2] == pytest.approx((100.0, 200.0), abs=1e-6)


def test_last_corner_may_repeat_the_first() -> None:
    zone = {"id": "z", "polygon_m": [[0, 0], [1, 0], [0, 1], [0, 0]]}

    assert len(read(table(zone=[zone])).zones[0].rings[0]) == 3


def test_areas_are_not_known_here() -> None:
    with pytest.raises(ValueError, match="areas"):
        read(table(area=[{"id": "field"}]))
