"""What viewers of a live mission are told: the very messages of a recording, and never too many."""

from __future__ import annotations

import io
import json
import struct
from collections import defaultdict
from typing import Any

import pytest
from mcap.reader import make_reader

from coordinator.foxglove import channels as channels_module
from coordinator.foxglove.channels import LOG_TOPIC, LiveChannels, Viewer
from coordinator.recording.flight_recorder import virtual_ns
from coordinator.recording.recorder import Recorder, RecordingInfo
from swarm.protocol.timing import Timing
from tests.support.observed_mission import shipped
from tests.support.recordings import fly_recorded

Told = dict[str, Any]


def words(viewer: Viewer) -> tuple[list[Told], list[tuple[int, int, bytes]]]:
    """All that waits: what is told, and messages as subscription, time and data."""
    told: list[Told] = []
    messages = []
    for word in viewer.take():
        if isinstance(word, str):
            told.append(json.loads(word))
        else:
            opcode, subscription, log_ns = struct.unpack_from("<BIQ", word)
            assert opcode == 1
            messages.append((subscription, log_ns, word[13:]))
    return told, messages


def subscribe(viewer: Viewer, *pairs: tuple[int, int]) -> None:
    asked = [{"id": number, "channelId": channel} for number, channel in pairs]
    viewer.says(json.dumps({"op": "subscribe", "subscriptions": asked}))


def opened(*topics: str) -> LiveChannels:
    """Channels 1, 2 and so on, each with a message."""
    channels = LiveChannels("test")
    channels.begin("first")
    channels.define("s", b"{}")
    for topic in topics:
        channels.add(topic, "s", b'"old"', 1)
    return channels


def joined(channels: LiveChannels) -> Viewer:
    return channels.join(lambda: None)


def test_a_viewer_gets_the_very_messages_of_the_recording() -> None:
    mission = shipped("table-1")
    flown = fly_recorded(mission)
    channels = LiveChannels("test")
    channels.begin("flight")
    viewer = joined(channels)
    recorder = Recorder(RecordingInfo(mission.name, Timing(status_s=0.5), virtual=True), channels)
    live: defaultdict[str, list[tuple[int, bytes]]] = defaultdict(list)
    schemas: dict[str, tuple[str, str, str, str]] = {}
    topics: dict[int, str] = {}

    def look() -> None:
        told, messages = words(viewer)
        new = [channel for word in told for channel in word.get("channels", [])]
        for channel in new:
            topics[channel["id"]] = channel["topic"]
            kinds = ("schemaName", "schema", "schemaEncoding", "encoding")
            schemas[channel["topic"]] = tuple(channel[kind] for kind in kinds)
        for subscription, log_ns, data in messages:
            live[topics[subscription]].append((log_ns, data))
        if new:
            subscribe(viewer, *((channel["id"], channel["id"]) for channel in new))
            look()

    for now_s, what in flown.steps.noted:
        recorder.note(what, now_s, virtual_ns(now_s))
        look()
    recorder.draw()
    look()

    written: defaultdict[str, list[tuple[int, bytes]]] = defaultdict(list)
    declared = {}
    for schema, channel, message in make_reader(io.BytesIO(flown.data)).iter_messages():
        assert schema is not None
        written[channel.topic].append((message.log_time, message.data))
        kinds = (schema.name, schema.data.decode(), schema.encoding, channel.message_encoding)
        declared[channel.topic] = kinds
    assert schemas == declared
    assert live.keys() == written.keys()
    for topic, messages in written.items():
        assert live[topic][-len(messages) :] == messages
        # What came before the subscription is there, too: nothing else can be.
        assert len(live[topic]) == len(messages)
    assert viewer.dropped == 0


def test_who_comes_late_is_told_how_everything_stands_and_the_last_lines() -> None:
    channels = opened("/scene/tasks", LOG_TOPIC)
    channels.add("/scene/tasks", "s", b'"new"', 2)
    channels.add(LOG_TOPIC, "s", b'"second"', 2)
    viewer = joined(channels)

    told, _ = words(viewer)
    subscribe(viewer, (7, 1), (8, 2))

    assert told[0]["op"] == "serverInfo"
    assert told[0]["sessionId"] == "first"
    assert [channel["topic"] for channel in told[1]["channels"]] == ["/scene/tasks", LOG_TOPIC]
    assert words(viewer)[1] == [(7, 2, b'"new"'), (8, 1, b'"old"'), (8, 2, b'"second"')]


def test_only_what_is_subscribed_is_sent_and_only_as_long() -> None:
    channels = opened("/a", "/b")
    viewer = joined(channels)
    subscribe(viewer, (0, 1))
    words(viewer)
    channels.add("/a", "s", b"1", 2)
    channels.add("/b", "s", b"2", 2)
    assert words(viewer) == ([], [(0, 2, b"1")])

    viewer.says('{"op":"unsubscribe","subscriptionIds":[0,99]}')
    channels.add("/a", "s", b"3", 3)

    assert words(viewer) == ([], [])


def test_a_slow_viewer_misses_messages_that_are_counted_and_gets_the_newest(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(channels_module, "MOST_BYTES", 10)
    channels = opened("/a", "/b")
    slow, quick = joined(channels), joined(channels)
    for viewer in (slow, quick):
        subscribe(viewer, (1, 1), (2, 2))
        words(viewer)
    for n in range(5):
        channels.add("/a", "s", b"aaa%d" % n, n)
        channels.add("/b", "s", b"bbb%d" % n, n)
        words(quick)

    told, messages = words(slow)

    assert [data for _, _, data in messages] == [b"aaa0", b"bbb0", b"aaa4", b"bbb4"]
    assert (slow.dropped, quick.dropped) == (8, 0)
    assert told == [
        {
            "op": "status",
            "level": 1,
            "message": "this viewer is too slow: 8 messages were left out, 8 in all",
        }
    ]
    assert words(slow) == ([], [])


def test_a_message_larger_than_all_room_is_sent_when_nothing_else_waits(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(channels_module, "MOST_BYTES", 10)
    channels = opened("/a")
    viewer = joined(channels)
    subscribe(viewer, (1, 1))
    words(viewer)

    channels.add("/a", "s", bytes(50), 2)

    assert words(viewer) == ([], [(1, 2, bytes(50))])


def test_another_mission_makes_viewers_forget_the_one_before() -> None:
    channels = opened("/a")
    viewer = joined(channels)
    subscribe(viewer, (1, 1))
    words(viewer)
    channels.add("/a", "s", b'"late"', 2)

    channels.begin("second")
    channels.define("s", b"{}")
    channels.add("/a", "s", b'"new"', 3)

    told, messages = words(viewer)
    assert messages == []
    assert [word["op"] for word in told] == ["unadvertise", "serverInfo", "advertise"]
    assert told[0]["channelIds"] == [1]
    assert told[1]["sessionId"] == "second"
    assert told[2]["channels"][0]["id"] == 2
    subscribe(viewer, (1, 2))
    assert words(viewer) == ([], [(1, 3, b'"new"')])


@pytest.mark.parametrize(
    ("said", "answer"),
    [
        (b"\x01", "nothing is taken in here: this server only shows"),
        ("no JSON", "this is no word of the protocol"),
        ("[" * 100_000, "this is no word of the protocol"),
        ("7", "this is no word of the protocol"),
        ('{"op":"subscribe"}', "this is no word of the protocol"),
        ('{"op":"subscribe","subscriptions":[{"id":-1,"channelId":1}]}', "this is no word of"),
        ('{"op":"subscribe","subscriptions":[{"id":true,"channelId":1}]}', "this is no word of"),
        ('{"op":"subscribe","subscriptions":[{"id":1,"channelId":9}]}', "there is no channel 9"),
        ('{"op":"subscribe","subscriptions":[{"id":5,"channelId":1}]}', "channel 1 is subscribed"),
        (
            '{"op":"subscribe","subscriptions":[{"id":4,"channelId":2}]}',
            "subscription 4 is another",
        ),
        ('{"op":"unsubscribe","subscriptionIds":[[]]}', "this is no word of the protocol"),
    ],
)
def test_what_cannot_be_done_is_told_to_the_viewer(said: str | bytes, answer: str) -> None:
    channels = opened("/a", "/b")
    viewer = joined(channels)
    subscribe(viewer, (4, 1))
    words(viewer)

    viewer.says(said)

    told, messages = words(viewer)
    assert messages == []
    assert [(word["op"], word["level"]) for word in told] == [("status", 2)]
    assert told[0]["message"].startswith(answer)


def test_what_is_not_offered_is_passed_over() -> None:
    viewer = joined(opened("/a"))
    words(viewer)

    viewer.says('{"op":"clientInfo","name":"viewer"}')
    viewer.says('{"op":"subscribeConnectionGraph"}')

    assert words(viewer) == ([], [])
