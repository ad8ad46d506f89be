"""What becomes of a UAV's task when its vehicle is in trouble."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from agent.core.interface import (
    Action,
    Caution,
    GoTo,
    HandedOver,
    HandOverExplained,
    HeardAgain,
    Home,
    NotReady,
    Prepare,
    Refused,
    Return,
    ReturnAdvised,
    VehicleReady,
    VehicleReport,
)
from swarm.model.ids import COORDINATOR, OPERATOR
from swarm.protocol.events import LogLine
from swarm.protocol.messages import CommandKind, OperatorCommand
from swarm.protocol.timing import Timing
from swarm.protocol.uav_messages import ClaimPhase, StatusPhase
from tests.support.builders import entry, uav
from tests.support.lone_agent import ZERO_S, LoneAgent, claims, finishes, orders, statuses

BATTERY = ReturnAdvised("battery at 15%, below the reserve of 20%")
FENCE = ReturnAdvised("75 m from the origin, outside the fence of 60 m")
PILOT = HandedOver("its pilot switched it to LOITER")
FAILSAFE = HandedOver("a failsafe switched it to RTL (Radio Failsafe)")
LOST = HandedOver("no valid position for 5 s")
SILENT = HandedOver("nothing heard for 5 s", silent=True)
AGAIN = HeardAgain("heard again after 20 s, as it was left")


def flying() -> LoneAgent:
    agent = LoneAgent(uav("u0"), uav("u1"))
    agent.fly_to(entry("near", east_m=10.0, service_s=4.0), entry("far", east_m=20.0, number=1))
    agent.start_mission()
    assert agent.task == "near"
    return agent


def reasons(actions: Sequence[Action]) -> list[object]:
    """What the log says of them."""
    return [action.fields["reason"] for action in actions if isinstance(action, LogLine)]


def status_phase_and_note(agent: LoneAgent) -> tuple[StatusPhase, str]:
    newest = statuses(agent.run_until(8.0))[-1]
    return newest.phase, newest.note


@pytest.mark.parametrize("serving", [False, True])
@pytest.mark.parametrize(
    ("report", "handed_over"),
    [(BATTERY, False), (FENCE, False), (PILOT, True), (FAILSAFE, True), (LOST, True)],
)
def test_a_vehicle_in_trouble_frees_its_task(
    report: ReturnAdvised | HandedOver, handed_over: bool, serving: bool
) -> None:
    agent = flying()
    if serving:
        agent.arrive(1.0)
    actions = agent.happen(report, 2.0)

    [claim] = claims(actions)
    assert (claim.phase, claim.task) == (ClaimPhase.OUT, None)
    assert claim.handed_over == handed_over
    returns = [] if handed_over else [Return(report.reason)]
    assert orders(actions) == returns
    phase = StatusPhase.OUT if handed_over else StatusPhase.RETURNING
    assert status_phase_and_note(agent) == (phase, report.reason)


@pytest.mark.parametrize("report", [BATTERY, PILOT])
def test_it_takes_no_task_afterwards(report: VehicleReport) -> None:
    agent = flying()
    agent.happen(report, 2.0)
    later = agent.post(entry("new", east_m=1.0, number=2)) + agent.run_until(30.0)
    assert orders(later) == []
    assert all(claim.phase is ClaimPhase.OUT for claim in claims(later))


def test_a_vehicle_that_was_advised_to_return_is_waited_for_until_it_is_home() -> None:
    agent = flying()
    agent.happen(BATTERY, 2.0)
    assert finishes(agent.run_until(20.0)) == []
    assert finishes(agent.happen(Home(), 20.0)) == [0]


def test_advice_that_comes_twice_gives_one_order() -> None:
    agent = flying()
    agent.happen(BATTERY, 2.0)
    assert orders(agent.happen(FENCE, 3.0)) == []


def test_a_vehicle_handed_over_is_not_called_home_by_advice() -> None:
    agent = flying()
    agent.happen(PILOT, 2.0)
    actions = agent.happen(BATTERY, 3.0)
    assert orders(actions) == []
    assert finishes(actions) == []


def test_a_vehicle_that_was_silent_and_is_heard_again_is_brought_home() -> None:
    agent = flying()
    [claim] = claims(agent.happen(SILENT, 2.0))
    assert (claim.phase, claim.handed_over) == (ClaimPhase.OUT, False)
    assert status_phase_and_note(agent) == (StatusPhase.OUT, SILENT.reason)

    actions = agent.happen(AGAIN, 20.0)
    assert orders(actions) == [Return(AGAIN.reason)]
    assert agent.core.phase is StatusPhase.RETURNING
    later = agent.post(entry("new", east_m=1.0, number=2)) + agent.run_until(30.0)
    assert orders(later) == []
    assert statuses(later)[-1].note == AGAIN.reason
    assert finishes(agent.happen(Home(), 31.0)) == [0]


def test_one_held_on_its_way_home_and_heard_again_after_a_silence_waits_for_nothing_else() -> None:
    agent = LoneAgent(uav("u0"))
    agent.fly_to()
    agent.start_mission()
    for kind in (CommandKind.RETURN, CommandKind.HOLD):
        agent.hear(OPERATOR, OperatorCommand("u0", kind, 1, ""))
    agent.happen(SILENT, 2.0)
    agent.lose(COORDINATOR, 3.0)  # with nothing left to do, it would leave after a while

    assert orders(agent.happen(AGAIN)) == [Return(AGAIN.reason)]
    assert finishes(agent.run_until(300.0)) == []
    assert finishes(agent.happen(Home())) == [0]


def test_what_became_of_a_silent_vehicle_is_told_and_it_is_left_to_who_has_it() -> None:
    agent = flying()
    agent.happen(SILENT, 2.0)
    told = HandOverExplained("heard again after 20 s: its pilot switched it to LOITER")
    actions = agent.happen(told, 3.0)
    assert orders(actions) == []
    assert [claim.handed_over for claim in claims(actions)] == [True]
    assert reasons(actions) == [told.reason]
    assert status_phase_and_note(agent) == (StatusPhase.OUT, told.reason)


def test_why_a_vehicle_was_handed_over_is_told_in_full_once_it_is_known() -> None:
    agent = flying()
    agent.happen(HandedOver("its pilot or a failsafe switched it to RTL"), 2.0)
    actions = agent.happen(HandOverExplained(FAILSAFE.reason), 2.5)
    assert (orders(actions), claims(actions)) == ([], [])
    assert reasons(actions) == [FAILSAFE.reason]
    assert status_phase_and_note(agent) == (StatusPhase.OUT, FAILSAFE.reason)


@pytest.mark.parametrize("report", [AGAIN, HandOverExplained("late news")])
def test_news_of_a_vehicle_that_is_not_given_up_means_nothing(report: VehicleReport) -> None:
    agent = flying()
    assert orders(agent.happen(report, 2.0)) == []
    assert agent.task == "near"


def test_a_target_refused_frees_the_task_and_the_uav_takes_another() -> None:
    agent = flying()
    [goto] = [order for order in orders(agent.log) if not isinstance(order, Prepare)]
    agent.happen(Refused(goto, "the autopilot did not take the target (denied)"), 2.0)
    assert agent.task == "far"
    assert Return not in {type(order) for order in orders(agent.log)}


def test_a_preparation_refused_takes_no_part_and_tells_why() -> None:
    agent = LoneAgent(uav("u0"), uav("u1"))
    agent.see("coordinator", "u1")
    agent.learn(agent.statement("coordinator", agent.brief))
    [prepare] = orders(agent.log)
    actions = agent.happen(Refused(prepare, "arming failed 15 times; last answer: failed"), 0.0)
    [claim] = claims(actions)
    assert (claim.phase, claim.handed_over) == (ClaimPhase.OUT, False)
    assert orders(actions) == []
    assert status_phase_and_note(agent) == (
        StatusPhase.OUT,
        "arming failed 15 times; last answer: failed",
    )


def test_what_a_vehicle_waits_for_shows_until_it_is_airborne() -> None:
    agent = LoneAgent(uav("u0"), uav("u1"))
    agent.see("coordinator", "u1")
    agent.learn(agent.statement("coordinator", agent.brief))
    reason = "battery at 15%, below the reserve of 20%: charge or change it"
    agent.happen(NotReady(reason), 0.0)
    assert status_phase_and_note(agent) == (StatusPhase.PREPARING, reason)

    agent.happen(VehicleReady(), 9.0)
    assert statuses(agent.run_until(12.0))[-1].note == ""


def test_what_people_should_know_of_a_vehicle_is_logged_and_shows_in_flight() -> None:
    agent = LoneAgent(uav("u0"), uav("u1"))
    agent.see("coordinator", "u1")
    agent.learn(agent.statement("coordinator", agent.brief))
    reason = "if its agent dies it hovers (FS_GCS_ENABLE is 0)"
    said = agent.happen(Caution(reason), 0.0)
    assert LogLine("caution", {"reason": reason}) in said

    agent.happen(VehicleReady(), 9.0)
    assert statuses(agent.run_until(12.0))[-1].note == reason

    agent.happen(Caution(""), 12.0)
    assert statuses(agent.run_until(15.0))[-1].note == ""


def test_a_refused_target_is_considered_again_after_a_while_each_time_longer() -> None:
    agent = LoneAgent(uav("u0"), timing=Timing(silence_s=1e6, pause_s=1e6))
    agent.fly_to(entry("near", east_m=10.0))
    agent.start_mission()
    refused_at_s, again_s = 0.0, agent.timing.reconsider_s
    for _ in range(3):
        (order,) = [o for o in orders(agent.log) if isinstance(o, GoTo) and o.leg == agent.leg]
        agent.happen(Refused(order, "outside the geofence"), refused_at_s)
        agent.run_until(refused_at_s + 0.99 * again_s)
        assert agent.phase is ClaimPhase.IDLE
        agent.run_until(refused_at_s + again_s + 2.0 * agent.timing.announce_s)
        assert agent.task == "near"
        refused_at_s = agent.now_s - ZERO_S
        again_s *= 2.0


def test_ready_again_and_again_is_ready_once() -> None:
    agent = flying()

    assert orders(agent.happen(VehicleReady())) == []
    assert agent.task == "near"
