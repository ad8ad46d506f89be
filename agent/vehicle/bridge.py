"""One vehicle's bridge: events in, bytes to send and reports out; no I/O, no clock.

It waits for the configured vehicle, prepares it, flies it from order to order and
brings it home. It commands no other vehicle, does not fight a pilot and trusts what it
sees over what was acknowledged. What it makes the vehicle do stands in one slot, its activity
(agent.vehicle.activity); which follows which, in agent.vehicle.transitions.

The vehicle is *handed over* when a pilot or a failsafe changes its mode, when it
disarms, reboots, ends its flight or loses its position, or when it falls silent. From
then on nothing is commanded until a new `Prepare`, or a `Return` that finds it still in
the mode that takes our targets. One that only fell silent is looked for, and taken back if
it is heard again as it was left. One that obeys and is in trouble is *advised to return*.
"""

from __future__ import annotations

import math
from functools import partial

from agent.core.interface import (
    GiveWay,
    GoTo,
    Hold,
    KeepOut,
    Prepare,
    Ready,
    Return,
    ReturnAdvised,
    Swap,
    Telemetry,
)
from agent.vehicle.activity import Activity, FlightPhase, Idle
from agent.vehicle.codec import MavlinkCodec
from agent.vehicle.commands import CommandEnded
from agent.vehicle.config import BridgeConfig
from agent.vehicle.contact import Contact, StreamRequests
from agent.vehicle.conversation import BridgeAction
from agent.vehicle.firmware import firmware_of
from agent.vehicle.hand_over import HandOver, HandOverReason, LinkLoss, hand_over
from agent.vehicle.landing import Landing
from agent.vehicle.messages import (
    BatteryStatus,
    CommandAck,
    DecodedMessage,
    ExtendedState,
    GroundHeartbeat,
    Heartbeat,
    Inbound,
    LandedState,
    Position,
    SystemStatus,
)
from agent.vehicle.obedience import obey
from agent.vehicle.preparing import Preparing
from agent.vehicle.returning import Returning
from agent.vehicle.session import (
    BridgeEvent,
    BytesReceived,
    LinkClosed,
    LinkOpened,
    TimePassed,
    VehicleSession,
)
from agent.vehicle.signing import Signing
from agent.vehicle.standing import Standing
from agent.vehicle.state import PositionNews
from agent.vehicle.supervision import intervention
from agent.vehicle.transitions import follow, follow_mission
from swarm.model.frames import enu_from_wgs84
from swarm.protocol.timing import StallDetector


class Bridge:
    """One vehicle, as the agent's core sees it."""

    def __init__(self, config: BridgeConfig, signing: Signing | None = None) -> None:
        self.config = config
        self.stale_positions = 0
        """Positions dropped because they were late or doubled."""
        self.strange_heartbeats = 0
        """Heartbeats dropped in flight: another kind of vehicle, under the same ids."""
        self._session = VehicleSession(config, signing)
        self._activity: Activity = Idle(self._session)
        self._streams: StreamRequests | None = None
        self._heartbeat_at_s = -math.inf
        self._raises_jerk = False
        self._next_deadline_s = -math.inf
        self._kept: GoTo | None = None
        """An order that is obeyed once it is known where the vehicle is."""
        self._kept_until_s = math.inf
        """When it is obeyed even so, and refused."""
        self._stall_detector = StallDetector(config.silence_timeout_s / 2.0)

    @property
    def phase(self) -> FlightPhase:
        """What it is doing."""
        return self._activity.phase

    @property
    def codec(self) -> MavlinkCodec:
        """Its side of the conversation; counts what it drops."""
        return self._session.codec

    @property
    def contact(self) -> Contact:
        """Who is heard."""
        return self._session.contact

    @property
    def boot_s(self) -> float | None:
        """How long ago the vehicle has booted, as it told last [s of its clock]; None: not told."""
        position = self._session.vehicle.position
        return None if position is None else position.boot_s

    @property
    def absurd_parameters(self) -> int:
        """How many parameters of the vehicle have values that nobody would believe."""
        return len(self._session.absurd_parameters)

    @property
    def silent(self) -> bool:
        """Whether the vehicle has not been heard for too long, at the last step."""
        return self._session.silent

    def step(self, event: BridgeEvent, now_s: float) -> list[BridgeAction]:
        """What to do about ``event``, in order; never raises on anything received."""
        session = self._session
        session.now_s = now_s
        if self._stall_detector.late(now_s):
            session.vehicle.excuse_silence(now_s)
            session.safety.excuse_silence(now_s)
            session.codec.excuse_silence(now_s)
        match event:
            case BytesReceived(data, source):
                for heard in session.codec.decode(data, source, now_s):
                    self._hear(heard)
            case GoTo() if self._activity.in_our_hands and not session.is_placed:
                # Told in a moment: an agent that was held up has heard no position meanwhile.
                self._kept, self._kept_until_s = event, now_s + self.config.position_timeout_s
            case Prepare() | GoTo() | Swap() | Hold() | Return() | GiveWay() | Ready() | KeepOut():
                if not isinstance(event, GiveWay | Ready | KeepOut):
                    self._kept = None
                self._activity = obey(self._activity, event, session)
            case LinkOpened():
                session.contact.link_up = True
                session.codec.reset_link()
                if self._streams is not None:
                    self._streams.ask_anew()
            case LinkClosed():
                session.contact.link_up = False
            case TimePassed():
                pass
        self._obey_kept()
        self._advance()
        self._next_deadline_s = self._earliest_deadline_s()
        self._stall_detector.expect_by(self._next_deadline_s)
        return session.take_actions()

    def _obey_kept(self) -> None:
        session, kept = self._session, self._kept
        if kept is None or not (session.is_placed or session.now_s >= self._kept_until_s):
            return
        self._kept = None
        self._activity = obey(self._activity, kept, session)

    def next_deadline_s(self) -> float:
        """When to step with `TimePassed` if nothing else happens before."""
        return self._next_deadline_s

    def _earliest_deadline_s(self) -> float:
        session, activity = self._session, self._activity
        deadlines_s = [
            self._heartbeat_at_s,
            activity.next_deadline_s(),
            session.mission_deadline_s(),
        ]
        if (commands_s := session.commands.next_deadline_s()) is not None:
            deadlines_s.append(commands_s)
        if self._kept is not None:
            deadlines_s.append(self._kept_until_s)
        silent_at_s = session.vehicle.silent_at_s(self.config.silence_timeout_s)
        if silent_at_s is not None and session.now_s < silent_at_s and activity.in_our_hands:
            deadlines_s.append(silent_at_s)
        return min(deadlines_s)

    # What is heard.

    def _hear(self, heard: DecodedMessage) -> None:
        session, message = self._session, heard.message
        if not session.contact.is_from_vehicle(heard):
            return
        session.vehicle.heard_at_s = session.now_s
        session.safety.on_message(message, session.now_s)
        if self._streams is not None:
            self._streams.on_message(message, session.now_s)
        match message:
            case Heartbeat():
                self._on_heartbeat(message)
            case Position():
                self._on_position(message)
            case CommandAck():
                out, ended = session.commands.on_ack(message, session.now_s)
                session.say(*out)
                self._on_ended(ended)
            case _:
                self._take_note(message)
        self._activity.on_message(message)
        if isinstance(message, Heartbeat) and (state := self._implied(message)) is not None:
            self._take_note(state)
            self._activity.on_message(state)
        self._settle()

    def _take_note(self, message: Inbound) -> None:
        """Of what is no heartbeat, position or acknowledgement."""
        session = self._session
        session.vehicle.on_message(message, session.now_s)
        session.on_message(message)
        self._heed_charge(message)

    def _implied(self, heartbeat: Heartbeat) -> ExtendedState | None:
        """Whether one that drives is under way: its motors tell, as it has no words for it."""
        firmware = self._session.firmware
        if firmware is None or not (firmware.traits.drives and firmware.flies(heartbeat)):
            return None
        return ExtendedState(LandedState.IN_AIR if heartbeat.armed else LandedState.ON_GROUND)

    def _heed_charge(self, message: Inbound) -> None:
        """Take what is known of the batteries each time that more is told."""
        session = self._session
        frac = session.vehicle.charge.frac
        if isinstance(message, SystemStatus | BatteryStatus) and frac is not None:
            session.tells_charge = True
            session.safety.on_charge(frac)

    def _settle(self) -> None:
        """Go on with what follows, if the activity has ended."""
        self._activity = follow(self._activity, self._session)

    def _on_heartbeat(self, heartbeat: Heartbeat) -> None:
        session, before = self._session, self._session.vehicle.heartbeat
        if (
            self._activity.in_our_hands
            and session.firmware
            and not session.firmware.flies(heartbeat)
        ):
            self.strange_heartbeats += 1
            return
        heartbeat = session.mission_part.read(heartbeat, firmware_of(heartbeat))
        if (
            before is not None
            and session.firmware is not None
            and session.firmware.has_rebooted(before, heartbeat)
        ):
            self._on_reboot()
        session.vehicle.on_message(heartbeat, session.now_s)
        if session.firmware is None or not session.firmware.flies(heartbeat):
            firmware = firmware_of(heartbeat)
            self._streams = StreamRequests(self.config, firmware) if firmware else None
            session.meet(firmware)
            session.commands.cancel_all()
            if isinstance(self._activity, Preparing):
                self._activity.begin_anew()
        self._check_authority(heartbeat)
        self._check_guards()

    def _check_authority(self, heartbeat: Heartbeat) -> None:
        """Hand over a vehicle that somebody else flies now."""
        session, activity = self._session, self._activity
        if session.firmware is None or not activity.in_our_hands:
            return
        why = partial(
            intervention,
            session.vehicle,
            heartbeat,
            session.firmware,
            expected=activity.expects(heartbeat),
            may_disarm=activity.may_disarm,
        )
        reason = why(session.now_s)
        if reason is not None:
            explanation = HandOverReason(reason, why, session.now_s)
            self._activity = hand_over(session, reason, explanation=explanation)

    def _check_guards(self) -> None:
        """Let go of a vehicle that has lost its way, and advise one in trouble to go home."""
        session, activity = self._session, self._activity
        firmware, now_s = session.firmware, session.now_s
        if firmware is None or not activity.in_our_hands or not firmware.airborne(session.vehicle):
            return
        returning = activity if isinstance(activity, Returning) else None
        if isinstance(activity, Returning | Landing) and activity.flies_home:
            return
        lost = session.safety.position_lost(now_s)
        if lost is not None and returning is None:
            self._activity = hand_over(session, lost)
            return
        advice = lost or session.safety.advice(session.vehicle, firmware, now_s)
        if advice is None:
            return
        if returning is not None:
            returning.go_straight()
        session.report(ReturnAdvised(advice))

    def _on_position(self, position: Position) -> None:
        match self._session.vehicle.on_position(position):
            case PositionNews.STALE:
                self.stale_positions += 1
            case PositionNews.REBOOTED:
                self._on_reboot()
            case PositionNews.FRESH:
                self._on_fresh_position(position)
            case PositionNews.UNKNOWN:
                pass

    def _on_fresh_position(self, position: Position) -> None:
        session = self._session
        place_enu_m = enu_from_wgs84(
            self.config.origin, position.lat_deg, position.lon_deg, position.alt_m
        )
        fault = session.firmware.position_fault(session.vehicle) if session.firmware else None
        session.place_enu_m = place_enu_m
        session.safety.on_position(place_enu_m, fault, session.now_s)
        velocity, battery_frac = position.velocity_enu_m_s, session.vehicle.charge.frac
        session.report(Telemetry(place_enu_m, velocity, battery_frac))
        if fault is None:  # nothing is judged by a place that the vehicle itself distrusts
            session.position_filter.on_position(place_enu_m, session.now_s)
            if session.mission is not None:
                session.mission.on_position(place_enu_m)
            self._activity.on_position(position)
            self._settle()

    def _on_reboot(self) -> None:
        """Forget what is no longer true of an autopilot that began anew."""
        if self._activity.in_our_hands:
            self._activity = hand_over(self._session, "the autopilot rebooted")
        elif isinstance(self._activity, HandOver | Preparing | Standing):
            self._activity.on_reboot()
        self._session.forget_vehicle()
        self._streams = None

    def _on_ended(self, ended: list[CommandEnded]) -> None:
        session = self._session
        for one in ended:
            if self._streams is not None:
                self._streams.on_ended(one, session.now_s)
            if session.mission is not None:
                session.mission.on_ended(one)
            if session.fence is not None:
                session.fence.on_ended(one)
            session.camera.on_ended(one)
            self._activity.on_ended(one)
            self._settle()

    # What time brings.

    def _advance(self) -> None:
        session, now_s = self._session, self._session.now_s
        if now_s >= self._heartbeat_at_s:
            self._heartbeat_at_s = now_s + self.config.heartbeat_interval_s
            session.say(GroundHeartbeat())
        out, ended = session.commands.on_time(now_s)
        session.say(*out)
        self._on_ended(ended)
        silent = session.silent
        if silent and self._activity.in_our_hands:
            self._lose()
        if not silent:
            if self._streams is not None:
                session.say(*self._streams.advance(session.commands, now_s))
            session.advance_mission()
            self._settle()
            self._activity = follow_mission(self._activity, session)
            self._advance_override()
            self._advance_fence()
            self._advance_camera()
        self._activity.advance()
        self._settle()

    def _lose(self) -> None:
        """Command nothing any more to a vehicle that is not heard, and look for it."""
        session = self._session
        loss = LinkLoss(session, tuple(session.sent_to_enu_m))
        self._activity = hand_over(session, session.vehicle.silence(session.now_s), loss=loss)

    def _advance_fence(self) -> None:
        """Have the zones on a vehicle that flies for us, and not on one that does not any more."""
        session, activity = self._session, self._activity
        if session.fence is None:
            return
        if activity.in_our_hands and session.vehicle.armed:
            session.advance_fence()
        elif isinstance(activity, Idle) and not session.vehicle.armed:
            session.take_fence_off()
        elif session.vehicle.armed or isinstance(activity, Standing | HandOver):
            session.abort_fence()
        session.tell_caution("fence", session.fence.caution)

    def _advance_camera(self) -> None:
        """Have pictures taken along lines, and nowhere else; of somebody else's vehicle never."""
        session, activity = self._session, self._activity
        if session.firmware is not None and activity.in_our_hands:
            session.camera.want(activity.trigger_m)
            session.camera.look(activity.look)
            session.camera.advance(session.firmware)

    def _advance_override(self) -> None:
        """Raise the limit of jerk from its preparation on, until it is told to go home."""
        session, activity = self._session, self._activity
        if isinstance(activity, Preparing):
            self._raises_jerk = True
        elif activity.flies_home or not activity.in_our_hands:
            self._raises_jerk = False
        if session.override is None:
            return
        session.override.want(self._raises_jerk and activity.in_our_hands)
        session.say(*session.override.advance(session.now_s))
        session.tell_caution("parameter", session.override.complaint)
