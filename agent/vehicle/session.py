"""The session with one vehicle: how to speak to it, and whether it is known what it does.

Holds what all activities share; what is said and why is theirs (agent.vehicle.activity).
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Hashable, Sequence
from dataclasses import dataclass

from agent.core.interface import FlightLimits, VehicleOrder
from agent.vehicle.camera_control import CameraControl
from agent.vehicle.config import BridgeConfig, CommandStyle
from agent.vehicle.contact import Contact
from agent.vehicle.conversation import Conversation
from agent.vehicle.firmware import unsupported
from agent.vehicle.firmware.profile import Firmware
from agent.vehicle.messages import Inbound
from agent.vehicle.mission_part import MissionPart
from agent.vehicle.onboard_fence import OnboardFence
from agent.vehicle.onboard_mission import OnboardMission
from agent.vehicle.parameter_override import ParameterOverride
from agent.vehicle.signing import Signing
from agent.vehicle.state import PositionFilter, VehicleState
from agent.vehicle.supervision import CruiseWatch, SafetyMonitor
from agent.vehicle.zone_guard import ZoneGuard
from swarm.model import Zone
from swarm.protocol.fields import Point
from swarm.protocol.timing import earliest


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
class ArrivalRule:
    """When a vehicle is at its target."""

    radius_m: float
    """So near it is there."""
    is_flat: bool = False
    """Heights do not count, as it cannot change its own."""
    passes: bool = False
    """It need not stop, and its height may differ by no more than `PASSES_M`."""


PASSES_M = 15.0
"""Height of a target by which it may be passed [m]."""
_CIRCLE_M = 60.0
"""Of a vehicle that has not told its own: ArduPlane's WP_LOITER_RAD."""
_CIRCLE_FRAC = 1.15
"""Of the radius of its circle, within which it is on it."""


BridgeEvent = BytesReceived | TimePassed | LinkOpened | LinkClosed | VehicleOrder

POLL_S = 0.25
"""While something is waited for, look that often even if nothing is heard."""

_PLACES = 2

_OVER_GROUND_M = 0.75
"""How far corners may be cut where the ground is known [m]. Where they are near each other bends
run together, and what is flown is 2 m beside its path."""

_ACCELERATION_M_S2 = 2.5
"""Of a vehicle of which neither mission nor parameters tell it: ArduCopter's own."""


_HEEDS_S = 2.0
"""So late at most a vehicle begins to brake for a zone that is new: news of it, the order and the
place that it tells take their time."""

_JUST_NOW_S = 1.0
"""So long ago a vehicle may have been where it is told to stop [s]."""
_BESIDE_M = 2.0
"""And so much farther off [m]."""
_BRAKES_S = 60.0
"""No vehicle brakes for longer, whatever acceleration is told of it."""


class VehicleSession(Conversation):
    """One vehicle, as far as it is heard; and what was made of it in the step under way."""

    def __init__(self, config: BridgeConfig, signing: Signing | None = None) -> None:
        super().__init__(config, signing)
        self.contact = Contact(config.system_id)
        self.vehicle = VehicleState()
        self.mission_part = MissionPart()
        """Which part of its mission it flies, where its mode does not say who has ordered it."""
        self.safety = SafetyMonitor(config)
        self.position_filter = PositionFilter()
        self.firmware: Firmware | None = None
        self.mission: OnboardMission | None = None
        """What stands on the vehicle; None if missions are not our way to command it."""
        self.fence: OnboardFence | None = None
        """Zones on the vehicle as its own fence; None as long as it is not known what it is."""
        self.override: ParameterOverride | None = None
        """What is another parameter during a flight; None if nothing is."""
        self.camera = CameraControl(self)
        """When it takes pictures."""
        self.cruise_speed_m_s = 0.0
        """Of the last preparation; 0 before the first."""
        self.pace_m_s: float | None = None
        """Slower than that, as it gives way to another UAV; None: it does not."""
        self.awaits_turn = False
        """Whether it must not take off yet, as another UAV goes before."""
        self.planned_m_s2: float | None = None
        """Acceleration that the mission counts on; None: it says none."""
        self.set_m_s2: float | None = None
        """Acceleration that is set on the vehicle; None: not known, or endless."""
        self.told_circle_m: float | None = None
        """Radius of its circles by its parameters; None: not known, or it makes none."""
        self.told_limits = FlightLimits()
        """How it flies by its parameters, as was told last."""
        self.absurd_parameters: set[str] = set()
        """Names of those whose values nobody would believe."""
        self.guard = ZoneGuard(config.zones, config.zone_margin_m, config.terrain)
        """Where not to fly."""
        self._zones: Sequence[Zone] = config.zones
        self.launched_enu_m: Point | None = None
        """Where it took off on our order, to which its return mode leads; None: not known."""
        self.tells_charge = False
        """Whether it has ever told the charge of its batteries."""
        self.cruise_watch = CruiseWatch()
        self.place_enu_m = (math.nan, math.nan, math.nan)
        """Where the vehicle is, by its newest position [m; mission origin]."""
        self.comes_back_into_zone = False
        """Whether it stops in a zone, and may be out of that for a while before: it has no fence of
        it yet, which it would flee from."""
        self.sent_to_enu_m: deque[Point] = deque(maxlen=_PLACES)
        """Where the vehicle was last told to fly: of the newest it may not have heard."""

    @property
    def arrival(self) -> ArrivalRule:
        """When it is where it was told to be."""
        radius_m, firmware = self.config.acceptance_radius_m, self.firmware
        if firmware is None:
            return ArrivalRule(radius_m)
        if not firmware.traits.stays:
            return ArrivalRule(max(radius_m, _CIRCLE_FRAC * self.circle_m), passes=True)
        return ArrivalRule(max(radius_m, firmware.stops_within_m), firmware.traits.drives)

    @property
    def circle_m(self) -> float:
        """Radius of the circle on which it waits; 0 of one that stays where it is [m]."""
        if self.firmware is None or self.firmware.traits.stays:
            return 0.0
        return self.told_circle_m or _CIRCLE_M

    @property
    def corner_m(self) -> float:
        """How far corners may be cut; over the ground heights are, too [m]."""
        corner_m = self.config.corner_m
        return corner_m if self.config.terrain is None else min(corner_m, _OVER_GROUND_M)

    @property
    def acceleration_m_s2(self) -> float:
        """With which it is reckoned to brake and to speed up."""
        return self.planned_m_s2 or self.set_m_s2 or _ACCELERATION_M_S2

    def known_place_m(self) -> Point | None:
        """Where the vehicle is, as far as that counts and is fresh [m; mission origin]."""
        return self.position_filter.place_m(self.now_s - self.config.stream_timeout_s)

    @property
    def is_placed(self) -> bool:
        """Whether it is known where it is, where that matters: no way is flown among zones else."""
        return not self.guard or self.known_place_m() is not None

    def arming_objection(self) -> str | None:
        """Why its motors must not be started, in words; None if they may."""
        return self.safety.arming_objection(self.vehicle, self.now_s)

    def way_objection(self, way_enu_m: Sequence[Point]) -> str | None:
        """Why that way must not be flown from where the vehicle is, in words; None if it may."""
        if not self.guard:
            return None
        place_enu_m = self.known_place_m()
        if place_enu_m is None:
            return "where it is is not known, and zones or the ground are to be kept away from"
        return self.guard.objection((place_enu_m, *way_enu_m))

    def keep_out(self, zones: Sequence[Zone], margin_m: float) -> None:
        """Heed these zones from now on, in place of those before."""
        self._zones, self.guard = zones, ZoneGuard(zones, margin_m, self.config.terrain)
        if self.fence is not None:
            self.fence.keep_out(zones)

    @property
    def silent(self) -> bool:
        """Whether it has not been heard for too long."""
        at_s = self.vehicle.silent_at_s(self.config.silence_timeout_s)
        return at_s is not None and self.now_s >= at_s

    def missing(self) -> str | None:
        """Why there is no vehicle to command yet, in words; None if there is one."""
        heartbeat, contact, wanted = self.vehicle.heartbeat, self.contact, self.config.system_id
        if heartbeat is not None and not self.silent:
            if self.firmware is None:
                return unsupported(heartbeat)
            if self.config.command is CommandStyle.MISSION and not self.firmware.takes_missions:
                kind = self.firmware.kind
                return f"a {kind} is not commanded by missions: leave out --command mission"
            return None
        if not contact.link_up:
            return "no link to the autopilot"
        if heartbeat is None and contact.wrong_autopilot is not None:
            return f"heard the vehicle with system id {contact.wrong_autopilot}, not {wanted}"
        if heartbeat is None and (reasons := " and ".join(self.codec.distrusted)):
            return f"heard only frames that are not to be believed: {reasons}"
        return f"waiting for a heartbeat of system id {wanted}"

    def meet(self, firmware: Firmware | None) -> None:
        """Speak to it as to that kind of vehicle."""
        self.firmware, self.override = firmware, None
        if firmware is not None:
            self.commands.acknowledged_twice = firmware.acknowledged_twice
            if firmware.override_spec is not None and self.config.raises_jerk:
                self.override = ParameterOverride(firmware.override_spec, self.config.commands)
        self.fence = None
        self.forget_mission()

    def forget_mission(self) -> None:
        """Know nothing of what stands on the vehicle, but for a fence that we have put there."""
        self.mission = None
        if self.firmware is None:
            return
        if self.config.command is CommandStyle.MISSION:
            self.mission = OnboardMission(self, self.firmware, self._free_line)
        if self.fence is None or not self.fence.stands:
            self.fence = OnboardFence(self, self.firmware)
            self.fence.keep_out(self.config.zones)
            self.fence.keep_out(self._zones)

    def flies_for_us(self, custom_mode: int) -> bool:
        """Whether that mode is our doing, as far as targets go."""
        if self.mission is not None:
            return self.mission.expects(custom_mode)
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
        self.mission_part.on_message(message)
        if self.mission is not None:
            self.mission.on_message(message)
        if self.fence is not None:
            self.fence.on_message(message)
        if self.override is not None:
            self.override.on_message(message)

    def advance_fence(self) -> str | None:
        """Carry on with its fence; why it is not started before, in words."""
        fence, position = self.fence, self.vehicle.position
        if fence is None:
            return None
        home_alt_m = 0.0 if position is None else position.alt_m - position.relative_alt_m
        free = self.mission is None or not self.mission.is_transferring
        home_up_m = home_alt_m - self.config.origin.alt_m
        braking_m = self._braking_way_m(_HEEDS_S, self.acceleration_m_s2)
        way_m = None if self.comes_back_into_zone else braking_m
        fence.advance(way_m, home_up_m, may_begin=free)
        return fence.objection

    def stops_in_zone(self, place_enu_m: Point) -> bool:
        """Whether it is in a zone, and that is where it is, or was just now [m].

        To stop is better there than to fly on.
        """
        here_enu_m, position = self.known_place_m(), self.vehicle.position
        if here_enu_m is None or position is None or not self.guard.inside(here_enu_m):
            return False
        flown_m = _JUST_NOW_S * math.hypot(*position.velocity_enu_m_s)
        return math.dist(here_enu_m, place_enu_m) <= _BESIDE_M + flown_m

    def slides_into_zone(self) -> bool:
        """Whether it is too fast to stop outside of zones."""
        position = self.vehicle.position
        way_m = self._braking_way_m(0.0, self.acceleration_m_s2) if self.guard else None
        if way_m is None or position is None:
            return False
        is_slow = math.hypot(*position.velocity_enu_m_s) <= self.config.arrival_speed_m_s
        return not is_slow and self.guard.objection(way_m) is not None

    def stops_at_m(self) -> Point | None:
        """Where it can stop if it brakes now, at its cruise speed at the most [m]; None: not known.

        Where it is, if it can't hover, if it is not known how it brakes or what it told last does
        not count, or if a zone is in the way.
        """
        place_enu_m, firmware = self.known_place_m(), self.firmware
        hovers = firmware is not None and firmware.traits.stays
        if self.set_m_s2 is None or not hovers or place_enu_m != self.place_enu_m:
            return place_enu_m
        way_m = self._braking_way_m(0.0, self.set_m_s2, self.cruise_speed_m_s)
        if way_m is None:
            return None
        blocked = bool(self.guard) and self.guard.objection(way_m) is not None
        return way_m[0] if blocked else way_m[1]

    def _braking_way_m(
        self, heeds_s: float, acceleration_m_s2: float, most_m_s: float = math.inf
    ) -> tuple[Point, Point] | None:
        """From where the vehicle is to where it would stop if it began to brake so late.

        A straight way [m; mission origin], braked on as from ``most_m_s`` at the most; None: not
        known.
        """
        place_enu_m, position = self.known_place_m(), self.vehicle.position
        if place_enu_m is None or position is None:
            return None
        east_m_s, north_m_s, _ = position.velocity_enu_m_s
        flown_m_s = math.hypot(east_m_s, north_m_s)
        counted_m_s = min(flown_m_s, most_m_s)
        brakes_s = min(counted_m_s / acceleration_m_s2, _BRAKES_S)
        far_m = heeds_s * flown_m_s + brakes_s / 2.0 * counted_m_s
        far_s = far_m / flown_m_s if flown_m_s > 0.0 else 0.0
        east_m, north_m, up_m = place_enu_m
        return place_enu_m, (east_m + far_s * east_m_s, north_m + far_s * north_m_s, up_m)

    def take_fence_off(self) -> bool:
        """Leave no fence of ours on a vehicle that has landed; whether that is over."""
        if self.fence is None:
            return True
        over = self.fence.take_off()
        if over:
            self.tell_caution("fence", self.fence.caution)
        return over

    def abort_fence(self) -> None:
        """Say nothing more of its fence."""
        if self.fence is not None:
            self.fence.abort()

    def _free_line(self) -> None:
        if self.fence is not None:
            self.fence.interrupt()

    def advance_mission(self) -> None:
        """Carry on what stands on the vehicle, or is on its way there."""
        heartbeat, heard_s = self.vehicle.heartbeat, self.vehicle.heartbeat_at_s
        if self.mission is not None and heartbeat is not None and heard_s is not None:
            self.mission.advance(heartbeat, heard_s)

    def mission_deadline_s(self) -> float:
        """When mission, fence or parameter may have something to do."""
        if self.mission is not None and self.mission.is_starting:
            return self.now_s + POLL_S
        override = self.override
        due_s = earliest(
            None if self.mission is None else self.mission.next_deadline_s(),
            None if override is None or self.silent else override.next_deadline_s(),
            None if self.fence is None or self.silent else self.fence.next_deadline_s(),
        )
        return math.inf if due_s is None else max(due_s, self.now_s)

    def in_its_words(self, failure: str) -> str:
        """A failure, and what the autopilot has said about it lately."""
        text = self.vehicle.telling_warning(self.now_s)
        return f"{failure}: {text}" if text and text not in failure else failure

    def forget_vehicle(self) -> None:
        """The autopilot began anew: nothing is known of it any more."""
        self.vehicle = VehicleState()
        self.mission_part = MissionPart()
        self.safety = SafetyMonitor(self.config)
        self.position_filter = PositionFilter()
        self.camera = CameraControl(self)
        self.firmware = self.mission = self.override = self.fence = None
        self.commands.cancel_all()
