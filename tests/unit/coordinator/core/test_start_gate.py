"""For whom the start of a mission waits, and for how long while others hover."""

from __future__ import annotations

from dataclasses import replace

from swarm.model.ids import OPERATOR
from swarm.protocol.messages import MissionPhase, StartWithout
from tests.support.builders import OUT, PAUSED, mission, task, uav
from tests.support.lone_coordinator import (
    START_TIMEOUT_S,
    TIMING,
    LoneCoordinator,
    notes,
    plans_wanted,
)

TRIO = mission([uav("u0"), uav("u1"), uav("u2")], [task("t0", 5.0), task("t1", 9.0)])
RESTART_S, HOVER_S = 10.0, 30.0
RUN = 1
GATE = replace(TIMING, restart_s=RESTART_S, hover_s=HOVER_S)


def fleet() -> LoneCoordinator:
    """Its coordinator has a plan for all, and waits."""
    coordinator = LoneCoordinator(TRIO, timing=GATE)
    coordinator.answer_plan("u0", "u1", "u2")
    return coordinator


def planned_for(coordinator: LoneCoordinator) -> list[str]:
    """Whom the newest plan is for."""
    return [uav.id for uav in plans_wanted(coordinator.log)[-1].mission.uavs]


def because(coordinator: LoneCoordinator) -> list[object]:
    return [n.fields["because"] for n in notes(coordinator.log) if n.text == "starting without"]


def test_a_uav_that_was_lost_gets_the_time_of_a_restart_and_no_more() -> None:
    coordinator = fleet()
    coordinator.see("u1")
    coordinator.ready("u0", "u2")
    lost_s = coordinator.now_s + 1.0
    coordinator.lose("u1", lost_s)
    lost_s = coordinator.now_s

    coordinator.run_until(lost_s + 0.9 * RESTART_S)
    assert planned_for(coordinator) == ["u0", "u1", "u2"]
    coordinator.run_until(lost_s + RESTART_S)

    assert planned_for(coordinator) == ["u0", "u2"]
    assert because(coordinator) == ["u1: its agent is lost"]
    coordinator.answer_plan("u0", "u2")
    assert coordinator.phase is MissionPhase.RUNNING


def test_a_uav_that_is_back_in_time_is_waited_for() -> None:
    coordinator = fleet()
    coordinator.see("u1")
    coordinator.ready("u0", "u2")
    coordinator.lose("u1", coordinator.now_s + 1.0)
    coordinator.run_until(coordinator.now_s + 0.5 * RESTART_S)
    coordinator.see("u1")

    coordinator.run_until(coordinator.now_s + RESTART_S)
    assert planned_for(coordinator) == ["u0", "u1", "u2"]
    coordinator.ready("u1")
    assert coordinator.phase is MissionPhase.RUNNING


def test_a_uav_that_is_lost_again_and_again_is_waited_for_as_long_as_a_stuck_one() -> None:
    coordinator = fleet()
    coordinator.ready("u0", "u2")
    began_s = coordinator.now_s
    while coordinator.now_s < began_s + HOVER_S - 3.0:
        coordinator.see("u1")
        coordinator.lose("u1", coordinator.now_s + 1.0)
    coordinator.run_until(began_s + HOVER_S)

    assert planned_for(coordinator) == ["u0", "u2"]


def test_vehicles_in_the_air_wait_so_long_for_one_that_does_not_get_ready() -> None:
    coordinator = fleet()
    coordinator.see("u1")
    coordinator.run_until(105.0)
    coordinator.ready("u0")
    hovers_s = coordinator.now_s
    coordinator.run_until(hovers_s + 0.5 * HOVER_S)
    coordinator.ready("u2")

    coordinator.run_until(hovers_s + 0.9 * HOVER_S)
    assert planned_for(coordinator) == ["u0", "u1", "u2"]
    coordinator.run_until(hovers_s + HOVER_S)

    assert planned_for(coordinator) == ["u0", "u2"]
    assert because(coordinator) == ["u1: not airborne, and others have waited 30 s in the air"]


def test_an_agent_that_was_never_seen_is_waited_for_like_one_that_gets_ready() -> None:
    coordinator = fleet()
    coordinator.ready("u0", "u2")
    hovers_s = coordinator.now_s

    coordinator.run_until(hovers_s + 2.0 * RESTART_S)
    assert planned_for(coordinator) == ["u0", "u1", "u2"]
    coordinator.run_until(hovers_s + HOVER_S)
    assert planned_for(coordinator) == ["u0", "u2"]


def test_on_the_ground_there_is_time() -> None:
    coordinator = fleet()
    coordinator.see("u0", "u1", "u2")
    coordinator.lose("u1", 103.0)

    coordinator.run_until(100.0 + 0.9 * START_TIMEOUT_S)
    assert coordinator.phase is None
    assert planned_for(coordinator) == ["u0", "u1", "u2"]


def test_who_comes_down_again_ends_the_hovering() -> None:
    coordinator = fleet()
    coordinator.see("u1", "u2")
    coordinator.ready("u0")
    hovers_s = coordinator.now_s
    coordinator.run_until(hovers_s + 0.8 * HOVER_S)
    coordinator.hear("u0", OUT)
    coordinator.ready("u2")

    coordinator.run_until(hovers_s + 1.5 * HOVER_S)
    assert planned_for(coordinator) == ["u0", "u1", "u2"]


def test_whom_the_operator_holds_in_the_air_waits_by_their_word() -> None:
    coordinator = fleet()
    coordinator.see("u1", "u2")
    coordinator.hear("u0", PAUSED)

    coordinator.run_until(coordinator.now_s + 1.5 * HOVER_S)
    assert planned_for(coordinator) == ["u0", "u1", "u2"]


def test_one_that_said_it_is_out_is_not_waited_for_although_its_agent_has_ended() -> None:
    coordinator = fleet()
    coordinator.see("u1")
    coordinator.leave("u1")
    coordinator.ready("u0", "u2")

    assert planned_for(coordinator) == ["u0", "u2"]
    assert because(coordinator) == ["u1: takes no part"]


def test_the_operator_may_say_whom_not_to_wait_for() -> None:
    coordinator = fleet()
    coordinator.see("u1")
    coordinator.ready("u0", "u2")
    coordinator.hear(OPERATOR, StartWithout("u1", RUN, "no GPS"))

    assert planned_for(coordinator) == ["u0", "u2"]
    assert because(coordinator) == ["u1: the operator does not wait for it (no GPS)"]
    coordinator.answer_plan("u0", "u2")
    assert coordinator.phase is MissionPhase.RUNNING
    assert coordinator.reason == "without u1: the operator does not wait for it (no GPS)"


def test_the_operators_word_is_about_one_uav_and_one_flight() -> None:
    coordinator = fleet()
    coordinator.see("u1", "u2")
    coordinator.ready("u0")
    coordinator.hear(OPERATOR, StartWithout("u1", RUN, ""))
    coordinator.hear(OPERATOR, StartWithout("u2", RUN + 1, ""))

    assert planned_for(coordinator) == ["u0", "u1", "u2"]
    coordinator.ready("u1", "u2")
    coordinator.answer_plan("u0", "u1", "u2")
    assert coordinator.reason == "every UAV is airborne"


def test_on_the_operators_word_nobody_starts_without_anybody_in_the_air() -> None:
    coordinator = fleet()
    coordinator.see("u0", "u1", "u2")
    for name in coordinator.uavs:
        coordinator.hear(OPERATOR, StartWithout(name, RUN, ""))
    assert coordinator.phase is None

    coordinator.ready("u2")
    assert planned_for(coordinator) == ["u2"]


def test_while_it_waits_for_a_plan_it_sleeps() -> None:
    coordinator = fleet()
    coordinator.ready("u0", "u2")
    coordinator.run_until(coordinator.now_s + HOVER_S)

    due_s = coordinator.core.next_deadline_s()
    assert due_s is not None
    assert due_s > coordinator.now_s + 1.0
