"""One agent's core with everybody else played by the test."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import TypeVar

from agent.core.agent_core import IMPOSSIBLE, AgentCore
from agent.core.interface import (
    Action,
    Arrived,
    Event,
    GoTo,
    OrderVehicle,
    Swap,
    Telemetry,
    VehicleOrder,
    VehicleReady,
)
from agent.core.verticals import Verticals
from swarm.model import Uav
from swarm.model.ids import COORDINATOR
from swarm.protocol.events import (
    Finish,
    LogLine,
    MessageReceived,
    PeerGone,
    PeerSeen,
    Publish,
    PublishLast,
    SnapshotsReceived,
    Tick,
)
from swarm.protocol.fields import Point
from swarm.protocol.messages import Body, Message, MissionPhase, Snapshot, TaskEntry
from swarm.protocol.timing import Timing
from swarm.protocol.uav_messages import Claim, ClaimPhase, Outcome, Status
from tests.support.builders import IDLE, MISSION, brief, epoch, message

T = TypeVar("T")

TIMING = Timing(announce_s=1e6, silence_s=2e6, pause_s=1e6)
"""Nothing gets lost on the way, so nothing need be said twice; and the process never hangs."""
START_S = 100.0
"""The agent's clock when its process begins."""
ZERO_S = 200.0
"""The agent's clock at mission time 0."""
ABOVE_START = (0.0, 0.0, 10.0)
"""Where `u0` starts, in its layer: unless in a hurry, it flies there before it returns."""


class LoneAgent:
    """The agent of ``uavs[0]``; its clock, bus and vehicle are the test."""

    def __init__(
        self,
        *uavs: Uav,
        timing: Timing = TIMING,
        incarnation: int = 5,
        reattempt_failed: bool = False,
        now_s: float = START_S,
        memory: Snapshot | None = None,
        memory_age_s: float = 0.0,
        rejoin: bool = False,
        without_bus_s: float | None = None,
        verticals: Verticals | None = None,
        shows_stations: bool = False,
    ) -> None:
        self.uavs = uavs
        self.me = uavs[0].id
        self.core = AgentCore(
            MISSION,
            self.me,
            incarnation,
            timing,
            memory,
            memory_age_s,
            rejoin=rejoin,
            without_bus_s=without_bus_s,
            verticals=verticals,
            shows_stations=shows_stations,
        )
        self.timing = timing
        self.now_s = now_s
        self.brief = brief(*uavs, reattempt_failed=reattempt_failed)
        self.log: list[Action] = []
        """Every action so far."""
        self.choices: list[Message] = []
        """What it said of its choices."""
        self._counters: Counter[str] = Counter()
        self._there: set[str] = set()
        self._do(self.core.start(self.now_s))

    def reborn(
        self, *, down_s: float = 2.0, remembers: bool = False, rejoin: bool = False
    ) -> LoneAgent:
        """The next life of this agent, which has learned nothing from others yet.

        Args:
            down_s: how long there was no process.
            remembers: whether it finds what this life kept last.
            rejoin: whether it is to take part at any rate.
        """
        memory = self.core.memory(self.now_s + down_s)
        agent = LoneAgent(
            *self.uavs,
            timing=self.timing,
            incarnation=memory.incarnation + 1,
            now_s=self.now_s + down_s,
            memory=memory if remembers else None,
            memory_age_s=down_s,
            rejoin=rejoin,
        )
        agent.brief, agent._counters = self.brief, self._counters
        return agent

    def learn_what_was_known_to(self, earlier: LoneAgent) -> list[Action]:
        """Others answer, who had heard everything that life of this agent said and heard."""
        memory = earlier.core.memory(self.now_s)
        return self.learn(*memory.messages, mission_s=memory.mission_s)

    # -- what happens ------------------------------------------------------------------

    def happen(self, event: Event, mission_s: float | None = None) -> list[Action]:
        """Step the core, at that mission time if one is given; gives the actions."""
        if mission_s is not None:
            assert ZERO_S + mission_s >= self.now_s, "time never goes back"
            self.now_s = ZERO_S + mission_s
        if isinstance(event, PeerSeen):
            self._there.add(event.writer)
        elif isinstance(event, PeerGone):
            self._there.discard(event.writer)
        return self._do(self.core.step(event, self.now_s))

    def tick(self, mission_s: float | None = None) -> list[Action]:
        return self.happen(Tick(), mission_s)

    def tick_when_due(self) -> list[Action]:
        """Let time go on to the next deadline."""
        due_s = self.core.next_deadline_s()
        assert due_s is not None
        self.now_s = max(self.now_s, due_s)
        return self.happen(Tick())

    def run_until(self, mission_s: float) -> list[Action]:
        """Tick at every deadline up to then; gives all actions."""
        actions: list[Action] = []
        spins = 0
        while (due_s := self.core.next_deadline_s()) is not None and due_s < ZERO_S + mission_s:
            spins = spins + 1 if due_s <= self.now_s else 0
            assert spins < 5, f"it spins at {self.now_s} s, due since {due_s} s"
            actions += self.tick_when_due()
        return actions + self.tick(mission_s)

    def statement(self, writer: str, body: Body) -> Message:
        """The next statement of ``writer``."""
        self._counters[writer] += 1
        return message(writer, body, self._counters[writer])

    def coordinators(self, *bodies: Body) -> list[Message]:
        """The next statements of the coordinator."""
        return [self.statement(COORDINATOR, body) for body in bodies]

    def hear(self, writer: str, body: Body, mission_s: float | None = None) -> list[Action]:
        return self.happen(MessageReceived(self.statement(writer, body)), mission_s)

    def see(self, *writers: str) -> list[Action]:
        return [action for w in writers for action in self.happen(PeerSeen(w))]

    def lose(self, writer: str, mission_s: float) -> list[Action]:
        """The token of ``writer`` goes at that time, and does not come back."""
        before = self.happen(PeerGone(writer), mission_s)
        return before + self.tick(mission_s + self.timing.loss_delay_s)

    def learn(self, *messages: Message, mission_s: float | None = None) -> list[Action]:
        """Everyone who is there answers the agent's question; one of them has something to tell."""
        answers = [Snapshot(MISSION, "other", 1, mission_s, messages)]
        answers += [Snapshot(MISSION, writer, 1, None, ()) for writer in sorted(self._there)]
        return self.happen(SnapshotsReceived(tuple(answers)))

    def learn_from_nobody(self) -> list[Action]:
        """Nobody answers."""
        return self.happen(SnapshotsReceived(()))

    def post(self, *entries: TaskEntry) -> list[Action]:
        return [action for e in entries for action in self.hear(COORDINATOR, e)]

    def fly_to(self, *entries: TaskEntry) -> None:
        """Learn, get airborne with everybody else present and idle."""
        self.see(COORDINATOR, *(uav.id for uav in self.uavs[1:]))
        self.learn(self.statement(COORDINATOR, self.brief))
        self.post(*entries)
        self.happen(VehicleReady())
        for uav in self.uavs[1:]:
            self.hear(uav.id, IDLE)

    def start_mission(self, *sequence: str) -> list[Action]:
        """Mission time 0."""
        return self.hear(COORDINATOR, epoch(*(sequence or [u.id for u in self.uavs])), 0.0)

    def end_mission(self, mission_s: float) -> list[Action]:
        ended = epoch(*(u.id for u in self.uavs), phase=MissionPhase.ENDED, reason="over", number=2)
        return self.hear(COORDINATOR, ended, mission_s)

    def arrive(self, mission_s: float) -> list[Action]:
        """The vehicle reports to be where it was last sent."""
        return self.happen(Arrived(self.leg), mission_s)

    def be_at(
        self,
        position_enu_m: Point,
        battery_frac: float | None = 0.5,
        mission_s: float | None = None,
    ) -> list[Action]:
        """Telemetry from that place, height layer included."""
        return self.happen(Telemetry(position_enu_m, (0.0, 0.0, 0.0), battery_frac), mission_s)

    # -- what came of it ---------------------------------------------------------------

    @property
    def leg(self) -> int:
        flights = [order.leg for order in orders(self.log) if isinstance(order, GoTo | Swap)]
        return flights[-1]

    @property
    def claim(self) -> Claim | None:
        """The newest claim it has said."""
        said = claims(self.log)
        return said[-1] if said else None

    @property
    def task(self) -> str | None:
        claim = self.claim
        return None if claim is None else claim.task

    @property
    def phase(self) -> ClaimPhase | None:
        claim = self.claim
        return None if claim is None else claim.phase

    def _do(self, actions: Sequence[Action]) -> list[Action]:
        assert IMPOSSIBLE not in notes(actions)
        self.log += actions
        self.choices += [action.make() for action in actions if isinstance(action, PublishLast)]
        return list(actions)


def orders(actions: Sequence[Action]) -> list[VehicleOrder]:
    return [action.order for action in actions if isinstance(action, OrderVehicle)]


def said(actions: Sequence[Action], kind: type[T]) -> list[T]:
    """Bodies of that kind that were published."""
    bodies = [action.message.body for action in actions if isinstance(action, Publish)]
    return [body for body in bodies if isinstance(body, kind)]


def claims(actions: Sequence[Action]) -> list[Claim]:
    return said(actions, Claim)


def outcomes(actions: Sequence[Action]) -> list[Outcome]:
    return said(actions, Outcome)


def finishes(actions: Sequence[Action]) -> list[int]:
    return [action.status for action in actions if isinstance(action, Finish)]


def statuses(actions: Sequence[Action]) -> list[Status]:
    return said(actions, Status)


def notes(actions: Sequence[Action]) -> list[str]:
    return [action.text for action in actions if isinstance(action, LogLine)]
