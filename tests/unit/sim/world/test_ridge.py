"""The scenario `ridge`, over hills: planned, simulated, and flown by bridges of both firmwares."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from agent.vehicle.config import CommandStyle
from sim.autopilot.firmware import FirmwareModelName
from sim.scenarios.hills import FILE, hills_m
from swarm.allocation.field import FieldProblem
from swarm.allocation.legs.ground import ground_of
from swarm.model import Mission, TaskId
from swarm.model.frames import enu_from_wgs84
from swarm.scenario import load_scenario
from swarm.scenario.files import resolve_scenario
from tests.support.bridged_fleet import long_flight
from tests.support.bridged_ridge import RidgeFleet
from tests.support.fleet_builders import plan_for
from tests.support.hills import above_m

WITHIN_M = 3.0


@pytest.fixture(scope="module", name="ridge")
def _ridge() -> Mission:
    return load_scenario(resolve_scenario("ridge"))


def test_the_tile_is_what_its_module_makes(ridge: Mission) -> None:
    assert ridge.terrain is not None
    assert ridge.origin is not None
    assert FILE.stat().st_size < 50_000
    row = round((48.0 - 47.397742) * 3600)
    column = round((8.545594 - 8.0) * 3600)
    made_m = hills_m(slice(row, row + 9, 4), slice(column, column + 9, 4)) - 488.0
    for south, east in np.ndindex(made_m.shape):
        lat_deg, lon_deg = 48.0 - (row + 4 * south) / 3600, 8.0 + (column + 4 * east) / 3600
        east_m, north_m, _ = enu_from_wgs84(ridge.origin, lat_deg, lon_deg, 488.0)
        ground_m = ground_of(ridge.terrain).one_up_m(east_m, north_m)
        assert ground_m == pytest.approx(made_m[south, east], abs=1.0)


def test_all_planned_ways_keep_from_the_ground_and_tell_their_heights(ridge: Mission) -> None:
    terrain = ridge.terrain
    assert terrain is not None
    plan = plan_for(ridge, "greedy", 0)
    assert plan.schedule is not None
    for entries in plan.schedule.values():
        for entry in entries:
            flat_m = np.array([entry.from_enu_m, *entry.via_enu_m])
            path_m = np.column_stack([flat_m, entry.up_m])
            assert above_m(terrain, path_m).min() >= terrain.planned_m - 0.2


def test_climbing_takes_time(ridge: Mission) -> None:
    over = FieldProblem.from_mission(ridge)
    flat = FieldProblem.from_mission(replace(ridge, terrain=None))
    behind = int(over.enter[over.task_ids.index(TaskId("behind")), 0])
    assert over.leg_s[0, 0, behind] > flat.leg_s[0, 0, behind] + 1.0


@long_flight(FirmwareModelName.PX4, CommandStyle.MISSION)
def test_nobody_comes_too_near_to_the_ground_and_lines_are_followed(
    flavour: FirmwareModelName, style: CommandStyle, ridge: Mission
) -> None:
    fleet = RidgeFleet(flavour, style, ridge)

    fleet.fly(900.0)

    assert ridge.terrain is not None
    fleet.assert_all_done()
    assert fleet.lowest_m >= ridge.terrain.clearance_m, fleet.lowest_at
    assert set(fleet.line_heights_m) == {"over", "along"}
    for line, heights_m in fleet.line_heights_m.items():
        assert len(heights_m) > 50
        assert min(heights_m) >= -WITHIN_M, line
        assert max(heights_m) <= WITHIN_M, line
    told_m = fleet.world.mission_state.limits.lowest_clearance_m
    assert told_m is not None
    assert told_m >= ridge.terrain.clearance_m - 1.0
