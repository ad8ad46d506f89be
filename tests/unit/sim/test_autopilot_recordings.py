"""The simulated vehicle against what real ArduCopter 4.8 said, word for word where it matters.

The ground side of a recording is played to the vehicle at the recorded vehicle
time. Compared is everything a bridge acts upon, in one order: acknowledgements,
mission traffic, modes, arming, refusals and the texts that tell of them.
"""

from __future__ import annotations

import json
from bisect import bisect_right
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.autopilot.config import Delays, VehicleConfig
from sim.autopilot.flavours.ardupilot import ArduCopter
from sim.autopilot.vehicle import Vehicle
from swarm.model.frames import Origin
from tests.ground_station import GroundStation

RECORDINGS = Path(__file__).parents[2] / "data" / "recordings"
ENVELOPE = {"t_s", "from", "sys", "comp", "msg"}
TEXTS = (
    "Arm:",
    "PreArm:",
    "Arming",
    "Disarming",
    "Flight plan",
    "Mission:",
    "Reached",
    "Auto mission",
    "ArduPilot Ready",
    "EKF3 IMU0 origin set",
    "EKF3 IMU0 is using GPS",
)

Key = tuple[Any, ...]


def recording(name: str) -> list[dict[str, Any]]:
    lines = (RECORDINGS / name).read_text().splitlines()
    return [json.loads(line) for line in lines]


class VehicleTime:
    """Vehicle seconds since boot at each wall second of a recording.

    The positions of a recording carry both; before the first of them the vehicle
    is taken to run at the nominal speed-up.
    """

    def __init__(self, messages: list[dict[str, Any]], speedup: float) -> None:
        reports = [each for each in messages if each["msg"] == "GLOBAL_POSITION_INT"]
        self._wall_s: list[float] = [each["t_s"] for each in reports]
        self._boot_s: list[float] = [each["time_boot_ms"] / 1e3 for each in reports]
        self._speedup = speedup

    def __call__(self, wall_s: float) -> float:
        place = bisect_right(self._wall_s, wall_s)
        if place == 0:
            return max(0.0, self._boot_s[0] + (wall_s - self._wall_s[0]) * self._speedup)
        if place == len(self._wall_s):
            return self._boot_s[-1] + (wall_s - self._wall_s[-1]) * self._speedup
        (wall_0, wall_1), (boot_0, boot_1) = (
            pair[place - 1 : place + 1] for pair in (self._wall_s, self._boot_s)
        )
        return boot_0 + (boot_1 - boot_0) * (wall_s - wall_0) / (wall_1 - wall_0)


def what_matters(messages: list[dict[str, Any]], asked: set[str]) -> Iterator[Key]:
    """The messages a bridge acts upon, reduced to the fields it looks at."""
    mode = None
    for each in messages:
        match each["msg"]:
            case "COMMAND_ACK":
                yield "ack", each["command"], each["result"], each["target_system"]
            case "HEARTBEAT":
                if each["custom_mode"] != mode:
                    mode = each["custom_mode"]
                    yield "mode", mode
            case "STATUSTEXT" if each["text"].startswith(TEXTS):
                yield "text", each["severity"], each["text"]
            case "MISSION_REQUEST" | "MISSION_ITEM_REACHED" as name:
                yield name, each["seq"]
            case "MISSION_ACK":
                yield "mission ack", each["type"]
            case "MISSION_COUNT":
                yield "mission count", each["count"]
            case "MISSION_ITEM_INT":
                place = (each["x"], each["y"], round(each["z"], 1)) if each["seq"] > 0 else ()
                yield "item", each["seq"], each["frame"], each["command"], *place
            case "PARAM_ERROR":
                yield "parameter error", each["param_id"], each["error"]
            case "PARAM_VALUE" if each["param_id"] in asked:
                yield "parameter", each["param_id"], each["param_value"], each["param_type"]


def played(
    name: str, vehicle: Vehicle, speedup: float
) -> tuple[list[dict[str, Any]], list[dict[str, Any]], set[str]]:
    """What the recorded vehicle said and what the simulated one says, and which parameters
    it was asked for."""
    messages = recording(name)
    vehicle_time = VehicleTime(messages, speedup)
    ground = GroundStation(vehicle)
    for each in messages:
        if each["from"] != "ground":
            continue
        due_s = vehicle_time(each["t_s"])
        if due_s > ground.now_s:
            ground.wait(due_s - ground.now_s)
        ground.send(message_of(each))
    ground.wait(vehicle_time(messages[-1]["t_s"]) - ground.now_s)

    asked = {each["param_id"] for each in messages if each["msg"] == "PARAM_REQUEST_READ"}
    # The real vehicle tells of parameters it saves while booting, asked or not.
    first_s = next((each["t_s"] for each in messages if each["msg"] == "PARAM_REQUEST_READ"), 0.0)
    real = [
        each
        for each in messages
        if each["from"] == "vehicle"
        and not (each["msg"] == "PARAM_VALUE" and each["t_s"] < first_s)
    ]
    simulated = [{"msg": heard.get_type(), **heard.to_dict()} for heard in ground.heard]
    return real, simulated, asked


def states(messages: list[dict[str, Any]], name: str, *fields: str) -> list[Key]:
    """The different values, one after the other, of some fields of a message."""
    found: list[Key] = []
    for each in messages:
        if each["msg"] == name:
            state = tuple(each[field] for field in fields)
            if state not in found[-1:]:
                found.append(state)
    return found


def message_of(recorded: dict[str, Any]) -> Any:
    """The recorded message, to be sent again."""
    fields = {name: value for name, value in recorded.items() if name not in ENVELOPE}
    for name, value in fields.items():
        if value == "nan":
            fields[name] = float("nan")
        elif isinstance(value, str):
            fields[name] = value.encode()
    message_type = getattr(mavlink, f"MAVLink_{recorded['msg'].lower()}_message")
    return message_type(**fields)


def arducopter(delays: Delays) -> Vehicle:
    config = VehicleConfig(
        system_id=1,
        origin=Origin(47.3977, 8.5456, 488.1),
        delays=delays,
        spool_up_s=3.0,
        land_m_s=0.6,  # the recorded vehicle slows down to 0.5 m/s near the ground
    )
    return Vehicle(config, ArduCopter(), 0.0)


MISSION = ("arducopter-4.8-mission.jsonl", 4.0, Delays(0.5, 15.0, 20.0, 41.4))
RETARGET = ("arducopter-4.8-retarget.jsonl", 6.0, Delays(2.5, 2.5, 20.0, 41.4))


@pytest.mark.parametrize(("name", "speedup", "delays"), [MISSION, RETARGET])
def test_vehicle_answers_like_the_recorded_one(name: str, speedup: float, delays: Delays) -> None:
    real, simulated, asked = played(name, arducopter(delays), speedup)

    assert list(what_matters(simulated, asked)) == list(what_matters(real, asked))


@pytest.mark.parametrize(("name", "speedup", "delays"), [MISSION, RETARGET])
def test_vehicle_goes_through_the_recorded_states(
    name: str, speedup: float, delays: Delays
) -> None:
    real, simulated, _ = played(name, arducopter(delays), speedup)

    mission = ("MISSION_CURRENT", "seq", "total", "mission_state", "mission_mode")
    assert states(simulated, *mission) == states(real, *mission)
    landed = states(real, "EXTENDED_SYS_STATE", "landed_state")
    # A recording may end before the last state is reported.
    assert states(simulated, "EXTENDED_SYS_STATE", "landed_state")[: len(landed)] == landed
    # States that last less than a heartbeat may be missed on either side.
    fields = ("HEARTBEAT", "custom_mode", "base_mode", "system_status")
    assert set(states(simulated, *fields)) <= set(states(real, *fields))
    assert (4, 217, 3) in states(simulated, *fields)  # armed and spooling up
    last = states(real, "SYS_STATUS", "onboard_control_sensors_health")[-1]
    assert states(simulated, "SYS_STATUS", "onboard_control_sensors_health")[-1] == last
    assert states(simulated, "EKF_STATUS_REPORT", "flags") == [(167,), (831,)]
