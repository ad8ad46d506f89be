"""Mission time as one agent knows it: whose word sets it, and what puts it right."""

from __future__ import annotations

from dataclasses import replace

from swarm.model.ids import COORDINATOR
from swarm.protocol.events import MessageReceived, MessagesReceived, SnapshotsReceived
from swarm.protocol.messages import MissionPhase, Snapshot
from swarm.protocol.mission_clock import WORDS_KEPT
from tests.support.builders import MISSION, entry, epoch, message, uav
from tests.support.lone_agent import ZERO_S, LoneAgent, notes, outcomes


def ready(*names: str) -> LoneAgent:
    agent = LoneAgent(*(uav(name) for name in names or ("u0",)))
    agent.fly_to(entry("near", east_m=10.0), entry("far", east_m=50.0, number=1))
    return agent


def mission_s(agent: LoneAgent) -> float | None:
    return agent.core.snapshot(agent.now_s).mission_s


def test_an_agent_that_heard_of_the_start_late_is_put_right_by_the_next_announcement() -> None:
    agent = ready()
    agent.hear(COORDINATOR, epoch("u0", mission_s=0.0), mission_s=3.0)  # 3 s under way
    assert mission_s(agent) == 0.0

    actions = agent.hear(COORDINATOR, epoch("u0", mission_s=4.0), mission_s=4.0)
    assert mission_s(agent) == 4.0
    assert "mission clock corrected" in notes(actions)

    done = [outcome.completed_s for outcome in outcomes(agent.arrive(13.0))]
    assert done == [13.0]
    assert agent.claim is not None
    assert (agent.claim.decided_s, agent.claim.completion_s) == (13.0, 53.0)


def test_what_an_announcement_has_waited_in_this_process_makes_it_no_earlier() -> None:
    agent = ready()
    start = agent.statement(COORDINATOR, epoch("u0", mission_s=0.0))
    agent.happen(MessageReceived(start, arrived_s=ZERO_S + 0.0), 0.75)
    assert mission_s(agent) == 0.75

    next_one = agent.statement(COORDINATOR, epoch("u0", mission_s=4.0))
    agent.happen(MessagesReceived((next_one,), arrived_s=ZERO_S + 4.5), 5.0)
    assert mission_s(agent) == 5.0
    last = agent.statement(COORDINATOR, epoch("u0", mission_s=6.0))
    agent.happen(MessagesReceived((last,), arrived_s=ZERO_S + 5.5), 6.0)
    assert mission_s(agent) == 6.5


def test_a_later_announcement_that_was_long_under_way_changes_nothing() -> None:
    agent = ready()
    agent.start_mission()
    actions = agent.hear(COORDINATOR, epoch("u0", mission_s=1.0), mission_s=5.0)
    assert mission_s(agent) == 5.0
    assert notes(actions) == []


def test_an_announcement_that_is_told_again_is_no_news_of_the_time() -> None:
    """Copies of an old word must not crowd out those that are near the truth."""
    agent = ready()
    agent.start_mission()
    old = agent.statement(COORDINATOR, epoch("u0", mission_s=1.0))
    agent.happen(MessageReceived(old), 1.0)
    for _ in range(2 * WORDS_KEPT):
        agent.happen(MessageReceived(old), 60.0)
    assert mission_s(agent) == 60.0


def test_an_epoch_from_the_future_is_got_over() -> None:
    agent = ready()
    agent.start_mission()
    agent.hear(COORDINATOR, epoch("u0", mission_s=1e15), mission_s=1.0)
    for at_s in range(2, 2 + WORDS_KEPT):
        agent.hear(COORDINATOR, epoch("u0", mission_s=float(at_s)), mission_s=float(at_s))
    assert mission_s(agent) == 1.0 + WORDS_KEPT


def test_a_restarted_coordinator_that_is_a_little_behind_does_not_put_the_fleet_back() -> None:
    agent = ready()
    agent.start_mission()
    for count in range(1, 2 * WORDS_KEPT):
        restated = epoch("u0", number=2, mission_s=10.0 * count - 0.4)
        agent.happen(
            MessageReceived(message(COORDINATOR, restated, count, incarnation=9)), 10.0 * count
        )
    assert mission_s(agent) == 10.0 * (2 * WORDS_KEPT - 1)


def test_another_flight_has_a_clock_of_its_own() -> None:
    """Its coordinator found nobody, and says that its flight runs before it tells which one."""
    agent = ready()
    agent.start_mission()
    agent.happen(
        MessageReceived(message(COORDINATOR, epoch("u0", mission_s=0.0), 1, incarnation=9)), 100.0
    )
    assert mission_s(agent) == 100.0

    other = replace(agent.brief, run=2)
    agent.happen(MessageReceived(message(COORDINATOR, other, 2, incarnation=9)), 101.0)
    assert mission_s(agent) == 1.0


def test_another_flight_that_is_being_prepared_has_no_time_yet() -> None:
    agent = ready()
    agent.start_mission()
    preparing = epoch("u0", phase=MissionPhase.PREPARING)
    agent.happen(MessageReceived(message(COORDINATOR, preparing, 1, incarnation=9)), 100.0)
    agent.happen(
        MessageReceived(message(COORDINATOR, replace(agent.brief, run=2), 2, incarnation=9))
    )
    assert mission_s(agent) is None


def test_the_coordinators_answer_puts_the_clock_right_and_no_other_does() -> None:
    agent = ready("u0", "u1")
    agent.hear(COORDINATOR, epoch("u0", mission_s=0.0), mission_s=3.0)
    agent.learn(mission_s=50.0)  # somebody else's
    assert mission_s(agent) == 0.0

    agent.happen(SnapshotsReceived((Snapshot(MISSION, COORDINATOR, 1, 3.0, ()),)))
    assert mission_s(agent) == 3.0
