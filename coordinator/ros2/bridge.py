"""Between a mission and ROS 2: says what has changed, gives orders that come, tells their results.

It is looked after every `LOOK_S`; it knows neither Zenoh nor the clock.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from typing import Any, Final, Protocol

from coordinator.dashboard.source import CommandState, DashboardSource, RefusedError
from coordinator.ros2.message_types import Fields
from coordinator.ros2.mirror import RosMessage, mirrored
from coordinator.ros2.services import SERVICES, RosService

LOOK_S: Final = 0.1
"""How often requests are looked for [wall s]."""
REPEAT_S: Final = 1.0
"""After that, what has not changed is said again [wall s]: for who has come since."""
MOST_OPEN: Final = 64
"""Orders under way; further requests are refused meanwhile."""


class RosCall(Protocol):
    """One request of a service."""

    @property
    def service(self) -> RosService:
        """Which one."""
        ...

    @property
    def asked(self) -> Mapping[str, Any] | None:
        """Its fields; None where they cannot be read."""
        ...

    def answer(self, fields: Fields) -> None:
        """Tell whoever asked what came of it; once."""
        ...


class RosGraph(Protocol):
    """Our node in the ROS 2 graph."""

    def say(self, message: RosMessage) -> None:
        """Publish a message, stamped with this moment."""
        ...

    def retain(self, topics: Collection[str]) -> None:
        """Take all other topics out of the graph."""
        ...

    def serve(self, service: RosService) -> None:
        """Take requests of a service, which `calls` gives."""
        ...

    def calls(self) -> Iterator[RosCall]:
        """Requests that have come since."""
        ...


class RosBridge:
    """Mirrors a source, and gives it the orders of a graph.

    Args:
        node: name of the node, with which its topics begin.
        period_s: of what moves [wall s].
        takes_orders: whether services are offered.
    """

    def __init__(
        self,
        source: DashboardSource,
        graph: RosGraph,
        node: str,
        *,
        period_s: float,
        takes_orders: bool,
    ) -> None:
        self._source = source
        self._graph = graph
        self._node = node
        self._period_s = period_s
        self._say_at_s = 0.0
        self._said: dict[str, tuple[Fields, float]] = {}
        """By topic: what was said last, and when."""
        self._open: dict[int, RosCall] = {}
        """Requests under way, by the number of their order."""
        if takes_orders:
            for service in SERVICES:
                graph.serve(service)

    def look(self, wall_s: float) -> None:
        """Answer, and say what is to be said at ``wall_s``, a monotonic instant [wall s]."""
        for call in self._graph.calls():
            self._take(call)
        if self._open:
            self._tell_results()
        if self._say_at_s <= wall_s:
            self._say_at_s = wall_s + self._period_s
            self._mirror(wall_s)

    def end(self, reason: str) -> None:
        """Tell all who wait that nothing more will be known."""
        for call in self._open.values():
            call.answer(call.service.refusal(reason))
        self._open.clear()

    def _mirror(self, wall_s: float) -> None:
        mission_state = self._source.mission_state
        if mission_state is None:
            return
        messages = mirrored(mission_state, self._node, self._source.now_s())
        for message in messages:
            before = self._said.get(message.topic)
            same = before is not None and before[0] == message.fields
            if same and before is not None and wall_s < before[1] + REPEAT_S:
                continue
            self._said[message.topic] = message.fields, wall_s
            self._graph.say(message)
        topics = {message.topic for message in messages}
        if gone := self._said.keys() - topics:
            self._graph.retain(topics)
            for topic in gone:
                del self._said[topic]

    def _take(self, call: RosCall) -> None:
        service, orders = call.service, self._source.orders
        if call.asked is None:
            call.answer(service.refusal(f"this is no request of {service.type}"))
        elif orders is None:
            call.answer(service.refusal("nobody takes orders here"))
        elif len(self._open) >= MOST_OPEN:
            call.answer(service.refusal("too many orders are under way; ask again later"))
        else:
            try:
                number = orders.give(service.wish(call.asked), "ros2")
            except (RefusedError, ValueError) as fault:
                call.answer(service.refusal(str(fault)))
            else:
                self._open[number] = call

    def _tell_results(self) -> None:
        rows = {row.n: row for row in self._source.commands}
        for number, call in list(self._open.items()):
            row = rows.get(number)
            if row is None:
                call.answer(call.service.refusal("it is not known what came of it"))
                del self._open[number]
            elif row.state is not CommandState.PENDING:
                call.answer(call.service.answer(row))
                del self._open[number]
