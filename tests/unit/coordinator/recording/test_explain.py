"""The story of a task and of a UAV, from missions small enough to know what has to be told."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest

from coordinator.mission_view.story import EventKind
from coordinator.recording.explanation import Explanation, explain_task, explain_uav
from coordinator.recording.growing_mcap import Patch
from coordinator.recording.reader import Recording, read_recording
from coordinator.recording.recorder import Recorder, RecordingInfo, new_mcap
from coordinator.recording.records import RecordingStarted
from swarm.model import Plan
from swarm.model.ids import COORDINATOR, OPERATOR
from swarm.protocol.events import CommonEvent, MessageReceived, PeerGone, PeerSeen, Tick
from swarm.protocol.messages import Body, CommandKind, MissionPhase, OperatorCommand, TaskEdit
from swarm.protocol.timing import Timing
from swarm.protocol.uav_messages import BaseStage, Candidate, Choice, ChoiceBasis, StatusPhase
from swarm.runtime.errors import InputError
from tests.support.builders import (
    IDLE,
    MISSION,
    OUT,
    PAUSED,
    brief,
    done,
    entry,
    epoch,
    failed,
    held,
    message,
    proposed,
    status,
    uav,
)

BEGIN_S = 100.0
TIMING = Timing(silence_s=1e6)


class Tape:
    """A recording made by hand, of a mission that begins at `BEGIN_S` of its clock."""

    def __init__(self, path: Path) -> None:
        self._path = path
        about = RecordingInfo(MISSION, TIMING)
        self._mcap = new_mcap(about)
        self._recorder = Recorder(about, self._mcap)
        self._counters: Counter[str] = Counter()
        self._recorder.note(RecordingStarted(), 0.0, 0)
        for name in (COORDINATOR, "u0", "u1"):
            self.happen(PeerSeen(name), -1.0)
        self.say(COORDINATOR, brief(uav("u0"), uav("u1")), -1.0)
        self.say(COORDINATOR, entry("t0", 10.0), -1.0)
        self.say(COORDINATOR, entry("t1", 20.0, number=1), -1.0)
        self.say("u0", IDLE, -0.5)
        self.say("u1", IDLE, -0.5)
        self.say(COORDINATOR, epoch("u0", "u1"), 0.0)

    def note(self, plan: Plan, mission_s: float) -> None:
        self._recorder.note(plan, BEGIN_S + mission_s, round((BEGIN_S + mission_s) * 1e9))

    def happen(self, fact: CommonEvent, mission_s: float) -> None:
        now_s = BEGIN_S + mission_s
        self._recorder.note(fact, now_s, round(now_s * 1e9))

    def say(self, writer: str, body: Body, mission_s: float) -> None:
        self._counters[writer] += 1
        self.happen(MessageReceived(message(writer, body, self._counters[writer])), mission_s)

    def lose(self, writer: str, mission_s: float) -> None:
        self.happen(PeerGone(writer), mission_s)
        self.happen(Tick(), mission_s + TIMING.loss_delay_s)

    def stop(self) -> Recording:
        patch = self._mcap.grow(last=True)
        assert isinstance(patch, Patch)
        self._path.write_bytes(patch.data)
        return read_recording(self._path)


@pytest.fixture
def tape(tmp_path: Path) -> Tape:
    return Tape(tmp_path / "tape.mcap")


def choice(task: str, left: str | None = None, *, certificate: bool = False) -> Choice:
    basis = ChoiceBasis(0.0, (0.0, 0.0, 0.0), 0.5, (), (), (), {}, 0)
    others = (Candidate(task, 8.0), Candidate("t1" if task == "t0" else "t0", 6.5))
    return Choice(1, task, left, 0.0, 1, "greedy", 0, 8.0, 6.5, certificate, 10.0, others, basis)


def texts(told: Explanation) -> list[str]:
    return [event.sentence for event in told.events]


def test_a_task_that_was_chosen_claimed_and_done(tape: Tape) -> None:
    tape.say("u0", proposed("t0", 0.0, completion_s=10.0), 0.0)
    tape.say("u0", choice("t0", certificate=True), 0.0)
    tape.say("u0", held("t0", 0.0, completion_s=10.0), 0.3)
    tape.say("u0", done("t0", 10.25), 10.25)
    tape.say("u0", IDLE, 10.25)
    told = explain_task(tape.stop(), "t0")

    assert texts(told) == [
        "Task t0 posted: value 1, 10 m east of the origin.",
        (
            "u0 chose t0 by the greedy rule of epoch 1, first in the sequence: score 8, against "
            "t1 (6.5); Theorem 5 proves that it was the best for this UAV."
        ),
        "u0 claimed t0, and set off; done at 10.0 s by its reckoning.",
        "Nobody with a better claim objected: u0 held t0.",
        "u0 ended t0: done at 10.2 s, 0.25 s later than it had said.",
    ]
    times_s = [event.mission_s for event in told.events]
    assert times_s[0] is None
    assert times_s[1:] == pytest.approx([0.0, 0.0, 0.3, 10.25])
    assert told.state == "done"
    assert told.worth == pytest.approx(1000.0 - 10.25)
    assert told.ending == (
        "So t0 was done by u0 at 10.2 s. That is worth 989.75 value·s, 100.0 % of J = 989.75."
    )


def test_a_task_that_the_plan_leaves_out_tells_why(tape: Tape) -> None:
    tape.say(COORDINATOR, epoch("u0", "u1", number=2, left_out={"energy": ("t1",)}), 3.0)

    explained = explain_task(tape.stop(), "t1")

    assert texts(explained)[-1] == (
        "Epoch 2 leaves out t1 (energy); energy: nobody has the energy for it beside the rest."
    )
    assert explained.ending == (
        "The plan leaves t1 out: nobody has the energy for it beside the rest. "
        "So t1 is still open as the recording ends, with nobody on the way to it."
    )


def test_a_uav_that_flies_to_a_base_tells_why(tape: Tape) -> None:
    to_base = replace(choice("t0"), task=None, candidates=(), completion_s=130.0, base="b0")
    stage = BaseStage.APPROACHING
    visits = replace(proposed("t0", 0.0), task=None, base="b0", stage=stage, arrives_s=10.0)
    tape.say("u0", visits, 0.0)
    tape.say("u0", to_base, 0.0)
    told = explain_uav(tape.stop(), "u0")

    assert texts(told)[-2:] == [
        (
            "u0 chose base b0 by the greedy rule of epoch 1, first in the sequence: its battery "
            "was enough for no task any more, and it is ready there before elsewhere; ready there "
            "at 130.0 s."
        ),
        "u0 flies to base b0 for another battery.",
    ]


def test_a_task_that_two_claim_goes_to_the_stronger_claim(tape: Tape) -> None:
    tape.say("u0", proposed("t0", 1.0, rank=0), 1.0)
    tape.say("u1", proposed("t0", 0.9, rank=1), 1.0)
    tape.say("u0", proposed("t1", 1.1, rank=0), 1.1)
    told = explain_task(tape.stop(), "t0")

    assert "Both u0 and u1 claimed t0: u1 keeps it, as it had decided earlier " in texts(told)[3]
    assert "(0.90 s against 1.00 s)" in texts(told)[3]
    assert texts(told)[4].startswith("u0 gave t0 up to u1: u1 keeps it, as it had decided earlier")
    assert told.ending == "So t0 is still open as the recording ends, with u1 on its way to it."


def test_a_task_of_a_lost_uav_is_taken_over(tape: Tape) -> None:
    tape.say("u0", held("t0", 0.0), 0.0)
    tape.lose("u0", 5.0)
    tape.say("u1", proposed("t0", 6.0, completion_s=15.0), 6.7)
    tape.say("u1", done("t0", 15.0), 15.0)
    recording = tape.stop()

    told = texts(explain_task(recording, "t0"))
    assert "u0 lost; task t0 is open again." in told
    assert (
        "u1 took over t0 from u0 1.50 s after its loss was noticed, and set off; done "
        "at 15.0 s by its reckoning."
    ) in told
    of_uav = explain_uav(recording, "u0")
    assert of_uav.state == "lost"
    assert of_uav.ending == "So u0 did no task, and was lost."


def test_turning_aside_is_the_reason_why_a_task_was_given_up(tape: Tape) -> None:
    tape.say("u0", held("t0", 0.0), 0.0)
    tape.say("u0", choice("t1", left="t0"), 3.0)
    tape.say("u0", proposed("t1", 3.0), 3.0)
    recording = tape.stop()

    assert "u0 gave t0 up: it had turned aside to t1." in texts(explain_task(recording, "t0"))
    assert any("turns aside from t0" in text for text in texts(explain_task(recording, "t1")))


def test_an_end_that_is_heard_of_after_the_next_claim_is_no_giving_up(tape: Tape) -> None:
    tape.say("u0", held("t0", 0.0, completion_s=9.0), 0.0)
    tape.say("u0", proposed("t1", 9.0), 9.0)
    tape.say("u0", done("t0", 9.0), 9.1)
    told = texts(explain_task(tape.stop(), "t0"))

    assert told[-1] == "u0 ended t0: done at 9.00 s, just when it had said."
    assert not any("gave" in text for text in told)


def test_the_operator_is_named_where_it_was_the_operator(tape: Tape) -> None:
    order = TaskEdit("extra", 2, (0.0, -5.0, 0.0), 3.0, 1.5, None, False, 1, "smoke seen")
    tape.say(OPERATOR, order, 4.0)
    tape.say("u0", held("extra", 5.0), 5.0)
    tape.say(OPERATOR, OperatorCommand("u0", CommandKind.HOLD, 1, "traffic"), 6.0)
    tape.say("u0", PAUSED, 6.1)
    gone = TaskEdit("extra", 2, (0.0, -5.0, 0.0), 3.0, 1.5, None, True, 1, "false alarm")
    tape.say(OPERATOR, gone, 8.0)
    recording = tape.stop()

    told = explain_task(recording, "extra")
    assert texts(told) == [
        "Operator adds task extra: smoke seen; value 3, 5 m south of the origin, service 1.50 s.",
        "u0 claimed extra, and set off; done at 1000 s by its reckoning.",
        "u0 gave extra up, told to hold.",
        "Operator withdraws extra: false alarm.",
    ]
    assert told.ending == "So extra was withdrawn, and is worth nothing."
    assert "Operator holds u0: traffic." in texts(explain_uav(recording, "u0"))


def test_what_the_operator_said_of_an_earlier_flight_is_no_part_of_the_story(tape: Tape) -> None:
    tape.say(OPERATOR, OperatorCommand("u0", CommandKind.HOLD, 0, "traffic"), 4.0)
    tape.say(OPERATOR, TaskEdit("t0", 0, (0.0, 0.0, 0.0), 1.0, 0.0, None, True, 0, ""), 5.0)
    recording = tape.stop()

    assert not any("perator" in text for text in texts(explain_uav(recording, "u0")))
    assert not any("perator" in text for text in texts(explain_task(recording, "t0")))


def test_an_end_that_is_restated_is_told_once(tape: Tape) -> None:
    for mission_s in (9.0, 10.0, 11.0):
        ended = epoch("u0", phase=MissionPhase.ENDED, number=2, reason="all over")
        tape.say(COORDINATOR, replace(ended, mission_s=mission_s), mission_s)

    assert texts(explain_uav(tape.stop(), "u0")).count("Mission ends: all over.") == 1


def test_a_failed_attempt_and_the_way_home_are_told(tape: Tape) -> None:
    tape.say("u0", held("t0", 0.0), 0.0)
    tape.say("u0", failed("t0", 9.0), 9.0)
    tape.say("u0", IDLE, 9.0)
    tape.say(COORDINATOR, epoch("u0", phase=MissionPhase.ENDED, number=2, reason="all over"), 9.5)
    tape.say("u0", OUT, 19.0)
    tape.say("u0", status(StatusPhase.HOME), 20.0)
    tape.happen(PeerGone("u0"), 21.0)
    tape.happen(Tick(), 22.0)
    recording = tape.stop()

    told = explain_task(recording, "t0")
    assert texts(told)[-1] == "u0 ended t0: failed at 9.00 s; that is the end of it."
    assert told.state == "failed"
    of_uav = explain_uav(recording, "u0")
    assert texts(of_uav)[-2:] == ["Mission ends: all over.", "u0 is home."]
    assert "failed at t0" in of_uav.ending


def test_tasks_that_were_preferred_are_named_and_soon_only_counted(tape: Tape) -> None:
    for number in range(6):
        tape.say("u0", replace(choice("t0"), number=number), float(number))
    told = texts(explain_task(tape.stop(), "t1"))

    assert told.count("u0 preferred t0 (score 8) to t1 (6.5).") == 3
    assert any(text.startswith("Other tasks were preferred to t1 ") for text in told)


def test_what_is_not_there_is_refused_with_what_is(tape: Tape) -> None:
    recording = tape.stop()

    with pytest.raises(InputError, match="has no such task; did you mean t1"):
        explain_task(recording, "t11")
    with pytest.raises(InputError, match="has no such uav; choose one of u0, u1"):
        explain_uav(recording, "nobody")


def test_how_near_others_came_is_told_where_it_happened(tape: Tape) -> None:
    """One flies to its task over another that hovers, and later waits far away."""
    tape.say("u0", held("t0", 0.0, completion_s=10.0), 0.3)
    for tick in range(60):
        mission_s = 0.5 + 0.2 * tick
        flown_m = min(40.0, 8.0 * mission_s) - 20.0
        for name, east_m, up_m in (("u0", flown_m, 40.0), ("u1", 0.0, 34.0)):
            body = replace(status(StatusPhase.FLYING, (east_m, 0.0, up_m)), mission_s=mission_s)
            tape.say(name, replace(body, layer_m=0.0), mission_s)
    tape.say("u0", done("t0", 11.0), 13.0)
    recording = tape.stop()

    told, of_task = explain_uav(recording, "u0", near_m=10.0), explain_task(recording, "t0", 10.0)

    said = [event for event in told.events if event.kind is EventKind.NEAR]
    assert [event.mission_s for event in said] == pytest.approx([2.5])
    assert said[0].text.startswith("u0 and u1 6.00 m apart, at the origin, 40 and 34 m up")
    assert said[0] in of_task.events
    assert [near.uavs for near in told.approaches] == [("u0", "u1")]
    kinds = [event.kind for event in of_task.events]
    assert kinds.index(EventKind.NEAR) < kinds.index(EventKind.DONE)
    assert explain_uav(recording, "u0", near_m=5.0).approaches == ()
    assert explain_task(recording, "t1", near_m=10.0).approaches == ()
