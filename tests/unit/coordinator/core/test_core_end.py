"""What ends a mission, and when its coordinator leaves."""

from __future__ import annotations

from coordinator.core.lifecycle import PlanFailed
from swarm.protocol.events import Stop
from swarm.protocol.messages import MissionPhase, PlanEpoch, TaskEntry
from tests.support.builders import done, mission, task, uav
from tests.support.lone_coordinator import START_TIMEOUT_S, TIMING, LoneCoordinator, finishes, said

U0, U1, U2 = uav("u0"), uav("u1"), uav("u2")
T0, T1 = task("t0", 5.0), task("t1", 9.0, service_s=2.0)
POPUP = task("popup", 7.0, appears_s=30.0)


def ended(*tasks_done: str) -> LoneCoordinator:
    coordinator = LoneCoordinator(mission([U0, U1], [T0, T1])).started()
    for name in tasks_done:
        coordinator.hear("u0", done(name))
    coordinator.happen(Stop("told"))
    return coordinator


def test_when_nobody_believes_it_any_more_it_leaves_and_ends_no_mission() -> None:
    """Also not in its memory, by which its next life would end it."""
    coordinator = LoneCoordinator(mission([U0, U1], [T0, T1])).started()

    actions = coordinator.happen(Stop("its keys were revoked or replaced", believed=False))

    assert coordinator.phase is MissionPhase.RUNNING
    assert finishes(actions) == [1]
    assert said(actions, PlanEpoch) == []
    assert coordinator.core.next_deadline_s() is None


def test_it_stays_until_all_have_left_and_then_ends_well_if_all_was_done() -> None:
    coordinator = ended("t0", "t1")
    assert coordinator.phase is MissionPhase.ENDED
    coordinator.leave("u0")
    assert finishes(coordinator.run_until(500.0)) == []

    coordinator.leave("u1")
    coordinator.run_until(600.0)
    assert finishes(coordinator.log) == [0]
    assert coordinator.core.next_deadline_s() is None


def test_it_stays_for_one_that_hangs_before_its_first_claim_no_longer_than_for_the_lost() -> None:
    """Nothing that it says so early comes here, so its silence says nothing."""
    coordinator = LoneCoordinator(mission([U0, U1], [T0]))
    coordinator.see("u1")
    coordinator.ready("u0")
    coordinator.run_until(100.0 + START_TIMEOUT_S)
    coordinator.answer_plan("u0")
    coordinator.hear("u0", done("t0"))
    assert coordinator.reason == "every task has ended"
    ended_s = coordinator.now_s
    coordinator.leave("u0")

    assert finishes(coordinator.run_until(ended_s + 0.9 * TIMING.abandon_s)) == []
    later_s = ended_s + TIMING.abandon_s + TIMING.linger_s
    assert finishes(coordinator.run_until(later_s)) == [0]


def test_it_ends_badly_if_something_was_left_undone() -> None:
    coordinator = ended("t0")
    assert coordinator.reason == "told"
    for name in coordinator.uavs:
        coordinator.leave(name)

    assert finishes(coordinator.run_until(600.0)) == [1]


def test_it_ends_badly_if_a_pop_up_never_came() -> None:
    coordinator = LoneCoordinator(mission([U0], [T0, POPUP])).started()
    coordinator.hear("u0", done("t0"))
    coordinator.happen(Stop("told"))
    coordinator.leave("u0")

    assert finishes(coordinator.run_until(600.0)) == [1]


def test_after_the_end_nothing_is_posted_and_no_deadline_stays_behind() -> None:
    coordinator = LoneCoordinator(mission([U0, U1], [T0, POPUP])).started()
    coordinator.happen(Stop("told"))

    assert said(coordinator.run_until(200.0), TaskEntry) == []


def test_it_says_once_that_the_mission_ended() -> None:
    coordinator = ended()
    coordinator.happen(Stop("again"))
    coordinator.happen(PlanFailed(1, "late"))

    assert [e.reason for e in said(coordinator.log, PlanEpoch)][1:] == ["told"]
