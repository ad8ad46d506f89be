"""Deciding, claiming, giving way and taking over."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import replace

import pytest

from agent.core import tasking
from agent.core.decision import nothing_left
from agent.core.interface import GoTo, Refused, Return
from swarm.model.ids import COORDINATOR
from swarm.protocol.board import TaskBoard
from swarm.protocol.events import LinkChanged, MessageReceived, PeerGone, PeerSeen
from swarm.protocol.messages import TaskEntry
from swarm.protocol.uav_messages import Claim, ClaimPhase
from tests.support.builders import (
    IDLE,
    OUT,
    done,
    entry,
    epoch,
    failed,
    held,
    message,
    proposed,
    uav,
)
from tests.support.lone_agent import ABOVE_START, LoneAgent, claims, notes, orders, statuses

NEAR, FAR = entry("near", east_m=10.0), entry("far", east_m=20.0, number=1)


def flying(*tasks: TaskEntry, others: int = 1, sequence: tuple[str, ...] = ()) -> LoneAgent:
    """``u0`` at mission time 0, decided, with everybody else idle."""
    agent = LoneAgent(*(uav(f"u{n}") for n in range(others + 1)))
    agent.fly_to(*tasks)
    agent.start_mission(*sequence)
    return agent


# -- deciding ---------------------------------------------------------------------------


def test_it_claims_its_best_task_and_flies_there_at_once() -> None:
    agent = LoneAgent(uav("u0"))
    agent.fly_to(FAR, NEAR)
    actions = agent.start_mission()

    assert claims(actions) == [proposed("near", 0.0, 0, 10.0)]
    assert orders(actions) == [GoTo(1, (10.0, 0.0, 10.0))]


def test_it_leaves_better_ranked_free_uavs_what_they_will_take() -> None:
    assert flying(NEAR, FAR, sequence=("u0", "u1")).task == "near"
    assert flying(NEAR, FAR, sequence=("u1", "u0")).task == "far"


def test_it_takes_nothing_that_a_stronger_claim_names() -> None:
    agent = LoneAgent(uav("u0"), uav("u1"))
    agent.fly_to(NEAR, FAR)
    agent.hear("u1", held("near", 0.0))
    agent.start_mission()

    assert agent.task == "far"


def test_it_takes_what_a_weaker_proposal_names() -> None:
    agent = LoneAgent(uav("u0"), uav("u1"))
    agent.fly_to(NEAR, FAR)
    agent.hear("u1", proposed("near", 0.0, rank=1))
    agent.start_mission("u0", "u1")

    assert agent.task == "near"


def test_claims_of_someone_who_is_not_there_do_not_count() -> None:
    agent = LoneAgent(uav("u0"), uav("u1"))
    agent.fly_to(NEAR)
    agent.lose("u1", -10.0)
    agent.hear("u1", held("near", 0.0))
    agent.start_mission()

    assert agent.task == "near"


def test_it_stays_idle_while_there_is_nothing_for_it() -> None:
    agent = LoneAgent(uav("u0", near=0.0))
    agent.fly_to(NEAR)
    agent.start_mission()

    assert agent.phase is ClaimPhase.IDLE
    assert agent.core.next_deadline_s() is not None


def test_under_a_rule_it_does_not_know_it_stays_idle_and_says_so() -> None:
    agent = LoneAgent(uav("u0"))
    agent.fly_to(NEAR)
    actions = agent.hear(COORDINATOR, epoch("u0", rule="newer"), 0.0)
    assert agent.phase is ClaimPhase.IDLE
    assert "unknown rule" in notes(actions)
    assert "newer" in statuses(agent.run_until(1.0))[-1].note

    agent.hear(COORDINATOR, epoch("u0", number=2), 2.0)
    assert agent.task == "near"
    agent.hear(COORDINATOR, epoch("u0", number=3, rule="newer"), 3.0)
    assert agent.task == "near"
    agent.arrive(12.0)
    assert agent.phase is ClaimPhase.IDLE
    assert orders(agent.end_mission(13.0)) == [Return("over", via_enu_m=ABOVE_START)]


def test_idle_it_takes_a_pop_up_at_once() -> None:
    agent = flying(others=0)
    actions = agent.hear(COORDINATOR, NEAR, 7.0)

    assert agent.claim == proposed("near", 7.0, 0, 17.0)
    assert orders(actions) == [GoTo(1, (10.0, 0.0, 10.0), idled=True)]


def test_busy_it_leaves_a_pop_up_for_later() -> None:
    agent = flying(FAR, others=0)
    agent.hear(COORDINATOR, NEAR, 1.0)
    assert agent.task == "far"

    agent.arrive(20.0)
    assert agent.claim == proposed("near", 20.0, 0, 30.0)


def test_when_the_patience_with_those_who_should_come_first_runs_out_it_takes_their_task() -> None:
    agent = flying(NEAR, sequence=("u1", "u0"))
    patience_s = agent.timing.patience_s
    assert agent.phase is ClaimPhase.IDLE

    agent.run_until(0.9 * patience_s)
    assert agent.phase is ClaimPhase.IDLE
    agent.run_until(1.1 * patience_s)
    assert agent.task == "near"


def test_it_waits_no_longer_for_those_who_have_decided() -> None:
    agent = flying(NEAR, FAR, others=2, sequence=("u1", "u2", "u0"))
    assert agent.phase is ClaimPhase.IDLE
    agent.hear("u1", proposed("near", 0.0, 0, 10.0))
    assert agent.phase is ClaimPhase.IDLE

    agent.hear("u2", OUT)
    assert agent.task == "far"


def test_where_others_keep_all_that_is_open_it_waits_for_nobody_to_decide(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    agent = LoneAgent(*(uav(f"u{n}") for n in range(4)))
    agent.fly_to(NEAR)
    agent.hear("u1", held("near", 0.0))
    agent.start_mission()
    looks: list[str] = []

    def look(
        board: TaskBoard, since_s: float, excluded: Collection[str], counts: Callable[[str], bool]
    ) -> bool:
        looks.append("looked")
        return nothing_left(board, since_s, excluded, counts)

    monkeypatch.setattr(tasking, "nothing_left", look)
    for writer in ("u2", "u3"):
        agent.hear(writer, replace(IDLE, decided_s=0.1))
    assert (looks, agent.task) == ([], None)

    agent.hear("u1", IDLE)
    assert (looks, agent.task) == (["looked"], "near")


def test_idle_it_takes_what_another_failed_at_though_that_one_claims_it_again_at_once() -> None:
    agent = LoneAgent(uav("u0"), uav("u1"), reattempt_failed=True)
    agent.fly_to(NEAR)
    agent.hear("u1", held("near", 0.0))
    agent.start_mission("u0", "u1")
    assert agent.task is None

    agent.hear("u1", failed("near", completed_s=7.0), 7.0)
    agent.hear("u1", proposed("near", 7.0, rank=1))
    assert agent.task == "near"


def test_a_uav_that_is_a_little_late_still_decides_first() -> None:
    """As the plan has it; its word is on its way, or it slows down at its task just now."""
    agent = LoneAgent(uav("u0"), uav("u1"))
    agent.fly_to(entry("own", east_m=10.0), entry("theirs", east_m=9.0, number=1))
    agent.hear("u1", held("theirs", 0.0, 0, 9.9))
    agent.start_mission("u1", "u0")
    agent.post(entry("next", east_m=11.0, number=2), entry("after", east_m=90.0, number=3))

    agent.arrive(10.0)

    assert agent.task == "after"


def test_for_a_uav_that_is_very_late_nobody_waits() -> None:
    agent = LoneAgent(uav("u0"), uav("u1"))
    agent.fly_to(entry("own", east_m=10.0), entry("theirs", east_m=9.0, number=1))
    agent.hear("u1", held("theirs", 0.0, 0, 9.0))
    agent.start_mission("u1", "u0")
    agent.post(entry("next", east_m=11.0, number=2), entry("after", east_m=90.0, number=3))

    agent.arrive(10.0)

    assert agent.task == "next"


# -- proposed and held ------------------------------------------------------------------


def test_a_claim_nobody_beats_is_held_after_the_objection_window() -> None:
    agent = flying(NEAR)
    window_s = agent.timing.objection_window_s

    assert claims(agent.run_until(0.9 * window_s)) == []
    assert claims(agent.run_until(1.1 * window_s)) == [held("near", 0.0, 0, 10.0)]
    assert claims(agent.run_until(5.0)) == []


def test_it_gives_way_to_a_stronger_proposal_and_decides_again_in_its_old_place() -> None:
    agent = flying(NEAR, FAR, sequence=("u0", "u1"))
    agent.post(entry("third", east_m=50.0, number=2))

    actions = agent.hear("u1", proposed("near", -0.5, 1), 0.25)

    assert claims(actions) == [proposed("far", 0.0, 0, 20.25)]
    assert orders(actions) == [GoTo(2, (20.0, 0.0, 10.0))]


def test_the_old_place_in_the_order_gives_it_what_later_deciders_proposed() -> None:
    agent = flying(NEAR, FAR, others=2)
    agent.hear("u2", proposed("far", 0.1, 2), 0.1)
    agent.hear("u1", proposed("near", -0.5, 1), 0.25)

    assert agent.claim == proposed("far", 0.0, 0, 20.25)


@pytest.mark.parametrize(
    "rival", [proposed("near", 0.1), proposed("near", 0.0, rank=1)], ids=["later", "lower rank"]
)
def test_it_keeps_its_task_against_a_weaker_claim(rival: Claim) -> None:
    agent = flying(NEAR, FAR)

    actions = agent.hear("u1", rival, 0.2)

    assert claims(actions) == []
    assert orders(actions) == []
    agent.run_until(1.0)
    assert agent.claim == held("near", 0.0, 0, 10.0)


def test_a_clock_that_is_a_second_behind_takes_no_task_from_a_uav_on_its_way() -> None:
    agent = flying(NEAR, FAR)
    agent.run_until(1.0)

    actions = agent.hear("u1", proposed("near", -0.5, 0, 3.0), 1.1)

    assert claims(actions) == []
    assert agent.task == "near"


def test_a_proposal_gives_way_to_a_held_claim_though_decided_earlier() -> None:
    agent = flying(NEAR, FAR)
    agent.hear("u1", held("near", 5.0, 1, 50.0), 0.1)

    assert agent.task == "far"


def test_of_two_held_claims_the_one_that_will_be_there_first_stays() -> None:
    for completion_s, stays in ((9.0, False), (11.0, True)):
        agent = flying(NEAR, FAR)
        agent.run_until(1.0)
        agent.hear("u1", held("near", 0.5, 1, completion_s), 2.0)
        assert (agent.task == "near") is stays


def test_having_lost_a_held_claim_it_decides_as_one_who_is_free_now() -> None:
    agent = flying(NEAR, FAR)
    agent.run_until(1.0)
    agent.hear("u1", held("near", 0.5, 1, 9.0), 2.0)

    assert agent.claim == proposed("far", 2.0, 0, 22.0)


def test_a_new_epoch_revokes_no_task() -> None:
    agent = flying(NEAR, FAR, sequence=("u0", "u1"))
    for mission_s in (0.1, 1.0):
        actions = agent.hear(COORDINATOR, epoch("u1", "u0", number=2, mission_s=0.0), mission_s)
        assert orders(actions) == []
    assert agent.task == "near"


# -- tasks that end or open elsewhere ---------------------------------------------------


@pytest.mark.parametrize("window_s", [0.1, 1.0])
def test_it_releases_a_task_that_another_has_done(window_s: float) -> None:
    agent = flying(NEAR, FAR)
    agent.run_until(window_s)
    actions = agent.hear("u1", done("near"), window_s)

    assert "released" in notes(actions)
    assert agent.task == "far"


def test_it_releases_a_task_that_failed_and_is_not_tried_again() -> None:
    agent = flying(NEAR, FAR)
    agent.hear("u1", failed("near"), 1.0)

    assert agent.task == "far"


def test_it_releases_a_withdrawn_task_and_stops_if_there_is_no_other() -> None:
    agent = flying(NEAR, others=0)
    agent.be_at((4.0, 0.0, 10.0))

    actions = agent.hear(COORDINATOR, entry("near", east_m=10.0, withdrawn=True), 4.0)

    assert [claim.phase for claim in claims(actions)] == [ClaimPhase.IDLE]
    assert orders(actions) == [GoTo(2, (4.0, 0.0, 10.0))]
    actions = agent.arrive(5.0)
    assert (claims(actions), orders(actions)) == ([], [])


def test_the_task_of_a_lost_uav_is_open_to_an_idle_one_after_the_delay() -> None:
    agent = LoneAgent(uav("u0"), uav("u1"))
    agent.fly_to(NEAR)
    agent.hear("u1", held("near", 0.0))
    agent.start_mission("u1", "u0")
    assert agent.phase is ClaimPhase.IDLE

    agent.happen(PeerGone("u1"), 3.0)
    assert agent.phase is ClaimPhase.IDLE
    agent.run_until(3.0 + 0.9 * agent.timing.loss_delay_s)
    assert agent.phase is ClaimPhase.IDLE
    agent.run_until(3.0 + 1.1 * agent.timing.loss_delay_s)
    assert agent.task == "near"


def test_a_token_that_blinks_opens_no_task() -> None:
    agent = LoneAgent(uav("u0"), uav("u1"))
    agent.fly_to(NEAR)
    agent.hear("u1", held("near", 0.0))
    agent.start_mission("u1", "u0")
    agent.happen(PeerGone("u1"), 3.0)
    agent.see("u1")
    agent.run_until(10.0)

    assert agent.phase is ClaimPhase.IDLE


def idle_beside(*, sequence: tuple[str, ...]) -> LoneAgent:
    """``u0`` and ``u2`` have long been idle, ``u1`` flies to the only task."""
    agent = LoneAgent(uav("u0", other=0.0), uav("u1"), uav("u2", other=0.0))
    agent.fly_to(NEAR)
    agent.hear("u1", held("near", 0.0))
    agent.start_mission(*sequence)
    agent.run_until(20.0)
    return agent


def opened(agent: LoneAgent, how: str) -> None:
    match how:
        case "lost":
            agent.lose("u1", 20.0)
        case "released for another":
            agent.post(entry("other", number=9))
            agent.hear("u1", proposed("other", 20.0))
        case "given up":
            agent.hear("u1", IDLE, 20.0)
        case "out":
            agent.hear("u1", OUT, 20.0)


@pytest.mark.parametrize("how", ["lost", "released for another", "given up", "out"])
def test_idle_uavs_take_an_opened_task_in_sequence_order(how: str) -> None:
    first = idle_beside(sequence=("u0", "u2", "u1"))
    opened(first, how)
    assert first.task == "near"

    second = idle_beside(sequence=("u2", "u0", "u1"))
    opened(second, how)
    assert second.phase is ClaimPhase.IDLE
    second.run_until(20.0 + second.timing.loss_delay_s + 1.1 * second.timing.patience_s)
    assert second.task == "near"


def test_a_lost_uav_that_comes_back_takes_no_task_before_it_speaks_itself() -> None:
    """It may be a new process that knows nothing of what the old one claimed."""
    agent = LoneAgent(uav("u0"), uav("u1"))
    agent.fly_to(NEAR, FAR)
    agent.hear("u1", held("near", 0.0, 0, 5.0))
    agent.start_mission("u1", "u0")
    agent.arrive(20.0)
    agent.lose("u1", 21.0)
    agent.run_until(23.0)
    assert agent.claim is not None
    assert (agent.task, agent.phase) == ("near", ClaimPhase.HELD)

    agent.happen(PeerSeen("u1"), 24.0)
    assert agent.task == "near"
    agent.hear("u1", held("near", 0.0, 0, 5.0))
    assert agent.phase is ClaimPhase.IDLE


def test_no_one_is_suspected_while_the_own_link_is_down() -> None:
    agent = LoneAgent(uav("u0"), uav("u1"))
    agent.fly_to(NEAR)
    agent.hear("u1", held("near", 0.0))
    agent.start_mission("u1", "u0")
    agent.happen(LinkChanged(False), 1.0)
    agent.happen(PeerGone("u1"))
    agent.run_until(60.0)
    assert agent.phase is ClaimPhase.IDLE

    agent.happen(LinkChanged(True))
    agent.run_until(60.0 + 0.9 * agent.timing.relink_grace_s)
    assert agent.phase is ClaimPhase.IDLE
    agent.run_until(60.0 + 1.1 * agent.timing.relink_grace_s)
    assert agent.phase is ClaimPhase.IDLE
    agent.learn()
    assert agent.task == "near"


def test_when_its_link_is_back_it_says_at_once_what_it_holds() -> None:
    agent = flying(NEAR)
    agent.run_until(1.0)
    agent.happen(LinkChanged(False), 2.0)

    assert claims(agent.happen(LinkChanged(True), 30.0)) == [held("near", 0.0, 0, 10.0)]


# -- what the vehicle refuses -----------------------------------------------------------


def test_a_target_the_vehicle_refuses_is_released_and_never_chosen_again() -> None:
    agent = flying(NEAR, FAR, others=0)
    (order,) = orders(agent.log)[1:]
    agent.happen(Refused(order, "outside the geofence"), 0.125)
    assert agent.claim == proposed("far", 0.0, 0, 20.125)

    agent.arrive(21.0)
    assert agent.phase is ClaimPhase.IDLE
    agent.hear(COORDINATOR, entry("third", east_m=99.0, number=3), 22.0)
    assert agent.task == "third"


def test_a_refusal_of_an_older_leg_means_nothing() -> None:
    agent = flying(NEAR, FAR, others=0)
    (order,) = orders(agent.log)[1:]
    agent.hear("u9", done("near"), 0.1)
    agent.happen(Refused(order, "busy"), 0.2)

    assert agent.task == "far"


def test_older_words_in_its_own_name_are_counted_and_change_nothing() -> None:
    agent = flying(NEAR, FAR)
    before = len(agent.log)

    for _ in range(3):
        agent.happen(MessageReceived(message("u0", held("far", -9.0), incarnation=1)))
    agent.tick(1.0)

    assert agent.task == "near"
    assert not orders(agent.log[before:])
    assert statuses(agent.log)[-1].dropped == {"stale": 3}
