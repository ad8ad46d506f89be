"""`swarm ros2` beside missions flown by real processes, seen by another implementation.

The fleet's own bus is encrypted; the ROS 2 graph beside it is not, as by default.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from coordinator.ros2.message_types import MessageTypes, definitions
from swarm.identity.founding import found_authority
from swarm.model import Mission, Origin, Task, TaskId, Uav, UavId
from swarm.runtime.clock import unix_s
from tests.process import ros2_reader
from tests.process.by_hand import ByHand
from tests.process.kept_open import KEEPER, kept_open
from tests.process.router_processes import commanded, finish, router

pytestmark = [pytest.mark.process]

ROOT = Path(__file__).parents[2]
UAVS = ["uav1", "uav2"]
MISSION = Mission(
    "mirrored",
    9000.0,
    tuple(Uav(UavId(u), (15.0 * n, 0.0, 0.0), 8.0) for n, u in enumerate(UAVS)),
    tuple(Task(TaskId(f"t{n}"), (40.0 * n, 90.0, 0.0), 1.0) for n in range(4)),
    origin=Origin(46.8, 9.7, 1100.0),
)
SERVICES = {
    f"/peckorder/{name}": [f"peckorder_msgs/srv/{kind}"]
    for name, kind in {
        "add_task": "AddTask",
        "withdraw_task": "WithdrawTask",
        "hold": "CommandUav",
        "resume": "CommandUav",
        "return": "CommandUav",
    }.items()
}
# Only the router that it is told of, as with ours: no scouting, nobody else's endpoint.
ALONE = 'mode="client";listen/endpoints=[];scouting/gossip/enabled=false'


def topics(mission: Mission) -> dict[str, list[str]]:
    own = {"status": "MissionStatus", "uavs": "UavStatusArray", "tasks": "TaskArray"}
    own |= {"claims": "ClaimArray", "plan": "Plan"}
    found = {f"/peckorder/{name}": [f"peckorder_msgs/msg/{kind}"] for name, kind in own.items()}
    found["/peckorder/markers"] = ["visualization_msgs/msg/MarkerArray"]
    found["/diagnostics"] = ["diagnostic_msgs/msg/DiagnosticArray"]
    for uav in mission.uavs:
        found[f"/peckorder/uav/{uav.id}/path"] = ["nav_msgs/msg/Path"]
        found[f"/peckorder/uav/{uav.id}/odometry"] = ["nav_msgs/msg/Odometry"]
        found[f"/peckorder/uav/{uav.id}/position"] = ["geographic_msgs/msg/GeoPointStamped"]
    return found


def write_definitions(folder: Path) -> None:
    """Every definition as ROS 2 has it, a file each: ours, and those that topics have besides."""
    texts = definitions("msg") | definitions("srv")
    types = MessageTypes()
    for (name,) in topics(MISSION).values():
        whole = types.definition(name).split(f"{'=' * 80}\n")
        texts.setdefault(name, whole[0])
        for part in whole[1:]:
            head, _, text = part.partition("\n")
            package, _, short = head.removeprefix("MSG: ").partition("/")
            texts.setdefault(f"{package}/msg/{short.removeprefix('msg/')}", text)
    for name in ("geographic_msgs/msg/GeoPoint", "geometry_msgs/msg/Point"):
        texts.setdefault(name, types.definition(name))
    for name, text in texts.items():
        path = folder / f"{name}.{name.split('/')[1]}"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)


def read(port: str, folder: Path) -> dict[str, Any]:
    """What the other implementation sees; it withdraws the keeper, so that the mission ends."""
    told = subprocess.run(
        [sys.executable, "-m", ros2_reader.__name__, port, str(folder), KEEPER],
        cwd=ROOT,
        env=os.environ | {"ZENOH_CONFIG_OVERRIDE": ALONE},
        capture_output=True,
        text=True,
        timeout=380,
        check=False,
    )
    assert told.returncode == 0, told.stderr
    said: dict[str, Any] = json.loads(told.stdout.splitlines()[-1])
    return said


def test_another_implementation_reads_a_flown_mission_and_has_a_task_done(tmp_path: Path) -> None:
    write_definitions(tmp_path / "definitions")
    keys = tmp_path / "keys"
    found_authority(keys, MISSION.name, UAVS, now_s=unix_s())
    with contextlib.ExitStack() as stack:
        _, ros = stack.enter_context(router("--listen", "tcp/127.0.0.1:0"))
        by_hand = ByHand(tmp_path, stack, kept_open(MISSION), speedup=6, keys=keys)
        words = ["ros2", "--mission", MISSION.name, "--services", "--ros-router", ros]
        mirror = by_hand.start("ros2", [*words, *by_hand.seat, *by_hand.keys_of("operator")])
        by_hand.coordinator("coordinator")

        seen = read(ros.rpartition(":")[2], tmp_path / "definitions")

        mirror.send_signal(signal.SIGINT)
        assert mirror.wait(20) == 130
        assert "ROS 2 was not told" not in by_hand.log("ros2")
    assert seen["faults"] == []
    assert seen["topics"] == topics(MISSION)
    assert set(seen["counts"]) == set(topics(MISSION))
    assert {name: kind for name, kind in seen["services"].items() if name in SERVICES} == SERVICES
    assert (seen["mission"], seen["frame"]) == (MISSION.name, "map")
    assert (seen["added"]["success"], seen["added"]["task"]) == (True, "op1")
    assert seen["added"]["message"].startswith("op1 is on the board, worth 50")
    assert seen["unknown"] == {
        "success": False,
        "message": "no such UAV: the fleet is uav1, uav2",
    }
    assert seen["withdrawn"] == [{"success": True, "message": f"{KEEPER} is withdrawn"}]
    done = {task.id: "done" for task in MISSION.tasks} | {"op1": "done", KEEPER: "withdrawn"}
    assert seen["tasks"] == done


def test_one_router_may_serve_both_and_it_waits_for_a_mission_and_ends_at_once() -> None:
    with router("--listen", "tcp/127.0.0.1:0") as (_, endpoint):
        words = ("ros2", "--connect", endpoint, "--ros-router", endpoint)
        with commanded(*words, SWARM_LOG_FORMAT="lines") as mirror:
            assert mirror.stderr is not None
            assert "in the graph" in mirror.stderr.readline()
            mirror.send_signal(signal.SIGINT)
            status, said, _ = finish(mirror)
    assert (status, said) == (130, "")
