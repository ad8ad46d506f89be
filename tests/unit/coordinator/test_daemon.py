"""The coordinator's process: its core on a bus, plans made beside it."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass
from functools import partial

import pytest

from coordinator.core.active import CoordinatorCore
from coordinator.core.lifecycle import CoordinatorEvent, MakePlan, PlanMade
from coordinator.daemon import BackgroundPlanner, MissionPlanner, run_coordinator
from coordinator.planner.options import ShouldStop
from swarm.bus.port import BusEvent, Sample
from swarm.model import Mission, Plan, UavId
from swarm.model.ids import COORDINATOR
from swarm.model.layers import FlightLayers
from swarm.protocol.codec import Codec
from swarm.protocol.encoding import encode
from swarm.protocol.key_space import KeySpace
from swarm.protocol.messages import Body, Message, MissionPhase
from swarm.protocol.registers import Replica
from swarm.protocol.timing import Timing
from swarm.runtime.joining import join_mission
from tests.support.builders import IDLE, MISSION, OUT, done, held, message, mission, task, uav
from tests.support.memory_bus import MemoryBus, MemoryNetwork
from tests.support.shell_play import LIMIT_S, HandClock, play, take_until, until

KEYS = KeySpace(MISSION)
WHOLE = mission([uav("u0")], [task("t0", 1.0)])


class OwnError(Exception):
    """Stands for a bug."""


def planned(wanted: MakePlan, unwanted: ShouldStop) -> Plan:
    sequence = tuple(UavId(each.id) for each in wanted.mission.uavs)
    routes = dict.fromkeys(sequence, ())
    name = wanted.mission.name
    return Plan(name, wanted.method, routes, 0.0, {}, sequence, None, 1, 0.0, wanted.seed)


@dataclass(slots=True)
class Played:
    """A coordinator at work, and the seat of the fleet's one UAV."""

    core: CoordinatorCore
    running: asyncio.Task[int]
    clock: HandClock
    fleet: MemoryBus
    observer: MemoryBus

    def heard(self, said: Message) -> bool:
        return self.running.done() or said in self.core.replica.messages()

    async def phase(self, phase: MissionPhase) -> None:
        def reached() -> bool:
            epoch = self.core.replica.epoch
            return epoch is not None and epoch.phase is phase

        await until(reached, f"a mission that is {phase}")

    def say(self, *bodies: Body, counter: int = 1) -> None:
        for number, body in enumerate(bodies):
            said = message("u0", body, counter=counter + number)
            self.fleet.publish(said.key, encode(said))


@asynccontextmanager
async def at_work(
    make_plan: MissionPlanner = planned, flown: Mission = WHOLE
) -> AsyncIterator[Played]:
    """The coordinator of ``flown``, by one UAV."""
    network = MemoryNetwork()
    observer = network.join("onlooker")
    fleet, seat = network.join("u0"), network.join(COORDINATOR)
    join_mission(fleet, MISSION, "u0", status=False)
    core = CoordinatorCore(
        flown,
        method="greedy",
        seed=5,
        incarnation=1,
        timing=Timing(),
        start_timeout_s=60.0,
        layers=FlightLayers(),
    )
    clock = HandClock()
    running = asyncio.create_task(run_coordinator(core, flown, seat, clock, make_plan))
    try:
        yield Played(core, running, clock, fleet, observer)
    finally:
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)
        seat.close()
        fleet.close()


def test_brief_and_board_are_said_at_once() -> None:
    async def scenario() -> None:
        replica, codec = Replica(), Codec(MISSION)
        async with at_work() as played:

            def told(seen: Sequence[BusEvent]) -> bool:
                for event in seen:
                    if isinstance(event, Sample):
                        said = codec.decode(event.key, event.payload)
                        assert said is not None
                        replica.join(said)
                return replica.brief is not None and set(replica.board) == {"t0"}

            await take_until(played.fleet, told)

    play(scenario)


def test_the_planner_is_asked_for_the_mission_as_it_is_known_off_the_loops_thread() -> None:
    asked: list[tuple[Mission, str, int, bool]] = []

    def make_plan(wanted: MakePlan, unwanted: ShouldStop) -> Plan:
        on_loop = threading.current_thread() is threading.main_thread()
        asked.append((wanted.mission, wanted.method, wanted.seed, on_loop))
        return planned(wanted, unwanted)

    async def scenario() -> None:
        async with at_work(make_plan) as played:
            await until(lambda: played.core.plan is not None, "a plan")

    play(scenario)
    assert asked == [(WHOLE, "greedy", 5, False)]


def test_a_mission_is_flown_to_its_end() -> None:
    async def scenario() -> None:
        async with at_work() as played:
            await until(lambda: played.core.plan is not None, "a plan")
            played.say(IDLE)
            await played.phase(MissionPhase.RUNNING)
            played.say(done("t0"), OUT, counter=2)
            await played.phase(MissionPhase.ENDED)
            played.fleet.close()
            for counter in range(10):
                # The clock stands still between events: whatever is heard moves it on.
                played.clock.time_s += 0.5
                said = message("u1", OUT, counter=counter)
                played.observer.publish(said.key, encode(said))
                await until(partial(played.heard, said), "hearing the onlooker")
            assert await played.running == 0

    play(scenario)


def test_a_mission_that_cannot_be_planned_ends_with_the_reason() -> None:
    def make_plan(wanted: MakePlan, unwanted: ShouldStop) -> Plan:
        raise ValueError("no UAV can do it")

    async def scenario() -> None:
        async with at_work(make_plan) as played:
            await played.phase(MissionPhase.ENDED)
            epoch = played.core.replica.epoch
            assert epoch is not None
            assert "no UAV can do it" in epoch.reason

    play(scenario)


def test_a_bug_in_the_planner_ends_the_coordinator_with_it() -> None:
    def make_plan(wanted: MakePlan, unwanted: ShouldStop) -> Plan:
        raise OwnError

    async def scenario() -> None:
        async with at_work(make_plan) as played:
            with pytest.raises(OwnError):
                await asyncio.wait_for(played.running, LIMIT_S)

    play(scenario)


def test_a_plan_under_way_does_not_outlive_the_coordinator() -> None:
    begun, told, may_end = threading.Event(), threading.Event(), threading.Event()

    def make_plan(wanted: MakePlan, unwanted: ShouldStop) -> Plan:
        begun.set()
        while not (unwanted(0.0) or may_end.wait(0.01)):
            pass
        if unwanted(0.0):
            told.set()
        return planned(wanted, unwanted)

    async def scenario() -> None:
        async with at_work(make_plan) as played:
            await until(begun.is_set, "planning")
            played.running.cancel()
            with pytest.raises(asyncio.CancelledError):
                await played.running
            assert len(asyncio.all_tasks()) == 1
            await until(told.is_set, "the planner being told that nobody waits for its plan")
            may_end.set()

    play(scenario)


class PlansInTurn:
    """A planner whose plans end when they are told to, or let go, and who is told of them."""

    def __init__(self) -> None:
        self.begun: list[int] = []
        self.ended: list[int] = []
        self.most_at_once = 0
        self.told: list[CoordinatorEvent] = []
        self.faults: list[BaseException] = []
        self.may_end = threading.Event()
        self.noted: list[tuple[str, int]] = []
        self.planner = self.planning(self.plan, self.told.append)

    def planning(
        self, make_plan: MissionPlanner, told: Callable[[CoordinatorEvent], None]
    ) -> BackgroundPlanner:
        def note(fault: Exception, failed: int) -> None:
            self.noted.append((type(fault).__name__, failed))

        return BackgroundPlanner(make_plan, told, self.faults.append, note)

    def plan(self, wanted: MakePlan, unwanted: ShouldStop) -> Plan:
        self.begun.append(wanted.request)
        self.most_at_once = max(self.most_at_once, len(self.begun) - len(self.ended))
        while not (unwanted(0.0) or self.may_end.wait(0.001)):
            pass
        self.ended.append(wanted.request)
        return planned(wanted, unwanted)

    def begin(self, *requests: int) -> None:
        for request in requests:
            self.planner.begin(MakePlan(request, WHOLE, "greedy", 0, {}))

    @property
    def told_of(self) -> list[int]:
        return [event.request for event in self.told if isinstance(event, PlanMade)]


def test_a_superseded_plan_is_stopped_and_the_newest_begins_once_it_has_ended() -> None:
    plans = PlansInTurn()

    async def scenario() -> None:
        plans.begin(1)
        await until(lambda: plans.begun == [1], "the first plan")
        plans.begin(2, 3)
        await until(lambda: plans.begun == [1, 3], "the newest plan")
        plans.may_end.set()
        await until(lambda: plans.told_of == [3], "what comes of it")
        await plans.planner.close()

    play(scenario)
    assert plans.most_at_once == 1
    assert (plans.ended, plans.told_of, plans.faults) == ([1, 3], [3], [])


def test_a_plan_may_be_wanted_by_who_is_told_of_another() -> None:
    plans = PlansInTurn()
    plans.may_end.set()
    tell = plans.told.append

    def told(event: CoordinatorEvent) -> None:
        tell(event)
        if len(plans.told) == 1:
            plans.begin(2)

    async def scenario() -> None:
        plans.planner = plans.planning(plans.plan, told)
        plans.begin(1)
        await until(lambda: plans.told_of == [1, 2], "both plans")

    play(scenario)


def test_nobody_is_told_of_a_plan_that_was_given_up_and_closing_waits_for_its_end() -> None:
    plans = PlansInTurn()

    async def scenario() -> None:
        plans.begin(1)
        await until(lambda: plans.begun == [1], "the plan")
        plans.planner.cancel()
        await plans.planner.close()
        assert plans.ended == [1]
        plans.begin(2)
        await until(lambda: plans.begun == [1, 2], "a plan that is wanted again")
        await plans.planner.close()

    play(scenario)
    assert (plans.ended, plans.told) == ([1, 2], [])


def test_faults_in_plans_that_nobody_wants_any_more_are_noted_and_end_nothing() -> None:
    plans = PlansInTurn()

    def fails_sooner(wanted: MakePlan, unwanted: ShouldStop) -> Plan:
        plan = plans.plan(wanted, unwanted)
        if wanted.request < 3:
            raise OwnError
        return plan

    async def scenario() -> None:
        plans.planner = plans.planning(fails_sooner, plans.told.append)
        plans.begin(1)
        await until(lambda: plans.begun == [1], "the first plan")
        plans.begin(2)
        await until(lambda: plans.begun == [1, 2], "the second plan")
        plans.begin(3)
        await until(lambda: plans.begun == [1, 2, 3], "the newest plan")
        plans.may_end.set()
        await until(lambda: plans.told_of == [3], "what comes of it")
        await plans.planner.close()

    play(scenario)
    assert plans.faults == []
    assert plans.noted == [("OwnError", 1), ("OwnError", 2)]


def test_a_running_mission_is_planned_anew_beside_the_loop() -> None:
    tasks = [task("t0", 1.0), task("t1", 2.0, appears_s=4.0)]

    async def scenario() -> None:
        async with at_work(flown=mission([uav("u0")], tasks)) as played:
            await until(lambda: played.core.plan is not None, "a plan")
            # Whatever is planned becomes an epoch.
            played.core._mission.replan_policy._margin_frac = -1.0
            played.say(IDLE)
            await played.phase(MissionPhase.RUNNING)
            played.clock.time_s += 6.0
            played.say(held("t0", 0.0, completion_s=9.0), counter=2)

            def planned_anew() -> bool:
                epoch = played.core.replica.epoch
                return epoch is not None and epoch.number == 2

            await until(planned_anew, "another epoch")
            epoch = played.core.replica.epoch
            assert epoch is not None
            assert epoch.routes == {"u0": ("t0", "t1")}

    play(scenario)


def test_queries_are_answered_with_brief_and_board() -> None:
    async def scenario() -> None:
        async with at_work() as played:
            await until(lambda: played.core.plan is not None, "a plan")
            (answer,) = await played.fleet.query(KEYS.state("*"), timeout_s=LIMIT_S)

            snapshot = Codec(MISSION).decode_snapshot(answer.key, answer.payload)
            assert snapshot == played.core.snapshot(0.0)
            assert len(snapshot.messages) == 2

    play(scenario)
