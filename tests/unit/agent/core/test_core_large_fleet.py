"""How seldom an agent repeats itself in a large fleet, and what is told soon all the same."""

from __future__ import annotations

import pytest

from agent.core.interface import Action, VehicleReady
from swarm.model.ids import COORDINATOR
from swarm.protocol.events import (
    Ask,
    LinkChanged,
    LogLine,
    MessageReceived,
    MessagesReceived,
    PeerGone,
    PeerSeen,
    Publish,
)
from swarm.protocol.key_space import KeySpace
from swarm.protocol.messages import Message
from swarm.protocol.sync import EVERYONE_UP_TO, SOME
from swarm.protocol.timing import MOST_STATUS_STRETCH, UNSTRETCHED_UAVS, Timing, stretch_of
from swarm.protocol.uav_messages import Claim, ClaimPhase, Outcome, Status
from tests.support.builders import MISSION, done, entry, held, uav
from tests.support.lone_agent import LoneAgent, claims, notes, outcomes

TIMING = Timing()
SIZES = (25, 50, 100, 200)


def fleet(n_uav: int, tasks: int = 8) -> LoneAgent:
    """``u0`` on its way in a running mission, all others idle; the nearest task comes first."""
    agent = LoneAgent(*(uav(f"u{n}") for n in range(n_uav)), timing=TIMING)
    agent.fly_to(*(entry(f"t{n}", east_m=10.0 + n, number=n) for n in range(tasks)))
    agent.start_mission()
    agent.run_until(0.5)
    agent.learn()
    return agent


def repeated(actions: list[Action]) -> list[Message]:
    """Registers that were published."""
    said = [action.message for action in actions if isinstance(action, Publish)]
    return [message for message in said if isinstance(message.body, Claim | Outcome)]


def lost(actions: list[Action]) -> list[object]:
    """Who was told to be lost."""
    logged = [action for action in actions if isinstance(action, LogLine)]
    return [line.fields["writer"] for line in logged if line.text == "lost"]


def asked(actions: list[Action]) -> list[tuple[str, ...]]:
    """Who was asked, by question."""
    return [action.of for action in actions if isinstance(action, Ask)]


def keep_alive(agent: LoneAgent, until_s: float, every_s: float = 1.0) -> list[Action]:
    """Let time go on while all others repeat what they have said."""
    keys = KeySpace(MISSION)
    others = [keys.plan, *(keys.claim(f"u{n}") for n in range(1, len(agent.uavs)))]
    said = [agent.core.replica.register(key) for key in others]
    actions: list[Action] = []
    at_s = agent.now_s - 200.0
    while at_s < until_s:
        at_s += every_s
        for message in said:
            assert message is not None
            actions += agent.happen(MessageReceived(message))
        actions += agent.run_until(at_s)
    return actions


@pytest.mark.parametrize("n_uav", SIZES)
def test_what_one_hears_of_repetitions_does_not_grow_with_the_fleet(n_uav: int) -> None:
    agent = fleet(n_uav)
    agent.arrive(1.0)
    keep_alive(agent, 20.0)
    period_s = stretch_of(n_uav) * TIMING.announce_s

    said = repeated(keep_alive(agent, 20.0 + 10.0 * period_s))

    heard_hz = len(said) * n_uav / (10.0 * period_s)
    assert 0.9 * UNSTRETCHED_UAVS / TIMING.announce_s < heard_hz
    at_once = 1 if n_uav > UNSTRETCHED_UAVS else 2
    assert heard_hz < (at_once + 0.3) * UNSTRETCHED_UAVS / TIMING.announce_s


@pytest.mark.parametrize("n_uav", SIZES)
def test_what_is_new_is_repeated_as_soon_as_in_a_small_fleet(n_uav: int) -> None:
    agent = fleet(n_uav)
    keep_alive(agent, 20.0)
    agent.arrive(20.0 if agent.now_s < 220.0 else agent.now_s - 200.0)
    ended_s = agent.now_s - 200.0
    keep_alive(agent, ended_s, every_s=0.1)

    again = keep_alive(agent, ended_s + TIMING.announce_s + 0.2, every_s=0.1)

    assert "t0" in {outcome.task for outcome in outcomes(again)}
    assert "t1" in {claim.task for claim in claims(again)}


@pytest.mark.parametrize("n_uav", SIZES[1:])
def test_a_decision_is_told_by_two_claims_and_its_outcome_is_said_with_each(n_uav: int) -> None:
    agent = fleet(n_uav)
    keep_alive(agent, 20.0)
    before, arrived_s = len(agent.log), agent.now_s - 200.0
    agent.arrive(arrived_s)
    keep_alive(agent, arrived_s + 0.9 * TIMING.announce_s, every_s=0.1)

    said = [message.body for message in repeated(agent.log[before:])]
    told = [(body.task, body.phase) for body in said if isinstance(body, Claim)]
    assert told == [("t1", ClaimPhase.PROPOSED), ("t1", ClaimPhase.HELD)]
    assert [body.task for body in said if isinstance(body, Outcome)] == ["t0", "t0"]
    assert isinstance(said[-1], Outcome), "repeated with the claim that is held"


def test_many_who_come_together_are_greeted_together() -> None:
    agent = fleet(100)
    keep_alive(agent, 5.0)
    before = len(agent.log)
    for n in range(1, 60):
        agent.happen(PeerGone(f"u{n}"))
    agent.run_until(agent.now_s - 200.0 + 2.0 * TIMING.loss_delay_s)
    for n in range(1, 60):
        agent.happen(PeerSeen(f"u{n}"))
    agent.run_until(agent.now_s - 200.0 + 1.5 * stretch_of(100) * TIMING.ask_gap_s)

    assert notes(agent.log[before:]).count("back") == 59
    assert 1 <= len(claims(agent.log[before:])) <= 3
    assert 1 <= len(asked(agent.log[before:])) <= 5


@pytest.mark.parametrize(("n_uav", "greets"), [(10, True), (100, False)])
def test_who_comes_to_many_for_the_first_time_is_not_greeted_for_it_asks(
    n_uav: int, greets: bool
) -> None:
    agent = fleet(n_uav)
    keep_alive(agent, 5.0)
    agent.run_until(agent.now_s - 200.0 + 2.0 * stretch_of(n_uav) * TIMING.ask_gap_s)

    actions = agent.happen(PeerSeen("newcomer"))

    assert bool(claims(actions)) is greets
    assert asked(actions) == []


def test_who_comes_before_the_mission_runs_is_there_and_waited_for_as_ever() -> None:
    agent = LoneAgent(uav("u0"), uav("u1"), timing=TIMING)
    agent.learn(agent.statement(COORDINATOR, agent.brief))
    agent.happen(VehicleReady())

    agent.happen(PeerSeen("u1"))
    agent.happen(PeerGone("u1"))

    assert lost(agent.run_until(agent.now_s - 200.0 + 2.0 * TIMING.loss_delay_s)) == ["u1"]


def test_a_uav_of_a_large_fleet_may_be_silent_longer_and_the_coordinator_may_not() -> None:
    agent = fleet(100)
    silence_s = stretch_of(100) * TIMING.silence_s
    began_s = agent.now_s - 200.0

    actions = agent.run_until(began_s + TIMING.silence_s + 1.0)
    assert lost(actions) == [COORDINATOR]

    actions = agent.run_until(began_s + silence_s + 1.0)
    assert len(lost(actions)) == 99


def test_messages_heard_together_are_learned_as_if_heard_one_by_one() -> None:
    said = [held(f"t{n}", 50.0 + n) for n in range(1, 5)]
    agents = fleet(30), fleet(30)
    told = [agents[0].statement(f"u{n}", claim) for n, claim in enumerate(said, 1)]
    told.append(agents[0].statement("u1", done("t1")))
    for message in told:
        agents[0].happen(MessageReceived(message))
    agents[1].happen(MessagesReceived(tuple(told)))

    one, other = (agent.core for agent in agents)
    assert list(one.replica.messages()) == list(other.replica.messages())
    assert one.next_deadline_s() == other.next_deadline_s()
    arrived = [agent.arrive(agent.now_s - 200.0) for agent in agents]
    assert [claim.task for claim in claims(arrived[0])] == ["t5"]
    assert claims(arrived[0]) == claims(arrived[1])


def test_what_is_only_repeated_among_messages_heard_together_keeps_its_writer_alive() -> None:
    agent = fleet(30)
    known = agent.statement("u1", held("t5", 50.0))
    agent.happen(MessageReceived(known))
    began_s = agent.now_s - 200.0
    silence_s = stretch_of(30) * TIMING.silence_s
    agent.run_until(began_s + 0.9 * silence_s)

    assert agent.happen(MessagesReceived((known,))) == []
    assert "u1" not in lost(agent.run_until(began_s + 1.5 * silence_s))
    assert "u1" in lost(agent.run_until(began_s + 2.0 * silence_s))


def test_a_word_that_is_only_repeated_keeps_its_writer_alive_and_changes_nothing_else() -> None:
    agent = fleet(3)
    said = agent.statement("u1", held("t5", 50.0))
    agent.happen(MessageReceived(said))
    agent.hear("u2", held("t6", 50.0))
    agent.run_until(1.0)
    deadline_s = agent.core.next_deadline_s()

    assert agent.happen(MessageReceived(said)) == []
    assert agent.core.next_deadline_s() == deadline_s

    for _ in range(20):
        agent.run_until(agent.now_s - 200.0 + 0.45 * TIMING.silence_s)
        agent.happen(MessageReceived(said))
    assert "u2" in lost(agent.log)
    assert "u1" not in lost(agent.log)


def test_a_repeated_word_of_one_who_was_lost_makes_its_claim_count_again() -> None:
    agent = fleet(3)
    said = agent.statement("u1", held("t5", 50.0))
    agent.happen(MessageReceived(said))
    agent.happen(PeerGone("u1"))
    agent.run_until(agent.now_s - 200.0 + 2.0 * TIMING.loss_delay_s)
    agent.happen(PeerSeen("u1"))
    credible = agent.core._peers.membership.is_credible

    assert not credible("u1")
    agent.happen(MessageReceived(said))
    assert credible("u1")


@pytest.mark.parametrize("n_uav", SIZES)
def test_what_onlookers_hear_grows_little_and_statuses_come_often_enough(n_uav: int) -> None:
    agent = fleet(n_uav)
    said = [a.message for a in keep_alive(agent, 20.0) if isinstance(a, Publish)]

    heard_hz = n_uav * sum(isinstance(message.body, Status) for message in said) / 19.5
    assert heard_hz <= 1.1 * max(UNSTRETCHED_UAVS / TIMING.status_s, n_uav)
    assert MOST_STATUS_STRETCH * TIMING.status_s < TIMING.silence_s / 4.0


def test_when_somebody_of_many_is_lost_some_are_asked_for_all_they_know() -> None:
    agent = fleet(100)
    actions = agent.lose("u50", 1.0)

    (first,) = asked(actions)
    assert {"u0", COORDINATOR} < set(first)
    assert len(first) == 2 + SOME
    assert "u50" not in first

    agent.learn()
    (second,) = asked(agent.lose("u51", 2.0))
    assert not set(first) & set(second) - {"u0", COORDINATOR}, "they take turns"


def test_who_is_back_is_asked_for_sure_and_of_few_everyone_is() -> None:
    agent = fleet(100)
    agent.lose("u50", 1.0)
    agent.now_s += 1.0
    (of,) = asked(agent.see("u50"))
    assert "u50" in of

    small = fleet(EVERYONE_UP_TO)
    assert asked(small.lose("u5", 1.0)) == [()]


def test_what_was_said_without_a_link_is_repeated_when_it_is_back_and_some_are_asked() -> None:
    agent = fleet(100)
    keep_alive(agent, 20.0)
    agent.happen(LinkChanged(False))
    agent.arrive(21.0)
    agent.run_until(21.0 + 3.0 * TIMING.announce_s)
    back = agent.happen(LinkChanged(True))

    assert {outcome.task for outcome in outcomes(back)} >= {"t0"}
    assert {claim.task for claim in claims(back)} == {"t1"}
    (first,) = asked(back)
    assert len(first) == 2 + SOME
    again = agent.learn() + agent.run_until(agent.now_s - 200.0 + TIMING.relink_grace_s)
    assert asked(again) == [], "who was not asked is not waited for"


def test_one_who_asks_for_all_is_told_what_others_have_said_but_the_coordinators_words() -> None:
    agent = fleet(100)
    agent.hear("u7", held("t5", 50.0))

    narrow = {m.writer for m in agent.core.snapshot(agent.now_s).messages}
    whole = {m.writer for m in agent.core.whole(agent.now_s).messages}

    assert narrow == {"u0"}
    assert whole == {f"u{n}" for n in range(100)}
