"""A new life of an agent: what it takes over from the earlier one, and what it leaves alone."""

from __future__ import annotations

from dataclasses import replace

import pytest

from agent.core.interface import (
    GoTo,
    Home,
    Return,
    VehicleReady,
)
from swarm.model.ids import COORDINATOR
from swarm.protocol.events import (
    Ask,
    KeysReplaced,
    MessageReceived,
    SnapshotsReceived,
)
from swarm.protocol.fields import MAX_COUNT
from swarm.protocol.messages import Body, Message, Snapshot, Stamp, demoted
from swarm.protocol.uav_messages import ClaimPhase, StatusPhase
from tests.support.builders import MISSION, done, entry, epoch, held, message, proposed, uav
from tests.support.lone_agent import (
    ABOVE_START,
    ZERO_S,
    LoneAgent,
    claims,
    finishes,
    notes,
    orders,
    outcomes,
)
from tests.support.restarted_agent import (
    AT_ONCE,
    HELD,
    LEFT,
    NEAR,
    PREPARE,
    crashed,
    registers,
)


def test_it_does_not_leave_its_task_for_want_of_the_coordinators_answer() -> None:
    """Others know the task that it had, and leave it to the coordinator to say that it is time."""
    earlier = crashed(others=1)
    agent = earlier.reborn()
    agent.see(COORDINATOR, "u1")
    known = agent.core.replica
    brief, claim = agent.statement(COORDINATOR, agent.brief), earlier.core.replica.claims["u0"]
    remembered = message("u0", claim, counter=70, incarnation=5)
    answer = Snapshot(MISSION, "u1", 1, 6.0, (brief, remembered))

    for _ in range(3):  # it asks again, and the coordinator's answer gets lost each time
        assert orders(agent.happen(SnapshotsReceived((answer,)))) == []

    assert known.claims["u0"] == HELD
    actions = agent.learn_what_was_known_to(earlier)
    assert orders(actions) == [LEFT]
    assert agent.task == "near"


# -- going on ---------------------------------------------------------------------------


@pytest.mark.parametrize("from_peers", [True, False], ids=["peers' memory", "own memory"])
def test_it_stands_by_its_claim_at_once_and_flies_on_to_its_task(from_peers: bool) -> None:
    earlier = crashed()
    agent = earlier.reborn(remembers=not from_peers)
    agent.see(COORDINATOR)
    if from_peers:
        actions = agent.learn_what_was_known_to(earlier)
    else:
        actions = agent.learn(agent.statement(COORDINATOR, agent.brief), mission_s=6.0)

    assert orders(actions) == [LEFT]
    assert set(claims(actions)) == {HELD}
    assert agent.core.phase is StatusPhase.FLYING
    actions = agent.happen(VehicleReady())
    assert orders(actions) == [GoTo(1, (10.0, 0.0, 10.0))]
    assert claims(actions) == []
    actions = agent.arrive(10.0)
    assert outcomes(actions) == [done("near", 10.0)]
    assert agent.task == "far"


def test_it_keeps_its_claim_though_nobody_has_told_the_time_at_first() -> None:
    """As when answers are lost; without the time it does not know whether the claim counts."""
    earlier = crashed()
    agent = earlier.reborn(remembers=False)
    agent.see(COORDINATOR)
    actions = agent.learn(*earlier.core.memory(agent.now_s).messages)
    assert orders(actions) == []
    assert registers(actions) == []
    assert any(isinstance(action, Ask) for action in agent.run_until(8.0))

    actions = agent.learn(mission_s=8.0)
    assert orders(actions) == [LEFT]
    assert set(claims(actions)) == {HELD}


def test_it_begins_without_the_time_when_nobody_has_told_it_for_long() -> None:
    earlier = crashed()
    agent = earlier.reborn()
    agent.see(COORDINATOR)
    agent.learn(*earlier.core.memory(agent.now_s).messages)
    agent.run_until(6.0 + agent.timing.abandon_s - 1.0)
    assert agent.core.phase is StatusPhase.LEARNING

    agent.run_until(6.0 + agent.timing.abandon_s + 1.0)
    assert agent.core.phase is not StatusPhase.LEARNING


def test_everything_it_says_is_newer_than_what_others_remember() -> None:
    earlier = crashed()
    agent = earlier.reborn()
    agent.learn_what_was_known_to(earlier)
    agent.happen(VehicleReady())
    agent.arrive(10.0)

    newest = max(said.stamp for said in registers(earlier.log))
    assert registers(agent.log)
    assert all(said.stamp > newest for said in registers(agent.log))


def test_it_says_anew_what_it_remembers_having_said_under_other_keys() -> None:
    """Nobody stands for that any more, and others may have believed a thief instead."""
    earlier = crashed(timing=AT_ONCE)
    own = demoted(message("u0", done("gone", 3.0), 9, 9))
    earlier.core.replica.join(own)
    agent = earlier.reborn(remembers=True)

    agent.learn_from_nobody()
    agent.happen(VehicleReady())
    agent.run_until(agent.now_s + 60.0)

    told = [said for said in registers(agent.log) if said.key == own.key]
    assert told
    assert told[0].body == own.body
    assert all(said.stamp.incarnation > 1 for said in told)


def test_keys_that_change_before_it_remembers_change_what_it_remembers() -> None:
    largest = Stamp(MAX_COUNT, MAX_COUNT)
    earlier = crashed(others=1)
    earlier.core.replica.join(Message(MISSION, "u1", largest, held("far", 0.0, 0, 10.0)))
    agent = earlier.reborn(remembers=True)

    agent.happen(KeysReplaced(frozenset({"u1"})))
    agent.learn(agent.statement(COORDINATOR, agent.brief), mission_s=6.0)
    honest = message("u1", proposed("far", 5.0), 1, 2000)
    agent.happen(MessageReceived(honest))

    assert agent.core.replica.known(honest) == honest


def test_with_nobody_there_it_trusts_a_young_memory() -> None:
    agent = crashed().reborn(remembers=True, down_s=20.0)
    actions = agent.learn_from_nobody()

    assert orders(actions) == [LEFT]
    assert set(claims(actions)) == {HELD}
    assert agent.core.snapshot(agent.now_s).mission_s == 24.0
    agent.happen(VehicleReady())
    assert outcomes(agent.arrive(30.0)) == [done("near", 30.0)]


def test_a_claim_that_was_only_proposed_is_so_still_and_held_after_the_window() -> None:
    earlier = LoneAgent(uav("u0"))
    earlier.fly_to(NEAR)
    earlier.start_mission()
    agent = earlier.reborn(down_s=1.0)
    actions = agent.learn_what_was_known_to(earlier)
    assert set(claims(actions)) == {proposed("near", 0.0, 0, 10.0)}
    agent.happen(VehicleReady())

    assert claims(agent.run_until(1.1 + agent.timing.objection_window_s)) == [HELD]


@pytest.mark.parametrize(
    ("news", "reason"),
    [(done("near"), "task is done"), (held("near", 0.0, 0, 3.0), "u1 has the stronger claim")],
)
def test_a_claim_that_counts_no_more_is_given_up_at_once(news: Body, reason: str) -> None:
    earlier = crashed(others=1)
    agent = earlier.reborn()
    agent.see(COORDINATOR, "u1")
    known = earlier.core.memory(0.0).messages
    actions = agent.learn(*known, agent.statement("u1", news), mission_s=6.0)

    assert {claim.phase for claim in claims(actions)} == {ClaimPhase.IDLE}
    assert "released" in notes(actions)
    assert reason in str(actions)
    assert orders(actions) == [LEFT]
    actions = agent.happen(VehicleReady())
    assert agent.task == "far"


def test_it_decides_from_where_the_vehicle_is() -> None:
    earlier = crashed(others=1)
    agent = earlier.reborn()
    agent.see(COORDINATOR, "u1")
    known = earlier.core.memory(0.0).messages
    agent.learn(*known, agent.statement("u1", done("near")), mission_s=6.0)
    agent.be_at((7.0, 0.0, 10.0))
    agent.happen(VehicleReady(), 6.0)

    assert agent.claim == proposed("far", 6.0, 0, 19.0)


def test_a_vehicle_that_does_not_show_itself_keeps_its_task_from_others_only_so_long() -> None:
    earlier = crashed(timing=AT_ONCE)
    agent = earlier.reborn()
    agent.see(COORDINATOR)
    agent.learn_what_was_known_to(earlier)
    mission_s = agent.now_s - ZERO_S

    agent.run_until(mission_s + 0.9 * AT_ONCE.silence_s)
    assert agent.task == "near"
    agent.run_until(mission_s + 1.1 * AT_ONCE.silence_s)
    assert agent.phase is ClaimPhase.IDLE

    agent.happen(VehicleReady())
    assert agent.task == "near"


def test_a_service_that_was_cut_short_is_done_in_full() -> None:
    earlier = crashed(entry("near", east_m=10.0, service_s=4.0))
    earlier.arrive(10.0)
    earlier.run_until(12.0)
    assert earlier.core.phase is StatusPhase.SERVING
    agent = earlier.reborn(down_s=1.0)
    agent.learn_what_was_known_to(earlier)
    agent.happen(VehicleReady(), 14.0)
    agent.arrive(14.5)

    assert outcomes(agent.run_until(18.25)) == []
    assert outcomes(agent.run_until(18.75)) == [done("near", 18.5)]


def test_it_knows_and_tells_again_what_it_has_done() -> None:
    earlier = crashed()
    earlier.arrive(10.0)
    agent = earlier.reborn(remembers=True)
    actions = agent.learn(agent.statement(COORDINATOR, agent.brief), mission_s=12.0)

    assert outcomes(actions) == [done("near", 10.0)]
    assert agent.task == "far"
    answered = [message.body for message in agent.core.snapshot(agent.now_s).messages]
    assert done("near", 10.0) in answered


def test_one_that_was_idle_says_so_again_once_the_vehicle_is_ready() -> None:
    earlier = crashed(NEAR)
    earlier.arrive(10.0)
    assert earlier.phase is ClaimPhase.IDLE
    agent = earlier.reborn()
    assert orders(agent.learn_what_was_known_to(earlier)) == [LEFT]

    assert [claim.phase for claim in claims(agent.happen(VehicleReady()))] == [ClaimPhase.IDLE]


def test_before_the_mission_runs_it_goes_on_from_where_it_hovers() -> None:
    earlier = LoneAgent(uav("u0"))
    earlier.fly_to(NEAR)
    agent = earlier.reborn()
    actions = agent.learn_what_was_known_to(earlier)

    assert orders(actions) == [LEFT]
    agent.happen(VehicleReady())
    agent.start_mission()
    assert agent.task == "near"


# -- whom to believe --------------------------------------------------------------------


def test_it_learns_before_it_believes_its_memory() -> None:
    agent = crashed().reborn(remembers=True)

    assert agent.log == [Ask()]
    agent.now_s += 0.5
    assert orders(agent.tick()) == []


def test_a_memory_of_another_flight_means_nothing() -> None:
    agent = crashed().reborn(remembers=True)
    another = replace(agent.brief, run=agent.brief.run + 1)
    actions = agent.learn(*agent.coordinators(another, NEAR))

    assert orders(actions) == [PREPARE]
    assert claims(agent.log) == []
    assert set(agent.core.replica.board) == {"near"}


def test_a_brief_heard_before_any_answer_is_no_answer_yet() -> None:
    """Others may remember what this agent claimed, and whoever is briefed anew asks again."""
    earlier = crashed()
    agent = earlier.reborn()
    agent.learn_from_nobody()
    agent.now_s += agent.timing.ask_gap_s
    heard = agent.hear(COORDINATOR, agent.brief)
    assert (orders(heard), heard.count(Ask())) == ([], 1)

    assert orders(agent.learn_what_was_known_to(earlier)) == [LEFT]
    assert agent.task == "near"


def test_whoever_is_there_and_has_not_answered_is_asked_once_more() -> None:
    """The coordinator may have been parted from the others, and know less than they do."""
    earlier = crashed(others=1)
    agent = earlier.reborn()
    agent.see(COORDINATOR, "u1")
    known = earlier.core.memory(0.0).messages
    agent.now_s += agent.timing.ask_gap_s
    actions = agent.happen(SnapshotsReceived((Snapshot(MISSION, COORDINATOR, 1, 6.0, known),)))
    assert (orders(actions), actions.count(Ask())) == ([], 1)

    own = message("u0", done("near", 3.0), counter=99, incarnation=5)
    agent.happen(SnapshotsReceived((Snapshot(MISSION, "u1", 1, 6.0, (own,)),)))
    assert orders(agent.log) == [LEFT]
    assert claims(agent.log) != [HELD]


def test_one_who_never_answers_is_waited_for_no_longer() -> None:
    earlier = crashed(others=1)
    agent = earlier.reborn()
    agent.see(COORDINATOR, "u1")
    known = earlier.core.memory(0.0).messages
    agent.now_s += agent.timing.ask_gap_s
    for _ in range(2):
        agent.happen(SnapshotsReceived((Snapshot(MISSION, COORDINATOR, 1, 6.0, known),)))

    assert orders(agent.log) == [LEFT]


def test_with_nobody_there_an_old_memory_is_not_trusted_but_the_vehicle_is_brought_home() -> None:
    earlier = crashed()
    agent = earlier.reborn(remembers=True, down_s=1.1 * earlier.timing.recall_s)
    began_s = agent.now_s - ZERO_S
    agent.learn_from_nobody()
    assert orders(agent.run_until(began_s + 0.9 * agent.timing.abandon_s)) == []

    actions = agent.run_until(began_s + 1.1 * agent.timing.abandon_s)
    assert orders(actions) == [
        Return("nobody knows of a mission", resume=True, via_enu_m=ABOVE_START)
    ]
    # Not a success: whoever runs it should start it again, in case a mission comes yet.
    assert finishes(agent.happen(Home())) == [1]


def test_an_old_memory_is_confirmed_by_whoever_comes_in_time() -> None:
    earlier = crashed()
    agent = earlier.reborn(remembers=True, down_s=1.1 * earlier.timing.recall_s)
    agent.learn_from_nobody()
    agent.now_s += 0.5 * agent.timing.abandon_s
    agent.see(COORDINATOR)
    actions = agent.learn(*agent.coordinators(agent.brief, NEAR, epoch("u0")), mission_s=99.0)

    assert orders(actions) == [LEFT]
    assert agent.task == "near"


@pytest.mark.parametrize("how", ["not begun", "went home"])
def test_with_nobody_there_it_waits_if_it_took_no_part(how: str) -> None:
    earlier = LoneAgent(uav("u0"))
    earlier.learn(earlier.statement(COORDINATOR, earlier.brief))
    if how == "went home":
        earlier.happen(VehicleReady())
        earlier.start_mission()
        earlier.end_mission(5.0)
    agent = earlier.reborn(remembers=True)
    agent.learn_from_nobody()
    agent.run_until(agent.now_s - ZERO_S + 2.0 * agent.timing.abandon_s)

    assert orders(agent.log) == []
    another = replace(agent.brief, run=agent.brief.run + 1)
    assert orders(agent.learn(*agent.coordinators(another))) == [PREPARE]
