"""Tasks that an operator adds and withdraws: what is said, and how what comes of it is seen."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import pytest

from coordinator.operator.commands import CommandRequest, RequestResult
from coordinator.operator.task_edits import NewTask, TaskWithdrawal, Wgs84
from swarm.model.ids import COORDINATOR, OPERATOR
from swarm.protocol.events import (
    Ask,
    MessageReceived,
    Tick,
)
from swarm.protocol.messages import (
    CommandKind,
    Message,
    MissionPhase,
    Stamp,
    TaskEdit,
)
from swarm.protocol.uav_messages import StatusPhase
from tests.support.builders import (
    IDLE,
    MISSION,
    OUT,
    brief,
    done,
    epoch,
    held,
    message,
    mission,
    order,
    status,
    task,
)
from tests.support.order_desk import FLEET, PATIENCE_S, TIMING, Desk, came

HERE = NewTask((3.0, 4.0, 0.0))


# -- adding -------------------------------------------------------------------------------


def test_a_task_is_added_at_the_end_of_the_board_worth_the_boards_median() -> None:
    desk = Desk()
    desk.give(NewTask((3.0, 4.0, 0.0), service_s=5.0, kind="look", reason="smoke"))

    expected = TaskEdit("op1", 5, (3.0, 4.0, 0.0), 4.0, 5.0, "look", False, 1, "smoke")
    assert desk.said == [Message(MISSION, OPERATOR, Stamp(50, 1), expected)]


def test_it_repeats_and_asks_until_everyone_there_has_confirmed() -> None:
    desk = Desk()
    tracked_request = desk.give(HERE)
    desk.wait(2.5 * TIMING.announce_s)
    assert (len(desk.said), len(set(desk.said))) == (3, 1)
    assert desk.wishes.count(Ask()) >= 4

    desk.confirm(tracked_request, "u0")
    assert tracked_request.verdict is None
    desk.confirm(tracked_request, "u1")
    desk.hear("u1", held("op1", 6.0))
    assert came(tracked_request) == (
        RequestResult.OBEYED,
        "op1 is on the board, worth 4; u1 flies there",
    )
    assert desk.errands.next_deadline_s() is None


def test_a_task_that_nobody_takes_at_once_is_told_so() -> None:
    desk = Desk()
    tracked_request = desk.give(HERE)
    desk.confirm(tracked_request, "u0", "u1")
    desk.wait(5.0)

    assert came(tracked_request) == (
        RequestResult.OBEYED,
        "op1 is on the board, worth 4; nobody has taken it yet",
    )
    assert desk.now_s < 2.0


def test_who_has_not_confirmed_in_time_is_named() -> None:
    desk = Desk()
    tracked_request = desk.give(HERE)
    desk.confirm(tracked_request, "u1")
    desk.wait(PATIENCE_S)

    result, text = came(tracked_request)
    assert (result, text.rpartition("; ")[2]) == (
        RequestResult.OBEYED,
        "u0 has not confirmed it yet",
    )


def test_without_any_answer_it_was_not_seen_to_arrive() -> None:
    desk = Desk()
    tracked_request = desk.give(HERE)
    desk.wait(PATIENCE_S)

    assert came(tracked_request) == (
        RequestResult.NOT_OBEYED,
        "op1: nobody has confirmed it within 10 s",
    )


def test_a_task_no_uav_is_capable_of_is_added_all_the_same() -> None:
    desk = Desk()
    tracked_request = desk.give(replace(HERE, kind="lift"))
    desk.confirm(tracked_request, "u0", "u1")

    result, text = came(tracked_request)
    assert result is RequestResult.OBEYED
    assert text.endswith("but no UAV is capable of it: the success of each there is 0")


def test_when_nobody_takes_part_any_more_it_was_in_vain() -> None:
    desk = Desk()
    desk.hear("u0", OUT)
    desk.hear("u1", OUT)
    tracked_request = desk.give(HERE)
    desk.confirm(tracked_request, "u0")

    result, text = came(tracked_request)
    assert (result, text.partition("; ")[2]) == (
        RequestResult.NOT_OBEYED,
        "but nobody who could do it takes part any more",
    )


@pytest.mark.parametrize(
    ("name", "why"),
    [("t0", "t0 is open"), ("t1", "t1 is done"), ("late", "late is yet to appear")],
)
def test_an_id_that_is_taken_is_refused(name: str, why: str) -> None:
    desk = Desk(mission(FLEET, [task("late", 9.0, appears_s=50.0)]))
    desk.hear("u0", done("t1"))
    tracked_request = desk.give(replace(HERE, task=name))

    assert came(tracked_request) == (RequestResult.TAKEN_ID, f"{why}: give another id, or none")
    assert desk.said == []


def test_ids_that_are_not_chosen_by_hand_go_on() -> None:
    desk = Desk()
    desk.hear(OPERATOR, order("op2", run=9))

    assert [desk.give(HERE).task for _ in range(2)] == ["op1", "op3"]


def test_a_place_on_the_earth_is_brought_into_the_missions_frame() -> None:
    desk = Desk()
    tracked_request = desk.give(NewTask(Wgs84(47.0, 8.001)))
    assert tracked_request.said is not None
    body = tracked_request.said.body
    assert isinstance(body, TaskEdit)
    assert body.position_enu_m[0] == pytest.approx(76.05, abs=0.1)
    assert body.position_enu_m[1:] == (0.0, 0.0)


@pytest.mark.parametrize(
    ("fields", "problem"),
    [
        ({"place": (1e9, 0.0, 0.0)}, "position must be within -1e+08..1e+08, not 1e+09"),
        ({"place": (math.nan, 0.0, 0.0)}, "position must be within -1e+08..1e+08, not nan"),
        ({"value": -1.0}, "value must be within 0..1e+12, not -1"),
        ({"service_s": math.inf}, "time on the spot must be within 0..1e+09, not inf"),
        ({"task": "a b"}, "id 'a b' is not 1 to 64 letters"),
        ({"kind": ""}, "kind '' is not 1 to 64 letters"),
    ],
)
def test_what_no_message_can_carry_is_refused(fields: dict[str, object], problem: str) -> None:
    with pytest.raises(ValueError, match=re.escape(problem)):
        replace(HERE, **fields)  # type: ignore[arg-type]  # each case names a real field


# -- withdrawing --------------------------------------------------------------------------


def test_a_withdrawal_is_obeyed_once_all_know_and_nobody_flies_there() -> None:
    desk = Desk()
    desk.hear("u1", held("t1", 1.0))
    tracked_request = desk.give(TaskWithdrawal("t1", "done by hand"))
    (message,) = desk.said
    assert isinstance(message.body, TaskEdit)
    assert (message.body.withdrawn, message.body.value, message.body.number) == (True, 6.0, 4)
    desk.confirm(tracked_request, "u0", "u1")
    assert tracked_request.verdict is None

    desk.hear("u1", IDLE)
    assert came(tracked_request) == (RequestResult.OBEYED, "t1 is withdrawn")


def test_who_does_not_give_a_withdrawn_task_up_is_named() -> None:
    desk = Desk()
    desk.hear("u1", held("t1", 1.0))
    tracked_request = desk.give(TaskWithdrawal("t1"))
    desk.confirm(tracked_request, "u0", "u1")
    desk.wait(PATIENCE_S)

    assert came(tracked_request) == (RequestResult.NOT_OBEYED, "u1 still claims t1")


def test_a_task_that_is_done_meanwhile_cannot_be_withdrawn() -> None:
    desk = Desk()
    tracked_request = desk.give(TaskWithdrawal("t1"))
    desk.hear("u1", done("t1"))
    desk.confirm(tracked_request, "u0", "u1")

    assert came(tracked_request) == (
        RequestResult.NOT_OBEYED,
        "t1 was done before it could be withdrawn",
    )


def test_what_is_not_there_done_or_withdrawn_is_refused_in_words() -> None:
    desk = Desk()
    desk.hear("u0", done("t0"))
    desk.hear(OPERATOR, order("t1", withdrawn=True))

    assert came(desk.give(TaskWithdrawal("t9"))) == (
        RequestResult.UNKNOWN_TASK,
        "the board holds t0, t1",
    )
    assert came(desk.give(TaskWithdrawal("t0"))) == (RequestResult.NOT_OBEYED, "t0 is done already")
    assert came(desk.give(TaskWithdrawal("t1"))) == (
        RequestResult.NOT_OBEYED,
        "t1 is withdrawn already",
    )
    assert desk.said == []


def test_who_knows_the_scenario_withdraws_a_pop_up_before_it_appears() -> None:
    desk = Desk(mission(FLEET, [task("late", 9.0, 3.0, appears_s=50.0)]))
    tracked_request = desk.give(TaskWithdrawal("late"))

    assert tracked_request.verdict is None
    assert desk.mission_state.board.states["late"].value == "withdrawn"
    assert desk.mission_state.result().open == ()


# -- many at once, and others ---------------------------------------------------------------


def test_several_errands_are_followed_side_by_side() -> None:
    desk = Desk()
    held_uav = desk.give(CommandRequest(CommandKind.HOLD, "u0"))
    added, gone = desk.give(HERE), desk.give(TaskWithdrawal("t0"))
    assert len({message.stamp for message in desk.said}) == 3

    desk.confirm(gone, "u0", "u1")
    assert (gone.obeyed, added.verdict, held_uav.verdict) == (True, None, None)
    desk.hear("u0", replace(status(StatusPhase.HOLDING), note="held"))
    assert (held_uav.obeyed, added.verdict) == (True, None)
    assert desk.errands.open == [added]


def test_it_speaks_above_all_that_any_operator_has_said() -> None:
    desk = Desk()
    desk.happen(MessageReceived(Message(MISSION, OPERATOR, Stamp(7_000, 3), order("op1"))))
    desk.give(HERE)

    assert desk.said[0].stamp > Stamp(7_000, 3)


def test_another_operators_later_word_ends_it() -> None:
    desk = Desk()
    tracked_request = desk.give(HERE)
    later = Message(MISSION, OPERATOR, Stamp(60, 1), order("op1", withdrawn=True))
    desk.happen(MessageReceived(later))

    text = "another operator has withdrawn op1 meanwhile"
    assert came(tracked_request) == (RequestResult.NOT_OBEYED, text)


def test_after_the_end_nothing_is_taken_up() -> None:
    desk = Desk()
    before = desk.give(HERE)
    desk.hear(COORDINATOR, epoch("u0", "u1", phase=MissionPhase.ENDED, number=2))
    assert came(before)[0] is RequestResult.NOT_OBEYED

    text = "the mission has ended: nothing is taken up any more"
    assert came(desk.give(HERE)) == (RequestResult.NOT_OBEYED, text)
    assert came(desk.give(TaskWithdrawal("t0"))) == (RequestResult.NOT_OBEYED, text)


def test_a_mission_that_ends_by_what_was_ordered_has_obeyed() -> None:
    over = epoch("u0", "u1", phase=MissionPhase.ENDED, number=2)
    desk = Desk()
    added, gone = desk.give(HERE), desk.give(TaskWithdrawal("t0"))
    desk.hear("u0", done("op1"))
    desk.hear(COORDINATOR, over)

    assert came(added) == (RequestResult.OBEYED, "op1 was added and is done")
    assert came(gone) == (RequestResult.OBEYED, "t0 is withdrawn")


def test_when_the_brief_turns_out_to_be_of_another_run_it_says_so_anew() -> None:
    desk = Desk()
    tracked_request = desk.give(HERE)
    desk.hear(COORDINATOR, replace(brief(*FLEET), run=5))
    desk.happen(Tick())

    assert tracked_request.said is not None
    assert [m.body.run for m in desk.said if isinstance(m.body, TaskEdit)] == [1, 5]
    assert "op1" in desk.mission_state.replica.board


# -- operators at the same moment ---------------------------------------------------------


def hear_other(desk: Desk, body: TaskEdit, incarnation: int = 60) -> None:
    """Another operator, who has not heard of this one's order, says so."""
    desk.happen(MessageReceived(message(OPERATOR, body, 1, incarnation)))


def test_a_task_that_crosses_anothers_under_one_id_gets_the_next_one() -> None:
    desk = Desk()
    tracked_request = desk.give(HERE)
    hear_other(desk, order("op1", 8.0))

    assert [said.body for said in desk.said] == [
        TaskEdit("op1", 5, (3.0, 4.0, 0.0), 4.0, 0.0, None, False, 1, ""),
        TaskEdit("op2", 10, (3.0, 4.0, 0.0), 4.0, 0.0, None, False, 1, ""),
    ]
    assert desk.said[1].stamp > Stamp(60, 1)
    assert {"op1", "op2"} <= desk.mission_state.replica.board.keys()
    desk.confirm(tracked_request, "u0", "u1")
    desk.hear("u1", held("op2", 6.0))
    assert came(tracked_request) == (
        RequestResult.OBEYED,
        "op2 is on the board, worth 4; u1 flies there",
    )


def test_who_spoke_later_keeps_the_id() -> None:
    desk = Desk()
    tracked_request = desk.give(HERE)
    hear_other(desk, order("op1", 8.0), incarnation=40)

    assert [said.body.task for said in desk.said if isinstance(said.body, TaskEdit)] == ["op1"]
    assert tracked_request.verdict is None


def test_an_id_that_was_chosen_by_hand_is_not_changed() -> None:
    desk = Desk()
    tracked_request = desk.give(replace(HERE, task="fire"))
    hear_other(desk, order("fire", 8.0))

    assert came(tracked_request) == (
        RequestResult.NOT_OBEYED,
        "another operator has changed fire meanwhile",
    )
