"""An operator adds and withdraws tasks in virtual time, whatever else goes wrong."""

from __future__ import annotations

from functools import partial

import pytest

from coordinator.operator.commands import RequestResult
from coordinator.operator.requests import OperatorClient, OperatorRequest
from coordinator.operator.task_edits import NewTask, TaskWithdrawal
from sim.faults.case import parse_case, play
from sim.world.network import IdealNetwork
from sim.world.settings import RestartMemory, WorldSettings
from sim.world.virtual_world import World
from swarm.model import Mission, Task, TaskId, Uav, UavId
from swarm.model.ids import COORDINATOR
from swarm.protocol.timing import Timing
from tests.support.fleet_builders import plan_for

MISSION = Mission(
    "test",
    1000.0,
    (Uav(UavId("u0"), (0.0, 0.0, 0.0), 4.0), Uav(UavId("u1"), (9.0, 0.0, 0.0), 4.0)),
    tuple(Task(TaskId(f"t{n}"), (20.0 * n, 50.0, 0.0), 1.0, service_s=5.0) for n in range(4)),
)
HERE = NewTask((30.0, 20.0, 0.0))
LIMIT_S = 2000.0


class Play:
    """Two UAVs and four tasks; what an operator wants, and when."""

    def __init__(self) -> None:
        setting = WorldSettings(lambda queue: IdealNetwork(queue, 0.02), kept=[COORDINATOR, "u0"])
        self.world = World(
            MISSION,
            plan_for,
            method="greedy",
            seed=0,
            timing=Timing(status_s=0.5),
            setting=setting,
        )
        self.seats: list[OperatorClient] = []

    def at(self, at_s: float, act: object) -> None:
        assert callable(act)
        self.world.queue.at(at_s, lambda: act() and None)

    def want(self, at_s: float, wish: OperatorRequest) -> None:
        self.at(at_s, lambda: self.seats.append(self.world.operate(wish)))

    def run(self) -> None:
        assert self.world.run(LIMIT_S)

    @property
    def done(self) -> set[str]:
        return set(self.world.mission_state.result().done)

    @property
    def results(self) -> list[RequestResult | None]:
        return [None if seat.verdict is None else seat.verdict.result for seat in self.seats]


EVERYTHING = {"t0", "t1", "t2", "t3", "op1"}


@pytest.mark.parametrize("coordinator_dies_s", [None, 10.0])
def test_an_added_task_is_done_with_and_without_a_coordinator(
    coordinator_dies_s: float | None,
) -> None:
    play = Play()
    if coordinator_dies_s is not None:
        play.at(coordinator_dies_s, partial(play.world.crash, COORDINATOR))
    play.want(15.0, HERE)
    play.run()

    assert (play.results, play.done) == ([RequestResult.OBEYED], EVERYTHING)
    assert play.world.mission_state.result().duplicate_visits == 0
    status = {} if coordinator_dies_s else {COORDINATOR: 0}
    assert play.world.finished == {"u0": 0, "u1": 0} | status


@pytest.mark.parametrize("coordinator_dies_s", [None, 5.0])
def test_a_task_withdrawn_in_flight_is_left_and_never_done(
    coordinator_dies_s: float | None,
) -> None:
    play = Play()
    if coordinator_dies_s is not None:
        play.at(coordinator_dies_s, partial(play.world.crash, COORDINATOR))
    flown: list[str | None] = []

    def withdraw() -> None:
        claim = play.world.agents["u0"].claim
        flown.append(None if claim is None else claim.task)
        play.seats.append(play.world.operate(TaskWithdrawal(str(flown[0]))))

    play.at(8.0, withdraw)
    play.run()

    assert flown[0] in EVERYTHING
    assert play.results == [RequestResult.OBEYED]
    assert play.done == EVERYTHING - {flown[0], "op1"}
    assert play.world.finished["u0"] == play.world.finished["u1"] == 0


@pytest.mark.parametrize("found", [RestartMemory.DISK, RestartMemory.NONE])
def test_a_coordinator_that_starts_anew_waits_for_what_was_added(found: RestartMemory) -> None:
    play = Play()
    play.want(15.0, HERE)
    play.at(16.0, partial(play.world.crash, COORDINATOR))
    play.at(18.0, partial(play.world.restart, COORDINATOR, found))
    play.run()

    assert (play.results, play.done) == ([RequestResult.OBEYED], EVERYTHING)
    assert play.world.finished == {COORDINATOR: 0, "u0": 0, "u1": 0}


@pytest.mark.parametrize("found", [RestartMemory.DISK, RestartMemory.NONE])
def test_an_agent_that_was_down_meanwhile_learns_of_it(found: RestartMemory) -> None:
    play = Play()
    play.at(5.0, partial(play.world.crash, COORDINATOR))
    play.at(14.0, partial(play.world.crash, "u0"))
    play.want(15.0, HERE)
    play.at(20.0, partial(play.world.restart, "u0", found))
    boards: list[set[str]] = []
    play.at(22.0, lambda: boards.append(set(play.world.agents["u0"].replica.board)))
    play.run()

    assert boards == [EVERYTHING]
    assert (play.results, play.done) == ([RequestResult.OBEYED], EVERYTHING)


SCHEDULES = {
    "added to one side of a partition": """
        fleet seed=5 uavs=4 tasks=8 popups=1 topology=mesh method=guided
        6 cut u0 u1 for 12
        8 add by 0.4
        9 retract t3
    """,
    "added while the coordinator is away at the end": """
        fleet seed=71219 uavs=4 tasks=11 popups=0 topology=router method=greedy
        4 add by 1
        12 retract t5
        29.8 unplug coordinator for 6
        32.3 add by 1
    """,
    "added while a coordinator begins that finds nobody at first": """
        fleet seed=70042 uavs=2 tasks=2 popups=0 topology=router method=greedy
        16 crash coordinator for 2 with none
        17 add by 0.5
    """,
    "added before a coordinator forgets all and its clock goes back": """
        fleet seed=82075 uavs=2 tasks=8 popups=0 topology=router method=greedy standby=yes
        12 add by 1
        18.7 crash coordinator for 0.2 with past
    """,
    "added before the start, and a pop-up withdrawn before it appears": """
        fleet seed=6 uavs=3 tasks=6 popups=2 topology=router method=greedy standby=yes
        0 add by 0.2
        0.5 retract t0
        9 lose coordinator
        12 add by 0.9
    """,
}


@pytest.mark.parametrize("what", SCHEDULES)
def test_what_must_hold_holds(what: str) -> None:
    lines = [line.strip() for line in SCHEDULES[what].strip().splitlines()]
    assert play(parse_case(lines, what)).broken is None
