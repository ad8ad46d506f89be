"""The session with one vehicle: how to speak to it, and whether it is known what it does.

Holds what all activities share; what is said and why is theirs (agent.vehicle.activity).
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Hashable
from dataclasses import dataclass

from agent.core.interface import Caution, NotReady, VehicleOrder, VehicleReport
from agent.vehicle.codec import MavlinkCodec
from agent.vehicle.commands import CommandQueue, RepeatedCommand
from agent.vehicle.config import BridgeConfig, CommandStyle
from agent.vehicle.contact import Contact
from agent.vehicle.firmware.profile import Firmware
from agent.vehicle.messages import Inbound, Outbound
from agent.vehicle.onboard_mission import OnboardMission
from agent.vehicle.parameter_override import ParameterOverride
from agent.vehicle.signing import Signing
from agent.vehicle.state import PositionFilter, VehicleState
from agent.vehicle.supervision import CruiseWatch, SafetyMonitor
from swarm.protocol.fields import Point
from swarm.protocol.timing import earliest

__all__ = [
    "POLL_S",
    "BridgeAction",
    "BridgeEvent",
    "BytesReceived",
    "LinkClosed",
    "LinkOpened",
    "SendBytes",
    "TimePassed",
    "VehicleSession",
]


@dataclass(frozen=True, slots=True)
class BytesReceived:
    """Bytes came from the link."""

    data: bytes
    source: Hashable | None = None
    """Who sent them, on a link to which anybody can send; None where there is one other end."""


@dataclass(frozen=True, slots=True)
class TimePassed:
    """Time has passed."""


@dataclass(frozen=True, slots=True)
class LinkOpened:
    """The link is open, for the first time or again."""


@dataclass(frozen=True, slots=True)
class LinkClosed:
    """The link is closed."""


@dataclass(frozen=True, slots=True)
class SendBytes:
    """Send these bytes."""

    data: bytes


BridgeEvent = BytesReceived | TimePassed | LinkOpened | LinkClosed | VehicleOrder

BridgeAction = SendBytes | VehicleReport

POLL_S = 0.25
"""While something is waited for, look that often even if nothing is heard."""

_PLACES = 2


class VehicleSession:
    """One vehicle, as far as it is heard; and what was made of it in the step under way."""

    def __init__(self, config: BridgeConfig, signing: Signing | None = None) -> None:
        self.config = config
        self.contact = Contact(config.system_id)
        self.codec = MavlinkCodec(
            config.system_id,
            source_system_id=config.ground_system_id,
            source_component_id=config.ground_component_id,
            signing=signing,
            peer_silence_s=config.peer_silence_s,
        )
        self.commands = CommandQueue(config.commands)
        self.vehicle = VehicleState()
        self.safety = SafetyMonitor(config)
        self.position_filter = PositionFilter()
        self.firmware: Firmware | None = None
        self.mission: OnboardMission | None = None
        """What stands on the vehicle; None if missions are not our way to command it."""
        self.override: ParameterOverride | None = None
        """What is another parameter during a flight; None if nothing is."""
        self.cruise_speed_m_s = 0.0
        """Of the last preparation; 0 before the first."""
        self.cruise_watch = CruiseWatch()
        self.place_enu_m = (math.nan, math.nan, math.nan)
        """Where the vehicle is, by its newest position [m; mission origin]."""
        self.sent_to_enu_m: deque[Point] = deque(maxlen=_PLACES)
        """Where the vehicle was last told to fly: of the newest it may not have heard."""
        self.now_s = 0.0
        self._actions: list[BridgeAction] = []
        self._told_not_ready: str | None = None
        self._told_caution: str | None = None

    @property
    def silent(self) -> bool:
        """Whether it has not been heard for too long."""
        at_s = self.vehicle.silent_at_s(self.config.silence_timeout_s)
        return at_s is not None and self.now_s >= at_s

    def missing(self) -> str | None:
        """Why there is no vehicle to command yet, in words; None if there is one."""
        heartbeat, contact, wanted = self.vehicle.heartbeat, self.contact, self.config.system_id
        if heartbeat is not None and not self.silent:
            unsupported = (
                f"autopilot {heartbeat.autopilot} on vehicle type {heartbeat.vehicle_type} "
                "(MAV_AUTOPILOT, MAV_TYPE) is not supported"
            )
            return unsupported if self.firmware is None else None
        if not contact.link_up:
            return "no link to the autopilot"
        if heartbeat is None and contact.wrong_autopilot is not None:
            return f"heard the vehicle with system id {contact.wrong_autopilot}, not {wanted}"
        if heartbeat is None and (reasons := " and ".join(self.codec.distrusted)):
            return f"heard only frames that are not to be believed: {reasons}"
        return f"waiting for a heartbeat of system id {wanted}"

    def meet(self, firmware: Firmware | None) -> None:
        """Speak to it as to that kind of vehicle."""
        self.firmware = firmware
        override_spec = None
        if firmware is not None:
            self.commands.acknowledged_twice = firmware.acknowledged_twice
            override_spec = firmware.override_spec
        self.override = None
        if override_spec is not None and self.config.raises_jerk:
            self.override = ParameterOverride(override_spec, self.config)
        self.forget_mission()

    def forget_mission(self) -> None:
        """Know nothing of what stands on the vehicle."""
        self.mission = (
            OnboardMission(self.config, self.commands, self.firmware)
            if self._by_missions and self.firmware is not None
            else None
        )

    @property
    def _by_missions(self) -> bool:
        return self.config.command is CommandStyle.MISSION

    def flies_for_us(self, custom_mode: int) -> bool:
        """Whether that mode is our doing, as far as targets go."""
        if self.mission is not None:
            return self.mission.expects(custom_mode, self.now_s)
        return self.firmware is not None and self.firmware.is_commanded(custom_mode)

    def flies_unknown_mission(self) -> bool:
        """Whether the vehicle flies a mission of which it is not known whose it is."""
        heartbeat = self.vehicle.heartbeat
        return (
            self.firmware is not None
            and self.mission is not None
            and heartbeat is not None
            and heartbeat.armed
            and self.firmware.is_mission(heartbeat.custom_mode)
            and self.mission.is_ours is None
            and not self.flies_for_us(heartbeat.custom_mode)
        )

    def on_message(self, message: Inbound) -> None:
        """Pass on what is no heartbeat, position or acknowledgement."""
        if self.mission is not None:
            self.say(*self.mission.on_message(message, self.now_s))
        if self.override is not None:
            self.override.on_message(message)

    def advance_mission(self) -> None:
        """Carry on what stands on the vehicle, or is on its way there."""
        heartbeat, heard_s = self.vehicle.heartbeat, self.vehicle.heartbeat_at_s
        if self.mission is not None and heartbeat is not None and heard_s is not None:
            self.say(*self.mission.advance(heartbeat, heard_s, self.now_s))

    def mission_deadline_s(self) -> float:
        """When mission or parameter may have something to do."""
        if self.mission is not None and self.mission.is_starting:
            return self.now_s + POLL_S
        override = None if self.silent else self.override
        due_s = earliest(
            None if self.mission is None else self.mission.next_deadline_s(),
            None if override is None else override.next_deadline_s(),
        )
        return math.inf if due_s is None else max(due_s, self.now_s)

    def in_its_words(self, failure: str) -> str:
        """A failure, and what the autopilot has said about it lately."""
        text = self.vehicle.telling_warning(self.now_s)
        return f"{failure}: {text}" if text and text not in failure else failure

    def repeated(self, tag: str, tries: int, *, patience: float = 1.0) -> RepeatedCommand:
        """A command that is given so often, and its effect awaited that many times as long."""
        effect_timeout_s = patience * self.config.effect_timeout_s
        waits_s = (effect_timeout_s, self.config.retry_delay_s)
        return RepeatedCommand(tag, self.commands, tries, *waits_s)

    def say(self, *messages: Outbound) -> None:
        """To the vehicle."""
        self._actions += [SendBytes(self.codec.encode(message)) for message in messages]

    def report(self, report: VehicleReport) -> None:
        """To whoever gave the orders."""
        self._actions.append(report)

    def tell_not_ready(self, reason: str) -> None:
        """Report what the vehicle is waited for, once."""
        if reason != self._told_not_ready:
            self._told_not_ready = reason
            self.report(NotReady(reason))

    def tell_caution(self, reason: str) -> None:
        """Report what people should know of the vehicle, once."""
        if reason != self._told_caution:
            self._told_caution = reason
            self.report(Caution(reason))

    def tell_anew(self) -> None:
        """Another wait begins: what was told may be told again."""
        self._told_not_ready = self._told_caution = None

    def take_actions(self) -> list[BridgeAction]:
        """What was said and reported, in order, once."""
        actions, self._actions = self._actions, []
        return actions

    def forget_vehicle(self) -> None:
        """The autopilot began anew: nothing is known of it any more."""
        self.vehicle = VehicleState()
        self.safety = SafetyMonitor(self.config)
        self.position_filter = PositionFilter()
        self.firmware = self.mission = self.override = None
        self.commands.cancel_all()
