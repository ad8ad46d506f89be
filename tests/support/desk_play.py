"""A session that is told by hand what the bus says: a source for feeds, pages and metrics."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from coordinator.dashboard.operator_session import OperatorSession
from coordinator.dashboard.source import CommandRow, PlaybackControl, PlaybackState
from coordinator.mission_view.mission_state import MissionState
from coordinator.operator.requests import OperatorRequest
from swarm.model.ids import COORDINATOR
from swarm.protocol.events import (
    CommonAction,
    CommonEvent,
    MessageReceived,
    PeerGone,
    PeerSeen,
    Publish,
    SnapshotsReceived,
    Tick,
)
from swarm.protocol.messages import Body, Message, MissionPhase, PlanEpoch, Snapshot, Stamp
from swarm.protocol.uav_messages import (
    AttemptResult,
    Claim,
    ClaimPhase,
    Outcome,
    Status,
    StatusPhase,
)
from tests.support.builders import MISSION, TIMING, brief, entry, uav


class DeskPlay:
    """A session beside a mission of which everything is told by the test."""

    def __init__(self, uavs: Sequence[str] = ("u1", "u2")) -> None:
        self.desk = OperatorSession(MISSION, TIMING, incarnation=5, patience_s=10.0)
        self.time_s = 0.0
        self.speedup = 1.0
        self.player: PlaybackControl | None = None
        self.may_order = True
        self.said: list[Message] = []
        """What the session has published."""
        self.wishes: list[CommonAction] = []
        self._uavs = [uav(name) for name in uavs]
        self._counter = 0
        self._run = 1
        self._take(self.desk.start(0.0))

    def take(self, fact: CommonEvent) -> None:
        """Let the session take note of a fact."""
        self._take(self.desk.step(fact, self.time_s))

    def say(self, writer: str, body: Body) -> None:
        """Let somebody say something."""
        self._counter += 1
        self.take(MessageReceived(Message(MISSION, writer, Stamp(self._run, self._counter), body)))

    def begin(self, tasks: Sequence[str] = ("t1", "t2", "t3"), run: int = 1) -> None:
        """A flight of the mission begins: everyone is there, every task is on the board."""
        self._run = run
        for name in (COORDINATOR, *(each.id for each in self._uavs)):
            self.take(PeerSeen(name))
        self.say(COORDINATOR, replace(brief(*self._uavs), run=run))
        for number, task in enumerate(tasks):
            self.post(task, number)
        self.epoch(MissionPhase.RUNNING, {self._uavs[0].id: tuple(tasks)})
        self.take(SnapshotsReceived((Snapshot(MISSION, COORDINATOR, 1, self.time_s, ()),)))

    def epoch(
        self, phase: MissionPhase, routes: dict[str, tuple[str, ...]] | None = None, number: int = 1
    ) -> None:
        sequence = tuple(each.id for each in self._uavs)
        epoch = PlanEpoch(number, phase, "greedy", sequence, self.time_s, "as told", routes or {})
        self.say(COORDINATOR, epoch)

    def post(self, task: str, number: int, *, withdrawn: bool = False) -> None:
        self.say(COORDINATOR, entry(task, 10.0 * number, number, withdrawn=withdrawn))

    def claim(self, who: str, task: str) -> None:
        completion_s = self.time_s + 10.0
        self.say(who, Claim(ClaimPhase.HELD, task, self.time_s, 0, completion_s))

    def end(self, who: str, task: str, result: AttemptResult = AttemptResult.DONE) -> None:
        self.say(who, Outcome(task, result, 1, self.time_s))

    def status(
        self, who: str, phase: StatusPhase = StatusPhase.IDLE, east_m: float = 0.0, note: str = ""
    ) -> None:
        place = (east_m, 0.0, 0.0)
        dropped = {"stale": 2}
        self.say(who, Status(phase, None, place, None, 0.5, self.time_s, dropped, note))

    def lose(self, who: str) -> None:
        """Somebody disappears, and it is noticed."""
        self.take(PeerGone(who))
        self.wait(TIMING.loss_delay_s)

    def wait(self, by_s: float) -> None:
        """Let time pass, with ticks when the session wants them."""
        until_s = self.time_s + by_s
        while (at_s := self.desk.next_deadline_s()) is not None and at_s <= until_s:
            self.time_s = max(self.time_s, at_s)
            self.take(Tick())
        self.time_s = until_s

    def _take(self, wishes: Sequence[CommonAction]) -> None:
        self.wishes += wishes
        self.said += [wish.message for wish in wishes if isinstance(wish, Publish)]

    # -- a source -----------------------------------------------------------------------

    @property
    def mission_state(self) -> MissionState | None:
        return self.desk.mission_state

    link = True
    dropped: Mapping[str, int] = {}

    def now_s(self) -> float:
        return self.time_s

    @property
    def commands(self) -> Sequence[CommandRow]:
        return self.desk.rows

    @property
    def orders(self) -> DeskPlay | None:
        return self if self.may_order and self.player is None else None

    def give(self, wish: OperatorRequest, who: str) -> int:
        n = self.desk.give(wish, who, self.time_s)
        self.take(Tick())
        return n


class FakePlayer:
    """A player that remembers what it was told."""

    duration_s = 60.0

    def __init__(self) -> None:
        self.state = PlaybackState(0.0, playing=True, speed=1.0)

    def control(self, *, playing: bool | None, speed: float | None, t_s: float | None) -> None:
        before = self.state
        self.state = PlaybackState(
            before.t_s if t_s is None else t_s,
            before.playing if playing is None else playing,
            before.speed if speed is None else speed,
        )
