"""The stages of a mission: each way of the table is taken, and nothing past is waited for."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from coordinator.core.leadership import LeadershipBid, LeadershipStage
from coordinator.core.publication import mission_config_of, task_entry_of
from coordinator.core.stages import TRANSITIONS, MissionStage
from swarm.model.ids import COORDINATOR
from swarm.protocol.events import LinkChanged, SnapshotsReceived, Stop, Tick
from swarm.protocol.messages import Body, Message, MissionPhase, Snapshot
from tests.support.builders import IDLE, MISSION, epoch, message, mission, task, uav
from tests.support.lone_coordinator import LAYERS, LoneCoordinator

FLOWN = mission([uav("u0")], [task("t0", 5.0)])
OWN_TERM, LATER_TERM = 100, 500
KNOWN_S = 40.0
AT_S = 120.0

Story = Callable[[LoneCoordinator], object]


def words_of_another(phase: MissionPhase) -> tuple[Message, ...]:
    """What a later coordinator has said of the same mission."""
    last = epoch("u0", number=5, mission_s=KNOWN_S, phase=phase)
    posted = task_entry_of(FLOWN.tasks[0], 0)
    bodies: tuple[Body, ...] = (mission_config_of(FLOWN, LAYERS, 1), posted, last)
    return tuple(message(COORDINATOR, body, n, LATER_TERM) for n, body in enumerate(bodies, 1))


def told_of(phase: MissionPhase) -> Snapshot:
    """The answer of an agent that has heard a coordinator which is gone."""
    claim = message("u0", IDLE, 8)
    return Snapshot(MISSION, "u0", 7, KNOWN_S, (*words_of_another(phase), claim))


def finds(*answers: Snapshot) -> Story:
    """Its first question is answered."""
    return lambda coordinator: coordinator.happen(SnapshotsReceived(answers))


def hears(*answers: Snapshot) -> Story:
    """The link is back, and so everyone is asked."""

    def happens(coordinator: LoneCoordinator) -> None:
        coordinator.answers = answers
        coordinator.happen(LinkChanged(True), AT_S)

    return happens


def everybody_leaves(coordinator: LoneCoordinator) -> None:
    coordinator.leave("u0")
    coordinator.run_until(coordinator.now_s + 10.0)


def is_stopped(coordinator: LoneCoordinator) -> None:
    coordinator.happen(Stop("by a person"))


def learning() -> LoneCoordinator:
    """Nobody has answered it yet."""
    return LoneCoordinator(FLOWN, answers=None, incarnation=OWN_TERM)


def briefed() -> LoneCoordinator:
    return LoneCoordinator(FLOWN, incarnation=OWN_TERM)


def running() -> LoneCoordinator:
    return briefed().started()


def ended() -> LoneCoordinator:
    coordinator = running()
    is_stopped(coordinator)
    return coordinator


RIVAL = Snapshot(MISSION, COORDINATOR, LATER_TERM, KNOWN_S, words_of_another(MissionPhase.RUNNING))
RUNS, IS_OVER = told_of(MissionPhase.RUNNING), told_of(MissionPhase.ENDED)
NOW_AT = {
    MissionStage.LEARNING: learning,
    MissionStage.BRIEFED: briefed,
    MissionStage.RUNNING: running,
    MissionStage.ENDED: ended,
}
STORIES: dict[tuple[MissionStage, MissionStage], Story] = {
    (MissionStage.LEARNING, MissionStage.BRIEFED): finds(),
    (MissionStage.LEARNING, MissionStage.RUNNING): finds(RUNS),
    (MissionStage.LEARNING, MissionStage.ENDED): finds(IS_OVER),
    (MissionStage.LEARNING, MissionStage.LEFT): is_stopped,
    (MissionStage.BRIEFED, MissionStage.RUNNING): lambda coordinator: coordinator.started(),
    (MissionStage.BRIEFED, MissionStage.ENDED): is_stopped,
    (MissionStage.BRIEFED, MissionStage.LEFT): hears(RIVAL),
    (MissionStage.RUNNING, MissionStage.RUNNING): hears(RUNS),
    (MissionStage.RUNNING, MissionStage.ENDED): hears(IS_OVER),
    (MissionStage.RUNNING, MissionStage.LEFT): hears(RIVAL),
    (MissionStage.ENDED, MissionStage.RUNNING): hears(RUNS),
    (MissionStage.ENDED, MissionStage.ENDED): hears(IS_OVER),
    (MissionStage.ENDED, MissionStage.DONE): everybody_leaves,
    (MissionStage.ENDED, MissionStage.LEFT): hears(RIVAL),
}


def test_the_stories_below_are_those_of_the_table() -> None:
    ways = {(before, after) for before, to in TRANSITIONS.items() for after in to}
    assert ways == STORIES.keys()


@pytest.mark.parametrize(("before", "after"), STORIES, ids=lambda stage: stage.name)
def test_each_way_of_the_table_is_taken(before: MissionStage, after: MissionStage) -> None:
    coordinator = NOW_AT[before]()
    assert coordinator.core.stage is before
    STORIES[before, after](coordinator)
    assert coordinator.core.stage is after


def test_a_mission_that_another_has_ended_is_not_ended_again_by_a_wait_of_before() -> None:
    """Or the process would wake up again and again for what is past, until all have left."""
    coordinator = running()
    coordinator.run_until(AT_S - 1.0)  # nobody takes what is left: a stalemate has begun
    stalemate_s = coordinator.core.next_deadline_s()
    assert stalemate_s is not None
    hears(IS_OVER)(coordinator)
    while coordinator.now_s < stalemate_s + 1.0:
        coordinator.happen(Tick(), coordinator.now_s + 0.5)
        next_s = coordinator.core.next_deadline_s()
        assert next_s is not None
        assert next_s > coordinator.now_s


@pytest.mark.parametrize(
    ("leads", "yields"),
    [
        ((LeadershipStage.STARTED, 1), (LeadershipStage.BRIEFED, 9)),
        ((LeadershipStage.STARTED, 9), (LeadershipStage.STARTED, 1)),
        ((LeadershipStage.BRIEFED, 1), (LeadershipStage.LEARNING, 9)),
        ((LeadershipStage.BRIEFED, 9), (LeadershipStage.BRIEFED, 1)),
        ((LeadershipStage.LEARNING, 1), (LeadershipStage.LEARNING, 9)),
    ],
)
def test_of_two_coordinators_exactly_one_yields(
    leads: tuple[LeadershipStage, int], yields: tuple[LeadershipStage, int]
) -> None:
    leader, other = LeadershipBid(*leads), LeadershipBid(*yields)

    assert other.yields_to(leader)
    assert not leader.yields_to(other)
