"""A new life of an agent with nothing to go on with, or after one that had just taken off."""

from __future__ import annotations

from dataclasses import replace

import pytest

from agent.core.interface import (
    HandedOver,
    Home,
    MotorsRun,
    Refused,
    Return,
    VehicleReady,
)
from swarm.model.ids import COORDINATOR
from swarm.protocol.events import (
    Ask,
    Save,
    Stop,
)
from swarm.protocol.messages import MissionPhase
from swarm.protocol.uav_messages import ClaimPhase, StatusPhase
from tests.support.builders import epoch, uav
from tests.support.lone_agent import (
    ABOVE_START,
    LoneAgent,
    claims,
    finishes,
    orders,
)
from tests.support.restarted_agent import (
    NEAR,
    PREPARE,
    RESUME,
    crashed,
    registers,
)


@pytest.mark.parametrize("from_peers", [True, False], ids=["peers' memory", "own memory"])
def test_a_mission_that_ended_meanwhile_brings_the_vehicle_home(from_peers: bool) -> None:
    earlier = crashed()
    agent = earlier.reborn(remembers=not from_peers)
    ended = agent.coordinators(agent.brief, epoch("u0", phase=MissionPhase.ENDED, number=2))
    known = earlier.core.memory(0.0).messages if from_peers else ()
    actions = agent.learn(*known, *ended, mission_s=9.0)

    assert orders(actions) == [Return("", resume=True, via_enu_m=ABOVE_START)]
    assert agent.phase is ClaimPhase.OUT
    assert finishes(agent.happen(Home())) == [0]


def test_the_end_of_a_mission_heard_before_any_answer_is_asked_about_first() -> None:
    """Somebody may remember that this vehicle is in the air."""
    earlier = crashed()
    agent = earlier.reborn()
    agent.learn_from_nobody()
    agent.now_s += agent.timing.ask_gap_s
    actions = agent.end_mission(20.0)
    assert (orders(actions), actions.count(Ask())) == ([], 1)

    assert orders(agent.learn_what_was_known_to(earlier)) == [
        Return("over", resume=True, via_enu_m=ABOVE_START)
    ]


def test_one_whose_vehicle_will_not_be_resumed_brings_it_home() -> None:
    earlier = crashed()
    agent = earlier.reborn()
    (order,) = orders(agent.learn_what_was_known_to(earlier))
    actions = agent.happen(Refused(order, "the cruise speed cannot be set"))

    assert orders(actions) == [Return("the cruise speed cannot be set", resume=True)]
    assert agent.phase is ClaimPhase.OUT
    assert finishes(agent.happen(Home())) == [1]


def test_one_that_was_returning_returns() -> None:
    earlier = crashed()
    earlier.happen(Stop("told"))
    agent = earlier.reborn()
    actions = agent.learn_what_was_known_to(earlier)

    assert orders(actions) == [
        Return("left the mission in an earlier life", resume=True, via_enu_m=ABOVE_START)
    ]
    assert finishes(agent.happen(Home())) == [0]


def test_a_pilot_who_has_the_vehicle_by_then_keeps_it() -> None:
    earlier = crashed()
    earlier.happen(Stop("told"))
    agent = earlier.reborn()
    (order,) = orders(agent.learn_what_was_known_to(earlier))

    assert finishes(agent.happen(HandedOver("its pilot flies it in LOITER"))) == [1]
    assert orders(agent.log) == [order]
    assert agent.claim is not None
    assert agent.claim.handed_over


@pytest.mark.parametrize("from_peers", [True, False], ids=["peers' memory", "own memory"])
@pytest.mark.parametrize("returning", [True, False])
def test_a_vehicle_that_was_handed_over_stays_so(returning: bool, from_peers: bool) -> None:
    """It may be in the guided mode again, by its pilot's will: no order at all."""
    earlier = crashed()
    if returning:
        earlier.happen(Stop("told"))
    earlier.happen(HandedOver("its pilot switched it to LOITER"))
    agent = earlier.reborn(remembers=not from_peers)
    agent.see(COORDINATOR)
    if from_peers:
        agent.learn_what_was_known_to(earlier)
    else:
        agent.learn(*agent.coordinators(agent.brief, epoch("u0")), mission_s=9.0)
    agent.happen(VehicleReady())
    agent.run_until(30.0)

    assert orders(agent.log) == []
    assert agent.core.phase is StatusPhase.OUT
    newest = max(said.stamp for said in registers(earlier.log))
    assert [c.handed_over for c in claims(agent.log)][-1]
    assert registers(agent.log)[-1].stamp > newest
    assert finishes(agent.end_mission(31.0)) == [0]


@pytest.mark.parametrize("returning", [True, False])
def test_a_vehicle_that_was_only_silent_is_looked_for_and_brought_home(returning: bool) -> None:
    """Nobody is known to have it; its new agent's heartbeats keep its own failsafe off."""
    earlier = crashed()
    if returning:
        earlier.happen(Stop("told"))
    earlier.happen(HandedOver("nothing heard for 5 s", silent=True))
    agent = earlier.reborn()
    actions = agent.learn_what_was_known_to(earlier)

    assert orders(actions) == [
        Return("left the mission in an earlier life", resume=True, via_enu_m=ABOVE_START)
    ]


def test_a_vehicle_handed_over_before_an_end_unheard_of_is_left_alone_then() -> None:
    earlier = crashed()
    earlier.happen(HandedOver("its pilot switched it to LOITER"))
    agent = earlier.reborn()
    ended = agent.coordinators(epoch("u0", phase=MissionPhase.ENDED, number=2))
    actions = agent.learn(*earlier.core.memory(0.0).messages, *ended, mission_s=9.0)

    assert orders(actions) == []
    assert finishes(actions) == [0]


@pytest.mark.parametrize("handed_over", [True, False])
def test_it_takes_part_again_if_its_operator_says_so(handed_over: bool) -> None:
    earlier = crashed()
    earlier.happen(HandedOver("mode changed") if handed_over else Stop("told"))
    agent = earlier.reborn(rejoin=True)
    assert orders(agent.learn_what_was_known_to(earlier)) == [RESUME]
    agent.happen(VehicleReady())

    assert agent.task == "near"


def test_one_whose_vehicle_would_not_get_ready_tries_again_before_the_mission() -> None:
    earlier = LoneAgent(uav("u0"))
    earlier.learn(earlier.statement(COORDINATOR, earlier.brief))
    earlier.happen(Refused(PREPARE, "arming failed 15 times"))
    agent = earlier.reborn()

    assert orders(agent.learn_what_was_known_to(earlier)) == [PREPARE]


def test_one_that_never_flew_needs_no_vehicle_to_go_home() -> None:
    agent = LoneAgent(uav("u0"))
    ended = epoch("u0", phase=MissionPhase.ENDED, reason="over")

    assert orders(agent.learn(*agent.coordinators(agent.brief, ended))) == [
        Return("over", via_enu_m=ABOVE_START)
    ]


@pytest.mark.parametrize("age_s", [1.0, 1e4])
def test_told_to_stop_before_it_has_learned_it_brings_the_vehicle_home(age_s: float) -> None:
    agent = crashed().reborn(remembers=True, down_s=age_s)

    assert orders(agent.happen(Stop("told"))) == [Return("told", resume=True)]


# -- killed while it takes off ----------------------------------------------------------------


@pytest.mark.parametrize("ours", [True, False])
def test_one_that_had_begun_to_take_off_knows_its_vehicle_again(ours: bool) -> None:
    earlier = LoneAgent(uav("u0"))
    earlier.learn(earlier.statement(COORDINATOR, earlier.brief))
    earlier.happen(MotorsRun(True))
    earlier.happen(MotorsRun(ours))
    agent = earlier.reborn(remembers=True)

    assert orders(agent.learn_what_was_known_to(earlier)) == [replace(PREPARE, begun=ours)]


def test_that_motors_run_is_kept_at_once_and_no_longer_than_until_it_is_ready() -> None:
    agent = LoneAgent(uav("u0"))
    agent.learn(agent.statement(COORDINATOR, agent.brief))

    assert Save() in agent.happen(MotorsRun(True))
    assert agent.core.memory(agent.now_s).begun
    assert Save() in agent.happen(VehicleReady())
    assert not agent.core.memory(agent.now_s).begun


def test_a_take_off_of_another_flight_means_nothing() -> None:
    earlier = LoneAgent(uav("u0"))
    earlier.learn(earlier.statement(COORDINATOR, earlier.brief))
    earlier.happen(MotorsRun(True))
    agent = earlier.reborn(remembers=True)
    another = replace(agent.brief, run=agent.brief.run + 1)

    assert orders(agent.learn(*agent.coordinators(another, NEAR))) == [PREPARE]
