"""A session in a viewer: what is heard is shown, each flight from its beginning."""

from __future__ import annotations

from dataclasses import replace

from coordinator.dashboard.operator_session import OperatorSession
from coordinator.foxglove.channels import LiveChannels, Viewer
from coordinator.foxglove.live_core import LiveCore
from coordinator.recording.recorder import RecordingInfo
from swarm.model.ids import COORDINATOR
from swarm.protocol.events import CommonEvent, MessageReceived, PeerSeen
from swarm.protocol.messages import Body
from swarm.protocol.timing import Timing
from tests.support.builders import MISSION, brief, entry, epoch, message, uav
from tests.unit.coordinator.foxglove.test_channels import joined, subscribe, words

TIMING = Timing(silence_s=1e6)


class Shown:
    """A session that stays, and a viewer of all that comes of it."""

    def __init__(self) -> None:
        session = OperatorSession(MISSION, TIMING, incarnation=1, patience_s=10.0)
        self.channels = LiveChannels("test")
        about = RecordingInfo(MISSION, TIMING)
        self.core = LiveCore(session, about, self.channels, lambda now_s: round(now_s * 1e9))
        self.viewer: Viewer = joined(self.channels)
        self.topics: dict[int, str] = {}
        self.ops: list[str] = []
        self._counter = 0
        self.core.start(0.0)

    def happens(self, fact: CommonEvent, now_s: float) -> list[str]:
        """Topics of the messages that the viewer gets of it."""
        self.core.step(fact, now_s)
        return self.seen()

    def says(self, body: Body, now_s: float) -> list[str]:
        self._counter += 1
        return self.happens(
            MessageReceived(message(COORDINATOR, body, counter=self._counter)), now_s
        )

    def seen(self) -> list[str]:
        told, messages = words(self.viewer)
        self.ops += [word["op"] for word in told]
        new = [channel for word in told for channel in word.get("channels", [])]
        for channel in new:
            self.topics[channel["id"]] = channel["topic"]
        topics = [self.topics[subscription] for subscription, _, _ in messages]
        if new:
            subscribe(self.viewer, *((channel["id"], channel["id"]) for channel in new))
            topics += self.seen()
        return topics


def begun() -> Shown:
    shown = Shown()
    shown.happens(PeerSeen("u0"), 0.1)
    shown.says(brief(uav("u0")), 0.2)
    shown.says(entry("t0", 10.0), 0.3)
    shown.says(epoch("u0"), 0.4)
    return shown


def test_pictures_come_while_the_mission_is_flown() -> None:
    shown = begun()

    topics = shown.happens(PeerSeen("u1"), 1.0)

    assert {"/progress", "/fleet", "/scene/uavs"} <= set(topics)


def test_a_picture_comes_also_when_nobody_says_anything() -> None:
    shown = begun()
    shown.happens(PeerSeen("u1"), 1.0)

    shown.core.look(1.2)
    assert shown.seen() == []
    shown.core.look(1.6)
    assert "/scene/uavs" in shown.seen()


def test_a_mission_that_is_flown_anew_begins_with_nothing_of_the_flight_before() -> None:
    shown = begun()
    shown.happens(PeerSeen("u1"), 1.0)
    shown.ops.clear()
    assert "/scene/tasks" in set(shown.topics.values())
    shown.topics.clear()

    shown.says(replace(brief(uav("u0")), run=77), 2.0)

    assert shown.ops[:2] == ["unadvertise", "serverInfo"]
    assert f"/swarm/{MISSION}/alive" in shown.topics.values()  # who is there is still there
