"""What an observer makes of what it hears: a result, whenever it joins."""

from __future__ import annotations

from dataclasses import replace

from coordinator.mission_view.mission_state import MissionState
from swarm.model import Plan
from swarm.model.ids import COORDINATOR
from swarm.protocol.events import (
    Ask,
    LinkChanged,
    MessageReceived,
    PeerGone,
    PeerSeen,
    SnapshotsReceived,
    Tick,
)
from swarm.protocol.messages import MissionPhase, Snapshot
from swarm.protocol.timing import Timing
from tests.support.builders import (
    MISSION,
    brief_of,
    done,
    entry,
    epoch,
    failed,
    held,
    message,
    proposed,
    status,
)
from tests.support.onlooker import FLOWN, TIMING, Onlooker

# -- the result -------------------------------------------------------------------------


def test_the_result_tells_lists_times_and_worth_of_what_was_done() -> None:
    observer = Onlooker().running()
    observer.hear("u0", done("t0", 5.0), 5.0)
    observer.hear("u1", done("t1", 1.5), 6.0)
    result = observer.mission_state.result()

    assert result.executed_routes == {"u0": ("t0",), "u1": ("t1",)}
    assert result.executed_completion_s == {"t0": 5.0, "t1": 1.5}
    assert result.executed_objective == 2.0 * 95.0 + 0.5 * 4.0 * 98.5
    assert (result.done, result.failed, result.open) == (("t0", "t1"), (), ("popup",))
    assert (result.makespan_s, result.duplicate_visits, result.epochs) == (5.0, 0, 1)


def test_before_anything_was_heard_everything_is_open() -> None:
    result = Onlooker().mission_state.result()

    assert result.open == ("t0", "t1", "popup")
    assert (result.executed_objective, result.makespan_s, result.epochs) == (0.0, 0.0, 0)


def plan_worth(objective: float) -> Plan:
    return Plan(MISSION, "greedy", {}, objective, {}, None, None, 1, 0.0, 0)


def test_the_first_plan_counts_however_late_the_word_of_it_comes() -> None:
    """It comes on another way than the word that the mission runs, and may be overtaken."""
    observer = Onlooker().running()
    observer.mission_state.take_plan(plan_worth(5.0))
    observer.mission_state.take_plan(plan_worth(3.0))  # made on the way

    assert observer.mission_state.plan == plan_worth(5.0)


def test_before_the_start_the_newest_plan_counts() -> None:
    observer = Onlooker()
    observer.mission_state.take_plan(plan_worth(5.0))
    observer.mission_state.take_plan(plan_worth(3.0))

    assert observer.mission_state.plan == plan_worth(3.0)


def test_a_second_visit_is_counted_and_worth_nothing() -> None:
    observer = Onlooker().running()
    observer.hear("u0", done("t1", 9.0), 9.0)
    observer.hear("u1", done("t1", 8.0), 9.5)
    result = observer.mission_state.result()

    assert result.duplicate_visits == 1
    assert result.executed_completion_s == {"t1": 8.0}
    assert result.executed_objective == 0.5 * 4.0 * 92.0
    assert result.executed_routes == {"u0": ("t1",), "u1": ("t1",)}


def test_tasks_that_failed_or_were_withdrawn_are_not_open() -> None:
    observer = Onlooker().running()
    observer.hear("u0", failed("t0"), 4.0)
    observer.hear(COORDINATOR, entry("t1", withdrawn=True), 5.0)
    result = observer.mission_state.result()

    assert (result.done, result.failed, result.open) == ((), ("t0",), ("popup",))


def test_visits_that_end_at_one_instant_stay_in_the_order_they_were_made_in() -> None:
    observer = Onlooker().running()
    observer.hear("u0", done("t1", 5.0), 5.0)
    observer.hear("u0", done("t0", 5.0), 5.0)

    assert observer.mission_state.result().executed_routes == {"u0": ("t1", "t0"), "u1": ()}


def test_holders_are_those_who_are_there_and_whose_task_is_open() -> None:
    observer = Onlooker().running()
    observer.hear("u0", held("t0", 0.0), 1.0)
    observer.hear("u1", proposed("t1", 0.0))
    assert observer.mission_state.holders == {"t0": "u0", "t1": "u1"}

    observer.hear("u0", done("t0"))
    assert observer.mission_state.holders == {"t1": "u1"}
    observer.lose("u1", 2.0)
    assert observer.mission_state.holders == {}


def test_the_newest_status_of_each_uav_is_kept() -> None:
    observer = Onlooker().running()
    observer.hear("u0", status(position_enu_m=(1.0, 0.0, 0.0)))
    observer.hear("u0", status(position_enu_m=(2.0, 0.0, 0.0)))

    assert observer.mission_state.statuses["u0"].position_enu_m == (2.0, 0.0, 0.0)
    assert set(observer.mission_state.statuses) == {"u0"}


# -- joining ----------------------------------------------------------------------------


def test_it_asks_until_it_knows_the_brief_and_then_only_for_losses() -> None:
    mission_state = MissionState(FLOWN, TIMING)
    assert mission_state.start(100.0) == [Ask()]
    assert mission_state.step(SnapshotsReceived(()), 100.5) == []
    due_s = mission_state.next_deadline_s()
    assert due_s == 100.0 + TIMING.ask_s

    assert mission_state.step(Tick(), due_s) == [Ask()]
    mission_state.step(MessageReceived(message(COORDINATOR, brief_of(FLOWN))), 101.5)
    assert mission_state.next_deadline_s() is None
    assert mission_state.step(Tick(), 200.0) == []
    assert mission_state.step(LinkChanged(True), 200.0) == [Ask()]


def test_it_asks_the_others_for_the_last_words_of_the_lost_and_for_what_the_returned_know() -> None:
    observer = Onlooker().running()
    observer.happen(PeerGone("u0"), 5.0)
    assert observer.happen(Tick(), 5.0 + TIMING.loss_delay_s) == [Ask()]
    assert observer.happen(PeerSeen("u0"), 10.0) == [Ask()]
    assert observer.happen(PeerSeen("u9"), 15.0) == []


def test_it_asks_a_uav_that_appears_for_what_it_said_before_it_could_be_heard() -> None:
    mission_state = MissionState(FLOWN, TIMING)
    mission_state.start(0.0)
    assert mission_state.step(PeerSeen("u0"), 0.5) == [], "who is there is being asked already"
    mission_state.step(MessageReceived(message(COORDINATOR, brief_of(FLOWN))), 2.0)

    assert mission_state.step(PeerSeen("u1"), 5.0) == [Ask()]
    assert mission_state.step(PeerSeen("u1"), 9.0) == []
    assert mission_state.step(PeerSeen("stranger"), 15.0) == []


def test_it_asks_again_when_a_token_that_was_gone_is_back_before_its_writer_was_lost() -> None:
    observer = Onlooker().running()
    observer.happen(PeerGone("u0"), 5.0)
    assert observer.happen(PeerSeen("u0"), 5.1) == [Ask()]
    assert observer.happen(PeerSeen("u0"), 9.0) == []


def test_it_asks_once_more_at_the_end_when_there_is_still_somebody_to_answer() -> None:
    observer = Onlooker().running()
    last = message(COORDINATOR, epoch("u0", phase=MissionPhase.ENDED), 90)
    assert observer.happen(MessageReceived(last), 50.0) == [Ask()]
    again = message(COORDINATOR, epoch("u0", phase=MissionPhase.ENDED), 91)
    assert observer.happen(MessageReceived(again), 60.0) == []


def test_after_it_was_held_up_itself_it_asks_and_misses_nobody_yet() -> None:
    observer = Onlooker(timing=Timing()).running()
    observer.happen(Tick(), 0.5)
    assert Ask() in observer.happen(Tick(), 60.0)

    assert observer.mission_state.present == {COORDINATOR, "u0", "u1"}


def test_one_who_joins_late_learns_time_and_result_but_tells_no_tales_of_pop_ups() -> None:
    observer = Onlooker()
    said = [observer.statement(COORDINATOR, body) for body in observer.posted()]
    said.append(observer.statement(COORDINATOR, epoch("u0", "u1", mission_s=40.0)))
    said.append(observer.statement("u0", done("t0", 5.0)))
    answer = Snapshot(MISSION, COORDINATOR, 1, 41.0, tuple(said))
    observer.happen(SnapshotsReceived((answer,)))

    assert observer.mission_state.mission_s(observer.now_s) == 41.0
    assert observer.mission_state.result().done == ("t0",)
    assert not any("appeared" in sentence for sentence in observer.story)


def test_who_heard_of_the_start_late_is_put_right_by_the_next_announcement() -> None:
    observer = Onlooker()
    observer.hear(COORDINATOR, epoch("u0", "u1"), 3.0)
    observer.hear(COORDINATOR, epoch("u0", "u1", mission_s=4.0), 4.0)
    assert observer.mission_state.mission_s(observer.now_s) == 4.0

    other = message(COORDINATOR, epoch("u0", "u1", number=7), 1, incarnation=9)
    observer.hear(COORDINATOR, brief_of(FLOWN))
    observer.happen(MessageReceived(other), 60.0)
    another_flight = replace(brief_of(FLOWN), run=2)
    observer.happen(MessageReceived(message(COORDINATOR, another_flight, 2, incarnation=9)), 61.0)
    assert observer.mission_state.mission_s(observer.now_s) == 1.0


def test_what_an_announcement_has_waited_here_makes_it_no_earlier() -> None:
    observer = Onlooker()
    said = observer.statement(COORDINATOR, epoch("u0", "u1", mission_s=4.0))
    observer.happen(MessageReceived(said, arrived_s=200.0), 0.75)
    assert observer.mission_state.mission_s(observer.now_s) == 4.75


def test_one_who_joins_late_tells_what_was_before_at_its_own_time() -> None:
    observer = Onlooker(replace(FLOWN, tasks=()))
    said = [observer.statement(COORDINATOR, epoch("u0", "u1", mission_s=40.0))]
    said += [observer.statement(COORDINATOR, body) for body in Onlooker().posted()]
    said += [observer.statement("u1", done("t1", 9.0)), observer.statement("u0", done("t0", 5.0))]
    observer.happen(SnapshotsReceived((Snapshot(MISSION, COORDINATOR, 1, 41.0, tuple(said)),)))
    observer.hear("u0", done("popup", 33.0), 50.0)

    assert [(h.mission_s, h.text) for h in observer.mission_state.story] == [
        (0.0, "epoch 1: greedy, u0 > u1"),
        (5.0, "u0 ended t0: done"),
        (9.0, "u1 ended t1: done"),
        (observer.mission_state.mission_s(observer.now_s), "u0 ended popup: done"),
    ]


def test_epochs_are_counted_and_not_kept_for_ever() -> None:
    observer = Onlooker().running()
    for number in range(2, 500):
        for _ in range(2):  # a new coordinator restates it
            observer.hear(COORDINATOR, epoch("u0", "u1", number=number))
    assert observer.mission_state.result().epochs == 499
    observer.hear(COORDINATOR, epoch("u0", "u1", number=490))
    assert observer.mission_state.result().epochs == 499


# -- other flights ------------------------------------------------------------------------


def test_a_brief_for_another_flight_counts_once_its_coordinator_has_taken_charge() -> None:
    observer = Onlooker().running()
    another = replace(brief_of(observer.flown), run=2)
    early, later = (message(COORDINATOR, another, count, incarnation=9) for count in (1, 3))

    observer.happen(MessageReceived(early), 5.0)
    observer.happen(SnapshotsReceived((Snapshot(MISSION, COORDINATOR, 9, None, (early,)),)), 5.1)
    assert observer.mission_state.replica.brief == brief_of(observer.flown)

    begun = epoch("u0", "u1", phase=MissionPhase.PREPARING)
    observer.happen(MessageReceived(message(COORDINATOR, begun, 2, incarnation=9)), 6.0)
    observer.happen(MessageReceived(later), 7.0)
    assert observer.mission_state.replica.brief == another
