"""What joins the processes of a virtual world: messages, tokens and questions.

`IdealNetwork` brings everything to everyone after one constant time.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

from sim.world.engine import EventQueue
from swarm.protocol.events import (
    Cell,
    CommonEvent,
    MessageReceived,
    MessagesReceived,
    PeerGone,
    PeerSeen,
    SnapshotsReceived,
)
from swarm.protocol.messages import Message, Snapshot, TaskEntry
from swarm.protocol.timing import PRESETS, LinkKind
from swarm.protocol.uav_messages import Choice, Nearby, Status


class Node(Protocol):
    """One life of one process, as the network sees it."""

    @property
    def name(self) -> str:
        """Of the process; the same in its next life."""
        ...

    writer: str | None
    """Whose token it holds and for whom it answers; None for an observer."""
    cells: frozenset[Cell]
    """Of the sky, whose traffic it hears."""

    def receive(self, fact: CommonEvent | MessagesReceived) -> None:
        """Something has arrived; nothing happens any more at the seat of one that ended."""
        ...

    def answer(self, *, whole: bool = False) -> Snapshot | None:
        """What it answers when asked, if need be for all it knows; None when it cannot."""
        ...


class Network(Protocol):
    """Joins seats."""

    def join(self, seat: Node) -> None:
        """A process begins."""
        ...

    def leave(self, seat: Node) -> None:
        """A process has ended, of itself or not."""
        ...

    def seat(self, seat: Node, writer: str) -> None:
        """Who has been an observer shows the token of ``writer`` and answers for it."""
        ...

    def publish(self, sender: Node, message: Message, to: Collection[str] | None = None) -> None:
        """``sender`` says ``message``, to those alone; None: to everybody."""
        ...

    def ask(self, asker: Node, of: Collection[str] = ()) -> None:
        """``asker`` asks all others, or those ``of`` whom it is for all they know.

        It ends in its `SnapshotsReceived`.
        """
        ...


class IdealNetwork:
    """Everyone hears everything after the same time, in order."""

    def __init__(self, queue: EventQueue, latency_s: float) -> None:
        self._queue = queue
        self._latency_s = latency_s
        self._seats: list[Node] = []
        self._posting: tuple[Node, list[Message], int] | None = None
        """Who puts tasks on the board, those that nobody has heard of yet, and how many callbacks
        there were by then."""

    def join(self, seat: Node) -> None:
        """Show the tokens of both to the newcomer and the others."""
        for other in self._seats:
            if other.writer is not None:
                self._later(self._telling(seat, PeerSeen(other.writer)))
            if seat.writer is not None:
                self._later(self._telling(other, PeerSeen(seat.writer)))
        self._seats.append(seat)

    def leave(self, seat: Node) -> None:
        """Take the token away."""
        self._seats.remove(seat)
        if seat.writer is not None:
            self._tell_all(PeerGone(seat.writer), seat)

    def seat(self, seat: Node, writer: str) -> None:
        """Show the token."""
        seat.writer = writer
        self._tell_all(PeerSeen(writer), seat)

    def publish(self, sender: Node, message: Message, to: Collection[str] | None = None) -> None:
        """Tell everyone whom it concerns.

        Tasks that are put on the board one right after the other are heard together: to look at
        each of thousands would take a fleet of hundreds minutes.
        """
        if isinstance(message.body, TaskEntry):
            self._post(sender, message)
            return

        def tell() -> None:
            for seat in tuple(self._seats):
                if seat is not sender and concerns(message, seat, to):
                    seat.receive(MessageReceived(message))

        self._later(tell)

    def _post(self, sender: Node, message: Message) -> None:
        if self._posting is not None:
            before, posted, scheduled = self._posting
            if before is sender and scheduled == self._queue.scheduled:
                posted.append(message)
                return
        posted = [message]

        def tell() -> None:
            if self._posting is not None and self._posting[1] is posted:
                self._posting = None
            fact = MessagesReceived(tuple(posted))
            for seat in tuple(self._seats):
                if seat is not sender:
                    seat.receive(fact)

        self._later(tell)
        self._posting = sender, posted, self._queue.scheduled

    def ask(self, asker: Node, of: Collection[str] = ()) -> None:
        """All who are asked answer at one instant."""

        def answer() -> None:
            asked = [seat for seat in self._seats if seat is not asker]
            answers = [seat.answer(whole=bool(of)) for seat in asked if not of or seat.writer in of]
            learned = SnapshotsReceived(tuple(a for a in answers if a is not None))
            self._later(lambda: asker.receive(learned))

        self._later(answer)

    def _tell_all(self, fact: CommonEvent, sender: Node) -> None:
        def tell() -> None:
            for seat in tuple(self._seats):
                if seat is not sender:
                    seat.receive(fact)

        self._later(tell)

    @staticmethod
    def _telling(seat: Node, fact: CommonEvent) -> Callable[[], None]:
        return lambda: seat.receive(fact)

    def _later(self, callback: Callable[[], None]) -> None:
        self._queue.after(self._latency_s, callback)


def concerns(message: Message, seat: Node, to: Collection[str] | None = None) -> bool:
    """Whether who sits there has subscribed to that: status and choices are for observers, what
    UAVs say to those near them is for who has tuned in to their cell, what is said to some is for
    them alone."""
    if to is not None and seat.writer not in to:
        return False
    match message.body:
        case Status() | Choice():
            return seat.writer is None
        case Nearby(cell=cell):
            return cell in seat.cells
        case _:
            return True


class Topology(StrEnum):
    """How processes reach each other."""

    MESH = "mesh"
    """Directly."""
    ROUTER = "router"
    """Through one router, which is never on the side that is cut off."""
    ROUTERS = "routers"
    """Through routers, one on each side of every cut."""


@dataclass(frozen=True, slots=True)
class NetworkConditions:
    """The network at its best."""

    topology: Topology = Topology.ROUTER
    latency_s: float = 0.005
    """Least delay of a message [s]."""
    spread_s: float = 0.02
    """Mean of what comes on top of it, exponentially distributed; of each link up to twice that."""
    lease_s: float = PRESETS[LinkKind.NORMAL].lease_s
    answer_s: float = PRESETS[LinkKind.NORMAL].answer_s
    """How long a question waits for the slowest answer."""
    reconnect_s: float = 1.0
    """A transport that could be there again is so within this time."""
    weather_delay_s: float = 1.0
    """In the worst weather, what may come on top of the delay."""
    loss_frac: float = 0.0
    """Share of messages that are lost in any weather; those that arrive do so in order."""


@dataclass(eq=False, slots=True)
class RouterNode:
    """The seat of the routers, seen as one."""

    name: str = "router"
    writer: str | None = None
    cells: frozenset[Cell] = frozenset()

    def receive(self, fact: CommonEvent | MessagesReceived) -> None:
        """Routers take no part."""

    def answer(self, *, whole: bool = False) -> Snapshot | None:
        """Routers know nothing."""
        del whole
        return None
