"""The invariants of what is said, each broken and kept by hand."""

from __future__ import annotations

import pytest

from sim.faults.message_log import MessageLog
from swarm.model.ids import COORDINATOR, OPERATOR
from swarm.protocol.messages import Body, Message, MissionPhase, PlanEpoch, Stamp, TaskEntry
from swarm.protocol.uav_messages import AttemptResult, Claim, ClaimPhase, Outcome
from tests.support.builders import order


class Telling:
    """Says things in the name of writers; stamps grow by themselves."""

    def __init__(self) -> None:
        self.message_log = MessageLog()
        self._counter = 0

    def say(
        self,
        writer: str,
        body: Body,
        *,
        life: int = 0,
        stamp: Stamp | None = None,
        unheard: bool = False,
    ) -> None:
        self._counter += 1
        message = Message("m", writer, stamp or Stamp(1, self._counter), body)
        self.message_log.said(float(self._counter), writer, life, message, unheard=unheard)

    def claim(self, uav: str, task: str | None, *, decided_s: float = 0.0, life: int = 0) -> None:
        phase = ClaimPhase.IDLE if task is None else ClaimPhase.PROPOSED
        self.say(uav, Claim(phase, task, decided_s, 0, 9.0), life=life)

    @property
    def broken(self) -> list[str]:
        return [each.invariant for each in self.message_log.broken]


@pytest.fixture
def told() -> Telling:
    return Telling()


IDLE = Claim(ClaimPhase.IDLE, None, 0.0, 0, 0.0)


def test_a_smaller_stamp_than_before_is_a_breach(told: Telling) -> None:
    told.say("u0", IDLE, stamp=Stamp(2, 1))
    told.say("u0", IDLE, stamp=Stamp(1, 9), life=1)

    assert told.broken == ["stamps go back"]


def test_a_new_life_may_speak_below_what_nobody_has_heard_but_not_below_what_somebody_has(
    told: Telling,
) -> None:
    told.say("u0", IDLE, stamp=Stamp(2, 1))
    told.say("u0", IDLE, stamp=Stamp(2, 9), unheard=True)
    told.say("u0", IDLE, stamp=Stamp(2, 3), life=1)
    assert told.broken == []

    told.say("u0", IDLE, stamp=Stamp(2, 2), life=2)
    assert told.broken == ["stamps go back"]


def test_one_life_never_speaks_below_itself_heard_or_not(told: Telling) -> None:
    told.say("u0", IDLE, stamp=Stamp(2, 2), unheard=True)
    told.say("u0", IDLE, stamp=Stamp(2, 1), unheard=True)

    assert told.broken == ["stamps go back"]


def test_the_same_statement_again_is_none(told: Telling) -> None:
    told.say("u0", IDLE, stamp=Stamp(2, 1))
    told.say("u0", IDLE, stamp=Stamp(2, 1))

    assert told.broken == []


def test_one_stamp_for_two_contents_is_a_breach(told: Telling) -> None:
    told.say("u0", IDLE, stamp=Stamp(2, 1))
    told.say("u0", Claim(ClaimPhase.IDLE, None, 1.0, 0, 0.0), stamp=Stamp(2, 1))

    assert told.broken == ["one stamp, two contents"]


def test_registers_are_counted_each_by_itself(told: Telling) -> None:
    told.say("u0", Outcome("t0", AttemptResult.DONE, 1, 1.0), stamp=Stamp(2, 5))
    told.say("u0", Outcome("t1", AttemptResult.DONE, 1, 1.0), stamp=Stamp(2, 4))

    assert told.broken == []


def test_leaving_a_task_without_a_reason_is_a_breach(told: Telling) -> None:
    told.claim("u0", "t0")
    told.claim("u0", "t1")
    told.claim("u0", None)

    assert told.broken == ["left its task"] * 2


def test_a_new_life_may_begin_with_another_task(told: Telling) -> None:
    told.claim("u0", "t0")
    told.claim("u0", "t1", life=1)

    assert told.broken == []


@pytest.mark.parametrize("uav", ["u0", "u1"])
def test_a_task_that_is_done_may_be_left(told: Telling, uav: str) -> None:
    told.claim("u0", "t0")
    told.say(uav, Outcome("t0", AttemptResult.DONE, 1, 1.0))
    told.claim("u0", "t1")

    assert told.broken == []


def test_a_task_that_is_withdrawn_may_be_left(told: Telling) -> None:
    told.claim("u0", "t0")
    told.say(COORDINATOR, TaskEntry("t0", 0, (0.0, 0.0, 0.0), 1.0, 0.0, None, True))
    told.claim("u0", "t1")

    assert told.broken == []


def test_a_task_that_the_operator_withdraws_may_be_left(told: Telling) -> None:
    told.claim("u0", "t0")
    told.say(OPERATOR, order("t0", withdrawn=True))
    told.claim("u0", "t1")

    assert told.broken == []


def test_a_task_may_be_left_to_a_stronger_claim_only(told: Telling) -> None:
    told.claim("u1", "t0", decided_s=1.0)
    told.claim("u2", "t1", decided_s=3.0)
    told.claim("u0", "t0", decided_s=2.0)
    told.claim("u0", "t1", decided_s=2.0)
    assert told.broken == []

    told.claim("u0", "t2", decided_s=2.0)
    assert told.broken == ["left its task"]


def test_a_task_that_the_vehicle_refuses_may_be_left(told: Telling) -> None:
    told.claim("u0", "t0")
    told.message_log.refused("u0", "t0")
    told.claim("u0", "t1")

    assert told.broken == []


def test_a_task_that_constraints_do_not_allow_any_more_may_be_left(told: Telling) -> None:
    told.claim("u0", "t0")
    told.message_log.gave_up("u0", "t0")
    told.claim("u0", "t1")

    assert told.broken == []


def test_who_goes_home_may_leave_its_task_when_the_mission_has_ended(told: Telling) -> None:
    out = Claim(ClaimPhase.OUT, None, 0.0, 0, 0.0)
    told.claim("u0", "t0")
    told.claim("u1", "t1")
    told.say("u0", out)
    told.say(COORDINATOR, PlanEpoch(2, MissionPhase.ENDED, "greedy", (), 0.0, "over", {}))
    told.say("u1", out)

    assert [each.text for each in told.message_log.broken] == ["u0 left t0 for out"]


def test_visits_beyond_the_first_are_duplicates(told: Telling) -> None:
    for uav, task, attempt in (("u0", "t0", 1), ("u1", "t0", 1), ("u0", "t0", 2), ("u0", "t1", 1)):
        told.say(uav, Outcome(task, AttemptResult.DONE, attempt, 1.0 * attempt))
        told.say(uav, Outcome(task, AttemptResult.DONE, attempt, 1.0 * attempt))

    assert told.message_log.duplicates == 2
    assert told.message_log.done == {"t0", "t1"}


def test_a_uav_may_turn_aside_as_often_as_something_opened(told: Telling) -> None:
    told.say(COORDINATOR, TaskEntry("t0", 0, (0.0, 0.0, 0.0), 1.0, 0.0, None, False))
    told.claim("u0", "t0")
    told.message_log.turned_aside(3.0, "u0", "t0")
    told.claim("u0", "t1")
    assert not told.broken

    told.message_log.missed("u0")
    told.message_log.turned_aside(4.0, "u0", "t1")
    told.claim("u0", "t0")
    assert not told.broken

    told.message_log.turned_aside(5.0, "u0", "t0")
    assert told.broken == ["left its task"]
