"""The session with one vehicle: how to speak to it, and whether it is known what it does.

Holds what everything shares that commands the vehicle. A vehicle of which nothing is known yet
is looked at before an order is carried out. One that was handed over for its silence is taken
back once it is heard again, if it flies as it was left. Left alone it would hover until its
battery is empty: our heartbeats keep its own failsafe for a lost ground station from acting,
and many have none. Anything else means that somebody else, or a failsafe, has it. Leaves out:
what is said and why (agent.vehicle.activity_runner).
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass

from agent.core.interface import (
    HandOverExplained,
    HeardAgain,
    Hold,
    Return,
    VehicleOrder,
    VehicleReport,
)
from agent.vehicle.codec import MavlinkCodec
from agent.vehicle.commands import CommandQueue
from agent.vehicle.config import BridgeConfig, CommandStyle
from agent.vehicle.contact import Contact
from agent.vehicle.firmware.profile import Firmware
from agent.vehicle.messages import ExtendedState, Heartbeat, Inbound, Landed, Outbound
from agent.vehicle.onboard_mission import OnboardMission
from agent.vehicle.parameter_override import ParameterOverride
from agent.vehicle.signing import Signing
from agent.vehicle.state import PositionFilter, VehicleState
from agent.vehicle.supervision import SafetyMonitor, intervention

__all__ = [
    "BridgeAction",
    "BridgeEvent",
    "BytesReceived",
    "LinkClosed",
    "LinkLoss",
    "LinkOpened",
    "SendBytes",
    "TimePassed",
    "VehicleSearch",
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


class VehicleSession:
    """One vehicle, as far as it is heard; and what was made of it in the step under way.

    Args:
        config: its settings.
    """

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
        self.now_s = 0.0
        self._actions: list[BridgeAction] = []

    @property
    def silent(self) -> bool:
        """Whether it has not been heard for too long."""
        at_s = self.vehicle.silent_at_s(self.config.silence_timeout_s)
        return at_s is not None and self.now_s >= at_s

    def missing(self) -> str | None:
        """Why there is no vehicle to command yet; None if there is one."""
        return self.contact.missing(
            self.vehicle.heartbeat,
            self.firmware,
            silent=self.silent,
            distrusted=self.codec.distrusted,
        )

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

    def in_its_words(self, failure: str) -> str:
        """A failure, and what the autopilot has said about it lately."""
        text = self.vehicle.telling_warning(self.now_s)
        return f"{failure}: {text}" if text and text not in failure else failure

    def say(self, *messages: Outbound) -> None:
        """To the vehicle."""
        self._actions += [SendBytes(self.codec.encode(message)) for message in messages]

    def report(self, report: VehicleReport) -> None:
        """To whoever gave the orders."""
        self._actions.append(report)

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


_UNHEARD_TIMEOUTS = 3.0
"""A vehicle that may be in the air has that many silence timeouts to be heard at all."""


class VehicleSearch:
    """Finds out what there is to know before an order can be carried out.

    Args:
        order: to be carried out then.
        session: with the vehicle.
    """

    def __init__(self, order: Return | Hold, session: VehicleSession) -> None:
        self.order = order
        self._session = session
        self._until_s = session.now_s + _UNHEARD_TIMEOUTS * session.config.silence_timeout_s

    @property
    def in_vain(self) -> bool:
        """Whether the vehicle has had its time."""
        return self._session.now_s >= self._until_s

    def advance(self) -> str | None:
        """What is still to be learned, in words; None if it is enough."""
        return self._session.missing() or self._unclear()

    def _unclear(self) -> str | None:
        session = self._session
        if not session.vehicle.armed:
            return None
        if isinstance(self.order, Hold) and session.vehicle.landed is Landed.UNDEFINED:
            return "waiting to hear whether it flies (EXTENDED_SYS_STATE)"
        if session.mission is not None and session.flies_unknown_mission():
            session.say(*session.mission.look(session.now_s))
            return "reading the mission that the vehicle flies"
        return None


Point = tuple[float, float, float]


_LOOK_S = 3.0
"""It is watched for that long: what comes first may have waited in a link for a while."""

_HEARTBEATS = 3

_FRESH_S = 1.5
"""A place older than that, and than the watch, is not where it is now."""

_DOUBT_S = 10.0
"""What is not explained by our orders may be so soon: a vehicle that overshoots comes back."""

_ASTRAY_M = 25.0
"""A vehicle farther than that from everywhere on its way was led there by somebody else:
braking and turning at speed take it less far."""


class LinkLoss:
    """One vehicle that fell silent while it was ours.

    Args:
        session: with the vehicle, as it was last heard.
        sent_to_enu_m: where it may be flying to [m; mission origin].
    """

    def __init__(self, session: VehicleSession, sent_to_enu_m: Sequence[Point]) -> None:
        heartbeat = session.vehicle.heartbeat
        self._session = session
        self._mode = None if heartbeat is None else heartbeat.custom_mode
        self._lost_s = session.vehicle.heard_at_s or session.now_s
        self._place_enu_m = session.position_filter.place_m(-math.inf)
        self._sent_to_enu_m = sent_to_enu_m
        self._begin_anew()

    def _begin_anew(self) -> None:
        self._heard_s: float | None = None
        self._heartbeats = 0
        self._tells_whether_it_flies = False

    def on_message(self, message: Inbound) -> None:
        """Note what is fresh."""
        match message:
            case Heartbeat():
                self._heartbeats += 1
            case ExtendedState(landed) if landed is not Landed.UNDEFINED:
                self._tells_whether_it_flies = True
            case _:
                pass

    def news(self) -> HeardAgain | HandOverExplained | None:
        """What became of it; None as long as that is not known."""
        session, heartbeat = self._session, self._session.vehicle.heartbeat
        if session.silent:
            self._begin_anew()
            return None
        if not self._heartbeats or heartbeat is None:
            return None
        if self._heard_s is None:
            self._heard_s = session.now_s
        if (why := self._taken(heartbeat)) is not None:
            return HandOverExplained(f"{self._heard_again}: {why}")
        watched_s = session.now_s - self._heard_s
        place_enu_m = session.position_filter.place_m(session.now_s - _FRESH_S)
        position = session.vehicle.position
        known = self._heartbeats >= _HEARTBEATS and self._tells_whether_it_flies
        if watched_s < _LOOK_S or not known or place_enu_m is None or position is None:
            return None
        if self._is_on_its_way(place_enu_m, position.velocity_enu_m_s):
            return HeardAgain(f"{self._heard_again}, as it was left")
        if watched_s < _LOOK_S + _DOUBT_S:
            return None
        return HandOverExplained(f"{self._heard_again}: somebody else has moved it")

    @property
    def _heard_again(self) -> str:
        heard_s = self._session.now_s if self._heard_s is None else self._heard_s
        return f"heard again after {heard_s - self._lost_s:.0f} s"

    def _taken(self, heartbeat: Heartbeat) -> str | None:
        """Why it is not to be commanded, by its heartbeat; None if it may be."""
        session, firmware, mode = self._session, self._session.firmware, heartbeat.custom_mode
        if firmware is None or self._mode is None:
            return "it is not known what it is"
        if self._tells_whether_it_flies and not firmware.airborne(session.vehicle):
            return "it stands on the ground"
        if heartbeat.armed and firmware.is_returning(mode):
            return f"it returns or lands by itself, in {firmware.mode_name(mode)}"
        if heartbeat.armed and firmware.is_mission(mode) and mode == self._mode:
            return "it flies its mission, which ends at home"
        # A takeoff ends in the guided mode by itself.
        ours = (mode, self._mode) if firmware.is_taking_off(self._mode) else (self._mode,)
        expected = mode in ours and (firmware.is_commanded(mode) or firmware.is_taking_off(mode))
        return intervention(
            session.vehicle, heartbeat, firmware, session.now_s, expected=expected, may_disarm=False
        )

    def _is_on_its_way(self, place_enu_m: Point, velocity_enu_m_s: Point) -> bool:
        """Whether our orders explain where it is, and where it flies."""
        if self._place_enu_m is None:
            return False
        still = math.hypot(*velocity_enu_m_s) <= self._session.config.arrival_speed_m_s
        if still:
            # Somewhere between, somebody has stopped it.
            ends = (self._place_enu_m, *self._sent_to_enu_m)
            return any(_near(place_enu_m, end, end) for end in ends)
        return any(
            _near(place_enu_m, self._place_enu_m, end)
            and _leads_to(end, place_enu_m, velocity_enu_m_s)
            for end in self._sent_to_enu_m
        )


def _leads_to(end_m: Point, place_m: Point, velocity_m_s: Point) -> bool:
    """Whether the way left gets shorter."""
    parts = zip(velocity_m_s, end_m, place_m, strict=True)
    return sum(speed_m_s * (end - place) for speed_m_s, end, place in parts) > 0.0


def _near(place_m: Point, from_m: Point, to_m: Point) -> bool:
    """Whether a place lies along a way, at one of its heights or between them."""
    (east_m, north_m, up_m), (to_east_m, to_north_m, to_up_m) = place_m, to_m
    way_east_m, way_north_m = to_east_m - from_m[0], to_north_m - from_m[1]
    length2 = way_east_m**2 + way_north_m**2
    along = (east_m - from_m[0]) * way_east_m + (north_m - from_m[1]) * way_north_m
    share = min(1.0, max(0.0, along / length2)) if length2 > 0.0 else 1.0
    aside_m = math.hypot(
        east_m - from_m[0] - share * way_east_m, north_m - from_m[1] - share * way_north_m
    )
    low_m, high_m = sorted((from_m[2], to_up_m))
    return aside_m <= _ASTRAY_M and low_m - _ASTRAY_M <= up_m <= high_m + _ASTRAY_M
