"""What somebody who only listens knows of the tasks that the plan leaves out."""

from __future__ import annotations

import pytest

from coordinator.mission_view.mission_state import MissionState
from coordinator.mission_view.scene import LEFT_OUT, TAKEN, scene_of
from coordinator.mission_view.story import EventKind
from swarm.model.ids import COORDINATOR
from swarm.protocol.events import Ask, MessageReceived, SnapshotsReceived
from swarm.protocol.messages import Body, MissionPhase, Snapshot
from swarm.protocol.timing import Timing
from tests.support.builders import (
    MISSION,
    brief_of,
    entries_of,
    epoch,
    held,
    message,
    mission,
    task,
    uav,
)
from tests.support.observed_mission import Teller


@pytest.fixture
def teller() -> Teller:
    """Two UAVs and four tasks, of which the first epoch leaves two out."""
    flown = mission([uav("u0"), uav("u1")], [task(f"t{n}", 10.0 * n) for n in range(4)])
    told = Teller(flown)
    told.say(COORDINATOR, brief_of(flown))
    told.begin()
    leave_out(told, energy=("t2",), due=("t3",))
    return told


def leave_out(teller: Teller, number: int = 1, **reasons: tuple[str, ...]) -> None:
    teller.say(COORDINATOR, epoch("u0", "u1", number=number, left_out=reasons), 1.0)


def told(teller: Teller) -> list[str]:
    story = teller.mission_state.story
    return [event.text for event in story if event.kind is EventKind.LEFT_OUT]


def test_open_tasks_that_the_epoch_leaves_out_are_known_with_the_reason(teller: Teller) -> None:
    scene = scene_of(teller.mission_state, 1.0)

    assert teller.mission_state.left_out == {"t2": "energy", "t3": "due"}
    assert scene.left_out == {"t2": "energy", "t3": "due"}
    assert [each.stands for each in scene.tasks] == ["open", "open", LEFT_OUT, LEFT_OUT]


def test_who_takes_one_after_all_takes_it_off_the_list(teller: Teller) -> None:
    teller.claim("u1", "t2", 20.0, 2.0)

    assert teller.mission_state.left_out == {"t3": "due"}
    assert scene_of(teller.mission_state, 2.0).tasks[2].stands == TAKEN

    teller.end("u1", "t2", 20.0)

    assert teller.mission_state.left_out == {"t3": "due"}


def test_a_task_that_is_withdrawn_is_left_out_no_more(teller: Teller) -> None:
    posted = teller.mission_state.mission.tasks[3]
    teller.post(posted, 3, withdrawn=True, now_s=3.0)

    assert teller.mission_state.left_out == {"t2": "energy"}


def test_another_epoch_says_anew_what_it_leaves_out(teller: Teller) -> None:
    leave_out(teller, 2, energy=("t1",))

    assert teller.mission_state.left_out == {"t1": "energy"}

    leave_out(teller, 2)

    assert teller.mission_state.left_out == {}


def test_the_story_tells_once_what_is_left_out(teller: Teller) -> None:
    leave_out(teller, energy=("t2",), due=("t3",))
    assert told(teller) == ["epoch 1 leaves out t2 (energy), t3 (due)"]

    leave_out(teller, 2, due=("t2", "t3"))
    assert told(teller)[1:] == ["epoch 2 leaves out t2 (due)"]
    assert teller.mission_state.story[-1].tasks == {"t2"}

    leave_out(teller, 2)
    assert len(told(teller)) == 2

    leave_out(teller, 2, window=tuple(f"x{n}" for n in range(7)))
    assert told(teller)[-1] == (
        "epoch 2 leaves out x0 (window), x1 (window), x2 (window), x3 (window), x4 (window) "
        "and 2 more"
    )


def test_a_reason_that_only_a_later_release_knows_is_told_as_it_is(teller: Teller) -> None:
    leave_out(teller, 2, weather=("t1",))

    assert teller.mission_state.story[-1].sentence == "Epoch 2 leaves out t1 (weather)."


def test_who_comes_late_is_told_what_is_left_out_by_now() -> None:
    flown = mission([uav("u0")], [task("t0", 10.0), task("t1", 20.0)])
    late = Teller(flown)
    said = epoch("u0", mission_s=50.0, left_out={"energy": ("t1",)})
    known = message(COORDINATOR, brief_of(flown), 1), message(COORDINATOR, said, 2)
    late.mission_state.step(
        SnapshotsReceived((Snapshot(MISSION, COORDINATOR, 1, 50.0, known),)), 100.0
    )

    assert late.mission_state.left_out == {"t1": "energy"}
    assert told(late) == ["epoch 1 leaves out t1 (energy)"]


def test_what_is_left_open_in_the_end_stays_left_out(teller: Teller) -> None:
    end = epoch("u0", "u1", number=3, phase=MissionPhase.ENDED, left_out={"energy": ("t2",)})
    teller.say(COORDINATOR, end, 30.0)

    assert teller.mission_state.left_out == {"t2": "energy"}
    assert len(told(teller)) == 1


def test_who_hears_of_a_task_that_it_does_not_know_asks_for_it() -> None:
    """As of one by an operator to whom it has no link."""
    flown = mission([uav("u0")], [task("t0", 10.0)])
    state = MissionState(flown, Timing())
    state.start(0.0)

    def wishes(body: Body, counter: int, now_s: float, writer: str = COORDINATOR) -> list[object]:
        said: list[object] = [*state.step(MessageReceived(message(writer, body, counter)), now_s)]
        if said == [Ask()]:
            state.step(SnapshotsReceived(()), now_s)
        return said

    assert wishes(brief_of(flown), 1, 10.0) == []
    state.step(SnapshotsReceived(()), 10.0)
    assert wishes(entries_of(flown)[0], 2, 10.0) == []
    assert wishes(epoch("u0"), 3, 10.0) == []
    assert wishes(epoch("u0", left_out={"energy": ("op1",)}), 4, 20.0) == [Ask()]
    assert wishes(held("op2", 20.0), 1, 30.0, "u0") == [Ask()]
    assert wishes(held("t0", 40.0), 2, 40.0, "u0") == []
