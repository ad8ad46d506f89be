"""An observer of one small mission, told by the test what happens."""

from __future__ import annotations

from collections import Counter

from coordinator.mission_view.mission_state import MissionState
from swarm.model import Mission
from swarm.model.ids import COORDINATOR
from swarm.protocol.events import (
    Ask,
    CommonAction,
    CommonEvent,
    MessageReceived,
    PeerGone,
    PeerSeen,
    SnapshotsReceived,
    Tick,
)
from swarm.protocol.messages import Body, Message
from swarm.protocol.timing import Timing
from tests.support.builders import IDLE, brief_of, entries_of, epoch, message, mission, task, uav

TIMING = Timing(silence_s=1e6)
FLEET = uav("u0"), uav("u1", east_m=10.0, t1=0.5)
T0, T1, POPUP = task("t0", 5.0, 2.0), task("t1", 9.0, 4.0), task("popup", 7.0, appears_s=30.0)
FLOWN = mission(FLEET, [T0, T1, POPUP], horizon_s=100.0)


class Onlooker:
    """The mission state of `FLOWN` whose mission begins at 200 s of its clock."""

    def __init__(self, flown: Mission = FLOWN, timing: Timing = TIMING) -> None:
        self.mission_state = MissionState(flown, timing)
        self.flown = flown
        self.now_s = 100.0
        self._counters: Counter[str] = Counter()

    def happen(self, fact: CommonEvent, mission_s: float | None = None) -> list[CommonAction]:
        if mission_s is not None:
            self.now_s = 200.0 + mission_s
        wishes = self.mission_state.step(fact, self.now_s)
        if Ask() in wishes:  # every question ends, be it without an answer
            wishes += self.mission_state.step(SnapshotsReceived(()), self.now_s)
        return wishes

    def statement(self, writer: str, body: Body) -> Message:
        self._counters[writer] += 1
        return message(writer, body, self._counters[writer])

    def hear(self, writer: str, body: Body, mission_s: float | None = None) -> list[CommonAction]:
        return self.happen(MessageReceived(self.statement(writer, body)), mission_s)

    def lose(self, writer: str, mission_s: float) -> None:
        self.happen(PeerGone(writer), mission_s)
        self.happen(Tick(), mission_s + TIMING.loss_delay_s)

    def posted(self) -> list[Body]:
        """What the coordinator says before the start."""
        return [brief_of(self.flown), *entries_of(self.flown.known_at_start())]

    def running(self) -> Onlooker:
        """The same at the start of the mission, everybody there and idle."""
        for writer in (COORDINATOR, "u0", "u1"):
            self.happen(PeerSeen(writer))
        for body in self.posted():
            self.hear(COORDINATOR, body)
        for name in ("u0", "u1"):
            self.hear(name, IDLE)
        self.hear(COORDINATOR, epoch("u0", "u1"), 0.0)
        return self

    @property
    def story(self) -> list[str]:
        return [happening.text for happening in self.mission_state.story]
