"""When an agent's knowledge is old, whom it asks, and what waits for the answer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from agent.core.interface import Action
from agent.core.verticals import Verticals
from swarm.model.ids import COORDINATOR
from swarm.protocol.events import (
    Ask,
    LinkChanged,
    LogLine,
    MessageReceived,
    PeerGone,
    Publish,
    Save,
    SnapshotsReceived,
)
from swarm.protocol.messages import Body, Snapshot, TaskEntry
from swarm.protocol.sync import MOST_OPEN
from swarm.protocol.timing import Timing
from swarm.protocol.uav_messages import Claim, ClaimPhase, Nearby, Outcome, Status, StatusPhase
from tests.support.builders import (
    IDLE,
    MISSION,
    OUT,
    brief,
    done,
    entry,
    epoch,
    held,
    message,
    proposed,
    uav,
)
from tests.support.lone_agent import ZERO_S, LoneAgent, claims, finishes, notes, orders, outcomes

NEAR, FAR = entry("near", east_m=10.0), entry("far", east_m=20.0, number=1)
TIMING = Timing(silence_s=1e6)
"""Timers as they are, but nobody must speak to count as alive."""


def flying(*tasks: TaskEntry, timing: Timing = TIMING) -> LoneAgent:
    """``u0`` on its way to the first of ``tasks``, up to date, with ``u1`` idle."""
    agent = LoneAgent(uav("u0"), uav("u1"), timing=timing, now_s=ZERO_S - 0.5)
    agent.fly_to(*tasks)
    agent.start_mission()
    agent.run_until(0.5)
    answer_all(agent)
    return agent


def asks(actions: list[Action]) -> int:
    return sum(action == Ask() for action in actions)


def answer_all(agent: LoneAgent) -> list[Action]:
    """Nobody has news, whichever question is still open."""
    return [action for _ in range(5) for action in agent.learn_from_nobody()]


def learn_from_all(agent: LoneAgent) -> list[Action]:
    """Everyone who is there answers, and has no news."""
    return agent.happen(
        SnapshotsReceived(tuple(Snapshot(MISSION, who, 1, None, ()) for who in (COORDINATOR, "u1")))
    )


# -- held up ----------------------------------------------------------------------------


def test_an_agent_that_was_stopped_asks_before_it_decides_and_flies_on_meanwhile() -> None:
    agent = flying(NEAR, FAR)
    actions = agent.arrive(10.0)

    assert "held up" in notes(actions)
    assert asks(actions) == 1
    assert set(outcomes(actions)) == {done("near", 10.0)}
    assert {claim.phase for claim in claims(actions)} == {ClaimPhase.IDLE}
    assert orders(actions) == []

    actions = agent.learn(agent.statement("u1", done("far", 8.0)))
    assert agent.task is None
    assert orders(agent.learn(agent.statement(COORDINATOR, entry("third", number=2)))) != []


def test_who_was_not_heard_while_it_was_stopped_is_not_lost() -> None:
    agent = flying(NEAR)
    agent.hear("u1", IDLE, 1.0)
    agent.happen(PeerGone("u1"))
    actions = agent.tick(60.0)
    assert "held up" in notes(actions)
    assert "lost" not in notes(actions)

    assert "lost" not in notes(agent.run_until(60.0 + 0.9 * TIMING.relink_grace_s))
    assert "lost" in notes(agent.run_until(60.0 + 1.1 * TIMING.relink_grace_s))


def test_an_answer_to_a_question_of_before_is_no_answer() -> None:
    agent = flying(NEAR, FAR)
    agent.happen(LinkChanged(True))
    agent.run_until(1.0)  # asked, and no answer yet
    agent.arrive(10.0)
    assert agent.phase is ClaimPhase.IDLE

    learn_from_all(agent)
    assert agent.phase is ClaimPhase.IDLE
    learn_from_all(agent)
    assert agent.task == "far"


@pytest.mark.parametrize("answered", [True, False])
def test_after_an_outage_it_waits_for_those_whose_link_is_back_later(answered: bool) -> None:
    agent = flying(NEAR, FAR, timing=replace(TIMING, pause_s=1e6))
    agent.happen(LinkChanged(False), 9.0)
    agent.happen(LinkChanged(True), 9.8)
    agent.learn_from_nobody()  # nobody else has its link yet
    agent.arrive(9.9)
    assert agent.phase is ClaimPhase.IDLE

    assert asks(agent.run_until(10.3)) == 1
    if answered:
        learn_from_all(agent)
    else:
        agent.learn_from_nobody()
        assert agent.phase is ClaimPhase.IDLE
        for _ in range(5):  # whoever is there and never answers holds nobody up for long
            agent.run_until(agent.now_s - ZERO_S + 0.5)
            agent.learn_from_nobody()
        assert agent.now_s - ZERO_S <= 9.8 + TIMING.relink_grace_s + 1.5
    assert agent.task == "far"


def test_a_claim_known_by_hearsay_counts_no_longer_than_its_writer_may_be_silent() -> None:
    agent = flying(NEAR, FAR, timing=Timing(pause_s=1e6))
    agent.hear(COORDINATOR, brief(*(uav(f"u{n}") for n in range(3))))
    agent.see("u2")
    agent.learn(message("u2", held("far", 0.0, 0, 5.0)))
    agent.arrive(1.0)
    assert agent.task is None

    for _ in range(4):  # u1 and the coordinator speak, u2 never does
        agent.run_until(agent.now_s - ZERO_S + 1.5)
        agent.hear("u1", IDLE)
        agent.hear(COORDINATOR, epoch("u0", "u1"))
    assert agent.task == "far"


def test_without_an_answer_it_asks_again_but_lets_no_questions_pile_up() -> None:
    """Each ends some time; where answers are read slowly, more of them would only take longer."""
    agent = flying(NEAR, FAR)
    agent.arrive(10.0)

    assert asks(agent.run_until(10.0 + 9.5 * TIMING.ask_s)) == MOST_OPEN - 1
    assert agent.phase is ClaimPhase.IDLE
    assert asks(answer_all(agent)) == 0
    assert agent.task == "far"
    assert asks(agent.run_until(30.0)) == 0


def test_who_is_held_up_again_before_it_has_caught_up_does_not_begin_anew() -> None:
    agent = flying(NEAR, FAR)
    assert asks(agent.arrive(10.0)) == 1

    actions = agent.tick(20.0)
    assert "held up" in notes(actions)
    answer_all(agent)
    assert agent.task == "far"


def test_who_took_long_to_catch_up_decides_though_it_is_held_up_again() -> None:
    """There is too much to do: to ask again and again would be more, and decide nothing."""
    agent = flying(NEAR, FAR, entry("third", east_m=30.0, number=2))
    agent.arrive(10.0)
    agent.run_until(15.0)
    answer_all(agent)
    assert agent.task == "far"
    asked = asks(agent.log)

    assert "held up" in notes(agent.arrive(25.0))
    assert agent.task == "third"
    assert asks(agent.log) == asked

    assert "held up" in notes(agent.tick(36.0))
    assert asks(agent.log) == asked + 1


def test_a_little_delay_is_no_matter() -> None:
    agent = flying(NEAR, FAR)
    actions = agent.arrive(0.5 + 0.9 * TIMING.pause_s)

    assert "held up" not in notes(actions)
    assert agent.task == "far"


# -- the own link -----------------------------------------------------------------------


def test_back_on_the_bus_it_learns_before_it_decides() -> None:
    agent = flying(NEAR, FAR)
    agent.happen(LinkChanged(False), 1.0)
    agent.run_until(5.0)
    actions = agent.happen(LinkChanged(True))
    assert asks(actions) == 1
    assert claims(actions) == [held("near", 0.0, 0, 10.0)]
    agent.arrive(5.0)
    assert agent.phase is ClaimPhase.IDLE

    agent.learn(agent.statement("u1", done("far", 4.0)))
    assert agent.task is None


def test_without_a_link_it_goes_on_by_itself() -> None:
    agent = flying(NEAR, FAR)
    agent.happen(LinkChanged(False), 1.0)
    agent.run_until(9.9)
    agent.arrive(10.0)

    assert agent.task == "far"


def test_after_a_partition_it_learns_everything_the_others_did() -> None:
    """However many outcomes there are: an answer holds them all."""
    tasks = [entry(f"t{n}", east_m=10.0 + n, number=n) for n in range(30)]
    agent = flying(*tasks)
    agent.happen(PeerGone("u1"), 1.0)
    agent.run_until(9.0)
    asked = asks(agent.log)
    actions = agent.see("u1")
    assert asks(agent.log) == asked + 1
    told = [agent.statement("u1", done(f"t{n}", 50.0)) for n in range(1, 30)]
    agent.learn(*told)

    assert agent.task == "t0"
    assert "back" in notes(actions)
    assert set(agent.core.replica.outcomes) == {("u1", f"t{n}") for n in range(1, 30)}


def test_what_it_did_is_answered_whole_and_repeated_by_and_by() -> None:
    tasks = [entry(f"t{n}", east_m=1.0 + n, number=n) for n in range(10)]
    agent = flying(*tasks)
    for n in range(9):
        agent.run_until(0.9 + n)
        agent.arrive(1.0 + n)
    answered = [m.body for m in agent.core.snapshot(agent.now_s).messages]
    assert sum(isinstance(body, Outcome) for body in answered) == 9

    repeated = outcomes(agent.run_until(10.0 + 3.5 * TIMING.announce_s))
    assert {outcome.task for outcome in repeated} == {f"t{n}" for n in range(9)}


# -- others -----------------------------------------------------------------------------


def told(actions: list[Action], text: str) -> list[dict[str, object]]:
    return [a.fields for a in actions if isinstance(a, LogLine) and a.text == text]


def test_a_lost_peer_is_asked_after_and_its_task_taken_without_waiting_for_answers() -> None:
    agent = LoneAgent(uav("u0"), uav("u1"))
    agent.fly_to(NEAR)
    agent.hear("u1", held("near", 0.0))
    agent.start_mission("u1", "u0")
    agent.now_s += 1.0
    agent.happen(PeerGone("u1"))
    agent.now_s += agent.timing.loss_delay_s
    actions = agent.tick()

    assert told(actions, "lost") == [{"writer": "u1", "why": "gone"}]
    assert asks(actions) == 1
    assert agent.task == "near"


def test_a_peer_that_says_nothing_any_more_is_lost_though_its_token_lives() -> None:
    agent = flying(NEAR, timing=Timing())
    agent.hear("u1", IDLE, 1.0)
    agent.hear(COORDINATOR, NEAR)
    assert told(agent.run_until(0.9 + agent.timing.silence_s), "lost") == []

    actions = agent.run_until(1.1 + agent.timing.silence_s)
    assert {"writer": "u1", "why": "silent"} in told(actions, "lost")
    assert "u1" not in agent.core._peers.credible


def test_one_who_speaks_again_is_back_and_asked() -> None:
    agent = flying(NEAR, timing=Timing())
    agent.hear("u1", IDLE, 1.0)
    agent.run_until(2.0 + agent.timing.silence_s)
    answer_all(agent)
    actions = agent.hear("u1", IDLE)

    assert told(actions, "back") == [{"writer": "u1"}]
    assert asks(actions) == 1
    assert claims(actions) == [held("near", 0.0, 0, 10.0)]


def test_one_who_left_for_good_is_not_called_lost() -> None:
    agent = flying(NEAR)
    agent.hear("u1", OUT)
    actions = agent.lose("u1", 1.0)

    assert told(actions, "left") == [{"writer": "u1", "why": "gone"}]


def test_many_reasons_to_ask_at_once_are_one_question() -> None:
    agent = LoneAgent(*(uav(f"u{n}") for n in range(9)))
    agent.fly_to(NEAR)
    agent.start_mission()
    for n in range(1, 9):
        agent.happen(PeerGone(f"u{n}"), 1.0)

    assert asks(agent.run_until(10.0)) == 1


# -- twins ------------------------------------------------------------------------------


def twin(incarnation: int, *at_work: Body) -> SnapshotsReceived:
    """Another process under the name of ``u0`` answers."""
    own = tuple(message("u0", body, 9, incarnation) for body in at_work)
    return SnapshotsReceived((Snapshot(MISSION, "u0", incarnation, None, own),))


@pytest.mark.parametrize("incarnation", [4, 6])
def test_beside_a_living_agent_at_work_a_new_one_gives_up(incarnation: int) -> None:
    agent = LoneAgent(uav("u0"), incarnation=5)
    actions = agent.happen(twin(incarnation, held("near", 0.0)))

    assert finishes(actions) == [1]
    assert "another agent already flies this UAV" in notes(actions)
    assert [a for a in actions if isinstance(a, Publish | Save)] == []
    assert orders(agent.log) == []
    assert agent.tick(9.0) == []


def test_of_two_that_begin_together_the_older_stays() -> None:
    older, newer = LoneAgent(uav("u0"), incarnation=5), LoneAgent(uav("u0"), incarnation=6)

    assert finishes(older.happen(twin(6))) == []
    assert finishes(newer.happen(twin(5))) == [1]


@pytest.mark.parametrize(("incarnation", "yields"), [(4, False), (9, True)])
def test_of_two_that_fly_the_newer_stays(incarnation: int, yields: bool) -> None:
    agent = flying(NEAR)
    ordered = len(orders(agent.log))
    actions = agent.happen(twin(incarnation, held("near", 0.0)))

    assert finishes(actions) == ([1] if yields else [])
    assert len(orders(agent.log)) == ordered
    assert not yields or [a for a in actions if isinstance(a, Publish | Save)] == []


def test_one_that_flies_gives_nothing_to_one_that_has_just_begun() -> None:
    agent = flying(NEAR)

    assert finishes(agent.happen(twin(9))) == []
    assert agent.task == "near"


def test_words_in_its_name_make_it_ask_before_it_contradicts() -> None:
    agent = flying(NEAR, FAR)
    stranger = message("u0", held("far", 0.0), counter=3, incarnation=9)
    agent.now_s += 0.5
    actions = agent.happen(MessageReceived(stranger))
    assert asks(actions) == 1
    assert claims(actions) == []

    spoken = [a.message for a in agent.learn_from_nobody() if isinstance(a, Publish)]
    (again,) = [said for said in spoken if not isinstance(said.body, Status)]
    assert again.body == held("near", 0.0, 0, 10.0)
    assert again.stamp > stranger.stamp


def test_words_in_its_name_that_a_living_twin_said_end_the_older() -> None:
    agent = flying(NEAR, FAR)
    agent.now_s += 1.0
    agent.happen(MessageReceived(message("u0", held("far", 0.0), counter=3, incarnation=9)))

    assert finishes(agent.happen(twin(9, held("far", 0.0)))) == [1]


def test_a_flood_of_words_in_its_name_keeps_it_from_no_decision() -> None:
    agent = flying(NEAR, FAR)
    for n in range(20):
        agent.now_s += 0.1
        agent.happen(
            MessageReceived(message("u0", held("far", 0.0), counter=n, incarnation=10_000 + n))
        )
        if n == 9:
            agent.arrive(agent.now_s - ZERO_S)
            assert agent.phase is ClaimPhase.IDLE
    agent.learn_from_nobody()

    assert agent.task == "far"


def test_its_own_token_means_nothing_to_it() -> None:
    agent = flying(NEAR)
    actions = agent.see("u0") + agent.happen(PeerGone("u0"))

    assert "lost" not in notes(actions + agent.run_until(9.0))
    assert agent.core.phase is StatusPhase.FLYING


# -- what is kept -----------------------------------------------------------------------


def saves(actions: list[Action]) -> int:
    return sum(action == Save() for action in actions)


def test_nothing_is_kept_before_it_has_learned() -> None:
    """It might replace what an earlier life kept, which is not joined yet."""
    agent = LoneAgent(uav("u0"))
    agent.hear(COORDINATOR, agent.brief)
    agent.post(NEAR)
    agent.now_s += agent.timing.ask_gap_s
    agent.tick()
    assert saves(agent.log) == 0

    assert saves(agent.learn() + agent.learn()) == 1


def test_its_own_words_and_the_coordinators_are_kept_and_nothing_else() -> None:
    agent = LoneAgent(uav("u0"), uav("u1"))
    agent.fly_to(NEAR, FAR)
    assert saves(agent.start_mission()) == 1
    assert saves(agent.run_until(0.25)) == 0  # status alone
    assert saves(agent.hear("u1", proposed("third", 0.2))) == 0
    assert saves(agent.run_until(0.5)) == 1  # held
    assert saves(agent.arrive(10.0)) == 1
    assert saves(agent.post(entry("fourth", number=3))) == 1
    assert saves(agent.hear(COORDINATOR, epoch("u0", "u1", number=1, mission_s=9.0))) == 0
    assert saves(agent.hear(COORDINATOR, epoch("u1", "u0", number=2, mission_s=9.0))) == 1
    assert saves(agent.end_mission(11.0)) == 1


def saved_at_s(agent: LoneAgent, until_s: float) -> list[float]:
    """Mission times at which it wants its memory kept, until then."""
    times_s: list[float] = []
    while (due_s := agent.core.next_deadline_s()) is not None and due_s < ZERO_S + until_s:
        times_s += [agent.now_s - ZERO_S] * saves(agent.tick_when_due())
    return times_s


def test_what_is_kept_stays_young_and_wears_no_flash_out_while_nothing_changes() -> None:
    agent = flying(entry("far", east_m=5000.0))
    agent.run_until(2.0)

    times_s = saved_at_s(agent, 602.0)
    gaps_s = np.diff([2.0, *times_s, 602.0])
    assert len(times_s) <= 4 * 10, "four times a minute"
    assert max(gaps_s) <= TIMING.recall_s / 4 + TIMING.announce_s


def test_what_others_have_done_is_kept_soon_but_not_each_word_for_itself() -> None:
    theirs = [entry(f"t{n}", 9000.0 + n, number=n) for n in range(9)]
    agent = flying(entry("far", east_m=5000.0), *theirs)
    agent.run_until(2.0)
    for number in range(9):
        assert saves(agent.hear("u1", done(f"t{number}"))) == 0

    times_s = saved_at_s(agent, 2.0 + 2 * TIMING.announce_s)
    assert len(times_s) == 1
    assert times_s[0] <= 2.0 + TIMING.announce_s


def test_its_memory_holds_what_everyone_has_said() -> None:
    agent = flying(NEAR)
    agent.hear("u1", done("far"))
    memory = agent.core.memory(ZERO_S + 7.0)

    assert memory.mission_s == 7.0
    assert {message.writer for message in memory.messages} == {"u0", "u1", COORDINATOR}
    assert memory.messages == tuple(agent.core.replica.messages())


def test_what_it_tells_those_near_it_many_times_a_second_keeps_nothing() -> None:
    """Each of these would be a write to the disk in a fleet where somebody decides all along."""
    theirs = [entry(f"t{n}", 9000.0 + n, number=n) for n in range(9)]
    agent = LoneAgent(uav("u0"), uav("u1", east_m=500.0), verticals=Verticals())
    agent.brief = replace(agent.brief, separation_m=5.0)
    agent.fly_to(entry("far", east_m=5000.0), *theirs)
    agent.start_mission()
    agent.run_until(2.0)
    told = len(agent.log)
    for number in range(9):
        agent.hear("u1", done(f"t{number}"))
        agent.be_at((20.0 + number, 0.0, 10.0))
        agent.run_until(2.0 + 0.2 * number)

    said = [each.message.body for each in agent.log[told:] if isinstance(each, Publish)]
    assert sum(isinstance(body, Nearby) for body in said) >= 2
    assert not any(isinstance(body, Claim) for body in said)
    assert saves(agent.log[told:]) == 0
