"""The agent's process: a seat on the bus, a vehicle that obeys, and an end in order."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass, field

import pytest

from agent import runner
from agent.core.agent_core import AgentCore
from agent.core.interface import (
    Action,
    Event,
    Hold,
    Home,
    NotReady,
    Prepare,
    Return,
    ReturnBegun,
    VehicleOrder,
    VehicleReady,
    VehicleReport,
)
from agent.core.station_words import AnswerStation, StationAction, StationAsked, StationWish
from agent.runner import run_agent
from swarm.bus.port import BusEvent, Sample, TokenGone, TokenSeen
from swarm.model import Origin
from swarm.model.ids import COORDINATOR
from swarm.protocol.codec import Codec
from swarm.protocol.encoding import encode
from swarm.protocol.events import Stop
from swarm.protocol.key_space import KeySpace
from swarm.protocol.messages import Message, MissionConfig, MissionPhase, Snapshot
from swarm.protocol.timing import Timing
from swarm.runtime.joining import join_mission
from swarm.runtime.process import StopRequest
from tests.support.builders import IDLE, MISSION, brief, epoch, message, uav
from tests.support.memory_bus import MemoryBus, MemoryNetwork
from tests.support.shell_play import HandClock, play, take_until, until

KEYS = KeySpace(MISSION)
BRIEF = message(COORDINATOR, brief(uav("u0", east_m=3.0, speed_m_s=2.0), layer_m=10.0), counter=1)
ENDED = message(COORDINATOR, epoch("u0", phase=MissionPhase.ENDED), counter=2)
INTERRUPTED = 130


class OwnError(Exception):
    """Stands for a bug."""


@dataclass(slots=True)
class FakeVehicle:
    """Does at once what it is told, unless its link is broken or it stays away."""

    origin: Origin
    report: Callable[[VehicleReport | StationAsked], None]
    broken: bool = False
    stays_away: bool = False
    orders: list[VehicleOrder] = field(default_factory=list)
    closed: int = 0
    dropped: dict[str, int] = field(default_factory=dict)
    told: list[StationAction] = field(default_factory=list)
    """To ground stations."""

    async def start(self) -> None:
        await asyncio.sleep(0)
        if self.broken:
            raise OwnError

    def order(self, order: VehicleOrder) -> None:
        self.orders.append(order)
        if isinstance(order, Prepare):
            self.report(VehicleReady())
        if isinstance(order, Return) and not self.stays_away:
            self.report(Home())

    def tell_stations(self, action: StationAction) -> None:
        self.told.append(action)

    async def close(self) -> None:
        self.closed += 1


@dataclass(slots=True)
class Played:
    """One agent at work, and the seat from which it is watched."""

    core: AgentCore
    running: asyncio.Task[int]
    stop: StopRequest
    seat: MemoryBus
    coordinator: MemoryBus
    vehicles: list[FakeVehicle]
    clock: HandClock

    def say(self, *said: Message) -> None:
        for each in said:
            self.coordinator.publish(each.key, encode(each))

    async def seated(self) -> None:
        token = TokenSeen(KEYS.alive("u0"))
        await take_until(self.coordinator, lambda seen: token in seen)

    async def briefed(self) -> None:
        """Heard of the mission, and asked everyone for more."""
        await self.seated()
        self.say(BRIEF)
        await until(lambda: self.core.replica.brief is not None, "hearing the brief")
        self.clock.time_s += 0.5
        self.say(BRIEF)

    async def airborne(self) -> FakeVehicle:
        await self.briefed()
        await until(lambda: self.core.claim is not None, "getting airborne")
        return self.vehicles[0]


@asynccontextmanager
async def at_work(
    *,
    broken: bool = False,
    stays_away: bool = False,
    memory: Snapshot | None = None,
    save: Callable[[Snapshot], None] | None = None,
) -> AsyncIterator[Played]:
    """The agent of u0, whose vehicle is a `FakeVehicle`."""
    network = MemoryNetwork()
    watching, seat = network.join("watching"), network.join("u0")
    join_mission(watching, MISSION, None, status=True)
    core = AgentCore(MISSION, "u0", 1, Timing(), memory)
    stop, vehicles, clock = StopRequest(), list[FakeVehicle](), HandClock()

    def make_vehicle(
        told: MissionConfig, report: Callable[[VehicleReport | StationAsked], None]
    ) -> FakeVehicle:
        vehicles.append(FakeVehicle(Origin(*told.origin), report, broken, stays_away))
        return vehicles[-1]

    agent = run_agent(core, MISSION, seat, clock, make_vehicle, stop, save=save)
    running = asyncio.create_task(agent)
    try:
        yield Played(core, running, stop, seat, watching, vehicles, clock)
    finally:
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)
        seat.close()
        watching.close()


def test_the_vehicle_is_made_at_the_missions_origin_and_prepared_at_its_start() -> None:
    async def scenario() -> None:
        async with at_work() as played:
            vehicle = await played.airborne()

            assert vehicle.origin == Origin(47.0, 8.0, 400.0)
            assert vehicle.orders == [Prepare((3.0, 0.0, 10.0), 2.0, ground_up_m=0.0)]
            assert len(played.vehicles) == 1

    play(scenario)


def test_what_the_vehicle_reports_leads_to_what_is_said() -> None:
    codec = Codec(MISSION)

    async def scenario() -> None:
        async with at_work() as played:
            await played.airborne()

            def free(seen: Sequence[BusEvent]) -> bool:
                samples = [event for event in seen if isinstance(event, Sample)]
                said = [codec.decode(sample.key, sample.payload) for sample in samples]
                return any(each is not None and each.body == IDLE for each in said)

            await take_until(played.coordinator, free)

    play(scenario)


def test_what_a_ground_station_asks_for_is_answered_to_it() -> None:
    async def scenario() -> None:
        async with at_work() as played:
            vehicle = await played.airborne()
            vehicle.report(StationAsked(7, StationWish.HOLD))

            answers = [told for told in vehicle.told if isinstance(told, AnswerStation)]
            assert [answer.number for answer in answers] == [7]
            assert isinstance(vehicle.orders[-1], Hold)

    play(scenario)


def test_an_ended_mission_brings_the_vehicle_home_and_ends_the_agent() -> None:
    async def scenario() -> None:
        async with at_work() as played:
            vehicle = await played.airborne()
            played.say(ENDED)

            assert await played.running == 0
            assert isinstance(vehicle.orders[-1], Return)
            assert vehicle.closed == 1

    play(scenario)


def test_an_agent_shows_that_it_is_there_until_its_seat_is_closed() -> None:
    async def scenario() -> None:
        token = KEYS.alive("u0")
        async with at_work() as played:
            await played.seated()
            played.stop.request(0)
            await played.running
            assert TokenGone(token) not in played.coordinator.inbox.take()
            played.seat.close()
            assert TokenGone(token) in played.coordinator.inbox.take()

    play(scenario)


def test_told_to_stop_it_brings_the_vehicle_home_first() -> None:
    async def scenario() -> None:
        async with at_work() as played:
            vehicle = await played.airborne()
            played.stop.request(INTERRUPTED)

            assert await played.running == INTERRUPTED
            assert isinstance(vehicle.orders[-1], Return)
            assert vehicle.closed == 1

    play(scenario)


def test_told_to_stop_it_leaves_once_the_vehicle_is_seen_to_return() -> None:
    async def scenario() -> None:
        async with at_work(stays_away=True) as played:
            vehicle = await played.airborne()
            played.stop.request(0)
            await until(lambda: isinstance(vehicle.orders[-1], Return), "ordering the return")
            for _ in range(100):
                await asyncio.sleep(0)
            assert not played.running.done()
            assert vehicle.closed == 0

            vehicle.report(ReturnBegun())
            assert await played.running == 0
            assert vehicle.closed == 1

    play(scenario)


def test_told_to_stop_while_the_vehicle_returns_it_leaves_at_once() -> None:
    async def scenario() -> None:
        async with at_work(stays_away=True) as played:
            vehicle = await played.airborne()
            played.say(ENDED)
            await until(lambda: isinstance(vehicle.orders[-1], Return), "ordering the return")
            vehicle.report(ReturnBegun())
            played.stop.request(0)
            assert await played.running == 0

    play(scenario)


def test_told_to_stop_it_does_not_wait_for_ever(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runner, "FAREWELL_S", 0.01)

    async def scenario() -> None:
        async with at_work(stays_away=True) as played:
            vehicle = await played.airborne()
            played.stop.request(0)

            assert await played.running == 0
            assert isinstance(vehicle.orders[-1], Return)
            assert vehicle.closed == 1

    play(scenario)


@pytest.mark.parametrize("at_once", [True, False])
def test_told_to_stop_before_it_knows_the_mission_it_just_leaves(at_once: bool) -> None:
    async def scenario() -> None:
        async with at_work() as played:
            if not at_once:
                await played.seated()
            played.stop.request(0)

            assert await played.running == 0
            assert played.vehicles == []

    play(scenario)


def test_what_the_agent_knows_is_kept_for_its_next_life() -> None:
    async def scenario() -> None:
        kept: list[Snapshot] = []
        async with at_work(save=kept.append) as played:
            await played.airborne()

            assert BRIEF in kept[0].messages
            assert IDLE in [message.body for message in kept[-1].messages]

    play(scenario)


def test_a_vehicle_that_an_earlier_life_left_in_the_air_is_brought_home() -> None:
    running = message(COORDINATOR, epoch("u0"), counter=2)
    idle = message("u0", IDLE)
    memory = Snapshot(MISSION, "u0", 1, 5.0, (BRIEF, running, idle))

    async def scenario() -> None:
        async with at_work(memory=memory) as played:
            await played.seated()
            played.say(BRIEF)
            played.stop.request(0)
            await played.running

            (vehicle,) = played.vehicles
            assert [type(order) for order in vehicle.orders][-1] is Return

    play(scenario)


def test_a_vehicle_that_cannot_be_reached_ends_the_agent_with_the_reason() -> None:
    async def scenario() -> None:
        async with at_work(broken=True) as played:
            await played.briefed()
            with pytest.raises(OwnError):
                await played.running
            assert played.vehicles[0].closed == 1

    play(scenario)


def break_core(played: Played, monkeypatch: pytest.MonkeyPatch, on: type[Event]) -> None:
    """Let the core fail at events of that kind."""
    step = played.core.step

    def fail(event: Event, now_s: float) -> Sequence[Action]:
        if isinstance(event, on):
            raise OwnError
        return step(event, now_s)

    monkeypatch.setattr(played.core, "step", fail)


def test_a_bug_in_the_core_ends_the_agent_and_closes_the_vehicle(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async def scenario() -> None:
        async with at_work() as played:
            vehicle = await played.airborne()
            break_core(played, monkeypatch, NotReady)
            vehicle.report(NotReady("a reason"))
            with pytest.raises(OwnError):
                await played.running
            assert vehicle.closed == 1

    play(scenario)


def test_a_bug_while_leaving_is_not_hidden(monkeypatch: pytest.MonkeyPatch) -> None:
    async def scenario() -> None:
        async with at_work() as played:
            vehicle = await played.airborne()
            break_core(played, monkeypatch, Stop)
            played.stop.request(0)
            with pytest.raises(OwnError):
                await played.running
            assert vehicle.closed == 1

    play(scenario)


def test_reports_that_come_after_the_end_do_no_harm() -> None:
    async def scenario() -> None:
        async with at_work() as played:
            vehicle = await played.airborne()
            played.say(ENDED)
            await played.running
            vehicle.report(VehicleReady())

    play(scenario)


def test_the_core_is_told_what_was_dropped() -> None:
    async def scenario() -> None:
        async with at_work() as played:
            vehicle = await played.airborne()
            played.coordinator.publish(KEYS.plan, b"nonsense")
            played.coordinator.publish(KEYS.claim("u1"), b"nonsense")
            said = message("u1", IDLE)
            played.say(said)
            await until(lambda: played.core.replica.known(said) == said, "hearing u1")
            vehicle.dropped["unsigned"] = 3

            assert played.core.dropped() == {"malformed": 2, "unsigned": 3}
            played.core.replica.overfull = 4
            assert played.core.dropped() == {"malformed": 2, "unsigned": 3, "no room": 4}

    play(scenario)
