"""A run draws its fence around everything that may be flown to."""

from __future__ import annotations

from dataclasses import replace

import pytest

from sim.fleet.passthrough import Fence, PassthroughOptions, fence_around
from swarm.model.layers import FlightLayers
from swarm.scenario import load_scenario
from swarm.scenario.files import resolve_scenario, shipped_scenarios
from tests.support.builders import mission, task, uav

HIGHEST_LAYER_M = FlightLayers().layer_m(1)


def test_fence_leaves_room_around_the_farthest_and_the_highest_place() -> None:
    flown = mission(
        [uav("u0"), uav("u1")],
        [
            replace(task("t0", 1.0), position_enu_m=(10.0, 20.0, 70.0)),
            replace(task("popup", 1.0), position_enu_m=(-300.0, 400.0, 5.0), appears_s=60.0),
        ],
    )

    assert fence_around(flown) == Fence(800.0, 70.0 + HIGHEST_LAYER_M + 50.0)


def test_fence_leaves_room_below_the_origin() -> None:
    deep = replace(task("t0", 1.0), position_enu_m=(10.0, 20.0, -400.0))

    assert fence_around(mission([uav("u0")], [deep])).height_m == 450.0


def test_fence_that_is_given_is_drawn() -> None:
    flown = mission([uav("u0")], [task("t0", 1.0)])

    assert fence_around(flown, 100.0, 30.0) == Fence(100.0, 30.0)
    assert fence_around(flown, radius_m=100.0).height_m == fence_around(flown).height_m


@pytest.mark.parametrize("name", shipped_scenarios())
def test_fence_of_a_shipped_scenario_is_a_fence(name: str) -> None:
    fence = fence_around(load_scenario(resolve_scenario(name)))

    assert fence.radius_m < 4000.0
    assert fence.height_m < 500.0


def test_agents_are_told_their_fence_and_how_long_to_fly_without_a_bus() -> None:
    fence = Fence(800.0, 130.0)
    told = PassthroughOptions(battery_reserve=0.3, keep_jerk=True, fence=fence, without_bus_s=20.0)

    assert told.to_agent("uav1") == [
        *("--battery-reserve", "0.3"),
        "--keep-jerk",
        *("--fence-radius-m", "800.0", "--fence-height-m", "130.0"),
        *("--without-bus-s", "20.0"),
    ]
