"""Arriving, serving, handing over, and going home."""

from __future__ import annotations

import pytest

from agent.core.interface import (
    Arrived,
    AttemptFailed,
    GoTo,
    HandedOver,
    Home,
    Prepare,
    Refused,
    Return,
    ReturnAdvised,
    ReturnBegun,
    VehicleReady,
)
from swarm.model.ids import COORDINATOR
from swarm.protocol.events import MessageReceived, Stop
from swarm.protocol.messages import MissionPhase, TaskEntry
from swarm.protocol.uav_messages import AttemptResult, ClaimPhase, StatusPhase
from tests.support.builders import IDLE, OUT, done, entry, epoch, failed, held, proposed, uav
from tests.support.lone_agent import (
    ABOVE_START,
    LoneAgent,
    claims,
    finishes,
    notes,
    orders,
    outcomes,
    statuses,
)

NEAR, FAR = entry("near", east_m=10.0), entry("far", east_m=20.0, number=1)


def flying(*tasks: TaskEntry, others: int = 0) -> LoneAgent:
    agent = LoneAgent(*(uav(f"u{n}") for n in range(others + 1)))
    agent.fly_to(*tasks)
    agent.start_mission()
    return agent


# -- arriving and serving ---------------------------------------------------------------


def test_arriving_at_a_task_without_service_ends_it_and_begins_the_next_at_once() -> None:
    agent = flying(NEAR, FAR)
    actions = agent.arrive(10.5)

    assert outcomes(actions) == [done("near", 10.5)]
    assert claims(actions) == [proposed("far", 10.5, 0, 20.5)]
    assert orders(actions) == [GoTo(2, (20.0, 0.0, 10.0))]


def test_the_outcome_is_said_before_the_next_claim() -> None:
    """Else the others would think for a moment that the task is open."""
    agent = flying(NEAR, FAR)
    actions = agent.arrive(10.5)
    bodies = [action.message.body for action in actions if hasattr(action, "message")]

    assert bodies[:2] == [outcomes(actions)[0], claims(actions)[0]]


def test_a_service_takes_its_time() -> None:
    agent = flying(entry("near", east_m=10.0, service_s=4.0))
    agent.arrive(10.0)
    assert agent.core.phase is StatusPhase.SERVING
    assert outcomes(agent.run_until(13.75)) == []

    assert outcomes(agent.run_until(14.25)) == [done("near", 14.0)]


def test_news_of_an_older_leg_is_ignored() -> None:
    agent = flying(NEAR, FAR, others=1)
    first_leg = agent.leg
    agent.hear("u1", done("near"), 1.0)
    assert agent.task == "far"

    assert outcomes(agent.happen(Arrived(first_leg), 2.0)) == []
    assert outcomes(agent.arrive(20.0)) == [done("far", 20.0)]


def test_arriving_twice_is_arriving_once() -> None:
    agent = flying(NEAR)
    agent.arrive(10.0)

    assert outcomes(agent.arrive(10.0)) == []
    assert outcomes(agent.arrive(11.0)) == []


def test_a_task_lost_while_it_is_served_counts_for_the_other() -> None:
    agent = flying(entry("near", east_m=10.0, service_s=4.0), others=1)
    agent.arrive(10.0)
    agent.hear("u1", done("near", 12.0), 12.0)

    assert outcomes(agent.run_until(20.0)) == []


def test_the_next_decision_is_made_from_where_the_uav_really_is() -> None:
    agent = flying(NEAR, entry("west", east_m=-6.0, number=1), entry("east", east_m=30.0, number=2))
    agent.hear(COORDINATOR, entry("near", east_m=10.0, withdrawn=True), 2.0)
    assert agent.task == "west"
    agent.be_at((29.0, 0.0, 10.0))

    agent.hear(COORDINATOR, entry("west", east_m=-6.0, number=1, withdrawn=True))
    assert agent.claim is not None
    assert (agent.claim.task, agent.claim.completion_s) == ("east", 3.0)


def test_status_tells_place_without_the_height_layer() -> None:
    agent = flying(NEAR)
    agent.be_at((3.0, 1.0, 12.0))

    (status,) = statuses(agent.run_until(0.9 * agent.timing.status_s + 0.1))[-1:]
    assert status.position_enu_m == (3.0, 1.0, 2.0)
    assert (status.phase, status.task) == (StatusPhase.FLYING, "near")


# -- handed over ------------------------------------------------------------------------


def test_a_handed_over_vehicle_frees_its_task_and_is_never_commanded_again() -> None:
    agent = flying(NEAR, FAR)
    ordered = len(orders(agent.log))
    agent.happen(HandedOver("mode changed by its pilot"), 1.0)
    assert agent.phase is ClaimPhase.OUT
    assert agent.claim is not None
    assert agent.claim.task is None

    agent.arrive(2.0)
    agent.happen(VehicleReady())
    agent.post(entry("third", east_m=1.0, number=5))
    agent.hear(COORDINATOR, epoch("u0", number=2, mission_s=0.0))
    agent.run_until(60.0)
    agent.happen(HandedOver("again"))
    agent.end_mission(61.0)

    assert len(orders(agent.log)) == ordered
    assert agent.phase is ClaimPhase.OUT


@pytest.mark.parametrize("how", ["end of the mission", "stop"])
def test_the_agent_of_a_handed_over_vehicle_ends_with_the_mission(how: str) -> None:
    """Else the coordinator would wait for it for ever."""
    agent = flying(NEAR)
    agent.happen(HandedOver("mode changed by its pilot"), 1.0)
    actions = agent.end_mission(2.0) if how != "stop" else agent.happen(Stop("told"))

    assert finishes(actions) == [0]
    assert orders(actions) == []


def test_a_vehicle_handed_over_on_its_way_home_is_waited_for_no_longer() -> None:
    agent = flying(NEAR)
    agent.end_mission(1.0)

    assert finishes(agent.happen(HandedOver("mode changed by its pilot"), 2.0)) == [1]


def test_a_vehicle_that_refuses_to_return_fails_the_process() -> None:
    agent = flying(NEAR)
    (order,) = orders(agent.end_mission(1.0))
    actions = agent.happen(Refused(order, "the autopilot is silent"), 2.0)

    assert finishes(actions) == [1]
    assert statuses(actions)[-1].note == "the autopilot is silent"


# -- the end ----------------------------------------------------------------------------


def test_at_the_end_of_the_mission_it_returns_and_ends_once_it_is_home() -> None:
    agent = flying(NEAR)
    actions = agent.end_mission(1.0)
    assert orders(actions) == [Return("over", via_enu_m=ABOVE_START)]
    assert [claim.phase for claim in claims(actions)] == [ClaimPhase.OUT]
    assert finishes(actions) == []

    agent.run_until(30.0)
    actions = agent.happen(Home())
    assert finishes(actions) == [0]
    assert statuses(actions)[-1].phase is StatusPhase.HOME
    assert agent.core.next_deadline_s() is None


def landed(agent: LoneAgent) -> str:
    """What the log says of a vehicle that is home."""
    return notes(agent.happen(Home()))[-1]


def test_only_a_vehicle_that_was_in_the_air_is_said_to_have_landed() -> None:
    prepared = LoneAgent(uav("u0"))
    prepared.learn(prepared.statement(COORDINATOR, prepared.brief))
    waiting = LoneAgent(uav("u0"))
    climbed = LoneAgent(uav("u0"))
    climbed.learn(climbed.statement(COORDINATOR, climbed.brief))
    flew = flying(NEAR)
    for agent in (prepared, waiting, climbed, flew):
        agent.happen(Stop("told"))
    climbed.happen(ReturnBegun())

    assert landed(prepared) == "ends without having taken off"
    assert landed(waiting) == "ends without having taken off"
    assert landed(climbed) == "landed at home"
    assert landed(flew) == "landed at home"


def test_of_a_vehicle_that_an_earlier_life_brought_down_it_says_where_it_is() -> None:
    agent = LoneAgent(uav("u0"))
    mine, ended = agent.statement("u0", OUT), epoch("u0", phase=MissionPhase.ENDED, reason="over")
    agent.learn(mine, *agent.coordinators(agent.brief, ended), mission_s=9.0)

    assert landed(agent) == "is on the ground"


def test_told_to_stop_it_returns_whatever_it_does() -> None:
    for agent in (flying(NEAR), flying(entry("x", service_s=9.0)), LoneAgent(uav("u0"))):
        assert orders(agent.happen(Stop("told"))) == [Return("told")]
        assert orders(agent.happen(Stop("told"))) == []
        assert finishes(agent.happen(Home())) == [0]


@pytest.mark.parametrize("event", [Stop("told"), ReturnAdvised("battery low")])
def test_in_a_hurry_it_returns_from_where_it_is(event: Stop | ReturnAdvised) -> None:
    agent = flying(NEAR)
    agent.end_mission(1.0)
    (order,) = orders(agent.happen(event))
    assert order == Return(event.reason)
    assert orders(agent.happen(event)) == []
    assert finishes(agent.happen(Home())) == [0]


def test_home_means_nothing_to_one_who_was_not_sent_there() -> None:
    agent = flying(NEAR)

    assert finishes(agent.happen(Home(), 1.0)) == []
    assert agent.task == "near"


def test_on_its_way_home_it_takes_no_task() -> None:
    agent = flying(NEAR)
    agent.end_mission(1.0)
    agent.post(FAR)
    agent.hear(COORDINATOR, epoch("u0", number=3, mission_s=0.0))
    agent.arrive(9.0)

    assert orders(agent.log)[-1] == Return("over", via_enu_m=ABOVE_START)
    assert agent.phase is ClaimPhase.OUT
    assert outcomes(agent.log) == []


def test_an_agent_that_comes_after_the_end_does_not_take_off() -> None:
    agent = LoneAgent(uav("u0"))
    ended = epoch("u0", phase=MissionPhase.ENDED, reason="over")
    agent.learn(*agent.coordinators(agent.brief, ended), mission_s=9.0)

    assert orders(agent.log) == [Return("over", via_enu_m=ABOVE_START)]


def test_the_end_heard_during_preparation_ends_the_preparation() -> None:
    agent = LoneAgent(uav("u0"))
    agent.learn(agent.statement(COORDINATOR, agent.brief))
    agent.end_mission(0.0)

    assert [type(order) for order in orders(agent.log)] == [Prepare, Return]


def test_having_ended_it_says_and_does_nothing_more() -> None:
    agent = flying(NEAR)
    agent.end_mission(1.0)
    agent.happen(Home())

    assert agent.tick(99.0) == []
    assert agent.happen(MessageReceived(agent.statement("u1", IDLE))) == []


# -- without a coordinator --------------------------------------------------------------


def test_without_a_coordinator_it_finishes_the_tasks_and_then_goes_home() -> None:
    agent = flying(NEAR, FAR)
    agent.lose(COORDINATOR, 1.0)
    agent.arrive(10.0)
    assert agent.task == "far"
    agent.arrive(20.0)

    assert orders(agent.run_until(20.0 + 0.9 * agent.timing.linger_s)) == []
    (order,) = orders(agent.run_until(20.0 + 1.1 * agent.timing.linger_s))
    assert order == Return("no coordinator and nothing left to do", via_enu_m=ABOVE_START)
    assert finishes(agent.happen(Home())) == [0]


def test_airborne_without_a_coordinator_it_waits_for_a_mission_only_so_long() -> None:
    agent = LoneAgent(uav("u0"))
    agent.fly_to(NEAR)
    agent.lose(COORDINATOR, -90.0)

    assert orders(agent.run_until(-90.0 + 0.9 * agent.timing.abandon_s))[1:] == []
    (order,) = orders(agent.run_until(-85.0 + agent.timing.abandon_s))
    assert isinstance(order, Return)


def test_a_late_uav_may_finish_preparing_though_the_coordinator_is_gone() -> None:
    agent = LoneAgent(uav("u0"))
    known = agent.coordinators(agent.brief, NEAR, epoch("u0"))
    agent.learn(*known, mission_s=40.0)
    agent.now_s += 60.0
    agent.tick()
    agent.happen(VehicleReady())

    assert agent.task == "near"


def test_with_a_coordinator_it_waits_for_what_may_come() -> None:
    agent = flying(NEAR)
    agent.arrive(10.0)

    assert orders(agent.run_until(500.0)) == []


def test_while_another_is_at_work_it_stays_to_take_over() -> None:
    agent = LoneAgent(uav("u0"), uav("u1"))
    agent.fly_to(NEAR)
    agent.hear("u1", held("near", 0.0, 0, 400.0))
    agent.start_mission("u1", "u0")
    agent.lose(COORDINATOR, 1.0)
    agent.run_until(100.0)
    agent.lose("u1", 101.0)

    assert agent.task == "near"


def test_it_goes_home_although_tasks_are_open_that_nobody_who_is_left_can_do() -> None:
    agent = LoneAgent(uav("u0", near=0.0), uav("u1"))
    agent.fly_to(NEAR)
    agent.hear("u1", held("near", 0.0))
    agent.start_mission("u1", "u0")
    agent.lose(COORDINATOR, 1.0)
    agent.lose("u1", 2.0)

    (order,) = orders(agent.run_until(10.0))
    assert isinstance(order, Return)


def test_it_goes_home_although_the_others_idle_about_an_open_task() -> None:
    """None of them will ever take it: perhaps it lies outside a geofence."""
    agent = LoneAgent(uav("u0", near=0.0), uav("u1"))
    agent.fly_to(NEAR)
    agent.start_mission("u1", "u0")
    agent.lose(COORDINATOR, 1.0)

    (order,) = orders(agent.run_until(10.0))
    assert isinstance(order, Return)


def test_a_pop_up_that_another_knew_of_keeps_it_from_going_home() -> None:
    agent = flying(NEAR, others=1)
    agent.lose(COORDINATOR, 1.0)
    agent.arrive(10.0)
    agent.run_until(11.0)
    agent.learn(agent.statement(COORDINATOR, FAR))

    assert agent.task == "far"
    assert orders(agent.run_until(19.0)) == []


def test_the_coordinator_coming_back_keeps_it_from_going_home() -> None:
    agent = flying(NEAR)
    agent.lose(COORDINATOR, 1.0)
    agent.arrive(10.0)
    agent.run_until(11.0)
    agent.see(COORDINATOR)

    assert orders(agent.run_until(100.0)) == []


def test_the_agent_of_a_handed_over_vehicle_ends_without_a_coordinator_too() -> None:
    agent = flying(NEAR, others=1)
    agent.happen(HandedOver("mode changed by its pilot"), 1.0)
    agent.lose(COORDINATOR, 2.0)
    agent.hear("u1", OUT)

    assert finishes(agent.run_until(10.0)) == [0]


# -- attempts that fail -----------------------------------------------------------------


def test_an_attempt_that_fails_ends_when_its_service_does() -> None:
    agent = flying(entry("near", east_m=10.0, service_s=4.0), FAR)
    agent.arrive(10.0)
    agent.happen(AttemptFailed(agent.leg), 11.0)
    assert outcomes(agent.run_until(13.75)) == []

    actions = agent.run_until(14.25)
    assert outcomes(actions) == [failed("near", 14.0)]
    assert agent.task == "far"
    assert outcomes(agent.arrive(30.0)) == [done("far", 30.0)]


def test_a_failure_told_before_the_arrival_counts_for_a_task_without_service() -> None:
    agent = flying(NEAR)
    agent.happen(AttemptFailed(agent.leg), 10.0)

    assert outcomes(agent.arrive(10.0)) == [failed("near", 10.0)]
    assert agent.task is None


def test_a_failed_task_is_tried_again_where_the_scenario_says_so() -> None:
    agent = LoneAgent(uav("u0"), reattempt_failed=True)
    agent.fly_to(NEAR)
    agent.start_mission()
    agent.happen(AttemptFailed(agent.leg), 10.0)
    agent.arrive(10.0)

    assert agent.task == "near"
    order = orders(agent.log)[-1]
    assert isinstance(order, GoTo)
    assert (order.task, order.attempt) == ("near", 2)
    assert [(each.result, each.attempt) for each in outcomes(agent.arrive(11.0))] == [
        (AttemptResult.DONE, 2)
    ]


def test_a_failure_of_an_older_leg_is_ignored() -> None:
    agent = flying(NEAR, FAR, others=1)
    first_leg = agent.leg
    agent.hear("u1", done("near"), 1.0)
    agent.happen(AttemptFailed(first_leg), 2.0)

    assert outcomes(agent.arrive(20.0)) == [done("far", 20.0)]
