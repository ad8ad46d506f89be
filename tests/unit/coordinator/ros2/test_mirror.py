"""What ROS 2 is told of a mission, message by message."""

from __future__ import annotations

import math
from typing import Any

import pytest

from coordinator.ros2.message_types import MessageTypes
from coordinator.ros2.mirror import FRAME, mirrored
from swarm.model import Mission, Origin, Task, TaskId, Uav, UavId
from swarm.model.frames import wgs84_from_enu
from swarm.model.ids import COORDINATOR, OPERATOR
from swarm.protocol.field_messages import ZoneEdit, ZoneSpec
from swarm.protocol.messages import PlanEpoch
from swarm.protocol.uav_messages import Status, StatusPhase
from tests.support.builders import brief
from tests.support.observed_mission import Teller, shipped, watch

ORIGIN = Origin(47.0, 8.0, 400.0)
"""That of the brief of `tests.support.builders`."""
MISSION = Mission(
    "told",
    900.0,
    (Uav(UavId("uav-1"), (0.0, 0.0, 0.0), 5.0), Uav(UavId("uav-2"), (5.0, 0.0, 0.0), 5.0)),
    (
        Task(TaskId("t1"), (30.0, 40.0, 0.0), 2.0),
        Task(TaskId("t2"), (60.0, 0.0, 0.0), 3.0),
    ),
    origin=ORIGIN,
)
TYPES = MessageTypes()


@pytest.fixture
def teller() -> Teller:
    told = Teller(MISSION)
    told.say(COORDINATOR, brief(*MISSION.uavs, layer_m=0.0))
    told.begin()
    return told


def told_by(teller: Teller, now_s: float = 1.0) -> dict[str, dict[str, Any]]:
    """What is read of each topic, in bytes and back."""
    said = mirrored(teller.mission_state, "peckorder", now_s)
    assert len({message.topic for message in said}) == len(said)
    return {
        message.topic.removeprefix("/peckorder/"): TYPES.decode(
            message.type, TYPES.encode(message.type, message.fields)
        )
        for message in said
    }


def test_nothing_is_told_before_there_is_a_mission() -> None:
    assert mirrored(Teller(MISSION).mission_state, "peckorder", 0.0) == []


def test_how_the_mission_is_and_what_became_of_its_tasks(teller: Teller) -> None:
    teller.claim("uav-1", "t1", 8.0)
    teller.end("uav-2", "t2", 0.5)

    told = told_by(teller)

    status = told["status"]
    assert (status["mission"], status["phase"], status["rule"]) == ("told", "running", "greedy")
    counts = {name: status[name] for name in ("open", "taken", "done", "failed", "left_out")}
    assert counts == {"open": 0, "taken": 1, "done": 1, "failed": 0, "left_out": 0}
    assert status["coordinator"]
    assert not status["aborted"]
    assert math.isnan(status["nearest_m"])
    tasks = {task["id"]: task for task in told["tasks"]["tasks"]}
    assert (tasks["t1"]["state"], tasks["t1"]["uav"], tasks["t1"]["value"]) == ("taken", "uav-1", 2)
    assert (tasks["t2"]["state"], tasks["t2"]["uav"]) == ("done", "uav-2")
    assert tasks["t1"]["position"] == {"x": 30.0, "y": 40.0, "z": 0.0}


def test_what_uavs_claim_and_the_plan_in_force(teller: Teller) -> None:
    teller.claim("uav-1", "t1", 8.0)
    lists = {"uav-1": ("t1",), "uav-2": ("t2",)}
    sequence = ("uav-2", "uav-1")
    running = teller.mission_state.phase
    teller.say(COORDINATOR, PlanEpoch(2, running, "lookahead", sequence, 0.5, "anew", lists))

    told = told_by(teller)

    (claim,) = told["claims"]["claims"]
    assert (claim["uav"], claim["phase"], claim["task"]) == ("uav-1", "held", "t1")
    assert claim["completion_s"] == 8.0
    plan = told["plan"]
    assert (plan["epoch"], plan["rule"], plan["reason"]) == (2, "lookahead", "anew")
    assert plan["sequence"] == ["uav-2", "uav-1"]
    assert plan["lists"] == [
        {"uav": "uav-1", "tasks": ["t1"]},
        {"uav": "uav-2", "tasks": ["t2"]},
    ]


def test_where_a_uav_is_and_where_it_flies(teller: Teller) -> None:
    teller.claim("uav-1", "t1", 8.0)
    told = Status(
        StatusPhase.FLYING, "t1", (10.0, 20.0, 1.0), (0.0, 3.0, 0.5), 0.5, 0.5, {}, "", layer_m=30.0
    )
    teller.say("uav-1", told)
    teller.say(
        COORDINATOR,
        PlanEpoch(2, teller.mission_state.phase, "greedy", (), 0.5, "", {"uav-1": ("t1", "t2")}),
    )

    seen = told_by(teller)

    odometry = seen["uav/uav_1/odometry"]
    assert (odometry["header"]["frame_id"], odometry["child_frame_id"]) == (FRAME, "uav_1")
    assert odometry["pose"]["pose"]["position"] == {"x": 10.0, "y": 20.0, "z": 31.0}
    north = odometry["pose"]["pose"]["orientation"]
    assert (north["z"], north["w"]) == pytest.approx((math.sin(math.pi / 4), math.cos(math.pi / 4)))
    assert odometry["twist"]["twist"]["linear"] == {"x": 3.0, "y": 0.0, "z": 0.5}
    earth = seen["uav/uav_1/position"]["position"]
    assert (earth["latitude"], earth["longitude"], earth["altitude"]) == wgs84_from_enu(
        ORIGIN, (10.0, 20.0, 31.0)
    )
    path = [pose["pose"]["position"] for pose in seen["uav/uav_1/path"]["poses"]]
    assert [tuple(at.values()) for at in path] == [
        (10.0, 20.0, 31.0),
        (30.0, 40.0, 31.0),
        (60.0, 0.0, 31.0),
    ]
    row = seen["uavs"]["uavs"][0]
    assert (row["id"], row["does"], row["task"], row["present"]) == ("uav-1", "flying", "t1", True)
    assert row["velocity"] == {"x": 0.0, "y": 3.0, "z": 0.5}
    assert (row["battery_frac"], row["base"]) == (0.5, "")
    assert "uav/uav_2/odometry" not in seen, "it has not told where it is"
    assert len(seen["uav/uav_2/path"]["poses"]) == 1


def test_diagnostics_grow_worse_with_what_happens(teller: Teller) -> None:
    def levels() -> list[tuple[str, int, str]]:
        told = told_by(teller)["/diagnostics"]["status"]
        return [(each["name"], each["level"], each["message"]) for each in told]

    teller.claim("uav-1", "t1", 8.0)
    teller.status("uav-1", StatusPhase.FLYING, battery_frac=0.9)
    teller.status("uav-2", StatusPhase.IDLE, battery_frac=0.1, note="battery low")
    assert levels() == [
        ("peckorder: mission", 0, "running"),
        ("peckorder: uav-1", 0, "flying"),
        ("peckorder: uav-2", 1, "idle: battery low"),
    ]

    teller.lose("uav-1", 0.6)
    assert levels()[1][:2] == ("peckorder: uav-1", 2)


def test_markers_show_tasks_uavs_lists_and_zones(teller: Teller) -> None:
    teller.claim("uav-1", "t1", 8.0)
    teller.status("uav-1", StatusPhase.FLYING, position_enu_m=(1.0, 2.0, 0.0))
    teller.end("uav-2", "t2", 0.5)
    corners = ((10.0, 10.0), (20.0, 10.0), (20.0, 20.0))
    zone = ZoneSpec("keep-out", corners, (), None, None, inclusive=False)
    teller.say(OPERATOR, ZoneEdit(zone, withdrawn=False, run=1, reason=""))

    markers = told_by(teller)["markers"]["markers"]

    assert len({(each["ns"], each["id"]) for each in markers}) == len(markers)
    kinds = {(each["ns"], each["id"]): each["type"] for each in markers}
    assert (kinds["tasks", 0], kinds["tasks", 1]) == (2, 1), "a ball is open, a box is done"
    assert {each["text"] for each in markers if each["ns"] == "uav names"} == {
        "uav-1 flying",
        "uav-2 starting",
    }
    (drawn,) = (each for each in markers if each["ns"] == "zone keep-out")
    assert [(at["x"], at["y"]) for at in drawn["points"]] == [*corners, corners[0]]
    assert all(each["lifetime"]["sec"] > 1 for each in markers), "they outlive a repetition"
    assert all(each["header"]["frame_id"] == FRAME for each in markers)


def test_every_message_of_a_flown_mission_can_be_written_and_read() -> None:
    read = 0

    def see(mission_state: Any, now_s: float) -> None:
        nonlocal read
        for message in mirrored(mission_state, "peckorder", now_s):
            TYPES.decode(message.type, TYPES.encode(message.type, message.fields))
            read += 1

    watch(shipped("table-1"), step_s=5.0, see=see)

    assert read > 20
