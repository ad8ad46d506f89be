"""The network on which things go wrong shows processes what Zenoh shows them."""

from __future__ import annotations

import gc
import weakref
from collections.abc import Sequence
from dataclasses import dataclass, field

import pytest

from sim.world.engine import EventQueue
from sim.world.network import NetworkConditions, Topology
from sim.world.rough_network import RoughNetwork
from swarm.protocol.events import (
    CommonEvent,
    LinkChanged,
    MessageReceived,
    MessagesReceived,
    PeerGone,
    PeerSeen,
    SnapshotsReceived,
)
from swarm.protocol.messages import Message, Snapshot, Stamp
from swarm.protocol.uav_messages import Claim, ClaimPhase, Status, StatusPhase

CONDITIONS = NetworkConditions()
LEASE_S, SLACK_S = CONDITIONS.lease_s, 0.5
UP_S = CONDITIONS.reconnect_s + SLACK_S
"""By then all transports are up."""
UP, DOWN = LinkChanged(True), LinkChanged(False)


@dataclass(eq=False)
class Listener:
    """A seat that notes what it is told and when."""

    queue: EventQueue
    name: str
    writer: str | None
    answers: bool = True
    cells: frozenset[tuple[int, int]] = frozenset()
    told: list[tuple[float, CommonEvent]] = field(default_factory=list)

    def receive(self, fact: CommonEvent | MessagesReceived) -> None:
        assert not isinstance(fact, MessagesReceived)  # on a rough network each word is alone
        self.told.append((self.queue.now_s(), fact))

    def answer(self, *, whole: bool = False) -> Snapshot | None:
        name = self.writer or ""
        return Snapshot("m", name, 1, 10.0, ()) if self.answers else None

    def since(self, time_s: float) -> list[CommonEvent]:
        return [fact for at_s, fact in self.told if at_s >= time_s]

    def when(self, fact: CommonEvent) -> float:
        """When it was last told that."""
        return max(at_s for at_s, told in self.told if told == fact)


class Net:
    """Seats a, b, c, … on one network, with a watch."""

    def __init__(
        self,
        topology: Topology = Topology.ROUTER,
        names: str = "abc",
        conditions: NetworkConditions | None = None,
    ) -> None:
        self.queue = EventQueue()
        self.network = RoughNetwork(self.queue, conditions or NetworkConditions(topology), seed=3)
        self.seats = {name: self.seat(name) for name in names}
        self.after(UP_S)

    def seat(self, name: str, writer: str | None = None) -> Listener:
        seat = Listener(self.queue, name, writer or name)
        self.network.join(seat)
        return seat

    def after(self, duration_s: float) -> float:
        """Let time pass; the time then."""
        until_s = self.queue.now_s() + duration_s
        self.queue.at(until_s, lambda: None)
        self.queue.run(until_s)
        return self.queue.now_s()

    def say(self, name: str, count: int = 1) -> None:
        for counter in range(count):
            self.network.publish(self.seats[name], said(name, counter))

    def heard(self, name: str) -> list[int]:
        facts = [fact for _, fact in self.seats[name].told if isinstance(fact, MessageReceived)]
        return [fact.message.stamp.counter for fact in facts]


def said(writer: str, counter: int) -> Message:
    return Message("m", writer, Stamp(1, counter), Claim(ClaimPhase.IDLE, None, 0.0, 0, 0.0))


def kinds(facts: Sequence[CommonEvent]) -> set[CommonEvent]:
    return {fact for fact in facts if not isinstance(fact, MessageReceived | SnapshotsReceived)}


@pytest.mark.parametrize("topology", list(Topology))
@pytest.mark.parametrize("cut", [False, True])
def test_who_has_left_is_forgotten(topology: Topology, cut: bool) -> None:
    """A machine that starts its process anew every second does so for hours."""
    net = Net(topology)
    left = list[weakref.ref[Listener]]()
    for life in range(20):
        seat = net.seat("d")
        if life % 3:
            net.after(0.4 * life % UP_S)
        if cut:
            net.network.cut("d")
        net.network.leave(seat)
        left.append(weakref.ref(seat))
        del seat
        net.after(UP_S + LEASE_S)
        if cut:
            net.network.heal("d")
            net.after(UP_S + LEASE_S)

    gc.collect()
    assert [seat() for seat in left] == [None] * len(left)


@pytest.mark.parametrize("topology", list(Topology))
def test_everyone_sees_everyone_else_and_its_own_link(topology: Topology) -> None:
    net = Net(topology)

    for name, seat in net.seats.items():
        assert kinds(seat.since(0.0)) == {UP, *(PeerSeen(o) for o in net.seats if o != name)}


def test_in_calm_weather_all_that_is_said_arrives_once_and_in_order() -> None:
    net = Net()
    net.say("a", 200)
    net.after(1.0)

    assert net.heard("b") == net.heard("c") == list(range(200))
    assert net.heard("a") == []


def test_in_bad_weather_messages_are_lost_doubled_and_out_of_order() -> None:
    net = Net()
    net.network.worsen(0.3)
    net.say("a", 1000)
    net.after(3.0)
    heard = net.heard("b")

    assert 600 < len(set(heard)) < 800
    assert len(heard) > len(set(heard)) + 50
    assert heard != sorted(heard)
    assert net.heard("c") != heard
    net.network.worsen(-0.3)
    net.say("a", 3)
    net.after(1.0)
    assert net.heard("b")[-3:] == [0, 1, 2]


def test_messages_are_lost_at_the_share_asked_for_and_the_others_stay_in_order() -> None:
    net = Net(conditions=NetworkConditions(loss_frac=0.2))
    net.say("a", 5000)
    net.after(1.0)

    for name in "bc":
        heard = net.heard(name)
        assert len(heard) == pytest.approx(4000, abs=4 * (5000 * 0.2 * 0.8) ** 0.5)
        assert heard == sorted(set(heard))
    assert net.heard("b") != net.heard("c")


def test_what_was_said_at_the_last_moment_arrives_even_without_a_delay() -> None:
    net = Net(conditions=NetworkConditions(latency_s=0.0, spread_s=0.0))
    net.say("a")
    net.network.leave(net.seats["a"])
    net.after(0.0)

    assert net.heard("b") == [0]


def test_status_goes_to_onlookers_only() -> None:
    net = Net()
    observer = Listener(net.queue, "onlooker", None)
    net.network.join(observer)
    net.after(UP_S)
    status = Status(StatusPhase.IDLE, None, None, None, None, None, {}, "")
    message = Message("m", "a", Stamp(1, 1), status)
    net.network.publish(net.seats["a"], message)
    net.after(1.0)

    assert MessageReceived(message) in observer.since(0.0)
    assert net.heard("b") == []


def test_a_death_shows_at_once_after_the_last_words() -> None:
    net = Net()
    net.say("a", 5)
    net.network.leave(net.seats["a"])
    begin_s = net.queue.now_s()
    net.after(0.5)

    assert net.seats["b"].since(begin_s)[-1] == PeerGone("a")
    assert net.heard("b") == list(range(5))


@pytest.mark.parametrize("topology", list(Topology))
def test_a_cut_shows_about_one_lease_later_on_both_sides(topology: Topology) -> None:
    net = Net(topology, "abcd")
    begin_s = net.queue.now_s()
    net.network.cut(("a", "b"))
    net.say("a")
    net.after(LEASE_S + 1e-6)

    assert net.heard("c") == []
    inside, outside = net.seats["a"], net.seats["c"]
    dark = topology is Topology.ROUTER
    assert kinds(outside.since(begin_s)) == {PeerGone("a"), PeerGone("b")}
    assert kinds(inside.since(begin_s)) == {
        *(PeerGone(other) for other in ("bcd" if dark else "cd")),
        *([DOWN] if dark else []),
    }
    gone_s = outside.when(PeerGone("a")) - begin_s
    assert 0.75 * LEASE_S <= gone_s <= LEASE_S
    assert (net.heard("b") == []) is dark


def test_after_a_cut_has_healed_tokens_and_messages_come_again() -> None:
    net = Net(Topology.MESH)
    net.network.cut(("a",))
    net.after(LEASE_S + SLACK_S)
    assert DOWN in net.seats["a"].since(0.0)
    healed_s = net.queue.now_s()
    net.network.heal(("a",))
    net.after(UP_S)
    net.say("a")
    net.after(SLACK_S)

    assert kinds(net.seats["a"].since(healed_s)) == {UP, PeerSeen("b"), PeerSeen("c")}
    assert kinds(net.seats["b"].since(healed_s)) == {PeerSeen("a")}
    assert net.heard("b") == [0]


def test_a_cut_that_is_shorter_than_the_lease_shows_nobody() -> None:
    net = Net()
    begin_s = net.queue.now_s()
    net.network.cut(("a",))
    net.after(0.7 * LEASE_S)
    net.network.heal(("a",))
    net.after(5.0)

    assert all(kinds(seat.since(begin_s)) == set() for seat in net.seats.values())


@pytest.mark.parametrize("topology", list(Topology))
def test_who_loses_its_own_link_knows_first_and_loses_all_tokens(topology: Topology) -> None:
    net = Net(topology)
    begin_s = net.queue.now_s()
    net.network.unplug("a")

    assert net.seats["a"].since(begin_s) == [DOWN, PeerGone("b"), PeerGone("c")]
    assert net.seats["b"].since(begin_s) == []
    net.after(LEASE_S + SLACK_S)
    assert kinds(net.seats["b"].since(begin_s)) == {PeerGone("a")}
    net.network.plug("a")
    net.after(UP_S)
    assert net.seats["a"].when(UP) > begin_s
    assert net.seats["b"].when(PeerSeen("a")) > begin_s


def test_when_all_routers_end_everyone_loses_everything_and_gets_it_back() -> None:
    net = Net()
    begin_s = net.queue.now_s()
    net.network.routers_down()

    assert all(seat.since(begin_s)[0] == DOWN for seat in net.seats.values())
    assert all(len(seat.since(begin_s)) == 3 for seat in net.seats.values())
    net.network.routers_up()
    net.after(UP_S)
    for name, seat in net.seats.items():
        others = {PeerSeen(other) for other in net.seats if other != name}
        assert kinds(seat.since(begin_s + 1e-9)) == {UP, *others}


def test_tokens_blink_within_milliseconds_and_the_link_does_not() -> None:
    net = Net()
    begin_s = net.queue.now_s()
    net.network.blink()
    net.after(0.005)

    facts = net.seats["a"].since(begin_s)
    assert kinds(facts) == {PeerGone("b"), PeerGone("c"), PeerSeen("b"), PeerSeen("c")}
    assert [type(fact) for fact in facts] == [PeerGone, PeerGone, PeerSeen, PeerSeen]


def test_who_is_muted_is_seen_and_not_heard() -> None:
    net = Net()
    begin_s = net.queue.now_s()
    net.network.mute("a", "b")
    net.say("a")
    net.after(3.0 * LEASE_S)

    assert (net.heard("b"), net.heard("c")) == ([], [0])
    assert kinds(net.seats["b"].since(begin_s)) == set()
    net.network.unmute("a", "b")
    net.say("a")
    net.after(SLACK_S)
    assert net.heard("b") == [0]


def test_a_stopped_process_goes_after_the_lease_and_must_be_reached_anew() -> None:
    net = Net()
    begin_s = net.queue.now_s()
    net.network.stop(net.seats["a"])
    net.after(LEASE_S + SLACK_S)
    assert kinds(net.seats["b"].since(begin_s)) == {PeerGone("a")}
    assert kinds(net.seats["a"].since(begin_s)) == set()
    went_on_s = net.queue.now_s()
    net.network.cont(net.seats["a"])
    net.after(UP_S + SLACK_S)

    assert {DOWN, UP, PeerGone("b"), PeerSeen("b")} <= kinds(net.seats["a"].since(went_on_s))
    assert kinds(net.seats["b"].since(went_on_s)) == {PeerSeen("a")}


def test_a_process_that_is_stopped_for_a_moment_misses_nothing() -> None:
    net = Net()
    begin_s = net.queue.now_s()
    net.network.stop(net.seats["a"])
    net.say("b")
    net.after(0.5 * LEASE_S)
    net.network.cont(net.seats["a"])
    net.after(5.0)

    assert net.heard("a") == [0]
    assert all(kinds(seat.since(begin_s)) == set() for seat in net.seats.values())


def test_a_question_is_answered_by_all_that_can_be_reached() -> None:
    net = Net(names="abcd")
    net.network.cut(("d",))
    net.after(LEASE_S + SLACK_S)
    asked_s = net.queue.now_s()
    net.network.ask(net.seats["a"])
    net.after(CONDITIONS.answer_s + SLACK_S)

    (learned,) = [
        fact for fact in net.seats["a"].since(asked_s) if isinstance(fact, SnapshotsReceived)
    ]
    assert {snapshot.writer for snapshot in learned.snapshots} == {"b", "c"}
    assert net.seats["a"].when(learned) - asked_s < SLACK_S


def test_who_does_not_answer_makes_the_asker_wait_and_answers_grow_older() -> None:
    net = Net()
    net.seats["b"].answers = False
    asked_s = net.queue.now_s()
    net.network.ask(net.seats["a"])
    net.after(CONDITIONS.answer_s + SLACK_S)

    (learned,) = [
        fact for fact in net.seats["a"].since(asked_s) if isinstance(fact, SnapshotsReceived)
    ]
    assert net.seats["a"].when(learned) == asked_s + CONDITIONS.answer_s
    (answer,) = learned.snapshots
    assert answer.writer == "c"
    assert answer.mission_s == pytest.approx(10.0 + CONDITIONS.answer_s, abs=SLACK_S)


def test_nobody_to_ask_is_an_answer_too() -> None:
    net = Net(names="a")
    net.network.ask(net.seats["a"])
    net.after(SLACK_S)

    assert SnapshotsReceived(()) in net.seats["a"].since(0.0)


def test_a_token_goes_only_with_the_last_process_that_holds_it() -> None:
    net = Net()
    twin = net.seat("a twin", "a")
    net.after(UP_S)
    begin_s = net.queue.now_s()
    net.network.leave(net.seats["a"])
    net.after(1.0)
    assert kinds(net.seats["b"].since(begin_s)) == set()
    assert kinds(twin.since(begin_s)) == set()

    net.network.leave(twin)
    net.after(1.0)
    assert kinds(net.seats["b"].since(begin_s)) == {PeerGone("a")}


def test_what_is_said_to_some_is_heard_by_them_alone() -> None:
    net = Net()
    observer = Listener(net.queue, "onlooker", None)
    net.network.join(observer)
    net.after(UP_S)
    message = said("a", 1)
    net.network.publish(net.seats["a"], message, ("b",))
    net.after(1.0)

    assert (net.heard("b"), net.heard("c")) == ([1], [])
    assert MessageReceived(message) not in observer.since(0.0)
