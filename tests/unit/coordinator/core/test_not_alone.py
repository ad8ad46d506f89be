"""The coordinator finds a mission that runs already, was away itself, or hears another one."""

from __future__ import annotations

from dataclasses import replace

import pytest

from coordinator.core.publication import task_entry_of
from swarm.model.ids import COORDINATOR
from swarm.protocol.events import (
    Ask,
    LinkChanged,
    MessageReceived,
    PeerGone,
    PeerSeen,
    Publish,
    SnapshotsReceived,
    Tick,
)
from swarm.protocol.messages import MissionConfig, MissionPhase, PlanEpoch
from tests.support.builders import IDLE, OUT, done, epoch, held, message, mission
from tests.support.earlier_life import (
    EXTRA,
    FLOWN,
    OLD_LIFE,
    RUN,
    T0,
    T1,
    U0,
    U1,
    answer,
    registers,
    resumed,
    running,
    twin,
)
from tests.support.lone_coordinator import (
    TIMING,
    LoneCoordinator,
    finishes,
    notes,
    plans_wanted,
    said,
)

# -- finding a running mission late -------------------------------------------------------


def test_a_mission_that_it_hears_of_before_it_started_one_is_adopted() -> None:
    """A mesh may link up after the first question."""
    withdrawn = replace(task_entry_of(T1, 1), withdrawn=True)
    coordinator = LoneCoordinator(FLOWN, incarnation=600)
    assert len(plans_wanted(coordinator.log)) == 1
    coordinator.answers = [answer(registers(running(19.0), withdrawn), 20.0)]
    coordinator.see("u0")

    assert coordinator.core.snapshot(coordinator.now_s).mission_s == pytest.approx(20.0, abs=1e-3)
    assert said(coordinator.log, MissionConfig)[-1].run == RUN
    assert coordinator.core.replica.board["t1"].withdrawn
    coordinator.answer_plan("u0", "u1")
    assert [e.number for e in said(coordinator.log, PlanEpoch)] == [3]


def test_a_fleet_at_work_is_a_reason_to_ask_and_never_to_start() -> None:
    coordinator = LoneCoordinator(FLOWN, incarnation=600)
    coordinator.answer_plan("u0", "u1")
    coordinator.see("u0", "u1")
    assert Ask() in coordinator.hear("u0", held("t0", 0.0), 101.0)
    coordinator.hear("u0", done("t0"), 102.0)
    coordinator.hear("u0", IDLE)
    coordinator.hear("u1", IDLE)
    coordinator.run_until(500.0)
    assert said(coordinator.log, PlanEpoch) == []

    coordinator.answers = [answer(registers(running(19.0)), 420.0)]
    coordinator.hear("u0", IDLE, 501.0)
    assert coordinator.phase is MissionPhase.RUNNING


def at_work(coordinator: LoneCoordinator) -> LoneCoordinator:
    """It hears a fleet at work, while every question of its own is lost."""
    coordinator.answer_plan("u0", "u1")
    coordinator.see("u0", "u1")
    coordinator.hear("u0", held("t0", 0.0), 101.0)
    coordinator.hear("u0", done("t0"), 102.0)
    return coordinator


def test_who_never_got_an_answer_leaves_when_the_fleet_has_been_gone_for_long() -> None:
    coordinator = at_work(LoneCoordinator(FLOWN, incarnation=600))
    coordinator.lose("u0", 200.0)
    coordinator.run_until(1000.0)
    assert finishes(coordinator.log) == []  # one is there, and may tell
    coordinator.lose("u1", 1000.0)
    gone_s = coordinator.now_s

    coordinator.run_until(gone_s + 0.9 * TIMING.abandon_s)
    assert finishes(coordinator.log) == []
    coordinator.run_until(gone_s + TIMING.abandon_s)

    assert finishes(coordinator.log) == [1]
    assert coordinator.core.next_deadline_s() is None
    # Who was only cut off flies on: nothing was said of an end.
    assert said(coordinator.log, PlanEpoch) == []
    assert notes(coordinator.log)[-1].text == "leaves the mission to others"


def test_who_comes_back_in_time_is_waited_for_and_asked() -> None:
    coordinator = at_work(LoneCoordinator(FLOWN, incarnation=600))
    coordinator.lose("u0", 200.0)
    coordinator.lose("u1", coordinator.now_s)
    coordinator.run_until(coordinator.now_s + 0.9 * TIMING.abandon_s)

    coordinator.answers = [answer(registers(running(19.0)), 20.0)]
    coordinator.see("u0")
    assert coordinator.phase is MissionPhase.RUNNING


def test_who_has_no_link_itself_takes_nobody_for_gone() -> None:
    coordinator = at_work(LoneCoordinator(FLOWN, incarnation=600))
    coordinator.happen(LinkChanged(False), 200.0)
    coordinator.happen(PeerGone("u0"))
    coordinator.happen(PeerGone("u1"))

    coordinator.run_until(200.0 + 10.0 * TIMING.abandon_s)

    assert finishes(coordinator.log) == []


def test_an_ended_mission_of_before_does_not_end_the_one_that_begins() -> None:
    coordinator = LoneCoordinator(FLOWN, incarnation=1)
    over = epoch("u0", phase=MissionPhase.ENDED, number=4, mission_s=50.0)
    coordinator.answers = [replace(answer(registers(over)), messages=tuple(registers(over)))]
    coordinator.see("u0")

    assert said(coordinator.log, PlanEpoch) == []
    restated = [a.message for a in coordinator.log if isinstance(a, Publish)][-3:]
    assert min(m.stamp.incarnation for m in restated) > OLD_LIFE
    assert all(m.body.run != RUN for m in restated if isinstance(m.body, MissionConfig))


def test_a_mission_that_has_just_ended_is_not_begun_anew_for_those_who_come_home() -> None:
    """It was begun anew within a moment, before any transport was up."""
    coordinator = LoneCoordinator(FLOWN, incarnation=600)
    over = epoch("u0", "u1", phase=MissionPhase.ENDED, number=4, mission_s=50.0)
    words = [*registers(over), message("u0", OUT, 9), message("u0", done("t0"), 8)]
    coordinator.answers = [replace(answer((), 51.0), messages=tuple(words))]
    coordinator.see("u0")

    assert coordinator.phase is MissionPhase.ENDED
    assert said(coordinator.log, MissionConfig)[-1].run == RUN
    coordinator.answers = ()
    coordinator.leave("u0")
    coordinator.run_until(coordinator.now_s + 2.0 * TIMING.linger_s)
    assert finishes(coordinator.log) == [1]  # t1 was left undone


def test_a_mission_that_has_ended_for_some_is_asked_about_while_others_are_at_work() -> None:
    coordinator = LoneCoordinator(FLOWN, incarnation=600)
    over = epoch("u0", "u1", phase=MissionPhase.ENDED, number=4, mission_s=50.0)
    words = [*registers(over), message("u0", OUT, 9), message("u0", done("t0"), 8)]
    coordinator.hear("u1", held("t1", 3.0))
    coordinator.happen(PeerSeen("u1"))
    coordinator.answers = [replace(answer((), 51.0), messages=tuple(words))]
    coordinator.see("u0")
    assert coordinator.phase is None

    coordinator.hear("u1", OUT, coordinator.now_s + 1.0)
    coordinator.run_until(coordinator.now_s + 2.0 * TIMING.ask_gap_s)
    assert coordinator.phase is MissionPhase.ENDED


# -- held up, cut off ---------------------------------------------------------------------


def test_after_a_pause_of_its_own_it_asks_before_it_decides() -> None:
    short = replace(TIMING, announce_s=2.0, silence_s=5.0)
    coordinator = LoneCoordinator(mission([U0], [T0]), timing=short).started()
    coordinator.answers = None
    actions = coordinator.happen(Tick(), 160.0)
    assert Ask() in actions
    assert [n.text for n in notes(actions)] == ["was held up"]
    coordinator.hear("u0", done("t0"), 160.5)
    assert coordinator.phase is MissionPhase.RUNNING

    coordinator.answers = ()
    coordinator.happen(SnapshotsReceived(()))
    coordinator.run_until(160.0 + short.relink_grace_s)
    assert coordinator.reason == "every task has ended"


def test_after_a_pause_another_coordinator_may_be_there() -> None:
    short = replace(TIMING, announce_s=2.0, silence_s=5.0)
    coordinator = LoneCoordinator(mission([U0], [T0]), timing=short).started()
    newer = message(COORDINATOR, running(), 1, OLD_LIFE)
    coordinator.answers = [twin(OLD_LIFE, newer, mission_s=60.0)]
    actions = coordinator.happen(MessageReceived(newer), 160.0)

    assert said(actions, PlanEpoch) == []
    assert finishes(actions) == [1]


def test_when_its_link_is_back_it_asks_before_it_decides() -> None:
    coordinator = LoneCoordinator(mission([U0], [T0])).started()
    coordinator.answers = None
    coordinator.happen(LinkChanged(False), 110.0)
    assert Ask() in coordinator.happen(LinkChanged(True), 115.0)
    coordinator.hear("u0", done("t0"), 115.5)
    assert coordinator.phase is MissionPhase.RUNNING

    coordinator.answers = ()
    coordinator.happen(SnapshotsReceived(()))
    coordinator.run_until(115.0 + TIMING.relink_grace_s)
    assert coordinator.reason == "every task has ended"


def test_it_asks_a_uav_that_is_back_for_what_it_knows() -> None:
    coordinator = LoneCoordinator(mission([U0, U1], [T0])).started()
    coordinator.lose("u0", 110.0)

    assert Ask() in coordinator.happen(PeerSeen("u0"), 120.0)


# -- another coordinator ------------------------------------------------------------------


@pytest.mark.parametrize("incarnation", [1, 900])
@pytest.mark.parametrize("started", [True, False])
def test_beside_a_living_coordinator_it_stands_down(incarnation: int, started: bool) -> None:
    more = [running()] if started else []
    known = registers(*more, life=incarnation)
    other = twin(incarnation, *known, mission_s=7.0 if started else None)
    coordinator = LoneCoordinator(FLOWN, answers=[other], incarnation=600)

    assert finishes(coordinator.log) == [1]
    assert coordinator.core.stood_down == "a coordinator is already there"
    assert said(coordinator.log, MissionConfig) == []
    assert coordinator.core.next_deadline_s() is None
    assert coordinator.happen(Tick(), 200.0) == []


def test_of_two_that_begin_together_the_one_that_came_first_stays() -> None:
    first = LoneCoordinator(FLOWN, answers=[twin(601)], incarnation=600)
    second = LoneCoordinator(FLOWN, answers=[twin(600)], incarnation=601)

    assert (first.core.stood_down, finishes(second.log)) == (None, [1])


def test_running_it_falls_silent_at_a_newer_ones_words_and_stands_down_if_that_lives() -> None:
    short = replace(TIMING, announce_s=2.0, silence_s=1e6)
    coordinator = LoneCoordinator(mission([U0], [T0]), timing=short).started()
    newer = message(COORDINATOR, running(), 1, OLD_LIFE)
    coordinator.answers = None
    coordinator.happen(MessageReceived(newer), 101.0)
    assert said(coordinator.run_until(110.0), PlanEpoch) == []

    actions = coordinator.happen(SnapshotsReceived((twin(OLD_LIFE, newer, mission_s=9.0),)))
    assert finishes(actions) == [1]
    assert coordinator.core.stood_down == "another coordinator has taken over"


def test_a_newer_one_that_nobody_knows_and_that_does_not_answer_deposes_nobody() -> None:
    coordinator = LoneCoordinator(mission([U0], [T0])).started()
    newer = message(COORDINATOR, running(), 1, OLD_LIFE)
    coordinator.happen(MessageReceived(newer), 110.0)

    assert coordinator.core.stood_down is None
    assert coordinator.epoch is not None
    assert coordinator.epoch.sequence == ("u0",)
    known = coordinator.core.replica.known(newer)
    assert known is not None
    assert known.stamp > newer.stamp, "whoever heard the other hears this one too"


def test_of_two_with_one_incarnation_one_comes_out_higher() -> None:
    """As when two machines' clocks are behind and both have outdone the same stamp."""
    coordinator = LoneCoordinator(mission([U0], [T0]), incarnation=600).started()
    theirs = message(COORDINATOR, running(), 90, 600)
    coordinator.answers = [twin(600, theirs, mission_s=9.0)]
    actions = coordinator.happen(MessageReceived(theirs), 110.0)

    stamps = [a.message.stamp for a in actions if isinstance(a, Publish)]
    assert min(stamps) > theirs.stamp


def test_running_it_outlasts_an_older_one_and_makes_itself_heard() -> None:
    coordinator = LoneCoordinator(mission([U0], [T0]), incarnation=600).started()
    older = message(COORDINATOR, running(), 90, OLD_LIFE)
    coordinator.answers = [twin(OLD_LIFE, older, mission_s=9.0)]
    actions = coordinator.happen(MessageReceived(older), 110.0)

    assert coordinator.core.stood_down is None
    assert said(actions, PlanEpoch) != []
    assert coordinator.epoch is not None
    assert coordinator.epoch.sequence == ("u0",)


def test_what_an_older_one_posted_and_withdrew_while_cut_off_holds() -> None:
    coordinator = LoneCoordinator(FLOWN, incarnation=600).started()
    posted = message(COORDINATOR, EXTRA, 80, OLD_LIFE)
    withdrawn = message(COORDINATOR, replace(task_entry_of(T1, 1), withdrawn=True), 81, OLD_LIFE)
    coordinator.answers = [twin(OLD_LIFE, posted, withdrawn, mission_s=9.0)]
    coordinator.happen(LinkChanged(True), 110.0)

    board = coordinator.core.replica.board
    assert board["t1"].withdrawn
    assert "extra" in board
    assert coordinator.core.replica.known(posted) != posted, "said in its own name"


def test_a_running_mission_is_kept_against_one_that_only_begins() -> None:
    """It was started by mistake, where it could not hear that a mission runs."""
    coordinator = LoneCoordinator(mission([U0], [T0]), incarnation=600).started()
    run = said(coordinator.log, MissionConfig)[-1].run
    beginners = registers(flown=coordinator.mission, life=900)
    coordinator.answers = [twin(900, *beginners)]
    actions = coordinator.happen(MessageReceived(beginners[0]), 110.0)

    assert coordinator.core.stood_down is None
    assert {b.run for b in said(actions, MissionConfig)} == {run}
    stamps = [a.message.stamp for a in actions if isinstance(a, Publish)]
    assert min(stamps) > max(m.stamp for m in beginners)


def test_what_a_later_one_said_that_is_gone_goes_on() -> None:
    """Cut off, it missed that another one took over, planned anew, and died."""
    coordinator = LoneCoordinator(FLOWN, incarnation=100).started()
    later = registers(running(30.0, number=5), EXTRA)
    coordinator.answers = [answer(later, 40.0)]
    coordinator.happen(LinkChanged(True), 140.0)

    assert coordinator.core.stood_down is None
    assert coordinator.epoch is not None
    assert (coordinator.epoch.number, coordinator.epoch.sequence) == (5, ("u1", "u0"))
    assert "extra" in coordinator.core.replica.board


def test_late_words_of_an_earlier_life_make_it_ask_and_nothing_more() -> None:
    coordinator = resumed(20.0)
    coordinator.answers = ()
    actions = coordinator.happen(
        MessageReceived(message(COORDINATOR, running(18.0), 77, OLD_LIFE)), 101.0
    )

    assert actions == [Ask()]
    assert coordinator.core.stood_down is None
