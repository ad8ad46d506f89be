"""Tasks with limits and lines that an operator adds: what is said, and whether anybody can."""

from __future__ import annotations

from dataclasses import replace

import pytest

from coordinator.operator.commands import RequestResult
from coordinator.operator.task_edits import MOST_POINTS, NewTask, Wgs84
from swarm.model.ids import COORDINATOR
from swarm.protocol.encoding import SMALL_LIMIT_BYTES, encode
from swarm.protocol.messages import TaskEdit
from tests.support.builders import brief, epoch, held
from tests.support.order_desk import FLEET, TIMING, Desk, came

HERE = (3.0, 4.0, 0.0)
FAR = (900.0, 0.0, 0.0)
LINE = ((0.0, 0.0, 0.0), (20.0, 0.0, 0.0), (20.0, 10.0, 5.0))


def test_limits_and_lines_are_said_as_they_are_given() -> None:
    desk = Desk()
    wish = NewTask(
        None, "ridge", 2.0, due_s=600.0, opens_s=60.0, closes_s=300.0, path=LINE, height_m=40.0
    )
    desk.give(wish)

    expected = TaskEdit(
        "ridge",
        5,
        LINE[0],
        2.0,
        0.0,
        None,
        False,
        1,
        "",
        due_s=600.0,
        opens_s=60.0,
        closes_s=300.0,
        path_enu_m=LINE,
        height_m=40.0,
    )
    assert desk.said[-1].body == expected
    (posted,) = (t for t in desk.mission_state.mission.tasks if t.id == "ridge")
    assert (posted.path_enu_m, posted.due_s) == (LINE, 600.0)


def test_programs_are_told_the_limits_that_there_are() -> None:
    desk = Desk()
    plain, line = desk.give(NewTask(HERE)), desk.give(NewTask(None, path=LINE[:2], opens_s=9.0))

    assert plain.handler.told.keys() == {
        "task",
        "uav",
        "known_to",
        "position",
        "value",
        "service_s",
        "kind",
    }
    assert line.handler.told["path_enu_m"] == [list(point) for point in LINE[:2]]
    assert line.handler.told["opens_s"] == 9.0


def test_points_in_degrees_lie_where_the_missions_origin_says() -> None:
    desk = Desk()
    desk.give(NewTask(None, path=(Wgs84(47.0, 8.0), Wgs84(47.001, 8.0))))
    edit = desk.said[-1].body

    assert isinstance(edit, TaskEdit)
    (begin, end) = edit.path_enu_m
    assert begin == edit.position_enu_m == pytest.approx((0.0, 0.0, 0.0))
    assert end == pytest.approx((0.0, 111.2, 0.0), abs=0.2)


@pytest.mark.parametrize("limits", [{"due_s": 50.0}, {"closes_s": 50.0}])
def test_what_would_be_too_late_already_is_not_said(limits: dict[str, float]) -> None:
    desk = Desk()
    desk.hear(COORDINATOR, epoch("u0", "u1", mission_s=60.0))
    result, text = came(desk.give(replace(NewTask(HERE), **limits)))  # type: ignore[arg-type]  # real fields

    assert result is RequestResult.NOT_OBEYED
    assert text.endswith("50 s, and the mission is at 60.0 s")
    assert not [each for each in desk.said if isinstance(each.body, TaskEdit)]


def test_who_flies_to_a_task_with_limits_is_told() -> None:
    desk = Desk()
    tracked = desk.give(NewTask(HERE, due_s=100.0))
    desk.confirm(tracked, "u0", "u1")
    desk.hear("u1", held("op1", 6.0))

    assert came(tracked) == (
        RequestResult.OBEYED,
        "op1 is on the board, worth 4; u1 flies there",
    )


def test_a_task_that_nobody_can_do_in_time_is_added_and_that_is_said() -> None:
    desk = Desk()
    tracked = desk.give(NewTask(FAR, due_s=100.0))
    desk.confirm(tracked, "u0", "u1")

    text = "no UAV can do it in time, or with its battery, or come there"
    told = f"op1 is on the board, worth 4; but {text}"
    assert came(tracked) == (RequestResult.OBEYED, told)


def test_a_task_that_somebody_can_do_yet_is_looked_after_for_a_moment() -> None:
    desk = Desk()
    tracked = desk.give(NewTask(HERE, due_s=100.0))
    desk.confirm(tracked, "u0", "u1")
    assert tracked.verdict is None

    desk.wait(desk.now_s + 2.5 * TIMING.patience_s)
    assert came(tracked) == (
        RequestResult.OBEYED,
        "op1 is on the board, worth 4; nobody has taken it yet",
    )


def test_the_longest_line_has_room_in_a_message_whatever_else_is_said() -> None:
    path = tuple((0.1 + n, 0.2, 0.3) for n in range(MOST_POINTS))
    desk = Desk()
    desk.hear(COORDINATOR, replace(brief(*FLEET), run=2**53))
    long = "x" * 64
    desk.give(
        NewTask(
            None, long, 1e-7, 0.1, long, "ä" * 150, 1e8 + 0.1, 0.1, 1e8 + 0.1, path, height_m=0.1
        )
    )
    size = len(encode(desk.said[-1]))
    assert size + len(long) <= SMALL_LIMIT_BYTES, "with the longest name of a mission, too"


@pytest.mark.parametrize(
    ("wrong", "why"),
    [
        ({}, "either a place, or a line"),
        ({"place": HERE, "path": LINE}, "either a place, or a line"),
        ({"path": LINE[:1]}, "a line of two points"),
        ({"path": (LINE[0], (1e9, 0.0, 0.0))}, "position must be within"),
        ({"place": HERE, "due_s": -1.0}, "due time must be within"),
        ({"place": HERE, "opens_s": float("nan")}, "opening time must be within"),
        ({"place": HERE, "opens_s": 5.0, "closes_s": 4.0}, "before it opens"),
        ({"place": HERE, "opens_s": 5.0, "due_s": 5.0}, "before it opens"),
        ({"place": HERE, "height_m": 1e9}, "height must be within"),
        ({"path": LINE * 50}, f"has 150 points, and a message has room for {MOST_POINTS}"),
    ],
)
def test_what_contradicts_itself_is_no_task(wrong: dict[str, object], why: str) -> None:
    with pytest.raises(ValueError, match=why):
        NewTask(**{"place": None, **wrong})  # type: ignore[arg-type]  # each case names real fields
