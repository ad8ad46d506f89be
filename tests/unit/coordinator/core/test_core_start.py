"""The coordinator before a mission begins: brief, plan, who is ready."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from coordinator.core.lifecycle import PlanFailed, PlanMade
from swarm.protocol.codec import Codec
from swarm.protocol.encoding import encode
from swarm.protocol.events import (
    PeerSeen,
    Stop,
)
from swarm.protocol.messages import (
    MissionConfig,
    MissionPhase,
    PlanEpoch,
    TaskEntry,
)
from swarm.protocol.timing import Timing
from swarm.protocol.uav_messages import StatusPhase
from tests.support.builders import (
    IDLE,
    MISSION,
    OUT,
    mission,
    status,
    task,
    uav,
)
from tests.support.lone_coordinator import (
    START_TIMEOUT_S,
    LoneCoordinator,
    finishes,
    notes,
    plan_of,
    plans_wanted,
    said,
)

U0, U1, U2 = uav("u0"), uav("u1"), uav("u2")
T0, T1 = task("t0", 5.0), task("t1", 9.0, service_s=2.0)
POPUP = task("popup", 7.0, appears_s=30.0)
TRIO = mission([U0, U1, U2], [T0, T1])


def test_it_briefs_posts_and_plans_at_once() -> None:
    coordinator = LoneCoordinator(mission([U0, U1], [T0, T1, POPUP]))
    (brief,) = said(coordinator.log, MissionConfig)
    posted = said(coordinator.log, TaskEntry)
    (wanted,) = plans_wanted(coordinator.log)

    assert [fleet.id for fleet in brief.uavs] == ["u0", "u1"]
    assert [fleet.layer_m for fleet in brief.uavs] == [10.0, 13.0]
    assert [(entry.task, entry.number) for entry in posted] == [("t0", 0), ("t1", 1)]
    assert posted[1].service_s == 2.0
    assert said(coordinator.log, PlanEpoch) == []
    assert (wanted.method, wanted.seed) == ("greedy", 7)
    assert [t.id for t in wanted.mission.tasks] == ["t0", "t1"]


def test_all_it_says_can_be_read() -> None:
    coordinator = LoneCoordinator(mission([U0], [T0, POPUP])).started()
    coordinator.run_until(200.0)
    coordinator.happen(Stop("told"))
    codec = Codec(MISSION)
    for action in coordinator.log:
        if hasattr(action, "message"):
            assert codec.decode(action.message.key, encode(action.message)) == action.message


def test_it_says_once_of_an_agent_that_its_release_is_too_old_for_the_mission() -> None:
    slow = replace(U0, acceleration_m_s2=2.5)
    deaf = replace(status(StatusPhase.LEARNING), dropped={"unknown version": 3})
    coordinator = LoneCoordinator(mission([slow, U1], [T0]))
    (brief,) = said(coordinator.log, MissionConfig)
    coordinator.see("u0", "u1")
    coordinator.hear("u0", status(StatusPhase.LEARNING))
    coordinator.hear("u1", deaf)
    coordinator.hear("u1", deaf)
    plain = LoneCoordinator(TRIO)
    plain.hear("u1", deaf)

    assert [fleet.acceleration_m_s2 for fleet in brief.uavs] == [2.5, None]
    (line,) = [line for line in notes(coordinator.log) if "too old" in line.text]
    assert (line.fields["uav"], line.fields["asks_for"]) == ("u1", "acceleration_m_s2")
    assert not [line for line in notes(plain.log) if "too old" in line.text]


def test_it_starts_as_soon_as_all_are_airborne_and_the_plan_is_made() -> None:
    coordinator = LoneCoordinator(TRIO)
    coordinator.answer_plan("u2", "u0", "u1")
    coordinator.ready("u0", "u1")
    assert coordinator.epoch is None

    (epoch,) = said(coordinator.ready("u2"), PlanEpoch)
    assert (epoch.number, epoch.phase, epoch.rule) == (1, MissionPhase.RUNNING, "greedy")
    assert (epoch.sequence, epoch.mission_s) == (("u2", "u0", "u1"), 0.0)


def test_it_waits_for_the_plan_when_all_are_airborne_first() -> None:
    coordinator = LoneCoordinator(TRIO)
    coordinator.ready("u0", "u1", "u2")
    assert coordinator.epoch is None

    assert len(said(coordinator.answer_plan("u0", "u1", "u2"), PlanEpoch)) == 1


def test_whoever_is_airborne_but_not_there_is_not_ready() -> None:
    coordinator = LoneCoordinator(TRIO)
    coordinator.answer_plan("u0", "u1", "u2")
    coordinator.hear("u2", IDLE)
    coordinator.ready("u0", "u1")
    assert coordinator.epoch is None

    coordinator.see("u2")
    assert coordinator.phase is MissionPhase.RUNNING


def test_after_the_timeout_it_replans_for_those_who_are_airborne_and_starts() -> None:
    coordinator = LoneCoordinator(TRIO)
    coordinator.answer_plan("u0", "u1", "u2")
    coordinator.ready("u2", "u0")
    assert plans_wanted(coordinator.run_until(100.0 + 0.9 * START_TIMEOUT_S)) == []

    actions = coordinator.run_until(100.0 + START_TIMEOUT_S)
    (wanted,) = plans_wanted(actions)
    assert [u.id for u in wanted.mission.uavs] == ["u0", "u2"]
    why = f"u1: its agent was never seen within {START_TIMEOUT_S:g} s"
    assert [n.fields for n in notes(actions)] == [{"uavs": "u1", "because": why}]
    assert coordinator.epoch is None

    coordinator.answer_plan("u2", "u0")
    assert coordinator.epoch is not None
    assert coordinator.epoch.sequence == ("u2", "u0")


def test_it_does_not_wait_for_a_uav_that_has_said_it_is_out() -> None:
    coordinator = LoneCoordinator(TRIO)
    coordinator.answer_plan("u0", "u1", "u2")
    coordinator.ready("u0", "u2")
    coordinator.see("u1")

    (wanted,) = plans_wanted(coordinator.hear("u1", OUT, 101.0))
    assert [u.id for u in wanted.mission.uavs] == ["u0", "u2"]


def test_who_gets_airborne_while_it_replans_is_planned_for_too() -> None:
    coordinator = LoneCoordinator(TRIO)
    coordinator.answer_plan("u0", "u1", "u2")
    coordinator.ready("u0")
    coordinator.run_until(100.0 + START_TIMEOUT_S)
    coordinator.ready("u1")
    late = plans_wanted(coordinator.log)[-2]
    coordinator.happen(PlanMade(late.request, plan_of(late.mission, "u0")))
    assert coordinator.epoch is None

    coordinator.answer_plan("u1", "u0")
    assert coordinator.epoch is not None
    assert coordinator.epoch.sequence == ("u1", "u0")


def test_it_sleeps_while_it_waits_for_a_plan_beyond_the_timeout() -> None:
    coordinator = LoneCoordinator(TRIO)
    coordinator.ready("u0", "u1", "u2")
    coordinator.run_until(100.0 + 2 * START_TIMEOUT_S)

    due_s = coordinator.core.next_deadline_s()
    assert due_s is not None
    assert due_s > coordinator.now_s


def test_when_nobody_is_airborne_in_time_the_mission_ends() -> None:
    coordinator = LoneCoordinator(TRIO)
    coordinator.answer_plan("u0", "u1", "u2")
    coordinator.see("u0")
    coordinator.run_until(100.0 + START_TIMEOUT_S)

    assert (coordinator.phase, coordinator.reason) == (MissionPhase.ENDED, "no UAV is airborne")
    coordinator.leave("u0")
    assert finishes(coordinator.run_until(300.0)) == [1]


def test_without_a_plan_the_mission_ends() -> None:
    coordinator = LoneCoordinator(TRIO)
    coordinator.ready("u0", "u1", "u2")
    coordinator.happen(PlanFailed(1, "too large"))

    assert (coordinator.phase, coordinator.reason) == (MissionPhase.ENDED, "no plan: too large")
    for name in coordinator.uavs:
        coordinator.leave(name)
    assert finishes(coordinator.run_until(300.0)) == [1]


def test_answers_to_an_older_request_mean_nothing() -> None:
    coordinator = LoneCoordinator(TRIO)
    coordinator.ready("u0")
    coordinator.run_until(100.0 + START_TIMEOUT_S)
    coordinator.happen(PlanFailed(1, "too large"))
    coordinator.happen(PlanMade(1, plan_of(TRIO, "u0", "u1", "u2")))

    assert coordinator.epoch is None


def test_it_speaks_on_while_so_many_join_that_it_never_knows_all_they_know() -> None:
    """Who says nothing for so long would be taken for lost by all who have joined."""
    uavs = [uav(f"u{number:02}") for number in range(40)]
    timing = Timing()
    coordinator = LoneCoordinator(mission(uavs, [T0, T1]), timing=timing)
    coordinator.answers = None  # each comes before the question about the last one is answered
    spoke_s, begun_s = [coordinator.now_s], coordinator.now_s
    for number, each in enumerate(uavs):
        actions = coordinator.happen(PeerSeen(each.id), begun_s + 0.5 * number)
        actions += coordinator.run_until(begun_s + 0.5 * (number + 1))
        if len(said(actions, MissionConfig)) + len(said(actions, TaskEntry)) > 0:
            spoke_s.append(coordinator.now_s)

    assert max(np.diff([*spoke_s, coordinator.now_s])) < timing.silence_s / 2
    assert said(coordinator.log, PlanEpoch) == []  # and decides nothing meanwhile
