"""Whatever happens: no exception, no busy loop, statements that never go back."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from agent.core.agent_core import IMPOSSIBLE, AgentCore
from agent.core.interface import (
    Action,
    Arrived,
    Event,
    GoTo,
    HandedOver,
    Home,
    NotReady,
    OrderVehicle,
    Refused,
    Telemetry,
    VehicleOrder,
    VehicleReady,
)
from agent.core.states import AT_BASE, VISITS_BASE, AgentState
from swarm.model.ids import COORDINATOR, FLEET, OPERATOR
from swarm.protocol.codec import Codec
from swarm.protocol.encoding import encode
from swarm.protocol.events import (
    Finish,
    LinkChanged,
    LogLine,
    MessageReceived,
    PeerGone,
    PeerSeen,
    Publish,
    SnapshotsReceived,
    Stop,
    Tick,
)
from swarm.protocol.messages import (
    Body,
    CommandKind,
    MissionPhase,
    OperatorCommand,
    Snapshot,
    Stamp,
)
from swarm.protocol.timing import Timing
from swarm.protocol.uav_messages import ClaimPhase
from tests.support.builders import (
    IDLE,
    MISSION,
    OUT,
    brief,
    done,
    entry,
    epoch,
    failed,
    held,
    message,
    proposed,
    uav,
)

OTHERS = ["u1", "u2"]
WRITERS = [COORDINATOR, *OTHERS]
TASKS = ["t0", "t1", "t2"]
BRIEF = brief(uav("u0", t2=0.0), uav("u1"), uav("u2", t0=0.0))
TIMING = Timing()


class Storm:
    """Random events for one agent, and what must hold after each."""

    brief = BRIEF

    def __init__(self, seed: int) -> None:
        self.rng = np.random.default_rng(seed)
        self.now_s = 50.0
        self.finished = False
        self.counter = 0
        memory = self.answer("u0") if self.rng.random() < 0.3 else None
        age_s = float(self.pick(1.0, 1e3))
        without_bus_s = self.pick(None, None, None, 5.0)
        self.core = AgentCore(MISSION, "u0", 1, TIMING, memory, age_s, without_bus_s=without_bus_s)
        self.ordered: list[VehicleOrder] = []
        self.stamps: dict[str, Stamp] = {}
        self.codec = Codec(MISSION)
        self.take(self.core.start(self.now_s))

    def pick(self, *choices: Any) -> Any:
        return choices[int(self.rng.integers(len(choices)))]

    def blow(self) -> None:
        """One random event, or time goes on to the next deadline."""
        due_s = self.core.next_deadline_s()
        if self.rng.random() < 0.4 and due_s is not None:
            self.now_s = max(self.now_s, due_s)
            self.step(Tick())
        else:
            self.now_s += float(self.pick(0.0, 0.0, self.rng.exponential(0.3)))
            self.step(self.event())
        self.let_time_go_on()

    def let_time_go_on(self) -> None:
        """A core that is ticked at its deadline must move the deadline on."""
        now_s = self.now_s
        for _ in range(5):
            due_s = self.core.next_deadline_s()
            if due_s is None or due_s > now_s:
                return
            self.step(Tick())
        raise AssertionError(f"still due at {due_s} at {now_s}, {self.core.phase}")

    def step(self, event: Event) -> None:
        self.take(self.core.step(event, self.now_s))

    def take(self, actions: list[Action]) -> None:
        assert not (self.finished and actions), "it had finished"
        for action in actions:
            if isinstance(action, OrderVehicle):
                self.ordered.append(action.order)
            elif isinstance(action, Finish):
                self.finished = True
            elif isinstance(action, LogLine):
                assert action.text != IMPOSSIBLE, action.fields
            elif isinstance(action, Publish):
                said = action.message
                assert self.codec.decode(said.key, encode(said)) == said
                before = self.stamps.get(said.key, said.stamp)
                assert said.stamp >= before, "it went back"
                self.stamps[said.key] = said.stamp
        claim = self.core.claim
        if claim is not None and self.core.phase in ("flying", "serving"):
            assert claim.phase in (ClaimPhase.PROPOSED, ClaimPhase.HELD)
        if self.core.phase == "holding" and self.ordered:
            assert not isinstance(self.ordered[-1], GoTo), "it flies on"

    def event(self) -> Event:
        makers: list[Callable[[], Event]] = [
            lambda: self.heard(self.pick(*OTHERS), self.uav_body()),
            lambda: self.heard(COORDINATOR, self.coordinator_body()),
            lambda: PeerSeen(self.pick(*WRITERS)),
            lambda: PeerGone(self.pick(*WRITERS)),
            lambda: LinkChanged(bool(self.rng.random() < 0.7)),
            self.learned,
            self.learned,
            self.report,
            self.report,
        ]
        if self.rng.random() < 0.03:
            return self.command()
        if self.rng.random() < 0.01:
            return self.pick(Stop("told"), self.echo())  # type: ignore[no-any-return]  # events
        event: Event = self.pick(*makers)()
        return event

    def heard(self, writer: str, body: Body) -> MessageReceived:
        self.counter += 1
        stale = int(self.rng.integers(0, 3))
        return MessageReceived(message(writer, body, max(1, self.counter - stale)))

    def uav_body(self) -> Body:
        task, at_s = self.pick(*TASKS), float(self.rng.uniform(-1.0, 20.0))
        rank, until_s = int(self.rng.integers(0, 3)), at_s + float(self.rng.uniform(0.0, 9.0))
        body: Body = self.pick(
            proposed(task, at_s, rank, until_s),
            held(task, at_s, rank, until_s),
            IDLE,
            OUT,
            done(task, at_s),
            failed(task, at_s),
        )
        return body

    def coordinator_body(self) -> Body:
        number = int(self.rng.integers(0, 3))
        posted = entry(
            f"t{number}",
            east_m=float(self.rng.uniform(0.0, 9.0)),
            number=number,
            service_s=float(self.pick(0.0, 0.5)),
            withdrawn=bool(self.rng.random() < 0.2),
        )
        sequence = [str(u) for u in self.rng.permutation(["u0", *OTHERS])]
        phase = self.pick(*[MissionPhase.RUNNING] * 60, MissionPhase.PREPARING, MissionPhase.ENDED)
        rule = self.pick("greedy", "lookahead")
        body: Body = self.pick(self.brief, posted, posted, epoch(*sequence, phase=phase, rule=rule))
        return body

    def command(self) -> MessageReceived:
        """The operator speaks, and seldom means the end."""
        kinds = [CommandKind.HOLD, CommandKind.RESUME, CommandKind.RESUME] * 9
        kind = self.pick(*kinds, CommandKind.RETURN, CommandKind.ABORT)
        target = FLEET if kind is CommandKind.ABORT else self.pick("u0", *OTHERS)
        return self.heard(OPERATOR, OperatorCommand(target, kind, self.brief.run, ""))

    def learned(self) -> SnapshotsReceived:
        answers = [self.answer(writer) for writer in WRITERS]
        if self.rng.random() < 0.005:
            answers.append(self.answer("u0"))
        return SnapshotsReceived(self.pick((), tuple(answers), tuple(answers)))

    def answer(self, writer: str) -> Snapshot:
        said = [self.heard(COORDINATOR, self.coordinator_body()).message]
        said += [self.heard(uav, self.uav_body()).message for uav in OTHERS]
        if self.rng.random() < 0.1:
            said.append(self.echo().message)
        mission_s = self.pick(None, float(self.rng.uniform(0.0, 9.0)))
        return Snapshot(MISSION, writer, int(self.rng.integers(1, 4)), mission_s, tuple(said))

    def echo(self) -> MessageReceived:
        """Something in its own name."""
        counter, incarnation = int(self.rng.integers(1, 99)), int(self.rng.integers(0, 3))
        return MessageReceived(message("u0", self.uav_body(), counter, incarnation))

    def report(self) -> Event:
        legs = [order.leg for order in self.ordered if isinstance(order, GoTo)] or [0]
        place = tuple(float(x) for x in self.rng.uniform(0.0, 9.0, 3))
        choices: list[Event] = [
            VehicleReady(),
            VehicleReady(),
            NotReady("no position"),
            Arrived(legs[-1]),
            Arrived(legs[-1]),
            Arrived(legs[0]),
            Telemetry((place[0], place[1], place[2]), (0.0, 0.0, 0.0), None),
        ]
        if self.rng.random() < 0.1:
            choices += [HandedOver("pilot"), Home()]
            choices += [Refused(order, "no") for order in self.ordered[-1:]]
        event: Event = self.pick(*choices)
        return event


def test_no_storm_of_events_raises_or_leaves_a_deadline_behind_and_all_reach_every_state() -> None:
    unreached = set(AgentState) - VISITS_BASE - AT_BASE  # see test_core_field_storms
    for seed in range(160):
        storm = Storm(seed)
        for _ in range(150):
            storm.blow()
            unreached.discard(storm.core.state)
    assert unreached == set(), "else the storms would prove little"


def test_in_the_quiet_it_wakes_only_for_status_and_repetition() -> None:
    storm = Storm(0)
    storm.step(PeerSeen(COORDINATOR))
    known = (message(COORDINATOR, BRIEF), message(COORDINATOR, entry("t2"), 2))
    storm.step(SnapshotsReceived((Snapshot(MISSION, COORDINATOR, 1, None, known),)))
    storm.step(VehicleReady())
    storm.step(MessageReceived(message(COORDINATOR, epoch("u0"), 9)))
    begin_s, wakes = storm.now_s, 0
    while storm.now_s < begin_s + 60.0:
        due_s = storm.core.next_deadline_s()
        assert due_s is not None
        assert due_s > storm.now_s
        storm.now_s = due_s
        storm.step(Tick())
        wakes += 1
    assert wakes <= 60.0 / TIMING.status_s + 60.0 / TIMING.announce_s + 2
