"""What one vehicle is being made to do, and how an order begins it.

One thing at a time, each by a machine of its own. An order is refused if it cannot be carried
out, and one for a vehicle of which nothing is known yet waits. Leaves out: how what was begun
goes on (agent.vehicle.activity_runner).
"""

from __future__ import annotations

import math
from collections import deque
from enum import Enum

from agent.core.interface import (
    Caution,
    GoTo,
    HandedOver,
    Held,
    Hold,
    Home,
    NotReady,
    Prepare,
    Refused,
    Return,
    VehicleOrder,
)
from agent.vehicle.config import BridgeConfig
from agent.vehicle.firmware.profile import Firmware
from agent.vehicle.holding import Holding, modes_to_leave
from agent.vehicle.leg import Target
from agent.vehicle.messages import Heartbeat, Landed
from agent.vehicle.preparation import Preparation
from agent.vehicle.returning import Returning, ReturnVia
from agent.vehicle.session import LinkLoss, VehicleSearch, VehicleSession
from agent.vehicle.supervision import HandOverReason

__all__ = ["Activity", "FlightPhase", "OrderHandler"]


Point = tuple[float, float, float]


_PLACES = 2


class FlightPhase(Enum):
    """What is being done."""

    IDLE = "idle"
    PREPARING = "preparing"
    HOVERING = "hovering"
    FLYING = "flying"
    HOLDING = "being stopped"
    RETURNING = "returning"
    HANDED_OVER = "handed over"


class Activity:
    """What one vehicle is being made to do.

    Args:
        session: with the vehicle.
    """

    def __init__(self, session: VehicleSession) -> None:
        self.phase = FlightPhase.IDLE
        self._session = session
        self.prepare: Prepare | None = None
        self.prepares_ours = False
        """The vehicle to be prepared flew, or was about to fly, on our orders."""
        self.preparation: Preparation | None = None
        self.target: Target | None = None
        self.holding: Holding | None = None
        self.returning: Returning | None = None
        self.search: VehicleSearch | None = None
        """For what the vehicle does, which may be in the air; then the order is carried out."""
        self.prepare_next: Prepare | None = None
        """Ordered of a vehicle that has to be stopped first."""
        self.speed_m_s = 0.0
        """Cruise speed of the last preparation [m/s]."""
        self.sent_to_enu_m: deque[Point] = deque(maxlen=_PLACES)
        """Where the vehicle was last told to fly: of the newest it may not have heard."""
        self.explanation: HandOverReason | None = None
        """Of a hand-over whose reason may not have been said in full."""
        self.loss: LinkLoss | None = None
        """Of a vehicle that was handed over for its silence, as long as it may be ours."""
        self._told_not_ready: str | None = None
        self._told_caution: str | None = None

    def in_our_hands(self) -> bool:
        """Whether the vehicle is, or may be, in the air on our orders."""
        if self.phase is FlightPhase.PREPARING:
            return self.preparation is not None and self.preparation.engaged
        return self.phase in (
            FlightPhase.HOVERING,
            FlightPhase.FLYING,
            FlightPhase.HOLDING,
            FlightPhase.RETURNING,
        )

    def expects(self, heartbeat: Heartbeat) -> bool:
        """Whether our orders lead to that mode."""
        mode = heartbeat.custom_mode
        if self.holding is not None:
            return not heartbeat.armed or self.holding.expects(mode)
        if self.returning is not None:
            return not heartbeat.armed or self.returning.expects(mode)
        return self.obeys(mode)

    @property
    def may_disarm(self) -> bool:
        """Whether our orders may lead to stopped motors."""
        if self.holding is not None:
            return self.returning is not None or not self.holding.aloft
        return self.phase in (FlightPhase.PREPARING, FlightPhase.RETURNING)

    def obeys(self, custom_mode: int) -> bool:
        """Whether the vehicle takes our orders in that mode, be it still taking off on one."""
        firmware = self._session.firmware
        return firmware is not None and (
            self._session.flies_for_us(custom_mode)
            or (firmware.is_taking_off(custom_mode) and self.took_off())
        )

    def took_off(self) -> bool:
        """Whether the preparation under way has asked for takeoff."""
        return self.preparation is not None and self.preparation.took_off

    def drop(self) -> None:
        """Give up whatever is under way; nothing is sent about it any more."""
        self.target = self.search = self.loss = self.explanation = None
        self.prepare = self.preparation = self.prepare_next = None
        self.returning = self.holding = None
        self._session.commands.cancel_all()

    def forget_preparation(self) -> None:
        """It is another kind of vehicle: what was begun in the terms of the last one ends."""
        self.preparation = None
        self._session.commands.cancel_all()

    def lose(self) -> None:
        """Command nothing any more to a vehicle that is not heard, and look for it."""
        loss = LinkLoss(self._session, tuple(self.sent_to_enu_m))
        self.hand_over(self._session.vehicle.silence(self._session.now_s), silent=True)
        self.loss = loss

    def take_back(self) -> None:
        """The vehicle obeys as it did before it was lost."""
        self.loss = None
        self.phase = FlightPhase.HOVERING

    def hand_over(self, reason: str, *, silent: bool = False) -> None:
        """Command nothing any more."""
        self.drop()
        if self._session.mission is not None:
            self._session.mission.abort(reason)
        self.phase = FlightPhase.HANDED_OVER
        self._session.report(HandedOver(reason, silent))

    def tell_not_ready(self, reason: str) -> None:
        """What the vehicle is waited for, once."""
        if reason != self._told_not_ready:
            self._told_not_ready = reason
            self._session.report(NotReady(reason))

    def tell_caution(self, reason: str) -> None:
        """What people should know of the vehicle, once."""
        if reason != self._told_caution:
            self._told_caution = reason
            self._session.report(Caution(reason))

    def tell_anew(self) -> None:
        """Another wait begins."""
        self._told_not_ready = self._told_caution = None


class OrderHandler:
    """Handles the orders to one vehicle.

    Args:
        session: with the vehicle.
        activity: what they begin.
    """

    def __init__(self, session: VehicleSession, activity: Activity) -> None:
        self._session = session
        self._activity = activity

    def obey(self, order: VehicleOrder) -> None:
        """Carry an order out, or refuse it."""
        match order:
            case Prepare():
                self.begin_preparation(order)
            case GoTo():
                self._go_to(order)
            case Hold():
                self._hold(order)
            case Return():
                self.return_home(order)

    def begin_preparation(self, order: Prepare) -> None:
        """Prepare a vehicle for flight; one that takes no targets is stopped first."""
        activity = self._activity
        if fault := _fault_of(order, self._session.config):
            self._session.report(Refused(order, fault))
            return
        if self._must_stop_first() and not self._session.silent:
            self._hold(Hold("to be prepared anew"))
            activity.prepare_next = order
            return
        ours = activity.in_our_hands()
        activity.drop()
        self._session.forget_mission()
        self._session.safety.begin()
        activity.phase = FlightPhase.PREPARING
        activity.prepare, activity.prepares_ours = order, ours
        activity.speed_m_s = order.speed_m_s
        activity.sent_to_enu_m.append(order.position_enu_m)
        activity.tell_anew()

    def _must_stop_first(self) -> bool:
        """Whether the vehicle flies on our orders, but takes no targets."""
        firmware, heartbeat = self._session.firmware, self._session.vehicle.heartbeat
        return (
            self._activity.phase in (FlightPhase.RETURNING, FlightPhase.HOLDING)
            and firmware is not None
            and heartbeat is not None
            and heartbeat.armed
            and not firmware.is_commanded(heartbeat.custom_mode)
            and self._session.vehicle.landed is not Landed.ON_GROUND
        )

    def _go_to(self, order: GoTo) -> None:
        activity = self._activity
        by_mission = self._session.mission is not None and activity.returning is None
        takes_targets = activity.phase in (FlightPhase.HOVERING, FlightPhase.FLYING) or (
            activity.phase is FlightPhase.HOLDING and (by_mission or not self._must_stop_first())
        )
        if not takes_targets or self._session.firmware is None:
            self._session.report(Refused(order, f"the vehicle is {activity.phase.value}"))
            return
        if fault := _fault_of(order, self._session.config):
            self._session.report(Refused(order, fault))
            return
        if activity.holding is not None:
            activity.drop()
        activity.target = Target(order, self._session, self._session.firmware, activity.speed_m_s)
        activity.phase = FlightPhase.FLYING
        activity.sent_to_enu_m.append(order.position_enu_m)
        activity.target.start()

    def _hold(self, order: Hold) -> None:
        activity = self._activity
        if activity.phase is FlightPhase.HANDED_OVER:
            self._session.report(Refused(order, f"the vehicle is {activity.phase.value}"))
        elif not activity.in_our_hands():
            # It may fly on the orders of an earlier life, or be somebody else's.
            activity.drop()
            activity.phase = FlightPhase.IDLE
            self._look_first(order)
        elif self._session.silent:
            self._session.report(Refused(order, "the autopilot is silent"))
        elif activity.returning is None or self._session.vehicle.armed:
            self.begin_holding(order)

    def begin_holding(self, order: Hold) -> None:
        """Stop a vehicle that flies on our orders, or is about to."""
        activity = self._activity
        firmware, heartbeat = self._session.firmware, self._session.vehicle.heartbeat
        if firmware is None or heartbeat is None:
            return
        took_off, returning = activity.took_off(), activity.returning
        motors_asked = activity.preparation is not None and activity.preparation.engaged
        leaves = modes_to_leave(
            firmware,
            heartbeat.custom_mode,
            took_off=took_off,
            on_missions=self._session.mission is not None
            and (activity.phase is not FlightPhase.PREPARING or self._session.mission.may_be_flown),
            returning=returning is not None,
        )
        activity.drop()
        activity.returning = returning  # goes on if the vehicle cannot be stopped
        if self._session.mission is not None:
            self._session.mission.suspend()
        activity.holding = Holding(
            order,
            self._session.config,
            self._session.commands,
            firmware,
            activity.speed_m_s,
            leaves,
            motors_asked=motors_asked,
        )
        activity.phase = FlightPhase.HOLDING

    def return_home(self, order: Return) -> None:
        """Bring a vehicle home, unless it is down, somebody else's, or not known well enough."""
        activity = self._activity
        if activity.phase is FlightPhase.RETURNING:
            if order.via_enu_m is None and activity.returning is not None:
                self._session.say(*activity.returning.go_straight(self._session.now_s))
            return
        in_air = (FlightPhase.HOVERING, FlightPhase.FLYING, FlightPhase.HOLDING)
        took_off = activity.phase in in_air or activity.took_off()
        motors_asked_for = activity.preparation is not None and activity.preparation.engaged
        firmware, heartbeat, holding = (
            self._session.firmware,
            self._session.vehicle.heartbeat,
            activity.holding,
        )
        activity.drop()
        activity.phase = FlightPhase.IDLE
        if firmware is None or heartbeat is None:
            if order.resume:
                self._look_first(order)
            else:
                self._session.report(Home())
            return
        mode = heartbeat.custom_mode
        if self._session.flies_unknown_mission():
            self._look_first(order)
            return
        taking_off = firmware.is_taking_off(mode) and (took_off or order.resume)
        on_mission = self._session.mission is not None and (
            self._session.flies_for_us(mode) or (holding is not None and holding.expects(mode))
        )
        commanded = firmware.is_commanded(mode) or taking_off or on_mission
        if self._session.mission is not None:
            self._session.say(*self._session.mission.call_off(self._session.now_s))
        aloft = heartbeat.armed and (
            took_off or firmware.airborne(self._session.vehicle) is not False
        )
        if not aloft:
            # That it was armed may not have been heard yet.
            if commanded and (heartbeat.armed or motors_asked_for):
                self._session.say(
                    *self._session.commands.send("disarm", firmware.disarm(), self._session.now_s)
                )
            self._session.report(Home())
            return
        if self._session.silent:
            self.refuse_return(order, "the autopilot is silent")
        elif not (commanded or firmware.is_returning(mode)):
            activity.hand_over(f"its pilot flies it in {firmware.mode_name(mode)}")
        else:
            self.come_home(order, firmware)

    def come_home(self, order: Return, firmware: Firmware) -> None:
        """Bring home a vehicle that flies and obeys, or returns already."""
        self._activity.returning = Returning(
            order,
            self._session.config,
            self._session.commands,
            firmware,
            from_mission=self._session.mission is not None,
            return_via=self._return_via(order, firmware),
        )
        self._activity.phase = FlightPhase.RETURNING

    def _return_via(self, order: Return, firmware: Firmware) -> ReturnVia | None:
        """The way to where the order says to fly first; None if there is none to be taken."""
        session, via_enu_m = self._session, order.via_enu_m
        heartbeat, config = session.vehicle.heartbeat, session.config
        place_enu_m = session.position_filter.place_m(session.now_s - config.stream_timeout_s)
        if via_enu_m is None or heartbeat is None or place_enu_m is None:
            return None
        mode = heartbeat.custom_mode
        obeys = firmware.is_commanded(mode) or firmware.is_mission(mode)
        if not (obeys and firmware.airborne(session.vehicle)) or config.out_of_bounds(via_enu_m):
            return None
        return ReturnVia(
            via_enu_m,
            place_enu_m,
            self._activity.speed_m_s,
            config,
            session.commands,
            firmware,
            session.now_s,
        )

    def refuse_return(self, order: Return, reason: str) -> None:
        """Say that it cannot be brought home, and leave it alone."""
        self._activity.phase = FlightPhase.HANDED_OVER
        self._session.report(Refused(order, reason))

    def _look_first(self, order: Return | Hold) -> None:
        """Carry the order out once it is known what the vehicle does."""
        self._activity.search = VehicleSearch(order, self._session)
        self._activity.tell_anew()

    def hold_found(self, order: Hold) -> None:
        """Stop a vehicle that an earlier life left in the air."""
        firmware, heartbeat = self._session.firmware, self._session.vehicle.heartbeat
        aloft = self._session.vehicle.landed is not Landed.ON_GROUND
        if firmware is None or heartbeat is None or not (heartbeat.armed and aloft):
            self._session.report(Held())
            return
        mode = heartbeat.custom_mode
        if self._session.flies_for_us(mode) or firmware.is_taking_off(mode):
            self.begin_holding(order)
        else:
            name = firmware.mode_name(mode)
            self._session.report(Refused(order, f"its pilot flies it in {name}"))


def _fault_of(order: Prepare | GoTo, config: BridgeConfig) -> str | None:
    """Why an order must not be carried out, in words; None if it may be."""
    if fault := config.out_of_bounds(order.position_enu_m):
        return fault
    match order:
        case Prepare(speed_m_s=speed_m_s) if not (math.isfinite(speed_m_s) and speed_m_s > 0.0):
            return f"speed {speed_m_s} m/s is not > 0"
        case GoTo(stay_s=stay_s) if not (math.isfinite(stay_s) and stay_s >= 0.0):
            return f"a stay of {stay_s} s is not >= 0"
        case _:
            return None
