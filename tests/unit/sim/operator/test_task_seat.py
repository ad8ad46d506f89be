"""An operator who keeps the board of a mission without a coordinator."""

from __future__ import annotations

from sim.operator.task_seat import TaskSeat
from swarm.config import Timing
from swarm.events import Ask, Finish, Heard, Learned, LinkChanged, Publish, Tick, Wish
from swarm.model import TaskId
from swarm.model.ids import COORDINATOR
from swarm.wire.messages import Board, Message, Snapshot
from tests.builders import MISSION, entry, message, mission, task, uav

TIMING = Timing(announce_s=4.0, silence_s=20.0, ask_s=5.0)
FLOWN = mission([uav("u0")], [task("t0", 5.0), task("t1", 9.0), task("late", 7.0, appears_s=30.0)])
NOW_S, ZERO_S = 100.0, 80.0
"""When the operator sits down, and when the mission began; by the operator's clock."""
KNOWN = [message(COORDINATOR, entry("t0", 5.0)), message(COORDINATOR, entry("t1", 9.0, number=1))]


def seated(withdrawn_at_s: dict[str, float] | None = None) -> TaskSeat:
    seat = TaskSeat(
        FLOWN,
        {TaskId(name): at_s for name, at_s in (withdrawn_at_s or {}).items()},
        incarnation=50,
        timing=TIMING,
        patience_s=10.0,
    )
    assert seat.step(LinkChanged(True), NOW_S) == []
    assert seat.start(NOW_S) == [Ask()]
    return seat


def answer(*messages: Message, mission_s: float | None = NOW_S - ZERO_S) -> Learned:
    return Learned((Snapshot(MISSION, "u0", 1, mission_s, tuple(messages)),))


def run(seat: TaskSeat, until_s: float) -> list[tuple[float, Wish]]:
    """Tick at its deadlines; its wishes, and when [s of the mission]."""
    told: list[tuple[float, Wish]] = []
    while (at_s := seat.next_deadline_s()) is not None and at_s <= until_s:
        told += [(at_s - ZERO_S, wish) for wish in seat.step(Tick(), at_s)]
    return told


def said(wishes: list[tuple[float, Wish]]) -> list[tuple[float, str, bool]]:
    found = []
    for at_s, wish in wishes:
        if isinstance(wish, Publish):
            assert wish.message.writer == COORDINATOR
            body = wish.message.body
            assert isinstance(body, Board)
            found.append((at_s, body.task, body.withdrawn))
    return found


def test_tasks_are_posted_and_withdrawn_when_their_time_has_come() -> None:
    seat = seated({"t1": 25.0})
    assert seat.step(answer(*KNOWN), NOW_S) == []

    told = said(run(seat, ZERO_S + 31.0))
    assert [each for each in told if each[0] in (25.0, 30.0)] == [
        (25.0, "t1", True),
        (30.0, "late", False),
    ]


def test_what_is_over_when_it_sits_down_is_said_at_once_and_what_is_known_not() -> None:
    seat = seated({"t1": 3.0})
    wishes = seat.step(answer(*KNOWN), NOW_S)

    assert said([(0.0, wish) for wish in wishes]) == [(0.0, "t1", True)]


def test_it_speaks_above_all_that_has_been_said_from_that_seat() -> None:
    seat = seated({"t1": 3.0})
    newer = message(COORDINATOR, entry("t1", 9.0, number=1), counter=7, incarnation=900)
    (wish,) = seat.step(answer(KNOWN[0], newer), NOW_S)

    assert isinstance(wish, Publish)
    assert wish.message.stamp > newer.stamp


def test_it_repeats_what_it_said_for_a_while_and_leaves_when_nothing_is_to_come() -> None:
    seat = seated()
    seat.step(answer(*KNOWN), NOW_S)
    told = run(seat, 1e6)

    assert [at_s for at_s, _, _ in said(told)] == [30.0, 34.0, 38.0, 42.0]
    assert told[-1][1] == Finish(0)
    assert seat.next_deadline_s() is None
    assert seat.step(Heard(KNOWN[0]), 1e6) == []


def test_it_asks_until_somebody_knows_when_the_mission_began() -> None:
    seat = seated()
    seat.step(Learned(()), NOW_S)
    assert [wish for _, wish in run(seat, NOW_S + 6.0)] == [Ask()]
    seat.step(answer(*KNOWN), NOW_S + 6.0)

    assert said(run(seat, 1e6)) != []


def test_it_gives_up_a_mission_that_nobody_knows() -> None:
    seat = seated()
    seat.step(Learned(()), NOW_S)

    assert run(seat, 1e6)[-1][1] == Finish(0)


def test_a_task_withdrawn_before_it_was_posted_is_posted_and_withdrawn_at_once() -> None:
    """Nobody who hears only the one statement takes it for open."""
    seat = seated({"late": 30.0})
    seat.step(answer(*KNOWN), NOW_S)

    told = said(run(seat, ZERO_S + 30.0))
    assert told[-2:] == [(30.0, "late", False), (30.0, "late", True)]
