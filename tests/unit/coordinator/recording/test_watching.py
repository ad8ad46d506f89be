"""When a recorder that looks on takes a mission for over."""

from __future__ import annotations

from collections import Counter

from coordinator.recording.recorder import RecordingObserver
from swarm.model.ids import COORDINATOR
from swarm.protocol.events import (
    CommonEvent,
    Finish,
    LinkChanged,
    MessageReceived,
    PeerGone,
    PeerSeen,
    Tick,
)
from swarm.protocol.messages import Body, MissionPhase
from swarm.protocol.timing import Timing
from tests.support.builders import MISSION, OUT, brief, epoch, message, uav


class Watch:
    """A recording observer of a mission with one UAV."""

    def __init__(self, until_s: float | None = None) -> None:
        timing = Timing(silence_s=1e6)
        self.witness = RecordingObserver(MISSION, timing, linger_s=5.0, until_s=until_s)
        self._counters: Counter[str] = Counter()
        self.witness.start(0.0)

    def ends(self, fact: CommonEvent, now_s: float) -> bool:
        return Finish(0) in self.witness.step(fact, now_s)

    def hears(self, writer: str, body: Body, now_s: float) -> bool:
        self._counters[writer] += 1
        return self.ends(MessageReceived(message(writer, body, self._counters[writer])), now_s)

    def begin(self) -> None:
        assert not self.ends(PeerSeen("u0"), 1.0)
        assert not self.hears(COORDINATOR, brief(uav("u0")), 1.0)
        assert not self.hears(COORDINATOR, epoch("u0"), 2.0)


def test_it_waits_for_a_fleet_that_has_not_come_yet() -> None:
    watch = Watch()

    assert not watch.hears(COORDINATOR, brief(uav("u0")), 1.0)
    assert not watch.ends(Tick(), 1000.0)


def test_it_is_over_when_the_last_has_been_gone_for_a_while() -> None:
    watch = Watch()
    watch.begin()
    watch.hears("u0", OUT, 8.0)

    assert not watch.ends(PeerGone("u0"), 10.0)
    assert not watch.ends(Tick(), 10.3)
    assert not watch.ends(Tick(), 15.2)
    assert watch.ends(Tick(), 15.4)


def test_who_comes_back_is_recorded_further() -> None:
    watch = Watch()
    watch.begin()
    watch.ends(PeerGone("u0"), 10.0)
    watch.ends(Tick(), 10.3)

    assert not watch.ends(PeerSeen("u0"), 12.0)
    assert not watch.ends(Tick(), 20.0)


def test_a_cut_link_ends_nothing_unless_the_mission_was_over() -> None:
    watch = Watch()
    watch.begin()
    watch.ends(LinkChanged(True), 3.0)
    assert not watch.ends(LinkChanged(False), 10.0)
    assert not watch.ends(Tick(), 500.0)

    watch.ends(LinkChanged(True), 501.0)
    watch.hears(COORDINATOR, epoch("u0", phase=MissionPhase.ENDED, number=2), 502.0)
    assert not watch.ends(LinkChanged(False), 503.0)
    assert watch.ends(Tick(), 508.0)


def test_it_ends_also_where_everybody_left_before_anything_was_known() -> None:
    watch = Watch()
    watch.ends(PeerSeen("u0"), 1.0)
    watch.ends(PeerGone("u0"), 2.0)

    assert not watch.ends(Tick(), 2.3)
    assert watch.ends(Tick(), 7.4)


def test_it_stops_after_the_time_it_was_given() -> None:
    watch = Watch(until_s=30.0)
    watch.begin()

    assert not watch.ends(Tick(), 29.9)
    assert watch.witness.next_deadline_s() == 30.0
    assert watch.ends(Tick(), 30.0)
