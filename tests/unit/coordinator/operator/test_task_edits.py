"""What the coordinator makes of tasks that the operator adds and withdraws."""

from __future__ import annotations

from dataclasses import replace

from coordinator.core.lifecycle import Withdraw
from coordinator.core.publication import RegisterAnnouncer, mission_config_of, scenario_differences
from swarm.model.ids import COORDINATOR, OPERATOR
from swarm.protocol.events import LinkChanged, PeerSeen, Publish
from swarm.protocol.messages import (
    Message,
    MissionConfig,
    MissionPhase,
    PlanEpoch,
    Snapshot,
    TaskEntry,
)
from swarm.protocol.registers import Replica
from swarm.protocol.timing import Timing
from tests.support.builders import (
    MISSION,
    done,
    entries_of,
    entry,
    epoch,
    held,
    message,
    mission,
    order,
    task,
    uav,
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

U0, U1 = uav("u0"), uav("u1")
T0 = task("t0", 5.0)
POPUP = task("popup", 9.0, appears_s=30.0)


def started(*tasks: object) -> LoneCoordinator:
    flown = mission([U0], [T0, *tasks])  # type: ignore[list-item]  # tasks, as each test has them
    return LoneCoordinator(flown, incarnation=1).started()


def test_the_mission_goes_on_until_what_was_added_is_done() -> None:
    coordinator = started()
    coordinator.hear(OPERATOR, order("op1"), 110.0)
    coordinator.hear("u0", done("t0"), 120.0)
    assert coordinator.phase is MissionPhase.RUNNING

    coordinator.hear("u0", done("op1"), 130.0)
    assert coordinator.reason == "every task has ended"
    coordinator.leave("u0")
    assert finishes(coordinator.run_until(200.0)) == [0]


def test_what_was_added_and_is_left_undone_makes_it_fail() -> None:
    coordinator = started()
    coordinator.hear(OPERATOR, order("op1"), 110.0)
    coordinator.hear("u0", done("t0"), 120.0)
    coordinator.leave("u0")

    assert finishes(coordinator.run_until(400.0)) == [1]


def test_a_pop_up_that_was_withdrawn_before_it_appeared_is_not_posted() -> None:
    coordinator = started(POPUP)
    coordinator.hear(OPERATOR, order("popup", withdrawn=True), 110.0)
    coordinator.run_until(140.0)
    assert "popup" not in {found.task for found in said(coordinator.log, TaskEntry)}

    coordinator.hear("u0", done("t0"), 141.0)
    assert coordinator.reason == "every task has ended"
    coordinator.leave("u0")
    assert finishes(coordinator.run_until(300.0)) == [0]


def test_what_is_ordered_is_logged() -> None:
    coordinator = started()
    actions = coordinator.hear(OPERATOR, order("op1", reason="smoke"))
    actions += coordinator.hear(OPERATOR, order("t0", withdrawn=True))

    told = [(note.text, note.fields["task"]) for note in notes(actions) if "task" in note.fields]
    assert told == [("task by the operator", "op1"), ("task withdrawn by the operator", "t0")]


def test_before_the_start_it_plans_anew_with_what_was_added_and_without_what_was_withdrawn() -> (
    None
):
    coordinator = LoneCoordinator(mission([U0, U1], [T0, task("t1", 8.0)]))
    coordinator.answer_plan("u0", "u1")
    coordinator.hear(OPERATOR, order("op1"))
    coordinator.hear(OPERATOR, order("t1", withdrawn=True))
    coordinator.ready("u0", "u1")
    assert coordinator.phase is None

    assert {each.id for each in plans_wanted(coordinator.log)[-1].mission.tasks} == {"t0", "op1"}
    coordinator.answer_plan("u1", "u0")
    assert coordinator.phase is MissionPhase.RUNNING


def test_orders_about_tasks_are_no_difference_from_the_scenario_file() -> None:
    flown = mission([U0], [T0, POPUP])
    replica = Replica()
    replica.join(message(COORDINATOR, replace(mission_config_of(flown, LAYERS, 1), run=1)))
    for counter, posted in enumerate(entries_of(flown), 2):
        replica.join(message(COORDINATOR, posted, counter))
    for counter, said_ in enumerate([order("op1"), order("t0", withdrawn=True, value=7.0)], 1):
        replica.join(message(OPERATOR, said_, counter))

    assert scenario_differences(flown, LAYERS, replica) == []
    replica.join(message(COORDINATOR, entry("t0", 6.0), 9))
    assert scenario_differences(flown, LAYERS, replica) == ["task t0"]


def test_what_another_coordinator_posted_is_kept_whatever_the_operator_says_of_it() -> None:
    replica = Replica()
    replica.join(message(COORDINATOR, mission_config_of(mission([U0], [T0]), LAYERS, 1)))
    replica.join(message(OPERATOR, order("popup", withdrawn=True)))
    postings = RegisterAnnouncer(mission([U0], [T0, POPUP]), LAYERS, 1, replica, Timing())
    theirs = [message(COORDINATOR, entry("popup"), 5)]

    assert postings.merged(theirs) == [entry("popup")]
    replica.join(theirs[0])
    assert postings.merged(theirs) == []
    assert replica.board["popup"].withdrawn


def test_its_own_withdrawal_of_a_task_that_only_the_operator_knows_says_nothing() -> None:
    coordinator = started()
    coordinator.hear(OPERATOR, order("op1"))

    assert said(coordinator.happen(Withdraw("op1")), TaskEntry) == []


# -- restarts and links -------------------------------------------------------------------


def agents_answer(*more: Message, run: int = 77, mission_s: float = 20.0) -> Snapshot:
    flown = mission([U0], [T0])
    known = [
        message(COORDINATOR, mission_config_of(flown, LAYERS, run), 1, 5),
        message(COORDINATOR, epoch("u0", number=3), 2, 5),
        message(COORDINATOR, entries_of(flown)[0], 3, 5),
        message("u0", held("t0", 1.0), 4),
    ]
    return Snapshot(MISSION, "u0", 7, mission_s, (*known, *more))


def test_one_that_starts_anew_finds_what_the_operator_has_added() -> None:
    added = message(OPERATOR, order("op1", run=77))
    coordinator = LoneCoordinator(
        mission([U0], [T0]), incarnation=600, answers=[agents_answer(added)]
    )
    coordinator.see("u0")
    coordinator.hear("u0", done("t0"))

    assert set(coordinator.core.replica.board) == {"t0", "op1"}
    assert coordinator.phase is MissionPhase.RUNNING
    assert all("differs_in" not in note.fields for note in notes(coordinator.log))


def test_one_that_briefed_too_early_takes_the_run_of_the_flight_that_is_on() -> None:
    """Its own brief has reached some, so they tell it as the newest there is."""
    coordinator = LoneCoordinator(mission([U0], [T0]), incarnation=600)
    (own,) = said(coordinator.log, MissionConfig)
    assert own.run == 600
    added = message(OPERATOR, order("op1", run=77))
    echo = Snapshot(MISSION, "u9", 7, 20.0, (message(COORDINATOR, own, 1, 600),))
    coordinator.answers = [agents_answer(added), echo]
    actions = coordinator.see("u0")

    assert said(coordinator.log, MissionConfig)[-1].run == 77
    resumed = [a.message.body for a in actions if isinstance(a, Publish)]
    kinds = [type(body) for body in resumed]
    assert kinds.index(MissionConfig) < kinds.index(PlanEpoch), (
        "nobody in charge is known by the other run"
    )
    assert set(coordinator.core.replica.board) == {"t0", "op1"}


def test_back_from_a_cut_it_waits_for_what_may_have_been_added_meanwhile() -> None:
    coordinator = started()
    coordinator.happen(LinkChanged(False), 110.0)
    coordinator.happen(LinkChanged(True), 120.0)
    coordinator.hear("u0", done("t0"), 120.5)
    assert coordinator.phase is MissionPhase.RUNNING

    added = message(OPERATOR, order("op1"))
    coordinator.answers = [Snapshot(MISSION, "u0", 7, 20.0, (added,))]
    coordinator.hear("u0", held("op1", 19.0), 121.0)
    coordinator.run_until(120.0 + 10.0 * TIMING.relink_grace_s)
    assert "op1" in coordinator.core.replica.board
    assert coordinator.phase is MissionPhase.RUNNING


def test_it_does_not_end_the_mission_while_somebody_claims_what_it_does_not_know() -> None:
    coordinator = started()
    coordinator.hear("u0", held("op1", 1.0), 110.0)
    coordinator.hear("u0", done("t0"), 111.0)

    assert coordinator.phase is MissionPhase.RUNNING


def test_what_a_stranger_claims_keeps_no_mission_from_ending() -> None:
    coordinator = started()
    coordinator.happen(PeerSeen("stranger"), 109.0)
    coordinator.hear("stranger", held("op1", 1.0), 110.0)
    coordinator.hear("u0", done("t0"), 111.0)

    assert coordinator.reason == "every task has ended"
