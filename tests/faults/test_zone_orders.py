"""An operator draws zones and adds lines and tasks with limits in virtual time."""

from __future__ import annotations

from functools import partial

import pytest

from coordinator.operator.commands import RequestResult
from coordinator.operator.requests import OperatorClient, OperatorRequest
from coordinator.operator.task_edits import NewTask
from coordinator.operator.zone_edits import NewZone, ZoneRemoval
from sim.world.network import IdealNetwork
from sim.world.settings import WorldSettings
from sim.world.virtual_world import World
from swarm.model import Mission, Task, TaskId, Uav, UavId
from swarm.model.ids import COORDINATOR
from swarm.protocol.operator_commands import zones_in_force
from swarm.protocol.timing import Timing
from tests.support.fleet_builders import plan_for

MISSION = Mission(
    "test",
    1000.0,
    (Uav(UavId("u0"), (0.0, 0.0, 0.0), 4.0), Uav(UavId("u1"), (9.0, 0.0, 0.0), 4.0)),
    tuple(Task(TaskId(f"t{n}"), (20.0 * n, 50.0, 0.0), 1.0, service_s=5.0) for n in range(4)),
)
AWAY = NewZone("lake", ((200.0, 200.0), (210.0, 200.0), (210.0, 210.0)))
LIMIT_S = 2000.0


class FieldPlay:
    """Two UAVs and four tasks; what an operator wants, and when."""

    def __init__(self) -> None:
        setting = WorldSettings(lambda queue: IdealNetwork(queue, 0.02))
        timing = Timing(status_s=0.5)
        self.world = World(
            MISSION, plan_for, method="greedy", seed=0, timing=timing, setting=setting
        )
        self.seats: list[OperatorClient] = []

    def want(self, at_s: float, wish: OperatorRequest) -> None:
        self.world.queue.at(at_s, lambda: self.seats.append(self.world.operate(wish)))

    def crash(self, at_s: float, name: str) -> None:
        self.world.queue.at(at_s, partial(self.world.crash, name))

    def run(self) -> None:
        assert self.world.run(LIMIT_S)

    @property
    def results(self) -> list[RequestResult | None]:
        return [None if seat.verdict is None else seat.verdict.result for seat in self.seats]


@pytest.mark.parametrize("coordinator_dies_s", [None, 10.0])
def test_a_zone_is_known_to_everybody_until_it_is_taken_away(
    coordinator_dies_s: float | None,
) -> None:
    play = FieldPlay()
    if coordinator_dies_s is not None:
        play.crash(coordinator_dies_s, COORDINATOR)
    known: list[list[str]] = []

    def look() -> None:
        replicas = [agent.replica for agent in play.world.agents.values()]
        known.append([zone.id for replica in replicas for zone in zones_in_force(replica)])

    play.want(12.0, AWAY)
    play.world.queue.at(16.0, look)
    play.want(17.0, ZoneRemoval("lake"))
    play.world.queue.at(21.0, look)
    play.run()

    assert play.results == [RequestResult.OBEYED] * 2
    assert known == [["lake", "lake"], []]
    assert set(play.world.mission_state.result().done) == {"t0", "t1", "t2", "t3"}


@pytest.mark.parametrize("coordinator_dies_s", [None, 10.0])
def test_a_line_with_a_due_time_is_flown_before_it_and_worth_what_was_left(
    coordinator_dies_s: float | None,
) -> None:
    play = FieldPlay()
    if coordinator_dies_s is not None:
        play.crash(coordinator_dies_s, COORDINATOR)
    line = ((30.0, 20.0, 0.0), (60.0, 20.0, 0.0))
    play.want(15.0, NewTask(None, "ridge", 2.0, due_s=150.0, path=line))
    play.run()
    result = play.world.mission_state.result()

    assert play.results == [RequestResult.OBEYED]
    assert set(result.done) == {"t0", "t1", "t2", "t3", "ridge"}
    ended_s = result.executed_completion_s
    assert ended_s[TaskId("ridge")] <= 150.0
    worth = 2.0 * (150.0 - ended_s[TaskId("ridge")])
    worth += sum(1000.0 - ended_s[TaskId(f"t{n}")] for n in range(4))
    assert result.executed_objective == pytest.approx(worth)
