"""A network on which messages are late, lost, doubled and out of order, and links break.

It shows what Zenoh shows (ZENOH.md): each process sees the tokens of those it has a transport to. A
cut or a stopped process takes transports away about one lease later, a death at once; a transport
that is back shows its tokens again. A message is lost when either end has no transport to the
other, and also, unlike there, when the way is cut while the transport stands. Where there are
routers, the own link is the transport to one's router; in a mesh, any transport. Losing it takes
all tokens away.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field, replace
from functools import partial

from sim.world.engine import EventQueue, stream, uniforms
from sim.world.network import NetworkConditions, Node, RouterNode, Topology, concerns
from swarm.protocol.events import (
    CommonEvent,
    LinkChanged,
    MessageReceived,
    PeerGone,
    PeerSeen,
    SnapshotsReceived,
)
from swarm.protocol.messages import Message, Snapshot


@dataclass(slots=True)
class _DirectedLink:
    """From one process to another, whatever life each is in."""

    draws: Iterator[float]
    spread_s: float
    last_s: float = 0.0
    """When the latest message arrives that was sent in order."""


@dataclass(slots=True)
class _PendingQuestion:
    asker: Node
    missing: set[Node]
    whole: bool = False
    """Whether all that is known is asked for."""
    answers: list[tuple[float, Snapshot]] = field(default_factory=list)
    """When each arrived."""
    over: bool = False


class RoughNetwork:
    """Joins seats as well as it can."""

    def __init__(self, queue: EventQueue, conditions: NetworkConditions, seed: int) -> None:
        self.weather = 0.0
        """How bad it is, 0..1: the share of messages lost, twice the share of those doubled."""
        self._queue = queue
        self._conditions = conditions
        self._seed = seed
        self._draws = uniforms(stream(seed, "transports"))
        self._links: dict[tuple[str, str], _DirectedLink] = {}
        self._seats: list[Node] = []
        self._router = RouterNode() if conditions.topology is not Topology.MESH else None
        self._open: set[tuple[Node, Node]] = set()
        """Transports: who has one, and to whom."""
        self._changes: Counter[tuple[Node, Node]] = Counter()
        """How often each was to come or go: what was to happen before the last is not to any more.
        None of who has left."""
        self._cuts: list[frozenset[str]] = []
        self._unplugged: Counter[str] = Counter()
        self._muted: Counter[tuple[str, str]] = Counter()
        self._down = 0
        self._weather = 0.0
        self._stopped: set[Node] = set()

    # -- what processes do ------------------------------------------------------------

    def join(self, seat: Node) -> None:
        """A process begins; transports come up one by one, that to a router at once."""
        others = list(self._others(seat))
        self._seats.append(seat)
        for other in others:
            if other is not self._router:
                self._review(other, seat)
                self._review(seat, other)
            elif self._is_cut(seat, other):
                self._review(seat, other)
            else:
                self._change(seat, other, None, opens=True)

    def leave(self, seat: Node) -> None:
        """A process has ended: its transports go as soon as what it said has arrived."""
        self._seats.remove(seat)
        self._stopped.discard(seat)
        for viewer in self._seats:
            if (viewer, seat) in self._open and not self._is_cut(viewer, seat):
                link, least_s = self._link(seat, viewer), self._conditions.latency_s
                after_s = max(link.last_s - self._queue.now_s(), least_s)
                self._change(viewer, seat, after_s, opens=False)
            elif (viewer, seat) not in self._open:
                self._changes.pop((viewer, seat), None)  # it will not come up any more
        self._open = {pair for pair in self._open if pair[0] is not seat}
        for pair in [pair for pair in self._changes if pair[0] is seat]:
            del self._changes[pair]

    def seat(self, seat: Node, writer: str) -> None:
        """Show the token to all that have a transport."""
        seat.writer = writer
        for viewer in list(self._seats):
            if viewer is not seat:
                self._queue.after(self._conditions.latency_s, partial(self._show, viewer, seat))

    def publish(self, sender: Node, message: Message, to: Collection[str] | None = None) -> None:
        """Tell everyone whom it concerns and reaches."""
        fact = MessageReceived(message)
        for seat in self._seats:
            if seat is not sender and concerns(message, seat, to):
                self._send(sender, seat, fact)

    def ask(self, asker: Node, of: Collection[str] = ()) -> None:
        """Ask who can be reached; the answers end when all are in, or at the timeout."""
        asked = [
            seat
            for seat in self._seats
            if seat.writer is not None
            and seat is not asker
            and (asker, seat) in self._open
            and (not of or seat.writer in of)
        ]
        question = _PendingQuestion(asker, set(asked), whole=bool(of))
        for seat in asked:
            self._pass_on(question, seat)
        if not asked:
            self._queue.after(self._conditions.latency_s, lambda: self._learn(question))
        self._queue.after(self._conditions.answer_s, lambda: self._learn(question))

    # -- what befalls the network -----------------------------------------------------

    def cut(self, group: Collection[str]) -> None:
        """Part the processes of ``group`` from all others."""
        self._cuts.append(frozenset(group))
        self._review_all()

    def heal(self, group: Collection[str]) -> None:
        """Undo a `cut`."""
        self._cuts.remove(frozenset(group))
        self._review_all()

    def unplug(self, name: str) -> None:
        """Take the link of one process away, which it notices at once."""
        self._unplugged[name] += 1
        for seat in list(self._seats):
            if seat.name == name:
                self._lose_all(seat)
        self._review_all()

    def plug(self, name: str) -> None:
        """Undo an `unplug`."""
        self._unplugged -= Counter({name: 1})  # zeros go, so that no cut is seen quickly
        self._review_all()

    def mute(self, sender: str, receiver: str) -> None:
        """Let nothing that ``sender`` says reach ``receiver``, though the transport stands."""
        self._muted[sender, receiver] += 1

    def unmute(self, sender: str, receiver: str) -> None:
        """Undo a `mute`."""
        self._muted[sender, receiver] -= 1

    def routers_down(self) -> None:
        """All routers end, or what joins the peers of a mesh: every transport goes at once."""
        self._down += 1
        for seat in list(self._seats):
            self._lose_all(seat)
        self._review_all()

    def routers_up(self) -> None:
        """Undo a `routers_down`."""
        self._down -= 1
        self._review_all()

    def blink(self) -> None:
        """All tokens go and come back at once, as when one of two routers ends."""
        for seat in list(self._seats):
            seen = [other for other in self._seats if (seat, other) in self._open]
            for other in seen:
                self._queue.after(0.004 * next(self._draws), partial(self._show, seat, other))
            for other in seen:
                self._tell_gone(seat, other)

    @property
    def is_lossy(self) -> bool:
        """Whether messages are lost in any weather."""
        return self._conditions.loss_frac > 0.0

    def worsen(self, by: float) -> None:
        """Change the weather."""
        self._weather += by
        self.weather = min(1.0, self._weather) if self._weather > 1e-9 else 0.0

    def stop(self, seat: Node) -> None:
        """A process is stopped with its network threads: it keeps no transport alive."""
        self._stopped.add(seat)
        for viewer in list(self._seats):
            self._review(viewer, seat)

    def cont(self, seat: Node) -> None:
        """Undo a `stop`: whoever has given it up meanwhile must be reached anew."""
        self._stopped.discard(seat)
        others = list(self._others(seat))
        gave_up: set[Node] = {
            o for o in self._seats if o is not seat and (o, seat) not in self._open
        }
        if self._router is not None and gave_up:
            gave_up.add(self._router)
        for other in others:
            if other is not self._router:
                self._review(other, seat)
            if other in gave_up and (seat, other) in self._open:
                self._change(seat, other, 0.2 * next(self._draws), opens=False)
            else:
                self._review(seat, other)

    # -- who can reach whom -----------------------------------------------------------

    def joined(self, one: Node, other: Node) -> bool:
        """Whether both have a transport to each other, over which messages come."""
        both = (one, other) in self._open and (other, one) in self._open
        return both and not self._is_cut(one, other)

    def is_alone(self, sender: Node) -> bool:
        """Whether nobody is there to hear what ``sender`` says now."""
        return not any(self._reaches(sender, seat) for seat in self._seats if seat is not sender)

    def _reaches(self, sender: Node, receiver: Node) -> bool:
        muted = self._muted.get((sender.name, receiver.name))
        return not muted and self.joined(sender, receiver)

    # -- messages ---------------------------------------------------------------------

    def _send(self, sender: Node, receiver: Node, fact: CommonEvent) -> None:
        if not self._reaches(sender, receiver):
            return
        link = self._link(sender, receiver)
        draw, weather = link.draws, self.weather
        copies = 1
        if self._conditions.loss_frac and next(draw) < self._conditions.loss_frac:
            return
        if weather:
            copies = int(next(draw) >= weather) + int(next(draw) < weather / 2.0)

        def arrive() -> None:
            # What one who has ended said still arrives.
            if (receiver, sender) in self._open and not self._is_cut(sender, receiver):
                receiver.receive(fact)

        for _ in range(copies):
            at_s = self._queue.now_s() + self._delay_s(link)
            if not weather:
                at_s = link.last_s = max(at_s, link.last_s)
            self._queue.at(at_s, arrive)

    def _delay_s(self, link: _DirectedLink) -> float:
        delay_s = self._conditions.latency_s - link.spread_s * math.log1p(-next(link.draws))
        if self.weather:
            delay_s += self.weather * self._conditions.weather_delay_s * next(link.draws)
        return delay_s

    def _link(self, sender: Node, receiver: Node) -> _DirectedLink:
        ends = sender.name, receiver.name
        link = self._links.get(ends)
        if link is None:
            draws = uniforms(stream(self._seed, "link", *ends))
            spread_s = 2.0 * next(draws) * self._conditions.spread_s
            link = self._links[ends] = _DirectedLink(draws, spread_s)
        return link

    # -- questions --------------------------------------------------------------------

    def _pass_on(self, question: _PendingQuestion, seat: Node) -> None:
        def reach() -> None:
            heard = self.joined(question.asker, seat)
            answer = self._answer_of(seat, whole=question.whole) if heard else None
            if answer is not None and not self._is_lost(back):
                self._queue.after(self._delay_s(back), lambda: self._take(question, seat, answer))

        there, back = self._link(question.asker, seat), self._link(seat, question.asker)
        if not self._is_lost(there):
            self._queue.after(self._delay_s(there), reach)

    def _answer_of(self, seat: Node, *, whole: bool) -> Snapshot | None:
        """What ``seat`` answers, as it is understood."""
        return seat.answer(whole=whole)

    def _is_lost(self, link: _DirectedLink) -> bool:
        """Whether a question or an answer is."""
        lost_frac = max(self.weather, self._conditions.loss_frac)
        return lost_frac > 0.0 and next(link.draws) < lost_frac

    def _take(self, question: _PendingQuestion, seat: Node, answer: Snapshot) -> None:
        if not question.over and self.joined(question.asker, seat):
            question.answers.append((self._queue.now_s(), answer))
            question.missing.discard(seat)
            if not question.missing:
                self._learn(question)

    def _learn(self, question: _PendingQuestion) -> None:
        if not question.over:
            question.over = True
            now_s, learned = self._queue.now_s(), list[Snapshot]()
            for arrived_s, answer in question.answers:
                mission_s = answer.mission_s
                if mission_s is not None:  # time has passed since then
                    mission_s += now_s - arrived_s
                learned.append(replace(answer, mission_s=mission_s))
            question.asker.receive(SnapshotsReceived(tuple(learned)))

    # -- transports and tokens --------------------------------------------------------

    def _others(self, seat: Node) -> Iterator[Node]:
        if self._router is not None:
            yield self._router
        yield from (other for other in self._seats if other is not seat)

    def _is_cut(self, one: Node, other: Node) -> bool:
        """Whether nothing can pass between the two, or the transport of either is asleep."""
        if not (self._cuts or self._down or self._unplugged):
            return False
        if self._down or self._unplugged[one.name] or self._unplugged[other.name]:
            return True
        for group in self._cuts:
            inside = (one.name in group) + (other.name in group)
            if inside == 1 and self._conditions.topology is not Topology.ROUTERS:
                return True
            if inside == 1 and self._router not in (one, other):
                return True
            if inside == 2 and self._conditions.topology is Topology.ROUTER:
                return True
        return False

    def _review_all(self) -> None:
        for seat in list(self._seats):
            for other in list(self._others(seat)):
                self._review(seat, other)

    def _review(self, viewer: Node, other: Node) -> None:
        """Let the transport go or come, as it must from now on."""
        asleep = viewer in self._stopped or other in self._stopped
        blocked = asleep or self._is_cut(viewer, other)
        if blocked == ((viewer, other) in self._open):
            if not blocked:
                after_s = self._conditions.reconnect_s * (0.05 + 0.95 * next(self._draws))
                self._change(viewer, other, after_s, opens=True)
            elif viewer not in self._stopped:
                after_s = self._conditions.lease_s * (0.75 + 0.25 * next(self._draws))
                self._change(viewer, other, after_s, opens=False)
        elif not blocked or viewer not in self._stopped:
            self._changes[viewer, other] += 1  # nothing to change any more

    def _change(self, viewer: Node, other: Node, after_s: float | None, *, opens: bool) -> None:
        """Let the transport come or go after that time, and all that happens by then; None: now."""
        pair = viewer, other
        self._changes[pair] += 1
        change = self._changes[pair]

        def happen() -> None:
            if change == self._changes[pair] and opens != (pair in self._open):
                if opens:
                    self._come_up(viewer, other)
                else:
                    self._go_down(viewer, other)
            if other is not self._router and other not in self._seats:
                self._changes.pop(pair, None)

        if after_s is None:
            happen()
        else:
            self._queue.after(after_s, happen)

    def _come_up(self, viewer: Node, other: Node) -> None:
        was_linked = self._is_linked(viewer)
        self._open.add((viewer, other))
        if not was_linked and self._is_linked(viewer):
            viewer.receive(LinkChanged(True))
        self._show(viewer, other)

    def _go_down(self, viewer: Node, other: Node) -> None:
        was_linked = self._is_linked(viewer)
        self._open.discard((viewer, other))
        if was_linked and not self._is_linked(viewer):
            viewer.receive(LinkChanged(False))
        self._tell_gone(viewer, other)
        if viewer in self._seats and (other is self._router or other in self._seats):
            self._review(viewer, other)

    def _lose_all(self, viewer: Node) -> None:
        """Every transport of ``viewer`` goes at once: it knows its own link to be down."""
        lost = [other for other in self._others(viewer) if (viewer, other) in self._open]
        was_linked = self._is_linked(viewer)
        for other in lost:
            self._changes[viewer, other] += 1
            self._open.discard((viewer, other))
        if was_linked:
            viewer.receive(LinkChanged(False))
        for other in lost:
            self._tell_gone(viewer, other)

    def _is_linked(self, viewer: Node) -> bool:
        if self._router is not None:
            return (viewer, self._router) in self._open
        return any(first is viewer for first, _ in self._open)

    def _show(self, viewer: Node, other: Node) -> None:
        """Tell ``viewer`` of the token, unless it is another's of the same name."""
        is_there = (viewer, other) in self._open
        if is_there and other.writer is not None and other.writer != viewer.writer:
            viewer.receive(PeerSeen(other.writer))

    def _tell_gone(self, viewer: Node, other: Node) -> None:
        if other.writer is None or other.writer == viewer.writer:
            return
        twins = (s for s in self._seats if s.writer == other.writer and s is not other)
        if not any((viewer, twin) in self._open for twin in twins):
            viewer.receive(PeerGone(other.writer))
