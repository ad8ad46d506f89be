"""One vehicle's bridge: events in, bytes to send and reports out; no I/O, no clock.

It waits for the configured vehicle, prepares it, flies it from order to order and
brings it home. It commands no other vehicle, does not fight a pilot and trusts what it
sees over what was acknowledged. Leaves out: transports (agent.mavlink.link), waiting
(agent.mavlink.vehicle) and what to fly to (agent.core).

The vehicle is *handed over* when a pilot or a failsafe changes its mode, when it
disarms, reboots, ends its flight or loses its position, or when it falls silent. From
then on nothing is commanded until a new `Prepare`, or a `Return` that finds it still in
the mode that takes our targets. One that only fell silent is looked for, and taken back if
it is heard again as it was left. One that obeys and is in trouble is *advised to return*.
"""

from __future__ import annotations

import math
from functools import partial

from agent.mavlink.authority import Explanation, intervention
from agent.mavlink.codec import MavlinkCodec
from agent.mavlink.commands import CommandEnded
from agent.mavlink.config import BridgeConfig
from agent.mavlink.contact import Contact
from agent.mavlink.duty import Duty
from agent.mavlink.events import Action, Event, LinkDown, LinkUp, Received, Tick
from agent.mavlink.flavours import flavour_of
from agent.mavlink.messages import (
    CommandAck,
    GroundHeartbeat,
    Heard,
    Heartbeat,
    Position,
)
from agent.mavlink.orders import OrderTaker
from agent.mavlink.seat import Seat
from agent.mavlink.signing import Signing
from agent.mavlink.state import PositionNews
from agent.mavlink.streams import Streams
from agent.mavlink.work import Phase, Work
from agent.vehicle import (
    GoTo,
    HandOverExplained,
    HeardAgain,
    Hold,
    Prepare,
    Return,
    ReturnAdvised,
    Telemetry,
)
from swarm.model.frames import enu_from_wgs84
from swarm.pulse import Pulse

__all__ = ["Bridge", "Phase"]


class Bridge:
    """One vehicle, as the agent's core sees it."""

    def __init__(self, config: BridgeConfig, signing: Signing | None = None) -> None:
        self.config = config
        self.stale_positions = 0
        """Positions dropped because they were late or doubled."""
        self.strange_heartbeats = 0
        """Heartbeats dropped in flight: another kind of vehicle, under the same ids."""
        self._seat = Seat(config, signing)
        self._work = Work(self._seat)
        self._orders = OrderTaker(self._seat, self._work)
        self._duty = Duty(self._seat, self._work, self._orders)
        self._streams: Streams | None = None
        self._heartbeat_at_s = -math.inf
        self._pulse = Pulse(config.silence_timeout_s / 2.0)

    @property
    def phase(self) -> Phase:
        """What it is doing."""
        return self._work.phase

    @property
    def codec(self) -> MavlinkCodec:
        """Its side of the conversation; counts what it drops."""
        return self._seat.codec

    @property
    def contact(self) -> Contact:
        """Who is heard."""
        return self._seat.contact

    @property
    def silent(self) -> bool:
        """Whether the vehicle has not been heard for too long, at the last step."""
        return self._seat.silent

    def step(self, event: Event, now_s: float) -> list[Action]:
        """What to do about ``event``, in order; never raises on anything received."""
        seat = self._seat
        seat.now_s = now_s
        if self._pulse.late(now_s):
            seat.vehicle.excuse_silence(now_s)
            seat.guards.excuse_silence(now_s)
            seat.codec.excuse_silence(now_s)
        match event:
            case Received(data, source):
                for heard in seat.codec.decode(data, source, now_s):
                    self._hear(heard)
            case Prepare() | GoTo() | Hold() | Return():
                self._orders.obey(event)
            case LinkUp():
                seat.contact.link_up = True
                seat.codec.reset_link()
                if self._streams is not None:
                    self._streams.ask_anew()
            case LinkDown():
                seat.contact.link_up = False
            case Tick():
                pass
        self._advance()
        self._pulse.promise(self.next_deadline_s())
        return seat.take_actions()

    def next_deadline_s(self) -> float:
        """When to step with `Tick` if nothing else happens before."""
        seat = self._seat
        deadlines_s = [self._heartbeat_at_s, self._duty.next_deadline_s()]
        if (commands_s := seat.commands.next_deadline_s()) is not None:
            deadlines_s.append(commands_s)
        silent_at_s = seat.vehicle.silent_at_s(self.config.silence_timeout_s)
        if silent_at_s is not None and self._work.in_our_hands() and not seat.silent:
            deadlines_s.append(silent_at_s)
        if self._work.explanation is not None:
            deadlines_s.append(self._work.explanation.due_s)
        return min(deadlines_s)

    # What is heard.

    def _hear(self, heard: Heard) -> None:
        seat, message = self._seat, heard.message
        if not seat.contact.is_from_vehicle(heard):
            return
        seat.vehicle.heard_at_s = seat.now_s
        seat.guards.on_message(message, seat.now_s)
        if self._work.loss is not None:
            self._work.loss.on_message(message)
        if self._streams is not None:
            self._streams.on_message(message, seat.now_s)
        match message:
            case Heartbeat():
                self._on_heartbeat(message)
            case Position():
                self._on_position(message)
            case CommandAck():
                out, ended = seat.commands.on_ack(message, seat.now_s)
                seat.say(*out)
                self._on_ended(ended)
            case _:
                seat.vehicle.on_message(message, seat.now_s)
                self._duty.on_message(message)

    def _on_heartbeat(self, heartbeat: Heartbeat) -> None:
        seat, before = self._seat, self._seat.vehicle.heartbeat
        if self._work.in_our_hands() and seat.flavour and not seat.flavour.flies(heartbeat):
            self.strange_heartbeats += 1
            return
        if (
            before is not None
            and seat.flavour is not None
            and seat.flavour.has_booted(before)
            and not seat.flavour.has_booted(heartbeat)
        ):
            self._on_reboot()
        seat.vehicle.on_message(heartbeat, seat.now_s)
        if seat.flavour is None or not seat.flavour.flies(heartbeat):
            flavour = flavour_of(heartbeat)
            self._streams = Streams(self.config, flavour) if flavour else None
            seat.meet(flavour)
            self._work.forget_preparation()
        self._check_authority(heartbeat)
        self._check_guards()

    def _check_authority(self, heartbeat: Heartbeat) -> None:
        """Hand over a vehicle that somebody else flies now."""
        seat, work = self._seat, self._work
        if seat.flavour is None or not work.in_our_hands():
            return
        why = partial(
            intervention,
            seat.vehicle,
            heartbeat,
            seat.flavour,
            expected=work.expects(heartbeat),
            may_disarm=work.may_disarm,
        )
        reason = why(seat.now_s)
        if reason is not None:
            work.hand_over(reason)
            work.explanation = Explanation(reason, why, seat.now_s)

    def _check_guards(self) -> None:
        """Let go of a vehicle that has lost its way, and advise one in trouble to go home."""
        seat, work = self._seat, self._work
        flavour, now_s = seat.flavour, seat.now_s
        if flavour is None or not work.in_our_hands() or not flavour.airborne(seat.vehicle):
            return
        returning = work.returning if work.phase is Phase.RETURNING else None
        if returning is not None and not returning.on_detour:
            return
        lost = seat.guards.position_lost(now_s)
        if lost is not None and returning is None:
            work.hand_over(lost)
            return
        advice = lost or seat.guards.advice(seat.vehicle, flavour, now_s)
        if advice is None:
            return
        if returning is not None:
            seat.say(*returning.go_straight(now_s))
        seat.report(ReturnAdvised(advice))

    def _on_position(self, position: Position) -> None:
        match self._seat.vehicle.on_position(position):
            case PositionNews.STALE:
                self.stale_positions += 1
            case PositionNews.REBOOTED:
                self._on_reboot()
            case PositionNews.FRESH:
                self._on_fresh_position(position)
            case PositionNews.UNKNOWN:
                pass

    def _on_fresh_position(self, position: Position) -> None:
        seat = self._seat
        place_enu_m = enu_from_wgs84(
            self.config.origin, position.lat_deg, position.lon_deg, position.alt_m
        )
        fault = seat.flavour.position_fault(seat.vehicle) if seat.flavour else None
        seat.guards.on_position(place_enu_m, fault, seat.now_s)
        velocity, battery_frac = position.velocity_enu_m_s, seat.vehicle.battery_frac
        seat.report(Telemetry(place_enu_m, velocity, battery_frac))
        if fault is None:  # nothing is judged by a place that the vehicle itself distrusts
            seat.whereabouts.on_position(place_enu_m, seat.now_s)
            self._duty.on_position(position, place_enu_m)

    def _on_reboot(self) -> None:
        """Forget what is no longer true of an autopilot that began anew."""
        if self._work.loss is not None:
            self._work.loss = None
            self._seat.report(HandOverExplained("heard again: the autopilot rebooted"))
        self._duty.on_reboot()
        self._seat.forget_vehicle()
        self._streams = None

    def _on_ended(self, ended: list[CommandEnded]) -> None:
        if self._streams is not None:
            for one in ended:
                self._streams.on_ended(one, self._seat.now_s)
        self._duty.on_ended(ended)

    def _explain(self) -> None:
        """Complete the reason of a hand-over once the words for it have had their time."""
        explanation = self._work.explanation
        if explanation is None or self._seat.now_s < explanation.due_s:
            return
        self._work.explanation = None
        if (reason := explanation.better()) is not None:
            self._seat.report(HandOverExplained(reason))

    def _look_for_lost(self) -> None:
        """Take a vehicle back that is heard again as it was left, or say what became of it."""
        loss = self._work.loss
        news = None if loss is None else loss.news()
        if isinstance(news, HeardAgain):
            self._work.take_back()
        elif news is not None:
            self._work.loss = None
        if news is not None:
            self._seat.report(news)

    # What time brings.

    def _advance(self) -> None:
        seat, now_s = self._seat, self._seat.now_s
        if now_s >= self._heartbeat_at_s:
            self._heartbeat_at_s = now_s + self.config.heartbeat_interval_s
            seat.say(GroundHeartbeat())
        out, ended = seat.commands.on_time(now_s)
        seat.say(*out)
        self._on_ended(ended)
        if seat.silent and self._work.in_our_hands():
            self._work.lose()
        self._explain()
        self._look_for_lost()
        if self._streams is not None and not seat.silent:
            seat.say(*self._streams.advance(seat.commands, now_s))
        self._duty.advance()
