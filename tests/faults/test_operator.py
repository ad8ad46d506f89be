"""An operator stops, resumes and sends home single UAVs, or aborts, whatever else goes wrong."""

from __future__ import annotations

from functools import partial

import pytest

from coordinator.operator.commands import RequestResult
from coordinator.operator.requests import OperatorClient
from sim.faults.case import CaseResult, parse_case, play
from sim.world.engine import EventQueue
from sim.world.network import IdealNetwork, NetworkConditions, Topology
from sim.world.rough_network import RoughNetwork
from sim.world.settings import RestartMemory, WorldSettings
from sim.world.virtual_world import World
from swarm.model import Mission, Task, TaskId, Uav, UavId
from swarm.model.ids import COORDINATOR
from swarm.protocol.messages import CommandKind, MissionPhase
from swarm.protocol.timing import Timing
from tests.support.fleet_builders import plan_for

HOLD, RESUME, RETURN, ABORT = CommandKind
TIMING = Timing(status_s=0.5)
MISSION = Mission(
    "test",
    1000.0,
    (Uav(UavId("u0"), (0.0, 0.0, 0.0), 4.0), Uav(UavId("u1"), (9.0, 0.0, 0.0), 4.0)),
    tuple(Task(TaskId(f"t{n}"), (20.0 * n, 50.0, 0.0), 1.0, service_s=5.0) for n in range(8)),
)
LIMIT_S = 2000.0


class Play:
    """Two UAVs and eight tasks; the coordinator dies at 10 s, unless told otherwise."""

    def __init__(self, *, coordinator_dies: bool = True) -> None:
        setting = WorldSettings(lambda queue: IdealNetwork(queue, 0.02), kept=[COORDINATOR, "u0"])
        self.world = World(
            MISSION, plan_for, method="greedy", seed=0, timing=TIMING, setting=setting
        )
        self.seats: list[OperatorClient] = []
        if coordinator_dies:
            self.at(10.0, partial(self.world.crash, COORDINATOR))

    def at(self, at_s: float, act: object) -> None:
        assert callable(act)
        self.world.queue.at(at_s, lambda: act() and None)

    def say(self, at_s: float, kind: CommandKind, *uav: str) -> None:
        self.at(at_s, lambda: self.seats.append(self.world.command(kind, *uav)))

    def done(self, uav: str) -> set[str]:
        return set(self.world.mission_state.result().executed_routes[UavId(uav)])

    def story(self) -> str:
        return "\n".join(line.text for line in self.world.mission_state.story)

    @property
    def results(self) -> list[RequestResult | None]:
        return [None if seat.verdict is None else seat.verdict.result for seat in self.seats]


def test_without_a_coordinator_a_held_uav_waits_and_then_takes_part_again() -> None:
    play = Play()
    play.say(15.0, HOLD, "u0")
    play.say(45.0, RESUME, "u0")
    assert play.world.run(LIMIT_S)

    assert play.results == [RequestResult.OBEYED, RequestResult.OBEYED]
    assert play.world.mission_state.result().open == ()
    assert play.world.finished == {"u0": 0, "u1": 0}
    assert "operator holds u0" in play.story()
    assert "operator lets u0 go on" in play.story()


def test_the_others_do_what_a_uav_leaves_that_was_sent_home() -> None:
    play = Play()
    play.say(15.0, RETURN, "u0")
    assert play.world.run(LIMIT_S)

    assert play.results == [RequestResult.OBEYED]
    assert len(play.done("u0")) <= 1
    assert play.world.mission_state.result().open == ()
    assert play.world.finished == {"u0": 0, "u1": 0}


@pytest.mark.parametrize("coordinator_dies", [False, True])
def test_an_abort_brings_everyone_home_and_nothing_more_is_done(*, coordinator_dies: bool) -> None:
    play = Play(coordinator_dies=coordinator_dies)
    play.say(15.0, ABORT)
    done: list[set[str]] = []
    play.at(16.0, lambda: done.append(play.done("u0") | play.done("u1")))
    assert play.world.run(LIMIT_S)

    assert play.results == [RequestResult.OBEYED]
    assert done == [play.done("u0") | play.done("u1")]
    assert play.world.queue.now_s() < 100.0
    assert {play.world.finished["u0"], play.world.finished["u1"]} == {0}
    if not coordinator_dies:
        epoch = play.world.mission_state.replica.epoch
        assert epoch is not None
        assert (epoch.phase, epoch.reason) == (MissionPhase.ENDED, "aborted by the operator")
        assert play.world.finished[COORDINATOR] == 1


@pytest.mark.parametrize("found", [RestartMemory.DISK, RestartMemory.NONE])
def test_an_agent_that_was_down_meanwhile_stays_held(found: RestartMemory) -> None:
    play = Play()
    play.at(14.0, partial(play.world.crash, "u0"))
    play.say(15.0, HOLD, "u0")
    play.at(20.0, partial(play.world.restart, "u0", found))
    play.say(60.0, RESUME, "u0")
    done: list[set[str]] = []
    play.at(14.0, lambda: done.append(play.done("u0")))
    play.at(60.0, lambda: done.append(play.done("u0")))
    assert play.world.run(LIMIT_S)

    assert done[0] == done[1], "it takes no task before it may"
    assert play.results == [RequestResult.OBEYED, RequestResult.OBEYED]
    assert play.world.finished == {"u0": 0, "u1": 0}


def test_an_agent_that_was_down_meanwhile_comes_home_from_an_aborted_mission() -> None:
    play = Play(coordinator_dies=False)
    play.at(14.0, partial(play.world.crash, "u0"))
    play.say(15.0, ABORT)
    play.at(16.5, partial(play.world.restart, "u0", RestartMemory.NONE))
    assert play.world.run(LIMIT_S)

    assert play.world.finished == {COORDINATOR: 1, "u0": 0, "u1": 0}
    assert play.results == [RequestResult.OBEYED]
    assert play.done("u0") | play.done("u1") < {task.id for task in MISSION.tasks}


def test_a_coordinator_that_starts_again_after_an_abort_begins_no_other_flight() -> None:
    play = Play(coordinator_dies=False)
    play.say(15.0, ABORT)
    play.at(15.5, partial(play.world.crash, COORDINATOR))
    play.at(17.0, partial(play.world.restart, COORDINATOR, RestartMemory.DISK))
    assert play.world.run(LIMIT_S)

    assert play.world.finished == {COORDINATOR: 1, "u0": 0, "u1": 0}
    assert play.world.mission_state.result().epochs == 1
    assert play.world.queue.now_s() < 100.0


def test_commands_to_nobody_and_to_nobody_known_are_told() -> None:
    play = Play()
    play.at(12.0, partial(play.world.lose, "u1"))
    play.say(15.0, HOLD, "u1")
    play.say(15.0, HOLD, "u7")
    assert play.world.run(LIMIT_S)

    assert play.results == [RequestResult.NOT_OBEYED, RequestResult.UNKNOWN_UAV]
    texts = [seat.verdict.text for seat in play.seats if seat.verdict is not None]
    assert texts[0].startswith("nobody flies u1")
    assert texts[1] == "the fleet is u0, u1"


SCHEDULES = {
    "abort while part of the fleet is cut off": """
        fleet seed=7 uavs=4 tasks=12 popups=0 topology=routers method=greedy
        4 lose coordinator
        6 cut u0 u1 for 15
        10 abort
    """,
    "hold who is cut off, and let it go on": """
        fleet seed=8 uavs=3 tasks=12 popups=2 topology=mesh method=guided
        4 lose coordinator
        6 cut u0 for 9
        8 hold u0 for 12
    """,
    "return who hangs": """
        fleet seed=9 uavs=3 tasks=12 popups=0 topology=router method=greedy
        6 hang u0 for 12
        8 return u0
    """,
    "hold who starts anew, on a poor network": """
        fleet seed=10 uavs=3 tasks=12 popups=0 topology=mesh method=guided
        5 weather by 0.4 for 25
        6 crash u0 for 6 with none
        8 hold u0 for 15
        9 hold u1 for 3
    """,
    "hold before take-off while the coordinator starts anew": """
        fleet seed=11 uavs=3 tasks=12 popups=0 topology=router method=greedy standby=yes
        0 hold u0 for 20
        0 crash coordinator for 3 with disk
    """,
    "abort when the coordinator has just died and another one stands by": """
        fleet seed=12 uavs=3 tasks=12 popups=0 topology=router method=greedy standby=yes
        8 lose coordinator
        8.1 abort
    """,
    "a command at the moment at which the own link is down": """
        fleet seed=424 uavs=2 tasks=4 popups=0 topology=router method=greedy
        18 return u1
        20 crash u0 for 7 with disk
        34 hold u0 for 0.1
    """,
}


def played(what: str) -> CaseResult:
    lines = [line.strip() for line in SCHEDULES[what].strip().splitlines()]
    return play(parse_case(lines, what))


@pytest.mark.parametrize("what", SCHEDULES)
def test_what_must_hold_holds(what: str) -> None:
    assert played(what).broken is None


def test_part_of_a_fleet_that_was_cut_off_learns_of_the_abort_when_it_is_back() -> None:
    world = played("abort while part of the fleet is cut off").world

    assert [world.finished.get(f"u{n}") for n in range(4)] == [0, 0, 0, 0]
    assert world.queue.now_s() < 60.0
    assert world.mission_state.result().open != ()


def test_one_that_stands_by_ends_a_mission_that_was_aborted_meanwhile() -> None:
    world = played("abort when the coordinator has just died and another one stands by").world

    assert world.finished["standby"] == 1
    assert COORDINATOR not in world.finished
    epoch = world.mission_state.replica.epoch
    assert epoch is not None
    assert (epoch.phase, epoch.reason) == (MissionPhase.ENDED, "aborted by the operator")


def test_agents_without_the_bus_for_too_long_come_home_and_the_others_do_the_rest() -> None:
    networks: list[RoughNetwork] = []

    def network(queue: EventQueue) -> RoughNetwork:
        networks.append(RoughNetwork(queue, NetworkConditions(Topology.ROUTER), 3))
        return networks[0]

    setting = WorldSettings(network, without_bus_s=15.0)
    world = World(MISSION, plan_for, method="greedy", seed=0, timing=TIMING, setting=setting)
    world.queue.at(10.0, lambda: networks[0].unplug("u0"))
    world.queue.at(60.0, lambda: networks[0].plug("u0"))
    assert world.run(LIMIT_S)

    assert world.finished == {COORDINATOR: 0, "u0": 0, "u1": 0}
    assert len(world.mission_state.result().executed_routes[UavId("u0")]) < 4
    assert world.mission_state.result().open == ()
