"""Whether an autopilot is heard, which one it is, and what it says of itself.

It is listened to and asked for messages, and never told to do anything. What it says is read as
the bridge reads it.
"""

from __future__ import annotations

import math
from collections.abc import Hashable
from dataclasses import dataclass
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from agent.vehicle.codec import MavlinkCodec
from agent.vehicle.firmware import firmware_of, unsupported
from agent.vehicle.firmware.kinematics import Kinematics
from agent.vehicle.firmware.profile import Firmware
from agent.vehicle.flight_limits import LimitsReading
from agent.vehicle.framing import Framer
from agent.vehicle.messages import (
    CommandLong,
    Heartbeat,
    Inbound,
    Outbound,
    ParameterRead,
    Position,
)
from agent.vehicle.preflight import FailsafeReading
from agent.vehicle.signing import Signing
from agent.vehicle.state import VehicleState
from sim.fleet.doctor.finding import CheckFinding, fails, fine, warns

OWN_SYSTEM_ID = 254
"""Not a ground station's 255: an autopilot would take its end for the loss of its station."""
ASK_AGAIN_S = 1.0
_AUTOPILOT_COMPONENT = 1
_CMD_REQUEST_MESSAGE = 512
_AGENT_SYSTEM_ID = 255
"""An agent's, unless it is told another one: whose silence the vehicle should notice."""
_ASKED_FOR = (
    mavlink.MAVLINK_MSG_ID_SYS_STATUS,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE,
    mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT,
    mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS,
    mavlink.MAVLINK_MSG_ID_SYSTEM_TIME,
)
"""What a vehicle may not say unasked."""
_SKEW_S = 1.0
_SHOWN_M_S = 10.0
"""Cruise speed at which legs are told of."""
_BOOTING = "still booting or calibrating"
_LOSSY, _DEAF = 0.02, 0.2
"""Shares of frames lost from which on a link is doubtful, and of no use."""


@dataclass(slots=True)
class _Sequence:
    """Sequence numbers of one component: gaps are frames that were lost."""

    newest: int
    received: int = 1
    lost: int = 0

    def received_one(self, number: int) -> None:
        ahead = (number - self.newest) % 256
        if ahead == 0 or ahead > 128:
            return  # doubled, or late
        self.received += 1
        self.lost += ahead - 1
        self.newest = number


class VehicleListener:
    """What one vehicle says on a link; a core without sockets.

    Without ``signing`` what is not signed is believed.
    """

    def __init__(self, system_id: int, signing: Signing | None = None) -> None:
        self._system_id = system_id
        self._signed = signing is not None
        self._codec = MavlinkCodec(system_id, source_system_id=OWN_SYSTEM_ID, signing=signing)
        self._codec.keep_frames = True
        self._framer = Framer()
        """Of what was believed: for what the codec keeps to itself."""
        self._state = VehicleState()
        self._now_s = 0.0
        self._sequences: dict[int, _Sequence] = {}
        self._ahead_s: float | None = None
        self._time_heard = False
        self._others: dict[int, int] = {}
        self._bytes = 0
        self._failsafes: FailsafeReading | None = None
        self._limits: LimitsReading | None = None

    @property
    def heard(self) -> bool:
        """Whether the vehicle's own heartbeat has come."""
        return self._state.heartbeat is not None

    @property
    def settled(self) -> bool:
        """Whether it is ready, or waiting changes nothing: it flies, or never will for us."""
        heartbeat = self._state.heartbeat
        if heartbeat is None:
            return False
        flavour = firmware_of(heartbeat)
        return flavour is None or heartbeat.armed or self._unready(flavour) is None

    def requests(self) -> list[bytes]:
        """Frames that ask the vehicle for messages, and for parameters, once each."""
        asked: list[Outbound] = [
            CommandLong(_CMD_REQUEST_MESSAGE, (float(each), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
            for each in _ASKED_FOR
        ]
        readings = (self._failsafes, self._limits)
        unread = (name for each in readings if each is not None for name in each.unread)
        asked += map(ParameterRead, unread)
        return [self._codec.encode(each) for each in asked]

    @property
    def peer(self) -> Hashable | None:
        """Whom to ask on a link to which anybody can send."""
        return self._codec.peer

    def receive(
        self, data: bytes, now_s: float, unix_s: float, source: Hashable | None = None
    ) -> None:
        """Take in what came, at a time of any clock.

        ``source`` sent it, on a link to which anybody can send.
        """
        self._bytes += len(data)
        self._now_s = now_s
        for heard in self._codec.decode(data, source, now_s):
            if heard.system_id != self._system_id:
                if isinstance(heard.message, Heartbeat):
                    self._others[heard.system_id] = self._others.get(heard.system_id, 0) + 1
            elif heard.component_id != _AUTOPILOT_COMPONENT:
                continue
            elif isinstance(heard.message, Position):
                self._state.on_position(heard.message)
            else:
                self._state.on_message(heard.message, now_s)
                self._read_parameters(heard.message)
        for frame in self._codec.take_frames():
            for each in self._framer.feed(frame):
                self._count(each.data)
                self._take_time(each.message, unix_s)

    def _read_parameters(self, message: Inbound) -> None:
        if self._failsafes is not None and self._limits is not None:
            self._failsafes.on_message(message)
            self._limits.on_message(message)
        elif isinstance(message, Heartbeat) and (flavour := firmware_of(message)) is not None:
            self._failsafes = FailsafeReading(flavour, _AGENT_SYSTEM_ID)
            self._limits = LimitsReading(flavour, flavour.override_spec)

    def _count(self, frame: bytes) -> None:
        number, component = (
            (frame[4], frame[6]) if frame[0] == mavlink.PROTOCOL_MARKER_V2 else (frame[2], frame[4])
        )
        known = self._sequences.get(component)
        if known is None:
            self._sequences[component] = _Sequence(number)
        else:
            known.received_one(number)

    def _take_time(self, message: Any, unix_s: float) -> None:
        if message is None or message.get_msgId() != mavlink.MAVLINK_MSG_ID_SYSTEM_TIME:
            return
        self._time_heard = True
        if message.time_unix_usec:
            self._ahead_s = message.time_unix_usec / 1e6 - unix_s

    def findings(self, name: str) -> list[CheckFinding]:
        """What is to be said of the vehicle, and of the link to it, which is called ``name``."""
        heartbeat = self._state.heartbeat
        if heartbeat is None:
            return [self._not_heard(name)]
        flavour = firmware_of(heartbeat)
        if flavour is None:
            remedy = "fly ArduCopter, Rover, ArduPlane, or PX4 on a multicopter or plane"
            return [fails(name, unsupported(heartbeat), remedy)]
        return [
            self._vehicle(name, heartbeat, flavour),
            *_kind(name, flavour),
            self._readiness(name, flavour),
            *([] if self._failsafes is None else [_failsafes(name, self._failsafes)]),
            *([] if self._limits is None else [_limits(name, self._limits.kinematics)]),
            self._time(name),
            self._loss(name),
            self._signature(name),
        ]

    def _not_heard(self, name: str) -> CheckFinding:
        if self._others:
            heard = ", ".join(map(str, sorted(self._others)))
            text = f"heard system id {heard}, not {self._system_id}"
            remedy = f"give --mavlink URL#{min(self._others)} here, and --system-id to swarm agent"
            return fails(name, text, remedy)
        if reasons := " and ".join(self._codec.distrusted):
            text = f"heard only frames that are not to be believed: {reasons}"
            remedy = "give the vehicle the same key (MAVLink SETUP_SIGNING, by a ground station)"
            return fails(name, text, remedy)
        if self._bytes:
            text = f"{self._bytes} bytes and no heartbeat among them"
            return fails(
                name, text, "set the baud rate and MAVLink 2 on that port of the autopilot"
            )
        return fails(
            name, "nothing heard", "see that the autopilot runs and sends MAVLink to this place"
        )

    def _vehicle(self, name: str, heartbeat: Heartbeat, flavour: Firmware) -> CheckFinding:
        firmware = {3: "ArduPilot", 12: "PX4"}.get(heartbeat.autopilot, "?")
        mode = flavour.mode_name(heartbeat.custom_mode)
        armed = "ARMED" if heartbeat.armed else "not armed"
        text = f"system id {self._system_id}, {firmware}, mode {mode}, {armed}"
        if self._others:
            others = ", ".join(map(str, sorted(self._others)))
            text += f"; also heard: system id {others}"
        if heartbeat.armed:
            return warns(name, text, "somebody flies it: leave it alone until it has landed")
        return fine(name, text)

    def _readiness(self, name: str, flavour: Firmware) -> CheckFinding:
        state = self._state
        what = f"{name} ready"
        charge = state.charge.frac
        battery = "" if charge is None else f", battery {charge:.0%}"
        problem = self._unready(flavour)
        if problem == _BOOTING:
            return warns(what, problem, "wait, and keep it still")
        if problem is not None:
            warning = state.recent_warning(self._now_s, math.inf)
            said = f"; it says: {warning}" if warning else ""
            return warns(what, f"not yet: {problem}{said}{battery}", _advice(problem))
        if charge is not None and charge < 0.2:
            return warns(what, f"battery {charge:.0%}", "charge it: below 20 % nothing is armed")
        place = "" if state.position is None else ", position known"
        return fine(what, f"pre-arm checks pass{place}{battery}")

    def _unready(self, flavour: Firmware) -> str | None:
        """What keeps it from being armed; None if nothing does."""
        heartbeat = self._state.heartbeat
        if heartbeat is not None and not flavour.has_booted(heartbeat):
            return _BOOTING
        return flavour.unready(self._state) or flavour.position_fault(self._state)

    def _time(self, name: str) -> CheckFinding:
        what = f"{name} time"
        if self._ahead_s is None:
            how = "does not know the time" if self._time_heard else "does not tell the time"
            return fine(what, f"it {how}; nothing depends on that")
        if abs(self._ahead_s) > _SKEW_S:
            by = _shown(abs(self._ahead_s))
            text = f"its clock is {by} {'ahead of' if self._ahead_s > 0 else 'behind'} this one"
            remedy = "see which of the two is wrong: logs will not agree (a simulator's may be)"
            return warns(what, text, remedy)
        return fine(what, f"its clock and this one differ by {abs(self._ahead_s):.2f} s")

    def _loss(self, name: str) -> CheckFinding:
        what = f"{name} link"
        received = sum(each.received for each in self._sequences.values())
        lost = sum(each.lost for each in self._sequences.values())
        share = lost / max(1, received + lost)
        text = f"{received} frames, {lost} lost ({share:.1%})"
        if share > _DEAF:
            return fails(what, text, "better the radio link, or lower the rate of its streams")
        if share > _LOSSY:
            return warns(what, text, "better the radio link, or lower the rate of its streams")
        return fine(what, text)

    def _signature(self, name: str) -> CheckFinding:
        what = f"{name} signing"
        if self._signed:
            dropped = sum(self._codec.distrusted.values())
            return fine(what, f"its frames are signed; {dropped} others dropped")
        if self._codec.unchecked_frames:
            text = "it signs what it says, and may obey nobody who does not"
            return warns(what, text, "give --signing-key FILE, here and to swarm agent")
        return fine(what, "nothing is signed; whoever reaches the link can command the vehicle")


def _failsafes(name: str, reading: FailsafeReading) -> CheckFinding:
    """What it does when nobody is there to command it."""
    what = f"{name} failsafes"
    told = reading.failsafes
    text = f"if its agent dies it {told.agent_lost}"
    if reading.simulated:
        return fine(what, f"{text}; it is simulated, and flown all the same")
    if not told.comes_home:
        remedy = f"{told.remedy}, or fly it with --command mission: it is not armed otherwise"
        return warns(what, text if told.battery is None else f"{text}; {told.battery}", remedy)
    if told.battery is not None:
        return warns(what, f"{text}; {told.battery}", "set what it does of its own: return or land")
    return fine(what, text)


def _kind(name: str, flavour: Firmware) -> list[CheckFinding]:
    """What it is, and what it is not flown with; nothing of a copter."""
    limits = flavour.traits.limits
    return [fine(f"{name} kind", f"a {flavour.kind}: {limits}")] if limits else []


def _limits(name: str, limits: Kinematics) -> CheckFinding:
    """How it flies its legs."""
    what = f"{name} legs"
    if limits.absurd:
        told = ", ".join(f"{each.name} {each.value:g}" for each in limits.absurd)
        return warns(what, f"not believed: {told}", "set what the vehicle can fly")
    parts = []
    if limits.acceleration is not None:
        acceleration, legs_m_s2 = limits.acceleration, limits.leg_acceleration_m_s2(_SHOWN_M_S)
        parts.append(f"{acceleration.name} {acceleration.value:.3g} m/s²")
        parts.append(f"with its jerk as long as {legs_m_s2:.3g} m/s² at {_SHOWN_M_S:g} m/s")
    if limits.circle is not None:
        parts.append(f"{limits.circle.name} {limits.circle.value:.3g} m")
    if limits.speed is not None:
        parts.append(f"{limits.speed.name} {limits.speed.value:.3g} m/s")
    if not parts:
        return fine(what, "it tells no limit of acceleration or speed")
    return fine(what, ", ".join(parts))


def _advice(problem: str) -> str:
    """What helps an autopilot that is not ready."""
    if "position" in problem or "GPS" in problem or "estimat" in problem:
        return "wait for a GPS fix under the open sky"
    return "mend what its pre-arm checks complain of; a ground station shows it all"


def _shown(duration_s: float) -> str:
    if duration_s < 120.0:
        return f"{duration_s:.1f} s"
    return (
        f"{duration_s / 3600.0:.1f} h"
        if duration_s < 172_800.0
        else f"{duration_s / 86_400.0:.0f} days"
    )
