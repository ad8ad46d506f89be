"""The coordinator that starts anew: it learns before it says anything."""

from __future__ import annotations

from dataclasses import replace

import pytest

from coordinator.core.publication import mission_config_of, task_entry_of
from swarm.model.ids import COORDINATOR
from swarm.protocol.events import (
    Ask,
    Finish,
    LinkChanged,
    PeerSeen,
    Publish,
    Save,
    SnapshotsReceived,
    Stop,
)
from swarm.protocol.messages import MissionConfig, MissionPhase, PlanEpoch, Snapshot, TaskEntry
from swarm.protocol.timing import Timing
from tests.support.builders import IDLE, OUT, done, epoch, held, message, mission, order, task
from tests.support.earlier_life import (
    EXTRA,
    FLOWN,
    OLD_LIFE,
    POPUP,
    RUN,
    T0,
    T1,
    U0,
    U1,
    answer,
    memory,
    registers,
    resumed,
    running,
    twin,
)
from tests.support.lone_coordinator import (
    LAYERS,
    TIMING,
    LoneCoordinator,
    finishes,
    notes,
    plans_wanted,
    said,
)

# -- learning ---------------------------------------------------------------------------


def test_it_asks_first_and_says_nothing_before_the_answer() -> None:
    coordinator = LoneCoordinator(FLOWN, answers=None)
    assert coordinator.log == [Ask()]
    coordinator.happen(PeerSeen("u0"))
    coordinator.run_until(200.0)
    assert said(coordinator.log, MissionConfig) == []
    assert coordinator.core.snapshot(200.0).messages == ()

    coordinator.happen(SnapshotsReceived(()))
    assert len(said(coordinator.log, MissionConfig)) == 1


def test_without_a_link_an_answer_says_nothing() -> None:
    coordinator = LoneCoordinator(FLOWN, answers=None)
    coordinator.happen(LinkChanged(False))
    coordinator.happen(SnapshotsReceived(()))
    assert said(coordinator.log, MissionConfig) == []

    coordinator.answers = [answer(registers(running()), 5.0)]
    coordinator.happen(LinkChanged(True), 101.0)
    (brief,) = said(coordinator.log, MissionConfig)
    assert brief.run == RUN


def test_told_to_stop_before_it_knows_anything_it_just_ends() -> None:
    coordinator = LoneCoordinator(FLOWN, answers=None)

    assert Finish(1) in coordinator.happen(Stop("told"))
    assert said(coordinator.log, PlanEpoch) == []


# -- resuming from the agents -----------------------------------------------------------


def test_it_adopts_brief_board_epoch_and_time_of_the_running_mission() -> None:
    coordinator = resumed(20.0, EXTRA)
    (brief,) = said(coordinator.log, MissionConfig)
    (adopted,) = said(coordinator.log, PlanEpoch)

    assert brief.run == RUN
    assert (adopted.number, adopted.phase, adopted.sequence) == (
        3,
        MissionPhase.RUNNING,
        ("u1", "u0"),
    )
    assert adopted.mission_s == 20.0
    assert coordinator.core.snapshot(105.0).mission_s == 25.0
    assert {entry.task for entry in said(coordinator.log, TaskEntry)} == {"t0", "t1", "extra"}
    assert plans_wanted(coordinator.log) == []


def test_what_it_restates_beats_the_earlier_life_even_if_its_clock_is_behind() -> None:
    known = registers(running(19.0))
    for incarnation in (1, OLD_LIFE, 600):
        coordinator = LoneCoordinator(FLOWN, answers=[answer(known, 20.0)], incarnation=incarnation)
        published = [a.message for a in coordinator.log if isinstance(a, Publish)]
        for before in known:
            now = coordinator.core.replica.known(before)
            assert now is not None
            assert now in published
            assert now.stamp > before.stamp
        assert isinstance(published[0].body, PlanEpoch), "by it others know who is in charge"


def test_pop_ups_that_came_due_meanwhile_are_posted_at_once_and_the_rest_on_time() -> None:
    late = task("late", 1.0, appears_s=90.0)
    coordinator = resumed(60.0, flown=mission([U0, U1], [T0, T1, POPUP, late]))
    assert "popup" in {entry.task for entry in said(coordinator.log, TaskEntry)}
    assert "late" not in coordinator.core.replica.board

    coordinator.run_until(100.0 + 30.0)
    assert "late" in coordinator.core.replica.board


def test_what_was_withdrawn_stays_withdrawn() -> None:
    coordinator = resumed(20.0, replace(task_entry_of(T1, 1), withdrawn=True))

    assert coordinator.core.replica.board["t1"].withdrawn


def test_the_mission_goes_on_to_its_end() -> None:
    coordinator = resumed(40.0)
    coordinator.see("u0", "u1")
    for name in ("t0", "t1", "popup"):
        coordinator.hear("u0", done(name))
    assert coordinator.reason == "every task has ended"
    assert coordinator.epoch is not None
    assert coordinator.epoch.number == 4

    coordinator.answers = ()
    coordinator.leave("u0")
    coordinator.leave("u1")
    coordinator.run_until(300.0)
    assert finishes(coordinator.log) == [0]


def test_nobody_is_missed_before_they_had_the_time_to_show_themselves() -> None:
    out = replace(
        answer(registers(running()), 5.0), messages=(*registers(running()), message("u0", OUT))
    )
    coordinator = LoneCoordinator(FLOWN, answers=[out], incarnation=600)
    coordinator.run_until(100.0 + 0.9 * TIMING.relink_grace_s)
    assert coordinator.phase is MissionPhase.RUNNING

    coordinator.run_until(100.0 + 1.1 * TIMING.relink_grace_s)
    assert coordinator.reason == "nobody is left who could go on"


def test_who_is_seen_but_was_never_heard_has_the_time_to_get_ready() -> None:
    out = replace(
        answer(registers(running()), 5.0), messages=(*registers(running()), message("u0", OUT))
    )
    coordinator = LoneCoordinator(FLOWN, answers=[out], incarnation=600)
    coordinator.run_until(100.0 + 0.5 * TIMING.relink_grace_s)
    coordinator.see("u1")
    seen_s = coordinator.now_s
    coordinator.run_until(100.0 + 0.9 * TIMING.abandon_s)
    assert coordinator.phase is MissionPhase.RUNNING

    coordinator.run_until(seen_s + 1.1 * TIMING.abandon_s)
    assert coordinator.reason == "nobody is left who could go on"


def test_where_nothing_is_known_of_any_uav_it_waits_for_them_as_for_the_lost() -> None:
    """It may be cut off from a whole fleet."""
    alone = replace(answer(registers(running()), 5.0), messages=tuple(registers(running())))
    coordinator = LoneCoordinator(FLOWN, answers=[alone], incarnation=600)
    coordinator.run_until(100.0 + 0.9 * TIMING.abandon_s)
    assert coordinator.phase is MissionPhase.RUNNING

    coordinator.run_until(100.0 + 1.1 * TIMING.abandon_s)
    assert coordinator.reason == "nobody is left who could go on"


def test_memory_grows_older_while_it_waits_for_answers() -> None:
    coordinator = LoneCoordinator(
        FLOWN, answers=None, incarnation=600, memory=memory(running(10.0), mission_s=25.0)
    )
    assert coordinator.core.memory(101.0).mission_s == 26.0

    coordinator.happen(SnapshotsReceived(()), 103.0)
    assert coordinator.core.snapshot(103.0).mission_s == 28.0


def test_one_that_stands_down_before_it_took_charge_keeps_what_it_remembered() -> None:
    kept = memory(running(10.0), mission_s=25.0)
    coordinator = LoneCoordinator(
        FLOWN, answers=[twin(1, mission_s=3.0)], incarnation=600, memory=kept
    )

    assert coordinator.core.stood_down is not None
    assert coordinator.core.memory(100.0) == kept


def test_one_odd_clock_among_many_does_not_set_the_time() -> None:
    known = registers(running(19.0))
    times_s = {"u0": 20.5, "u1": 20.0, "u2": 9e9}
    answers = [answer(known, at_s, name) for name, at_s in times_s.items()]
    coordinator = LoneCoordinator(FLOWN, answers=answers, incarnation=600)

    assert coordinator.core.snapshot(100.0).mission_s == 20.5


def test_a_scenario_file_that_was_edited_since_is_named_and_yields() -> None:
    moved = mission([U0, U1], [task("t0", 99.0), T1, POPUP, task("new", 2.0)])
    coordinator = resumed(20.0, EXTRA, flown=moved)
    told = [n.fields for n in notes(coordinator.log) if "scenario file" in n.text]

    assert told == [{"differs_in": "task t0"}]
    assert coordinator.core.replica.board["t0"].position_enu_m == T0.position_enu_m
    assert "new" in coordinator.core.replica.board


def test_of_an_unchanged_scenario_file_nothing_is_said() -> None:
    withdrawn = replace(task_entry_of(T1, 1), withdrawn=True)

    assert [n.text for n in notes(resumed(20.0, EXTRA, withdrawn).log)] == ["resumes the mission"]


def test_an_ending_that_was_cut_short_is_seen_through() -> None:
    over = epoch("u0", phase=MissionPhase.ENDED, number=4, mission_s=50.0, reason="told")
    known = [*registers(over), message("u0", done("t0"), 3)]
    coordinator = LoneCoordinator(FLOWN, answers=[answer(known, 51.0)], incarnation=600)
    coordinator.see("u0")
    coordinator.run_until(150.0)
    assert [e.phase for e in said(coordinator.log, PlanEpoch)] == [MissionPhase.ENDED]
    assert finishes(coordinator.log) == []

    coordinator.answers = ()
    coordinator.leave("u0")
    coordinator.run_until(200.0)
    assert finishes(coordinator.log) == [1]


def test_a_beginning_that_was_cut_short_goes_on_with_the_same_run() -> None:
    ready = answer(registers())
    ready = replace(ready, messages=(*registers(), message("u0", IDLE, 8)))
    coordinator = LoneCoordinator(FLOWN, answers=[ready], incarnation=600)
    (brief,) = said(coordinator.log, MissionConfig)
    (wanted,) = plans_wanted(coordinator.log)
    assert brief.run == RUN
    assert [t.id for t in wanted.mission.tasks] == ["t0", "t1"]

    coordinator.started()
    assert coordinator.phase is MissionPhase.RUNNING


def test_a_beginning_that_the_operator_has_spoken_about_is_gone_on_with_though_found_late() -> None:
    """Nobody answers the first question of a life that remembers nothing."""
    added = order("added", run=RUN)
    coordinator = LoneCoordinator(FLOWN, incarnation=600)
    assert said(coordinator.log, MissionConfig)[0].run != RUN
    ready = answer(registers())
    ready = replace(ready, messages=(*registers(), message("operator", added, 1)))

    coordinator.answers = [ready]
    coordinator.see("u0")

    assert said(coordinator.log, MissionConfig)[-1].run == RUN
    assert "added" in coordinator.core.replica.board
    coordinator.see("u1")
    for name in ("u0", "u1"):
        coordinator.hear(name, IDLE)
    assert "added" in [t.id for t in plans_wanted(coordinator.log)[-1].mission.tasks]


def test_one_that_nobody_has_said_anything_about_is_begun_anew() -> None:
    coordinator = LoneCoordinator(FLOWN, incarnation=600)
    (own,) = said(coordinator.log, MissionConfig)
    ready = replace(answer(registers()), messages=tuple(registers()))

    coordinator.answers = [ready]
    coordinator.see("u0")

    assert said(coordinator.log, MissionConfig)[-1].run == own.run


# -- its own memory ---------------------------------------------------------------------


def remembering(
    kept: Snapshot, age_s: float, answers: list[Snapshot] | None = None
) -> LoneCoordinator:
    return LoneCoordinator(
        FLOWN, answers=answers or [], incarnation=600, memory=kept, memory_age_s=age_s
    )


def test_a_young_memory_of_a_running_mission_is_resumed_though_nobody_answers() -> None:
    coordinator = remembering(memory(running(10.0), EXTRA, mission_s=25.0), 15.0)

    assert coordinator.core.snapshot(100.0).mission_s == 25.0
    assert "extra" in coordinator.core.replica.board
    assert plans_wanted(coordinator.log) == []


def test_when_nobody_knows_the_time_it_is_that_of_the_last_epoch() -> None:
    coordinator = remembering(memory(running(10.0)), 15.0)

    assert coordinator.core.snapshot(100.0).mission_s == 10.0


def test_the_agents_time_goes_before_the_own() -> None:
    kept = memory(running(10.0), mission_s=90.0)
    coordinator = remembering(kept, 15.0, [answer(registers(running(19.0)), 20.0)])

    assert coordinator.core.snapshot(100.0).mission_s == 20.0


def test_memory_adds_to_what_the_agents_know_of_the_same_flight_however_old() -> None:
    kept = memory(running(10.0), EXTRA, mission_s=5000.0)
    coordinator = remembering(kept, 1e5, [answer(registers(running(19.0)), 20.0)])

    assert "extra" in coordinator.core.replica.board


@pytest.mark.parametrize(
    ("kept", "age_s"),
    [
        (memory(epoch("u0", phase=MissionPhase.ENDED), mission_s=60.0), 1.0),
        (memory(running(10.0), mission_s=900.0), 1.1 * Timing().recall_s),
    ],
)
def test_an_ended_mission_and_an_old_memory_mean_a_new_flight(kept: Snapshot, age_s: float) -> None:
    coordinator = remembering(
        replace(kept, messages=(*kept.messages, message("u0", done("t0")))), age_s
    )
    (brief,) = said(coordinator.log, MissionConfig)

    assert brief.run not in (RUN, 0)
    assert said(coordinator.log, PlanEpoch) == []
    assert coordinator.core.replica.outcomes == {}
    assert len(plans_wanted(coordinator.log)) == 1
    stamps = [a.message.stamp for a in coordinator.log if isinstance(a, Publish)]
    assert min(stamps) > max(m.stamp for m in kept.messages)


def test_memory_of_another_flight_than_the_agents_does_not_count() -> None:
    kept = memory(running(10.0), EXTRA, mission_s=25.0)
    other = [
        message(COORDINATOR, replace(mission_config_of(FLOWN, LAYERS, RUN), run=7), 1, OLD_LIFE + 1)
    ]
    other.append(message(COORDINATOR, running(3.0, number=1), 2, OLD_LIFE + 1))
    coordinator = remembering(kept, 15.0, [answer(other, 4.0)])

    assert "extra" not in coordinator.core.replica.board
    assert coordinator.core.snapshot(100.0).mission_s == 4.0


def test_it_has_kept_what_it_needs_whenever_tasks_or_epochs_change() -> None:
    coordinator = LoneCoordinator(FLOWN)
    assert coordinator.log.count(Save()) == 1
    coordinator.started()
    assert coordinator.log.count(Save()) == 2
    assert Save() in coordinator.hear("u0", done("t0"))
    assert Save() not in coordinator.hear("u0", held("t1", 2.0))

    kept = coordinator.core.memory(110.0)
    assert kept.mission_s == pytest.approx(10.0, abs=1e-3)
    assert {m.writer for m in kept.messages} == {COORDINATOR, "u0", "u1"}
    again = LoneCoordinator(FLOWN, incarnation=2, memory=kept)
    assert set(again.core.replica.outcomes) == {("u0", "t0")}
    assert again.core.replica.claims == coordinator.core.replica.claims
