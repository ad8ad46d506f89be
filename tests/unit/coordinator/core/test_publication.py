"""When the coordinator tells the fleet of tasks."""

from __future__ import annotations

from coordinator.core.publication import RegisterAnnouncer
from swarm.model.layers import FlightLayers
from swarm.protocol.events import LogLine, Publish
from swarm.protocol.messages import TaskEntry
from swarm.protocol.registers import Replica
from swarm.protocol.timing import Timing
from tests.support.builders import mission, task, uav

TASKS = [
    task("t0", 1.0),
    task("late", 1.0, appears_s=20.0),
    task("t2", 1.0, appears_s=10.0),
    task("t3", 1.0, appears_s=10.0),
    task("t4", 1.0),
]


def posted(actions: list[Publish | LogLine]) -> list[tuple[str, int]]:
    said = [action.message.body for action in actions if isinstance(action, Publish)]
    return [(body.task, body.number) for body in said if isinstance(body, TaskEntry)]


def test_tasks_are_posted_when_they_appear_in_the_order_of_the_mission_and_once() -> None:
    flown = mission([uav("u0")], TASKS)
    announcer = RegisterAnnouncer(flown, FlightLayers(), 1, Replica(), Timing())

    assert posted(announcer.post(5.0)) == [("t0", 0), ("t4", 4)]
    assert posted(announcer.post(1000.0)) == []  # mission time does not run yet
    assert announcer.next_release_s() is None

    announcer.set_zero(100.0)
    assert announcer.next_release_s() == 110.0
    assert posted(announcer.post(109.9)) == []
    assert posted(announcer.post(110.0)) == [("t2", 2), ("t3", 3)]
    assert announcer.more_to_come
    assert announcer.next_release_s() == 120.0
    assert posted(announcer.post(500.0)) == [("late", 1)]
    assert not announcer.more_to_come
    assert announcer.next_release_s() is None
