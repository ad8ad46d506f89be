"""What was really flown, as `swarm simulate --json` tells it."""

from __future__ import annotations

from dataclasses import replace

import pytest

from coordinator.planner.plan import make_plan
from sim.world.simulation import SimulatedMission, simulate_mission
from sim.world.uncertainty import Uncertainty
from swarm.model import Mission, UavId
from swarm.runtime.clock import SystemClock
from tests.support.field_missions import mission_of
from tests.support.field_oracle.made_up import made_up


def straight_mission(seed: int, change_m_s2: float | None, n_uavs: int = 2) -> Mission:
    mission = mission_of(made_up(seed, "plain", n_uavs=n_uavs, n_tasks=5))
    uavs = tuple(replace(uav, acceleration_m_s2=change_m_s2) for uav in mission.uavs)
    return replace(mission, uavs=uavs, schema=2)


def flown(mission: Mission, seed: int = 0, **uncertain: float) -> SimulatedMission:
    what = Uncertainty(**uncertain)  # type: ignore[arg-type]  # names of shares and rates only
    return simulate_mission(mission, method="greedy", seed=seed, uncertainty=what)


@pytest.mark.parametrize("change_m_s2", [None, 2.0])
def test_without_faults_it_is_the_plan_but_for_when_they_go_home(change_m_s2: float | None) -> None:
    for seed in range(6):
        mission = straight_mission(seed, change_m_s2)
        plan = make_plan(mission.known_at_start(), "greedy", clock=SystemClock(), seed=0)
        assert plan.schedule is not None
        world = flown(mission.known_at_start()).world
        executed = world.executed_schedule()
        for uav, entries in plan.schedule.items():
            assert [one.go for one in executed[uav]] == [other.go for other in entries]
            for one, other in zip(executed[uav][:-1], entries[:-1], strict=True):
                assert (one.depart_s, one.end_s) == pytest.approx((other.depart_s, other.end_s))
                assert (one.arrive_s, one.begin_s) == pytest.approx((other.arrive_s, other.begin_s))
                assert (one.from_enu_m, one.via_enu_m) == (other.from_enu_m, other.via_enu_m)
            for one, other in zip(executed[uav][-1:], entries[-1:], strict=True):
                leg_s = other.arrive_s - other.depart_s
                assert one.arrive_s - one.depart_s == pytest.approx(leg_s)
                assert one.depart_s >= other.depart_s - 1e-9


def test_layers_keep_uavs_apart_and_a_single_one_is_near_to_nobody() -> None:
    nearest_m = flown(straight_mission(1, 2.0)).world.closest_approach_m()
    assert nearest_m is not None
    assert nearest_m >= 3.0
    assert flown(straight_mission(1, 2.0, n_uavs=1)).world.closest_approach_m() is None


def test_who_is_lost_has_no_way_home_and_every_visit_is_told_once() -> None:
    lost = 0
    for seed in range(8):
        mission = straight_mission(seed, None)
        done = flown(mission, seed, loss=0.5, popup=0.3)
        executed = done.world.executed_schedule()
        for uav, entries in executed.items():
            goes = [entry.go for entry in entries if entry.go != "start"]
            assert tuple(goes) == done.result.executed_routes[uav]
            if uav in done.lost_because:
                lost += 1
                assert all(entry.go != "start" for entry in entries)
            elif entries:
                assert entries[-1].go == "start"
    assert lost > 0


def test_who_does_nothing_has_an_empty_list() -> None:
    mission = replace(straight_mission(0, None), tasks=())
    assert flown(mission).world.executed_schedule() == {
        UavId(str(uav.id)): () for uav in mission.uavs
    }
