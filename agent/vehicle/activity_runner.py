"""How the activity of one vehicle goes on: by what it says, and by time.

Passes both to the machine at work, and ends or follows up what that has done; tells if the
vehicle flies more slowly than it was told. Leaves out: what begins an activity
(agent.vehicle.activity) and what is heard (agent.vehicle.bridge).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from agent.core.interface import (
    HandedOver,
    Held,
    Hold,
    Home,
    Refused,
    Return,
    ReturnAdvised,
    ReturnBegun,
    VehicleReady,
)
from agent.vehicle.activity import Activity, FlightPhase, OrderHandler
from agent.vehicle.commands import CommandEnded
from agent.vehicle.messages import Inbound, Landed, Position
from agent.vehicle.preparation import Preparation
from agent.vehicle.session import VehicleSearch, VehicleSession
from swarm.protocol.timing import earliest

__all__ = ["ActivityRunner", "CruiseWatch"]


Point = tuple[float, float, float]


_POLL_S = 0.25
"""While something is waited for, look that often even if nothing is heard."""


class ActivityRunner:
    """Carries on the activity of one vehicle.

    Args:
        session: with the vehicle.
        activity: what is under way.
        order_handler: for what follows of itself.
    """

    def __init__(
        self, session: VehicleSession, activity: Activity, order_handler: OrderHandler
    ) -> None:
        self._session = session
        self._activity = activity
        self._order_handler = order_handler
        self._cruise = CruiseWatch()
        self._raises_jerk = False

    # What the vehicle says.

    def on_message(self, message: Inbound) -> None:
        """Pass on what is no heartbeat, position or acknowledgement."""
        if self._activity.preparation is not None:
            self._session.say(*self._activity.preparation.on_message(message, self._session.now_s))
        if self._session.mission is not None:
            self._session.say(*self._session.mission.on_message(message, self._session.now_s))
        if self._session.override is not None:
            self._session.override.on_message(message)
        if self._activity.target is not None:
            self._activity.target.on_message(message)
            self._judge_target()

    def on_position(self, position: Position, place_enu_m: Point) -> None:
        """Take a fresh position."""
        now_s = self._session.now_s
        if self._activity.preparation is not None:
            self._session.say(*self._activity.preparation.on_position(position, now_s))
        if self._activity.holding is not None:
            self._activity.holding.on_position(position)
        elif self._activity.returning is not None:
            self._activity.returning.on_position(place_enu_m, position.velocity_enu_m_s, now_s)
        if self._session.mission is not None:
            self._session.mission.on_position(place_enu_m, now_s)
        if self._activity.target is not None:
            velocity_enu_m_s, told_m_s = position.velocity_enu_m_s, self._activity.speed_m_s
            if remark := self._cruise.judge(velocity_enu_m_s, told_m_s, now_s):
                self._activity.tell_caution(remark)
            self._activity.target.on_position(place_enu_m, velocity_enu_m_s)
            self._judge_target()

    def on_ended(self, ended: Sequence[CommandEnded]) -> None:
        """Take the outcomes of commands."""
        now_s = self._session.now_s
        for one in ended:
            if self._activity.preparation is not None:
                self._session.say(*self._activity.preparation.on_ended(one, now_s))
            if self._activity.returning is not None:
                self._activity.returning.on_ended(one, now_s)
            if self._activity.holding is not None:
                self._activity.holding.on_ended(one, now_s)
            if self._session.mission is not None:
                self._session.mission.on_ended(one, now_s)
            if self._activity.target is not None:
                self._activity.target.on_ended(one)
                self._judge_target()

    def on_reboot(self) -> None:
        """The autopilot began anew."""
        if self._activity.in_our_hands():
            self._activity.hand_over("the autopilot rebooted")
        self._activity.preparation, self._activity.prepares_ours = None, False

    # What time brings.

    def advance(self) -> None:
        """Do what time and state ask for."""
        if not self._session.silent:
            self._advance_mission()
            self._advance_override()
        match self._activity.phase:
            case FlightPhase.PREPARING:
                self._advance_preparation()
            case FlightPhase.HOLDING:
                self._advance_holding()
            case FlightPhase.RETURNING:
                self._advance_return()
            case _ if self._activity.search is not None:
                self._advance_search(self._activity.search)
            case _:
                pass

    def next_deadline_s(self) -> float:
        """When `advance` may have something to do."""
        session, now_s, mission = self._session, self._session.now_s, self._session.mission
        busy = self._activity.phase in (
            FlightPhase.PREPARING,
            FlightPhase.HOLDING,
            FlightPhase.RETURNING,
        )
        starting = mission is not None and mission.is_starting
        if busy or self._activity.search is not None or starting:
            return now_s + _POLL_S
        at_s = None if mission is None else mission.next_deadline_s()
        override = None if session.silent else session.override
        due_s = earliest(at_s, None if override is None else override.next_deadline_s())
        return math.inf if due_s is None else max(due_s, now_s)

    def _advance_preparation(self) -> None:
        heartbeat, order = self._session.vehicle.heartbeat, self._activity.prepare
        if order is None:
            return
        if (reason := self._session.missing()) is not None:
            self._activity.tell_not_ready(reason)
            return
        if heartbeat is None or self._session.firmware is None:
            return
        if self._activity.preparation is None:
            self._activity.preparation = Preparation(
                order,
                self._session.config,
                self._session.commands,
                self._session.firmware,
                self._session.safety,
                self._session.mission,
                ours=self._activity.prepares_ours,
            )
        preparation = self._activity.preparation
        self._session.say(
            *preparation.advance(self._session.vehicle, heartbeat, self._session.now_s)
        )
        if preparation.caution is not None:
            self._activity.tell_caution(preparation.caution)
        if preparation.failure is not None:
            aloft = heartbeat.armed and self._session.firmware.airborne(self._session.vehicle)
            obeys = self._activity.obeys(heartbeat.custom_mode)
            self._activity.drop()
            if aloft and obeys:
                self._activity.phase = FlightPhase.HOVERING  # nobody else would bring it down
                self._session.report(ReturnAdvised(preparation.failure))
            else:
                self._activity.phase = FlightPhase.IDLE
                if self._session.mission is not None:
                    self._session.mission.stand_down()  # an upload is still ended, never left half
                self._session.report(Refused(order, preparation.failure))
        elif preparation.done:
            self._activity.drop()
            self._activity.phase = FlightPhase.HOVERING
            if self._session.mission is not None:
                self._session.mission.wait_there()
            self._session.report(VehicleReady())
        else:
            self._activity.tell_not_ready(preparation.waiting_for)

    def _advance_search(self, search: VehicleSearch) -> None:
        """Return or stop the vehicle once it is found; it has its time to be."""
        order, reason = search.order, search.advance()
        if reason is None:
            self._activity.search = None
            if isinstance(order, Return):
                self._order_handler.return_home(order)
            else:
                self._order_handler.hold_found(order)
        elif not search.in_vain:
            self._activity.tell_not_ready(reason)
        else:
            self._activity.drop()
            if isinstance(order, Return):
                self._order_handler.refuse_return(order, reason)
            else:
                self._session.report(Refused(order, reason))

    def _advance_mission(self) -> None:
        mission, firmware = self._session.mission, self._session.firmware
        heartbeat, heard_s = self._session.vehicle.heartbeat, self._session.vehicle.heartbeat_at_s
        if mission is None or firmware is None or heartbeat is None or heard_s is None:
            return
        self._session.say(*mission.advance(heartbeat, heard_s, self._session.now_s))
        self._judge_target()
        if self._activity.phase not in (FlightPhase.HOVERING, FlightPhase.FLYING):
            return
        if mission.coming_home:
            reason = "nothing followed its last target in time, so it comes home by itself"
            self._activity.drop()
            self._session.say(*mission.call_off(self._session.now_s))
            self._session.report(ReturnAdvised(reason))
            self._order_handler.come_home(Return(reason), firmware)
        elif mission.unverified:
            self._order_handler.begin_holding(Hold("which mission it flies is not known"))

    def _advance_override(self) -> None:
        """Raise the limit of jerk from its preparation on, until it is told to go home."""
        session, activity, returning = self._session, self._activity, self._activity.returning
        flies_home = returning is not None and not returning.on_detour
        if activity.phase is FlightPhase.PREPARING:
            self._raises_jerk = True
        elif flies_home or not activity.in_our_hands():
            self._raises_jerk = False
        if session.override is None:
            return
        session.override.want(self._raises_jerk and activity.in_our_hands())
        session.say(*session.override.advance(session.now_s))
        if complaint := session.override.take_complaint():
            self._activity.tell_caution(complaint)

    def _advance_holding(self) -> None:
        holding, heartbeat = self._activity.holding, self._session.vehicle.heartbeat
        if holding is None or heartbeat is None:
            return
        session = self._session
        session.say(
            *holding.advance(session.vehicle, heartbeat, session.position_filter, session.now_s)
        )
        if not holding.done and holding.failure is None:
            return
        prepare, returning, mission = (
            self._activity.prepare_next,
            self._activity.returning,
            self._session.mission,
        )
        self._activity.drop()
        self._activity.phase = FlightPhase.HOVERING if holding.aloft else FlightPhase.IDLE
        if holding.failure is None and mission is not None:
            mission.stand_down()
        elif mission is not None and returning is None:
            mission.carry_on()
        if holding.failure is not None:
            failure = self._session.in_its_words(holding.failure)
            self._session.report(Refused(holding.order, failure))
            if prepare is not None:
                self._session.report(Refused(prepare, failure))
            if returning is not None:
                self._activity.returning, self._activity.phase = returning, FlightPhase.RETURNING
                self._session.say(*returning.go_straight(self._session.now_s))
        elif prepare is not None:
            self._order_handler.begin_preparation(prepare)
        elif returning is not None and not holding.aloft:
            self._session.report(Home())  # it landed before it could be stopped
        else:
            self._session.report(Held())

    def _advance_return(self) -> None:
        returning, heartbeat = self._activity.returning, self._session.vehicle.heartbeat
        if returning is None or heartbeat is None:
            return
        self._session.say(*returning.advance(heartbeat, self._session.now_s))
        if returning.has_begun():
            self._session.report(ReturnBegun())
        on_ground = self._session.vehicle.landed in (Landed.ON_GROUND, Landed.UNDEFINED)
        if not heartbeat.armed and (on_ground or returning.disarmed_long(self._session.now_s)):
            self._activity.drop()
            self._activity.phase = FlightPhase.IDLE
            self._session.report(Home())
        elif returning.failure is not None:
            self._activity.drop()
            self._activity.phase = FlightPhase.HOVERING
            failure = self._session.in_its_words(returning.failure)
            self._session.report(Refused(returning.order, failure))

    def _judge_target(self) -> None:
        outcome = None if self._activity.target is None else self._activity.target.outcome()
        if outcome is None:
            return
        if isinstance(outcome, HandedOver):
            self._activity.hand_over(outcome.reason)
            return
        self._activity.target = None
        self._activity.phase = FlightPhase.HOVERING
        if self._session.mission is not None:
            self._session.mission.wait_there()
        self._session.report(outcome)


_STEADY_S = 3.0
"""A speed kept for that long is the one that is flown."""

_STEADY_FRAC = 0.03
"""How much a steady speed may change meanwhile."""

_SHORT_FRAC = 0.9
"""Of the speed told, below which it is not reached."""

_LEAST_FRAC = 0.3
"""Of the speed told, below which the vehicle is doing something else than cruising."""

_STEEPEST = 0.3
"""Climb per way flown, beyond which the climb sets the speed."""


class CruiseWatch:
    """Compares steady ground speeds with the one told, and says once when they fall short."""

    def __init__(self) -> None:
        self._since_s = math.inf
        self._first_m_s = 0.0
        self._told = False

    def judge(
        self, velocity_enu_m_s: tuple[float, float, float], told_m_s: float, now_s: float
    ) -> str | None:
        """Take a velocity on the way to a target; what to tell people, or None.

        Args:
            velocity_enu_m_s: over ground [m/s].
            told_m_s: cruise speed that was asked for [m/s].
            now_s: now.
        """
        east_m_s, north_m_s, up_m_s = velocity_enu_m_s
        speed_m_s = math.hypot(east_m_s, north_m_s)
        cruising = speed_m_s >= _LEAST_FRAC * told_m_s and abs(up_m_s) <= _STEEPEST * speed_m_s
        steady = abs(speed_m_s - self._first_m_s) <= _STEADY_FRAC * self._first_m_s
        if self._told or not cruising or not steady or speed_m_s >= _SHORT_FRAC * told_m_s:
            self._since_s, self._first_m_s = now_s, speed_m_s
            return None
        if now_s - self._since_s < _STEADY_S:
            return None
        self._told = True
        return (
            f"it flies at {speed_m_s:.1f} m/s, asked for {told_m_s:g}: its own limits forbid more"
        )
