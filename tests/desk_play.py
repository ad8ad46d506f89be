"""A desk that is told by hand what the bus says: a source for feeds, pages and metrics."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from coordinator.dashboard.desk import Desk
from coordinator.dashboard.source import CommandRow, Player, PlayerState
from coordinator.observer import Observer
from coordinator.operator.errands import OperatorWish
from swarm.events import BusFact, Heard, Learned, PeerGone, PeerSeen, Publish, Tick, Wish
from swarm.model.ids import COORDINATOR
from swarm.wire.messages import (
    Body,
    Claim,
    ClaimPhase,
    Epoch,
    EpochPhase,
    Message,
    Outcome,
    Result,
    Snapshot,
    Stamp,
    Status,
    StatusPhase,
)
from tests.builders import MISSION, TIMING, brief, entry, uav

__all__ = ["DeskPlay", "FakePlayer"]


class DeskPlay:
    """A desk beside a mission of which everything is told by the test."""

    def __init__(self, uavs: Sequence[str] = ("u1", "u2")) -> None:
        self.desk = Desk(MISSION, TIMING, incarnation=5, patience_s=10.0)
        self.time_s = 0.0
        self.speedup = 1.0
        self.player: Player | None = None
        self.may_order = True
        self.said: list[Message] = []
        """What the desk has published."""
        self.wishes: list[Wish] = []
        self._uavs = [uav(name) for name in uavs]
        self._counter = 0
        self._run = 1
        self._take(self.desk.start(0.0))

    def take(self, fact: BusFact) -> None:
        """Let the desk take note of a fact."""
        self._take(self.desk.step(fact, self.time_s))

    def say(self, writer: str, body: Body) -> None:
        """Let somebody say something."""
        self._counter += 1
        self.take(Heard(Message(MISSION, writer, Stamp(self._run, self._counter), body)))

    def begin(self, tasks: Sequence[str] = ("t1", "t2", "t3"), run: int = 1) -> None:
        """A flight of the mission begins: everyone is there, every task is on the board."""
        self._run = run
        for name in (COORDINATOR, *(each.id for each in self._uavs)):
            self.take(PeerSeen(name))
        self.say(COORDINATOR, replace(brief(*self._uavs), run=run))
        for number, task in enumerate(tasks):
            self.post(task, number)
        self.epoch(EpochPhase.RUNNING, {self._uavs[0].id: tuple(tasks)})
        self.take(Learned((Snapshot(MISSION, COORDINATOR, 1, self.time_s, ()),)))

    def epoch(
        self, phase: EpochPhase, routes: dict[str, tuple[str, ...]] | None = None, number: int = 1
    ) -> None:
        sequence = tuple(each.id for each in self._uavs)
        epoch = Epoch(number, phase, "greedy", sequence, self.time_s, "as told", routes or {})
        self.say(COORDINATOR, epoch)

    def post(self, task: str, number: int, *, withdrawn: bool = False) -> None:
        self.say(COORDINATOR, entry(task, 10.0 * number, number, withdrawn=withdrawn))

    def claim(self, who: str, task: str) -> None:
        completion_s = self.time_s + 10.0
        self.say(who, Claim(ClaimPhase.HELD, task, self.time_s, 0, completion_s))

    def end(self, who: str, task: str, result: Result = Result.DONE) -> None:
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
        """Let time pass, with ticks when the desk wants them."""
        until_s = self.time_s + by_s
        while (at_s := self.desk.next_deadline_s()) is not None and at_s <= until_s:
            self.time_s = max(self.time_s, at_s)
            self.take(Tick())
        self.time_s = until_s

    def _take(self, wishes: Sequence[Wish]) -> None:
        self.wishes += wishes
        self.said += [wish.message for wish in wishes if isinstance(wish, Publish)]

    # -- a source -----------------------------------------------------------------------

    @property
    def observer(self) -> Observer | None:
        return self.desk.observer

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

    def give(self, wish: OperatorWish, who: str) -> int:
        n = self.desk.give(wish, who, self.time_s)
        self.take(Tick())
        return n


class FakePlayer:
    """A player that remembers what it was told."""

    duration_s = 60.0

    def __init__(self) -> None:
        self.state = PlayerState(0.0, playing=True, speed=1.0)

    def control(self, *, playing: bool | None, speed: float | None, t_s: float | None) -> None:
        before = self.state
        self.state = PlayerState(
            before.t_s if t_s is None else t_s,
            before.playing if playing is None else playing,
            before.speed if speed is None else speed,
        )
