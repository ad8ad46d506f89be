"""Channels of a live mission, and what waits for each viewer.

The messages are those of a recording. A topic is a channel; of each the newest messages are kept,
so that who comes late sees how everything stands. What a viewer is too slow for is left out and
counted, never waited for; when it has caught up it is told the newest of each such channel, and how
many it missed. Pure: words go in, words come out; coordinator.foxglove.server has the sockets.

Protocol: https://github.com/foxglove/ws-protocol/blob/main/docs/spec.md.
"""

from __future__ import annotations

import json
import struct
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any, Final

MOST_BYTES: Final = 8 << 20
"""Of messages that wait for one viewer."""
KEPT_LINES: Final = 200
"""Of the topic `/log`, whose messages are lines; of others the newest says all."""
LOG_TOPIC: Final = "/log"
_MESSAGE_DATA: Final = 1
"""Opcode of a binary message."""
_HIGHEST_ID: Final = 2**32 - 1


class StatusLevel(IntEnum):
    """How a viewer shows what it is told of the connection."""

    INFO = 0
    WARNING = 1
    ERROR = 2


@dataclass(frozen=True, slots=True)
class LiveMessage:
    """One message of a channel."""

    channel: int
    log_ns: int
    """By the wall's clock."""
    data: bytes

    def to(self, subscription: int) -> bytes:
        """As it is sent to who has subscribed under that number."""
        head = struct.pack("<BIQ", _MESSAGE_DATA, subscription, self.log_ns)
        return head + self.data


@dataclass(frozen=True, slots=True)
class _Channel:
    id: int
    topic: str
    schema: str
    kept: deque[LiveMessage]


class LiveChannels:
    """A line sink whose lines are heard by viewers.

    Args:
        name: of the server, as viewers show it.
    """

    def __init__(self, name: str) -> None:
        self.viewers: list[Viewer] = []
        self._name = name
        self._session = ""
        self._schemas: dict[str, str] = {}
        self._channels: dict[str, _Channel] = {}
        self._next = 1
        """Numbers of channels are never used again: viewers keep what they know by them."""

    def begin(self, session: str) -> None:
        """Forget the mission before; viewers forget it too."""
        gone = [channel.id for channel in self._channels.values()]
        self._session, self._schemas, self._channels = session, {}, {}
        for viewer in self.viewers:
            viewer.begin_anew(gone)
            viewer.tell(self.info)

    def define(self, schema: str, data: bytes) -> None:
        """Publish a JSON schema under a name."""
        self._schemas[schema] = data.decode()

    def add(self, topic: str, schema: str, data: bytes, log_ns: int) -> None:
        """One message, for all who have subscribed to its topic."""
        channel = self._channels.get(topic)
        if channel is None:
            kept: deque[LiveMessage] = deque(maxlen=KEPT_LINES if topic == LOG_TOPIC else 1)
            channel = _Channel(self._next, topic, schema, kept)
            self._next += 1
            self._channels[topic] = channel
            for viewer in self.viewers:
                viewer.tell(self._advertise([channel]))
        message = LiveMessage(channel.id, log_ns, data)
        channel.kept.append(message)
        for viewer in self.viewers:
            viewer.hear(message)

    def join(self, wake: Callable[[], None]) -> Viewer:
        """Another viewer, who is told what there is; ``wake`` is called when something waits."""
        viewer = Viewer(self.kept, wake)
        viewer.tell(self.info)
        viewer.tell(self._advertise(list(self._channels.values())))
        self.viewers.append(viewer)
        return viewer

    def leave(self, viewer: Viewer) -> None:
        """Nothing more is for that viewer."""
        self.viewers.remove(viewer)

    def kept(self, channel: int) -> tuple[LiveMessage, ...] | None:
        """The newest messages of a channel, oldest first; None when there is no such channel."""
        for known in self._channels.values():
            if known.id == channel:
                return tuple(known.kept)
        return None

    @property
    def info(self) -> dict[str, Any]:
        """Who serves; another session makes viewers forget what they have shown."""
        told = {"op": "serverInfo", "name": self._name, "capabilities": []}
        return told | ({"sessionId": self._session} if self._session else {})

    def _advertise(self, channels: list[_Channel]) -> dict[str, Any]:
        told = [
            {
                "id": channel.id,
                "topic": channel.topic,
                "encoding": "json",
                "schemaName": channel.schema,
                "schema": self._schemas[channel.schema],
                "schemaEncoding": "jsonschema",
            }
            for channel in channels
        ]
        return {"op": "advertise", "channels": told}


@dataclass(slots=True)
class Viewer:
    """Who looks on: its subscriptions, and what waits to be sent to it."""

    kept: Callable[[int], tuple[LiveMessage, ...] | None]
    wake: Callable[[], None]
    dropped: int = 0
    """Messages that were left out since the viewer was too slow."""
    _told: int = 0
    """Of these it has been told."""
    _subscribed: dict[int, int] = field(default_factory=dict)
    """Channel -> number of its subscription."""
    _missed: set[int] = field(default_factory=set)
    """Channels of which something was left out."""
    _waiting: deque[str | tuple[int, LiveMessage]] = field(default_factory=deque)
    _bytes: int = 0

    # -- to the viewer ------------------------------------------------------------------

    def tell(self, word: dict[str, Any]) -> None:
        """Tell something that is no message of a channel; it is never left out."""
        self._waiting.append(json.dumps(word, separators=(",", ":")))
        self.wake()

    def warn(self, text: str, level: StatusLevel = StatusLevel.ERROR) -> None:
        """Have it show a line."""
        self.tell({"op": "status", "level": level, "message": text})

    def hear(self, message: LiveMessage) -> None:
        """Have a message wait for it, if it has subscribed and there is room."""
        subscription = self._subscribed.get(message.channel)
        if subscription is None:
            return
        if self._bytes and self._bytes + len(message.data) > MOST_BYTES:
            self.dropped += 1
            self._missed.add(message.channel)
            return
        self._bytes += len(message.data)
        self._waiting.append((subscription, message))
        self.wake()

    def begin_anew(self, gone: list[int]) -> None:
        """Its channels are gone, and with them whatever waited."""
        self._subscribed, self._missed, self._bytes = {}, set(), 0
        self._waiting.clear()
        if gone:
            self.tell({"op": "unadvertise", "channelIds": gone})

    def take(self) -> Iterator[str | bytes]:
        """All that waits, one word after the other, also what comes meanwhile."""
        while self._waiting or self._missed:
            if not self._waiting:
                self._catch_up()
                continue
            word = self._waiting.popleft()
            if isinstance(word, str):
                yield word
                continue
            subscription, message = word
            self._bytes -= len(message.data)
            yield message.to(subscription)

    def _catch_up(self) -> None:
        missed, self._missed = sorted(self._missed), set()
        new, self._told = self.dropped - self._told, self.dropped
        text = f"this viewer is too slow: {new} messages were left out, {self.dropped} in all"
        self.warn(text, StatusLevel.WARNING)
        for channel in missed:
            for message in (self.kept(channel) or ())[-1:]:
                self.hear(message)

    # -- from the viewer ----------------------------------------------------------------

    def says(self, said: str | bytes) -> None:
        """Do what it asks for, or tell why not; what is not offered at all is passed over."""
        if isinstance(said, bytes):
            self.warn("nothing is taken in here: this server only shows")
            return
        try:
            word = json.loads(said)
            match word["op"]:
                case "subscribe":
                    for each in word["subscriptions"]:
                        self._subscribe(_number(each["id"]), _number(each["channelId"]))
                case "unsubscribe":
                    ids = {_number(each) for each in word["subscriptionIds"]}
                    kept = {c: s for c, s in self._subscribed.items() if s not in ids}
                    self._missed &= kept.keys()
                    self._subscribed = kept
        except (ValueError, KeyError, TypeError, RecursionError):
            self.warn("this is no word of the protocol")

    def _subscribe(self, subscription: int, channel: int) -> None:
        kept = self.kept(channel)
        if kept is None:
            self.warn(f"there is no channel {channel}")
        elif channel in self._subscribed:
            self.warn(f"channel {channel} is subscribed already")
        elif subscription in self._subscribed.values():
            self.warn(f"subscription {subscription} is another channel's")
        else:
            self._subscribed[channel] = subscription
            for message in kept:
                self.hear(message)


def _number(said: object) -> int:
    if type(said) is not int or not 0 <= said <= _HIGHEST_ID:
        raise ValueError(said)
    return said
