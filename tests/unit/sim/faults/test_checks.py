"""A recording that shows a broken promise is recognised, and one that shows none is not."""

from __future__ import annotations

from sim.fleet.faults.checks import (
    AGREE_WITHIN_S,
    ProcessDown,
    Trouble,
    agreement_s,
    disagreements,
    message_logs,
    rivalries,
    visits,
)
from sim.fleet.faults.recorder import BusEntry
from swarm.protocol.messages import Body, Message, Stamp, TaskEntry
from swarm.protocol.uav_messages import AttemptResult, Claim, ClaimPhase, Outcome

MISSION = "m"


class Tape:
    """Entries as a recorder makes them."""

    def __init__(self) -> None:
        self.entries: list[BusEntry] = []
        self._counter = 0
        for number, task in enumerate(("t1", "t2")):
            board = TaskEntry(task, number, (0.0, 0.0, 0.0), 1.0, 0.0, None, False)
            self.say(0.0, "coordinator", board)

    def say(
        self, at_s: float, writer: str, body: Body, stamp: Stamp | None = None, seat: int = 0
    ) -> None:
        self._counter += 1
        message = Message(MISSION, writer, stamp or Stamp(1, self._counter), body)
        self.entries.append(BusEntry(at_s, seat, message, 100))

    def claim(self, at_s: float, uav: str, task: str | None) -> None:
        phase = ClaimPhase.IDLE if task is None else ClaimPhase.HELD
        self.say(at_s, uav, Claim(phase, task, at_s, 0, at_s))


def done(task: str, attempt: int = 1, completed_s: float = 5.0) -> Outcome:
    return Outcome(task, AttemptResult.DONE, attempt, completed_s)


def broken(tape: Tape) -> list[str]:
    return [each.invariant for told in message_logs(tape.entries) for each in told.broken]


def test_counters_that_grow_or_repeat_are_in_order() -> None:
    tape = Tape()
    for stamp in (Stamp(1, 1), Stamp(1, 2), Stamp(1, 2), Stamp(2, 0)):
        tape.say(1.0, "u1", done("t1"), stamp)

    assert broken(tape) == []


def test_a_counter_that_goes_back_is_a_fault() -> None:
    tape = Tape()
    tape.say(1.0, "u1", done("t1"), Stamp(2, 1))
    tape.say(2.0, "u1", done("t1"), Stamp(1, 9))

    assert broken(tape) == ["stamps go back"]


def test_two_statements_under_one_counter_are_a_fault() -> None:
    tape = Tape()
    tape.say(1.0, "u1", done("t1"), Stamp(1, 1))
    tape.say(2.0, "u1", done("t1", completed_s=9.0), Stamp(1, 1))

    assert broken(tape) == ["one stamp, two contents"]


def test_each_register_and_each_seat_counts_by_itself() -> None:
    tape = Tape()
    tape.say(1.0, "u1", done("t1"), Stamp(1, 2))
    tape.say(2.0, "u1", done("t2"), Stamp(1, 1))
    tape.say(3.0, "u1", done("t1"), Stamp(1, 1), seat=1)

    assert broken(tape) == []


def test_a_uav_that_leaves_a_task_without_need_breaks_a_rule_but_not_in_a_new_life() -> None:
    tape = Tape()
    tape.claim(1.0, "u1", "t1")
    tape.say(2.0, "u1", Claim(ClaimPhase.IDLE, None, 2.0, 0, 2.0), Stamp(2, 0))
    assert broken(tape) == []

    tape.claim(1.0, "u2", "t2")
    tape.claim(2.0, "u2", "t1")
    assert broken(tape) == ["left its task"]


def test_a_visit_is_counted_once_however_often_it_is_told() -> None:
    tape = Tape()
    for seat in (0, 1):
        tape.say(1.0, "u1", done("t1"), Stamp(1, 1), seat=seat)
        tape.say(2.0, "u2", done("t1", completed_s=6.0), Stamp(1, 1), seat=seat)
    tape.say(3.0, "u2", done("t1", attempt=2, completed_s=9.0), Stamp(1, 2))
    tape.say(4.0, "u3", Outcome("t1", AttemptResult.FAILED, 1, 7.0), Stamp(1, 1))

    seen = visits(message_logs(tape.entries))
    assert [(v.task, v.uav, v.completed_s) for v in seen] == [
        ("t1", "u1", 5.0),
        ("t1", "u2", 6.0),
        ("t1", "u2", 9.0),
    ]


def test_a_rivalry_lasts_until_one_gives_way() -> None:
    tape = Tape()
    tape.claim(1.0, "u1", "t1")
    tape.claim(2.0, "u2", "t1")
    tape.claim(2.5, "u2", "t2")
    tape.claim(9.0, "u1", "t1")

    (found,) = rivalries(tape.entries, MISSION)
    assert (found.task, found.uavs, found.begin_s, found.end_s) == ("t1", ("u1", "u2"), 2.0, 2.5)


def test_a_rivalry_that_never_ends_lasts_as_long_as_the_recording() -> None:
    tape = Tape()
    tape.claim(1.0, "u1", "t1")
    tape.claim(2.0, "u2", "t1")
    tape.claim(8.0, "u3", "t2")

    assert [(each.begin_s, each.end_s) for each in rivalries(tape.entries, MISSION)] == [(2.0, 8.0)]


def test_nobody_is_a_rival_for_a_task_that_is_done() -> None:
    tape = Tape()
    tape.claim(1.0, "u1", "t1")
    tape.say(2.0, "u1", done("t1"))
    tape.claim(3.0, "u2", "t1")

    assert rivalries(tape.entries, MISSION) == []


def test_the_dead_are_nobodys_rivals_until_they_speak_again() -> None:
    tape = Tape()
    tape.claim(1.0, "u1", "t1")
    tape.claim(3.0, "u2", "t1")
    tape.claim(4.0, "u1", "t1")
    tape.claim(4.2, "u2", None)

    (found,) = rivalries(tape.entries, MISSION, [ProcessDown(2.0, "u1")])
    assert (found.begin_s, found.end_s) == (4.0, 4.2)


def test_an_old_claim_that_comes_late_makes_no_rivalry() -> None:
    tape = Tape()
    tape.say(1.0, "u1", Claim(ClaimPhase.HELD, "t2", 1.0, 0, 1.0), Stamp(1, 50))
    tape.claim(2.0, "u2", "t1")
    tape.say(3.0, "u1", Claim(ClaimPhase.HELD, "t1", 0.0, 0, 0.0), Stamp(1, 49))

    assert rivalries(tape.entries, MISSION) == []


def rivalry(begin_s: float, end_s: float) -> Tape:
    tape = Tape()
    tape.claim(1.0, "u1", "t1")
    tape.claim(begin_s, "u2", "t1")
    tape.claim(end_s, "u2", None)
    return tape


def test_agreement_is_counted_from_the_end_of_the_trouble() -> None:
    trouble = Trouble(10.0, 20.0)
    found = rivalries(rivalry(12.0, 23.0).entries, MISSION)

    assert agreement_s(found, trouble) == 3.0
    assert agreement_s(found, Trouble(10.0, 25.0)) == 0.0
    assert agreement_s(rivalries(rivalry(40.0, 49.0).entries, MISSION), trouble) == 0.0


def test_a_rivalry_in_a_whole_network_is_a_fault_unless_it_is_short() -> None:
    long, short = (rivalries(rivalry(2.0, end).entries, MISSION) for end in (6.0, 2.5))

    assert disagreements(short, []) == []
    (fault,) = disagreements(long, [])
    assert fault == "u1, u2 claimed t1 for 4.0 s too long"


def test_a_rivalry_is_excused_while_the_network_is_parted_and_shortly_after() -> None:
    trouble = Trouble(10.0, 20.0)
    healed = rivalries(rivalry(12.0, 20.0 + AGREE_WITHIN_S).entries, MISSION)
    stubborn = rivalries(rivalry(12.0, 29.0).entries, MISSION)

    assert disagreements(healed, [trouble]) == []
    assert disagreements(stubborn, [trouble, Trouble(11.0, 13.0)]) == [
        "u1, u2 claimed t1 for 4.0 s too long"
    ]
