"""One vehicle's bridge: events in, bytes to send and reports out; no I/O, no clock.

It waits for the configured vehicle, prepares it, flies it from order to order and
brings it home. It commands no other vehicle, does not fight a pilot and trusts what it
sees over what was acknowledged. Leaves out: transports (agent.mavlink.link), waiting
(agent.mavlink.vehicle) and what to fly to (agent.core).

The vehicle is *handed over* when a pilot or a failsafe changes its mode, when it
disarms, reboots, ends its flight or loses its position, or when it falls silent. From
then on nothing is commanded until a new `Prepare`, or a `Return` that finds it still in
the mode that takes our targets. One that obeys and is in trouble is *advised to return*.
"""

from __future__ import annotations

import math
from enum import Enum

from agent.mavlink.authority import intervention
from agent.mavlink.codec import MavlinkCodec
from agent.mavlink.commands import CommandEnded, Commands
from agent.mavlink.config import BridgeConfig
from agent.mavlink.contact import Contact
from agent.mavlink.events import Action, Event, LinkDown, LinkUp, Received, Send, Tick
from agent.mavlink.flavours import Flavour, flavour_of
from agent.mavlink.guards import Guards
from agent.mavlink.leg import TARGET_TAG, Leg
from agent.mavlink.messages import (
    CommandAck,
    GroundHeartbeat,
    Heard,
    Heartbeat,
    Inbound,
    Landed,
    Outbound,
    Position,
)
from agent.mavlink.preparation import Preparation
from agent.mavlink.returning import Returning
from agent.mavlink.state import PositionNews, VehicleState
from agent.mavlink.streams import Streams
from agent.vehicle import (
    Arrived,
    GoTo,
    HandedOver,
    Hold,
    Home,
    NotReady,
    Orders,
    Prepare,
    Refused,
    Return,
    ReturnAdvised,
    Telemetry,
    VehicleReady,
)
from swarm.model.frames import enu_from_wgs84, wgs84_from_enu
from swarm.pulse import Pulse

__all__ = ["Bridge", "Phase"]

_POLL_S = 0.25
"""While something is waited for, look that often even if nothing is heard."""
_UNHEARD_TIMEOUTS = 3.0
"""A vehicle that may be in the air has that many silence timeouts to be heard at all."""


class Phase(Enum):
    """What the bridge is doing."""

    IDLE = "idle"
    PREPARING = "preparing"
    HOVERING = "hovering"
    FLYING = "flying"
    RETURNING = "returning"
    HANDED_OVER = "handed over"


class Bridge:
    """One vehicle, as the agent's core sees it."""

    def __init__(self, config: BridgeConfig) -> None:
        self.config = config
        self.phase = Phase.IDLE
        self.contact = Contact(config.system_id)
        self.stale_positions = 0
        """Positions dropped because they were late or doubled."""
        self.codec = MavlinkCodec(
            config.system_id,
            source_system_id=config.ground_system_id,
            source_component_id=config.ground_component_id,
        )
        self._commands = Commands(config.commands)
        self._vehicle = VehicleState()
        self._guards = Guards(config)
        self._flavour: Flavour | None = None
        self._streams: Streams | None = None
        self._prepare: Prepare | None = None
        self._preparation: Preparation | None = None
        self._returning: Returning | None = None
        self._to_return: Return | None = None
        """Ordered before the vehicle was heard, which may be in the air."""
        self._to_return_until_s = 0.0
        self._speed_m_s = 0.0
        """Cruise speed of the last preparation [m/s]."""
        self._order: GoTo | None = None
        self._leg: Leg | None = None
        self._told_not_ready: str | None = None
        self._heartbeat_at_s = -math.inf
        self._pulse = Pulse(config.silence_timeout_s / 2.0)
        self._now_s = 0.0
        self._actions: list[Action] = []

    def step(self, event: Event, now_s: float) -> list[Action]:
        """What to do about ``event``, in order; never raises on anything received."""
        self._now_s = now_s
        if self._pulse.late(now_s):
            self._vehicle.excuse_silence(now_s)
            self._guards.excuse_silence(now_s)
        match event:
            case Received(data):
                for heard in self.codec.decode(data):
                    self._hear(heard)
            case Prepare() | GoTo() | Hold() | Return():
                self._obey(event)
            case LinkUp():
                self.contact.link_up = True
                self.codec.reset_link()
                if self._streams is not None:
                    self._streams.ask_anew()
            case LinkDown():
                self.contact.link_up = False
            case Tick():
                pass
        self._advance()
        self._pulse.promise(self.next_deadline_s())
        actions, self._actions = self._actions, []
        return actions

    def next_deadline_s(self) -> float:
        """When to step with `Tick` if nothing else happens before."""
        deadlines_s = [self._heartbeat_at_s]
        if (commands_s := self._commands.next_deadline_s()) is not None:
            deadlines_s.append(commands_s)
        if self.phase in (Phase.PREPARING, Phase.RETURNING) or self._to_return is not None:
            deadlines_s.append(self._now_s + _POLL_S)
        heard_s = self._vehicle.heartbeat_at_s
        if heard_s is not None and self._in_our_hands() and not self._silent():
            deadlines_s.append(heard_s + self.config.silence_timeout_s)
        return min(deadlines_s)

    # What is heard.

    def _hear(self, heard: Heard) -> None:
        if not self.contact.is_from_vehicle(heard):
            return
        message = heard.message
        self._guards.on_message(message, self._now_s)
        if self._streams is not None:
            self._streams.on_message(message, self._now_s)
        match message:
            case Heartbeat():
                self._on_heartbeat(message)
            case Position():
                self._on_position(message)
            case CommandAck():
                out, ended = self._commands.on_ack(message, self._now_s)
                self._say(*out)
                self._on_ended(ended)
            case _:
                self._vehicle.on_message(message, self._now_s)
                self._pass_to_preparation(message)

    def _pass_to_preparation(self, message: Inbound) -> None:
        if self._preparation is not None:
            self._say(*self._preparation.on_message(message, self._now_s))

    def _on_heartbeat(self, heartbeat: Heartbeat) -> None:
        vehicle, before = self._vehicle, self._vehicle.heartbeat
        if (
            before is not None
            and self._flavour is not None
            and self._flavour.has_booted(before)
            and not self._flavour.has_booted(heartbeat)
        ):
            self._on_reboot()
            vehicle = self._vehicle
        vehicle.on_message(heartbeat, self._now_s)
        if self._flavour is None or not self._flavour.flies(heartbeat):
            self._flavour = flavour_of(heartbeat)
            self._streams = Streams(self.config, self._flavour) if self._flavour else None
            if self._flavour is not None:
                self._commands.acknowledged_twice = self._flavour.acknowledged_twice
        self._check_authority(heartbeat)
        self._check_guards()

    def _check_authority(self, heartbeat: Heartbeat) -> None:
        """Hand over a vehicle that somebody else flies now."""
        flavour = self._flavour
        if flavour is None or not self._in_our_hands():
            return
        mode = heartbeat.custom_mode
        ours = self._obeys(mode)
        if self._returning is not None:
            ours = not heartbeat.armed or self._returning.expects(mode)
        reason = intervention(
            self._vehicle,
            heartbeat,
            flavour,
            self._now_s,
            expected=ours,
            may_disarm=self.phase in (Phase.PREPARING, Phase.RETURNING),
        )
        if reason is not None:
            self._hand_over(reason)

    def _check_guards(self) -> None:
        """Let go of a vehicle that has lost its way, and advise one in trouble to go home."""
        flavour = self._flavour
        if flavour is None or not self._in_our_hands() or self._returning is not None:
            return
        if not flavour.airborne(self._vehicle):
            return
        if (lost := self._guards.position_lost(self._now_s)) is not None:
            self._hand_over(lost)
        elif (advice := self._guards.advice(self._vehicle, flavour, self._now_s)) is not None:
            self._actions.append(ReturnAdvised(advice))

    def _on_position(self, position: Position) -> None:
        match self._vehicle.on_position(position):
            case PositionNews.STALE:
                self.stale_positions += 1
            case PositionNews.REBOOTED:
                self._on_reboot()
            case PositionNews.FRESH:
                self._on_fresh_position(position)
            case PositionNews.UNKNOWN:
                pass

    def _on_fresh_position(self, position: Position) -> None:
        place_enu_m = enu_from_wgs84(
            self.config.origin, position.lat_deg, position.lon_deg, position.alt_m
        )
        velocity = position.velocity_enu_m_s
        fault = self._flavour.position_fault(self._vehicle) if self._flavour else None
        self._guards.on_position(place_enu_m, fault, self._now_s)
        self._actions.append(Telemetry(place_enu_m, velocity, self._vehicle.battery_frac))
        if self._preparation is not None:
            self._say(*self._preparation.on_position(position, self._now_s))
        leg, order = self._leg, self._order
        if leg is None or order is None:
            return
        self._say(*leg.on_position(place_enu_m, velocity, self._commands, self._now_s))
        if leg.arrived:
            self._end_leg()
            self._actions.append(Arrived(order.leg))
        elif leg.failure is not None:
            self._refuse_leg(order, leg.failure)

    def _on_reboot(self) -> None:
        """Forget what is no longer true of an autopilot that began anew."""
        if self._in_our_hands():
            self._hand_over("the autopilot rebooted")
        self._vehicle = VehicleState()
        self._guards = Guards(self.config)
        self._flavour = None
        self._streams = None
        self._preparation = None
        self._commands.cancel_all()

    def _on_ended(self, ended: list[CommandEnded]) -> None:
        for one in ended:
            if self._streams is not None:
                self._streams.on_ended(one, self._now_s)
            if self._preparation is not None:
                self._say(*self._preparation.on_ended(one, self._now_s))
            if self._returning is not None:
                self._returning.on_ended(one, self._now_s)
            if self._leg is not None and self._order is not None:
                self._leg.on_ended(one)
                if self._leg.failure is not None:
                    self._refuse_leg(self._order, self._leg.failure)

    # What is ordered.

    def _obey(self, order: Orders) -> None:
        match order:
            case Prepare():
                self._begin_preparation(order)
            case GoTo():
                self._go_to(order)
            case Hold():
                self._hold(order)
            case Return():
                self._return(order)

    def _begin_preparation(self, order: Prepare) -> None:
        if fault := self.config.out_of_bounds(order.position_enu_m):
            self._actions.append(Refused(order, fault))
            return
        if not (math.isfinite(order.speed_m_s) and order.speed_m_s > 0.0):
            self._actions.append(Refused(order, f"speed {order.speed_m_s} m/s is not > 0"))
            return
        self._drop_work()
        self._guards.begin()
        self.phase = Phase.PREPARING
        self._prepare = order
        self._speed_m_s = order.speed_m_s
        self._told_not_ready = None

    def _go_to(self, order: GoTo) -> None:
        if self.phase not in (Phase.HOVERING, Phase.FLYING) or self._flavour is None:
            self._actions.append(Refused(order, f"the vehicle is {self.phase.value}"))
            return
        if fault := self.config.out_of_bounds(order.position_enu_m):
            self._actions.append(Refused(order, fault))
            return
        place = wgs84_from_enu(self.config.origin, order.position_enu_m)
        message = self._flavour.reposition(*place, self._speed_m_s)
        leg = Leg(order.position_enu_m, message, self.config)
        self._order, self._leg = order, leg
        self.phase = Phase.FLYING
        self._say(*leg.start(self._commands, self._now_s))

    def _hold(self, order: Hold) -> None:
        position = self._vehicle.position
        if self.phase not in (Phase.HOVERING, Phase.FLYING) or position is None:
            self._actions.append(Refused(order, f"the vehicle is {self.phase.value}"))
            return
        if self._flavour is None:
            return
        self._end_leg()
        here = (position.lat_deg, position.lon_deg, position.alt_m)
        message = self._flavour.reposition(*here, self._speed_m_s)
        self._say(*self._commands.send(TARGET_TAG, message, self._now_s))

    def _return(self, order: Return) -> None:
        if self.phase is Phase.RETURNING:
            return
        took_off = self.phase in (Phase.HOVERING, Phase.FLYING) or self._took_off()
        motors_asked_for = self._preparation is not None and self._preparation.engaged
        flavour, heartbeat = self._flavour, self._vehicle.heartbeat
        self._drop_work()
        self.phase = Phase.IDLE
        if flavour is None or heartbeat is None:
            if order.resume:
                patience_s = _UNHEARD_TIMEOUTS * self.config.silence_timeout_s
                self._to_return, self._to_return_until_s = order, self._now_s + patience_s
                self._told_not_ready = None
            else:
                self._actions.append(Home())
            return
        mode = heartbeat.custom_mode
        taking_off = flavour.is_taking_off(mode) and (took_off or order.resume)
        commanded = flavour.is_commanded(mode) or taking_off
        aloft = heartbeat.armed and (took_off or flavour.airborne(self._vehicle) is not False)
        if not aloft:
            # That it was armed may not have been heard yet.
            if commanded and (heartbeat.armed or motors_asked_for):
                self._say(*self._commands.send("disarm", flavour.disarm(), self._now_s))
            self._actions.append(Home())
            return
        if self._silent():
            self._refuse_return(order, "the autopilot is silent")
        elif not (commanded or flavour.is_returning(mode)):
            self._hand_over(f"its pilot flies it in {flavour.mode_name(mode)}")
        else:
            self._returning = Returning(order, self.config, self._commands, flavour)
            self.phase = Phase.RETURNING

    def _refuse_return(self, order: Return, reason: str) -> None:
        self.phase = Phase.HANDED_OVER
        self._actions.append(Refused(order, reason))

    # What time brings.

    def _advance(self) -> None:
        now_s = self._now_s
        if now_s >= self._heartbeat_at_s:
            self._heartbeat_at_s = now_s + self.config.heartbeat_interval_s
            self._say(GroundHeartbeat())
        out, ended = self._commands.on_time(now_s)
        self._say(*out)
        self._on_ended(ended)
        silent = self._silent()
        if silent and self._in_our_hands():
            self._hand_over(f"no heartbeat for {self.config.silence_timeout_s:g} s")
        if self._streams is not None and not silent:
            self._say(*self._streams.advance(self._commands, now_s))
        if self.phase is Phase.PREPARING:
            self._advance_preparation()
        elif self.phase is Phase.RETURNING:
            self._advance_return()
        elif self._to_return is not None:
            self._look_for_vehicle(self._to_return)

    def _advance_preparation(self) -> None:
        heartbeat, order = self._vehicle.heartbeat, self._prepare
        if order is None:
            return
        if (reason := self._unheard()) is not None:
            self._tell_not_ready(reason)
            return
        if heartbeat is None or self._flavour is None:
            return
        if self._preparation is None:
            self._preparation = Preparation(
                order, self.config, self._commands, self._flavour, self._guards
            )
        preparation = self._preparation
        self._say(*preparation.advance(self._vehicle, heartbeat, self._now_s))
        if preparation.failure is not None:
            aloft = heartbeat.armed and self._flavour.airborne(self._vehicle)
            obeys = self._obeys(heartbeat.custom_mode)
            self._drop_work()
            if aloft and obeys:
                self.phase = Phase.HOVERING  # nobody else would bring it down
                self._actions.append(ReturnAdvised(preparation.failure))
            else:
                self.phase = Phase.IDLE
                self._actions.append(Refused(order, preparation.failure))
        elif preparation.done:
            self._drop_work()
            self.phase = Phase.HOVERING
            self._actions.append(VehicleReady())
        else:
            self._tell_not_ready(preparation.waiting_for)

    def _unheard(self) -> str | None:
        """Why there is no vehicle to prepare yet; None if there is one."""
        heartbeat = self._vehicle.heartbeat
        return self.contact.missing(heartbeat, self._flavour, silent=self._silent())

    def _tell_not_ready(self, reason: str) -> None:
        if reason != self._told_not_ready:
            self._told_not_ready = reason
            self._actions.append(NotReady(reason))

    def _look_for_vehicle(self, order: Return) -> None:
        """Return the vehicle once it is heard; it has this long to be."""
        if (reason := self._unheard()) is None:
            self._return(order)
        elif self._now_s < self._to_return_until_s:
            self._tell_not_ready(reason)
        else:
            self._drop_work()
            self._refuse_return(order, reason)

    def _advance_return(self) -> None:
        returning, heartbeat = self._returning, self._vehicle.heartbeat
        if returning is None or heartbeat is None:
            return
        self._say(*returning.advance(heartbeat, self._now_s))
        on_ground = self._vehicle.landed in (Landed.ON_GROUND, Landed.UNDEFINED)
        if not heartbeat.armed and (on_ground or returning.disarmed_long(self._now_s)):
            self._drop_work()
            self.phase = Phase.IDLE
            self._actions.append(Home())
        elif returning.failure is not None:
            self._drop_work()
            self.phase = Phase.HOVERING
            self._actions.append(Refused(returning.order, returning.failure))

    # Keeping the books.

    def _in_our_hands(self) -> bool:
        """Whether the vehicle is, or may be, in the air on our orders."""
        if self.phase is Phase.PREPARING:
            return self._preparation is not None and self._preparation.engaged
        return self.phase in (Phase.HOVERING, Phase.FLYING, Phase.RETURNING)

    def _obeys(self, custom_mode: int) -> bool:
        """Whether the vehicle takes our orders in that mode, be it still taking off on one."""
        flavour = self._flavour
        return flavour is not None and (
            flavour.is_commanded(custom_mode)
            or (flavour.is_taking_off(custom_mode) and self._took_off())
        )

    def _took_off(self) -> bool:
        """Whether the preparation under way has asked for takeoff."""
        return self._preparation is not None and self._preparation.took_off

    def _silent(self) -> bool:
        heard_s = self._vehicle.heartbeat_at_s
        return heard_s is not None and self._now_s - heard_s >= self.config.silence_timeout_s

    def _hand_over(self, reason: str) -> None:
        self._drop_work()
        self.phase = Phase.HANDED_OVER
        self._actions.append(HandedOver(reason))

    def _refuse_leg(self, order: GoTo, reason: str) -> None:
        self._end_leg()
        text = self._vehicle.recent_warning(self._now_s)
        self._actions.append(Refused(order, f"{reason}: {text}" if text else reason))

    def _end_leg(self) -> None:
        self._leg = self._order = None
        self.phase = Phase.HOVERING

    def _drop_work(self) -> None:
        """Give up whatever is under way; nothing is sent about it any more."""
        self._leg = self._order = None
        self._prepare = self._preparation = self._returning = self._to_return = None
        self._commands.cancel_all()

    def _say(self, *messages: Outbound) -> None:
        self._actions += [Send(self.codec.encode(message)) for message in messages]
