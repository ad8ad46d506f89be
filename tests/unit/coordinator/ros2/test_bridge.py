"""The bridge between a mission and ROS 2: what it says again, and what comes of orders."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import pytest

from coordinator.dashboard.source import CommandRow, CommandState, Refusal, RefusedError
from coordinator.mission_view.mission_state import MissionState
from coordinator.operator.commands import CommandRequest
from coordinator.operator.requests import OperatorRequest
from coordinator.operator.task_edits import NewTask, TaskWithdrawal, Wgs84
from coordinator.ros2.bridge import MOST_OPEN, REPEAT_S, RosBridge
from coordinator.ros2.message_types import Fields, MessageTypes
from coordinator.ros2.mirror import RosMessage
from coordinator.ros2.services import SERVICES, RosService
from swarm.model import Mission, Task, TaskId, Uav, UavId
from swarm.model.ids import COORDINATOR
from swarm.protocol.messages import CommandKind
from swarm.protocol.uav_messages import StatusPhase
from tests.support.builders import brief
from tests.support.observed_mission import Teller

MISSION = Mission(
    "told",
    900.0,
    (Uav(UavId("u1"), (0.0, 0.0, 0.0), 5.0),),
    (Task(TaskId("t1"), (30.0, 40.0, 0.0), 2.0),),
)
TYPES = MessageTypes()
BY_NAME = {service.name: service for service in SERVICES}
PERIOD_S = 0.25


@dataclass(eq=False)
class Call:
    """One request that a test makes."""

    service: RosService
    asked: Mapping[str, Any] | None
    answers: list[Fields] = field(default_factory=list)

    def answer(self, fields: Fields) -> None:
        TYPES.encode(f"{self.service.type}_Response", fields)
        self.answers.append(fields)


class Graph:
    """What a ROS 2 graph is told."""

    def __init__(self) -> None:
        self.said: list[RosMessage] = []
        self.served: list[str] = []
        self.retained: list[set[str]] = []
        self.waiting: list[Call] = []

    def say(self, message: RosMessage) -> None:
        self.said.append(message)

    def retain(self, topics: Collection[str]) -> None:
        self.retained.append(set(topics))

    def serve(self, service: RosService) -> None:
        self.served.append(service.name)

    def calls(self) -> Iterator[Call]:
        while self.waiting:
            yield self.waiting.pop(0)

    def ask(self, name: str, **asked: Any) -> Call:
        """A request as its bytes would be read."""
        typ = f"{BY_NAME[name].type}_Request"
        call = Call(BY_NAME[name], TYPES.decode(typ, TYPES.encode(typ, asked)))
        self.waiting.append(call)
        return call

    def topics(self) -> set[str]:
        """Said since it was last asked."""
        topics = {message.topic for message in self.said}
        self.said.clear()
        return topics


class Source:
    """A mission and its orders, both played by the test."""

    def __init__(self) -> None:
        self.mission_state: MissionState | None = None
        self.link = True
        self.speedup = 1.0
        self.dropped: dict[str, int] = {}
        self.commands: list[CommandRow] = []
        self.orders: Source | None = self
        self.player = None
        self.wishes: list[OperatorRequest] = []
        self.refuses: str | None = None

    def now_s(self) -> float:
        return 1.0

    def give(self, wish: OperatorRequest, who: str) -> int:
        assert who == "ros2"
        if self.refuses is not None:
            raise RefusedError(Refusal.WRONG, self.refuses)
        self.wishes.append(wish)
        number = len(self.wishes)
        self.commands.append(CommandRow(number, str(wish), CommandState.PENDING, ""))
        return number

    def end(self, number: int, state: CommandState, text: str, task: str | None = None) -> None:
        self.commands[number - 1] = CommandRow(number, "", state, text, task)


@pytest.fixture
def graph() -> Graph:
    return Graph()


@pytest.fixture
def source() -> Source:
    return Source()


def bridge_of(source: Source, graph: Graph, *, takes_orders: bool = True) -> RosBridge:
    return RosBridge(source, graph, "n", period_s=PERIOD_S, takes_orders=takes_orders)


def teller() -> Teller:
    told = Teller(MISSION)
    told.say(COORDINATOR, brief(*MISSION.uavs))
    told.begin()
    return told


def test_what_has_changed_is_said_at_once_and_the_rest_once_a_second(
    source: Source, graph: Graph
) -> None:
    told = teller()
    source.mission_state = told.mission_state
    bridge = bridge_of(source, graph)

    bridge.look(0.0)
    everything = graph.topics()
    assert "/n/status" in everything
    assert "/n/uav/u1/odometry" not in everything

    bridge.look(PERIOD_S / 2.0)
    assert graph.topics() == set(), "not before its period is over"
    bridge.look(PERIOD_S)
    assert graph.topics() == set(), "nothing has changed"

    told.status("u1", StatusPhase.FLYING, position_enu_m=(1.0, 0.0, 0.0))
    bridge.look(2.0 * PERIOD_S)
    changed = graph.topics()
    assert {"/n/uav/u1/odometry", "/n/uav/u1/position", "/n/uavs", "/n/markers"} <= changed
    assert not {"/n/tasks", "/n/plan", "/n/status"} & changed

    bridge.look(REPEAT_S + 2.0 * PERIOD_S)
    assert graph.topics() == everything | changed
    assert graph.retained == []


def test_topics_of_a_mission_that_is_over_leave_the_graph(source: Source, graph: Graph) -> None:
    source.mission_state = teller().mission_state
    bridge = bridge_of(source, graph)
    bridge.look(0.0)
    source.mission_state = Teller(MISSION).mission_state

    bridge.look(PERIOD_S)

    assert graph.retained == [set()]


def test_a_mirror_that_takes_no_orders_offers_no_services(source: Source, graph: Graph) -> None:
    bridge_of(source, graph, takes_orders=False)
    assert graph.served == []
    bridge_of(source, graph)
    assert graph.served == ["add_task", "withdraw_task", "hold", "resume", "return"]


def test_an_order_is_answered_once_it_is_known_what_came_of_it(
    source: Source, graph: Graph
) -> None:
    bridge = bridge_of(source, graph)
    call = graph.ask("add_task", points=[{"x": 1.0, "y": 2.0}], reason="smoke")

    bridge.look(0.0)
    assert source.wishes == [NewTask((1.0, 2.0, 0.0), reason="smoke")]
    assert call.answers == []

    source.end(1, CommandState.OBEYED, "op1 is on the board", "op1")
    bridge.look(0.1)
    bridge.look(0.2)
    told = {"success": True, "message": "op1 is on the board", "task": "op1"}
    assert call.answers == [told]


def test_requests_mean_what_their_fields_say(source: Source, graph: Graph) -> None:
    bridge = bridge_of(source, graph)
    places = [{"latitude": 46.8, "longitude": 9.7, "altitude": 5.0}]
    graph.ask("add_task", geo_points=places, task="t9", value=4.0, service_s=3.0, kind="photo")
    graph.ask("add_task", geo_points=places, use_altitude=True)
    graph.ask("add_task", points=[{"x": 1.0}, {"y": 2.0}], due_s=90.0, opens_s=5.0, closes_s=60.0)
    graph.ask("withdraw_task", task="t1", reason="done by hand")
    graph.ask("hold", uav="u1", reason="helicopter")
    graph.ask("resume", uav="u1")
    graph.ask("return", uav="u1")

    bridge.look(0.0)

    assert source.wishes == [
        NewTask(Wgs84(46.8, 9.7), task="t9", value=4.0, service_s=3.0, kind="photo"),
        NewTask(Wgs84(46.8, 9.7, 5.0)),
        NewTask(
            None, path=((1.0, 0.0, 0.0), (0.0, 2.0, 0.0)), due_s=90.0, opens_s=5.0, closes_s=60.0
        ),
        TaskWithdrawal("t1", "done by hand"),
        CommandRequest(CommandKind.HOLD, "u1", "helicopter"),
        CommandRequest(CommandKind.RESUME, "u1"),
        CommandRequest(CommandKind.RETURN, "u1"),
    ]


@pytest.mark.parametrize(
    ("name", "asked", "text"),
    [
        ("add_task", {}, "give either points or geo_points"),
        ("add_task", {"points": [{}], "geo_points": [{}]}, "give either points or geo_points"),
        (
            "add_task",
            {"points": [{"x": float("nan")}]},
            "position must be within -1e+08..1e+08, not nan",
        ),
        (
            "add_task",
            {"geo_points": [{"latitude": 91.0}]},
            "latitude must be within -90..90, not 91",
        ),
        ("hold", {}, "name the one UAV that it is for"),
        ("return", {"uav": "fleet"}, "name the one UAV that it is for"),
        ("resume", {"uav": "u1", "reason": "x" * 151}, "a reason has at most 150 characters"),
    ],
)
def test_what_makes_no_sense_is_refused(
    source: Source, graph: Graph, name: str, asked: dict[str, Any], text: str
) -> None:
    call = graph.ask(name, **asked)

    bridge_of(source, graph).look(0.0)

    assert call.answers == [{"success": False, "message": text}]
    assert source.wishes == []


def test_every_request_is_answered_whatever_becomes_of_it(source: Source, graph: Graph) -> None:
    bridge = bridge_of(source, graph)
    unreadable = Call(BY_NAME["hold"], None)
    graph.waiting.append(unreadable)
    bridge.look(0.0)
    assert unreadable.answers[0]["message"] == "this is no request of peckorder_msgs/srv/CommandUav"

    source.refuses = "no such UAV: the fleet is u1"
    refused = graph.ask("hold", uav="u9")
    bridge.look(0.1)
    assert refused.answers == [{"success": False, "message": "no such UAV: the fleet is u1"}]

    source.refuses = None
    under_way = [graph.ask("hold", uav="u1") for _ in range(MOST_OPEN + 1)]
    bridge.look(0.2)
    assert [len(call.answers) for call in under_way] == [0] * MOST_OPEN + [1]
    source.end(1, CommandState.NOT_OBEYED, "u1 has not been heard of")
    del source.commands[1]
    bridge.look(0.3)
    assert under_way[0].answers == [{"success": False, "message": "u1 has not been heard of"}]
    assert under_way[1].answers[0]["message"] == "it is not known what came of it"

    bridge.end("it has ended")
    assert [len(call.answers) for call in under_way] == [1] * (MOST_OPEN + 1)
    assert under_way[2].answers == [{"success": False, "message": "it has ended"}]
