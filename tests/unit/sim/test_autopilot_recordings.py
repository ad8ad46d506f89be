"""The simulated vehicle against what the real firmwares said, word for word where it matters.

The ground side of a recording is played to the vehicle at the recorded vehicle
time. Compared is everything a bridge acts upon: acknowledgements, mission traffic,
modes, arming, refusals and the texts that tell of them. What ArduCopter says is
compared in one order. PX4 tells of modes once a second and sends texts when it finds
time, so what it says is compared in the order of each kind.
"""

from __future__ import annotations

import itertools
import json
import re
from bisect import bisect_right
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.autopilot.config import Delays, VehicleConfig
from sim.autopilot.flavours.ardupilot import ArduCopter
from sim.autopilot.flavours.base import Flavour
from sim.autopilot.flavours.px4 import Px4
from sim.autopilot.vehicle import Vehicle
from swarm.model.frames import Origin
from tests.ground_station import GroundStation

RECORDINGS = Path(__file__).parents[2] / "data" / "recordings"
ENVELOPE = {"t_s", "from", "sys", "comp", "msg"}
REBOOT_GAP_S = 30.0
"""A silence of the vehicle this long [s] is another power-up."""
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


Key = tuple[Any, ...]
Reduce = Callable[[dict[str, Any]], Key | None]


def text_that_matters(each: dict[str, Any]) -> Key | None:
    """PX4 says little, and all of it; heights in its texts depend on its barometer."""
    text = str(each["text"])
    if text.endswith("\t") or each["chunk_seq"] > 0 or text.startswith("RTL"):
        return "text", each["severity"], re.sub(r"\d+", "#", text), each["chunk_seq"]
    return ("text", each["severity"], text) if text.startswith(TEXTS) else None


def mission_item(each: dict[str, Any]) -> Key:
    place = (each["x"], each["y"], round(each["z"], 1)) if each["seq"] > 0 else ()
    return "item", each["seq"], each["frame"], each["command"], *place


def own_command(each: dict[str, Any]) -> Key | None:
    """What a vehicle asks of its own components; nobody answers, so it may ask again."""
    if each["confirmation"] > 0:
        return None
    params = tuple(str(each[f"param{number}"]) for number in range(1, 7))
    return "own command", each["target_component"], each["command"], *params


def home(each: dict[str, Any]) -> Key:
    """To about ten metres, as the recorded barometer drifts."""
    place = (each["latitude"], each["longitude"], each["altitude"] * 0.1)
    return each["msg"], *(round(number / 1000.0) for number in place)


REDUCTIONS: dict[str, Reduce] = {
    "COMMAND_ACK": lambda each: (
        "ack",
        each["command"],
        each["result"],
        each["target_system"],
        each["target_component"],
    ),
    "COMMAND_LONG": own_command,
    "HEARTBEAT": lambda each: ("mode", each["custom_mode"]),
    "STATUSTEXT": text_that_matters,
    "MISSION_REQUEST": lambda each: (each["msg"], each["seq"]),
    "MISSION_REQUEST_INT": lambda each: (each["msg"], each["seq"]),
    "MISSION_ITEM_REACHED": lambda each: (each["msg"], each["seq"]),
    "MISSION_ACK": lambda each: (
        "mission ack",
        each["type"],
        each["target_system"],
        each["target_component"],
    ),
    "MISSION_COUNT": lambda each: ("mission count", each["count"]),
    "MISSION_ITEM_INT": mission_item,
    "PARAM_ERROR": lambda each: ("parameter error", each["param_id"], each["error"]),
    "PARAM_VALUE": lambda each: (
        "parameter",
        each["param_id"],
        each["param_value"],
        each["param_type"],
    ),
    "HOME_POSITION": home,
    "GPS_GLOBAL_ORIGIN": home,
}
"""Messages compared one by one, each by the fields a bridge looks at."""
ONLY_CHANGES = {"HEARTBEAT", "HOME_POSITION", "GPS_GLOBAL_ORIGIN"}
"""Messages that repeat a state."""
STATES: dict[str, tuple[str, ...]] = {
    "HEARTBEAT": ("custom_mode", "base_mode", "system_status"),
    "MISSION_CURRENT": ("seq", "total", "mission_state", "mission_mode"),
    "EXTENDED_SYS_STATE": ("vtol_state", "landed_state"),
    "SYS_STATUS": (
        "onboard_control_sensors_present",
        "onboard_control_sensors_enabled",
        "onboard_control_sensors_health",
    ),
    "EKF_STATUS_REPORT": ("flags",),
}
"""Messages compared by the states they go through."""
TELEMETRY = {"GLOBAL_POSITION_INT", "POSITION_TARGET_GLOBAL_INT"}
"""Messages that depend on how the real vehicle flew."""


def what_matters(messages: list[dict[str, Any]], asked: set[str]) -> Iterator[tuple[str, Key]]:
    """The messages a bridge acts upon, by name, reduced to the fields it looks at."""
    last: dict[str, Key] = {}
    for each in messages:
        name = each["msg"]
        if name not in REDUCTIONS or (name == "PARAM_VALUE" and each["param_id"] not in asked):
            continue
        key = REDUCTIONS[name](each)
        if key is None or (name in ONLY_CHANGES and last.get(name) == key):
            continue
        last[name] = key
        yield name, key


@dataclass(frozen=True)
class Play:
    """A recording from one power-up on, and a vehicle as the recorded one."""

    name: str
    speedup: float
    flavour: Flavour
    delays: Delays
    alt_m: float
    """Height of home above the sea [m]."""
    config: dict[str, Any]
    """Speeds and delays of `VehicleConfig`."""
    power_up: int = 0
    asked: tuple[str, ...] = ()
    """Parameters to compare besides those that are asked for."""

    def messages(self) -> list[dict[str, Any]]:
        """Its part of the recording."""
        found = recording(self.name)
        last_s = [0.0, *(each["t_s"] for each in found)]
        ups = itertools.accumulate(
            each["t_s"] - before_s > REBOOT_GAP_S
            for each, before_s in zip(found, last_s, strict=False)
        )
        return [each for each, up in zip(found, ups, strict=True) if up == self.power_up]

    def vehicle(self) -> Vehicle:
        """A vehicle that has just been powered up."""
        config = VehicleConfig(
            system_id=1,
            origin=Origin(47.3977, 8.5456, self.alt_m),
            delays=self.delays,
            **self.config,
        )
        return Vehicle(config, self.flavour, 0.0)


def played(play: Play) -> tuple[list[dict[str, Any]], list[dict[str, Any]], set[str]]:
    """What the recorded vehicle said and what the simulated one says, and which parameters
    are compared."""
    messages = play.messages()
    vehicle_time = VehicleTime(messages, play.speedup)
    ground = GroundStation(play.vehicle())
    # Nobody listened before the recording began.
    ground.wait(vehicle_time(messages[0]["t_s"]))
    ground.heard.clear()
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
    simulated = [
        {
            "msg": heard.get_type(),
            **{name: plain(getattr(heard, name)) for name in heard.fieldnames},
        }
        for heard in ground.heard
    ]
    return without_bounce(real), simulated, asked | set(play.asked)


def plain(value: Any) -> Any:
    """A field as the recordings write it."""
    return "nan" if value != value else value


def without_bounce(messages: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Leave out that the recorded PX4 took its landing for a take-off and a landing again.

    It also took the place of that take-off for its home.
    """
    landings = [
        place
        for place, each in enumerate(messages)
        if each["msg"] == "STATUSTEXT" and each["text"] == "Landing detected\t"
    ]
    if len(landings) < 2:
        return messages
    first, last = landings[0], landings[-1]
    bounce = ("STATUSTEXT", "EXTENDED_SYS_STATE")
    return [
        each
        for place, each in enumerate(messages)
        if not (first < place <= last and each["msg"] in bounce)
        and not (first < place and each["msg"] == "HOME_POSITION")
    ]


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


ARDUCOPTER = {
    "spool_up_s": 3.0,
    "land_m_s": 0.6,  # the recorded vehicle slows down to 0.5 m/s near the ground
}
# As slow as the recorded vehicle was on average, which speeds up and slows down.
PX4_SHORT_LEGS = {"spool_up_s": 1.5, "climb_m_s": 0.93, "land_m_s": 0.62, "cruise_m_s": 3.26}
PX4_LONG_LEGS = {"spool_up_s": 1.5, "climb_m_s": 0.93, "land_m_s": 0.78, "cruise_m_s": 4.4}
PX4_READY = Delays(1.0, 1.0, 1.0, 1.0)

PLAYS = {
    "ArduCopter's mission": Play(
        "arducopter-4.8-mission.jsonl",
        4.0,
        ArduCopter(),
        Delays(0.5, 15.0, 20.0, 41.4),
        488.1,
        ARDUCOPTER,
    ),
    "ArduCopter's retarget": Play(
        "arducopter-4.8-retarget.jsonl",
        6.0,
        ArduCopter(),
        Delays(2.5, 2.5, 20.0, 41.4),
        488.1,
        ARDUCOPTER,
    ),
    "PX4's mission": Play("px4-1.17-mission.jsonl", 2.0, Px4(), PX4_READY, 489.55, PX4_SHORT_LEGS),
    "PX4's boot": Play(
        "px4-1.17-mission.jsonl",
        3.0,
        Px4(),
        Delays(3.0, 3.0, 3.0, 3.0),
        489.55,
        PX4_SHORT_LEGS,
        power_up=1,
        asked=Px4.parameter_habits.told_at_boot,
    ),
    "PX4's retarget": Play("px4-1.17-retarget.jsonl", 3.0, Px4(), PX4_READY, 489.55, PX4_LONG_LEGS),
}
ARDUCOPTERS = ["ArduCopter's mission", "ArduCopter's retarget"]
PX4S = ["PX4's mission", "PX4's boot", "PX4's retarget"]


@pytest.mark.parametrize("name", ARDUCOPTERS)
def test_arducopter_says_what_the_recorded_one_said_in_one_order(name: str) -> None:
    real, simulated, asked = played(PLAYS[name])

    assert list(what_matters(simulated, asked)) == list(what_matters(real, asked))


@pytest.mark.parametrize("name", PX4S)
def test_px4_says_what_the_recorded_one_said_in_the_order_of_each_kind(name: str) -> None:
    real, simulated, asked = played(PLAYS[name])

    conversation = {"COMMAND_ACK", "MISSION_REQUEST_INT", "MISSION_ACK"}
    kinds = [conversation, *({kind} for kind in sorted(REDUCTIONS.keys() - conversation))]
    for kind in kinds:
        said, recorded = (
            [key for message, key in what_matters(messages, asked) if message in kind]
            for messages in (simulated, real)
        )
        assert said == recorded


@pytest.mark.parametrize("name", ARDUCOPTERS)
def test_arducopter_goes_through_the_recorded_states(name: str) -> None:
    real, simulated, _ = played(PLAYS[name])

    mission = STATES["MISSION_CURRENT"]
    assert states(simulated, "MISSION_CURRENT", *mission) == states(
        real, "MISSION_CURRENT", *mission
    )
    landed = states(real, "EXTENDED_SYS_STATE", "landed_state")
    # A recording may end before the last state is reported.
    assert states(simulated, "EXTENDED_SYS_STATE", "landed_state")[: len(landed)] == landed
    # States that last less than a heartbeat may be missed on either side.
    fields = ("HEARTBEAT", *STATES["HEARTBEAT"])
    assert set(states(simulated, *fields)) <= set(states(real, *fields))
    assert (4, 217, 3) in states(simulated, *fields)  # armed and spooling up
    last = states(real, "SYS_STATUS", *STATES["SYS_STATUS"])[-1]
    assert states(simulated, "SYS_STATUS", *STATES["SYS_STATUS"])[-1] == last
    assert states(simulated, "EKF_STATUS_REPORT", "flags") == [(167,), (831,)]


@pytest.mark.parametrize("name", PX4S)
def test_px4_goes_through_the_recorded_states(name: str) -> None:
    real, simulated, _ = played(PLAYS[name])

    for message, fields in STATES.items():
        assert states(simulated, message, *fields) == states(real, message, *fields)


def test_everything_in_the_recordings_is_compared() -> None:
    known = REDUCTIONS.keys() | STATES.keys() | TELEMETRY
    for path in RECORDINGS.glob("*.jsonl"):
        said = {each["msg"] for each in recording(path.name) if each["from"] == "vehicle"}
        assert said <= known, f"{path.name} has messages that no comparison looks at"
        assert path.name in {play.name for play in PLAYS.values()}


def test_everything_the_recorded_ground_said_is_understood() -> None:
    for play in PLAYS.values():
        vehicle = play.vehicle()
        for each in play.messages():
            if each["from"] == "ground":
                message = message_of(each)
                assert message.get_msgId() in vehicle._handlers
                if each["msg"].startswith("COMMAND"):
                    assert message.command in vehicle._commands._handlers
