"""What an observer makes of what it hears: a story in sentences."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from coordinator.mission_view.story import STORY_KEPT
from swarm.model.ids import COORDINATOR
from swarm.protocol.events import (
    KeysReplaced,
    LinkChanged,
    MessageReceived,
    PeerGone,
    PeerSeen,
    Tick,
)
from swarm.protocol.fields import MAX_COUNT
from swarm.protocol.messages import Message, MissionPhase, Stamp
from swarm.protocol.timing import Timing
from swarm.protocol.uav_messages import StatusPhase
from tests.support.builders import (
    IDLE,
    MISSION,
    OUT,
    done,
    entries_of,
    epoch,
    held,
    message,
    proposed,
    status,
)
from tests.support.onlooker import FLOWN, Onlooker


def test_a_faultless_mission_in_sentences() -> None:
    observer = Onlooker().running()
    observer.hear("u0", held("t0", 0.0), 0.5)
    observer.hear("u0", done("t0", 5.0), 5.0)
    observer.hear(COORDINATOR, entries_of(FLOWN)[2], 30.0)
    observer.hear("u0", done("popup", 33.0), 33.0)
    observer.hear(COORDINATOR, epoch("u0", phase=MissionPhase.ENDED, reason="over"), 34.0)

    assert [(h.mission_s, h.text) for h in observer.mission_state.story] == [
        (0.0, "epoch 1: greedy, u0 > u1"),
        (5.0, "u0 ended t0: done"),
        (30.0, "task popup appeared"),
        (33.0, "u0 ended popup: done"),
        (34.0, "mission ends: over"),
    ]


def test_hearing_it_again_makes_no_second_sentence() -> None:
    observer = Onlooker().running()
    ended = epoch("u0", phase=MissionPhase.ENDED, reason="over")
    told = observer.statement("u0", done("t0", 5.0))
    for _ in range(2):
        observer.happen(MessageReceived(told), 5.0)
        observer.hear(COORDINATOR, epoch("u0", "u1", mission_s=5.0))
    for _ in range(2):
        observer.hear(COORDINATOR, ended, 9.0)

    assert len(observer.story) == 3


def test_a_loss_is_told_with_the_task_it_opens_and_who_takes_over() -> None:
    observer = Onlooker().running()
    observer.hear("u0", held("t0", 0.0), 0.5)
    observer.lose("u0", 3.0)
    observer.hear("u1", proposed("t0", 3.3), 3.3)
    observer.hear("u1", held("t0", 3.3), 3.6)

    assert observer.story[1:] == ["u0 lost; task t0 is open again", "u1 took over t0 from u0"]
    assert observer.mission_state.lost == ["u0"]
    assert observer.mission_state.result().lost_uavs == ("u0",)


def test_a_uav_lost_with_nothing_to_do_opens_nothing() -> None:
    observer = Onlooker().running()
    observer.lose("u0", 3.0)

    assert observer.story[1:] == ["u0 lost"]


def test_a_uav_that_comes_back_takes_its_task_over_from_nobody() -> None:
    observer = Onlooker().running()
    observer.hear("u0", held("t0", 0.0), 0.5)
    observer.lose("u0", 3.0)
    observer.happen(PeerSeen("u0"), 4.0)
    observer.hear("u0", IDLE)
    observer.hear("u0", proposed("t0", 4.0))
    observer.lose("u0", 5.0)

    loss = "u0 lost; task t0 is open again"
    assert observer.story[1:] == [loss, "u0 is back", loss]
    assert observer.mission_state.result().lost_uavs == ("u0",)


def test_who_came_back_and_stayed_is_not_among_the_lost() -> None:
    observer = Onlooker().running()
    observer.lose("u0", 3.0)
    observer.happen(PeerSeen("u0"), 60.0)

    assert observer.mission_state.result().lost_uavs == ()


def test_a_loss_by_silence_is_told_as_such_and_so_is_the_end_of_the_silence() -> None:
    observer = Onlooker(timing=Timing()).running()
    for mission_s in np.arange(0.5, 2.0 * Timing().silence_s, 0.5):
        observer.hear("u1", status(), float(mission_s))
        observer.hear(COORDINATOR, epoch("u0", "u1", mission_s=float(mission_s)))
    assert observer.story[1:] == ["u0 lost, silent though its link is up"]

    observer.hear("u0", IDLE, 100.0)
    assert observer.story[2] == "u0 is back"


def test_a_second_visit_is_told() -> None:
    observer = Onlooker().running()
    observer.hear("u0", done("t1", 9.0), 9.0)
    observer.hear("u1", done("t1", 9.5), 9.5)

    assert observer.story[-1] == "u1 ended t1: done, as u0 had"


def test_an_agent_that_forgot_its_visit_and_made_it_again_made_a_duplicate() -> None:
    observer = Onlooker().running()
    observer.hear("u0", done("t1", 9.0), 9.0)
    observer.happen(MessageReceived(message("u0", done("t1", 40.0), 1, incarnation=2)), 40.0)

    assert observer.mission_state.result().duplicate_visits == 1


def test_an_outcome_that_a_new_life_of_an_agent_restates_is_no_second_visit() -> None:
    observer = Onlooker().running()
    observer.hear("u0", done("t1", 9.0), 9.0)
    observer.happen(MessageReceived(message("u0", done("t1", 9.0), 1, incarnation=2)), 40.0)

    assert observer.mission_state.result().duplicate_visits == 0
    assert len(observer.story) == 2


def test_the_newest_status_is_the_one_said_last_and_not_the_one_heard_last() -> None:
    observer = Onlooker().running()
    older, newer = (
        message("u0", status(position_enu_m=(x, 0.0, 0.0)), n, 1)
        for n, x in enumerate((1.0, 2.0), 50)
    )
    reborn = message("u0", status(position_enu_m=(3.0, 0.0, 0.0)), 1, incarnation=2)
    for said, east_m in ((newer, 2.0), (older, 2.0), (reborn, 3.0), (newer, 3.0)):
        observer.happen(MessageReceived(said))
        assert observer.mission_state.statuses["u0"].position_enu_m == (east_m, 0.0, 0.0)


def test_who_has_new_keys_is_heard_whatever_stamps_the_old_ones_bore() -> None:
    observer = Onlooker().running()
    largest, honest = Stamp(MAX_COUNT, MAX_COUNT), status(position_enu_m=(2.0, 0.0, 0.0))
    observer.happen(
        MessageReceived(Message(MISSION, "u0", largest, status(position_enu_m=(1.0, 0.0, 0.0))))
    )
    observer.happen(MessageReceived(Message(MISSION, COORDINATOR, largest, epoch("u0"))))

    observer.happen(KeysReplaced(frozenset({"u0", COORDINATOR})))
    observer.happen(MessageReceived(message("u0", honest, 1)))
    observer.happen(MessageReceived(message(COORDINATOR, epoch("u1", "u0", number=2), 2)))

    assert observer.mission_state.statuses["u0"] == honest
    assert observer.mission_state.replica.epoch is not None
    assert observer.mission_state.replica.epoch.number == 2
    assert "keys revoked or replaced: coordinator, u0" in observer.story


def test_of_many_new_keys_a_few_are_named() -> None:
    observer = Onlooker().running()
    observer.happen(KeysReplaced(frozenset(f"u{number}" for number in range(9))))

    assert observer.story[-1] == "keys revoked or replaced: u0, u1, u2, u3, u4 and 4 more"


def test_what_agents_dropped_is_added_up_over_their_lives() -> None:
    observer = Onlooker().running()
    counts = [{"malformed": 2}, {"malformed": 5, "stale": 1}]
    for number, dropped in enumerate(counts):
        observer.happen(
            MessageReceived(message("u0", replace(status(), dropped=dropped), 90 + number))
        )
    reborn = replace(status(), dropped={"malformed": 3})
    observer.happen(MessageReceived(message("u0", reborn, 1, incarnation=2)))

    assert observer.mission_state.dropped == {"u0": Counter(malformed=8, stale=1)}


def test_who_leaves_after_its_last_word_is_not_lost() -> None:
    observer = Onlooker().running()
    observer.hear("u0", OUT, 3.0)
    observer.lose("u0", 4.0)

    assert observer.story[1:] == ["u0 takes no further part"]
    assert observer.mission_state.lost == []


def test_a_token_that_blinks_and_a_cut_of_the_own_link_are_no_losses() -> None:
    observer = Onlooker().running()
    observer.happen(PeerGone("u0"), 1.0)
    observer.happen(PeerSeen("u0"))
    observer.happen(LinkChanged(False), 2.0)
    observer.happen(PeerGone("u1"))
    observer.happen(Tick(), 50.0)

    assert observer.story[1:] == []
    assert observer.mission_state.present == {COORDINATOR, "u0", "u1"}


@pytest.mark.parametrize(
    ("phase", "told"),
    [
        (None, ["coordinator lost before the mission began"]),
        (MissionPhase.RUNNING, ["coordinator lost; the fleet goes on with the last epoch"]),
        (MissionPhase.ENDED, []),
    ],
)
def test_the_loss_of_the_coordinator_is_told_for_what_it_means(
    phase: MissionPhase | None, told: list[str]
) -> None:
    observer = Onlooker()
    observer.happen(PeerSeen(COORDINATOR))
    if phase is not None:
        observer.hear(COORDINATOR, epoch("u0", phase=phase), 0.0)
    before = len(observer.story)
    observer.lose(COORDINATOR, 1.0)

    assert observer.story[before:] == told
    assert observer.mission_state.lost == []


def test_the_return_of_the_coordinator_is_told() -> None:
    observer = Onlooker().running()
    observer.lose(COORDINATOR, 5.0)
    observer.happen(PeerSeen(COORDINATOR), 9.0)
    observer.hear(COORDINATOR, epoch("u0", "u1", mission_s=9.0))

    assert observer.story[2:] == ["coordinator is back"]


@pytest.mark.parametrize("was_missed", [True, False])
def test_a_new_coordinator_is_told_and_its_epoch_is_no_new_one(was_missed: bool) -> None:
    observer = Onlooker().running()
    if was_missed:
        observer.lose(COORDINATOR, 5.0)
        observer.happen(PeerSeen(COORDINATOR), 9.0)
    restated = message(COORDINATOR, epoch("u0", "u1", mission_s=9.0), 1, incarnation=2)
    for _ in range(2):
        observer.happen(MessageReceived(restated), 9.0)
    next_one = message(COORDINATOR, epoch("u1", "u0", number=2, mission_s=9.0), 2, incarnation=2)
    observer.happen(MessageReceived(next_one))

    assert observer.story[1 + was_missed :] == [
        "a new coordinator has taken charge",
        "epoch 2: greedy, u1 > u0",
    ]
    assert observer.mission_state.result().epochs == 2


def test_a_new_plan_is_told_with_its_reason() -> None:
    observer = Onlooker().running()
    anew = epoch("u1", "u0", number=2, mission_s=9.0, reason="u2 lost: worth 9 instead of 8")
    observer.happen(MessageReceived(message(COORDINATOR, anew, 9)), 9.0)

    assert observer.story[-1] == "epoch 2: greedy, u1 > u0 (u2 lost: worth 9 instead of 8)"


def test_a_start_without_somebody_is_told_with_its_reason() -> None:
    observer = Onlooker()
    for body in observer.posted():
        observer.hear(COORDINATOR, body)
    observer.hear(COORDINATOR, epoch("u0", reason="without u1: its agent is lost"), 0.0)

    assert observer.story == ["epoch 1: greedy, u0 (without u1: its agent is lost)"]


def test_late_words_of_the_old_coordinator_are_no_news() -> None:
    observer = Onlooker().running()
    observer.happen(MessageReceived(message(COORDINATOR, epoch("u0", "u1"), 1, incarnation=5)))
    before = list(observer.story)
    observer.hear(COORDINATOR, epoch("u0", "u1", mission_s=3.0))

    assert observer.story == before


def test_a_story_without_end_is_kept_in_part_and_says_so() -> None:
    observer = Onlooker().running()
    mission_state = observer.mission_state
    for number in range(3 * STORY_KEPT):
        mission_state.tell(f"line {number}", observer.now_s)
        assert len(mission_state.story) <= STORY_KEPT + 1

    first = observer.story[0]
    gone = mission_state.told - len(mission_state.story) + 1
    assert first == f"{gone} earlier lines are no longer kept"
    assert observer.story[1:] == [f"line {n}" for n in range(gone - 1, 3 * STORY_KEPT)]


def test_who_reads_a_story_as_it_grows_is_told_each_line_once() -> None:
    observer = Onlooker().running()
    mission_state, told, read = observer.mission_state, 0, list[str]()
    for number in range(2 * STORY_KEPT):
        mission_state.tell(f"line {number}", observer.now_s)
        if number % 7 == 0:
            read += [line.text for line in mission_state.told_since(told)]
            told = mission_state.told

    assert [text for text in read if text.startswith("line")] == [
        f"line {number}" for number in range(len(read) - 1)
    ]


def leaving(phase: StatusPhase, note: str, counter: int, incarnation: int = 1) -> MessageReceived:
    said = replace(status(phase), note=note)
    return MessageReceived(message("u0", said, counter, incarnation=incarnation))


def test_why_a_uav_leaves_is_told_once() -> None:
    observer = Onlooker().running()
    observer.happen(leaving(StatusPhase.FLYING, "", 90))
    observer.happen(leaving(StatusPhase.OUT, "its pilot switched it to LOITER", 91))
    observer.happen(leaving(StatusPhase.OUT, "its pilot switched it to LOITER", 92))

    assert observer.story[1:] == ["u0 gave its vehicle up: its pilot switched it to LOITER"]


def test_who_leaves_again_in_another_life_is_told_again() -> None:
    observer = Onlooker().running()
    observer.happen(leaving(StatusPhase.RETURNING, "the battery is low", 90))
    observer.happen(leaving(StatusPhase.RETURNING, "told to stop", 1, incarnation=2))

    assert observer.story[1:] == ["u0 goes home: the battery is low", "u0 goes home: told to stop"]


def test_going_home_when_all_is_done_is_no_news() -> None:
    observer = Onlooker().running()
    for name in observer.mission_state.board.states:
        observer.hear("u0", done(name, 2.0), 2.0)
    told = list(observer.story)
    observer.happen(leaving(StatusPhase.RETURNING, "every task has ended", 90))

    assert observer.story == told
