"""Our node in the ROS 2 graph: a Zenoh session with what it publishes and serves.

Publishes messages and tokens, and answers requests, by the keys of `coordinator.ros2.wire`;
subscribes to nothing. One thread makes all calls into Zenoh, as in `swarm.bus`; what is not sent
in time is dropped, as the next message is newer.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Final

import zenoh
from zenoh.handlers import RingChannel

from coordinator.ros2.bridge import RosCall
from coordinator.ros2.message_types import Fields, MalformedError, MessageTypes
from coordinator.ros2.mirror import RosMessage
from coordinator.ros2.services import RosService
from coordinator.ros2.wire import Attachment, EntityKind, RosEndpoint, RosNode
from swarm.bus.config import DEFAULT_LEASE_S, config_file_fault
from swarm.bus.zenoh_session import close_session, open_session, plain_error, session_config
from swarm.runtime.clock import unix_ns
from swarm.runtime.errors import BusError
from swarm.runtime.log import get_logger
from swarm.runtime.writer_thread import WriterThread

MOST_WAITING: Final = 64
"""Requests of one service that have not been looked at; then the oldest goes unanswered."""
_OPEN_S: Final = 30.0
_CLOSE_S: Final = 1.0


@dataclass(slots=True)
class _Topic:
    """Something that is published."""

    endpoint: RosEndpoint
    publisher: zenoh.Publisher | None = None
    """Once the thread has made it."""
    token: zenoh.LivelinessToken | None = None
    said: int = 0


@dataclass(slots=True)
class _Served:
    """A service."""

    service: RosService
    queryable: zenoh.Queryable[Any]
    token: zenoh.LivelinessToken


@dataclass(frozen=True, slots=True)
class _Call:
    """One request, to be answered once."""

    service: RosService
    asked: Mapping[str, Any] | None
    key: str
    query: zenoh.Query
    attachment: Attachment
    types: MessageTypes
    writer: WriterThread

    def answer(self, fields: Fields) -> None:
        """Tell whoever asked what came of it."""
        payload = self.types.encode(f"{self.service.type}_Response", fields)
        # An answer is known by the number and the client of its request.
        told = Attachment(self.attachment.sequence, unix_ns(), self.attachment.gid)
        self.writer.submit(lambda: self._send(payload, told.encode()), size_bytes=len(payload))

    def _send(self, payload: bytes, attachment: bytes) -> None:
        try:
            self.query.reply(self.key, payload, attachment=attachment)
        except zenoh.ZError as fault:
            get_logger("ros2").warning("an answer was lost", reason=plain_error(fault))
        finally:
            self.query.drop()


class ZenohRosGraph:
    """The node, as long as its session is open; use `open_ros_graph`."""

    def __init__(self, session: zenoh.Session, domain_id: int, name: str) -> None:
        self._types = MessageTypes()
        self._session = session
        self._node = RosNode(domain_id, name, str(session.zid()))
        self._writer = WriterThread("ros2")
        self._topics: dict[str, _Topic] = {}
        self._served: list[_Served] = []
        self._numbers = 0
        self._tokens: list[zenoh.LivelinessToken] = []
        self._call(lambda: self._tokens.append(self._declared(self._node.token)))

    def say(self, message: RosMessage) -> None:
        """Publish a message, stamped with this moment."""
        stamp_ns = unix_ns()
        fields = message.fields
        if "header" in fields:
            seconds, nanoseconds = divmod(stamp_ns, 10**9)
            stamp = {"sec": seconds, "nanosec": nanoseconds}
            fields = {**fields, "header": {**fields["header"], "stamp": stamp}}
        topic = self._topics.get(message.topic) or self._begun(message)
        topic.said += 1
        payload = self._types.encode(message.type, fields)
        attachment = Attachment(topic.said, stamp_ns, topic.endpoint.gid).encode()

        def put() -> None:
            if topic.publisher is not None:
                topic.publisher.put(payload, attachment=attachment)

        self._call(put, size_bytes=len(payload), must_run=False)

    def retain(self, topics: Collection[str]) -> None:
        """Take all other topics out of the graph."""
        for name in self._topics.keys() - set(topics):
            topic = self._topics.pop(name)
            self._call(partial(_ended, topic))

    def serve(self, service: RosService) -> None:
        """Take requests of a service, which `calls` gives."""
        name = f"/{self._node.name}/{service.name}"
        endpoint = self._endpoint(EntityKind.SERVICE, name, service.type)

        def begin() -> None:
            queryable = self._session.declare_queryable(
                endpoint.key, RingChannel(MOST_WAITING), complete=True
            )
            self._served.append(_Served(service, queryable, self._declared(endpoint.token)))

        self._call(begin)

    def calls(self) -> Iterator[RosCall]:
        """Requests that have come since."""
        for served in list(self._served):
            while (query := served.queryable.try_recv()) is not None:
                if (call := self._call_of(served.service, query)) is not None:
                    yield call

    def close(self) -> None:
        """Leave the graph."""
        self._writer.close(_CLOSE_S)
        close_session(self._session, limit_s=_CLOSE_S)

    def _begun(self, message: RosMessage) -> _Topic:
        endpoint = self._endpoint(EntityKind.PUBLISHER, message.topic, message.type)
        topic = self._topics[message.topic] = _Topic(endpoint)

        def begin() -> None:
            control = zenoh.CongestionControl.DROP
            topic.publisher = self._session.declare_publisher(
                endpoint.key, congestion_control=control
            )
            topic.token = self._declared(endpoint.token)

        self._call(begin)
        return topic

    def _endpoint(self, kind: EntityKind, name: str, typ: str) -> RosEndpoint:
        self._numbers += 1
        return self._node.endpoint(self._numbers, kind, name, typ, self._types.hash_of(typ))

    def _declared(self, token: str) -> zenoh.LivelinessToken:
        return self._session.liveliness().declare_token(token)

    def _call_of(self, service: RosService, query: zenoh.Query) -> RosCall | None:
        """A request; None of what no client of ROS 2 would ask."""
        attachment = None if query.attachment is None else query.attachment.to_bytes()
        told = None if attachment is None else Attachment.decode(attachment)
        if told is None or query.payload is None:
            query.drop()
            return None
        try:
            asked = self._types.decode(f"{service.type}_Request", query.payload.to_bytes())
        except MalformedError:
            asked = None
        key = str(query.key_expr)
        return _Call(service, asked, key, query, told, self._types, self._writer)

    def _call(
        self, call: Callable[[], object], *, size_bytes: int = 0, must_run: bool = True
    ) -> None:
        def run() -> None:
            try:
                call()
            except zenoh.ZError as fault:
                get_logger("ros2").warning("ROS 2 was not told", reason=plain_error(fault))

        self._writer.submit(run, size_bytes=size_bytes, must_run=must_run)


def _ended(topic: _Topic) -> None:
    if topic.token is not None:
        topic.token.undeclare()
    if topic.publisher is not None:
        topic.publisher.undeclare()


async def open_ros_graph(place: str | Path, domain_id: int, name: str) -> ZenohRosGraph:
    """A node of that name, in the graph of a router or of a Zenoh configuration file.

    Waits for the router as long as it takes.

    Raises:
        BusError: it cannot be opened at all.
        InputError: the file cannot be read.
    """
    if isinstance(place, Path):
        try:
            config = zenoh.Config.from_file(str(place))
        except zenoh.ZError as fault:
            raise config_file_fault(place, plain_error(fault)) from None
        return ZenohRosGraph(await open_session(config, timeout_s=_OPEN_S), domain_id, name)
    config = session_config("client", listen=(), connect=(place,), lease_s=DEFAULT_LEASE_S)
    while True:
        try:
            session = await open_session(config, timeout_s=_OPEN_S)
        except BusError:
            get_logger("ros2").warning("no router of ROS 2 yet", at=place)
        else:
            return ZenohRosGraph(session, domain_id, name)
