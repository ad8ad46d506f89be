"""The coordinator plans a running mission anew: what it asks for, and what it says of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import pytest

from coordinator.core.lifecycle import CoordinatorAction, Replan, Replanned, StopPlanning
from coordinator.planner.online import EpochPolicy, Prediction, ReplanResult
from swarm.model import Mission
from swarm.protocol.events import LinkChanged, SnapshotsReceived, Stop
from swarm.protocol.messages import MissionPhase, PlanEpoch, Snapshot
from swarm.protocol.timing import Timing
from swarm.protocol.uav_messages import Claim, ClaimPhase
from tests.support.builders import held, mission, task, uav
from tests.support.lone_coordinator import TIMING, LoneCoordinator, said

INTERVAL_S = 5.0
EAGER = replace(TIMING, replan_interval_s=INTERVAL_S)
GOOD = {"a": ("t1", "t2", "t3"), "b": (), "c": ("t4", "t5")}
BAD = {"a": ("t3", "t1", "t2"), "b": (), "c": ("t5", "t4")}


def flown() -> Mission:
    """Three UAVs, of which c is at 100 m, and tasks between them."""
    fleet = [uav("a"), uav("b"), uav("c", east_m=100.0)]
    places_m = (10.0, 20.0, 30.0, 90.0, 80.0)
    tasks = [task(f"t{n}", at_m) for n, at_m in enumerate(places_m, start=1)]
    return mission(fleet, [*tasks, task("late", 50.0, appears_s=20.0)], horizon_s=300.0)


def started(timing: Timing = EAGER) -> LoneCoordinator:
    return LoneCoordinator(flown(), timing=timing).started()


def wanted(actions: Sequence[CoordinatorAction]) -> list[Replan]:
    return [action for action in actions if isinstance(action, Replan)]


def made(request: Replan, new: dict[str, tuple[str, ...]] = GOOD) -> Replanned:
    """A plan that differs from going on by its lists."""
    going_on = Prediction(BAD, {}, 0.0)
    return Replanned(
        request.request, ReplanResult("guided", ("c", "a"), Prediction(new, {}, 0.0), going_on)
    )


def after_a_loss(timing: Timing = EAGER) -> tuple[LoneCoordinator, Replan]:
    fleet = started(timing)
    fleet.lose("b", 101.0)
    (request,) = wanted(fleet.run_until(100.0 + 2 * INTERVAL_S))
    return fleet, request


def test_a_loss_makes_it_plan_for_the_rest_once_the_epoch_is_old_enough() -> None:
    fleet = started()
    begun_s = fleet.now_s

    assert wanted(fleet.lose("b", begun_s + 1.0)) == []
    (request,) = wanted(fleet.run_until(begun_s + INTERVAL_S))

    assert fleet.now_s == begun_s + INTERVAL_S
    assert request.situation.taking_part == {"a", "c"}
    assert request.situation.now_s == INTERVAL_S
    assert fleet.epoch is not None
    assert request.course == EpochPolicy.of(fleet.epoch)
    assert request.method == "greedy"


def test_a_better_plan_becomes_the_next_epoch() -> None:
    fleet, request = after_a_loss()

    (epoch,) = said(fleet.happen(made(request), at_s=112.0), PlanEpoch)

    assert (epoch.number, epoch.phase) == (2, MissionPhase.RUNNING)
    assert (epoch.rule, epoch.sequence) == ("guided", ("c", "a"))
    assert epoch.routes["c"] == GOOD["c"]
    assert epoch.mission_s == pytest.approx(12.0, abs=1e-5)
    assert epoch.reason.startswith("b lost: worth ")


def test_a_plan_as_good_as_going_on_is_not_mentioned() -> None:
    fleet, request = after_a_loss()

    assert said(fleet.happen(made(request, BAD)), PlanEpoch) == []


def test_a_pop_up_is_planned_for() -> None:
    fleet = started()

    (request,) = wanted(fleet.run_until(125.0))

    assert "late" in request.situation.problem.task_ids
    assert request.situation.now_s == 20.0


def test_a_claim_is_a_fact_for_the_plan() -> None:
    fleet = started()
    fleet.hear("a", held("t3", 0.0, completion_s=30.0))
    fleet.lose("b", 101.0)

    (request,) = wanted(fleet.run_until(110.0))

    assert request.situation.under_way == {"a": "t3"}
    assert request.situation.state.free_s.tolist()[0] == 30.0


def test_no_plan_is_wanted_before_the_start_or_after_the_end() -> None:
    fleet = LoneCoordinator(flown(), timing=EAGER)
    fleet.see("a", "b", "c")
    assert wanted(fleet.lose("b", 101.0) + fleet.run_until(120.0)) == []

    fleet = started()
    fleet.happen(Stop("enough"))
    assert wanted(fleet.lose("b", 101.0) + fleet.run_until(120.0)) == []


def test_a_plan_that_comes_after_the_end_is_no_epoch() -> None:
    fleet, request = after_a_loss()
    fleet.happen(Stop("enough"))

    assert said(fleet.happen(made(request)), PlanEpoch) == []
    assert fleet.phase is MissionPhase.ENDED


def test_what_is_being_planned_is_stopped_at_the_end() -> None:
    fleet, _ = after_a_loss()

    assert StopPlanning() in fleet.happen(Stop("enough"))
    assert StopPlanning() not in started().happen(Stop("enough"))


def test_while_it_learns_it_publishes_no_epoch_and_afterwards_it_plans_again() -> None:
    fleet, request = after_a_loss()
    fleet.answers = None  # from now on it has to wait
    fleet.happen(LinkChanged(False), at_s=111.0)
    fleet.happen(LinkChanged(True), at_s=112.0)

    assert said(fleet.happen(made(request), at_s=112.5), PlanEpoch) == []
    (again,) = wanted(fleet.happen(SnapshotsReceived(()), at_s=116.0))
    assert again.request != request.request


def test_a_coordinator_that_resumes_a_mission_soon_plans_it_anew() -> None:
    earlier = started()
    reborn = LoneCoordinator(
        flown(),
        timing=EAGER,
        begin_s=130.0,
        incarnation=2,
        answers=[answer(earlier)],
    )
    reborn.see("a", "b", "c")
    for name in "abc":
        reborn.hear(name, Claim(ClaimPhase.IDLE, None, 9.0, 0, 9.0))

    actions = reborn.run_until(130.0 + 2 * INTERVAL_S)

    requests = wanted(actions)
    assert len(requests) == 1
    assert requests[0].situation.now_s >= INTERVAL_S


def answer(fleet: LoneCoordinator) -> Snapshot:
    """What a UAV tells of the coordinator that is gone."""
    known = fleet.core.memory(fleet.now_s)
    return replace(known, writer="a", incarnation=1)
