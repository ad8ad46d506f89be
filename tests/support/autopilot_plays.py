"""Recordings of the real firmwares, played to the simulated vehicle: what both of them say.

The ground side of a recording is played to the vehicle at the recorded vehicle time; what
went wrong on the ground's order goes wrong when the firmware noticed it. Compared is
everything a bridge acts upon: acknowledgements, mission traffic, modes, arming, refusals
and the texts that tell of them. What ArduCopterModel says is
compared in one order. PX4 tells of modes once a second and sends texts when it finds
time, so what it says is compared in the order of each kind.
"""

from __future__ import annotations

import itertools
import json
import math
import re
import struct
from bisect import bisect_right
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.autopilot.config import BatteryFailsafe, Delays, VehicleConfig
from sim.autopilot.faults import FaultKind, VehicleFault
from sim.autopilot.firmware.ardupilot import ArduCopterModel
from sim.autopilot.firmware.model import FirmwareModel
from sim.autopilot.firmware.px4 import Px4Model
from sim.autopilot.firmware.px4_plane import Px4PlaneModel
from sim.autopilot.vehicle import SimulatedAutopilot
from swarm.model.frames import Origin
from swarm.model.vehicles import VehicleKind
from tests.support.ground_station import GroundStation

RECORDINGS = Path(__file__).parents[1] / "data" / "recordings"
ENVELOPE = {"t_s", "from", "sys", "comp", "msg"}
REBOOT_GAP_S = 30.0
"""A silence of the vehicle this long [s] is another power-up."""
TEXTS = (
    "Fence",
    "Invalid vertex",
    "Manual recovery",
    "Polygon fence",
    "GCS Failsafe",
    "Battery 1 is",
    "Battery Failsafe",
    "EKF variance",
    "EKF Failsafe",
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
    matters = text.startswith(TEXTS)
    # Volts and charge depend on the battery.
    text = re.sub(r"[\d.]+V used \d+", "#V used #", text)
    return ("text", each["severity"], text) if matters else None


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
    "FENCE_STATUS": lambda each: (each["msg"], each["breach_status"], each["breach_type"]),
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
        struct.pack("<f", each["param_value"]),
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
    "ESTIMATOR_STATUS": ("flags",),
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
        first = name not in last
        last[name] = key
        if not (first and name == "HEARTBEAT"):  # which tells of no change
            yield name, key


@dataclass(frozen=True)
class Failure:
    """Something that went wrong on the ground's order."""

    parameter: str
    """Setting of the firmware's own simulator by which it was brought about."""
    kind: FaultKind
    noticed_s: float
    """How long after the order the firmware noticed it [s]."""
    charge_frac: float = 0.15


@dataclass(frozen=True)
class Play:
    """A recording from one power-up on, and a vehicle as the recorded one."""

    name: str
    speedup: float
    flavour: FirmwareModel
    delays: Delays
    alt_m: float
    """Height of home above the sea [m]."""
    config: dict[str, Any]
    """Speeds and delays of `VehicleConfig`."""
    power_up: int = 0
    asked: tuple[str, ...] = ()
    """Parameters to compare besides those that are asked for."""
    failure: Failure | None = None

    def messages(self) -> list[dict[str, Any]]:
        """Its part of the recording."""
        found = recording(self.name)
        last_s = [0.0, *(each["t_s"] for each in found)]
        ups = itertools.accumulate(
            each["t_s"] - before_s > REBOOT_GAP_S
            for each, before_s in zip(found, last_s, strict=False)
        )
        return [each for each, up in zip(found, ups, strict=True) if up == self.power_up]

    def vehicle(self) -> SimulatedAutopilot:
        """A vehicle that has just been powered up."""
        told = next(each for each in self.messages() if each["from"] == "vehicle")
        config = VehicleConfig(
            system_id=told["sys"],
            origin=Origin(47.3977, 8.5456, self.alt_m),
            delays=self.delays,
            **self.config,
        )
        return SimulatedAutopilot(config, self.flavour, 0.0)

    def faults(self, vehicle_time: Callable[[float], float]) -> tuple[VehicleFault, ...]:
        """What goes wrong, as faults are told: after the first arming."""
        failure = self.failure
        if failure is None:
            return ()
        messages = self.messages()
        armed_s = next(each["t_s"] for each in messages if _is_armed(each))
        failed_s = next(each["t_s"] for each in messages if _sets(each, failure.parameter))
        after_s = vehicle_time(failed_s) + failure.noticed_s - vehicle_time(armed_s)
        return (VehicleFault(failure.kind, after_s, math.inf, failure.charge_frac),)


def _is_armed(message: dict[str, Any]) -> bool:
    armed = mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    told = message["msg"] == "HEARTBEAT" and message["from"] == "vehicle"
    return told and bool(message["base_mode"] & armed)


def _sets(message: dict[str, Any], parameter: str) -> bool:
    return message["msg"] == "PARAM_SET" and bool(message["param_id"] == parameter)


def played(play: Play) -> tuple[list[dict[str, Any]], list[dict[str, Any]], set[str]]:
    """What the recorded vehicle said and what the simulated one says, and which parameters
    are compared."""
    messages = play.messages()
    vehicle_time = VehicleTime(messages, play.speedup)
    component_id = next((each["comp"] for each in messages if each["from"] == "ground"), 190)
    ground = GroundStation(
        play.vehicle(), faults=play.faults(vehicle_time), component_id=component_id
    )
    # Nobody listened before the recording began.
    ground.wait(vehicle_time(messages[0]["t_s"]))
    ground.heard.clear()
    for each in messages:
        if each["from"] != "ground" or (play.failure and _sets(each, play.failure.parameter)):
            continue
        due_s = vehicle_time(each["t_s"])
        if due_s > ground.now_s:
            ground.wait(due_s - ground.now_s)
        ground.send(message_of(each))
    ground.wait(vehicle_time(messages[-1]["t_s"]) - ground.now_s)

    asked = {each["param_id"] for each in messages if each["msg"] == "PARAM_REQUEST_READ"}
    # Vehicles tell of some parameters while booting, asked or not.
    first_s = next((each["t_s"] for each in messages if each["msg"] == "PARAM_REQUEST_READ"), 0.0)
    real = [
        each
        for each in messages
        if each["from"] == "vehicle"
        and not (each["msg"] == "PARAM_VALUE" and each["t_s"] < first_s)
        and not (each["msg"] == "PARAM_ERROR" and each["param_id"] == "SWARM_SIMULATED")
    ]
    simulated = [
        {
            "msg": heard.get_type(),
            **{name: plain(getattr(heard, name)) for name in heard.fieldnames},
        }
        for heard, heard_s in zip(ground.heard, ground.heard_s[-len(ground.heard) :], strict=True)
        if not (heard.get_type() == "PARAM_VALUE" and heard_s < vehicle_time(first_s))
    ]
    # Only simulated ones have that one.
    return without_bounce(real), simulated, (asked | set(play.asked)) - {"SWARM_SIMULATED"}


def plain(value: Any) -> Any:
    """A field as the recordings write it."""
    return "nan" if value != value else value


def without_bounce(messages: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Leave out that the recorded PX4 took its landing for a take-off and a landing again.

    Where it landed is its home from then on, as after any landing.
    """
    said = [each["text"] if each["msg"] == "STATUSTEXT" else "" for each in messages]
    end = said.index("Disarmed by landing\t") if "Disarmed by landing\t" in said else len(said)
    landings = [place for place, text in enumerate(said[:end]) if text == "Landing detected\t"]
    if len(landings) < 2:
        return messages
    first, last = landings[0], landings[-1]
    bounce = ("STATUSTEXT", "EXTENDED_SYS_STATE")
    return [
        each
        for place, each in enumerate(messages)
        if not (first < place <= last and each["msg"] in bounce)
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

COPTER_BOOTS = Delays(2.5, 15.0, 20.0, 41.4)
PX4_BOOTS = Delays(2.5, 2.5, 2.5, 2.5)
TURNS = {"acceleration_m_s2": 2.5, "rounds_corners": True}
PX4_RUNWAY = {
    "vehicle": VehicleKind.PLANE,
    "circle_m": 80.0,
    "cruise_m_s": 12.5,
    "climb_m_s": 2.7,
    "spool_up_s": 1.0,
}
PX4_FLIGHT = {"spool_up_s": 1.5, "climb_m_s": 1.2, "land_m_s": 1.4, "cruise_m_s": 5.0}

PLAYS = {
    "ArduCopter's mission": Play(
        "arducopter-4.8-mission.jsonl",
        4.0,
        ArduCopterModel(),
        Delays(0.5, 15.0, 20.0, 41.4),
        488.1,
        ARDUCOPTER,
    ),
    "ArduCopter's retarget": Play(
        "arducopter-4.8-retarget.jsonl",
        6.0,
        ArduCopterModel(),
        Delays(2.5, 2.5, 20.0, 41.4),
        488.1,
        ARDUCOPTER,
    ),
    "PX4's mission": Play(
        "px4-1.17-mission.jsonl", 2.0, Px4Model(), PX4_READY, 489.55, PX4_SHORT_LEGS
    ),
    "PX4's boot": Play(
        "px4-1.17-mission.jsonl",
        3.0,
        Px4Model(),
        Delays(3.0, 3.0, 3.0, 3.0),
        489.55,
        PX4_SHORT_LEGS,
        power_up=1,
        asked=Px4Model.parameter_habits.told_at_boot,
    ),
    "PX4's retarget": Play(
        "px4-1.17-retarget.jsonl", 3.0, Px4Model(), PX4_READY, 489.55, PX4_LONG_LEGS
    ),
    "ArduCopter's flight": Play(
        "arducopter-4.8-flight.jsonl", 4.0, ArduCopterModel(), COPTER_BOOTS, 488.1, ARDUCOPTER
    ),
    "ArduCopter's landings": Play(
        "arducopter-4.8-landing.jsonl", 4.0, ArduCopterModel(), COPTER_BOOTS, 488.1, ARDUCOPTER
    ),
    "PX4's landings": Play("px4-1.17-landing.jsonl", 3.0, Px4Model(), PX4_BOOTS, 487.8, PX4_FLIGHT),
    "ArduCopter's fence": Play(
        "arducopter-4.8-fence.jsonl",
        4.0,
        ArduCopterModel(),
        COPTER_BOOTS,
        488.1,
        {**ARDUCOPTER, "land_m_s": 0.35},
    ),
    "PX4's fence": Play("px4-1.17-fence.jsonl", 3.0, Px4Model(), PX4_BOOTS, 487.8, PX4_FLIGHT),
    "PX4's runway": Play("px4-1.17-runway.jsonl", 2.0, Px4PlaneModel(), PX4_READY, 2.0, PX4_RUNWAY),
    "ArduCopter's camera": Play(
        "arducopter-4.8-camera.jsonl", 4.0, ArduCopterModel(), COPTER_BOOTS, 488.1, ARDUCOPTER
    ),
    "PX4's camera": Play("px4-1.17-camera.jsonl", 3.0, Px4Model(), PX4_BOOTS, 487.8, PX4_FLIGHT),
    "ArduCopter's corners": Play(
        "arducopter-4.8-corners.jsonl",
        4.0,
        ArduCopterModel(),
        COPTER_BOOTS,
        488.1,
        {**ARDUCOPTER, **TURNS},
    ),
    "PX4's corners": Play(
        "px4-1.17-corners.jsonl",
        3.0,
        Px4Model(),
        PX4_BOOTS,
        487.8,
        {**PX4_FLIGHT, **TURNS, "acceleration_m_s2": 3.0, "jerk_m_s3": 4.0},
    ),
    "ArduCopter without its ground station": Play(
        "arducopter-4.8-ground-lost.jsonl", 4.0, ArduCopterModel(), COPTER_BOOTS, 488.1, ARDUCOPTER
    ),
    "ArduCopter with a low battery": Play(
        "arducopter-4.8-battery-low.jsonl",
        4.0,
        ArduCopterModel(),
        COPTER_BOOTS,
        488.1,
        {**ARDUCOPTER, "battery_failsafe": BatteryFailsafe()},
        failure=Failure("SIM_BATT_VOLTAGE", FaultKind.BATTERY_LOW, 10.0),
    ),
    "ArduCopter without GPS": Play(
        "arducopter-4.8-gps-lost.jsonl",
        4.0,
        ArduCopterModel(),
        COPTER_BOOTS,
        488.1,
        {**ARDUCOPTER, "position_failsafe_s": 0.3},
        failure=Failure("SIM_GPS1_ENABLE", FaultKind.GPS_LOST, 7.6),
    ),
    "PX4's flight": Play("px4-1.17-flight.jsonl", 3.0, Px4Model(), PX4_BOOTS, 487.8, PX4_FLIGHT),
    "PX4 without its ground station": Play(
        "px4-1.17-ground-lost.jsonl", 3.0, Px4Model(), PX4_BOOTS, 487.8, PX4_FLIGHT
    ),
    "PX4 with a low battery": Play(
        "px4-1.17-battery-low.jsonl",
        3.0,
        Px4Model(),
        PX4_BOOTS,
        487.8,
        {**PX4_FLIGHT, "battery_failsafe": BatteryFailsafe()},
        failure=Failure("SIM_BAT_MIN_PCT", FaultKind.BATTERY_LOW, 30.0),
    ),
    "PX4 without GPS": Play(
        "px4-1.17-gps-lost.jsonl",
        3.0,
        Px4Model(),
        PX4_BOOTS,
        487.8,
        {**PX4_FLIGHT, "position_failsafe_s": 0.2},
        failure=Failure("SIM_GPS_USED", FaultKind.GPS_LOST, 5.0),
    ),
}
