"""Whole fleets in virtual time whose vehicles are the real bridge and a simulated autopilot.

Every step of every bridge is watched (tests.support.bridge_watch), and all that it is told, sends
and reports is written down. Leaves out: what is to come of a flight.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from agent.core.agent_core import AgentCore
from agent.core.interface import (
    Arrived,
    HandedOver,
    HandOverExplained,
    Refused,
    ReturnAdvised,
    Telemetry,
    VehicleOrder,
    VehicleReport,
)
from agent.vehicle.activity import FlightPhase
from agent.vehicle.bridge import Bridge
from agent.vehicle.config import BridgeConfig, CommandStyle
from agent.vehicle.conversation import BridgeAction, SendBytes
from agent.vehicle.session import BridgeEvent, BytesReceived, LinkOpened, TimePassed
from coordinator.operator.requests import OperatorClient
from sim.autopilot.config import VehicleConfig
from sim.autopilot.faults import VehicleFault, parse_fault
from sim.autopilot.firmware import FirmwareModelName
from sim.world.bridged_vehicle import BridgedVehicle, Equipment, LinkQuality
from sim.world.engine import EventQueue
from sim.world.network import IdealNetwork, Network
from sim.world.settings import Planner, WorldListener, WorldSettings
from sim.world.virtual_world import World
from swarm.model import Mission, Task, TaskId, Uav, UavId
from swarm.model.frames import DEFAULT_ORIGIN
from swarm.model.ids import COORDINATOR
from swarm.protocol.messages import CommandKind
from swarm.protocol.timing import Timing
from swarm.protocol.uav_messages import StatusPhase
from tests.support.bridge_watch import BridgeWatch
from tests.support.fake_copter import ASK, INTERVAL, FakeCopter
from tests.support.fake_px4 import FakePx4
from tests.support.fleet_builders import plan_for

KINDS = [(flavour, style) for flavour in FirmwareModelName for style in CommandStyle]
_ALIKE = [
    (FirmwareModelName.ARDUPILOT, CommandStyle.REPOSITION),
    (FirmwareModelName.PX4, CommandStyle.MISSION),
]


def _by_day(day: Collection[tuple[FirmwareModelName, CommandStyle]]) -> pytest.MarkDecorator:
    night = pytest.mark.slow
    cases = [
        pytest.param(*kind, marks=[] if kind in day else [night], id=f"{kind[0]}-{kind[1]}")
        for kind in KINDS
    ]
    return pytest.mark.parametrize(("flavour", "style"), cases)


ONE_DIAGONAL = _by_day(_ALIKE)
"""Every firmware and every style by day, all that they make together at night."""
OTHER_DIAGONAL = _by_day([kind for kind in KINDS if kind not in _ALIKE])
"""The same with the other two by day: for every second test, so that each day flies all four."""


def long_flight(flavour: FirmwareModelName, style: CommandStyle) -> pytest.MarkDecorator:
    """That pair alone by day: for flights of many minutes, of which others fly the other pairs."""
    return _by_day([(flavour, style)])


LIMIT_S = 400.0
_WITH_REASON = HandedOver | HandOverExplained | Refused | ReturnAdvised
FIELD = Mission(
    "field",
    600.0,
    tuple(Uav(UavId(f"u{n}"), (12.0 * n, 0.0, 0.0), 10.0) for n in range(3)),
    tuple(
        Task(TaskId(f"t{n}"), (-40.0 + 16.0 * n, 60.0 + 25.0 * (n % 3), 0.0), 1.0, service_s=1.0)
        for n in range(7)
    ),
)
"""Three UAVs side by side and seven tasks before them, each within 12 s of every start."""
_FAKES: dict[FirmwareModelName, type[FakeCopter]] = {
    FirmwareModelName.ARDUPILOT: FakeCopter,
    FirmwareModelName.PX4: FakePx4,
}


@dataclass(frozen=True, slots=True)
class Sent:
    """One message of a bridge."""

    at_s: float
    life: int
    """Of the agent, from 1 on."""
    phase: FlightPhase
    """After the step in which it was sent."""
    message: Any

    @property
    def name(self) -> str:
        """The message's type."""
        name: str = self.message.get_type()
        return name

    @property
    def harmless(self) -> bool:
        """Whether it commands nothing: a heartbeat, a request for messages, the old jerk."""
        asks = self.name == "COMMAND_LONG" and self.message.command in (ASK, INTERVAL)
        return asks or self.name == "HEARTBEAT" or self._puts_jerk_back

    @property
    def _puts_jerk_back(self) -> bool:
        """`BridgeWatch` sees that it is not raised."""
        names = {name for fake in _FAKES.values() for name in fake.jerk_names}
        return self.name == "PARAM_SET" and self.message.param_id in names


@dataclass(slots=True)
class Logbook:
    """What one UAV's bridges were told, sent and reported, in order."""

    ordered: list[tuple[float, VehicleOrder]] = field(default_factory=list)
    sent: list[Sent] = field(default_factory=list)
    reported: list[tuple[float, VehicleReport]] = field(default_factory=list)
    """All but telemetry."""
    lives: int = 0

    def reasons(self, kind: type) -> list[str]:
        """Why the vehicle was handed over, refused an order, or was advised to return."""
        return [
            report.reason
            for _, report in self.reported
            if isinstance(report, kind) and isinstance(report, _WITH_REASON)
        ]

    def first_s(self, kind: type) -> float:
        """When a report of that kind came first."""
        return next(at_s for at_s, report in self.reported if isinstance(report, kind))

    def arrivals(self) -> int:
        """Legs that were flown to their end."""
        return sum(isinstance(report, Arrived) for _, report in self.reported)

    def commands_after(self, at_s: float) -> list[str]:
        """What was commanded later than that, one line each."""
        return [
            f"{each.at_s:.2f} {each.message}"
            for each in self.sent
            if each.at_s > at_s and not each.harmless
        ]


class _Watched:
    """The bridge of one life of an agent."""

    def __init__(
        self,
        config: BridgeConfig,
        fake: type[FakeCopter],
        book: Logbook,
        tell: Callable[[Sent | VehicleReport], None],
    ) -> None:
        book.lives += 1
        self.bridge = Bridge(config)
        self._watch = BridgeWatch(self.bridge, fake)
        self._book = book
        self._tell = tell
        self._life = book.lives
        self._parser = mavlink.MAVLink(None)

    def step(self, event: BridgeEvent, now_s: float) -> list[BridgeAction]:
        book = self._book
        if not isinstance(event, BytesReceived | TimePassed | LinkOpened):
            assert isinstance(event, VehicleOrder)
            book.ordered.append((now_s, event))
        actions = self._watch.step(event, now_s)
        for action in actions:
            if isinstance(action, SendBytes):
                for message in self._parser.parse_buffer(action.data) or ():
                    sent = Sent(now_s, self._life, self.bridge.phase, message)
                    book.sent.append(sent)
                    self._tell(sent)
            elif not isinstance(action, Telemetry):
                book.reported.append((now_s, action))
                self._tell(action)
        return actions

    def next_deadline_s(self) -> float:
        return self.bridge.next_deadline_s()


Change = Callable[[Equipment], Equipment]


class BridgedFleet:
    """A mission that is going to be flown.

    Args:
        flavour: of every autopilot.
        style: how every bridge commands.
        faults: of autopilots, by UAV; as in ``--fault``, without the UAV's name.
        change: what else is special about the equipment of a UAV.
        mission: the scenario.
        seed: of the planner and of lost frames.
        link: of every UAV.
        plan: makes the plan.
        network: joins the agents; an ideal one if None.
        watch: is told all that happens on the bus.
        timing: of agents and coordinator.
        agent: makes the core of an agent.
    """

    def __init__(
        self,
        flavour: FirmwareModelName,
        style: CommandStyle,
        *,
        faults: Mapping[str, str] | None = None,
        change: Mapping[str, Change] | None = None,
        mission: Mission = FIELD,
        seed: int = 0,
        link: LinkQuality | None = None,
        plan: Planner = plan_for,
        network: Callable[[EventQueue], Network] | None = None,
        watch: WorldListener | None = None,
        timing: Timing | None = None,
        agent: Callable[..., AgentCore] = AgentCore,
    ) -> None:
        self.flavour, self.style = flavour, style
        self.vehicles: dict[str, BridgedVehicle] = {}
        self.books = {str(uav.id): Logbook() for uav in mission.uavs}
        self.seats: list[OperatorClient] = []
        self.on_said: Callable[[str, Sent | VehicleReport], None] = lambda _uav, _said: None
        """Is told of every message of a bridge before it is on the link, and of every report."""
        self._faults = {uav: fault(text) for uav, text in (faults or {}).items()}
        self._change = change or {}
        self._mission = mission
        self._seed = seed
        self._link = link or LinkQuality()
        self.world = World(
            mission,
            plan,
            method="greedy",
            seed=seed,
            timing=timing or Timing(status_s=1.0),
            setting=WorldSettings(
                network or (lambda queue: IdealNetwork(queue, 0.02)),
                kept=[*self.books, COORDINATOR],
                vehicle=self._vehicle,
                agent=agent,
            ),
            watch=watch,
        )

    def at(self, at_s: float, act: Callable[[], object]) -> None:
        """Do that at a virtual time."""

        def do() -> None:
            act()

        self.world.queue.at(at_s, do)

    def say(self, at_s: float, kind: CommandKind, *uav: str) -> None:
        """Let an operator say that."""
        self.at(at_s, lambda: self.seats.append(self.world.command(kind, *uav)))

    def fly(self, limit_s: float = LIMIT_S) -> BridgedFleet:
        """Fly the mission to its end."""
        assert self.world.run(limit_s), "\n".join(self.told())
        return self

    def told(self) -> Iterator[str]:
        """How it stands, for a test that fails."""
        yield f"at {self.world.queue.now_s():.1f} s, open: {self.world.mission_state.result().open}"
        for uav, agent in self.world.agents.items():
            book = self.books[uav]
            yield f"{uav} is {agent.phase}: {self.note(uav)}; {book.ordered[-3:]}"
            yield f"    {book.reported[-5:]}"

    # What came of it.

    def done_by(self, uav: str) -> tuple[str, ...]:
        """Tasks that it did."""
        return tuple(self.world.mission_state.result().executed_routes[UavId(uav)])

    def note(self, uav: str) -> str:
        """The last words of a UAV about itself."""
        status = self.world.mission_state.statuses.get(uav)
        return "" if status is None else status.note

    def phase(self, uav: str) -> StatusPhase:
        """What a UAV last said that it does."""
        return self.world.mission_state.statuses[uav].phase

    def assert_all_done(self, *, without: Collection[str] = ()) -> None:
        """Every task is done once, by none of those, and every process has ended well."""
        result, world = self.world.mission_state.result(), self.world
        told = "\n".join(self.told())
        assert sorted(result.done) == sorted(task.id for task in self._mission.tasks), told
        assert (result.failed, result.open, result.lost_uavs) == ((), (), ()), told
        assert [uav for uav in without if self.done_by(uav)] == [], told
        assert set(world.finished.values()) == {0}, told

    def assert_left_alone_after(self, uav: str, kind: type) -> None:
        """Nothing was commanded any more after that report, in whatever life."""
        book = self.books[uav]
        assert book.commands_after(book.first_s(kind)) == []

    # Pieces.

    def _vehicle(
        self, queue: EventQueue, uav: str, report: Callable[[VehicleReport], None]
    ) -> BridgedVehicle:
        number, book, fake = list(self.books).index(uav), self.books[uav], _FAKES[self.flavour]
        start = self._mission.uavs[number]
        origin = self._mission.origin or DEFAULT_ORIGIN
        equipment = Equipment(
            VehicleConfig(
                number + 1,
                start.position_enu_m,
                origin,
                start.speed_m_s,
                land_m_s=6.0,  # lest flights take most of their time to come down
            ),
            BridgeConfig(number + 1, origin, self.style, position_rate_hz=5.0),
            self.flavour,
            self._faults.get(uav, ()),
            self._link,
        )
        if uav in self._change:
            equipment = self._change[uav](equipment)
        made = BridgedVehicle(
            queue,
            uav,
            report,
            equipment,
            self._seed,
            lambda config: _Watched(config, fake, book, lambda said: self.on_said(uav, said)),
        )
        self.vehicles[uav] = made
        return made


def fault(text: str) -> tuple[VehicleFault, ...]:
    """Faults in the words of ``--fault``, separated by blanks, without the UAV."""
    return tuple(parse_fault(f"u:{each}")[1] for each in text.split())


def fenced(radius_m: float) -> Change:
    """A bridge that keeps its vehicle that near to the origin."""
    return lambda eq: replace(eq, bridge=replace(eq.bridge, fence_radius_m=radius_m))
