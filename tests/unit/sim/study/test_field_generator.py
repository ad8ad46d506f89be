"""Random missions in the field: each constraint is a measure, drawn by itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sim.study.field_generator import FieldShape, field_span_s, random_field_mission
from sim.study.generator import mission_of, random_mission
from swarm.allocation.field import FieldProblem, FieldState
from swarm.allocation.legs import Airspace
from swarm.kernels.field_alone import earliest_alone
from swarm.model import Mission

WHOLE = FieldShape(endurance_frac=0.5, bases=2, zones=3, windows_frac=0.5, due_frac=0.25)


def drawn(shape: FieldShape, seed: int = 4) -> Mission:
    return random_field_mission(4, 12, seed, shape, "drawn")


def test_without_any_measure_it_is_the_plain_mission_of_that_seed() -> None:
    assert drawn(FieldShape()) == mission_of(random_mission(4, 12, 4), "drawn")


def test_every_measure_is_met() -> None:
    mission = drawn(WHOLE)

    assert len(mission.bases) == 2
    assert {base.slots for base in mission.bases} == {1}
    assert len(mission.zones) == 3
    assert sum(task.closes_s is not None for task in mission.tasks) == 6
    assert sum(task.due_s is not None for task in mission.tasks) == 3
    assert len({uav.endurance_s for uav in mission.uavs}) == 1
    assert mission.horizon_s == pytest.approx(1.2 * field_span_s(mission))


@pytest.mark.parametrize("seed", range(3))
def test_every_task_of_the_shipped_missions_can_be_done_by_somebody(seed: int) -> None:
    shape = FieldShape(endurance_frac=0.4, bases=2, zones=4, windows_frac=0.5)
    mission = random_field_mission(10, 50, seed, shape, "drawn")
    problem = FieldProblem.from_mission(mission)

    alone_s = earliest_alone(problem.kernel, FieldState.at_start(problem))

    assert np.isfinite(alone_s).any(axis=0).all()
    planner = Airspace(mission.zones, 0.0).concerning(-1e6, 1e6)
    assert planner.free(np.array([task.position_enu_m[:2] for task in mission.tasks])).all()


def test_one_measure_leaves_what_others_draw() -> None:
    few, many = drawn(replace(WHOLE, zones=0)), drawn(replace(WHOLE, due_frac=0.0, zones=0))

    assert few.bases == many.bases
    for one, other in zip(few.tasks, many.tasks, strict=True):
        assert one.position_enu_m == other.position_enu_m
        assert (one.opens_s, one.closes_s) == (other.opens_s, other.closes_s)


def test_wind_lines_and_accelerations_can_be_had() -> None:
    shape = FieldShape(lines_frac=0.5, steady_wind_m_s=3.0, acceleration_m_s2=2.0, bases=1)
    mission = drawn(shape)

    assert np.hypot(*mission.wind_enu_m_s) == pytest.approx(3.0)
    assert all(uav.airspeed_m_s is not None for uav in mission.uavs)
    assert all(uav.acceleration_m_s2 == 2.0 for uav in mission.uavs)
    assert sum(bool(task.path_enu_m) for task in mission.tasks) == 6
