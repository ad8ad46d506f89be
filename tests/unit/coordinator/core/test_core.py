"""The coordinator of a mission that runs: pop-ups, the end, answers, withdrawals."""

from __future__ import annotations

import numpy as np
import pytest

from coordinator.core.lifecycle import CoordinatorAction, Withdraw
from coordinator.core.stages import StagedMission
from swarm.model.ids import COORDINATOR, OPERATOR
from swarm.model.layers import FlightLayers
from swarm.protocol.events import (
    Ask,
    LinkChanged,
    MessageReceived,
    PeerGone,
    PeerSeen,
    SnapshotsReceived,
    Tick,
)
from swarm.protocol.messages import (
    MissionConfig,
    MissionPhase,
    PlanEpoch,
    Snapshot,
    StartWithout,
    TaskEntry,
)
from swarm.protocol.timing import Timing, stretch_of
from tests.support.builders import (
    IDLE,
    MISSION,
    OUT,
    done,
    failed,
    held,
    message,
    mission,
    status,
    task,
    uav,
)
from tests.support.lone_coordinator import (
    START_TIMEOUT_S,
    TIMING,
    LoneCoordinator,
    notes,
    said,
)

U0, U1, U2 = uav("u0"), uav("u1"), uav("u2")
T0, T1 = task("t0", 5.0), task("t1", 9.0, service_s=2.0)
POPUP = task("popup", 7.0, appears_s=30.0)
TRIO = mission([U0, U1, U2], [T0, T1])


# -- while it runs ----------------------------------------------------------------------


def test_a_pop_up_is_posted_on_time_and_once() -> None:
    coordinator = LoneCoordinator(mission([U0], [POPUP, T0])).started()
    assert said(coordinator.run_until(129.9), TaskEntry) == []

    (entry,) = said(coordinator.run_until(130.1), TaskEntry)
    assert (entry.task, entry.number) == ("popup", 0)
    assert said(coordinator.run_until(200.0), TaskEntry) == []


def test_statuses_of_who_is_there_change_nothing_until_something_is_due(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    looks = list[float]()
    looks_at = StagedMission.advance

    def counted(self: StagedMission, now_s: float) -> list[CoordinatorAction]:
        looks.append(now_s)
        return looks_at(self, now_s)

    coordinator = LoneCoordinator(mission([U0, U1], [POPUP, T0])).started()
    monkeypatch.setattr(StagedMission, "advance", counted)
    how_it_is = MessageReceived(message("u0", status()))
    coordinator.happen(how_it_is, 110.0)
    assert looks == []
    coordinator.happen(MessageReceived(message("nobody knows it", status())), 110.1)
    assert looks == [110.1]

    coordinator.run_until(129.9)
    due_s = coordinator.core.next_deadline_s()
    assert due_s is not None
    (entry,) = said(coordinator.happen(how_it_is, due_s), TaskEntry)
    assert entry.task == "popup"


def test_a_pop_up_is_posted_at_its_deadline_whatever_the_rounding() -> None:
    """0.1 + 0.7 - 0.1 < 0.7 in floating point: the deadline would stay past for ever."""
    for begin_s in (0.1, 0.3, 1.1, 100.1, 1e6 + 0.1):
        for appears_s in (0.7, 0.1, 30.3, 1e-3):
            late = task("late", 7.0, appears_s=appears_s)
            coordinator = LoneCoordinator(mission([U0], [T0, late]), begin_s=begin_s).started()
            due_s = coordinator.core.next_deadline_s()
            assert due_s is not None
            assert len(said(coordinator.happen(Tick(), due_s), TaskEntry)) == 1


def test_it_ends_when_every_task_has_ended() -> None:
    coordinator = LoneCoordinator(mission([U0, U1], [T0, T1])).started()
    coordinator.hear("u0", done("t0"))
    assert coordinator.phase is MissionPhase.RUNNING

    coordinator.hear("u1", failed("t1"))
    assert coordinator.reason == "every task has ended"


def test_it_waits_for_pop_ups_to_come() -> None:
    coordinator = LoneCoordinator(mission([U0], [T0, POPUP])).started()
    coordinator.hear("u0", done("t0"))
    assert coordinator.phase is MissionPhase.RUNNING

    coordinator.run_until(140.0)
    coordinator.hear("u0", done("popup", 45.0))
    assert coordinator.reason == "every task has ended"


def test_it_ends_when_all_who_could_go_on_are_lost() -> None:
    coordinator = LoneCoordinator(mission([uav("u0"), uav("u1", t1=0.0)], [T0, T1])).started()
    coordinator.hear("u1", done("t0"))
    assert coordinator.phase is MissionPhase.RUNNING

    actions = coordinator.lose("u0", 110.0)
    assert next(n.text for n in notes(actions)) == "lost"
    coordinator.run_until(110.0 + 0.9 * TIMING.abandon_s)
    assert coordinator.phase is MissionPhase.RUNNING

    coordinator.run_until(111.0 + TIMING.abandon_s)
    assert coordinator.reason == "nobody is left who could go on"


def test_it_goes_on_with_those_who_were_only_cut_off() -> None:
    coordinator = LoneCoordinator(mission([U0], [T0])).started()
    coordinator.lose("u0", 110.0)
    coordinator.run_until(110.0 + 0.9 * TIMING.abandon_s)
    coordinator.see("u0")
    coordinator.hear("u0", held("t0", 0.0))
    coordinator.run_until(1000.0)

    assert coordinator.phase is MissionPhase.RUNNING


@pytest.mark.parametrize("is_lost", [True, False], ids=["lost", "climbing"])
def test_who_was_there_before_the_start_and_is_not_airborne_may_yet_do_what_is_left(
    is_lost: bool,
) -> None:
    coordinator = LoneCoordinator(mission([U0, uav("u1", t0=0.0)], [T0, T1]))
    coordinator.see("u0")
    if is_lost:
        coordinator.lose("u0", 105.0)
    coordinator.ready("u1")
    coordinator.run_until(100.0 + START_TIMEOUT_S)
    coordinator.answer_plan("u1")
    coordinator.hear("u1", done("t1"))
    ends_s = coordinator.now_s + TIMING.abandon_s
    coordinator.run_until(ends_s - 1.0)
    assert coordinator.phase is MissionPhase.RUNNING

    coordinator.run_until(ends_s + 1.0)
    assert coordinator.reason == "nobody is left who could go on"


def test_nobody_waits_for_who_was_never_there_nor_for_whom_the_operator_does_without() -> None:
    coordinator = LoneCoordinator(mission([U0, uav("u1", t0=0.0), U2], [T0, T1]))
    coordinator.see("u0")
    coordinator.hear(OPERATOR, StartWithout("u0", 1, "no battery"))
    coordinator.ready("u1")
    coordinator.run_until(100.0 + START_TIMEOUT_S)
    coordinator.answer_plan("u1")
    coordinator.hear("u1", done("t1"))

    assert coordinator.reason == "nobody is left who could go on"


def test_the_wait_for_the_lost_begins_anew_after_each_return() -> None:
    coordinator = LoneCoordinator(mission([U0], [T0])).started()
    coordinator.hear("u0", held("t0", 0.0))
    coordinator.lose("u0", 110.0)
    coordinator.run_until(150.0)
    coordinator.see("u0")
    coordinator.lose("u0", 160.0)
    coordinator.run_until(160.0 + 0.9 * TIMING.abandon_s)
    assert coordinator.phase is MissionPhase.RUNNING

    coordinator.run_until(161.0 + TIMING.abandon_s)
    assert coordinator.reason == "nobody is left who could go on"


def test_it_asks_the_others_for_the_last_words_of_the_lost() -> None:
    coordinator = LoneCoordinator(mission([U0, U1], [T0, T1])).started()
    asked = coordinator.lose("u0", 110.0).count(Ask())
    witness = Snapshot(MISSION, "u1", 1, 11.0, (message("u0", done("t0"), 9),))
    coordinator.happen(SnapshotsReceived((witness,)))
    coordinator.hear("u1", done("t1"))

    assert asked == 1
    assert coordinator.reason == "every task has ended"


def test_it_has_nothing_to_ask_about_who_leaves() -> None:
    coordinator = LoneCoordinator(mission([U0, U1], [T0, T1])).started()
    coordinator.hear("u0", OUT)

    assert Ask() not in coordinator.lose("u0", 110.0)


def test_it_ends_when_all_who_could_go_on_are_out() -> None:
    coordinator = LoneCoordinator(mission([U0], [T0, POPUP])).started()
    coordinator.hear("u0", OUT)

    assert coordinator.reason == "nobody is left who could go on"


def test_a_token_that_blinks_ends_nothing() -> None:
    coordinator = LoneCoordinator(mission([U0], [T0])).started()
    coordinator.happen(PeerGone("u0"))
    coordinator.happen(PeerSeen("u0"))
    coordinator.run_until(120.0)

    assert coordinator.phase is MissionPhase.RUNNING


def test_a_cut_of_its_own_link_ends_nothing() -> None:
    coordinator = LoneCoordinator(mission([U0], [T0])).started()
    coordinator.hear("u0", held("t0", 0.0))
    coordinator.happen(LinkChanged(False))
    coordinator.happen(PeerGone("u0"))
    coordinator.run_until(1000.0)

    assert coordinator.phase is MissionPhase.RUNNING


def test_a_task_that_every_uav_refuses_ends_the_mission_in_the_end() -> None:
    coordinator = LoneCoordinator(mission([U0, U1], [T0])).started()
    coordinator.run_until(100.0 + 0.9 * TIMING.stalemate_s)
    assert coordinator.phase is MissionPhase.RUNNING

    coordinator.run_until(101.0 + TIMING.stalemate_s)
    assert coordinator.reason == "nobody takes what is left"


def test_what_nobody_takes_is_left_to_one_that_is_lost_for_as_long_as_to_come_back() -> None:
    coordinator = LoneCoordinator(mission([U0, U1], [T0])).started()
    coordinator.hear("u1", held("t0", 0.0))
    coordinator.lose("u1", 110.0)
    ends_s = coordinator.now_s + TIMING.abandon_s
    coordinator.run_until(ends_s - 1.0)
    assert coordinator.phase is MissionPhase.RUNNING

    coordinator.run_until(ends_s + 1.0)
    assert coordinator.reason == "nobody takes what is left"


def test_as_long_as_one_is_at_work_there_is_no_stalemate() -> None:
    coordinator = LoneCoordinator(mission([U0, U1], [T0])).started()
    coordinator.run_until(110.0)
    coordinator.hear("u1", held("t0", 0.0))
    coordinator.run_until(900.0)
    assert coordinator.phase is MissionPhase.RUNNING

    coordinator.hear("u1", IDLE)
    coordinator.run_until(899.0 + TIMING.stalemate_s)
    assert coordinator.phase is MissionPhase.RUNNING


def test_it_repeats_the_epoch_with_the_time_of_now_and_the_rest_in_turns() -> None:
    tasks = [task(f"t{n}", float(n)) for n in range(20)]
    coordinator = LoneCoordinator(
        mission([U0], tasks), timing=Timing(announce_s=2.0, silence_s=1e6)
    ).started()
    actions = coordinator.run_until(100.0 + 6.0)

    told_s = [e.mission_s for e in said(actions, PlanEpoch)]
    assert np.diff(told_s) == pytest.approx([2.0, 2.0])
    repeated = [e.task for e in said(actions, TaskEntry)]
    assert len(set(repeated)) == 20
    assert len(repeated) + len(said(actions, MissionConfig)) == 24


@pytest.mark.parametrize("n_uav", [10, 100])
def test_uavs_of_a_large_fleet_are_given_up_only_after_a_longer_silence(n_uav: int) -> None:
    timing = Timing()
    uavs = [uav(f"u{number}") for number in range(n_uav)]
    silence_s = stretch_of(n_uav) * timing.silence_s
    coordinator = LoneCoordinator(mission(uavs, [T0]), timing=timing)
    coordinator.answer_plan(*coordinator.uavs)
    coordinator.ready(*coordinator.uavs)
    heard_s = coordinator.now_s

    def lost(until_s: float) -> list[str]:
        return [note.text for note in notes(coordinator.run_until(until_s)) if note.text == "lost"]

    assert lost(heard_s + silence_s - 1.0) == []
    assert lost(heard_s + silence_s + 1.0) == ["lost"] * n_uav


# -- answering --------------------------------------------------------------------------


def test_it_answers_with_its_own_registers_and_those_of_the_absent() -> None:
    coordinator = LoneCoordinator(mission([U0, U1], [T0, T1])).started()

    def answered_for() -> set[str]:
        return {m.writer for m in coordinator.core.snapshot(coordinator.now_s).messages}

    assert answered_for() == {COORDINATOR}
    coordinator.lose("u1", 110.0)
    assert answered_for() == {COORDINATOR, "u1"}
    coordinator.see("u1")
    assert answered_for() == {COORDINATOR, "u1"}
    coordinator.hear("u1", IDLE)
    assert answered_for() == {COORDINATOR}
    whole = coordinator.core.whole(coordinator.now_s)
    assert {m.writer for m in whole.messages} == {COORDINATOR, "u0", "u1"}


def test_its_answer_tells_the_mission_time() -> None:
    coordinator = LoneCoordinator(mission([U0], [T0]))
    assert coordinator.core.snapshot(100.0).mission_s is None

    coordinator.started()
    assert coordinator.core.snapshot(112.5).mission_s == pytest.approx(12.5, abs=1e-3)


def test_what_it_learns_counts_like_what_it_hears() -> None:
    coordinator = LoneCoordinator(mission([U0], [T0])).started()
    outcome = message("u0", done("t0"), 99)
    coordinator.happen(SnapshotsReceived((Snapshot(MISSION, "u0", 1, None, (outcome,)),)))

    assert coordinator.reason == "every task has ended"
    assert coordinator.happen(MessageReceived(outcome)) == []


@pytest.mark.parametrize(("lowest_m", "spacing_m"), [(0.0, 3.0), (-1.0, 3.0), (10.0, -1.0)])
def test_layers_below_the_ground_are_refused(lowest_m: float, spacing_m: float) -> None:
    with pytest.raises(ValueError, match="layers"):
        FlightLayers(lowest_m, spacing_m)


# -- withdrawals ------------------------------------------------------------------------


def test_a_task_that_is_withdrawn_is_so_on_the_board_once_and_for_all() -> None:
    coordinator = LoneCoordinator(TRIO)
    coordinator.happen(Withdraw("t0"))
    coordinator.happen(Withdraw("t0"))
    coordinator.happen(Withdraw("unknown"))

    posted = [entry for entry in said(coordinator.log, TaskEntry) if entry.withdrawn]
    assert [entry.task for entry in posted] == ["t0"]
    assert coordinator.core.replica.board["t0"].withdrawn
