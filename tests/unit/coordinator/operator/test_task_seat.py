"""An operator who goes on with the scenario of a mission without a coordinator."""

from __future__ import annotations

from sim.world.scripted_operator import ScriptedOperator
from swarm.model import TaskId
from swarm.model.ids import OPERATOR
from swarm.protocol.events import CommonAction, Finish, LinkChanged, MessageReceived, Publish, Tick
from swarm.protocol.messages import TaskEdit
from swarm.protocol.timing import Timing
from tests.support.builders import entry, message, mission, task, uav

TIMING = Timing(announce_s=4.0, silence_s=20.0)
FLOWN = mission([uav("u0")], [task("t0", 5.0), task("t1", 9.0), task("late", 7.0, appears_s=30.0)])
ZERO_S = 80.0
"""When the mission began, by the operator's clock."""


def flown(
    withdrawn_at_s: dict[str, float] | None = None, *, since_s: float = 10.0, until_s: float = 1e6
) -> tuple[ScriptedOperator, list[tuple[float, CommonAction]]]:
    """A seat of which the operator sits down at 20 s, its wishes, and when [s mission time]."""
    seat = ScriptedOperator(
        FLOWN,
        {TaskId(name): at_s for name, at_s in (withdrawn_at_s or {}).items()},
        since_s=since_s,
        mission_s=20.0,
        run=7,
        incarnation=50,
        timing=TIMING,
        patience_s=10.0,
    )
    assert seat.step(LinkChanged(True), ZERO_S) == []
    told = [(20.0, wish) for wish in seat.start(ZERO_S + 20.0)]
    while (at_s := seat.next_deadline_s()) is not None and at_s <= ZERO_S + until_s:
        told += [(at_s - ZERO_S, wish) for wish in seat.step(Tick(), at_s)]
    return seat, told


def said(wishes: list[tuple[float, CommonAction]]) -> list[tuple[float, str, bool]]:
    found = []
    for at_s, wish in wishes:
        if isinstance(wish, Publish):
            assert wish.message.writer == OPERATOR
            assert wish.message.stamp.incarnation == 50
            body = wish.message.body
            assert isinstance(body, TaskEdit)
            assert body.run == 7
            found.append((at_s, body.task, body.withdrawn))
    return found


def test_tasks_are_posted_and_withdrawn_when_their_time_has_come() -> None:
    _, told = flown({"t1": 25.0}, until_s=30.0)

    assert [each for each in said(told) if each[0] in (25.0, 30.0)] == [
        (25.0, "t1", True),
        (30.0, "late", False),
    ]


def test_what_has_come_about_while_nobody_sat_there_is_said_at_once() -> None:
    _, told = flown({"t1": 12.0}, until_s=21.0)

    assert said(told) == [(20.0, "t1", True)]


def test_what_the_coordinator_has_told_is_left_as_it_is() -> None:
    _, told = flown({"t1": 12.0}, since_s=15.0)

    assert {name for _, name, _ in said(told)} == {"late"}


def test_it_repeats_what_it_said_for_a_while_and_leaves_when_nothing_is_to_come() -> None:
    seat, told = flown()

    assert [at_s for at_s, _, _ in said(told)] == [30.0, 34.0, 38.0, 42.0]
    assert told[-1][1] == Finish(0)
    assert seat.next_deadline_s() is None
    assert seat.step(MessageReceived(message("u0", entry("t0"))), 1e6) == []


def test_where_nothing_is_to_come_it_leaves_at_once() -> None:
    assert flown(since_s=31.0)[1] == [(20.0, Finish(0))]


def test_a_task_that_appears_and_is_withdrawn_at_one_instant_ends_withdrawn() -> None:
    _, told = flown({"late": 30.0}, until_s=30.0)

    assert said(told) == [(30.0, "late", False), (30.0, "late", True)]
