"""What joins the processes of a virtual world: messages, tokens and questions.

`IdealNetwork` brings everything to everyone after one constant time. Leaves out: a network
on which anything goes wrong (sim.rough_network), and what the processes make of what they
hear.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from sim.event_queue import EventQueue
from swarm.events import BusFact, Heard, Learned, PeerGone, PeerSeen
from swarm.wire.messages import Choice, Message, Snapshot, Status

__all__ = ["IdealNetwork", "Network", "Seat"]


class Seat(Protocol):
    """One life of one process, as the network sees it."""

    @property
    def name(self) -> str:
        """Of the process; the same in its next life."""
        ...

    writer: str | None
    """Whose token it holds and for whom it answers; None for an onlooker."""

    def receive(self, fact: BusFact) -> None:
        """Something has arrived; nothing happens any more at the seat of one that ended."""
        ...

    def answer(self) -> Snapshot | None:
        """What it answers when asked; None when it cannot."""
        ...


class Network(Protocol):
    """Joins seats."""

    def join(self, seat: Seat) -> None:
        """A process begins."""
        ...

    def leave(self, seat: Seat) -> None:
        """A process has ended, of itself or not."""
        ...

    def seat(self, seat: Seat, writer: str) -> None:
        """Who has been an onlooker shows the token of ``writer`` and answers for it."""
        ...

    def publish(self, sender: Seat, message: Message) -> None:
        """``sender`` says ``message``."""
        ...

    def ask(self, asker: Seat) -> None:
        """``asker`` asks all others; ends in its `Learned`."""
        ...


class IdealNetwork:
    """Everyone hears everything after the same time, in order.

    Args:
        queue: virtual time.
        latency_s: of everything that is told [s].
    """

    def __init__(self, queue: EventQueue, latency_s: float) -> None:
        self._queue = queue
        self._latency_s = latency_s
        self._seats: list[Seat] = []

    def join(self, seat: Seat) -> None:
        """Show the tokens of both to the newcomer and the others."""
        for other in self._seats:
            if other.writer is not None:
                self._later(self._telling(seat, PeerSeen(other.writer)))
            if seat.writer is not None:
                self._later(self._telling(other, PeerSeen(seat.writer)))
        self._seats.append(seat)

    def leave(self, seat: Seat) -> None:
        """Take the token away."""
        self._seats.remove(seat)
        if seat.writer is not None:
            self._tell_all(PeerGone(seat.writer), seat)

    def seat(self, seat: Seat, writer: str) -> None:
        """Show the token."""
        seat.writer = writer
        self._tell_all(PeerSeen(writer), seat)

    def publish(self, sender: Seat, message: Message) -> None:
        """Tell everyone; status and choices go to onlookers only."""
        for_onlookers = isinstance(message.body, Status | Choice)
        self._tell_all(Heard(message), sender, onlookers_only=for_onlookers)

    def ask(self, asker: Seat) -> None:
        """All answer at one instant."""

        def answer() -> None:
            answers = [seat.answer() for seat in self._seats if seat is not asker]
            learned = Learned(tuple(a for a in answers if a is not None))
            self._later(lambda: asker.receive(learned))

        self._later(answer)

    def _tell_all(self, fact: BusFact, sender: Seat, *, onlookers_only: bool = False) -> None:
        def tell() -> None:
            for seat in tuple(self._seats):
                if seat is not sender and not (onlookers_only and seat.writer is not None):
                    seat.receive(fact)

        self._later(tell)

    @staticmethod
    def _telling(seat: Seat, fact: BusFact) -> Callable[[], None]:
        return lambda: seat.receive(fact)

    def _later(self, callback: Callable[[], None]) -> None:
        self._queue.after(self._latency_s, callback)
