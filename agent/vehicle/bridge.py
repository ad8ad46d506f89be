"""One vehicle's bridge: events in, bytes to send and reports out; no I/O, no clock.

It waits for the configured vehicle, prepares it, flies it from order to order and
brings it home. It commands no other vehicle, does not fight a pilot and trusts what it
sees over what was acknowledged. Leaves out: transports (agent.links.link), waiting
(agent.links.mavlink_vehicle) and what to fly to (agent.core.agent_core).

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
    GoTo,
    HandOverExplained,
    HeardAgain,
    Hold,
    Prepare,
    Return,
    ReturnAdvised,
    Telemetry,
)
from agent.vehicle.activity import Activity, FlightPhase, OrderHandler
from agent.vehicle.activity_runner import ActivityRunner
from agent.vehicle.codec import MavlinkCodec
from agent.vehicle.commands import CommandEnded
from agent.vehicle.config import BridgeConfig
from agent.vehicle.contact import Contact, StreamRequests
from agent.vehicle.firmware import firmware_of
from agent.vehicle.messages import CommandAck, DecodedMessage, GroundHeartbeat, Heartbeat, Position
from agent.vehicle.session import (
    BridgeAction,
    BridgeEvent,
    BytesReceived,
    LinkClosed,
    LinkOpened,
    TimePassed,
    VehicleSession,
)
from agent.vehicle.signing import Signing
from agent.vehicle.state import PositionNews
from agent.vehicle.supervision import HandOverReason, intervention
from swarm.model.frames import enu_from_wgs84
from swarm.protocol.timing import StallDetector

__all__ = ["Bridge"]


class Bridge:
    """One vehicle, as the agent's core sees it."""

    def __init__(self, config: BridgeConfig, signing: Signing | None = None) -> None:
        self.config = config
        self.stale_positions = 0
        """Positions dropped because they were late or doubled."""
        self.strange_heartbeats = 0
        """Heartbeats dropped in flight: another kind of vehicle, under the same ids."""
        self._session = VehicleSession(config, signing)
        self._activity = Activity(self._session)
        self._order_handler = OrderHandler(self._session, self._activity)
        self._runner = ActivityRunner(self._session, self._activity, self._order_handler)
        self._streams: StreamRequests | None = None
        self._heartbeat_at_s = -math.inf
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
            case Prepare() | GoTo() | Hold() | Return():
                self._order_handler.obey(event)
            case LinkOpened():
                session.contact.link_up = True
                session.codec.reset_link()
                if self._streams is not None:
                    self._streams.ask_anew()
            case LinkClosed():
                session.contact.link_up = False
            case TimePassed():
                pass
        self._advance()
        self._stall_detector.expect_by(self.next_deadline_s())
        return session.take_actions()

    def next_deadline_s(self) -> float:
        """When to step with `TimePassed` if nothing else happens before."""
        session = self._session
        deadlines_s = [self._heartbeat_at_s, self._runner.next_deadline_s()]
        if (commands_s := session.commands.next_deadline_s()) is not None:
            deadlines_s.append(commands_s)
        silent_at_s = session.vehicle.silent_at_s(self.config.silence_timeout_s)
        if silent_at_s is not None and self._activity.in_our_hands() and not session.silent:
            deadlines_s.append(silent_at_s)
        if self._activity.explanation is not None:
            deadlines_s.append(self._activity.explanation.due_s)
        return min(deadlines_s)

    # What is heard.

    def _hear(self, heard: DecodedMessage) -> None:
        session, message = self._session, heard.message
        if not session.contact.is_from_vehicle(heard):
            return
        session.vehicle.heard_at_s = session.now_s
        session.safety.on_message(message, session.now_s)
        if self._activity.loss is not None:
            self._activity.loss.on_message(message)
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
                session.vehicle.on_message(message, session.now_s)
                self._runner.on_message(message)

    def _on_heartbeat(self, heartbeat: Heartbeat) -> None:
        session, before = self._session, self._session.vehicle.heartbeat
        if (
            self._activity.in_our_hands()
            and session.firmware
            and not session.firmware.flies(heartbeat)
        ):
            self.strange_heartbeats += 1
            return
        if (
            before is not None
            and session.firmware is not None
            and session.firmware.has_booted(before)
            and not session.firmware.has_booted(heartbeat)
        ):
            self._on_reboot()
        session.vehicle.on_message(heartbeat, session.now_s)
        if session.firmware is None or not session.firmware.flies(heartbeat):
            firmware = firmware_of(heartbeat)
            self._streams = StreamRequests(self.config, firmware) if firmware else None
            session.meet(firmware)
            self._activity.forget_preparation()
        self._check_authority(heartbeat)
        self._check_guards()

    def _check_authority(self, heartbeat: Heartbeat) -> None:
        """Hand over a vehicle that somebody else flies now."""
        session, activity = self._session, self._activity
        if session.firmware is None or not activity.in_our_hands():
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
            activity.hand_over(reason)
            activity.explanation = HandOverReason(reason, why, session.now_s)

    def _check_guards(self) -> None:
        """Let go of a vehicle that has lost its way, and advise one in trouble to go home."""
        session, activity = self._session, self._activity
        firmware, now_s = session.firmware, session.now_s
        if (
            firmware is None
            or not activity.in_our_hands()
            or not firmware.airborne(session.vehicle)
        ):
            return
        returning = activity.returning if activity.phase is FlightPhase.RETURNING else None
        if returning is not None and not returning.on_detour:
            return
        lost = session.safety.position_lost(now_s)
        if lost is not None and returning is None:
            activity.hand_over(lost)
            return
        advice = lost or session.safety.advice(session.vehicle, firmware, now_s)
        if advice is None:
            return
        if returning is not None:
            session.say(*returning.go_straight(now_s))
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
        session.safety.on_position(place_enu_m, fault, session.now_s)
        velocity, battery_frac = position.velocity_enu_m_s, session.vehicle.battery_frac
        session.report(Telemetry(place_enu_m, velocity, battery_frac))
        if fault is None:  # nothing is judged by a place that the vehicle itself distrusts
            session.position_filter.on_position(place_enu_m, session.now_s)
            self._runner.on_position(position, place_enu_m)

    def _on_reboot(self) -> None:
        """Forget what is no longer true of an autopilot that began anew."""
        if self._activity.loss is not None:
            self._activity.loss = None
            self._session.report(HandOverExplained("heard again: the autopilot rebooted"))
        self._runner.on_reboot()
        self._session.forget_vehicle()
        self._streams = None

    def _on_ended(self, ended: list[CommandEnded]) -> None:
        if self._streams is not None:
            for one in ended:
                self._streams.on_ended(one, self._session.now_s)
        self._runner.on_ended(ended)

    def _explain(self) -> None:
        """Complete the reason of a hand-over once the words for it have had their time."""
        explanation = self._activity.explanation
        if explanation is None or self._session.now_s < explanation.due_s:
            return
        self._activity.explanation = None
        if (reason := explanation.better()) is not None:
            self._session.report(HandOverExplained(reason))

    def _look_for_lost(self) -> None:
        """Take a vehicle back that is heard again as it was left, or say what became of it."""
        loss = self._activity.loss
        news = None if loss is None else loss.news()
        if isinstance(news, HeardAgain):
            self._activity.take_back()
        elif news is not None:
            self._activity.loss = None
        if news is not None:
            self._session.report(news)

    # What time brings.

    def _advance(self) -> None:
        session, now_s = self._session, self._session.now_s
        if now_s >= self._heartbeat_at_s:
            self._heartbeat_at_s = now_s + self.config.heartbeat_interval_s
            session.say(GroundHeartbeat())
        out, ended = session.commands.on_time(now_s)
        session.say(*out)
        self._on_ended(ended)
        if session.silent and self._activity.in_our_hands():
            self._activity.lose()
        self._explain()
        self._look_for_lost()
        if self._streams is not None and not session.silent:
            session.say(*self._streams.advance(session.commands, now_s))
        self._runner.advance()
